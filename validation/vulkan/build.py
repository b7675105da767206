"""The Vulkan build: the passes of `beams` in WGSL through wgpu, headless, on whatever Vulkan device there is.

The same passes as the OpenGL build's and the same inputs (`validation/gl/case.py`), by another driver, another shading
language and another compiler.  Coordinates are per pixel.
"""

from __future__ import annotations

import contextlib
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("LP_NUM_THREADS", "1")  # lavapipe reads it once
os.environ.setdefault("XDG_RUNTIME_DIR", "/tmp")  # Mesa asks for one, and never writes there

import wgpu
from wgpu.backends.wgpu_native.extras import set_instance_extras

from atmoref.stages.beam_planes import BeamUniforms
from atmoref.stages.main_plane import DT_PAPER
from atmoref.stages.opaque import PRINTED_G, SATURATING
from validation.gl.case import DEPTH_TOP, Case, Light, Passes, Unsupported, inputs
from validation.vulkan.programs import Program, buffer, solid_buffers, uniforms

FEATURES = (
    "float32-blendable", "float32-filterable", "texture-format16bit-norm", "texture-adapter-specific-format-features",
)  # fmt: skip
KINDS = {"unorm8": ("8unorm", np.uint8), "unorm16": ("16unorm", np.uint16), "float16": ("16float", np.float16),
         "float32": ("32float", np.float32)}  # fmt: skip
PLANE = np.dtype([("depth", "f4"), ("z", "f4"), ("share", "f4")])
SCREEN = np.array([(0.0, 0.0, 0.0)], PLANE)


class Missing(RuntimeError):
    """There is no Vulkan device, or it has not what the build needs."""


def context() -> Any:
    """Return a Vulkan device with the formats of the build.

    Raises
    ------
    Missing
        If there is none.
    """
    with contextlib.suppress(RuntimeError):  # of a second call: the instance is there
        set_instance_extras(backends=["Vulkan"])  # OpenGL's would take the thread's context from another program
    for adapter in wgpu.gpu.enumerate_adapters_sync():
        if adapter.info["backend_type"] == "Vulkan" and set(FEATURES) <= set(adapter.features):
            return adapter.request_device_sync(required_features=list(FEATURES))
    raise Missing("no Vulkan device that blends and filters 32-bit floats")


def name_of(device: Any) -> str:
    """Return what the driver calls its device."""
    info = device.adapter.info
    return f"{info['device']}, {info['description']}"


def by_division(depths: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the codes of depths that are code / 16777215."""
    return np.rint(depths.astype(np.float64) * DEPTH_TOP).astype(np.uint32)


def by_product(depths: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the codes of depths that are code x float32(1 / 16777215), rounded to float32."""
    codes = by_division(depths)
    for less in (0, 1, 2):
        tried = np.maximum(codes.astype(np.int64) - less, 0).astype(np.uint32)
        right = tried.astype(np.float32) * np.float32(1.0 / DEPTH_TOP) == depths
        codes = np.where(right & (codes < DEPTH_TOP), tried, codes)
    return codes


class Build(Passes):
    """A scene on the device.  Arrays that come and go are (H, W, C), row 0 at the bottom.

    Raises
    ------
    Unsupported
        For the previous method, and for coordinates per vertex.
    """

    def __init__(self, device: Any, case: Case) -> None:
        self.device, self.case = device, case
        if "f_h" not in case.setting.formats:
            raise Unsupported(f"{case.scene.origin}: the Vulkan build draws beams, not {case.technique}")
        if any(light.given["uniforms"].slab_switches.vertex for light in case.lights):
            raise Unsupported(f"{case.scene.origin}: the Vulkan build needs coordinates = pixel")
        self._programs: dict[tuple[Any, ...], Program] = {}
        self.samplers = {
            "smooth_filter": device.create_sampler(mag_filter="linear", min_filter="linear"),
            "pcf": device.create_sampler(mag_filter="linear", min_filter="linear", compare="less-equal"),
            "nearest": device.create_sampler(compare="less-equal"),
        }
        self.screen = buffer(device, SCREEN)
        self._decode = self._depth_rule()
        self.depth = self.depth_texture(case.size)
        self.frame, self.fast = self._target("frame"), self._target("f_h")
        self.lights = [LightOnDevice(self, light) for light in case.lights]

    # ---- objects
    def depth_texture(self, size: tuple[int, int]) -> Any:
        """Return a 24-bit depth buffer that shaders can read."""
        usage = wgpu.TextureUsage.RENDER_ATTACHMENT | wgpu.TextureUsage.TEXTURE_BINDING
        return self.device.create_texture(size=(*size, 1), format="depth24plus", usage=usage)

    def texture(self, values: NDArray[Any], fmt: str) -> Any:
        """Return a texture of codes or values (H, W, C): one channel, or four."""
        kind, storage = KINDS[fmt]
        height, width, given = values.shape
        channels = 1 if given == 1 else 4
        data = np.zeros((height, width, channels), storage)
        data[..., :given] = values
        usage = wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST
        prefix = "r" if channels == 1 else "rgba"
        made = self.device.create_texture(size=(width, height, 1), format=prefix + kind, usage=usage)
        self._upload(made, data)
        return made

    def _upload(self, texture: Any, data: NDArray[Any]) -> None:
        height, width, channels = data.shape
        layout = {"bytes_per_row": width * channels * data.itemsize, "rows_per_image": height}
        self.device.queue.write_texture({"texture": texture}, data.tobytes(), layout, (width, height, 1))

    def _download(self, texture: Any, storage: Any, channels: int) -> NDArray[Any]:
        width, height = texture.size[:2]
        layout = {"bytes_per_row": width * channels * np.dtype(storage).itemsize, "rows_per_image": height}
        data = self.device.queue.read_texture({"texture": texture}, layout, (width, height, 1))
        return np.frombuffer(data, storage).reshape(height, width, channels)

    def _target(self, name: str) -> Any:
        """Return an RGBA target in a buffer's format."""
        kind, _ = KINDS[self.case.setting.formats[name].name]
        return self._colour("rgba" + kind, self.case.size)

    def _colour(self, kind: str, size: tuple[int, int]) -> Any:
        usage = wgpu.TextureUsage
        every = usage.RENDER_ATTACHMENT | usage.TEXTURE_BINDING | usage.COPY_SRC | usage.COPY_DST
        return self.device.create_texture(size=(*size, 1), format=kind, usage=every)

    # ---- drawing
    def draw(
        self, name: str, given: dict[str, Any], switches: dict[str, int], *, colour: Any = None, depth: Any = None,
        write_depth: bool = False, blend: bool = False, clear: bool = False, planes: tuple[int, int] = (0, 1),
    ) -> None:  # fmt: skip
        """Draw planes [first, end) of a light over a whole target in one pass."""
        state = "none" if depth is None else "write" if write_depth else "test"
        target = None if colour is None else colour.format
        key = (name, target, state, blend, *sorted(switches.items()))
        if key not in self._programs:
            self._programs[key] = Program(self.device, name, switches, target, state, blend)
        program = self._programs[key]
        encoder = self.device.create_command_encoder()
        colours = []
        if colour is not None:
            load = "clear" if clear else "load"
            colours = [
                {"view": colour.create_view(), "load_op": load, "store_op": "store", "clear_value": (0, 0, 0, 0)}
            ]
        attachment = None
        if depth is not None:
            ops = {
                "depth_load_op": "clear" if write_depth else "load",
                "depth_store_op": "store",
                "depth_clear_value": 1.0,
            }
            attachment = {"view": depth.create_view(), **ops}
        drawn = encoder.begin_render_pass(color_attachments=colours, depth_stencil_attachment=attachment)
        drawn.set_pipeline(program.pipeline)
        drawn.set_bind_group(0, program.bind(given))
        for plane in range(*planes):
            drawn.draw(4, 1, 0, plane)
        drawn.end()
        self.device.queue.submit([encoder.finish()])

    def _depths(self, texture: Any) -> NDArray[np.float32]:
        """Return a depth buffer as its shaders see it (H, W, 1)."""
        shown = self._colour("r32float", texture.size[:2])
        self.draw("read_depth.wgsl", {"depths": texture.create_view(), "planes": self.screen}, {}, colour=shown)
        return self._download(shown, np.float32, 1)

    def _depth_rule(self) -> Any:
        """Return how a depth is turned into its code on this device: the rule that gives back what was put in.

        A shader cannot see the code itself. It sees code / 16777215, or code times the float32 next to 1 / 16777215,
        by which depths near 1 seem one or two codes farther (and the last two codes are one).
        """
        probes = np.array([0, 1, 8388607, 8388609, 12582911, 12582913, 16777001, DEPTH_TOP], np.uint32).reshape(
            1, -1, 1
        )
        texture = self.depth_texture((probes.size, 1))
        self.put_depth(texture, probes)
        seen = self._depths(texture)
        for rule in (by_division, by_product):
            if np.array_equal(rule(seen), probes):
                return rule
        raise Missing(f"depths come back as {seen.ravel().tolist()}, by a rule that this build does not know")

    def read_depth(self, texture: Any) -> NDArray[Any]:
        """Return the codes of a depth buffer (H, W, 1)."""
        found: NDArray[Any] = self._decode(self._depths(texture))
        return found

    def put_depth(self, texture: Any, codes: NDArray[Any]) -> None:
        """Replace a depth buffer by codes (H, W, 1)."""
        source = self.texture(codes / DEPTH_TOP, "float32").create_view()
        self.draw("put_depth.wgsl", {"codes": source, "planes": self.screen}, {}, depth=texture, write_depth=True)

    def read(self, name: str) -> NDArray[Any]:
        """Return frame or f_h as (H, W, 3) codes or values, or depth as (H, W, 1) codes."""
        if name == "depth":
            return self.read_depth(self.depth)
        _, storage = KINDS[self.case.setting.formats[name].name]
        data = self._download(self.frame if name == "frame" else self.fast, storage, 4)
        return np.ascontiguousarray(data[..., :3])

    def write(self, name: str, values: NDArray[Any]) -> None:
        """Replace frame, f_h or depth by the mirror's."""
        if name == "depth":
            self.put_depth(self.depth, values)
            return
        _, storage = KINDS[self.case.setting.formats[name].name]
        data = np.zeros((*values.shape[:2], 4), storage)
        data[..., :3] = values
        self._upload(self.frame if name == "frame" else self.fast, data)

    # ---- passes
    def draw_base(self) -> None:
        """Draw depth and ambient term of the opaque scene."""
        given = inputs(self.case.base)
        block, shader = given["blocks"][0], "opaque_base.wgsl"
        solids = solid_buffers(self.device, given["eye_solids"], (np.zeros(0), np.zeros(0)))
        held = {
            **solids, "planes": self.screen, "camera": uniforms(self.device, shader, "Camera", block.camera),
            "surface": uniforms(self.device, shader, "Surface", block.surface),
        }  # fmt: skip
        switches = {"SATURATING_AMBIENT": int(block.surface_switches.ambient == SATURATING)}
        self.draw(shader, held, switches, colour=self.frame, depth=self.depth, write_depth=True)


class LightOnDevice:
    """One light: its textures, planes and passes."""

    def __init__(self, owner: Build, light: Light) -> None:
        self.owner, self.light = owner, light
        self.given = light.given
        self.uniforms: BeamUniforms = self.given["uniforms"]
        self.draws = draws = self.given["draws"]
        size = inputs(light.shadow)["size"]
        self.shadow = owner.depth_texture((size, size))
        sub = np.zeros(len(draws.z), PLANE)
        sub["depth"], sub["z"], sub["share"] = draws.depth / DEPTH_TOP, draws.z, draws.share
        main = np.zeros(len(draws.main_z), PLANE)
        main["depth"], main["z"] = draws.main_depth / DEPTH_TOP, draws.main_z
        self.sub, self.main = buffer(owner.device, sub), buffer(owner.device, main)
        self.held = self._held()

    def _held(self) -> dict[str, Any]:
        """Return everything that a pass of this light may read."""
        owner, case, device = self.owner, self.owner.case, self.owner.device
        pcf = self.given["stage"].params.shadow_filter == "pcf"
        spot = self.given["spot"]
        held = {
            "compare": owner.samplers["pcf" if pcf else "nearest"], "smooth_filter": owner.samplers["smooth_filter"],
            "shadow_map": self.shadow.create_view(), "fast_map": owner.fast.create_view(),
            "camera": uniforms(device, "main_plane.wgsl", "Camera", self.uniforms.camera),
            "slab": uniforms(device, "main_plane.wgsl", "Slab", self.uniforms.slab),
            "spot": uniforms(device, "sub_plane.wgsl", "Spot", self.uniforms.spot),
            **solid_buffers(device, spot.solids, (spot.solids.grounds, spot.solids.ground_ids)),
        }  # fmt: skip
        none = owner.texture(np.zeros((1, 1, 1)), "unorm8").create_view()
        for name, key in (("light_map", "light_map"), ("q_map", "q"), ("q_rest", "q_rest")):
            full = f"{self.light.prefix}/{key}"
            fmt = case.setting.formats["q" if key.startswith("q") else key].name if full in case.bank else ""
            held[name] = owner.texture(case.codes(full), fmt).create_view() if fmt else none
        return held

    def _switches(self) -> dict[str, int]:
        slab, switches = self.uniforms.slab_switches, self.uniforms.switches
        return {
            "PARALLEL": int(switches.parallel), "UNBOUNDED": int(switches.unbounded),
            "GREY_LIGHT": int(switches.grey_light), "GREY_FOG": int(slab.grey), "PHASE": int(slab.phase),
            "COSINE": int(slab.dt_mode != DT_PAPER), "Q_REST": int(slab.rest),
        }  # fmt: skip

    # ---- pass 1
    def draw_shadow_map(self) -> None:
        """Draw the scene's depth as the light sees it."""
        owner, given = self.owner, inputs(self.light.shadow)
        shadow = uniforms(owner.device, "shadow_map.wgsl", "Shadow", given["uniforms"])
        held = {**self.held, "planes": owner.screen, "shadow": shadow}
        owner.draw("shadow_map.wgsl", held, self._switches(), depth=self.shadow, write_depth=True)

    def read_shadow_map(self) -> NDArray[Any]:
        """Return depth codes (size, size, 1)."""
        return self.owner.read_depth(self.shadow)

    def write_shadow_map(self, codes: NDArray[Any]) -> None:
        """Take the mirror's."""
        self.owner.put_depth(self.shadow, codes)

    # ---- pass 3
    def draw_opaque(self) -> None:
        """Blend the light that surfaces reflect into the frame."""
        if self.light.opaque is None:
            return
        owner, shader, given = self.owner, "opaque_light.wgsl", inputs(self.light.opaque)
        block, spot = given["blocks"][self.given["spot"].index], self.given["spot"]
        seen = solid_buffers(owner.device, given["eye_solids"], (spot.solids.grounds, spot.solids.ground_ids))
        held = {
            **self.held, **seen, "planes": owner.screen,
            "surface": uniforms(owner.device, shader, "Surface", block.surface),
        }  # fmt: skip
        switches = self._switches() | {
            "PRINTED_FOG": int(block.surface_switches.fog == PRINTED_G), "PHASE": int(block.surface_switches.phase),
        }  # fmt: skip
        owner.draw(shader, held, switches, colour=owner.frame, blend=True)

    # ---- passes 4 and 5
    def draw_planes(self) -> None:
        """Draw all slabs."""
        for k in range(len(self.draws.main_z)):
            self.draw_sub_planes(k)
            self.draw_main_plane(k)

    def draw_sub_planes(self, k: int) -> None:
        """Clear f_h and gather the sub-planes of slab k."""
        owner, span = self.owner, (int(self.draws.first[k]), int(self.draws.first[k + 1]))
        held = {**self.held, "planes": self.sub}
        target = {"colour": owner.fast, "depth": owner.depth}
        owner.draw("sub_plane.wgsl", held, self._switches(), **target, blend=True, clear=True, planes=span)

    def draw_main_plane(self, k: int) -> None:
        """Blend f_h c_k q of slab k into the frame."""
        owner, held = self.owner, {**self.held, "planes": self.main}
        target = {"colour": owner.frame, "depth": owner.depth}
        owner.draw("main_plane.wgsl", held, self._switches(), **target, blend=True, planes=(k, k + 1))
