"""Hexagonal prisms of ice in random orientation: geometrical optics by rays, diffraction as a forward peak.

    P = 1/2 delta (diffraction) + 1/2 (f delta + (1 - f) P_GO),

because the extinction efficiency of large particles is 2, and the diffraction peak of a millimetre is 0.06 degrees
wide.  f is the share of rays that pass parallel facets without deviation.  Fresnel's reflectances are those of
unpolarised light at every facet; ice does not absorb (k < 1.1e-7 in the visible).

The crystal stands still, the ray's direction is isotropic: the same as random orientation.  Facets may be tilted at
random at every meeting (`tilt`), which is how roughness is modelled and takes the halos away.

Source: [Riley2004] sec. 4 uses a table of other authors; method and checks are those of the sheet, sections 6.4, 6.5.
"""

from __future__ import annotations

import functools
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.optics import legendre
from atmoref.optics.crystal_kernels import DELTA, HIT, LOST, REFLECTED, rays_kernel
from atmoref.optics.drops import cosines
from atmoref.optics.orders import Split
from atmoref.optics.refraction import air, ice
from atmoref.optics.single import Progress, Single

__all__ = ["Aggregate", "Crystals", "Traced"]

Floats = NDArray[np.float64]

BLOCK = 1 << 16  # rays traced together
TABLE_RAYS = 96_000_000
BIN_TERMS = 3000  # Legendre coefficients of bins of 0.1 degrees


class Traced(NamedTuple):
    """What rays through crystals did.

    `phase_function` (1/sr) holds means over bins of scattering angle between `edges_deg`, without the delta share; its
    integral is 1.  `noise` is its relative standard error.  `asymmetry` is the mean cosine of P_GO; `delta` is f,
    `reflected` the share reflected at the outside, `area` the projected area over its exact mean, `lost` the rays
    that were given up.
    """

    edges_deg: Floats
    phase_function: Floats
    noise: Floats
    delta: float
    asymmetry: float
    reflected: float
    area: float
    lost: int

    @property
    def whole_delta(self) -> float:
        """The share of the whole phase function in the forward peak: diffraction, and rays not deviated."""
        return 0.5 + 0.5 * self.delta

    def split(self, count: int) -> Split:
        """Return the whole phase function as peak and Legendre coefficients of the rest, exact for the bins."""
        return Split(self.whole_delta, legendre.of_bins(self.phase_function, self.edges_deg, count))

    def single(self, angles_deg: ArrayLike, count: int = BIN_TERMS) -> Single:
        """Return the whole as light scattered once (see `Single`)."""
        middles = 0.5 * (self.edges_deg[:-1] + self.edges_deg[1:])
        values = np.interp(np.asarray(angles_deg, np.float64), middles, self.phase_function)
        return Single(self.whole_delta, values, self.split(count).rest)

    @property
    def whole_asymmetry(self) -> float:
        """The mean cosine of the whole phase function, peak included."""
        return self.whole_delta + (1.0 - self.whole_delta) * self.asymmetry


class _ByRays:
    """What every particle answers, out of `trace`."""

    __slots__ = ()

    if TYPE_CHECKING:

        def trace(self, wavelength_nm: float, rays: int, seed: int = 1, step_deg: float = 0.1) -> Traced: ...

    def split(self, wavelength_nm: float, count: int) -> Split:
        """Return the forward peak and the first coefficients of the rest, by 4 million rays, bins of 0.1 degrees."""
        return self.trace(wavelength_nm, 4_000_000).split(count)

    def single(self, wavelength_nm: float, angles_deg: ArrayLike, progress: Progress | None = None) -> Single:
        """Return light scattered once (see `Single`), by `TABLE_RAYS` rays."""
        if progress is not None:
            progress(f"rays through crystals at {wavelength_nm:g} nm", None)
        return self.trace(wavelength_nm, TABLE_RAYS).single(angles_deg)


@dataclass(frozen=True, slots=True)
class Crystals(_ByRays):
    """Hexagonal prisms.

    Attributes
    ----------
    aspect
        Length over the diameter 2a of the hexagon's circumscribed circle: columns above 1, plates below.
    extinction_m2
        Cross-section with which the particle is rendered (the paper's Table 2).
    tilt_deg
        Greatest tilt of a facet at each meeting, slopes being uniform in a disc; 0: smooth.
    """

    aspect: float
    extinction_m2: float
    tilt_deg: float = 0.0

    def __post_init__(self) -> None:
        if not (1e-3 <= self.aspect <= 1e3 and self.extinction_m2 > 0.0 and 0.0 <= self.tilt_deg <= 60.0):
            raise ValueError(
                f"crystals need an aspect of 0.001 to 1000, extinction_m2 > 0 and tilt_deg of 0 to 60, found {self}"
            )

    def trace(self, wavelength_nm: float, rays: int, seed: int = 1, step_deg: float = 0.1) -> Traced:
        """Return the scattering of light of a vacuum wavelength by rays.

        Parameters
        ----------
        wavelength_nm : float
            380 to 780; the index is that of ice in air.
        rays : int
            Sent to a disc around the crystal; a third to two thirds hit it.
        seed : int
            Of the random numbers, not negative; equal ones give equal bits on any number of threads.
        step_deg : float
            Width of bins; 180 must be a multiple.
        """
        return self.trace_index(float(ice(wavelength_nm) / air(wavelength_nm)), rays, seed, step_deg)

    def trace_index(self, index: float, rays: int, seed: int = 1, step_deg: float = 0.1) -> Traced:
        """Return the same for a relative index of refraction above 1."""
        bins = round(180.0 / step_deg)
        if not (1.0 < index <= 4.0) or rays < 1 or seed < 0 or bins < 1 or abs(bins * step_deg - 180.0) > 1e-9:
            raise ValueError(
                f"rays need an index in (1, 4], a positive number, a seed >= 0 and bins that divide 180 degrees, found "
                f"{index!r}, {rays!r}, {seed!r}, {step_deg!r}"
            )
        return _trace(self.aspect, self.tilt_deg, index, rays, seed, bins)


@dataclass(frozen=True, slots=True)
class Aggregate(_ByRays):
    """Crystals of several shapes, each of which scatters the same share of the light."""

    crystals: tuple[Crystals, ...]

    def __post_init__(self) -> None:
        if len({c.extinction_m2 for c in self.crystals}) != 1:
            raise ValueError(f"an aggregate needs crystals of one extinction_m2, found {self}")

    @property
    def extinction_m2(self) -> float:
        """Cross-section with which the particle is rendered."""
        return self.crystals[0].extinction_m2

    def trace(self, wavelength_nm: float, rays: int, seed: int = 1, step_deg: float = 0.1) -> Traced:
        """Return the scattering of light by rays that are shared among the shapes; see `Crystals.trace`."""
        each = [c.trace(wavelength_nm, -(-rays // len(self.crystals)), seed, step_deg) for c in self.crystals]
        passed = 1.0 - math.fsum(t.delta for t in each) / len(each)
        shares = [(1.0 - t.delta) / (passed * len(each)) for t in each]
        values, square = np.zeros_like(each[0].noise), np.zeros_like(each[0].noise)
        for share, t in zip(shares, each, strict=True):
            values += share * t.phase_function
            square += (share * t.phase_function * t.noise) ** 2
        noise = np.sqrt(square) / np.where(values > 0.0, values, 1.0)
        return Traced(
            each[0].edges_deg, values, noise, 1.0 - passed,
            math.fsum(share * t.asymmetry for share, t in zip(shares, each, strict=True)),
            math.fsum(t.reflected for t in each) / len(each), math.fsum(t.area for t in each) / len(each),
            sum(t.lost for t in each),
        )  # fmt: skip


def _prism(aspect: float) -> tuple[Floats, Floats]:
    """Return outward normals and distances of the facets; a = 1, the axis is z."""
    half = 0.5 * math.sqrt(3.0)
    normals = [(half, 0.5, 0.0), (0.0, 1.0, 0.0), (-half, 0.5, 0.0), (-half, -0.5, 0.0), (0.0, -1.0, 0.0)]
    normals += [(half, -0.5, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    return np.array(normals), np.array([half] * 6 + [aspect] * 2)


@functools.lru_cache(maxsize=16)
def _trace(aspect: float, tilt_deg: float, index: float, rays: int, seed: int, bins: int) -> Traced:
    normals, offsets = _prism(aspect)
    edges_deg = np.arange(bins + 1) * 180.0 / bins
    edges = cosines(edges_deg)
    radius = math.sqrt(1.0 + aspect * aspect)
    slope = float(np.sqrt(1.0 / cosines(tilt_deg) ** 2 - 1.0))
    starts = range(0, rays, BLOCK)
    counts, tally = np.zeros((len(starts), bins), np.int64), np.zeros((len(starts), 4), np.int64)

    def work(block: int) -> float:
        first = starts[block]
        end = min(first + BLOCK, rays)
        total: float = rays_kernel(
            counts[block], tally[block], edges, first, end, seed, radius, index, slope, normals, offsets
        )
        return total

    with ThreadPoolExecutor(max(1, len(os.sched_getaffinity(0)))) as pool:
        total = math.fsum(pool.map(work, range(len(starts))))
    found, sums = counts.sum(0), tally.sum(0)
    hit, delta = int(sums[HIT]), int(sums[DELTA])
    left = hit - delta - int(sums[LOST])
    if left < 1:
        raise ValueError(f"{rays} rays are too few: none was scattered")
    values = found / (left * 2.0 * math.pi * (edges[:-1] - edges[1:]))
    noise = 1.0 / np.sqrt(np.maximum(found, 1))
    for array in (edges_deg, values, noise):
        array.flags.writeable = False
    surface = 2.0 * 1.5 * math.sqrt(3.0) + 6.0 * 2.0 * aspect  # Cauchy: the mean shadow is a quarter of the surface
    area = hit / rays * math.pi * radius * radius / (0.25 * surface)
    return Traced(
        edges_deg, values, noise, delta / (left + delta), (total - delta) / left, int(sums[REFLECTED]) / hit, area,
        int(sums[LOST]),
    )  # fmt: skip
