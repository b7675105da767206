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
from atmoref.truth.beams_light_maps import projector_at, sun_at
from atmoref.truth.beams_monte_carlo_geometry import first_surface, sun_visible, visible
from atmoref.truth.beams_question import LINEAR_ANGLE, NO_FALLOFF, Question, light_at
from atmoref.truth.rows import Crop, Progress, run_rows

__all__ = ["BATCH", "monte_carlo"]

BATCH = 16
"""Samples in one batch, one in each sixteenth of the ray's angle."""

_FIRST_STOP = 4  # batches
_LEAST_OFFSET_M = 1e-9


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
def _texel(q, picture, column, line, c):
    """Return a texel of a picture; beyond its edges the nearest."""
    column = min(max(column, 0), picture.width - 1)
    line = min(max(line, 0), picture.height - 1)
    return q.texels[picture.first + (line + 1) * (picture.width + 2) + column + 1, c]


@subroutine
def _looked_up(q, picture, u, v, c):
    """Return a picture at u (from the left) and v (from the top), bilinear; 0 outside the unit square."""
    if u < 0.0 or u > 1.0 or v < 0.0 or v > 1.0:
        return 0.0
    x, y = u * picture.width - 0.5, v * picture.height - 0.5
    i, j = math.floor(x), math.floor(y)
    top = (i + 1 - x) * _texel(q, picture, i, j, c) + (x - i) * _texel(q, picture, i + 1, j, c)
    bottom = (i + 1 - x) * _texel(q, picture, i, j + 1, c) + (x - i) * _texel(q, picture, i + 1, j + 1, c)
    return (j + 1 - y) * top + (y - j) * bottom


@subroutine
def _projected(q, light, x, y, z, c):
    """Return I_l of a projector towards a direction (any length)."""
    along = light.axis[0] * x + light.axis[1] * y + light.axis[2] * z
    if along <= 0.0:
        return 0.0
    u = 0.5 + (light.across[0] * x + light.across[1] * y + light.across[2] * z) / along
    v = 0.5 + (light.down[0] * x + light.down[1] * y + light.down[2] * z) / along
    return _looked_up(q, light.picture, u, v, c)


@subroutine
def _glass(q, light, p, c):
    """Return I_l of a sun at a place, and how far behind its window that is (infinite without)."""
    if not light.windowed:
        return q.texels[light.picture.first, c], math.inf
    x, y, z = p[0] - light.center[0], p[1] - light.center[1], p[2] - light.center[2]
    reach = light.depth[0] * x + light.depth[1] * y + light.depth[2] * z
    if reach < 0.0:
        return 0.0, reach
    u = 0.5 + light.across[0] * x + light.across[1] * y + light.across[2] * z
    v = 0.5 + light.down[0] * x + light.down[1] * y + light.down[2] * z
    return _looked_up(q, light.picture, u, v, c), reach


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
        if cosine <= 0.0 or emitted == 0.0 or not visible(q.objects, q.mesh, light.position, p):
            continue
        for c in range(3):
            irradiance = light.intensity[c] * emitted * cosine * math.exp(-q.medium.extinction[c] * s) / (s * s)
            out[c] += albedo[c] / math.pi * irradiance * math.exp(-q.medium.extinction[c] * distance)
    _reflected_pictures(q, p, distance, normal, albedo, out)


@subroutine
def _reflected_pictures(q, p, distance, normal, albedo, out):
    """Add what the surface at ``p`` sends to the eye from projectors and suns."""
    for which in range(q.projectors.shape[0]):
        light = projector_at(q.projectors, which)
        x, y, z = p[0] - light.position[0], p[1] - light.position[1], p[2] - light.position[2]
        s = math.sqrt(x * x + y * y + z * z)
        cosine = -(x * normal[0] + y * normal[1] + z * normal[2]) / s
        if cosine <= 0.0 or not visible(q.objects, q.mesh, light.position, p):
            continue
        for c in range(3):
            emitted = light.intensity[c] * _projected(q, light, x, y, z, c)
            dim = math.exp(-q.medium.extinction[c] * (s + distance))
            out[c] += albedo[c] / math.pi * emitted * cosine * dim / (s * s)
    for which in range(q.suns.shape[0]):
        sun = sun_at(q.suns, which)
        cosine = -(sun.axis[0] * normal[0] + sun.axis[1] * normal[1] + sun.axis[2] * normal[2])
        reach = _glass(q, sun, p, 0)[1]
        if cosine <= 0.0 or reach < 0.0 or not sun_visible(q.objects, q.mesh, p, sun.axis, reach, distance):
            continue
        for c in range(3):
            dim = math.exp(-q.medium.extinction[c] * distance)
            out[c] += albedo[c] / math.pi * sun.irradiance[c] * _glass(q, sun, p, c)[0] * cosine * dim


@subroutine
def _towards(position, a, d, distance, xi):
    """Return a place on a ray by equiangular sampling of a point light.

    The place, the way there from the light, its distance from the eye, its distance from the light squared, and the
    density.
    """
    to = (position[0] - a[0], position[1] - a[1], position[2] - a[2])
    foot = to[0] * d[0] + to[1] * d[1] + to[2] * d[2]
    off = (to[0] - foot * d[0], to[1] - foot * d[1], to[2] - foot * d[2])
    v = max(math.sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]), _LEAST_OFFSET_M)
    u, density = equiangular(xi, v, -foot, distance - foot)
    t = foot + u
    p = (a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2])
    w = (p[0] - position[0], p[1] - position[1], p[2] - position[2])
    return p, w, t, w[0] * w[0] + w[1] * w[1] + w[2] * w[2], density


@subroutine
def _scattered(medium, w, s, d):
    """Return the phase function for light that comes along ``w`` (s metres long) and leaves towards -d."""
    mu = -(w[0] * d[0] + w[1] * d[1] + w[2] * d[2]) / s
    return phase(medium.phase_kind, medium.phase_g, min(max(mu, -1.0), 1.0))


@subroutine
def _sample(q, light, a, d, distance, xi, out):
    """Add to ``out`` (3,) one sample of a spot's light scattered along a ray, divided by its density."""
    p, w, t, ss, density = _towards(light.position, a, d, distance, xi)
    if ss == 0.0:
        return
    emitted = _emitted(light, w[0], w[1], w[2])
    if emitted == 0.0 or not visible(q.objects, q.mesh, light.position, p):
        return
    s = math.sqrt(ss)
    f = emitted * _scattered(q.medium, w, s, d) / (ss * density)
    for c in range(3):
        out[c] += light.intensity[c] * q.medium.scattering[c] * f * math.exp(-q.medium.extinction[c] * (s + t))


@subroutine
def _sample_projector(q, light, a, d, distance, xi, out):
    """Add to ``out`` (3,) one sample of a projector's light scattered along a ray, divided by its density."""
    p, w, t, ss, density = _towards(light.position, a, d, distance, xi)
    if ss == 0.0 or not visible(q.objects, q.mesh, light.position, p):
        return
    s = math.sqrt(ss)
    f = _scattered(q.medium, w, s, d) / (ss * density)
    for c in range(3):
        emitted = light.intensity[c] * _projected(q, light, w[0], w[1], w[2], c)
        out[c] += emitted * q.medium.scattering[c] * f * math.exp(-q.medium.extinction[c] * (s + t))


@subroutine
def _sample_sun(q, light, a, d, distance, xi, out):
    """Add to ``out`` (3,) one sample of sunlight scattered along a ray, divided by its density.

    The distance is exponential up to the ray's end with the least extinction of the channels that scatter.
    """
    sigma = math.inf
    for c in range(3):
        if q.medium.scattering[c] > 0.0:
            sigma = min(sigma, q.medium.extinction[c])
    if sigma == math.inf:
        return
    seen = -math.expm1(-sigma * distance) if sigma > 0.0 else 0.0
    t = -math.log1p(-xi * seen) / sigma if seen > 0.0 else xi * distance
    weight = seen / sigma * math.exp(sigma * t) if seen > 0.0 else distance
    p = (a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2])
    reach = _glass(q, light, p, 0)[1]
    if reach < 0.0 or not sun_visible(q.objects, q.mesh, p, light.axis, reach, 1.0):
        return
    f = weight * _scattered(q.medium, light.axis, 1.0, d)
    for c in range(3):
        emitted = light.irradiance[c] * _glass(q, light, p, c)[0]
        out[c] += emitted * q.medium.scattering[c] * f * math.exp(-q.medium.extinction[c] * t)


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
        for which in range(q.projectors.shape[0]):
            projector = projector_at(q.projectors, which)
            for k in range(BATCH):
                xi, _ = uniform_pair(key, pixel, b * BATCH + k, q.lights.shape[0] + which)
                _sample_projector(q, projector, a, d, distance, (k + xi) / BATCH, batch)
        for which in range(q.suns.shape[0]):
            sun = sun_at(q.suns, which)
            for k in range(BATCH):
                xi, _ = uniform_pair(key, pixel, b * BATCH + k, q.lights.shape[0] + q.projectors.shape[0] + which)
                _sample_sun(q, sun, a, d, distance, (k + xi) / BATCH, batch)
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
            distance, normal, albedo = first_surface(q.objects, q.mesh, a, d)
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
