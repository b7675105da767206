"""Where a tabulated phase function has its bows, rings and halo edges, beside where theory puts them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.optics import refraction
from atmoref.optics.angles import bow_deg, halo_deg, peak_deg, turning_points_deg

__all__ = ["FEATURES", "Feature", "features"]


class Feature(NamedTuple):
    """One feature: what it is called, the scattering angle measured, and theory's (NaN: there is no simple one)."""

    name: str
    measured_deg: float
    theory_deg: float


def _steepest_deg(angles_deg: NDArray[np.float64], values: NDArray[np.float64], low: float, high: float) -> float:
    """Return where the values rise most steeply between two angles."""
    inside = (angles_deg >= low) & (angles_deg <= high)
    angles, f = angles_deg[inside], values[inside]
    at = int(np.argmax(np.diff(f) / np.diff(angles)))
    return float(0.5 * (angles[at] + angles[at + 1]))


def _of_rain(angles: NDArray[np.float64], values: NDArray[np.float64], nm: float) -> list[Feature]:
    index = float(refraction.water(nm))
    return [
        Feature("primary bow", peak_deg(angles, values, 136.0, 141.0), bow_deg(index, 1)),
        Feature("secondary bow", peak_deg(angles, values, 124.0, 131.0), bow_deg(index, 2)),
    ]


def _of_cloud(angles: NDArray[np.float64], values: NDArray[np.float64], nm: float) -> list[Feature]:
    ring = peak_deg(angles, values, 177.3, 179.5)
    _, dark = turning_points_deg(angles, values, 173.0, ring)
    return [
        Feature("fogbow", peak_deg(angles, values, 136.0, 150.0), math.nan),
        Feature("glory, bright ring", ring, math.nan),
        *(Feature("glory, dark ring around it", one, math.nan) for one in dark[-1:]),
    ]


def _of_ice(angles: NDArray[np.float64], values: NDArray[np.float64], nm: float) -> list[Feature]:
    index = float(refraction.ice(nm) / refraction.air(nm))
    return [
        Feature("22 degree halo, inner edge", _steepest_deg(angles, values, 20.5, 23.5), halo_deg(index, 60.0)),
        Feature("22 degree halo, peak", peak_deg(angles, values, 20.5, 24.0), math.nan),
        Feature("46 degree halo, inner edge", _steepest_deg(angles, values, 44.0, 48.5), halo_deg(index, 90.0)),
    ]


FEATURES = {"rain": _of_rain, "cloud": _of_cloud, "ice": _of_ice}
"""Particle -> what looks for its features."""


def features(name: str, angles_deg: ArrayLike, values: ArrayLike, wavelength_nm: float) -> list[Feature]:
    """Return the features of a particle's phase function at ascending angles; none of particles that have none."""
    angles, f = np.asarray(angles_deg, np.float64), np.asarray(values, np.float64)
    return FEATURES[name](angles, f, wavelength_nm) if name in FEATURES else []
