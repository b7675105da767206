"""Ams_n and F_n: where light goes that one kind of particle has scattered n times, and how much of it goes on forward.

Ams_n = P * ... * P (n times, eq. 20) has the Legendre coefficients a_l^n.  A forward peak is kept apart (R-E17): with
P = f delta + (1 - f) P',

    Ams_n = f^n delta + sum over k from 1 of C(n, k) f^(n-k) (1 - f)^k Ams'_k,

whose first term, P' itself, comes straight from the particle, so that a halo's edge does not ring; all others are
series of a'_l^k, which fall fast.  With `poisson` row n is one scattering more than a Poisson number of mean n - 1
(R-E21): a_l exp(-(n - 1)(1 - a_l)).

Computation.  Everything in float64, one order of sums, stored as float32.  Rows are cleared of what truncation leaves
below zero (at most 1e-6 of the greatest value, else it fails) and divided so that table and delta together integrate
to 1, table values being linear between angles; tables so coarse that this would change them by more than 1 % keep the
values themselves.  F_n is summed in closed form.

Look-up.  `look_up` in `scattered_lookup.py`; row n - 1, column angle / 180 x (columns - 1).

Source: [Riley2004] eqs. (20), (23); R-E7, R-E17, R-E21, R-E23; sheet section 7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import exp
from atmoref.optics import legendre
from atmoref.optics.drops import cosines
from atmoref.optics.orders import forward_share, poisson, power
from atmoref.optics.particles import PARTICLES, Particle
from atmoref.optics.single import Progress, Single, hat_weights
from atmoref.store import Parameters, load_or_build

__all__ = ["Axes", "Scattered", "parameters_of", "rows_of", "scattered"]

Floats = NDArray[np.float64]
VERSION = 1
KIND = "scattered"
MOST_COLUMNS, MOST_ORDERS = 36_001, 1024
NEGATIVE = 1e-6
"""Of the greatest value: truncation may leave so much below zero."""
COARSE = 0.01
"""A table whose linear interpolation integrates to something farther from 1 is not normalised."""


@dataclass(frozen=True, slots=True)
class Axes:
    """Coordinates of a table.

    Attributes
    ----------
    wavelengths_nm
        Any number of them, in vacuum; channels of the table. R, G, B by default (R-E12).
    columns
        Scattering angles, uniform from 0 to 180 degrees with samples on both ends: 3601 are 0.05 degrees; the paper has
        1001.
    orders
        Rows n = 1 ... orders; the paper has 26.
    poisson
        Rows are averages over Poisson numbers instead of powers.
    """

    wavelengths_nm: tuple[float, ...] = (680.0, 550.0, 440.0)
    columns: int = 3601
    orders: int = 26
    poisson: bool = False

    def __post_init__(self) -> None:
        if not self.wavelengths_nm or not 2 <= self.columns <= MOST_COLUMNS or not 1 <= self.orders <= MOST_ORDERS:
            raise ValueError(
                f"a table needs wavelengths, 2 to {MOST_COLUMNS} columns and 1 to {MOST_ORDERS} orders, found {self}"
            )
        if self.columns % 2 == 0:
            raise ValueError(f"a table needs an odd number of columns, so that one is 90 degrees, found {self.columns}")

    @property
    def angles_deg(self) -> Floats:
        """The columns' scattering angles."""
        return np.arange(self.columns) * 180.0 / (self.columns - 1)


class Scattered(NamedTuple):
    """A table.

    `values` (W, orders, columns), float32, 1/sr: Ams_n without its delta; `delta` and `forward` (W, orders), float64:
    f^n, and F_n with the delta in it; `asymmetry` (W,): mean cosine of single scattering, delta included; `changed`:
    how far the integral of a row was from 1 - delta at most (relative), before it was divided by that.
    """

    axes: Axes
    values: NDArray[np.float32]
    delta: Floats
    forward: Floats
    asymmetry: Floats
    changed: float


def _powers(single: Single, angles_deg: Floats, most: int) -> Floats:
    """Return Ams'_k at angles for k = 1 ... most, (most, columns)."""
    mu = cosines(angles_deg)
    rows = [single.values]
    for k in range(2, most + 1):
        a = power(single.rest, k)
        kept = int(np.flatnonzero(np.abs(a) > 1e-16)[-1]) + 1
        rows.append(legendre.series(a[:kept], mu))
    return np.array(rows, np.float64)


def _binomial(single: Single, angles_deg: Floats, count: int) -> tuple[Floats, Floats]:
    """Return rows without their delta, and the deltas, of n = 1 ... count."""
    f = single.delta
    rest = _powers(single, angles_deg, count)
    deltas = np.cumprod(np.full(count, f))
    if f == 0.0:
        return rest, deltas
    rows = np.zeros_like(rest)
    for n in range(1, count + 1):
        for k in range(1, n + 1):
            share = math.comb(n, k) * math.prod([f] * (n - k)) * math.prod([1.0 - f] * k)
            rows[n - 1] += share * rest[k - 1]
    return rows, deltas


def _poisson(single: Single, angles_deg: Floats, count: int) -> tuple[Floats, Floats]:
    """Return rows without their delta, and the deltas, of one scattering more than Poisson numbers of mean 0, 1, ..."""
    f, mu = single.delta, cosines(angles_deg)
    rows, deltas = np.empty((count, mu.size)), np.empty(count)
    a = single.rest / single.rest[0]
    for n in range(count):
        passed = n * (1.0 - f)
        once = (1.0 - f) * (1.0 + n * f)  # of P' itself, before the factor exp(-passed)
        unscattered = float(exp(np.float64(-passed)))
        spread = np.asarray(exp(-passed * (1.0 - a)), np.float64)
        more = (f + (1.0 - f) * a) * spread - unscattered * (f + once * a)
        rows[n] = unscattered * once * single.values + legendre.series(more, mu)
        deltas[n] = f * unscattered
    return rows, deltas


def rows_of(single: Single, angles_deg: Floats, axes: Axes) -> tuple[Floats, Floats]:
    """Return rows (orders, angles) without their delta, and the deltas, as they are before they are settled."""
    return (_poisson if axes.poisson else _binomial)(single, angles_deg, axes.orders)


def _settled(rows: Floats, deltas: Floats, weights: Floats) -> tuple[Floats, float]:
    """Return rows that are nowhere negative and integrate to 1 - delta, and the greatest change of a row."""
    least, greatest = rows.min(1), rows.max(1)
    if (least < -NEGATIVE * greatest).any():
        raise ValueError(f"the series rings: {(least / greatest).min():.3g} of the greatest value is negative")
    cleared = np.maximum(rows, 0.0)
    integrals = np.array([math.fsum(weights * row) for row in cleared])
    factors = (1.0 - deltas) / integrals
    changed = float(np.abs(factors - 1.0).max())
    return cleared * (factors[:, None] if changed <= COARSE else 1.0), changed


def _forward(single: Single, deltas: Floats, averaged: bool) -> list[float]:
    """Return F_n, or its average over one scattering more than Poisson numbers, in closed form."""
    whole = single.delta + (1.0 - single.delta) * (single.rest / single.rest[0])
    found = []
    for row, delta in enumerate(deltas.tolist()):
        a = poisson(whole, float(row)) if averaged else power(whole, row + 1)
        found.append(delta + (1.0 - delta) * forward_share((a - delta) / (1.0 - delta)))
    return found


def build(particle: Particle, axes: Axes, progress: Progress | None = None) -> dict[str, NDArray[Any]]:
    """Return the arrays of a table; see `Scattered`."""
    angles = axes.angles_deg
    weights = hat_weights(angles)
    values = np.empty((len(axes.wavelengths_nm), axes.orders, axes.columns), np.float32)
    delta, forward = np.empty(values.shape[:2]), np.empty(values.shape[:2])
    asymmetry, changed = np.empty(values.shape[0]), 0.0
    for i, wavelength in enumerate(axes.wavelengths_nm):
        if progress is not None:
            progress(f"{wavelength:g} nm", i / len(axes.wavelengths_nm))
        single = particle.single(wavelength, angles, progress)
        rows, delta[i] = rows_of(single, angles, axes)
        settled, change = _settled(rows, delta[i], weights)
        values[i], changed = settled, max(changed, change)
        forward[i] = _forward(single, delta[i], axes.poisson)
        asymmetry[i] = single.delta + (1.0 - single.delta) * float(single.rest[1] / single.rest[0])
    return {
        "values": values, "delta": delta, "forward": forward, "asymmetry": asymmetry, "changed": np.array([changed])
    }  # fmt: skip


def parameters_of(particle: Particle, axes: Axes) -> Parameters:
    """Return everything that a table depends on, for its key: the particle in words, and the axes."""
    return {
        "particle": repr(particle), "wavelengths_nm": list(axes.wavelengths_nm), "columns": axes.columns,
        "orders": axes.orders, "poisson": int(axes.poisson),
    }  # fmt: skip


def table_of(arrays: Mapping[str, NDArray[Any]], axes: Axes) -> Scattered:
    """Return stored arrays as a table."""
    return Scattered(
        axes, arrays["values"], arrays["delta"], arrays["forward"], arrays["asymmetry"], float(arrays["changed"][0])
    )


def scattered(particle: str | Particle, axes: Axes | None = None, progress: Progress | None = None) -> Scattered:
    """Return the table of a particle: shipped, out of the cache, or built and kept there.

    Parameters
    ----------
    particle : str or Particle
        A name of `PARTICLES`, or a particle.
    axes : Axes, optional
    progress : callable, optional
        Called with what is being done and the fraction done.

    Returns
    -------
    Scattered

    Raises
    ------
    ValueError
        For an unknown name, or a series that rings.
    """
    if isinstance(particle, str):
        if particle not in PARTICLES:
            raise ValueError(f"particle: found {particle!r}; allowed: {', '.join(PARTICLES)}")
        particle = PARTICLES[particle]
    chosen, given = axes or Axes(), particle
    arrays = load_or_build(KIND, VERSION, parameters_of(given, chosen), lambda: build(given, chosen, progress))
    return table_of(arrays, chosen)
