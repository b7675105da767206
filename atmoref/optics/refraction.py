"""Refractive indices of water, ice and air in the visible, from published formulas and tables.

**Water**: IAPWS R9-97, Release on the Refractive Index of Ordinary Water Substance as a Function of Wavelength,
Temperature and Pressure (1997), its equation and coefficients (http://iapws.org/relguide/Rindex.html).  It gives the
index relative to vacuum, from 200 to 1100 nm.  Density at 101,325 Pa after Tanaka et al., Metrologia 38, 301 (2001).
The release's check values come out to all digits printed.  Its own uncertainty is not restated here; what matters is
that 1e-4 of the index moves the primary bow by 0.014 degrees.  Water is taken as not absorbing (the paper's albedo 1).

**Ice**: S. G. Warren and R. E. Brandt, Optical constants of ice from the ultraviolet to the microwave: a revised
compilation, J. Geophys. Res. 113, D14220 (2008), their table (IOP_2008_ASCIItable.dat), taken from the public-domain
database refractiveindex.info (main/H2O/Warren-2008).  Ice Ih at -7 C, relative to vacuum.  Four decimals are printed:
values here are within 1e-4 of the authors' curve.  Between rows the index is linear in the logarithm of the wavelength,
and so is the logarithm of the absorption, as the authors prescribe.

**Air**: P. E. Ciddor, Appl. Opt. 35, 1566 (1996): dry standard air, 15 C, 101,325 Pa, 450 ppm CO2.  In a cloud n - 1 of
the air differs from it by some 10 %, which is 3e-5 of a drop's index.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.elementary import exp, log

__all__ = ["LEAST_NM", "MOST_NM", "air", "ice", "ice_absorption", "water", "water_density", "water_vacuum"]

Floats = NDArray[np.float64]

LEAST_NM, MOST_NM = 380.0, 780.0
"""Wavelengths that are accepted (in vacuum)."""

_WATER = (
    0.244257733,
    9.74634476e-3,
    -3.73234996e-3,
    2.68678472e-4,
    1.58920570e-3,
    2.45934259e-3,
    0.900704920,
    -1.66626219e-2,
)
_WATER_UV, _WATER_IR = 0.2292020, 5.432937

# wavelength (um), real part, imaginary part: Warren and Brandt 2008
_ICE = np.array(
    [
        (0.350, 1.3249, 2.0e-11),
        (0.390, 1.3203, 2.0e-11),
        (0.400, 1.3194, 2.365e-11),
        (0.410, 1.3185, 2.669e-11),
        (0.420, 1.3177, 3.135e-11),
        (0.430, 1.3170, 4.140e-11),
        (0.440, 1.3163, 6.268e-11),
        (0.450, 1.3157, 9.239e-11),
        (0.460, 1.3151, 1.325e-10),
        (0.470, 1.3145, 1.956e-10),
        (0.480, 1.3140, 2.861e-10),
        (0.490, 1.3135, 4.172e-10),
        (0.500, 1.3130, 5.889e-10),
        (0.510, 1.3126, 8.036e-10),
        (0.520, 1.3121, 1.076e-9),
        (0.530, 1.3117, 1.409e-9),
        (0.540, 1.3114, 1.813e-9),
        (0.550, 1.3110, 2.289e-9),
        (0.560, 1.3106, 2.839e-9),
        (0.570, 1.3103, 3.461e-9),
        (0.580, 1.3100, 4.159e-9),
        (0.590, 1.3097, 4.930e-9),
        (0.600, 1.3094, 5.730e-9),
        (0.610, 1.3091, 6.890e-9),
        (0.620, 1.3088, 8.580e-9),
        (0.630, 1.3085, 1.040e-8),
        (0.640, 1.3083, 1.220e-8),
        (0.650, 1.3080, 1.430e-8),
        (0.660, 1.3078, 1.660e-8),
        (0.670, 1.3076, 1.890e-8),
        (0.680, 1.3073, 2.090e-8),
        (0.690, 1.3071, 2.400e-8),
        (0.700, 1.3069, 2.900e-8),
        (0.710, 1.3067, 3.440e-8),
        (0.720, 1.3065, 4.030e-8),
        (0.730, 1.3062, 4.300e-8),
        (0.740, 1.3060, 4.920e-8),
        (0.750, 1.3059, 5.870e-8),
        (0.760, 1.3057, 7.080e-8),
        (0.770, 1.3055, 8.580e-8),
        (0.780, 1.3053, 1.020e-7),
        (0.790, 1.3051, 1.180e-7),
    ]
)


def _wavelengths(wavelength_nm: ArrayLike) -> Floats:
    nm = np.asarray(wavelength_nm, np.float64)
    if not ((nm >= LEAST_NM) & (nm <= MOST_NM)).all():
        raise ValueError(f"wavelengths must be {LEAST_NM:g} to {MOST_NM:g} nm, found {wavelength_nm!r}")
    return nm


def water_density(temperature_c: float) -> float:
    """Return the density of water (kg/m^3) at 101,325 Pa, 0 to 40 C: Tanaka et al. 2001."""
    if not 0.0 <= temperature_c <= 40.0:
        raise ValueError(f"the temperature of water must be 0 to 40 C, found {temperature_c!r}; else give a density")
    t = temperature_c
    return 999.974950 * (1.0 - (t - 3.983035) * (t - 3.983035) * (t + 301.797) / (522528.9 * (t + 69.34881)))


def water_vacuum(
    wavelength_nm: ArrayLike, temperature_c: float = 10.0, density_kg_per_m3: float | None = None
) -> Floats:
    """Return the index of water relative to vacuum: IAPWS R9-97.

    Parameters
    ----------
    wavelength_nm : array
        In vacuum, nm; the release holds from 200 to 1100 nm.
    temperature_c : float
        Celsius; the release holds from -12 to 500.
    density_kg_per_m3 : float, optional
        That of `water_density` if left out.

    Returns
    -------
    float64 array of the shape of `wavelength_nm`.

    Raises
    ------
    ValueError
        For wavelengths outside, or a temperature outside 0 to 40 C without a density.
    """
    micrometres = np.asarray(wavelength_nm, np.float64) / 1000.0
    if not ((micrometres >= 0.2) & (micrometres <= 1.1)).all():
        raise ValueError(f"wavelengths in water must be 200 to 1100 nm, found {wavelength_nm!r}")
    rho = (water_density(temperature_c) if density_kg_per_m3 is None else density_kg_per_m3) / 1000.0
    t = (temperature_c + 273.15) / 273.15
    square = (micrometres / 0.589) * (micrometres / 0.589)
    a = _WATER
    inner = a[0] + a[1] * rho + a[2] * t + a[3] * square * t + a[4] / square + a[7] * rho * rho
    inner = inner + a[5] / (square - _WATER_UV * _WATER_UV) + a[6] / (square - _WATER_IR * _WATER_IR)
    share = inner * rho  # (n^2 - 1) / (n^2 + 2)
    index: Floats = np.sqrt((1.0 + 2.0 * share) / (1.0 - share))
    return index


def air(wavelength_nm: ArrayLike) -> Floats:
    """Return the index of dry standard air (15 C, 101,325 Pa, 450 ppm CO2) relative to vacuum: Ciddor 1996; 1e-8."""
    nm = _wavelengths(wavelength_nm)
    wavenumber = (1000.0 / nm) * (1000.0 / nm)
    index: Floats = 1.0 + 0.05792105 / (238.0185 - wavenumber) + 0.00167917 / (57.362 - wavenumber)
    return index


def water(wavelength_nm: ArrayLike, temperature_c: float = 10.0) -> Floats:
    """Return the index of water relative to air: what light in air meets at a drop."""
    nm = _wavelengths(wavelength_nm)
    index: Floats = water_vacuum(nm, temperature_c) / air(nm)
    return index


def _of_ice(wavelength_nm: ArrayLike, column: Floats) -> Floats:
    """Return a column of the table, linear between its rows in the logarithm of the wavelength."""
    micrometres = _wavelengths(wavelength_nm) / 1000.0
    grid = _ICE[:, 0]
    i = np.clip(np.searchsorted(grid, micrometres, side="right") - 1, 0, grid.size - 2)
    along = log(micrometres / grid[i]) / log(grid[i + 1] / grid[i])
    value: Floats = np.asarray(column[i] + (column[i + 1] - column[i]) * along, np.float64)
    return value


def ice(wavelength_nm: ArrayLike) -> Floats:
    """Return the index of ice Ih (-7 C) relative to vacuum; in air it is 3.6e-4 less (a 22 degree halo: 0.03)."""
    return _of_ice(wavelength_nm, _ICE[:, 1])


def ice_absorption(wavelength_nm: ArrayLike) -> Floats:
    """Return the imaginary part of the index of ice: relative error 5e-3 (digits printed)."""
    value: Floats = np.asarray(exp(_of_ice(wavelength_nm, np.asarray(log(_ICE[:, 2])))), np.float64)
    return value
