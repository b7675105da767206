"""Light beams by the previous method [Dobashi 2002, sec. 4.1]: many planes, g dt at the vertices, no tables.

Kept because the artefacts that the paper repairs are its own: ghost shadows with few planes, pseudo-contours with many.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.lanes import N
from atmoref.numerics.vectors import minus
from atmoref.optics.phase_functions import PHASE_FUNCTIONS
from atmoref.pipeline import Bank, Pass
from atmoref.stages.beam_planes import COUNTERS, PROBE, BeamUniforms
from atmoref.stages.vertex_colour import VertexUniforms
from atmoref.stages.vertex_colour import vertex_colours as fill_colours
from atmoref.stages.vertex_planes import VertexDraws, vertex_planes
from atmoref.techniques import beams
from atmoref.techniques.beam_plan import base_distance, extent
from atmoref.techniques.beams_parameters import BeamsVertexParameters
from atmoref.techniques.light_frames import light_frame, shadow_far
from atmoref.techniques.opaque_passes import (
    HOST_BYTES,
    Spotlight,
    Stage,
    opaque_passes,
    shadow_passes,
    spotlight,
)
from atmoref.techniques.setting import Setting
from atmoref.techniques.spotlights import camera_uniforms

NAME = "beams_vertex"
Parameters = BeamsVertexParameters
_PAPER = {
    "frame": "unorm8", "light_map": "unorm8", "vertex_colour": "frame", "depth": "depth24", "shadow_map": "depth24",
}  # fmt: skip
BUFFERS: dict[str, dict[str, str]] = {
    "paper": _PAPER, "corrected": _PAPER, "analysis": dict.fromkeys(_PAPER, "float64"),
}  # fmt: skip


def plane_depths(near_m: float, far_m: float, params: BeamsVertexParameters) -> tuple[NDArray[np.float64], float]:
    """Return the depths of the planes and their spacing, metres; none when the pyramid has no extent."""
    if far_m <= near_m:
        return np.zeros(0), 1.0
    dt = (far_m - near_m) / params.planes
    shift = 0.5 if params.plane_positions == "mid" else 0.0
    return near_m + dt * (np.arange(params.planes, dtype=np.float64) + shift), dt


def vertex_colours(stage: Stage, spot: Spotlight, z: NDArray[np.float64], dt_m: float) -> NDArray[np.float64]:
    """Return g dt at the mesh vertices of every plane as stored colours, flat [channel, plane, vertex] [eq. 3]."""
    scene, params = stage.scene, stage.params
    if params.coordinates != "vertex" or not len(z):
        return np.zeros(1)
    ex, ey = beams.mesh_rays(scene, params.mesh)
    count = ex.size
    padding = np.zeros(-count % N)
    medium = scene.medium
    uniforms = VertexUniforms(
        camera_uniforms(scene), *minus(scene.camera.position_m, spot.frame.position), dt_m, medium.phase_function.g,
        -1.0 if params.scattering_angle == "backward" else 1.0, *spot.frame.axis,
    )  # fmt: skip
    channels = 1 if spot.switches.grey_fog else 3
    needed = channels * len(z) * count * HOST_BYTES
    stage.setting.account.require(needed, f"technique.mesh = {list(params.mesh)} with {len(z)} planes")
    colours = np.zeros(channels * len(z) * count + N)
    fill_colours(
        colours, np.concatenate([ex, padding]), np.concatenate([ey, padding]), z,
        np.array(medium.extinction_per_m[:channels]), np.array(spot.sources[:channels]), uniforms,
        PHASE_FUNCTIONS[medium.phase_function.type], int(params.dt_mode != "paper"),
        spot.switches.parallel, count,
    )  # fmt: skip
    return beams.encoded(stage.setting, "vertex_colour", colours[:-N])


def planes_pass(
    stage: Stage, spot: Spotlight, z: NDArray[np.float64], dt_m: float, counters: NDArray[np.int64], probe: Any
) -> Pass:
    """Return the pass that draws all planes of one light."""
    setting, scene, params = stage.setting, stage.scene, stage.params
    slab = beams.slab_uniforms(stage, spot, dt_m, (0.0,) * 6)
    choices = beams.slab_switches(stage, spot, params, exact_q=False, rest=False)
    uniforms = BeamUniforms(camera_uniforms(scene, stage.shift), spot.uniforms, slab, spot.switches, choices)
    codes = beams.window_codes(scene, z, setting.formats["depth"])
    draws = VertexDraws(z.astype(setting.dtype), codes.astype(setting.dtype))
    colours = vertex_colours(stage, spot, z, dt_m).astype(setting.dtype)
    frame, depth, rules = stage.bank["frame"], stage.bank["depth"], setting.rules("frame")
    grid = beams.mesh_grid(stage)

    def execute(d0: int, d1: int, row0: int, row1: int) -> None:
        trace = probe is not None
        vertex_planes(
            frame.data, depth.data, counters, probe if trace else np.zeros(1), setting.arith, setting.form, rules,
            uniforms, spot.textures(), colours, grid, spot.solids, draws, stage.window(d0, d1, row0, row1, trace=trace),
        )  # fmt: skip

    names = tuple(f"{spot.prefix}/plane_{k:03d}" for k in range(len(z)))
    return Pass(f"{spot.prefix}/planes", names, frame.height, execute, ("frame",) * len(z), stage.rows())


def build(
    setting: Setting, params: BeamsVertexParameters, *, trace: bool = False
) -> tuple[list[Pass], Bank, dict[str, Any]]:
    """Return the passes of a scene, their buffers, and what was decided; see `beams.build`."""
    scene, bank = setting.scene, Bank()
    stage = Stage(setting, params, bank)
    setting.target(bank, "frame", "frame", scene.image.width, scene.image.height)
    setting.depth_target(bank, "depth", "depth", scene.image.width, scene.image.height)
    passes: list[Pass] = []
    bases = []
    for index in range(len(scene.lights)):
        own = light_frame(scene, index)
        bases.append(base_distance(scene, own, params, index))
        far = shadow_far(scene, own, bases[-1])
        stage.spots.append(spotlight(stage, index, far))
        passes += shadow_passes(stage, stage.spots[-1], far)
    passes += opaque_passes(stage)
    report: dict[str, Any] = {"lights": [], "counters": [], "probe": []}
    for spot, base_m in zip(stage.spots, bases, strict=True):
        near, far = extent(scene, spot.frame, base_m, params.bounds)
        z, dt = plane_depths(near, far, params)
        counters = np.zeros((scene.image.height, COUNTERS), np.int64)
        probe = np.zeros(max(len(z), 1) * len(PROBE) * N) if trace else None
        passes.append(planes_pass(stage, spot, z, dt, counters, probe))
        report["counters"].append(counters)
        report["probe"].append(probe)
        report["lights"].append(
            {
                "interval_m": dt,
                "main_planes": len(z),
                "sub_planes": 0,
                "depth_m": [near, far],
                "base_distance_m": base_m,
            }
        )
    return passes, bank, report
