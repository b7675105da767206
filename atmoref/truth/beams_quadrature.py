# mypy: allow-untyped-defs, allow-untyped-calls
# (kernels: Numba infers their types)
"""The truth of light beams by interval splitting and adaptive Gauss-Legendre-Kronrod quadrature.

Per view ray: the nearest surface, its direct light (``beams_surfaces.py``), and for each light the lit pieces of the
ray (``beams_pieces.py``, ``beams_sun_pieces.py``, and for meshes ``beams_shadows.py``), each integrated in the angle at
the light (``beams_integral.py``, ``beams_projector.py``) or in closed form (``beams_sun.py``). Radiance, not clipped:

    I = I_b exp(-sigma_t T) + sum over lights ∫_0^T I_l H rho_c F exp(-sigma_t (s + t)) / s² dt + I_a
    I_b = albedo/pi · sum over lights I_0 I_l H max(0, cos) exp(-sigma_t s) / s²,   rho_c F = I_0 sigma_s p(cos alpha)

The camera's near and far distances are the rasteriser's; here rays start in the eye and end at a surface or never.

Source: Dobashi, Yamamoto and Nishita 2002, eqs. (1)-(3) with errata D-E1, D-E2, D-E3, D-E34.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import kernel
from atmoref.truth.beams_geometry import row
from atmoref.truth.beams_integral import add_slack, integrate_pieces
from atmoref.truth.beams_panels import Panels, Settings, workspace
from atmoref.truth.beams_pieces import cut_capacity, find_pieces, line_from_light
from atmoref.truth.beams_projector import GAUSS_KRONROD_5, projectors_kernel
from atmoref.truth.beams_question import Camera, Medium, Question, light_at
from atmoref.truth.beams_shadows import shade_by_point
from atmoref.truth.beams_sun import suns_kernel
from atmoref.truth.beams_sun_pieces import sun_cut_capacity
from atmoref.truth.beams_surfaces import pictured_surfaces_kernel, surfaces_kernel
from atmoref.truth.quadrature_rules import GAUSS_KRONROD_21, Rule
from atmoref.truth.rows import Crop, Progress, run_rows

__all__ = ["ROUNDING", "quadrature", "quadrature_along"]

ROUNDING = 4e-15
"""Relative rounding error of sums and of the surface term, added to the quadrature's own estimate (measured 1e-15)."""

_FIRST_SHADOWS = 64  # of meshes on one ray; room for four times as many, and so on, where these are not enough
_COUNTERS = 3  # panels, lit pieces, rays with a lit piece


@kernel
def _spots_kernel(beam, error, counters, q, rule, settings, work, starts, directions, ends, slacks):
    """Add the light (n, 3) of spots scattered to the eye along rays up to their ends, and its error estimate.

    Return whether the work space was large enough; if not, what was added is worthless.
    """
    value = work.scratch[3]
    estimate = work.scratch[4]
    for i in range(starts.shape[0]):
        for which in range(q.lights.shape[0]):
            light = light_at(q.lights, which)
            line = line_from_light(row(starts, i), row(directions, i), light.position)
            low, high = -line.foot, ends[i] - line.foot
            pieces = find_pieces(q.objects, light, line, low, high, work.cuts, work.ends, work.classes)
            pieces = shade_by_point(q.mesh, line, pieces, work, high, slacks[i])
            if pieces < 0:
                return False
            if pieces == 0:
                continue
            counters[i, 0] += integrate_pieces(q.medium, light, line, pieces, rule, settings, work, value, estimate)
            counters[i, 1] += pieces
            counters[i, 2] = 1
            if value[0] < math.inf:
                add_slack(q.mesh, q.medium, light, line, pieces, work, estimate)
            for c in range(3):
                scale = light.intensity[c] * light.peak * q.medium.scattering[c]
                if scale > 0.0:
                    group = q.medium.group[c]
                    beam[i, c] += scale * value[group]
                    if value[group] < math.inf:
                        error[i, c] += scale * (estimate[group] + ROUNDING * value[group])
    return True


def _ambient(medium: Medium, ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ambient term (n, 3) of rays that end at distances (n,)."""
    ambient = np.array(medium.ambient)
    if not medium.ambient_saturates:
        return np.broadcast_to(ambient, (len(ends), 3))
    sigma = np.array(medium.extinction)
    depth = np.multiply.outer(ends, sigma, where=sigma > 0.0, out=np.zeros((len(ends), 3)))
    saturated: NDArray[np.float64] = -ambient * np.expm1(-depth)
    return saturated


def _solve_rays(
    out: dict[str, NDArray[Any]],
    q: Question,
    rule: Rule,
    settings: Settings,
    starts: NDArray[np.float64],
    directions: NDArray[np.float64],
    limits: NDArray[np.float64],
) -> None:
    """Fill the entries of n rays in ``out``; directions are of any length."""
    d = directions / np.sqrt((directions * directions).sum(axis=1))[:, None]
    ends = limits.copy()
    hits = np.zeros((len(ends), 2), np.int64)
    slacks = np.zeros(len(ends))
    surfaces_kernel(out["surface"], ends, slacks, hits, q, starts, d)
    if len(q.projectors) or len(q.suns):
        pictured_surfaces_kernel(out["surface"], ends, hits, q, starts, d)
    lines = [int(table[:, k : k + 2].sum(axis=1).max(initial=0)) for table, k in ((q.projectors, 16), (q.suns, 19))]
    room = _FIRST_SHADOWS if q.mesh else 0
    while not _solve_beams(out, q, rule, settings, _workspace(q, settings, max(lines), room), starts, d, ends, slacks):
        room = 4 * max(room, _FIRST_SHADOWS)
    rest = out["surface"] + _ambient(q.medium, ends)
    out["image"][:] = out["beam"] + rest
    out["error"][:] += ROUNDING * rest


def _workspace(q: Question, settings: Settings, lines: int, shadows: int) -> Panels:
    solids = len(q.objects.spheres), len(q.objects.boxes), len(q.objects.grounds)
    cuts = max(cut_capacity(*solids), sun_cut_capacity(*solids))
    return workspace(cuts, settings.first_split, lines=lines, shadows=shadows)


def _solve_beams(
    out: dict[str, NDArray[Any]],
    q: Question,
    rule: Rule,
    settings: Settings,
    work: Panels,
    starts: NDArray[np.float64],
    directions: NDArray[np.float64],
    ends: NDArray[np.float64],
    slacks: NDArray[np.float64],
) -> bool:
    """Set the beam terms of n rays and their errors; return whether the work space was large enough."""
    for name in ("beam", "error", "counters"):
        out[name][:] = 0
    tables = out["beam"], out["error"], out["counters"]
    rays = starts, directions, ends, slacks
    if len(q.lights) and not _spots_kernel(*tables, q, rule, settings, work, *rays):
        return False
    quick = GAUSS_KRONROD_5 if settings.adaptive else rule
    if len(q.projectors) and not projectors_kernel(*tables, q, rule, quick, settings, work, *rays, ROUNDING):
        return False
    return not len(q.suns) or bool(suns_kernel(*tables, q, work, *rays, ROUNDING))


def _pixel_rays(camera: Camera, shape: tuple[int, int], crop: Crop, rows: tuple[int, int]) -> NDArray[np.float64]:
    """Return the directions (rows · width, 3), of any length, through the pixel centres of some rows of a crop."""
    x = (2.0 * (crop.x + np.arange(crop.width) + 0.5) / shape[1] - 1.0) * camera.half_width
    y = (1.0 - 2.0 * (crop.y + np.arange(*rows) + 0.5) / shape[0]) * camera.half_height
    across = x[None, :, None] * np.array(camera.right)
    d: NDArray[np.float64] = np.array(camera.forward) + across + y[:, None, None] * np.array(camera.up)
    return d.reshape(-1, 3)


def quadrature(
    q: Question,
    shape: tuple[int, int],
    crop: Crop,
    *,
    rtol: float = 1e-9,
    threads: int | None = None,
    progress: Progress | None = None,
    rule: Rule = GAUSS_KRONROD_21,
    first_split: int = 1,
    adaptive: bool = True,
) -> dict[str, NDArray[Any]]:
    """Return the radiance of the pixels of a crop, with an error estimate for each.

    Parameters
    ----------
    q
        The question.
    shape
        (H, W) of the whole image, in pixels.
    crop
        The part to compute, row 0 at the top.
    rtol
        Pieces are divided until the estimate is below rtol times the pixel's beam term, in every channel.
    threads
        Rows are shared by this many threads; None takes all processors. The bits do not depend on it.
    progress
        Called as ``progress(rows_done, rows_in_all)`` in the calling thread.
    rule, first_split, adaptive
        For cross-checks with other rules and finer first panels.

    Returns
    -------
    dict
        ``image, beam, surface, error`` (h, w, 3) float64, radiance in W/(m² sr); ``counters`` (h, w, 3): panels,
        lit pieces, 1 for a ray with a lit piece.
    """
    settings = Settings(rtol, first_split, adaptive)
    out = _outputs((crop.height, crop.width))

    def compute(first: int, last: int) -> None:
        directions = _pixel_rays(q.camera, shape, crop, (first, last))
        starts = np.full(directions.shape, q.camera.eye)
        limits = np.full(len(directions), math.inf)
        part = {name: array[first:last].reshape(-1, 3) for name, array in out.items()}
        _solve_rays(part, q, rule, settings, starts, directions, limits)

    run_rows(compute, crop.height, threads, progress)
    return out


def quadrature_along(
    q: Question,
    starts: NDArray[np.float64],
    directions: NDArray[np.float64],
    limits: NDArray[np.float64] | None = None,
    *,
    rtol: float = 1e-9,
    rule: Rule = GAUSS_KRONROD_21,
    first_split: int = 1,
    adaptive: bool = True,
) -> dict[str, NDArray[Any]]:
    """Return the radiance along any rays.

    Parameters
    ----------
    q
        The question; its camera is not read.
    starts, directions
        (n, 3); directions of any length.
    limits
        (n,) lengths (m) at which rays end in nothing, if no surface comes first; None for no limit.
    rtol, rule, first_split, adaptive
        As for :func:`quadrature`.

    Returns
    -------
    dict
        ``image, beam, surface, error`` (n, 3); ``counters`` (n, 3).
    """
    settings = Settings(rtol, first_split, adaptive)
    n = starts.shape[0]
    if starts.shape != (n, 3) or directions.shape != (n, 3):
        raise ValueError(f"rays want shapes (n, 3), found {starts.shape} and {directions.shape}")
    ends = np.full(n, math.inf) if limits is None else np.ascontiguousarray(limits, np.float64)
    out = _outputs((n,))
    a = np.ascontiguousarray(starts, np.float64)
    b = np.ascontiguousarray(directions, np.float64)
    _solve_rays(out, q, rule, settings, a, b, ends)
    return out


def _outputs(shape: tuple[int, ...]) -> dict[str, NDArray[Any]]:
    out: dict[str, NDArray[Any]] = {name: np.zeros((*shape, 3)) for name in ("image", "beam", "surface", "error")}
    out["counters"] = np.zeros((*shape, _COUNTERS), np.int64)
    return out
