"""Radiance at many wavelengths to linear sRGB, through the colour-matching functions of the CIE.

X = integral of L(lambda) x(lambda), and so on, of a spectrum that is linear between its wavelengths and zero beyond
them; then linear sRGB (IEC 61966-2-1, D65), adapted so that a chosen spectrum is white.

Source: CIE 1931 standard observer, 2 degrees (CIE 15), every 5 nm from 380 to 780.  Against every nanometre from 360 to
830: of a flat spectrum X and Y differ by 1e-4, Z by 4.3e-4 (nearly all of it lies beyond 380 nm); chromaticities of
black bodies (2856, 6500 K) by 6e-5.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["matching_functions", "to_srgb", "weights"]

Floats = NDArray[np.float64]

FIRST_NM, STEP_NM = 380.0, 5.0
_OBSERVER = (
    (0.001368, 3.9e-05, 0.006450001),
    (0.002236, 6.4e-05, 0.01054999),
    (0.004243, 0.00012, 0.02005001),
    (0.00765, 0.000217, 0.03621),
    (0.01431, 0.000396, 0.06785001),
    (0.02319, 0.00064, 0.1102),
    (0.04351, 0.00121, 0.2074),
    (0.07763, 0.00218, 0.3713),
    (0.13438, 0.004, 0.6456),
    (0.21477, 0.0073, 1.0390501),
    (0.2839, 0.0116, 1.3856),
    (0.3285, 0.01684, 1.62296),
    (0.34828, 0.023, 1.74706),
    (0.34806, 0.0298, 1.7826),
    (0.3362, 0.038, 1.77211),
    (0.3187, 0.048, 1.7441),
    (0.2908, 0.06, 1.6692),
    (0.2511, 0.0739, 1.5281),
    (0.19536, 0.09098, 1.28764),
    (0.1421, 0.1126, 1.0419),
    (0.09564, 0.13902, 0.8129501),
    (0.05795001, 0.1693, 0.6162),
    (0.03201, 0.20802, 0.46518),
    (0.0147, 0.2586, 0.3533),
    (0.0049, 0.323, 0.272),
    (0.0024, 0.4073, 0.2123),
    (0.0093, 0.503, 0.1582),
    (0.0291, 0.6082, 0.1117),
    (0.06327, 0.71, 0.07824999),
    (0.1096, 0.7932, 0.05725001),
    (0.1655, 0.862, 0.04216),
    (0.2257499, 0.9148501, 0.02984),
    (0.2904, 0.954, 0.0203),
    (0.3597, 0.9803, 0.0134),
    (0.4334499, 0.9949501, 0.008749999),
    (0.5120501, 1.0, 0.005749999),
    (0.5945, 0.995, 0.0039),
    (0.6784, 0.9786, 0.002749999),
    (0.7621, 0.952, 0.0021),
    (0.8425, 0.9154, 0.0018),
    (0.9163, 0.87, 0.001650001),
    (0.9786, 0.8163, 0.0014),
    (1.0263, 0.757, 0.0011),
    (1.0567, 0.6949, 0.001),
    (1.0622, 0.631, 0.0008),
    (1.0456, 0.5668, 0.0006),
    (1.0026, 0.503, 0.00034),
    (0.9384, 0.4412, 0.00024),
    (0.8544499, 0.381, 0.00019),
    (0.7514, 0.321, 0.0001),
    (0.6424, 0.265, 4.999999e-05),
    (0.5419, 0.217, 3e-05),
    (0.4479, 0.175, 2e-05),
    (0.3608, 0.1382, 1e-05),
    (0.2835, 0.107, 0.0),
    (0.2187, 0.0816, 0.0),
    (0.1649, 0.061, 0.0),
    (0.1212, 0.04458, 0.0),
    (0.0874, 0.032, 0.0),
    (0.0636, 0.0232, 0.0),
    (0.04677, 0.017, 0.0),
    (0.0329, 0.01192, 0.0),
    (0.0227, 0.00821, 0.0),
    (0.01584, 0.005723, 0.0),
    (0.01135916, 0.004102, 0.0),
    (0.008110916, 0.002929, 0.0),
    (0.005790346, 0.002091, 0.0),
    (0.004109457, 0.001484, 0.0),
    (0.002899327, 0.001047, 0.0),
    (0.00204919, 0.00074, 0.0),
    (0.001439971, 0.00052, 0.0),
    (0.0009999493, 0.0003611, 0.0),
    (0.0006900786, 0.0002492, 0.0),
    (0.0004760213, 0.0001719, 0.0),
    (0.0003323011, 0.00012, 0.0),
    (0.0002348261, 8.48e-05, 0.0),
    (0.0001661505, 6e-05, 0.0),
    (0.000117413, 4.24e-05, 0.0),
    (8.307527e-05, 3e-05, 0.0),
    (5.870652e-05, 2.12e-05, 0.0),
    (4.150994e-05, 1.499e-05, 0.0),
)
_SRGB = (  # XYZ to linear sRGB, D65
    (3.2404541621, -1.5371385128, -0.4985314096),
    (-0.9692660305, 1.8760108454, 0.0415560175),
    (0.0556434310, -0.2040259135, 1.0572251882),
)
_BRADFORD = ((0.8951, 0.2664, -0.1614), (-0.7502, 1.7135, 0.0367), (0.0389, -0.0685, 1.0296))
_D65 = (0.95047, 1.0, 1.08883)


def matching_functions() -> tuple[Floats, Floats]:
    """Return wavelengths (nm) and the functions x, y, z (wavelengths, 3)."""
    table = np.array(_OBSERVER, np.float64)
    return FIRST_NM + STEP_NM * np.arange(float(len(table))), table


def _tristimulus(wavelengths_nm: ArrayLike) -> Floats:
    """Return what radiance 1 at each wavelength alone adds to X, Y, Z: (W, 3), for wavelengths in any order."""
    given = np.asarray(wavelengths_nm, np.float64)
    grid, functions = matching_functions()
    if given.ndim != 1 or given.size < 2 or not ((given >= grid[0]) & (given <= grid[-1])).all():
        raise ValueError(
            f"colours need two or more wavelengths of {grid[0]:g} to {grid[-1]:g} nm, found {given.tolist()}"
        )
    order = np.argsort(given)
    if (np.diff(given[order]) == 0.0).any():
        raise ValueError(f"wavelengths must differ, found {given.tolist()}")
    found = np.empty((given.size, 3))
    for place in order:
        unit = np.zeros(given.size)
        unit[place] = 1.0
        # fine enough to meet every wavelength: the spectrum's corners count
        fine = np.union1d(grid, given)
        hat = np.interp(fine, given[order], unit[order], left=0.0, right=0.0)
        curves = np.array([np.interp(fine, grid, functions[:, i]) for i in range(3)])
        product = hat * curves
        found[place] = (0.5 * (product[:, 1:] + product[:, :-1]) * np.diff(fine)).sum(1)
    return found


def weights(wavelengths_nm: ArrayLike, white: ArrayLike | None = None) -> Floats:
    """Return the matrix (W, 3) that turns radiances into linear sRGB.

    Parameters
    ----------
    wavelengths_nm : (W,) array
        Two or more, 380 to 780.
    white : (W,) array, optional
        The spectrum that becomes (1, 1, 1): sunlight, for instance; equal radiances if left out.

    Raises
    ------
    ValueError
        For other wavelengths, or a white that is black.
    """
    xyz = _tristimulus(wavelengths_nm)
    spectrum = np.ones(len(xyz)) if white is None else np.asarray(white, np.float64)
    if spectrum.shape != (len(xyz),) or not np.isfinite(spectrum).all() or not (spectrum @ xyz > 0.0).all():
        raise ValueError(f"white needs {len(xyz)} radiances that are not black, found {white!r}")
    bradford, source = np.array(_BRADFORD), spectrum @ xyz
    gains = (bradford @ np.array(_D65)) / (bradford @ source)
    adapted = np.linalg.inv(bradford) @ (gains[:, None] * bradford)
    matrix: Floats = xyz @ (np.array(_SRGB) @ adapted).T
    return matrix / (spectrum @ matrix)  # the matrices have ten digits: white is white to all of them


def to_srgb(radiance: ArrayLike, wavelengths_nm: ArrayLike, white: ArrayLike | None = None) -> Floats:
    """Return linear sRGB (..., 3) of radiances (..., W); saturated colours have negative parts, see `weights`."""
    given = np.asarray(radiance, np.float64)
    matrix = weights(wavelengths_nm, white)
    if given.shape[-1:] != matrix.shape[:1]:
        raise ValueError(f"radiances need {len(matrix)} wavelengths as their last axis, found shape {given.shape}")
    colours: Floats = given @ matrix
    return colours
