"""Light beams with main planes, sub-planes and a q table [Dobashi, Yamamoto, Nishita 2002, sec. 4.2].

Passes, in GPU order: for each light its shadow map and the upload of its textures; the opaque scene with fog; for each
light, slab after slab, the sub-planes into f_h and the main plane f_h c_k q into the frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.formats import Format, decode, encode
from atmoref.elementary import exp
from atmoref.lanes import N
from atmoref.numerics.quadrature import gauss_legendre
from atmoref.numerics.vectors import cross, dot, minus
from atmoref.optics.phase_functions import PHASE_FUNCTIONS
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene, SceneError
from atmoref.stages.beam_planes import COUNTERS, PROBE, BeamUniforms, beam_planes
from atmoref.stages.main_plane import DT_COSINE, DT_EXACT, DT_PAPER, Grid, Mesh, QMaps, Slab, SlabSwitches
from atmoref.stages.sub_plane import Draws
from atmoref.tables.q import QDomain, q_table
from atmoref.techniques.beam_plan import BeamPlan, base_distance, beam_plan, fogs, q_domain, sunlight
from atmoref.techniques.beams_parameters import BeamsParameters, SpotlightParameters
from atmoref.techniques.light_frames import ParallelFrame, PointFrame, light_frame, shadow_far
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

NAME = "beams"
Parameters = BeamsParameters
TEXTURES = {"q": "unorm8", "light_map": "unorm8", "vertex_colour": "frame"}
BUFFERS: dict[str, dict[str, str]] = {
    "paper": {"frame": "unorm8", "f_h": "frame", **TEXTURES, "depth": "depth24", "shadow_map": "depth24"},
    "corrected": {"frame": "unorm8", "f_h": "frame", **TEXTURES, "depth": "depth24", "shadow_map": "depth24"},
    "analysis": dict.fromkeys(("frame", "f_h", "q", "light_map", "vertex_colour", "depth", "shadow_map"), "float64"),
}
DT_MODES = {"paper": DT_PAPER, "cosine": DT_COSINE, "exact": DT_EXACT}
NODES = {"float32": 16, "float64": 32, "interval": 16}


def window_codes(scene: Scene, depths_m: NDArray[np.float64], fmt: Format) -> NDArray[np.float64]:
    """Return window depth of screen-parallel planes, in the units of the depth buffer (nearest code)."""
    camera = camera_uniforms(scene)
    with np.errstate(divide="ignore"):
        window = np.clip(camera.depth_a - camera.depth_b / np.maximum(depths_m, 1e-6), 0.0, 1.0)
    return np.rint(window * fmt.top) if fmt.kind == "unorm" else window


def slab_uniforms(stage: Stage, spot: Spotlight, dt_m: float, table: tuple[float, ...]) -> Slab:
    """Return the uniforms of the fog between two planes; `table` is (su, ou, sv, ov, range, rest) of the q texture."""
    scene, params = stage.scene, stage.params
    right, up, forward = scene.camera.basis()
    offset = minus(scene.camera.position_m, spot.frame.position)
    cells = (params.mesh[0] / scene.image.width, params.mesh[1] / scene.image.height)
    cosine = -1.0 if params.scattering_angle == "backward" else 1.0
    return Slab._make((
        dt_m, *scene.medium.extinction_per_m, *spot.sources, scene.medium.phase_function.g, cosine, *table, *offset,
        *cross(offset, right), *cross(offset, up), *cross(offset, forward),
        *cells, *spot.frame.axis, cells[0] * stage.shift[0], cells[1] * stage.shift[1],
    ))  # fmt: skip


def slab_switches(
    stage: Stage, spot: Spotlight, params: SpotlightParameters, exact_q: bool, rest: bool
) -> SlabSwitches:
    """Return the uniform choices of the slab stages."""
    scene = stage.scene
    return SlabSwitches(
        PHASE_FUNCTIONS[scene.medium.phase_function.type], DT_MODES[params.dt_mode], int(exact_q), int(rest),
        int(params.coordinates == "vertex"), params.mesh[0], params.mesh[1], spot.switches.grey_fog,
        spot.switches.parallel,
        int(stage.setting.device.interpolation == "screen" and stage.setting.arithmetic == "float32"),
    )  # fmt: skip


def mesh_rays(scene: Scene, mesh: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return image-plane coordinates (ex, ey) of mesh vertices, flat, bottom row first."""
    camera = camera_uniforms(scene)
    x = (2.0 * np.arange(mesh[0] + 1) / mesh[0] - 1.0) * camera.tan_x
    y = (2.0 * np.arange(mesh[1] + 1) / mesh[1] - 1.0) * camera.tan_y
    return np.tile(x, mesh[1] + 1), np.repeat(y, mesh[0] + 1)


def encoded(setting: Setting, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values as a buffer format holds them (vertex colours, for example)."""
    fmt = setting.formats[name]
    return decode(encode(values, fmt, setting.device, rounding=setting.rounding_of(fmt)), fmt)


def mesh_grid(stage: Stage) -> Grid:
    """Return where mesh vertices stand on the screen, pixels: normalised coordinates in float32, one fused step."""
    dtype = stage.setting.dtype

    def axis(cells: int, size: int, shift: float) -> NDArray[Any]:
        start = cells / size * shift
        ndc = (2.0 * (np.arange(cells + 1) - start) / cells - 1.0).astype(np.float32).astype(np.float64)
        return (ndc * (0.5 * size) + 0.5 * size).astype(np.float32).astype(dtype)

    image, mesh = stage.scene.image, stage.params.mesh
    return Grid(axis(mesh[0], image.width, stage.shift[0]), axis(mesh[1], image.height, stage.shift[1]))


def vertex_mesh(stage: Stage, spot: Spotlight, plan: BeamPlan) -> Mesh:
    """Return the vertex attributes of every main plane: u, v, and c_k as a stored colour (D-E15)."""
    scene, params = stage.scene, stage.params
    if params.coordinates != "vertex":
        nothing = np.zeros(1, stage.setting.dtype)
        return Mesh(nothing, nothing, nothing, mesh_grid(stage))
    points = (params.mesh[0] + 1) * (params.mesh[1] + 1) * len(plan.main_z)
    stage.setting.account.require(points * 5 * HOST_BYTES, f"technique.mesh = {list(params.mesh)}")
    ex, ey = mesh_rays(scene, params.mesh)
    if isinstance(spot.frame, ParallelFrame):
        return _sun_mesh(stage, spot, spot.frame, plan, ex, ey)
    (right, up, forward), offset = scene.camera.basis(), minus(scene.camera.position_m, spot.frame.position)
    span = np.sqrt(1.0 + ex * ex + ey * ey)
    along = (ex * dot(offset, right) + ey * dot(offset, up) + dot(offset, forward)) / span
    crosses = [cross(offset, axis) for axis in (right, up, forward)]
    parts = [ex * crosses[0][i] + ey * crosses[1][i] + crosses[2][i] for i in range(3)]
    v = np.sqrt(parts[0] * parts[0] + parts[1] * parts[1] + parts[2] * parts[2]) / span
    z = plan.main_z[:, None]
    u = along + span * z
    factor = span if params.dt_mode == "cosine" else np.ones_like(span)
    sigmas = scene.medium.extinction_per_m[: 1 if spot.switches.grey_fog else 3]
    c = np.stack([exp(-sigma * (span * z)) * factor for sigma in sigmas])
    attributes = (u.ravel(), v, encoded(stage.setting, "vertex_colour", c).ravel())
    u_k, v_k, c_k = (array.astype(stage.setting.dtype) for array in attributes)
    return Mesh(u_k, v_k, c_k, mesh_grid(stage))


def _sun_mesh(
    stage: Stage,
    spot: Spotlight,
    frame: ParallelFrame,
    plan: BeamPlan,
    ex: NDArray[np.float64],
    ey: NDArray[np.float64],
) -> Mesh:
    """Return the vertex attributes of the sun: all of f_l, as a stored colour."""
    scene, params = stage.scene, stage.params
    path = np.sqrt(1.0 + ex * ex + ey * ey) * plan.main_z[:, None]
    factor = sunlight(scene, frame, spot.sources, params, plan.dt_m, ex, ey)
    sigmas = scene.medium.extinction_per_m[: 1 if spot.switches.grey_fog else 3]
    c = np.stack([exp(-sigma * path) * f for sigma, f in zip(sigmas, factor, strict=False)])
    colours = encoded(stage.setting, "vertex_colour", np.minimum(c, 1.0))
    nothing = np.zeros(1, stage.setting.dtype)
    return Mesh(nothing, nothing, colours.ravel().astype(stage.setting.dtype), mesh_grid(stage))


def q_textures(stage: Stage, spot: Spotlight, plan: BeamPlan, domain: QDomain) -> tuple[QMaps, float, float]:
    """Return the q textures, what 1 means in them, and what 1 means in the table of the rest (0 without one).

    clamped: min(q, i_max) / i_max, as published; bright parts near the light are lost.
    scaled: q over e^(sigma_t t) of the farthest plane: a greater q saturates the frame where f_h is 1.
    overflow: clamped, and a second channel with the rest up to `useful` = m e^(sigma_t t), m the greatest number of
    sub-planes: with a greater q one lit sub-plane saturates the frame.  All codes still serve the faint parts, and the
    second channel is exactly 0 there, so that a filter of 8 bits adds nothing.
    split: the same 16 bits as high and low byte of q / useful; finer, but an 8-bit filter rounds the high byte.
    unclamped: as it is (float formats).
    """
    setting, params = stage.setting, stage.params
    assert isinstance(params, BeamsParameters)
    blank = setting.blank(0.0, setting.formats["q"])
    if params.q == "exact" or not len(plan.main_z):
        return QMaps(blank, blank), 1.0, 0.0
    channels = range(1 if spot.switches.grey_fog else 3)
    fog = fogs(stage.scene, -1.0 if params.scattering_angle == "backward" else 1.0)
    needed = params.q_table_size**2 * len(channels) * HOST_BYTES
    setting.account.require(needed, f"technique.q_table_size = {params.q_table_size}")
    tables = {f: q_table(domain, plan.dt_m, f) for f in fog[: len(channels)]}
    q = np.stack([tables[fog[i]] * spot.sources[i] for i in channels], -1)
    farthest = max(stage.scene.medium.extinction_per_m) * plan.far_m
    opaque = float(exp(np.float64(min(farthest, 20.0))))
    useful = max(params.i_max, opaque * float(np.diff(plan.first).max()))
    key = f"{spot.prefix}/q"
    if params.q_storage == "unclamped":
        return QMaps(setting.texture(setting.image(stage.bank, "q", key, q)), blank), 1.0, 0.0
    if params.q_storage == "split":
        fine = np.minimum(q / useful, 1.0) * 255.0
        coarse = np.floor(fine)
        main = setting.image(stage.bank, "q", key, coarse / 255.0)
        rest = setting.image(stage.bank, "q", f"{spot.prefix}/q_rest", fine - coarse)
        return QMaps(setting.texture(main), setting.texture(rest)), useful, useful / 255.0
    top = max(params.i_max, opaque) if params.q_storage == "scaled" else params.i_max
    main = setting.image(stage.bank, "q", key, np.minimum(q, top) / top)
    if params.q_storage != "overflow" or useful <= top:
        return QMaps(setting.texture(main), blank), top, 0.0
    excess = np.clip((q - top) / (useful - top), 0.0, 1.0)
    rest = setting.image(stage.bank, "q", f"{spot.prefix}/q_rest", excess)
    return QMaps(setting.texture(main), setting.texture(rest)), top, useful - top


def draw_names(spot: Spotlight, plan: BeamPlan) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of all draws of one light in GPU order, and the buffer each stores into."""
    names: list[str] = []
    stores: list[str] = []
    for k in range(len(plan.main_z)):
        for j in range(int(plan.first[k + 1] - plan.first[k])):
            names.append(f"{spot.prefix}/slab_{k:03d}/sub_{j:03d}")
            stores.append("f_h")
        names.append(f"{spot.prefix}/slab_{k:03d}/main")
        stores.append("frame")
    return tuple(names), tuple(stores)


def slab_pass(stage: Stage, spot: Spotlight, plan: BeamPlan, counters: NDArray[np.int64], probe: Any) -> Pass:
    """Return the pass that draws all slabs of one light."""
    setting, scene, params = stage.setting, stage.scene, stage.params
    assert isinstance(params, BeamsParameters)
    table, rest = (0.0,) * 6, 0.0
    blank = setting.blank(0.0, setting.formats["q"])
    q = QMaps(blank, blank)
    if isinstance(spot.frame, PointFrame):
        if setting.intervals and params.q == "exact":
            raise SceneError(
                f'{scene.origin}: technique.q: found "exact" with buffers.arithmetic = "interval"; allowed: "table" '
                f"(a GPU reads q; its integral is the method's own analysis, in float64)"
            )
        domain = q_domain(spot.frame, plan.base_m, plan.dt_m, params)
        q, span, rest = q_textures(stage, spot, plan, domain)
        table = (*domain.scale_offset(), span, rest)
    slab = slab_uniforms(stage, spot, plan.dt_m, table)
    choices = slab_switches(stage, spot, params, params.q == "exact", rest > 0.0)
    uniforms = BeamUniforms(camera_uniforms(scene, stage.shift), spot.uniforms, slab, spot.switches, choices)
    depth_format = setting.formats["depth"]
    sub_depth = plan.sub_z if params.sub_plane_depth_test else plan.main_z[plan.sub_slab]
    uploaded = (
        plan.sub_z, window_codes(scene, sub_depth, depth_format), plan.share,
        plan.main_z, window_codes(scene, plan.main_z, depth_format),
    )  # fmt: skip
    draws = Draws(plan.first, *(array.astype(setting.dtype) for array in uploaded))
    mesh, quadrature = vertex_mesh(stage, spot, plan), gauss_legendre(NODES[setting.arithmetic])
    frame, fast, depth = stage.bank["frame"], stage.bank["f_h"], stage.bank["depth"]
    rules = (setting.rules("frame"), setting.rules("f_h"))

    def execute(d0: int, d1: int, row0: int, row1: int) -> None:
        trace = probe is not None
        beam_planes(
            frame.data, fast.data, depth.data, counters, probe if trace else np.zeros(1), setting.arith, setting.form,
            rules, uniforms, spot.textures(), q, mesh, quadrature, spot.solids, draws,
            stage.window(d0, d1, row0, row1, trace=trace),
        )  # fmt: skip

    names, stores = draw_names(spot, plan)
    return Pass(f"{spot.prefix}/slabs", names, frame.height, execute, stores, stage.rows())


def build(setting: Setting, params: BeamsParameters, *, trace: bool = False) -> tuple[list[Pass], Bank, dict[str, Any]]:
    """Return the passes of a scene, their buffers, and what the plan decided (for statistics).

    Parameters
    ----------
    setting : Setting
    params : BeamsParameters
    trace : bool
        Fill a probe per light, `report["probe"]`: for the one wave of a window one wave wide and one row high.
    """
    scene, bank = setting.scene, Bank()
    stage = Stage(setting, params, bank)
    width, height = scene.image.width, scene.image.height
    for key in ("frame", "f_h"):
        setting.target(bank, key, key, width, height)
    setting.depth_target(bank, "depth", "depth", width, height)
    passes: list[Pass] = []
    plans: list[BeamPlan] = []
    top = setting.formats["f_h"].top if setting.formats["f_h"].kind == "unorm" else None
    for index in range(len(scene.lights)):
        frame = light_frame(scene, index)
        far = shadow_far(scene, frame, base_distance(scene, frame, params, index))
        spot = spotlight(stage, index, far)
        stage.spots.append(spot)
        plans.append(beam_plan(scene, frame, params, index, spot.sources, top))
        passes += shadow_passes(stage, spot, far)
    passes += opaque_passes(stage)
    report: dict[str, Any] = {"lights": [], "counters": [], "probe": []}
    for spot, plan in zip(stage.spots, plans, strict=True):
        counters = np.zeros((height, COUNTERS), np.int64)
        draws = len(plan.main_z) + len(plan.sub_z)
        probe = np.zeros(max(draws, 1) * len(PROBE) * N) if trace else None
        passes.append(slab_pass(stage, spot, plan, counters, probe))
        report["counters"].append(counters)
        report["probe"].append(probe)
        report["lights"].append(describe(plan))
    return passes, bank, report


def describe(plan: BeamPlan) -> dict[str, Any]:
    """Return the plan of one light as plain values."""
    return {
        "interval_m": plan.dt_m, "main_planes": len(plan.main_z), "sub_planes": len(plan.sub_z),
        "depth_m": [plan.near_m, plan.far_m], "base_distance_m": plan.base_m,
        "sub_planes_per_slab": np.diff(plan.first).tolist(), "f_l_centre": plan.f_l.tolist(),
    }  # fmt: skip
