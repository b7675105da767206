"""Where theory puts bows, halos and coronas, and where a tabulated phase function has them.

Angles are scattering angles in degrees: 0 towards the sun, 180 at the antisolar point.  For reports and tests: but for
`between` nothing here feeds a table, so the standard library's functions serve.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.elementary import atan2

__all__ = ["between", "bow_deg", "dark_rings_deg", "halo_deg", "lowest_deg", "peak_deg", "turning_points_deg"]

Floats = NDArray[np.float64]

_DARK = (3.8317059702075125, 7.015586669815619, 10.173468135062722)  # zeros of J_1


def bow_deg(index: float, reflections: int) -> float:
    """Return the angle of the bow of 1, 2, ... inner reflections: Descartes' ray, cos^2 i = (n^2 - 1)/(k^2 + 2k).

    Folded into 0 to 180 degrees.  Mie theory has the peak some 0.2 degrees inside the bright side (primary).
    """
    k = reflections
    incident = math.acos(math.sqrt((index * index - 1.0) / (k * k + 2.0 * k)))
    refracted = math.asin(math.sin(incident) / index)
    turned = math.degrees(k * math.pi + 2.0 * incident - 2.0 * (k + 1.0) * refracted) % 360.0
    return 360.0 - turned if turned > 180.0 else turned


def halo_deg(index: float, wedge_deg: float) -> float:
    """Return the least deviation by a prism, 2 asin(n sin A/2) - A: a halo's inner edge (A = 60: 22 degrees)."""
    return 2.0 * math.degrees(math.asin(index * math.sin(math.radians(0.5 * wedge_deg)))) - wedge_deg


def dark_rings_deg(radius_m: float, wavelength_nm: float) -> tuple[float, float, float]:
    """Return the first three dark rings of diffraction by a disc: zeros of J_1(x sin theta)."""
    x = 2.0 * math.pi * radius_m / (wavelength_nm * 1e-9)
    first, second, third = (math.degrees(math.asin(zero / x)) for zero in _DARK)
    return first, second, third


def between(a: ArrayLike, b: ArrayLike) -> NDArray[np.floating]:
    """Return the angles (radians, 0 to pi) between vectors (..., 3), in their precision: atan2(|a x b|, a . b).

    In float32 the error is below 2e-7 near 0 and 180 degrees; acos(a . b) of unit vectors is 5e-4 off there, which is
    0.03 degrees.
    """
    p, q = np.asarray(a), np.asarray(b)
    cross = [p[..., i] * q[..., j] - p[..., j] * q[..., i] for i, j in ((1, 2), (2, 0), (0, 1))]
    sine = np.sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2])
    cosine = p[..., 0] * q[..., 0] + p[..., 1] * q[..., 1] + p[..., 2] * q[..., 2]
    angle: NDArray[np.floating] = np.asarray(atan2(sine, cosine))
    return angle


def _window(angles_deg: ArrayLike, values: ArrayLike, low_deg: float, high_deg: float) -> tuple[Floats, Floats]:
    angles, f = np.asarray(angles_deg, np.float64), np.asarray(values, np.float64)
    inside = (angles >= low_deg) & (angles <= high_deg)
    if angles.shape != f.shape or inside.sum() < 3:
        raise ValueError(f"fewer than 3 of the {angles.size} angles lie between {low_deg:g} and {high_deg:g} degrees")
    return angles[inside], f[inside]


def peak_deg(angles_deg: ArrayLike, values: ArrayLike, low_deg: float, high_deg: float) -> float:
    """Return the angle of the greatest value between two angles."""
    angles, f = _window(angles_deg, values, low_deg, high_deg)
    return float(angles[f.argmax()])


def lowest_deg(angles_deg: ArrayLike, values: ArrayLike, low_deg: float, high_deg: float) -> float:
    """Return the angle of the least value between two angles."""
    angles, f = _window(angles_deg, values, low_deg, high_deg)
    return float(angles[f.argmin()])


def turning_points_deg(
    angles_deg: ArrayLike, values: ArrayLike, low_deg: float, high_deg: float
) -> tuple[list[float], list[float]]:
    """Return the angles of all maxima and of all minima strictly between two angles."""
    angles, f = _window(angles_deg, values, low_deg, high_deg)
    rise = np.diff(f)
    inner = angles[1:-1]
    peaks, dips = (rise[:-1] > 0.0) & (rise[1:] <= 0.0), (rise[:-1] < 0.0) & (rise[1:] >= 0.0)
    return inner[peaks].tolist(), inner[dips].tolist()
