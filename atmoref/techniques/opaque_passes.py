"""Passes that both light-beam techniques share: shadow maps, their upload as textures, the opaque scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from atmoref.buffers.blend import Mixed
from atmoref.numerics.vectors import Vec3
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene
from atmoref.stages.beam_planes import Window
from atmoref.stages.opaque import OpaqueUniforms, opaque_base, opaque_light
from atmoref.stages.ray_cast import Solids
from atmoref.stages.shadow_map import shadow_map
from atmoref.stages.spot_light import Maps, Spot, Switches
from atmoref.techniques.light_frames import LightFrame, ParallelFrame, light_frame
from atmoref.techniques.setting import Setting
from atmoref.techniques.spotlights import (
    all_equal,
    camera_uniforms,
    solids,
    source,
    surface_uniforms,
    switches,
)
from atmoref.techniques.triangle_passes import (
    OCCLUDER_BYTES,
    TriangleSet,
    axes,
    camera_view,
    no_surfaces,
    shadow_view,
    triangle_pass,
    with_occluders,
    with_parallel_occluders,
)

if TYPE_CHECKING:
    from atmoref.scene import Light
    from atmoref.techniques.beams_parameters import SpotlightParameters


HOST_BYTES = 48  # per texel and channel of a table: float64 while it is computed, codes, padded texture


@dataclass(slots=True)
class Spotlight:
    """One light of a render: its frame, its uniforms, and its textures once they have been drawn."""

    index: int
    light: Light
    frame: LightFrame
    sources: Vec3
    uniforms: Spot
    switches: Switches
    solids: Solids
    maps: Maps | None = None

    @property
    def prefix(self) -> str:
        """Start of the names of its draws and buffers."""
        return f"light_{self.index}"

    def textures(self) -> Maps:
        """Return shadow map and light map; they exist after the upload pass."""
        if self.maps is None:
            raise RuntimeError(f"{self.prefix}: its textures are read before the upload pass")
        return self.maps


@dataclass(slots=True)
class Stage:
    """What passes of one render share."""

    setting: Setting
    params: SpotlightParameters
    bank: Bank
    shift: tuple[float, float] = (0.0, 0.0)  # of pixel centres: an interleaved image's place in the whole
    spots: list[Spotlight] = field(default_factory=list)
    triangle_set: TriangleSet | None = None  # of the scene, made when first asked for

    def triangles(self) -> TriangleSet:
        """Return the scene's triangles."""
        if self.triangle_set is None:
            self.triangle_set = TriangleSet.of(self.scene, self.setting.dtype)
        return self.triangle_set

    @property
    def scene(self) -> Scene:
        """The question."""
        return self.setting.scene

    def window(self, d0: int, d1: int, row0: int, row1: int, *, trace: bool = False) -> Window:
        """Return the uniforms of one call."""
        column0, column1, _, _ = self.setting.window()
        frame = self.bank["frame"]
        return Window(column0, column1, row0, row1, frame.height, frame.pitch, d0, d1, int(trace))

    def rows(self) -> tuple[int, int]:
        """Return the rows to draw."""
        return self.setting.window()[2:]


def spotlight(stage: Stage, index: int, far_m: float) -> Spotlight:
    """Return one light of the scene, ready for its passes; `far_m` is the far plane of its shadow map."""
    scene, params = stage.scene, stage.params
    light = scene.lights[index]
    frame = light_frame(scene, index)
    sources = source(scene, light, params)
    grey_fog = all_equal(sources, scene.medium.extinction_per_m)
    target = "f_h" if "f_h" in stage.setting.formats else "frame"
    objects = solids(scene, frame.position)
    if params.visibility == "exact" and stage.triangles().count:
        needed = stage.triangles().count * OCCLUDER_BYTES
        stage.setting.account.require(needed, f"exact visibility of {stage.triangles().count} triangles", keep=True)
        if isinstance(frame, ParallelFrame):
            view = axes(frame.position, frame.right, frame.up, frame.axis)
            objects = with_parallel_occluders(objects, stage.triangles(), view, stage.setting.dtype)
        else:
            objects = with_occluders(objects, stage.triangles(), frame.position, stage.setting.dtype)
    same_rules = all(len(set(stage.setting.rules(name))) == 1 for name in (target, "light_map"))
    return Spotlight(
        index, light, frame, sources, frame.uniforms(scene, params, far_m),
        switches(frame, params, same_rules, grey_fog), objects,
    )  # fmt: skip


def shadow_passes(stage: Stage, spot: Spotlight, far_m: float) -> list[Pass]:
    """Return the passes that make one light's shadow map and light map and hand them to the texture units."""
    setting, params = stage.setting, stage.params
    passes: list[Pass] = []
    shadow_key, light_key = f"{spot.prefix}/shadow_map", f"{spot.prefix}/light_map"
    if params.visibility == "shadow_map":
        size = params.shadow_map_size
        buffer = setting.depth_target(stage.bank, "shadow_map", shadow_key, size, size)
        uniforms = spot.frame.shadow_uniforms(size, params.shadow_near_m, far_m)
        depth_rule = setting.rules("shadow_map")[0]
        surfaces = no_surfaces(setting)
        if stage.triangles().count:
            name = f"{shadow_key}/triangles"
            view = shadow_view(uniforms, spot.frame.position, "parallel" if spot.frame.parallel else "perspective")
            surfaces, drawn = triangle_pass(setting, stage.bank, stage.triangles(), name, name, view, (size, size))
            passes.append(drawn)

        def draw(d0: int, d1: int, row0: int, row1: int) -> None:
            shadow_map(
                buffer.data, setting.arith, Mixed(), depth_rule, uniforms, spot.switches.parallel, spot.solids,
                surfaces, buffer.pitch, size, row0, row1,
            )  # fmt: skip

        passes.append(Pass(shadow_key, (shadow_key,), size, draw, (shadow_key,)))
    if not spot.switches.exact_distribution:
        edge = params.light_map_size
        if spot.frame.picture is None:
            setting.account.require(3 * edge * edge * HOST_BYTES, f"technique.light_map_size = {edge}")
        texels = spot.frame.light_map(edge)
        if texels.ndim == 2 and not spot.switches.grey_light:  # stages read a channel each
            texels = np.repeat(texels[..., None], 3, -1)
        setting.image(stage.bank, "light_map", light_key, texels)

    def upload(d0: int, d1: int, row0: int, row1: int) -> None:
        bank = stage.bank
        blank = setting.blank(1.0, setting.formats["depth"])
        shadow = setting.texture(bank[shadow_key], params.shadow_filter) if shadow_key in bank else blank
        light = setting.texture(bank[light_key]) if light_key in bank else blank
        spot.maps = Maps(shadow, light)

    name = f"{spot.prefix}/upload"
    passes.append(Pass(name, (name,), 1, upload, (light_key,)))
    return passes


def opaque_passes(stage: Stage) -> list[Pass]:
    """Return the passes of the opaque scene: depth and ambient term, then one additive pass a light."""
    setting, scene = stage.setting, stage.scene
    eye_solids = solids(scene, scene.camera.position_m)
    frame, depth = stage.bank["frame"], stage.bank["depth"]
    camera = camera_uniforms(scene, stage.shift)
    frame_rules, depth_rule = setting.rules("frame"), setting.rules("depth")[0]
    blocks = {}
    for spot in stage.spots:
        surface, choices = surface_uniforms(scene, spot.light, stage.params)
        blocks[spot.index] = OpaqueUniforms(camera, spot.uniforms, surface, spot.switches, choices)

    passes: list[Pass] = []
    surfaces = no_surfaces(setting)
    if stage.triangles().count:
        surfaces, drawn = triangle_pass(
            setting, stage.bank, stage.triangles(), "opaque/triangles", "opaque/triangles/depth",
            camera_view(camera, scene.camera.position_m), (frame.width, frame.height),
            lambda row0, row1: stage.window(0, 1, row0, row1), stage.rows(),
        )  # fmt: skip
        passes.append(drawn)

    def base(d0: int, d1: int, row0: int, row1: int) -> None:
        opaque_base(
            frame.data, depth.data, setting.arith, (setting.form, Mixed()), (frame_rules, depth_rule),
            blocks[0], eye_solids, surfaces, stage.window(d0, d1, row0, row1),
        )  # fmt: skip

    passes.append(Pass("opaque", ("opaque",), frame.height, base, ("frame",), stage.rows()))
    if not scene.objects:
        return passes
    for spot in stage.spots:

        def light(d0: int, d1: int, row0: int, row1: int, spot: Spotlight = spot) -> None:
            opaque_light(
                frame.data, setting.arith, setting.form, frame_rules, blocks[spot.index], spot.textures(), eye_solids,
                surfaces, spot.solids, stage.window(d0, d1, row0, row1),
            )  # fmt: skip

        name = f"{spot.prefix}/opaque"
        passes.append(Pass(name, (name,), frame.height, light, ("frame",), stage.rows()))
    return passes
