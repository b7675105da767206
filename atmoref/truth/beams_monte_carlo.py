# mypy: allow-untyped-defs, allow-untyped-calls
# (kernels: Numba infers their types)
"""A second truth of light beams: Monte Carlo with equiangular samples, as plain as it can be.

It exists to contradict the quadrature: its geometry is written a second time, in another way (faces instead of slabs,
crossings of a segment instead of distances), it knows no pieces, and it uses no angle but that of the sampler. Both
read the same question, and the same phase functions, which are part of it.

A pixel's samples come in batches of 16, stratified along the ray; batch means are independent, so their spread gives
the standard error. The random numbers depend on seed, pixel, sample and light only, and whether a pixel stops early is
decided from its own batches at fixed numbers of them: the bits depend neither on threads nor on the crop.

Source: Dobashi, Yamamoto and Nishita 2002, eqs. (1)-(3) with errata D-E1, D-E2, D-E3, D-E34.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import device, kernel
from atmoref.optics.phase_functions import phase
from atmoref.transport.random_numbers import uniform_pair
from atmoref.transport.samplers import equiangular
from atmoref.truth.beams_question import LINEAR_ANGLE, NO_FALLOFF, Question
from atmoref.truth.rows import Crop, Progress, run_rows

__all__ = ["BATCH", "monte_carlo"]

BATCH = 16
"""Samples in one batch, one in each sixteenth of the ray's angle."""

_FIRST_STOP = 4  # batches
_END = 1e-9  # relative: crossings this near to a segment's end are its own surface
_LEAST_OFFSET_M = 1e-9


@device
def _crosses_sphere(ax, ay, az, dx, dy, dz, cx, cy, cz, radius, low, high):
    """Return the least crossing parameter in (low, high) of a + k d with a sphere's surface; infinite for none."""
    x, y, z = ax - cx, ay - cy, az - cz
    a = dx * dx + dy * dy + dz * dz
    b = 2.0 * (x * dx + y * dy + z * dz)
    c = x * x + y * y + z * z - radius * radius
    root = b * b - 4.0 * a * c
    if root <= 0.0:
        return math.inf
    first = (-b - math.sqrt(root)) / (2.0 * a)
    second = (-b + math.sqrt(root)) / (2.0 * a)
    if low < first < high:
        return first
    return second if low < second < high else math.inf


@device
def _crosses_box(a, d, q, i, low, high):
    """Return the least crossing parameter in (low, high) of a + k d with one of a box's six faces, and its axis."""
    best = math.inf
    axis = 0
    for k in range(6):
        n = k // 2
        plane = q.box_min[i, n] if k % 2 == 0 else q.box_max[i, n]
        if d[n] == 0.0:
            continue
        t = (plane - a[n]) / d[n]
        j, m = (n + 1) % 3, (n + 2) % 3
        p = a[j] + t * d[j]
        r = a[m] + t * d[m]
        inside = q.box_min[i, j] < p < q.box_max[i, j] and q.box_min[i, m] < r < q.box_max[i, m]
        if inside and low < t < high and t < best:
            best, axis = t, n
    return best, axis


@device
def _visible(q, a, b):
    """Tell whether nothing crosses the segment between two points; surfaces at its ends do not count."""
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    high = 1.0 - _END
    for i in range(q.sphere_radius.shape[0]):
        c = q.sphere_center[i]
        t = _crosses_sphere(a[0], a[1], a[2], d[0], d[1], d[2], c[0], c[1], c[2], q.sphere_radius[i], _END, high)
        if t < high:
            return False
    for i in range(q.box_min.shape[0]):
        if _crosses_box(a, d, q, i, _END, high)[0] < high:
            return False
    for i in range(q.ground_height.shape[0]):
        h = q.ground_height[i]
        if abs(b[1] - h) > _END * abs(d[1]) and (a[1] < h) != (b[1] < h):
            return False
    return True


@device
def _first_surface(q, a, d):
    """Return distance, normal facing the eye, and albedo of the first surface from ``a`` along unit ``d``."""
    best = math.inf
    normal = (0.0, 0.0, 0.0)
    albedo = (0.0, 0.0, 0.0)
    for i in range(q.sphere_radius.shape[0]):
        c = q.sphere_center[i]
        r = q.sphere_radius[i]
        t = _crosses_sphere(a[0], a[1], a[2], d[0], d[1], d[2], c[0], c[1], c[2], r, 0.0, best)
        if t < best:
            best = t
            normal = (
                (a[0] + t * d[0] - c[0]) / r,
                (a[1] + t * d[1] - c[1]) / r,
                (a[2] + t * d[2] - c[2]) / r,
            )
            albedo = (q.sphere_albedo[i, 0], q.sphere_albedo[i, 1], q.sphere_albedo[i, 2])
    for i in range(q.box_min.shape[0]):
        t, n = _crosses_box(a, d, q, i, 0.0, best)
        if t < best:
            best = t
            face = -1.0 if d[n] > 0.0 else 1.0
            normal = (face if n == 0 else 0.0, face if n == 1 else 0.0, face if n == 2 else 0.0)
            albedo = (q.box_albedo[i, 0], q.box_albedo[i, 1], q.box_albedo[i, 2])
    for i in range(q.ground_height.shape[0]):
        t = (q.ground_height[i] - a[1]) / d[1] if d[1] != 0.0 else math.inf
        if 0.0 < t < best:
            best = t
            normal = (0.0, 1.0 if d[1] < 0.0 else -1.0, 0.0)
            albedo = (q.ground_albedo[i, 0], q.ground_albedo[i, 1], q.ground_albedo[i, 2])
    return best, normal, albedo


@device
def _emitted(q, which, x, y, z):
    """Return I_l towards a direction from the light (any length)."""
    if q.light_outer_rad[which] >= math.pi:
        return q.light_peak[which]
    length = math.sqrt(x * x + y * y + z * z)
    cosine = (x * q.light_axis[which, 0] + y * q.light_axis[which, 1] + z * q.light_axis[which, 2]) / length
    angle = math.acos(min(max(cosine, -1.0), 1.0))
    inner, outer = q.light_inner_rad[which], q.light_outer_rad[which]
    if angle >= outer:
        return 0.0
    if angle <= inner or q.light_falloff[which] == NO_FALLOFF:
        return q.light_peak[which]
    if q.light_falloff[which] == LINEAR_ANGLE:
        return q.light_peak[which] * (outer - angle) / (outer - inner)
    x = (cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer))
    return q.light_peak[which] * x * x * (3.0 - 2.0 * x)


@device
def _reflected(q, a, d, distance, normal, albedo, out):
    """Set what the first surface sends to the eye: a finite sum over lights, nothing to sample."""
    out[:] = 0.0
    if distance == math.inf:
        return
    p = (a[0] + distance * d[0], a[1] + distance * d[1], a[2] + distance * d[2])
    for which in range(q.light_peak.shape[0]):
        light = (q.light_position[which, 0], q.light_position[which, 1], q.light_position[which, 2])
        x, y, z = p[0] - light[0], p[1] - light[1], p[2] - light[2]
        s = math.sqrt(x * x + y * y + z * z)
        cosine = -(x * normal[0] + y * normal[1] + z * normal[2]) / s
        emitted = _emitted(q, which, x, y, z)
        if cosine <= 0.0 or emitted == 0.0 or not _visible(q, light, p):
            continue
        for c in range(3):
            irradiance = q.light_intensity[which, c] * emitted * cosine * math.exp(-q.extinction[c] * s) / (s * s)
            out[c] += albedo[c] / math.pi * irradiance * math.exp(-q.extinction[c] * distance)


@device
def _sample(q, which, a, d, distance, xi, out):
    """Add to ``out`` (3,) one sample of the light scattered along a ray, divided by its density."""
    light = (q.light_position[which, 0], q.light_position[which, 1], q.light_position[which, 2])
    to = (light[0] - a[0], light[1] - a[1], light[2] - a[2])
    foot = to[0] * d[0] + to[1] * d[1] + to[2] * d[2]
    off = (to[0] - foot * d[0], to[1] - foot * d[1], to[2] - foot * d[2])
    v = max(math.sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]), _LEAST_OFFSET_M)
    u, density = equiangular(xi, v, -foot, distance - foot)
    t = foot + u
    p = (a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2])
    x, y, z = p[0] - light[0], p[1] - light[1], p[2] - light[2]
    ss = x * x + y * y + z * z
    if ss == 0.0:
        return
    emitted = _emitted(q, which, x, y, z)
    if emitted == 0.0 or not _visible(q, light, p):
        return
    s = math.sqrt(ss)
    mu = -(x * d[0] + y * d[1] + z * d[2]) / s  # the eye lies towards -d
    f = emitted * phase(q.phase_kind, q.phase_g, min(max(mu, -1.0), 1.0)) / (ss * density)
    for c in range(3):
        out[c] += q.light_intensity[which, c] * q.scattering[c] * f * math.exp(-q.extinction[c] * (s + t))


@device
def _settled(mean, square, batches, rtol):
    """Tell whether every channel's standard error is within rtol of its mean, and not all means are zero."""
    bright = False
    for c in range(3):
        bright |= mean[c] > 0.0
        variance = square[c] / (batches - 1.0) / batches
        if not variance <= (rtol * mean[c]) ** 2:
            return False
    return bright


@device
def _estimate(q, a, d, distance, key, pixel, batches, rtol, mean, error, square, batch):
    """Set mean and standard error (3,) of the beam term of one ray; return how many batches were used."""
    mean[:] = 0.0
    square[:] = 0.0
    used = 0
    check = _FIRST_STOP
    for b in range(batches):
        batch[:] = 0.0
        for which in range(q.light_peak.shape[0]):
            for k in range(BATCH):
                xi, _ = uniform_pair(key, pixel, b * BATCH + k, which)
                _sample(q, which, a, d, distance, (k + xi) / BATCH, batch)
        used += 1
        for c in range(3):  # Welford
            delta = batch[c] / BATCH - mean[c]
            mean[c] += delta / used
            square[c] += delta * (batch[c] / BATCH - mean[c])
        if used == check:
            if _settled(mean, square, used, rtol):
                break
            check *= 2
    for c in range(3):
        error[c] = math.sqrt(square[c] / (used - 1.0) / used)
    return used


@kernel
def _monte_carlo_kernel(image, beam, surface, error, counters, q, key, batches, rtol, shape, corner, rows):
    """Fill the rows [rows[0], rows[1]) of a crop whose corner (column, row) lies in an image of ``shape`` (H, W)."""
    square = np.empty(3)
    batch = np.empty(3)
    for j in range(rows[0], rows[1]):
        for i in range(image.shape[1]):
            column, line = corner[0] + i, corner[1] + j
            x = q.half_width * (2.0 * (column + 0.5) / shape[1] - 1.0)
            y = q.half_height * (1.0 - 2.0 * (line + 0.5) / shape[0])
            length = math.sqrt(1.0 + x * x + y * y)
            a = (q.eye[0], q.eye[1], q.eye[2])
            d = (
                (q.forward[0] + x * q.right[0] + y * q.up[0]) / length,
                (q.forward[1] + x * q.right[1] + y * q.up[1]) / length,
                (q.forward[2] + x * q.right[2] + y * q.up[2]) / length,
            )
            distance, normal, albedo = _first_surface(q, a, d)
            _reflected(q, a, d, distance, normal, albedo, surface[j, i])
            pixel = line * shape[1] + column
            used = _estimate(
                q, a, d, distance, key, pixel, batches, rtol, beam[j, i], error[j, i], square, batch
            )  # fmt: skip
            counters[j] += used
            for c in range(3):
                ambient = q.ambient[c]
                if q.ambient_saturates:
                    tau = q.extinction[c] * distance if q.extinction[c] > 0.0 else 0.0
                    ambient *= 1.0 - math.exp(-tau)
                image[j, i, c] = beam[j, i, c] + surface[j, i, c] + ambient


def monte_carlo(
    q: Question,
    shape: tuple[int, int],
    crop: Crop,
    *,
    samples: int = 256,
    seed: int = 0,
    rtol: float = 0.0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> dict[str, NDArray[Any]]:
    """Return an unbiased estimate of the radiance of a crop's pixels, with standard errors.

    Parameters
    ----------
    q
        The question.
    shape
        (H, W) of the whole image, in pixels.
    crop
        The part to compute, row 0 at the top.
    samples
        Per pixel and light, a multiple of 16, at least 64.
    seed
        In [0, 2^64): another seed, other and independent numbers.
    rtol
        A pixel stops after 4, 8, 16, ... batches if its standard error is within rtol of its mean in each channel;
        0 takes all samples. Stopping early biases the standard error (it is small where it looks small).
    threads
        Rows are shared by this many threads; None takes all processors. The bits do not depend on it.
    progress
        Called as ``progress(rows_done, rows_in_all)`` in the calling thread.

    Returns
    -------
    dict
        ``image, beam, surface`` (h, w, 3) float64, radiance in W/(m² sr); ``error`` (h, w, 3), the standard error;
        ``counters`` (h,), batches used.

    Raises
    ------
    ValueError
        For an unsuitable number of samples or seed.
    """
    if samples < _FIRST_STOP * BATCH or samples % BATCH:
        raise ValueError(f"samples = {samples}: a multiple of {BATCH} from {_FIRST_STOP * BATCH} is needed")
    if not 0 <= seed < 1 << 64:
        raise ValueError(f"seed = {seed}: allowed are 0 <= seed < 2^64")
    out: dict[str, NDArray[Any]] = {
        name: np.zeros((crop.height, crop.width, 3)) for name in ("image", "beam", "surface", "error")
    }
    out["counters"] = np.zeros(crop.height, np.int64)
    key = (np.uint64(seed & 0xFFFFFFFF), np.uint64(seed >> 32))

    def compute(first: int, last: int) -> None:
        corner = (crop.x, crop.y)
        _monte_carlo_kernel(*out.values(), q, key, samples // BATCH, rtol, shape, corner, (first, last))

    run_rows(compute, crop.height, threads, progress)
    return out
