"""How many particles of which radius: size distributions, cut into equal cells with one radius each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import exp, log

__all__ = ["Lognormal", "ModifiedGamma", "OneSize", "Radii", "Sizes"]

Floats = NDArray[np.float64]


class Radii(NamedTuple):
    """Radii (m) and the share of all particles each stands for; the shares sum to 1."""

    radii_m: Floats
    shares: Floats


def _shared(radii_m: Floats, density: Floats) -> Radii:
    return Radii(radii_m, density / math.fsum(density))


def _count(count: int) -> int:
    if count < 1:
        raise ValueError(f"the number of radii must be at least 1, found {count}")
    return count


@dataclass(frozen=True, slots=True)
class Lognormal:
    """dN / d ln r proportional to exp(-(ln(r / median) / ln sigma_g)^2 / 2), cut at `cut` times ln sigma_g."""

    median_m: float
    sigma_g: float
    cut: float = 3.0

    def __post_init__(self) -> None:
        if not (self.median_m > 0.0 and self.sigma_g > 1.0 and self.cut > 0.0):
            raise ValueError(f"a lognormal needs median_m > 0, sigma_g > 1 and cut > 0, found {self}")

    def radii(self, count: int) -> Radii:
        """Return the middles of `count` cells of equal width in ln r."""
        u = self.cut * (2.0 * (np.arange(_count(count)) + 0.5) / count - 1.0)
        radii = self.median_m * np.asarray(exp(u * float(log(self.sigma_g))), np.float64)
        return _shared(radii, np.asarray(exp(-0.5 * u * u), np.float64))


@dataclass(frozen=True, slots=True)
class ModifiedGamma:
    """dN / dr proportional to r^(gamma - 1) exp(-r / scale), cut where less than 1e-9 of the cross-section is left.

    Effective radius (gamma + 2) scale, effective variance 1 / (gamma + 2).  Source: [Bouthors2008] eq. (3).
    """

    scale_m: float
    gamma: float

    def __post_init__(self) -> None:
        if not (self.scale_m > 0.0 and 0.0 < self.gamma <= 100.0):
            raise ValueError(f"a modified gamma needs scale_m > 0 and 0 < gamma <= 100, found {self}")

    def radii(self, count: int) -> Radii:
        """Return the middles of `count` cells of equal width in r."""
        most = self.gamma + 2.0 + 30.0 * np.sqrt(1.0 + 0.1 * self.gamma)
        u = most * (np.arange(_count(count)) + 0.5) / count
        return _shared(u * self.scale_m, np.asarray(exp((self.gamma - 1.0) * log(u) - u), np.float64))


@dataclass(frozen=True, slots=True)
class OneSize:
    """All particles alike."""

    radius_m: float

    def __post_init__(self) -> None:
        if not self.radius_m > 0.0:
            raise ValueError(f"a radius must be positive, found {self}")

    def radii(self, count: int) -> Radii:
        """Return the one radius, whatever `count`."""
        _count(count)
        return Radii(np.array([self.radius_m]), np.ones(1))


Sizes = Lognormal | ModifiedGamma | OneSize
