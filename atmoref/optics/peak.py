"""Phase functions whose forward peak is cut off: the light in it counts as unscattered.

Within an angle P is held at its value there: P'(theta) = P(max(theta, angle)) / (1 - f), with

    f = 2 pi integral from 0 to the angle of (P - P(angle)) sin(theta) d theta,

and the extinction is (1 - f) times the true one.  Exact for series of Legendre polynomials: the share within an angle
is a sum over l, and coefficients come from a Gauss-Legendre rule on the cap alone, where the integrand is a polynomial.

Source: [Bouthors2008] sec. 3, where the factor is 1/2 and the cut 5 degrees; B-E7 (the factor is 1 - f), B-E8, B-E9.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.optics import legendre
from atmoref.optics.drops import cosines

__all__ = ["Clamped", "clamped", "share_within"]

Floats = NDArray[np.float64]


class Clamped(NamedTuple):
    """A phase function without its peak."""

    whole: Floats  # a_l before
    angle_deg: float
    removed: float  # f
    level: float  # P at the angle (1/sr), before division by 1 - f

    def phase_function(self, mu: ArrayLike) -> Floats:
        """Return P' (1/sr, integral 1) at scattering cosines of any shape."""
        edge = float(cosines(self.angle_deg))
        values: Floats = legendre.series(self.whole, np.minimum(np.asarray(mu, np.float64), edge)) / (
            1.0 - self.removed
        )
        return values

    def legendre(self, count: int) -> Floats:
        """Return a'_0 ... a'_{count-1}; without error but rounding (1e-12)."""
        if count < 1:
            raise ValueError(f"the number of coefficients must be at least 1, found {count}")
        x, weights = legendre.gauss_nodes((self.whole.size + count) // 2 + 1)
        cap = 1.0 - float(cosines(self.angle_deg))
        mu = 1.0 - 0.5 * cap * (1.0 - x)
        excess = 0.5 * cap * weights * (legendre.series(self.whole, mu) - self.level)
        full = np.zeros(count)
        kept = min(count, self.whole.size)
        full[:kept] = self.whole[:kept]
        return (full - legendre.of_points(excess, mu, count)) / (1.0 - self.removed)


def share_within(a: ArrayLike, angle_deg: float) -> float:
    """Return the share of the light that is scattered by less than an angle (0 to 180 degrees, above 0)."""
    given = np.asarray(a, np.float64)
    if not 0.0 < angle_deg <= 180.0:
        raise ValueError(f"an angle must be in (0, 180] degrees, found {angle_deg!r}")
    cap = 1.0 - float(cosines(angle_deg))
    degrees = np.arange(float(given.size))
    return 0.5 * cap * math.fsum((2.0 * degrees + 1.0) * given * legendre.of_disc(angle_deg, given.size))


def clamped(a: ArrayLike, angle_deg: float) -> Clamped:
    """Return a phase function held at its value at `angle_deg` within that angle.

    Parameters
    ----------
    a : (count,) array
        All Legendre coefficients that differ from 0.
    angle_deg : float
        Between 0 and 90.

    Raises
    ------
    ValueError
        For other angles, or if more lies above the level inside than is there to remove.
    """
    given = np.asarray(a, np.float64)
    if not 0.0 < angle_deg <= 90.0:
        raise ValueError(f"a peak ends between 0 and 90 degrees, found {angle_deg!r}")
    level = float(legendre.series(given, cosines(angle_deg)))
    removed = share_within(given, angle_deg) - level * 2.0 * math.pi * (1.0 - float(cosines(angle_deg)))
    if not removed < 1.0:
        raise ValueError(f"nothing is left outside of {angle_deg:g} degrees")
    return Clamped(given, float(angle_deg), removed, level)
