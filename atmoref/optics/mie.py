"""Scattering of light by spheres: Mie coefficients, efficiencies, amplitudes, and sums over many spheres.

A sphere is known by its size parameter x = 2 pi r / wavelength and its refractive index m relative to the medium,
m = n + i k with k >= 0 (time dependence exp(-i omega t); codes after Wiscombe write n - i k).

More terms are taken than Wiscombe's x + 4.05 x^(1/3) + 2: there the amplitudes end at 2e-7 of their size (enough for
efficiencies, in which they are squared), here at 1e-15, so that dark angles keep their digits too.  Nothing but
+ - * /, `elementary` and integers is used: the bits are the same on every machine and for any number of threads.

Errors, measured in multiprecision (`tests/optics`): efficiencies and asymmetry 1e-11 relative (nearly transparent
spheres lose what m - 1 loses, others are below 1e-14); amplitudes 1e-9 relative in any direction for x <= 200, 1e-12 of
the greatest.

Source: [Bohren1983] ch. 4; [Wiscombe1979] for the angular recurrence and test cases.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.elementary import cos, exp, log, sin
from atmoref.lanes import N
from atmoref.optics.mie_kernels import amplitudes_kernel, coefficients_kernel, intensities_kernel

__all__ = [
    "LEAST_SIZE",
    "MOST_INDEX",
    "MOST_SIZE",
    "Efficiencies",
    "amplitudes",
    "coefficients",
    "efficiencies",
    "intensities",
    "number_of_terms",
    "phase_function",
]

Floats = NDArray[np.float64]

LEAST_SIZE, MOST_SIZE = 1e-6, 40000.0
"""Size parameters that are accepted."""
MOST_INDEX = 20.0
"""Greatest real or imaginary part of a refractive index."""
BATCH_BYTES = 1 << 26
"""Coefficients held at a time, for spheres whose intensities are summed."""


class Efficiencies(NamedTuple):
    """Cross-sections over pi r^2, and the mean cosine; arrays of the shape of x.

    `backscatter` is 4 pi times the differential cross-section at 180 degrees over pi r^2 (radar's).
    """

    extinction: Floats
    scattering: Floats
    absorption: Floats
    backscatter: Floats
    asymmetry: Floats


class _Spheres(NamedTuple):
    """Spheres of one index, checked, with what their kernels need."""

    m: complex
    x: Floats
    last: NDArray[np.int64]
    start_z: NDArray[np.int64]
    start_x: NDArray[np.int64]


def _cube_root(x: Floats) -> Floats:
    root: Floats = np.asarray(exp(log(x) / 3.0), np.float64)
    return root


def number_of_terms(x: ArrayLike) -> NDArray[np.int64]:
    """Return how many coefficients are used for size parameters x: the last one is below 1e-15."""
    sizes = np.asarray(x, np.float64)
    return np.ceil(sizes + 7.0 * _cube_root(sizes) + 5.0).astype(np.int64)


def _spheres(m: complex, x: ArrayLike) -> _Spheres:
    """Return checked spheres; the downward recurrences start far enough beyond |z| for weak absorbers, too."""
    index = complex(m)
    if not (0.0 < index.real <= MOST_INDEX and 0.0 <= index.imag <= MOST_INDEX):
        raise ValueError(
            f"refractive index m = {m!r} is outside: real part in (0, {MOST_INDEX:g}], imaginary part (absorption, "
            f"positive) in [0, {MOST_INDEX:g}]"
        )
    sizes = np.atleast_1d(np.asarray(x, np.float64)).ravel()
    if not sizes.size or not ((sizes >= LEAST_SIZE) & (sizes <= MOST_SIZE)).all():
        raise ValueError(f"size parameters must be in [{LEAST_SIZE:g}, {MOST_SIZE:g}], found {x!r}")
    last = number_of_terms(sizes)
    absolute = np.sqrt(index.real * index.real + index.imag * index.imag)

    def start(z: Floats) -> NDArray[np.int64]:
        far = np.maximum(z, last)
        return np.ceil(far + 10.0 * _cube_root(far) + 50.0).astype(np.int64)

    return _Spheres(index, np.ascontiguousarray(sizes), last, start(absolute * sizes), start(sizes))


def _threads() -> int:
    return max(1, len(os.sched_getaffinity(0)))


def _pieces(count: int, step: int) -> Iterator[tuple[int, int]]:
    for first in range(0, count, step):
        yield first, min(first + step, count)


def _spread(work: Callable[[int, int], None], pieces: list[tuple[int, int]]) -> None:
    """Call work(first, end) for all pieces, on as many threads as there are processors."""
    if len(pieces) < 2 or _threads() < 2:
        for piece in pieces:
            work(*piece)
        return
    with ThreadPoolExecutor(_threads()) as pool:
        for done in [pool.submit(work, *piece) for piece in pieces]:
            done.result()


def _solve(s: _Spheres) -> tuple[Floats, Floats]:
    """Return coefficients (spheres, 4, n) from order 0, zero beyond each sphere's last, and sums (spheres, 4)."""
    room = int(s.last.max()) + 3
    out, sums = np.zeros((s.x.size, 4, room)), np.empty((s.x.size, 4))
    sine, cosine = np.asarray(sin(s.x), np.float64), np.asarray(cos(s.x), np.float64)

    def work(i: int, j: int) -> None:
        coefficients_kernel(
            out[i:j], sums[i:j], s.m.real, s.m.imag, s.x[i:j], sine[i:j], cosine[i:j], s.last[i:j], s.start_z[i:j],
            s.start_x[i:j], np.zeros((4, room)),
        )  # fmt: skip

    _spread(work, list(_pieces(s.x.size, max(1, -(-s.x.size // 16)))))
    return out, sums


def coefficients(m: complex, x: float) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return a_n and b_n, n = 1, 2, ..., of one sphere.

    Parameters
    ----------
    m : complex
        Relative refractive index n + i k; 0 < n <= 20, 0 <= k <= 20.
    x : float
        Size parameter, 1e-6 to 40,000.

    Returns
    -------
    a, b : (number_of_terms(x),) complex arrays
        Relative error of each part 1e-12 for x <= 200, where the part is above 1e-14.

    Raises
    ------
    ValueError
        For m or x outside.
    """
    spheres = _spheres(m, float(x))
    out, _ = _solve(spheres)
    n = slice(1, int(spheres.last[0]) + 1)
    return out[0, 0, n] + 1j * out[0, 1, n], out[0, 2, n] + 1j * out[0, 3, n]


def efficiencies(m: complex, x: ArrayLike) -> Efficiencies:
    """Return efficiencies and mean cosines of spheres of one index; see `coefficients` for domain and errors.

    Parameters
    ----------
    m : complex
        Relative refractive index n + i k.
    x : array
        Size parameters, any shape.
    """
    spheres = _spheres(m, x)
    shape = np.shape(x)
    parts = [_solve(_take(spheres, i, j))[1] for i, j in _batches(spheres)]
    sums = np.concatenate(parts)
    scattered, absorbed, forward, backward = (sums[:, k].reshape(shape) for k in range(4))
    asymmetry = np.divide(forward, scattered, out=np.zeros_like(forward), where=scattered > 0.0)
    return Efficiencies(scattered + absorbed, scattered, absorbed, backward, asymmetry)


def _take(s: _Spheres, i: int, j: int) -> _Spheres:
    return _Spheres(s.m, s.x[i:j], s.last[i:j], s.start_z[i:j], s.start_x[i:j])


def _batches(s: _Spheres) -> Iterator[tuple[int, int]]:
    return _pieces(s.x.size, max(1, BATCH_BYTES // (32 * (int(s.last.max()) + 3))))


def _fold(mu: ArrayLike) -> tuple[Floats, NDArray[np.intp], NDArray[np.bool_], tuple[int, ...]]:
    """Return distinct |mu| padded to lanes, the place of each mu there, and which are negative."""
    cosines = np.asarray(mu, np.float64)
    if not (np.abs(cosines) <= 1.0).all():
        raise ValueError("scattering cosines must be in [-1, 1]")
    flat = cosines.ravel()
    half, place = np.unique(np.abs(flat), return_inverse=True)
    padded = np.zeros(-(-half.size // N) * N)
    padded[: half.size] = half
    return padded, place.ravel(), flat < 0.0, cosines.shape


def _weighted(out: Floats) -> Floats:
    n = np.arange(1.0, out.shape[2])
    scaled = np.zeros_like(out)
    scaled[:, :, 1:] = out[:, :, 1:] * ((2.0 * n + 1.0) / (n * (n + 1.0)))
    return scaled


def _angle_pieces(count: int) -> list[tuple[int, int]]:
    return list(_pieces(count, N * max(1, count // (N * 8 * _threads()))))


def amplitudes(m: complex, x: float, mu: ArrayLike) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return S1 and S2 of one sphere at scattering cosines mu (any shape, 1 forward)."""
    spheres = _spheres(m, float(x))
    scaled = _weighted(_solve(spheres)[0])[0]
    half, place, negative, shape = _fold(mu)
    out = np.empty((8, half.size))
    _spread(lambda i, j: amplitudes_kernel(out, half, scaled, spheres.last[0], i, j), _angle_pieces(half.size))
    rows = np.where(negative, out[4:, place], out[:4, place]).reshape(4, *shape)
    return rows[0] + 1j * rows[1], rows[2] + 1j * rows[3]


def intensities(m: complex, x: ArrayLike, weights: ArrayLike, mu: ArrayLike) -> Floats:
    """Return the weighted sum over spheres of |S1|^2 + |S2|^2 at scattering cosines.

    The differential scattering cross-section of one sphere (unpolarised light) is (|S1|^2 + |S2|^2) / (2 k^2) per
    steradian, with k = 2 pi / wavelength.

    Parameters
    ----------
    m : complex
        Relative refractive index n + i k.
    x, weights : (spheres,) arrays
        Size parameters, and how often each sphere counts.
    mu : array, any shape
        Scattering cosines; 1 is forward.  Pairs mu, -mu cost as much as one.

    Raises
    ------
    ValueError
        For values outside, or weights of another shape than x.
    """
    spheres = _spheres(m, x)
    counts = np.ascontiguousarray(np.atleast_1d(np.asarray(weights, np.float64)))
    if counts.shape != spheres.x.shape:
        raise ValueError(f"weights have shape {counts.shape}, size parameters {spheres.x.shape}")
    half, place, negative, shape = _fold(mu)
    ahead, behind = np.zeros_like(half), np.zeros_like(half)
    for i, j in _batches(spheres):
        batch = _take(spheres, i, j)
        scaled = _weighted(_solve(batch)[0])

        def work(first: int, end: int, scaled: Any = scaled, batch: _Spheres = batch, i: int = i, j: int = j) -> None:
            intensities_kernel(ahead, behind, half, scaled, batch.last, counts[i:j], first, end)

        _spread(work, _angle_pieces(half.size))
    return np.where(negative, behind[place], ahead[place]).reshape(shape)


def phase_function(m: complex, x: float, mu: ArrayLike) -> Floats:
    """Return the phase function (1/sr) of one sphere for unpolarised light, its integral over the sphere being 1."""
    scattering = float(efficiencies(m, float(x)).scattering)
    return intensities(m, [float(x)], [1.0], mu) / (2.0 * np.pi * float(x) ** 2 * scattering)
