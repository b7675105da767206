"""Air of Riley et al. 2004: Rayleigh scattering without depolarisation, eq. (1).

Extinction: the paper's Table 2.  Its wavelengths read 650, 515, 440 nm, but the values go like the fourth power of 680,
550, 440 nm and are those of its Table 3 (R-E12); here 5.33e-31 m^2 at 550 nm, times (550 / wavelength)^4.  Measured air
has 15 to 20 % less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.optics.drops import CrossSections, cosines
from atmoref.optics.orders import Split
from atmoref.optics.phase_functions import RAYLEIGH, evaluate
from atmoref.optics.single import Progress, Single

__all__ = ["AIR", "Molecules"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Molecules:
    """Particles far smaller than the wavelength; `extinction_m2` is that at 550 nm."""

    extinction_m2: float

    def cross_sections(self, wavelength_nm: float) -> CrossSections:
        """Return the cross-sections (nothing is absorbed) at a vacuum wavelength of 380 to 780 nm; asymmetry 0."""
        if not 380.0 <= wavelength_nm <= 780.0:
            raise ValueError(f"wavelengths must be 380 to 780 nm, found {wavelength_nm!r}")
        ratio = (550.0 / wavelength_nm) * (550.0 / wavelength_nm)
        return CrossSections(self.extinction_m2 * ratio * ratio, self.extinction_m2 * ratio * ratio, 0.0)

    def phase_function(self, mu: ArrayLike, wavelength_nm: float) -> Floats:
        """Return 3/(16 pi) (1 + mu^2), the same for every wavelength (1/sr)."""
        self.cross_sections(wavelength_nm)
        return evaluate(RAYLEIGH, 0.0, mu)

    def split(self, wavelength_nm: float, count: int) -> Split:
        """Return no peak, and the coefficients 1, 0, 1/10, 0, ..."""
        self.cross_sections(wavelength_nm)
        whole = np.zeros(max(count, 3))
        whole[0], whole[2] = 1.0, 0.1
        return Split(0.0, whole[:count])

    def single(self, wavelength_nm: float, angles_deg: ArrayLike, progress: Progress | None = None) -> Single:
        """Return light scattered once (see `Single`)."""
        values = self.phase_function(cosines(angles_deg), wavelength_nm)
        return Single(0.0, values, self.split(wavelength_nm, 3).rest)


AIR = Molecules(extinction_m2=5.33e-31)
