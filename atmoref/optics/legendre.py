"""Legendre series of phase functions, P(mu) = sum of (2l+1)/(4 pi) a_l P_l(mu): exact quadrature and its inverse.

a_l = 2 pi times the integral of P(mu) P_l(mu); a_0 = 1 for a normalised phase function and a_1 is its asymmetry.  The
intensity of a sphere with n terms is a polynomial of degree 2n in mu, so a Gauss-Legendre rule of 2n + 1 nodes gives
its a_l, l <= 2n, without any error but rounding.  The same bits on every machine (no BLAS, one order of sums).
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.elementary import sin
from atmoref.lanes import N
from atmoref.optics.legendre_kernels import coefficients_kernel, nodes_kernel, sums_kernel

__all__ = ["MOST_NODES", "coefficients", "gauss_nodes", "of_bins", "of_disc", "of_points", "series"]

Floats = NDArray[np.float64]

MOST_NODES = 100_000
_BLOCK = 32  # a multiple of every lane width and of the eight sums


def _padded(values: Floats, fill: float) -> Floats:
    room = np.full(-(-values.size // _BLOCK) * _BLOCK, fill)
    room[: values.size] = values
    return room


@functools.lru_cache(maxsize=4)
def _half_rule(n: int) -> tuple[Floats, Floats]:
    """Return 1 - mu of the nodes mu >= 0, from the forward end, and their weights (the middle node's halved)."""
    theta = math.pi * (np.arange((n + 1) // 2) + 0.75) / (n + 0.5)
    half = np.asarray(sin(0.5 * theta), np.float64)
    v = _padded(2.0 * half * half, 0.5)
    weights = np.zeros_like(v)
    nodes_kernel(v, weights, n)
    v, weights = v[: theta.size], weights[: theta.size]
    if n % 2:
        v[-1] = 1.0
        weights[-1] *= 0.5  # it is its own mirror image
    v.flags.writeable = weights.flags.writeable = False
    return v, weights


def gauss_nodes(n: int) -> tuple[Floats, Floats]:
    """Return nodes (descending from the forward end) and weights of the Gauss-Legendre rule of n nodes on [-1, 1].

    Parameters
    ----------
    n : int
        2 to 100,000.

    Returns
    -------
    mu, weights : (n,) arrays
        Nodes within 2e-16, weights within 1e-12 relative (n <= 2000; measured) of the exact rule.
    """
    if not 2 <= n <= MOST_NODES:
        raise ValueError(f"a rule has 2 to {MOST_NODES} nodes here, not {n}")
    v, weights = _half_rule(n)
    mu = 1.0 - v
    if n % 2 == 0:
        return np.concatenate([mu, -mu[::-1]]), np.concatenate([weights, weights[::-1]])
    whole = np.concatenate([weights[:-1], 2.0 * weights[-1:], weights[-2::-1]])
    return np.concatenate([mu, -mu[-2::-1]]), whole


def coefficients(values: ArrayLike, count: int) -> Floats:
    """Return a_0 ... a_{count-1} of a function given at the nodes of `gauss_nodes(n)`.

    Parameters
    ----------
    values : (n,) array, 1/sr
    count : int
        How many.  They are exact for polynomials in mu of degree up to 2n - count.
    """
    f = np.asarray(values, np.float64)
    if f.ndim != 1 or not 2 <= f.size <= MOST_NODES:
        raise ValueError(f"values stand at 2 to {MOST_NODES} nodes in one row, found shape {f.shape}")
    if count < 1:
        raise ValueError(f"the number of coefficients must be at least 1, found {count}")
    v, weights = _half_rule(f.size)
    ahead, behind = f[: v.size], f[::-1][: v.size]
    share = 2.0 * math.pi * weights
    out, room = np.empty(count), _padded(v, 0.5)
    even, odd = _padded(share * (ahead + behind), 0.0), _padded(share * (ahead - behind), 0.0)
    coefficients_kernel(out, room, even, odd, np.empty_like(room), np.empty_like(room))
    return out


def of_points(weighted: ArrayLike, mu: ArrayLike, count: int) -> Floats:
    """Return 2 pi times the sum over points of weighted values times P_l(mu), l < count: coefficients by any rule."""
    f, cosines = np.asarray(weighted, np.float64).ravel(), np.asarray(mu, np.float64).ravel()
    if f.shape != cosines.shape or count < 1:
        raise ValueError(
            f"as many values as cosines and a count >= 1 are needed, found {f.size}, {cosines.size}, {count}"
        )
    room, share = _padded(1.0 - cosines, 0.5), _padded(2.0 * math.pi * f, 0.0)
    out = np.empty(count)
    coefficients_kernel(out, room, share, share, np.empty_like(room), np.empty_like(room))
    return out


def of_bins(values: ArrayLike, edges_deg: ArrayLike, count: int) -> Floats:
    """Return a_0 ... a_{count-1} of a function that is constant between angles, and 0 beyond them; exact.

    Parameters
    ----------
    values : (bins,) array, 1/sr
    edges_deg : (bins + 1,) array
        Ascending scattering angles, 0 to 180 degrees.
    count : int
        How many.

    Notes
    -----
    The integral of P_l is (P_{l+1} - P_{l-1}) / (2l+1), here (d_{l+1} + d_l) / (2l+1): nothing cancels for narrow bins
    at the forward end.
    """
    f, edges = np.asarray(values, np.float64), np.asarray(edges_deg, np.float64)
    ascending = edges.ndim == 1 and f.shape == (edges.size - 1,) and f.size > 0 and bool((np.diff(edges) > 0.0).all())
    if not ascending or edges[0] < 0.0 or edges[-1] > 180.0 or count < 1:
        raise ValueError(
            f"bins need one more ascending edge than values, 0 to 180, and count >= 1, found {edges_deg!r}"
        )
    half = np.asarray(sin(edges * (math.pi / 360.0)), np.float64)
    v = 2.0 * half * half
    p, d = np.ones_like(v), np.zeros_like(v)
    out = np.empty(count)
    for degree in range(count):
        following = (degree * d - (2.0 * degree + 1.0) * v * p) / (degree + 1.0)
        whole = (following + d) / (2.0 * degree + 1.0)  # for l = 0 this is mu - 1
        out[degree] = 2.0 * math.pi * math.fsum(f * (whole[:-1] - whole[1:]))
        p, d = p + following, following
    return out


def of_disc(radius_deg: float, count: int) -> Floats:
    """Return a_0 ... of a uniform disc around the forward direction: factors by which the sun softens a_l (0.25)."""
    half = float(sin(np.float64(radius_deg * (math.pi / 360.0))))
    return of_bins([1.0 / (4.0 * math.pi * half * half)], [0.0, radius_deg], count)


def series(a: ArrayLike, mu: ArrayLike) -> Floats:
    """Return the sum of (2l+1)/(4 pi) a_l P_l(mu) at scattering cosines of any shape (1/sr)."""
    given = np.asarray(a, np.float64)
    cosines = np.asarray(mu, np.float64)
    if not (np.abs(cosines) <= 1.0).all():
        raise ValueError("scattering cosines must be in [-1, 1]")
    degrees = np.arange(given.size + given.size % 2)
    terms = np.zeros(degrees.size)
    terms[: given.size] = given
    terms *= (2.0 * degrees + 1.0) / (4.0 * math.pi)
    flat = cosines.ravel()
    half, place = np.unique(np.abs(flat), return_inverse=True)
    v = np.ones(-(-half.size // N) * N)
    v[: half.size] = 1.0 - half
    ahead, behind = np.empty_like(v), np.empty_like(v)
    sums_kernel(ahead, behind, v, terms)
    return np.where(flat < 0.0, behind[place.ravel()], ahead[place.ravel()]).reshape(cosines.shape)
