"""Light scattered n times: multiple convolutions of a phase function, their forward share, peaks taken out.

All of it is arithmetic on Legendre coefficients a_l (a_0 = 1), because a zonal convolution on the sphere multiplies
them: Ams_n has a_l^n.  The number of orders is not limited.  `legendre.series` gives values at angles.

Peaks.  A phase function with a peak too narrow for a table (diffraction by rain, light that passes ice undeviated) is
split, P = f delta + (1 - f) P', a'_l = (a_l - f) / (1 - f).  Then

    Ams_n = f^n delta + sum of (2l+1)/(4 pi) (a_l^n - f^n) P_l,

which is exact for any f; its second part is smooth where f is the share of the peak (R-E17).

Source: [Riley2004] eqs. (20) and (23); errata R-E7 (telescoped, averaged), R-E11 (mixtures), R-E17, R-E21 (Poisson).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.elementary import exp

__all__ = [
    "Split",
    "forward_share",
    "mean_forward_share",
    "mixture",
    "poisson",
    "power",
    "split",
    "split_power",
]

Floats = NDArray[np.float64]


class Split(NamedTuple):
    """A phase function as `delta` times a peak in the exact forward direction plus 1 - delta times a smooth rest."""

    delta: float
    rest: Floats  # a'_l of the smooth part, a'_0 = 1


def _checked(a: ArrayLike) -> Floats:
    given = np.asarray(a, np.float64)
    if given.ndim != 1 or not given.size or not abs(given[0] - 1.0) < 1e-4 or not (np.abs(given) < 1.0001).all():
        raise ValueError("Legendre coefficients stand in one row, the first is 1 (within 1e-4), none exceeds 1")
    scaled: Floats = given / given[0]
    return scaled


def power(a: ArrayLike, n: int) -> Floats:
    """Return the coefficients a_l^n of light scattered n times: Ams_n; n = 0 is the beam itself (all 1).

    They are divided by a_0 first: its error grows with n otherwise.  Repeated squaring, so the bits are ours.
    """
    if n < 0:
        raise ValueError(f"the number of scatterings must not be negative, found {n}")
    base = _checked(a)
    result = np.ones_like(base)
    while n:
        if n & 1:
            result = result * base
        base = base * base
        n >>= 1
    return result


def poisson(a: ArrayLike, depth: float) -> Floats:
    """Return a_l exp(-depth (1 - a_l)): one scattering more than a Poisson number of mean `depth` (R-E21)."""
    if not depth >= 0.0:
        raise ValueError(f"an optical depth must not be negative, found {depth!r}")
    base = _checked(a)
    value: Floats = base * np.asarray(exp(-depth * (1.0 - base)), np.float64)
    return value


def _half_integrals(count: int) -> Floats:
    """Return (2l+1) times the integral of P_l from 0 to 1 for odd l below `count`, else 0: P_{l-1}(0) (2l+1)/(l+1)."""
    out = np.zeros(count)
    at_zero = 1.0  # P_{l-1}(0)
    for degree in range(1, count, 2):
        out[degree] = (2.0 * degree + 1.0) * at_zero / (degree + 1.0)
        at_zero *= -degree / (degree + 1.0)
    return out


def _ordered_sum(values: Floats) -> float:
    """Return the sum in order: one after the other, so that the bits do not depend on the machine."""
    total = 0.0
    for value in values.tolist():
        total += value
    return total


def forward_share(a: ArrayLike) -> float:
    """Return F, the share that goes on into the forward hemisphere: 1/2 + 1/2 sum over odd l of (2l+1) c_l a_l.

    For light scattered n times give `power(a, n)`.  The series of a single sharp peak converges slowly (like l^(-3/2)):
    give all coefficients, or split the peak.
    """
    base = _checked(a)
    return 0.5 + 0.5 * _ordered_sum(_half_integrals(base.size) * base)


def mean_forward_share(a: ArrayLike, depth: float) -> float:
    """Return the forward share of light scattered a Poisson number of times of mean `depth` (R-E7).

    The unscattered part exp(-depth) is forward altogether and is summed apart: its coefficients don't fall.
    """
    base = _checked(a)
    unscattered = float(exp(np.float64(-depth)))
    scattered = np.asarray(exp(-depth * (1.0 - base)), np.float64) - unscattered
    return unscattered + 0.5 * (1.0 - unscattered) + 0.5 * _ordered_sum(_half_integrals(base.size) * scattered)


def split(a: ArrayLike, delta: float) -> Split:
    """Return a phase function with the share `delta` of forward peak taken out of it.

    Parameters
    ----------
    a : (count,) array
        Legendre coefficients of the whole.
    delta : float
        From 0 to below 1.  For large drops about 1/2 (diffraction), or a_l where the peak alone is left.
    """
    if not 0.0 <= delta < 1.0:
        raise ValueError(f"the share of the peak must be in [0, 1), found {delta!r}")
    return Split(float(delta), (_checked(a) - delta) / (1.0 - delta))


def split_power(parts: Split, n: int) -> tuple[float, Floats]:
    """Return f^n and the coefficients a_l^n - f^n of what is not in the peak after n scatterings."""
    whole = parts.delta + (1.0 - parts.delta) * parts.rest
    peak = float(power(np.array([1.0, parts.delta]), n)[1])
    return peak, power(whole, n) - peak


def mixture(shares: Sequence[float], coefficients: Sequence[ArrayLike]) -> Floats:
    """Return the coefficients of a mixture by shares of scattering: its Ams_n are powers of these (R-E11, "coeff")."""
    if len(shares) != len(coefficients) or not shares or min(shares) < 0.0 or not sum(shares) > 0.0:
        raise ValueError("a mixture needs as many shares, none negative, as sets of coefficients")
    rows = [_checked(a) for a in coefficients]
    out = np.zeros(max(row.size for row in rows))
    for share, row in zip(shares, rows, strict=True):
        out[: row.size] += share * row
    return out / sum(shares)
