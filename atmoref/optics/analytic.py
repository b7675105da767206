"""Particles whose phase function is a formula: Henyey-Greenstein, Cornette-Shanks, Nishita's hazy and murky air."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.optics import legendre
from atmoref.optics.drops import CrossSections, cosines
from atmoref.optics.orders import Split
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate
from atmoref.optics.single import Progress, Single

__all__ = ["Formula"]

Floats = NDArray[np.float64]
LEAST = 1e-15  # coefficients below it are left out: the noise of quadrature
MOST = 4096


@dataclass(frozen=True, slots=True)
class Formula:
    """One formula for all wavelengths; nothing is absorbed.

    Attributes
    ----------
    phase
        A name of `PHASE_FUNCTIONS`.
    extinction_m2
        Cross-section of one particle.
    g
        Asymmetry, -0.98 to 0.98; read by Henyey-Greenstein and Cornette-Shanks alone.
    """

    phase: str
    extinction_m2: float
    g: float = 0.0

    def __post_init__(self) -> None:
        if self.phase not in PHASE_FUNCTIONS:
            raise ValueError(f"phase: found {self.phase!r}; allowed: {', '.join(PHASE_FUNCTIONS)}")
        if not (-0.98 <= self.g <= 0.98 and self.extinction_m2 > 0.0):
            raise ValueError(f"a formula needs g from -0.98 to 0.98 and extinction_m2 > 0, found {self}")

    def cross_sections(self, wavelength_nm: float) -> CrossSections:
        """Return the cross-sections and the mean cosine, the same at every wavelength."""
        asymmetry = float(self._coefficients()[1]) if self.phase != "isotropic" else 0.0
        return CrossSections(self.extinction_m2, self.extinction_m2, asymmetry)

    def phase_function(self, mu: ArrayLike, wavelength_nm: float) -> Floats:
        """Return the phase function (1/sr) at scattering cosines of any shape."""
        return evaluate(PHASE_FUNCTIONS[self.phase], self.g, mu)

    def _coefficients(self) -> Floats:
        """Return a_l down to `LEAST`: g^l, or Gauss-Legendre quadrature (these formulas are analytic)."""
        if self.phase == "henyey_greenstein":
            a = np.cumprod(np.concatenate([[1.0], np.full(MOST - 1, self.g)]))
        else:
            mu, _ = legendre.gauss_nodes(2 * MOST)
            a = legendre.coefficients(evaluate(PHASE_FUNCTIONS[self.phase], self.g, mu), MOST // 2)
        kept = np.flatnonzero(np.abs(a) > LEAST)
        return a[: max(int(kept[-1]) + 1, 2)]

    def split(self, wavelength_nm: float, count: int) -> Split:
        """Return no peak, and the first coefficients."""
        a, whole = self._coefficients(), np.zeros(count)
        whole[: a.size] = a[:count]
        return Split(0.0, whole)

    def single(self, wavelength_nm: float, angles_deg: ArrayLike, progress: Progress | None = None) -> Single:
        """Return light scattered once (see `Single`)."""
        return Single(0.0, self.phase_function(cosines(angles_deg), wavelength_nm), self._coefficients())


def disc_m2(radius_m: float) -> float:
    """Return 2 pi r^2, the extinction cross-section of a sphere much larger than the wavelength."""
    return 2.0 * math.pi * radius_m * radius_m
