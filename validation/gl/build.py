"""The OpenGL build: the paper's passes on a real device, headless.

Textures and frame buffers as a program of 2002 would have them: a shadow map of depth24, an RGBA frame and an RGBA f_h
that share one depth buffer, planes drawn as rectangles that cover the screen (or as meshes), additive blending, depth
test on and depth writes off.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("LP_NUM_THREADS", "1")  # llvmpipe reads it once, before its first context

import moderngl

from atmoref.stages.beam_planes import BeamUniforms
from atmoref.stages.main_plane import DT_PAPER
from atmoref.stages.opaque import PRINTED_G, SATURATING
from validation.gl import programs
from validation.gl.case import DEPTH_TOP, Case, Light, Passes, inputs
from validation.gl.geometry import hull, pyramid_rectangles
from validation.gl.mesh import MeshOnDevice

KINDS = {"unorm8": ("f1", np.uint8), "unorm16": ("nu2", np.uint16), "float16": ("f2", np.float16),
         "float32": ("f4", np.float32)}  # fmt: skip
QUAD = np.array([-1, -1, 1, -1, -1, 1, 1, 1], "f4")


def context() -> Any:
    """Return a headless context with no state but this build's."""
    ctx = moderngl.create_context(standalone=True, backend="egl")
    ctx.disable(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
    ctx.blend_func = moderngl.ONE, moderngl.ONE
    return ctx


def window_to_ndc(codes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return z of normalised device coordinates that the rasteriser turns into depth codes (exact in float32)."""
    return 2.0 * (codes / DEPTH_TOP) - 1.0


def read_depth(texture: Any, width: int, height: int) -> NDArray[Any]:
    """Return the codes of a depth texture, (H, W, 1)."""
    values = np.frombuffer(texture.read(alignment=1), np.float32).reshape(height, width, 1)
    return np.rint(values.astype(np.float64) * DEPTH_TOP).astype(np.uint32)


class Build(Passes):
    """A scene on the device.  Arrays that come and go are (H, W, C), row 0 at the bottom.

    Parameters
    ----------
    ctx : moderngl.Context
    case : Case
    native_exp : bool
        exp of the device instead of the mirror's.
    discard : bool
        Fragments without light are discarded before the blend.
    scissor : bool
        Sub-planes and planes are drawn inside the screen rectangle of the light's pyramid only.
    mesh_in_shader : bool
        The fragment interpolates between mesh vertices, within the triangle, instead of the rasteriser by its own rule.
    """

    def __init__(
        self, ctx: Any, case: Case, *, native_exp: bool = False, discard: bool = True, scissor: bool = False,
        mesh_in_shader: bool = False,
    ) -> None:  # fmt: skip
        self.ctx, self.case = ctx, case
        self._programs: dict[tuple[Any, ...], Any] = {}
        self._arrays: dict[tuple[Any, ...], Any] = {}
        self._build_switches = {"NATIVE_EXP": int(native_exp), "DISCARD": int(discard)}
        self.scissor, self.mesh_in_shader = scissor, mesh_in_shader
        self._quad = ctx.buffer(QUAD.tobytes())
        width, height = case.size
        self.depth = ctx.depth_texture((width, height))
        self.depth_target = ctx.framebuffer([], self.depth)
        self.frame = self._target("frame")
        self.fast = self._target("f_h") if "f_h" in case.setting.formats else None
        self.lights = [LightOnDevice(self, light) for light in case.lights]

    # ---- objects
    def texture(self, codes: NDArray[Any], fmt: str, channels: int, linear: bool = True) -> Any:
        """Return a texture of codes or values (H, W, C)."""
        dtype, storage = KINDS[fmt]
        data = np.zeros((*codes.shape[:2], channels), storage)
        data[..., : codes.shape[2]] = codes
        height, width = codes.shape[:2]
        made = self.ctx.texture((width, height), channels, data.tobytes(), alignment=1, dtype=dtype)
        mode = moderngl.LINEAR if linear else moderngl.NEAREST
        made.filter, made.repeat_x, made.repeat_y = (mode, mode), False, False
        return made

    def _target(self, name: str) -> Any:
        """Return an RGBA frame buffer in a buffer's format, with the common depth buffer."""
        dtype, _ = KINDS[self.case.setting.formats[name].name]
        colour = self.ctx.texture(self.case.size, 4, dtype=dtype)
        colour.filter = moderngl.NEAREST, moderngl.NEAREST
        return self.ctx.framebuffer([colour], self.depth)

    def program(self, vertex: str, fragment: str, switches: dict[str, int]) -> Any:
        """Return a program, built once for each set of switches."""
        key = (vertex, fragment, *sorted(switches.items()))
        if key not in self._programs:
            self._programs[key] = programs.build(self.ctx, vertex, fragment, {**self._build_switches, **switches})
        return self._programs[key]

    def cover(self, program: Any) -> None:
        """Draw a rectangle that covers the target."""
        if program not in self._arrays:
            self._arrays[program] = self.ctx.vertex_array(program, [(self._quad, "2f", "corner")])
        self._arrays[program].render(moderngl.TRIANGLE_STRIP)

    # ---- state between passes
    def aim(self, target: Any, *, test: bool, blend: bool) -> None:
        """Bind a target with its state; planes test depth and never write it."""
        target.depth_mask = not test
        target.use()
        self.ctx.depth_func = "<" if test else "1"
        self.ctx.enable(moderngl.DEPTH_TEST)
        (self.ctx.enable if blend else self.ctx.disable)(moderngl.BLEND)

    def read(self, name: str) -> NDArray[Any]:
        """Return frame or f_h as (H, W, 3) codes or values, or depth as (H, W, 1) codes."""
        width, height = self.case.size
        if name == "depth":
            return read_depth(self.depth, width, height)
        target = self.frame if name == "frame" else self.fast
        _, storage = KINDS[self.case.setting.formats[name].name]
        data = np.frombuffer(target.color_attachments[0].read(alignment=1), storage).reshape(height, width, 4)
        return np.ascontiguousarray(data[..., :3])

    def write(self, name: str, values: NDArray[Any]) -> None:
        """Replace frame, f_h or depth by the mirror's."""
        if name == "depth":
            self.put_depth(self.depth_target, values)
            return
        target = self.frame if name == "frame" else self.fast
        _, storage = KINDS[self.case.setting.formats[name].name]
        data = np.zeros((*values.shape[:2], 4), storage)
        data[..., :3] = values
        target.color_attachments[0].write(data.tobytes(), alignment=1)

    def put_depth(self, target: Any, codes: NDArray[Any]) -> None:
        """Replace the depth buffer of a target by codes (H, W, 1): drawn, since uploads go through other rules."""
        source = self.texture(codes / DEPTH_TOP, "float32", 1, linear=False)
        program = self.program("fullscreen.vert", "put_depth.frag", {})
        source.use(0)
        programs.put(program, "codes", 0)
        self.aim(target, test=False, blend=False)
        self.cover(program)

    # ---- passes
    def draw_base(self) -> None:
        """Draw depth and ambient term of the opaque scene."""
        given = inputs(self.case.base)
        uniforms, solids = given["blocks"][0], given["eye_solids"]
        switches = {
            **programs.solid_counts(solids),
            "SATURATING_AMBIENT": int(uniforms.surface_switches.ambient == SATURATING),
        }
        program = self.program("fullscreen.vert", "opaque_base.frag", switches)
        programs.put_all(program, uniforms._asdict(), ("camera", "surface"))
        programs.put_solids(program, solids)
        self.aim(self.frame, test=False, blend=False)
        self.cover(program)


class LightOnDevice:
    """One light: its textures, meshes and passes."""

    def __init__(self, owner: Build, light: Light) -> None:
        self.owner, self.light = owner, light
        case = owner.case
        self.given = light.given
        self.uniforms: BeamUniforms = self.given["uniforms"]
        self.draws = self.given["draws"]
        self.size = inputs(light.shadow)["size"]
        self.shadow = owner.ctx.depth_texture((self.size, self.size))
        self.shadow.compare_func = "<="
        pcf = self.given["stage"].params.shadow_filter == "pcf"
        mode = moderngl.LINEAR if pcf else moderngl.NEAREST
        self.shadow.filter, self.shadow.repeat_x, self.shadow.repeat_y = (mode, mode), False, False
        self.shadow_target = owner.ctx.framebuffer([], self.shadow)
        self.maps = {}
        for name, key in (("light_map", "light_map"), ("q_map", "q"), ("q_rest", "q_rest")):
            if f"{light.prefix}/{key}" in case.bank:
                texels = case.codes(f"{light.prefix}/{key}")
                fmt = case.setting.formats["q" if key.startswith("q") else key].name
                self.maps[name] = owner.texture(texels, fmt, 1 if texels.shape[2] == 1 else 4)
        self.mesh = MeshOnDevice(owner.ctx, self.given) if self.uniforms.slab_switches.vertex else None
        self.rectangles = None
        if owner.scissor and not self.uniforms.switches.parallel:
            self.rectangles = pyramid_rectangles(self.uniforms, self.draws.z, case.size)

    def _switches(self) -> dict[str, int]:
        slab = self.uniforms.slab_switches
        vertex = 2 * slab.vertex if self.owner.mesh_in_shader else slab.vertex
        return {
            "PARALLEL": self.uniforms.switches.parallel, "UNBOUNDED": self.uniforms.switches.unbounded,
            "LIGHT_GROUNDS": len(self.given["spot"].solids.grounds),
            "GREY_LIGHT": self.uniforms.switches.grey_light, "GREY_FOG": slab.grey, "PHASE": slab.phase,
            "COSINE": int(slab.dt_mode != DT_PAPER), "VERTEX": vertex, "Q_REST": slab.rest,
            "MESH_X": slab.mesh_x, "MESH_Y": slab.mesh_y,
        }  # fmt: skip

    def _program(self, fragment: str, *, mesh: bool = False, more: dict[str, int] | None = None) -> Any:
        """Return a program of this light with its uniforms and textures bound."""
        switches = {**self._switches(), **(more or {})}
        program = self.owner.program("mesh.vert" if mesh else "fullscreen.vert", fragment, switches)
        programs.put_all(program, self.uniforms._asdict(), ("camera", "spot", "slab"))
        solids = self.given["spot"].solids
        programs.put_array(program, "light_grounds", solids.grounds)
        programs.put_array(program, "light_ground_ids", solids.ground_ids, "i4")
        textures = {"shadow_map": self.shadow, **self.maps}
        if self.owner.fast is not None:
            textures["fast_map"] = self.owner.fast.color_attachments[0]
        for unit, (name, made) in enumerate(textures.items()):
            if name in program:
                made.use(unit)
                program[name].value = unit
        return program

    # ---- pass 1
    def draw_shadow_map(self) -> None:
        """Draw the scene's depth as the light sees it."""
        given = inputs(self.light.shadow)
        solids = self.given["spot"].solids
        switches = {**programs.solid_counts(solids), "PARALLEL": self.uniforms.switches.parallel}
        program = self.owner.program("fullscreen.vert", "shadow_map.frag", switches)
        programs.put(program, "shadow", given["uniforms"])
        programs.put_solids(program, solids)
        self.owner.aim(self.shadow_target, test=False, blend=False)
        self.owner.cover(program)

    def read_shadow_map(self) -> NDArray[Any]:
        """Return depth codes (size, size, 1)."""
        return read_depth(self.shadow, self.size, self.size)

    def write_shadow_map(self, codes: NDArray[Any]) -> None:
        """Take the mirror's."""
        self.owner.put_depth(self.shadow_target, codes)

    # ---- pass 3
    def draw_opaque(self) -> None:
        """Blend the light that surfaces reflect into the frame."""
        if self.light.opaque is None:
            return
        given = inputs(self.light.opaque)
        uniforms, solids = given["blocks"][self.given["spot"].index], given["eye_solids"]
        more = {
            **programs.solid_counts(solids), "PRINTED_FOG": int(uniforms.surface_switches.fog == PRINTED_G),
            "PHASE": uniforms.surface_switches.phase,
        }  # fmt: skip
        program = self._program("opaque_light.frag", more=more)
        programs.put(program, "surface", uniforms.surface)
        programs.put_solids(program, solids)
        self.owner.aim(self.owner.frame, test=False, blend=True)
        self.owner.frame.depth_mask = False
        self.owner.cover(program)

    # ---- passes 4 and 5
    def _rasterises_mesh(self) -> bool:
        return self.mesh is not None and not self.owner.mesh_in_shader

    def _draw_plane(self, program: Any, k: int) -> None:
        """Draw a plane as a mesh or as a rectangle."""
        if self.mesh is None:
            self.owner.cover(program)
        elif self.owner.mesh_in_shader:
            self.mesh.bind(0)
            programs.put(program, "plane_index", k)
            self.owner.cover(program)
        else:
            self.mesh.draw(program, k)

    def draw_planes(self) -> None:
        """Draw all slabs, or all planes of the previous method."""
        if self.owner.fast is None:
            self.draw_vertex_planes(0, len(self.draws.z))
            return
        for k in range(len(self.draws.main_z)):
            self.draw_sub_planes(k)
            self.draw_main_plane(k)

    def draw_sub_planes(self, k: int) -> None:
        """Clear f_h and gather the sub-planes of slab k."""
        owner, draws = self.owner, self.draws
        program = self._program("sub_plane.frag")
        owner.aim(owner.fast, test=True, blend=True)
        owner.fast.clear(0.0, 0.0, 0.0, 0.0)
        depth, z, share = program["plane_depth"], program["plane_z"], program["share"]
        for s in range(int(draws.first[k]), int(draws.first[k + 1])):
            depth.value, z.value, share.value = window_to_ndc(draws.depth[s]), draws.z[s], draws.share[s]
            owner.fast.scissor = self.rectangles[s] if self.rectangles else None
            owner.cover(program)
        owner.fast.scissor = None

    def draw_main_plane(self, k: int) -> None:
        """Blend f_h c_k q of slab k into the frame."""
        owner, draws = self.owner, self.draws
        program = self._program("main_plane.frag", mesh=self._rasterises_mesh())
        owner.aim(owner.frame, test=True, blend=True)
        programs.put(program, "plane_depth", window_to_ndc(draws.main_depth[k]))
        programs.put(program, "plane_z", draws.main_z[k])
        if self.rectangles:
            owner.frame.scissor = hull(self.rectangles[int(draws.first[k]) : int(draws.first[k + 1])])
        self._draw_plane(program, k)
        owner.frame.scissor = None

    def draw_vertex_planes(self, d0: int, d1: int) -> None:
        """Blend planes [d0, d1) of the previous method into the frame."""
        owner, draws = self.owner, self.draws
        program = self._program("vertex_plane.frag", mesh=self._rasterises_mesh())
        owner.aim(owner.frame, test=True, blend=True)
        for k in range(d0, d1):
            programs.put(program, "plane_depth", window_to_ndc(draws.depth[k]))
            programs.put(program, "plane_z", draws.z[k])
            owner.frame.scissor = self.rectangles[k] if self.rectangles else None
            self._draw_plane(program, k)
        owner.frame.scissor = None

    def draw_attributes(self, k: int) -> NDArray[np.float32]:
        """Return u, v and two colour channels of plane k at every pixel, as the rasteriser interpolates them."""
        owner = self.owner
        width, height = owner.case.size
        texture = owner.ctx.texture((width, height), 4, dtype="f4")
        target = owner.ctx.framebuffer([texture])
        program = owner.program("mesh.vert", "attributes.frag", {})
        owner.aim(target, test=False, blend=False)
        self.mesh.draw(program, k)
        return np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)
