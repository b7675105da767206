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

from atmoref._jit import kernel, subroutine
from atmoref.optics.phase_functions import phase
from atmoref.transport.random_numbers import uniform_pair
from atmoref.transport.samplers import equiangular
from atmoref.truth.beams_question import LINEAR_ANGLE, NO_FALLOFF, Question, light_at
from atmoref.truth.rows import Crop, Progress, run_rows

__all__ = ["BATCH", "monte_carlo"]

BATCH = 16
"""Samples in one batch, one in each sixteenth of the ray's angle."""

_FIRST_STOP = 4  # batches
_END = 1e-9  # relative: crossings this near to a segment's end are its own surface
_LEAST_OFFSET_M = 1e-9


@subroutine
def _crosses_sphere(a, d, spheres, i, low, high):
    """Return the least crossing parameter in (low, high) of a + k d with a sphere's surface; infinite for none."""
    x, y, z = a[0] - spheres[i, 0], a[1] - spheres[i, 1], a[2] - spheres[i, 2]
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    b = 2.0 * (x * d[0] + y * d[1] + z * d[2])
    c = x * x + y * y + z * z - spheres[i, 3] * spheres[i, 3]
    root = b * b - 4.0 * square * c
    if root <= 0.0:
        return math.inf
    first = (-b - math.sqrt(root)) / (2.0 * square)
    second = (-b + math.sqrt(root)) / (2.0 * square)
    if low < first < high:
        return first
    return second if low < second < high else math.inf


@subroutine
def _crosses_box(a, d, boxes, i, low, high):
    """Return the least crossing parameter in (low, high) of a + k d with one of a box's six faces, and its axis."""
    best = math.inf
    axis = 0
    for k in range(6):
        n = k // 2
        plane = boxes[i, n] if k % 2 == 0 else boxes[i, n + 3]
        if d[n] == 0.0:
            continue
        t = (plane - a[n]) / d[n]
        j, m = (n + 1) % 3, (n + 2) % 3
        p = a[j] + t * d[j]
        r = a[m] + t * d[m]
        inside = boxes[i, j] < p < boxes[i, j + 3] and boxes[i, m] < r < boxes[i, m + 3]
        if inside and low < t < high and t < best:
            best, axis = t, n
    return best, axis


@subroutine
def _visible(objects, a, b):
    """Tell whether nothing crosses the segment between two points; surfaces at its ends do not count."""
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    high = 1.0 - _END
    for i in range(objects.spheres.shape[0]):
        if _crosses_sphere(a, d, objects.spheres, i, _END, high) < high:
            return False
    for i in range(objects.boxes.shape[0]):
        if _crosses_box(a, d, objects.boxes, i, _END, high)[0] < high:
            return False
    for i in range(objects.grounds.shape[0]):
        h = objects.grounds[i, 0]
        if abs(b[1] - h) > _END * abs(d[1]) and (a[1] < h) != (b[1] < h):
            return False
    return True


@subroutine
def _first_surface(objects, a, d):
    """Return distance, normal facing the eye, and albedo of the first surface from ``a`` along unit ``d``."""
    best = math.inf
    normal = (0.0, 0.0, 0.0)
    albedo = (0.0, 0.0, 0.0)
    for i in range(objects.spheres.shape[0]):
        t = _crosses_sphere(a, d, objects.spheres, i, 0.0, best)
        if t < best:
            best = t
            o = objects.spheres[i]
            normal = (
                (a[0] + t * d[0] - o[0]) / o[3],
                (a[1] + t * d[1] - o[1]) / o[3],
                (a[2] + t * d[2] - o[2]) / o[3],
            )
            albedo = (o[4], o[5], o[6])
    for i in range(objects.boxes.shape[0]):
        t, n = _crosses_box(a, d, objects.boxes, i, 0.0, best)
        if t < best:
            best = t
            face = -1.0 if d[n] > 0.0 else 1.0
            normal = (face if n == 0 else 0.0, face if n == 1 else 0.0, face if n == 2 else 0.0)
            albedo = (objects.boxes[i, 6], objects.boxes[i, 7], objects.boxes[i, 8])
    for i in range(objects.grounds.shape[0]):
        t = (objects.grounds[i, 0] - a[1]) / d[1] if d[1] != 0.0 else math.inf
        if 0.0 < t < best:
            best = t
            normal = (0.0, 1.0 if d[1] < 0.0 else -1.0, 0.0)
            albedo = (objects.grounds[i, 1], objects.grounds[i, 2], objects.grounds[i, 3])
    return best, normal, albedo


@subroutine
def _emitted(light, x, y, z):
    """Return I_l towards a direction from the light (any length)."""
    if light.outer >= math.pi:
        return light.peak
    length = math.sqrt(x * x + y * y + z * z)
    cosine = (x * light.axis[0] + y * light.axis[1] + z * light.axis[2]) / length
    angle = math.acos(min(max(cosine, -1.0), 1.0))
    if angle >= light.outer:
        return 0.0
    if angle <= light.inner or light.falloff == NO_FALLOFF:
        return light.peak
    if light.falloff == LINEAR_ANGLE:
        return light.peak * (light.outer - angle) / (light.outer - light.inner)
    k = (cosine - math.cos(light.outer)) / (math.cos(light.inner) - math.cos(light.outer))
    return light.peak * k * k * (3.0 - 2.0 * k)


@subroutine
def _reflected(q, a, d, distance, normal, albedo, out):
    """Set what the first surface sends to the eye: a finite sum over lights, nothing to sample."""
    out[:] = 0.0
    if distance == math.inf:
        return
    p = (a[0] + distance * d[0], a[1] + distance * d[1], a[2] + distance * d[2])
    for which in range(q.lights.shape[0]):
        light = light_at(q.lights, which)
        x, y, z = p[0] - light.position[0], p[1] - light.position[1], p[2] - light.position[2]
        s = math.sqrt(x * x + y * y + z * z)
        cosine = -(x * normal[0] + y * normal[1] + z * normal[2]) / s
        emitted = _emitted(light, x, y, z)
        if cosine <= 0.0 or emitted == 0.0 or not _visible(q.objects, light.position, p):
            continue
        for c in range(3):
            irradiance = light.intensity[c] * emitted * cosine * math.exp(-q.medium.extinction[c] * s) / (s * s)
            out[c] += albedo[c] / math.pi * irradiance * math.exp(-q.medium.extinction[c] * distance)


@subroutine
def _sample(q, light, a, d, distance, xi, out):
    """Add to ``out`` (3,) one sample of the light scattered along a ray, divided by its density."""
    to = (light.position[0] - a[0], light.position[1] - a[1], light.position[2] - a[2])
    foot = to[0] * d[0] + to[1] * d[1] + to[2] * d[2]
    off = (to[0] - foot * d[0], to[1] - foot * d[1], to[2] - foot * d[2])
    v = max(math.sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]), _LEAST_OFFSET_M)
    u, density = equiangular(xi, v, -foot, distance - foot)
    t = foot + u
    p = (a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2])
    x, y, z = p[0] - light.position[0], p[1] - light.position[1], p[2] - light.position[2]
    ss = x * x + y * y + z * z
    if ss == 0.0:
        return
    emitted = _emitted(light, x, y, z)
    if emitted == 0.0 or not _visible(q.objects, light.position, p):
        return
    s = math.sqrt(ss)
    mu = -(x * d[0] + y * d[1] + z * d[2]) / s  # the eye lies towards -d
    f = emitted * phase(q.medium.phase_kind, q.medium.phase_g, min(max(mu, -1.0), 1.0)) / (ss * density)
    for c in range(3):
        out[c] += light.intensity[c] * q.medium.scattering[c] * f * math.exp(-q.medium.extinction[c] * (s + t))


@subroutine
def _settled(mean, square, batches, rtol):
    """Tell whether every channel's standard error is within rtol of its mean, and not all means are zero."""
    bright = False
    for c in range(3):
        bright |= mean[c] > 0.0
        variance = square[c] / (batches - 1.0) / batches
        if not variance <= (rtol * mean[c]) ** 2:
            return False
    return bright


@subroutine
def _estimate(q, a, d, distance, key, pixel, batches, rtol, mean, error, square, batch):
    """Set mean and standard error (3,) of the beam term of one ray; return how many batches were used."""
    mean[:] = 0.0
    square[:] = 0.0
    used = 0
    check = _FIRST_STOP
    for b in range(batches):
        batch[:] = 0.0
        for which in range(q.lights.shape[0]):
            light = light_at(q.lights, which)
            for k in range(BATCH):
                xi, _ = uniform_pair(key, pixel, b * BATCH + k, which)
                _sample(q, light, a, d, distance, (k + xi) / BATCH, batch)
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
def _monte_carlo_kernel(image, beam, surface, error, counters, q, key, batches, rtol, shape, corner, rows, scratch):
    """Fill the rows [rows[0], rows[1]) of a crop whose corner (column, row) lies in an image of ``shape`` (H, W)."""
    square, batch = scratch[0], scratch[1]
    camera = q.camera
    for j in range(rows[0], rows[1]):
        for i in range(image.shape[1]):
            column, line = corner[0] + i, corner[1] + j
            x = camera.half_width * (2.0 * (column + 0.5) / shape[1] - 1.0)
            y = camera.half_height * (1.0 - 2.0 * (line + 0.5) / shape[0])
            length = math.sqrt(1.0 + x * x + y * y)
            a = camera.eye
            d = (
                (camera.forward[0] + x * camera.right[0] + y * camera.up[0]) / length,
                (camera.forward[1] + x * camera.right[1] + y * camera.up[1]) / length,
                (camera.forward[2] + x * camera.right[2] + y * camera.up[2]) / length,
            )
            distance, normal, albedo = _first_surface(q.objects, a, d)
            _reflected(q, a, d, distance, normal, albedo, surface[j, i])
            pixel = line * shape[1] + column
            used = _estimate(
                q, a, d, distance, key, pixel, batches, rtol, beam[j, i], error[j, i], square, batch
            )  # fmt: skip
            counters[j] += used
            for c in range(3):
                ambient = q.medium.ambient[c]
                if q.medium.ambient_saturates:
                    tau = q.medium.extinction[c] * distance if q.medium.extinction[c] > 0.0 else 0.0
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
        _monte_carlo_kernel(
            *out.values(), q, key, samples // BATCH, rtol, shape, corner, (first, last), np.empty((2, 3))
        )

    run_rows(compute, crop.height, threads, progress)
    return out
