"""Phase functions of many spheres of different sizes, and the particles made of water drops.

Averaged is C_sca P, not P: P(mu) = sum of share (|S1|^2 + |S2|^2) / (2 k^2) over the sum of share C_sca.  That last sum
comes from the coefficients a_n, b_n, never from the integral of P; that the integral is 1 is a check.

Small drops (`Drops.through = "series"`): intensities stand at the nodes of a Gauss-Legendre rule that is exact for
their degree, and everything else follows from the Legendre coefficients, the phase function at any angle included; sums
of 1000 radii cost a tenth of a second.  Large ones (`"angles"`): intensities stand at the angles asked for.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.elementary import cos
from atmoref.optics import legendre, mie
from atmoref.optics.orders import Split
from atmoref.optics.refraction import air, water
from atmoref.optics.single import Progress, Single
from atmoref.optics.sizes import Sizes

__all__ = ["BeyondPeak", "CrossSections", "Drops", "cosines"]

Floats = NDArray[np.float64]

BINS = 3600  # of scattering angle, for large drops
BIN_TERMS = 3000
PEAK_DEG = 1.0
EDGE_BINS = 4
PORTION = 100  # sizes between two reports of progress


class CrossSections(NamedTuple):
    """Mean cross-sections of one particle (m^2) and the mean cosine of scattering."""

    extinction_m2: float
    scattering_m2: float
    asymmetry: float


class BeyondPeak(NamedTuple):
    """A phase function whose peak is `delta`: `values` (1/sr, integral 1) of the rest, constant in bins of angle."""

    delta: float
    middles_deg: Floats
    values: Floats
    edges_deg: Floats

    def legendre(self, count: int) -> Floats:
        """Return Legendre coefficients of the rest."""
        return legendre.of_bins(self.values, self.edges_deg, count)


def cosines(angles_deg: ArrayLike) -> Floats:
    """Return cosines of angles from 0 to 180 degrees; those of d and 180 - d are exact mirror images."""
    angles = np.asarray(angles_deg, np.float64)
    if not ((angles >= 0.0) & (angles <= 180.0)).all():
        raise ValueError("scattering angles must be 0 to 180 degrees")
    behind = angles > 90.0
    value = np.asarray(cos(np.where(behind, 180.0 - angles, angles) * (math.pi / 180.0)), np.float64)
    value = np.where(angles == 90.0, 0.0, value)
    return np.where(behind, -value, value)


@dataclass(frozen=True, slots=True)
class Drops:
    """Water drops in air.

    Attributes
    ----------
    sizes
        Distribution of radii.
    radii
        How many radii stand for it by default.
    extinction_m2
        Cross-section with which the particle is rendered (the paper's Table 2); optics here computes its own.
    through
        "series" or "angles", see the module's text.
    temperature_c
        Of the water.
    fine_radii
        How many radii stand for it in tables; `radii` if left out.
    size_error
        How far phase functions by so many are from converged ones: relative, root mean square over angles (of rain
        beyond the peak), measured at 550 nm. A statement that tables carry with them; nothing is computed from it.
    """

    sizes: Sizes
    radii: int
    extinction_m2: float
    through: Literal["series", "angles"] = "series"
    temperature_c: float = 10.0
    fine_radii: int | None = None
    size_error: float | None = None

    def _spheres(self, wavelength_nm: float, radii: int | None) -> tuple[complex, Floats, Floats, float]:
        """Return index, size parameters, shares and 1/k^2 (m^2); the wavelength is that in vacuum."""
        index = complex(float(water(wavelength_nm, self.temperature_c)))
        wave_number = 2.0 * math.pi * float(air(wavelength_nm)) / (wavelength_nm * 1e-9)
        chosen = self.sizes.radii(self.radii if radii is None else radii)
        return index, wave_number * chosen.radii_m, chosen.shares, 1.0 / (wave_number * wave_number)

    def cross_sections(self, wavelength_nm: float, radii: int | None = None) -> CrossSections:
        """Return the mean cross-sections and the asymmetry for light of a vacuum wavelength (380 to 780 nm)."""
        index, x, shares, area = self._spheres(wavelength_nm, radii)
        found = mie.efficiencies(index, x)
        disc = math.pi * area * shares * x * x
        extinction, scattering = math.fsum(disc * found.extinction), math.fsum(disc * found.scattering)
        return CrossSections(extinction, scattering, math.fsum(disc * found.scattering * found.asymmetry) / scattering)

    def _at(self, mu: ArrayLike, wavelength_nm: float, radii: int | None) -> Floats:
        """Return the phase function summed directly at scattering cosines."""
        index, x, shares, area = self._spheres(wavelength_nm, radii)
        scattering = self.cross_sections(wavelength_nm, radii).scattering_m2
        return mie.intensities(index, x, shares, mu) * (0.5 * area / scattering)

    def legendre(self, wavelength_nm: float, radii: int | None = None, count: int | None = None) -> Floats:
        """Return Legendre coefficients a_0 ... of the phase function, without error but rounding.

        Parameters
        ----------
        wavelength_nm : float
            In vacuum, 380 to 780.
        radii : int, optional
            Number of radii.
        count : int, optional
            Number of coefficients; all that differ from 0 (2 n + 1 for n Mie terms) if left out.

        Raises
        ------
        ValueError
            For drops so large that the rule would need more than 50,000 nodes.
        """
        _, x, _, _ = self._spheres(wavelength_nm, radii)
        terms = int(mie.number_of_terms(x).max())
        if terms > 25_000:
            raise ValueError(f"a series of degree {2 * terms} is not summed here: the drops are too large")
        kept = 2 * terms + 1 if count is None else min(count, 2 * terms + 1)
        a = _coefficients(self, wavelength_nm, radii, terms + kept // 2 + 1, kept)
        return a if count is None else np.concatenate([a, np.zeros(count - kept)])

    def split(self, wavelength_nm: float, count: int) -> Split:
        """Return the forward peak, which only large drops have, and the first coefficients of the rest."""
        if self.through == "series":
            return Split(0.0, self.legendre(wavelength_nm, count=count))
        found = self.beyond_peak(wavelength_nm, self.radii)
        return Split(found.delta, found.legendre(count))

    def phase_function(self, mu: ArrayLike, wavelength_nm: float, radii: int | None = None) -> Floats:
        """Return the phase function (1/sr, integral 1) at scattering cosines of any shape.

        Error of the sums alone: 1e-12 of the forward value (`"series"`), 1e-9 relative (`"angles"`); that of the number
        of radii is measured in the documentation.
        """
        if self.through == "series":
            return legendre.series(self.legendre(wavelength_nm, radii), mu)
        return self._at(mu, wavelength_nm, radii)

    def single(self, wavelength_nm: float, angles_deg: ArrayLike, progress: Progress | None = None) -> Single:
        """Return light scattered once (see `Single`) by `fine_radii` sizes; of large drops `beyond_peak`."""
        radii = self.radii if self.fine_radii is None else self.fine_radii
        if self.through == "series":
            a = self.legendre(wavelength_nm, radii)
            return Single(0.0, legendre.series(a, cosines(angles_deg)), a)
        found = self.beyond_peak(wavelength_nm, radii, progress)
        at = np.interp(np.asarray(angles_deg, np.float64), found.middles_deg, found.values)
        return Single(found.delta, at, found.legendre(BIN_TERMS))

    def beyond_peak(self, wavelength_nm: float, radii: int, progress: Progress | None = None) -> BeyondPeak:
        """Return the phase function without its forward peak, in bins (R-E17).

        Large drops diffract half of the light into less than 0.1 degrees.  What remains is the phase function held
        within `PEAK_DEG` at what it is there (mean of `EDGE_BINS`); all above that is delta.
        """
        edges = np.linspace(0.0, 180.0, BINS + 1)
        middles = 0.5 * (edges[:-1] + edges[1:])
        inside = int(np.searchsorted(middles, PEAK_DEG))
        index, x, shares, area = self._spheres(wavelength_nm, radii)
        mu, values = cosines(middles[inside:]), np.zeros(BINS)
        for start in range(0, x.size, PORTION):
            part = slice(start, start + PORTION)
            values[inside:] += mie.intensities(index, x[part], shares[part], mu)
            if progress is not None:
                progress(f"{x.size} sizes of drops at {wavelength_nm:g} nm", min(1.0, (start + PORTION) / x.size))
        values *= 0.5 * area / self.cross_sections(wavelength_nm, radii).scattering_m2
        values[:inside] = math.fsum(values[inside : inside + EDGE_BINS]) / EDGE_BINS
        held = 2.0 * math.pi * math.fsum(values * -np.diff(cosines(edges)))
        return BeyondPeak(1.0 - held, middles, values / held, edges)


@functools.lru_cache(maxsize=32)
def _coefficients(drops: Drops, wavelength_nm: float, radii: int | None, nodes: int, count: int) -> Floats:
    """Return coefficients by a rule of n + count/2 + 1 nodes: exact for P P_l, whose degree is below 2n + count."""
    mu, _ = legendre.gauss_nodes(nodes)
    a = legendre.coefficients(drops._at(mu, wavelength_nm, radii), count)
    a.flags.writeable = False
    return a
