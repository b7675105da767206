"""Where the planes of one light stand: interval, count, sub-planes [Dobashi 2002, sec. 4.2].

All of it is decided on the host, in float64 and with the exact integral: a table in 8 bits would move the counts (in
the reconstruction of Figure 4 a change of 0.5 % in brightness changes the number of sub-planes).
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import exp
from atmoref.numerics.vectors import Vec3, cross, dot, length, minus
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate
from atmoref.scene import Ground, Scene, SceneError
from atmoref.tables.q import Fog, QDomain, q_values
from atmoref.techniques.beams_parameters import (
    MAX_PLANES,
    MAX_SUB_PLANES,
    BeamsParameters,
    SpotlightParameters,
)
from atmoref.techniques.light_frames import LightFrame, ParallelFrame, PointFrame
from atmoref.techniques.spotlights import camera_uniforms

OPAQUE = 6.0  # optical depth at which a beam without a ground is cut off
COARSE_U, COARSE_V, ZOOMS = 257, 8, 3
SCREEN = 33  # rays across the screen and up it, among which the sun's greatest f_l is looked for


@dataclass(frozen=True, slots=True)
class BeamPlan:
    """The planes of one light, float64.

    `first[k]` to `first[k + 1]` are the sub-planes of slab k; `share` is their weight in f_h; depths in metres.
    """

    base_m: float
    near_m: float
    far_m: float
    dt_m: float
    main_z: NDArray[np.float64]
    first: NDArray[np.int32]
    sub_z: NDArray[np.float64]
    sub_slab: NDArray[np.int32]
    share: NDArray[np.float64]
    f_l: NDArray[np.float64]  # greatest channel of f_l on the centre ray, per slab

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of main planes and sub-planes."""
        return len(self.main_z), len(self.sub_z)


def base_distance(scene: Scene, frame: LightFrame, params: SpotlightParameters, index: int) -> float:
    """Return d_0 of one light, metres: as given, or to the ground under the pyramid, or where the beam has faded.

    Of a sun without a window it is the depth from the eye, at most the camera's far plane.

    Raises
    ------
    SceneError
        If a list of another length than the number of lights was given, or nothing ends the beam.
    """
    given = params.base_distance_m
    if given is not None:
        if len(given) not in (1, len(scene.lights)):
            raise SceneError(
                f"{scene.origin}: technique.base_distance_m: found {len(given)} numbers; "
                f"allowed: one number, or {len(scene.lights)}, one per light (m)"
            )
        return given[index % len(given)]
    reach = [] if frame.unbounded else [_to_ground(frame, i.height_m) for i in scene.objects if isinstance(i, Ground)]
    sigma = max(scene.medium.extinction_per_m)
    if sigma > 0.0:
        reach.append(OPAQUE / sigma)
    if frame.unbounded:
        reach.append(scene.camera.far_m)
    finite = [r for r in reach if math.isfinite(r)]
    if not finite:
        raise SceneError(
            f"{scene.origin}: technique.base_distance_m: missing, and neither a ground nor extinction ends the beam of "
            f"lights[{index}]; needed: a length > 0 and <= 1e6 (m)"
        )
    return min(finite)


def _to_ground(frame: LightFrame, height: float) -> float:
    """Return the depth at which all of the light's volume has passed y = height; infinite if some of it never does."""
    farthest = 0.0
    for start, ray in frame.edges():
        drop, slope = height - start[1], ray[1]
        if drop * slope <= 0.0:
            return math.inf
        farthest = max(farthest, drop / slope)
    return farthest


def extent(scene: Scene, frame: LightFrame, base_m: float, bounds: str) -> tuple[float, float]:
    """Return the nearest and farthest depth of the light's volume, clipped to the near plane (D-E9).

    `euclid` gives the least and greatest distance from the eye instead, as printed, where the volume is a pyramid.
    """
    eye, forward = scene.camera.position_m, scene.camera.basis()[2]
    near = scene.camera.near_m
    if frame.unbounded:
        return near, max(near, base_m)
    offsets = [minus(corner, eye) for corner in frame.corners(base_m)]
    if bounds == "euclid" and isinstance(frame, PointFrame):
        start = _distance_to_pyramid(frame, base_m, eye)
        return max(near, start), max(near, max(length(o) for o in offsets))
    depths = [dot(o, forward) for o in offsets]
    return max(near, min(depths)), max(near, max(depths))


def _distance_to_pyramid(frame: PointFrame, base_m: float, point: Vec3) -> float:
    """Return the distance from a point to the nearest one of the pyramid, metres; 0 inside.

    At depth h below the apex the nearest point is clamped to the rectangle |x| <= h t_x, |y| <= h t_y; the squared
    distance is convex in h, and quadratic between the depths at which the rectangle reaches |x| and |y|.
    """
    p = minus(point, frame.position)
    w = dot(p, frame.axis)
    sides = ((abs(dot(p, frame.right)), frame.tan_outer), (abs(dot(p, frame.up)), frame.tan_up))
    (y, t), (x, s) = sorted(sides, key=lambda side: side[0] / side[1])
    first, second = min(y / t, base_m), min(x / s, base_m)
    vertices = (
        (0.0, first, (w + t * y + s * x) / (1.0 + t * t + s * s)),
        (first, second, (w + s * x) / (1.0 + s * s)),
        (second, base_m, w),
    )
    best = math.inf
    for low, high, vertex in vertices:
        h = min(max(vertex, low), high)
        best = min(best, length((w - h, max(x - h * s, 0.0), max(y - h * t, 0.0))))
    return best


def fogs(scene: Scene, cosine: float) -> tuple[Fog, Fog, Fog]:
    """Return what q depends on, for each channel."""
    medium = scene.medium
    kind, g = PHASE_FUNCTIONS[medium.phase_function.type], medium.phase_function.g
    a, b, c = (Fog(s, kind, g, cosine) for s in medium.extinction_per_m)
    return a, b, c


def q_domain(frame: PointFrame, base_m: float, dt_m: float, params: BeamsParameters) -> QDomain:
    """Return the table's extent: all (u, v) that points of the pyramid can have."""
    reach = frame.reach(base_m)
    return QDomain(-reach - dt_m, reach, min(params.q_least_v_m, 0.5 * reach), reach, params.q_table_size)


@functools.lru_cache(maxsize=4096)  # plans of one scene ask for the same slabs again and again
def _greatest_q(fog: Fog, scale: float, dt_m: float, reach: float, v_ref: float) -> float:
    """Return the maximum of q over the table's u and v >= v_ref: a coarse grid, then three zooms around its peak."""
    steps = np.arange(COARSE_U) / (COARSE_U - 1.0)
    ratio = math.sqrt(math.sqrt(math.sqrt(max(reach / v_ref, 1.0))))
    rows = [v_ref]
    for _ in range(COARSE_V - 1):
        rows.append(rows[-1] * ratio)
    best = 0.0
    for v in rows:
        low, high = -reach - dt_m, reach
        for _ in range(ZOOMS):
            u = low + (high - low) * steps
            q = q_values(u, np.full_like(u, v), dt_m, fog)
            peak = int(np.argmax(q))
            best = max(best, float(q[peak]) * scale)
            low, high = float(u[max(peak - 1, 0)]), float(u[min(peak + 1, COARSE_U - 1)])
    return best


def _greatest_f_l(
    scene: Scene, frame: LightFrame, base_m: float, dt_m: float, params: BeamsParameters, sources: Vec3
) -> float:
    """Return the maximum of q over the light's volume from v_ref on, or of the sun's f_l at the eye over the screen."""
    if isinstance(frame, ParallelFrame):
        at = (2.0 * np.arange(SCREEN) / (SCREEN - 1.0)) - 1.0
        camera = camera_uniforms(scene)
        ex, ey = np.tile(at * camera.tan_x, SCREEN), np.repeat(at * camera.tan_y, SCREEN)
        return float(sunlight(scene, frame, sources, params, dt_m, ex, ey).max())
    reach = frame.reach(base_m)
    v_ref = min(params.v_ref_m if params.v_ref_m is not None else 0.2 * base_m, reach)
    greatest: dict[Fog, float] = {}  # q is proportional to its scale
    for fog, scale in zip(fogs(scene, 1.0), sources, strict=True):
        greatest[fog] = max(scale, greatest.get(fog, 0.0))
    return max(_greatest_q(fog, scale, dt_m, reach, v_ref) for fog, scale in greatest.items())


def sunlight(
    scene: Scene, frame: ParallelFrame, sources: Vec3, params: SpotlightParameters, dt_m: float,
    ex: NDArray[np.float64], ey: NDArray[np.float64],
) -> NDArray[np.float64]:  # fmt: skip
    """Return f_l / c_k of the sun, (3, n), for rays through points (ex, ey) of the image plane (D-E13).

    gamma (1 - exp(-sigma_t dt)) / sigma_t with gamma = E_0 sigma_s p(cos alpha), which is constant along a ray.
    """
    axes = scene.camera.basis()
    right, up, forward = (dot(axis, frame.axis) for axis in axes)
    span = np.sqrt(1.0 + ex * ex + ey * ey)
    mu = -(ex * right + ey * up + forward) / span
    sign = -1.0 if params.scattering_angle == "backward" else 1.0
    medium = scene.medium.phase_function
    dt = dt_m * (np.ones_like(span) if params.dt_mode == "paper" else span)
    peak = evaluate(PHASE_FUNCTIONS[medium.type], medium.g, mu * sign) * dt
    sigmas = scene.medium.extinction_per_m
    return np.stack([peak * s * mean_transmittance(sigma * dt) for s, sigma in zip(sources, sigmas, strict=True)])


def mean_transmittance(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (1 - exp(-x)) / x for x >= 0, without cancellation, to 1e-15."""
    series = 1.0 + x * 0.0
    for n in (8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0):
        series = 1.0 - x / n * series
    return np.where(x < 0.0625, series, (1.0 - exp(-x)) / np.maximum(x, 0.0625))


def interval(scene: Scene, frame: LightFrame, base_m: float, params: BeamsParameters, sources: Vec3) -> float:
    """Return dt: the greatest multiple of delta_min whose q does not exceed i_max (D-E7, D-E8), at most delta_max.

    If even delta_min exceeds it, delta_min is kept; the table clamps.
    """
    if params.interval_m is not None:
        return params.interval_m
    most = int(params.delta_max_m / params.delta_min_m * (1.0 + 1e-12))

    def fits(count: int) -> bool:
        return _greatest_f_l(scene, frame, base_m, count * params.delta_min_m, params, sources) <= params.i_max

    low, high = 1, max(most, 1)  # q grows with dt (M-5), so the last count that fits is found by halving
    if not fits(low):
        return params.delta_min_m
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if fits(middle) else (low, middle - 1)
    if params.interval_rule == "first_above":
        low = min(low + 1, max(most, 1))
    return low * params.delta_min_m


def centre_f_l(
    scene: Scene, frame: LightFrame, depths: NDArray[np.float64], dt_m: float, sources: Vec3, params: BeamsParameters
) -> NDArray[np.float64]:
    """Return the greatest channel of f_l = c_k q on the ray through the centre of the screen, per depth.

    q counts up to i_max, as in the paper's table: a camera that looks into the light would ask for endless sub-planes.
    """
    if isinstance(frame, ParallelFrame):
        factor = sunlight(scene, frame, sources, params, dt_m, np.zeros(1), np.zeros(1))
        per_channel = [
            np.minimum(f, params.i_max) * exp(-s * depths)
            for f, s in zip(factor, scene.medium.extinction_per_m, strict=True)
        ]
        return np.asarray(np.max(per_channel, axis=0))
    forward = scene.camera.basis()[2]
    offset = minus(scene.camera.position_m, frame.position)
    u = dot(offset, forward) + depths
    v = np.full_like(u, length(cross(offset, forward)))
    best = np.zeros_like(u)
    cosine = -1.0 if params.scattering_angle == "backward" else 1.0
    for fog, scale in set(zip(fogs(scene, cosine), sources, strict=True)):
        q = np.minimum(q_values(u, v, dt_m, fog) * scale, params.i_max)
        best = np.maximum(best, exp(-fog.sigma_t * depths) * q)
    return best


def sub_plane_count(f_l: float, params: BeamsParameters) -> int:
    """Return m_k of one slab (D-E11): f_l / epsilon, at least 1."""
    if params.sub_plane_rule == "one":
        return 1
    ratio = min(f_l / params.epsilon, float(MAX_SUB_PLANES + 1))
    return max(1, math.ceil(ratio) if params.sub_plane_rule == "ceil" else math.floor(ratio))


def sub_plane_fractions(count: int, positions: str) -> tuple[list[float], list[int], int]:
    """Return where sub-planes stand in their slab, cumulative weights in units, and the units of the whole (D-E10)."""
    if count == 1:
        return [0.5 if positions == "mid" else 0.0], [0, 1], 1
    if positions in ("printed", "trap"):
        at = [j / (count - 1) for j in range(count)]
    elif positions == "left":
        at = [j / count for j in range(count)]
    else:
        at = [(j + 0.5) / count for j in range(count)]
    if positions == "trap":
        return at, [0, *(2 * j + 1 for j in range(count - 1)), 2 * (count - 1)], 2 * (count - 1)
    return at, list(range(count + 1)), count


def shares(cumulative: list[int], whole: int, weights: str, top: int | None) -> list[float]:
    """Return the weights of a slab's sub-planes: fractions, or codes that add up to a unorm format's top (D-E12)."""
    pairs = itertools.pairwise(cumulative)
    if weights == "telescoped" and top is not None:
        return [(top * b // whole - top * a // whole) / top for a, b in pairs]
    return [(b - a) / whole for a, b in pairs]


def beam_plan(
    scene: Scene, frame: LightFrame, params: BeamsParameters, index: int, sources: Vec3, f_h_top: int | None
) -> BeamPlan:
    """Return the planes of light `index`.

    Parameters
    ----------
    scene, frame, params
    index : int
        Which light.
    sources : three floats, W/(sr m)
        rho F without the phase function.
    f_h_top : int or None
        Greatest code of the f_h buffer; None for a float format.

    Returns
    -------
    BeamPlan
        Without planes when the pyramid lies behind the near plane.

    Raises
    ------
    SceneError
        If more than 4096 planes or 65536 sub-planes would be needed.
    """
    base_m = base_distance(scene, frame, params, index)
    dt = interval(scene, frame, base_m, params, sources)
    near, far = extent(scene, frame, base_m, params.bounds)
    ratio = (far - near) / dt
    if ratio > MAX_PLANES:
        raise SceneError(
            f"{scene.origin}: technique: lights[{index}] needs {ratio:.3g} main planes ({near:.6g} to {far:.6g} m, "
            f"every {dt:.3g} m); allowed: at most {MAX_PLANES}. Raise interval_m, delta_min_m or i_max, or lower "
            f"base_distance_m"
        )
    count = 0 if far <= near else (math.ceil(ratio) if params.plane_count == "ceil" else math.floor(ratio)) + 1
    main_z = near + dt * np.arange(count, dtype=np.float64)
    f_l = centre_f_l(scene, frame, main_z, dt, sources, params) if count else np.zeros(0)
    sub_z: list[float] = []
    slab: list[int] = []
    share: list[float] = []
    first = [0]
    for k in range(count):
        m = sub_plane_count(float(f_l[k]), params)
        if len(sub_z) + m > MAX_SUB_PLANES:
            raise SceneError(
                f"{scene.origin}: technique.epsilon: found {params.epsilon}, which asks for more than {MAX_SUB_PLANES} "
                f"sub-planes of lights[{index}]; allowed: a greater epsilon"
            )
        at, cumulative, whole = sub_plane_fractions(m, params.sub_plane_positions)
        sub_z += [float(main_z[k]) + dt * x for x in at]
        slab += [k] * m
        share += shares(cumulative, whole, params.sub_plane_weights, f_h_top)
        first.append(len(sub_z))
    weight: NDArray[np.float64] = np.array(share, np.float64) * (dt if params.f_h == "printed" else 1.0)
    return BeamPlan(
        base_m, near, far, dt, main_z, np.array(first, np.int32), np.array(sub_z, np.float64),
        np.array(slab, np.int32), weight, f_l,
    )  # fmt: skip
