"""Light scattered once, in the form that tables of many scatterings are made from.

A phase function given at angles means its linear interpolation between them.  `hat_weights` integrates that exactly, so
what is normalised is what is looked up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.elementary import cos, sin

__all__ = ["Progress", "Single", "hat_weights", "normalised"]

Floats = NDArray[np.float64]
Progress = Callable[[str, float | None], None]
"""Called with what is being done and the fraction done."""


class Single(NamedTuple):
    """A phase function: the share `delta` in the exact forward direction, and the rest, twice.

    `values` (1/sr) stand at the angles that were asked for, `rest` are Legendre coefficients a'_0 = 1, a'_1, ...; both
    are of the rest alone, divided by 1 - delta.
    """

    delta: float
    values: Floats
    rest: Floats


def hat_weights(angles_deg: ArrayLike, end_deg: float = 180.0) -> Floats:
    """Return w so that the sum of w f is the integral over the sphere, up to `end_deg`, of f interpolated linearly.

    Parameters
    ----------
    angles_deg : (count,) array
        Ascending scattering angles from 0 to 180.
    end_deg : float
        One of them.

    Returns
    -------
    (count,) array, sr; the error of the whole is about 1e-13.
    """
    angles = np.asarray(angles_deg, np.float64)
    if angles.ndim != 1 or angles.size < 2 or angles[0] != 0.0 or angles[-1] != 180.0 or (np.diff(angles) <= 0.0).any():
        raise ValueError("scattering angles must ascend from 0 to 180 degrees")
    if end_deg not in angles:
        raise ValueError(f"{end_deg!r} is none of the angles")
    theta = angles * (math.pi / 180.0)
    s, c = np.asarray(sin(theta), np.float64), np.asarray(cos(theta), np.float64)
    width = np.diff(theta)
    slope = np.diff(s) / width
    rising, falling = slope - c[1:], c[:-1] - slope
    used = angles[1:] <= end_deg
    weights = np.zeros_like(angles)
    weights[1:] += np.where(used, rising, 0.0)
    weights[:-1] += np.where(used, falling, 0.0)
    return 2.0 * math.pi * weights


def normalised(values: ArrayLike, angles_deg: ArrayLike) -> tuple[Floats, float]:
    """Return values divided by the integral of their interpolation over the sphere, and that integral."""
    f = np.asarray(values, np.float64)
    whole = math.fsum(hat_weights(angles_deg) * f)
    return f / whole, whole
