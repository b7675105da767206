"""Rays through ice: shadows, reflectance and angles by theory, shares of the sheet, noise, roughness, the same bits."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from atmoref.optics import crystals
from atmoref.optics.angles import halo_deg, peak_deg
from atmoref.optics.crystals import Aggregate, Crystals, Traced
from atmoref.optics.particles import PARTICLES
from atmoref.optics.refraction import air, ice

COLUMN = Crystals(2.5, 1.82e-6)
# indices of the sheet (relative to vacuum), and its shares with 6e6 rays: delta, mean cosine with delta
SHEET = [(1.3073, 0.295, 0.671), (1.3110, 0.296, 0.666), (1.3163, 0.298, 0.659)]
SHAPES = [(0.1, 0.691, 0.828), (0.5, 0.328, 0.585), (1.0, 0.240, 0.541), (5.0, 0.330, 0.718)]


@functools.cache
def _column(index: float) -> Traced:
    return COLUMN.trace_index(index, 3_000_000)


def _middles(t: Traced) -> np.ndarray:
    return 0.5 * (t.edges_deg[1:] + t.edges_deg[:-1])


@pytest.mark.parametrize(("index", "delta", "cosine"), SHEET)
def test_shares_of_the_column_are_the_sheets(index, delta, cosine):
    """1.2 million rays hit: standard errors 0.0004 and 0.0005; the sheet's numbers are rounded to 0.001."""
    t = _column(index)
    assert t.delta == pytest.approx(delta, abs=0.0025)
    assert t.delta + (1.0 - t.delta) * t.asymmetry == pytest.approx(cosine, abs=0.003)
    assert t.whole_asymmetry == pytest.approx(0.5 + 0.5 * cosine, abs=0.0015)
    assert t.whole_delta == 0.5 + 0.5 * t.delta
    assert t.lost < 20


@pytest.mark.parametrize(("aspect", "delta", "cosine"), SHAPES)
def test_shares_of_other_shapes_are_the_sheets(aspect, delta, cosine):
    t = Crystals(aspect, 1.0).trace_index(1.311, 1_000_000)
    assert t.delta == pytest.approx(delta, abs=0.004)
    assert t.delta + (1.0 - t.delta) * t.asymmetry == pytest.approx(cosine, abs=0.004)


@pytest.mark.parametrize("aspect", [0.1, 1.0, 2.5, 10.0])
def test_the_mean_shadow_is_a_quarter_of_the_surface(aspect):
    """Cauchy; five standard errors of a binomial number."""
    rays = 1_000_000
    t = Crystals(aspect, 1.0).trace_index(1.311, rays)
    shadow = 0.25 * (3.0 * math.sqrt(3.0) + 12.0 * aspect)
    share = shadow / (math.pi * (1.0 + aspect * aspect))
    assert t.area == pytest.approx(1.0, abs=5.0 * math.sqrt((1.0 - share) / (share * rays)))


@pytest.mark.parametrize("index", [1.1, 1.311, 2.0])
def test_the_outside_reflects_what_fresnel_says(index):
    """Random orientation of a convex body: the mean of R over 2 mu d mu."""
    nodes, weights = leggauss(200)
    mu = 0.5 * (nodes + 1.0)
    behind = np.sqrt(1.0 - (1.0 - mu * mu) / index**2)
    s = (mu - index * behind) / (mu + index * behind)
    p = (index * mu - behind) / (index * mu + behind)
    expected = math.fsum(0.5 * weights * 2.0 * mu * 0.5 * (s * s + p * p))
    t = COLUMN.trace_index(index, 1_000_000)
    assert t.reflected == pytest.approx(expected, abs=5.0 * math.sqrt(expected / 350_000))


@pytest.mark.parametrize(("index", "delta", "cosine"), SHEET)
def test_the_integral_is_one(index, delta, cosine):
    t = _column(index)
    mu = np.cos(np.radians(t.edges_deg))
    assert math.fsum(t.phase_function * 2.0 * math.pi * -np.diff(mu)) == pytest.approx(1.0, abs=1e-9)
    binned = math.fsum(t.phase_function * math.pi * -np.diff(mu * mu))
    assert binned == pytest.approx(t.asymmetry, abs=1e-5)


@pytest.mark.parametrize(("index", "delta", "cosine"), SHEET)
@pytest.mark.parametrize("wedge", [60.0, 90.0])
def test_halos_begin_where_theory_says(wedge, index, delta, cosine):
    """The inner edge (steepest rise) within 0.15 degrees, the peak within 0.5 outside of it."""
    t, edge = _column(index), halo_deg(index, wedge)
    middles = _middles(t)
    rise = np.gradient(t.phase_function, middles)
    assert peak_deg(middles, rise, edge - 3.0, edge + 3.0) == pytest.approx(edge, abs=0.15)
    peak = peak_deg(middles, t.phase_function, edge - 3.0, edge + 3.0)
    assert -0.05 < peak - edge < 0.5
    before = t.phase_function[np.abs(middles - (edge - 1.0)) < 0.5].mean()
    assert t.phase_function[np.abs(middles - peak) < 0.1].mean() > (20.0 if wedge == 60.0 else 1.8) * before


def test_red_is_inside():
    peaks = [peak_deg(_middles(_column(n)), _column(n).phase_function, 20.0, 26.0) for n, _, _ in SHEET]
    assert peaks == sorted(peaks)


def test_noise_falls_with_the_root_of_the_rays():
    """Two seeds differ by what the stated standard errors say."""
    spread = []
    seen = COLUMN.trace_index(1.311, 200_000, step_deg=1.0).noise < 0.1
    for rays in (200_000, 800_000):
        a, b = (COLUMN.trace_index(1.311, rays, seed=seed, step_deg=1.0) for seed in (1, 2))
        z = (a.phase_function - b.phase_function)[seen] / np.hypot(
            a.noise * a.phase_function, b.noise * b.phase_function
        )[seen]
        assert 0.8 < float(np.sqrt(np.mean(z * z))) < 1.25
        spread.append(float(np.sqrt(np.mean((a.phase_function[seen] / b.phase_function[seen] - 1.0) ** 2))))
    assert 1.4 < spread[0] / spread[1] < 2.8


def test_the_wavelength_chooses_the_index_in_air():
    t, u = COLUMN.trace(550.0, 20_000), COLUMN.trace_index(float(ice(550.0) / air(550.0)), 20_000)
    np.testing.assert_array_equal(t.phase_function, u.phase_function)


def test_snow_has_no_halo():
    """M-16: where the column rises by 37 times, snow falls on; the same at 46 degrees."""
    snow = PARTICLES["snow"]
    assert isinstance(snow, Aggregate)
    t = snow.trace(550.0, 2_000_000, step_deg=1.0)
    middles = _middles(t)
    for edge in (21.9, 45.9):
        near = t.phase_function[np.abs(middles - edge) < 6.0]
        assert (np.diff(near) < 3.0 * t.noise.max() * near[:-1]).all()
        assert near[-1] < near[0]
    assert t.delta < 0.005
    assert 0.5 < t.asymmetry < 0.75
    for crystal in snow.crystals:
        smooth = Crystals(crystal.aspect, 1.0).trace_index(1.311, 500_000, step_deg=1.0)
        assert smooth.phase_function[22] > 5.0 * smooth.phase_function[20]


def test_an_aggregate_is_the_mean_of_its_shapes():
    """Each scatters the same share: rest weighted by what is not delta; mean cosine and noise follow."""
    shapes = (Crystals(0.3, 2e-6), Crystals(3.0, 2e-6))
    both = Aggregate(shapes).trace(550.0, 400_000, step_deg=1.0)
    each = [one.trace(550.0, 200_000, step_deg=1.0) for one in shapes]
    left = [1.0 - t.delta for t in each]
    expected = (left[0] * each[0].phase_function + left[1] * each[1].phase_function) / sum(left)
    np.testing.assert_allclose(both.phase_function, expected, rtol=1e-12)
    assert both.delta == pytest.approx(1.0 - 0.5 * sum(left), rel=1e-12)
    whole = [t.delta + (1.0 - t.delta) * t.asymmetry for t in each]
    assert both.delta + (1.0 - both.delta) * both.asymmetry == pytest.approx(0.5 * sum(whole), rel=1e-12)
    assert (both.noise <= np.maximum(each[0].noise, each[1].noise)).all()
    with pytest.raises(ValueError, match="one extinction_m2"):
        Aggregate((Crystals(0.3, 1e-6), Crystals(3.0, 2e-6)))


def test_threads_leave_the_bits(monkeypatch):
    question = (2.5, 35.0, 1.311, 100_000, 3, 180)
    before = crystals._trace.__wrapped__(*question)
    monkeypatch.setattr(crystals.os, "sched_getaffinity", lambda _: set(range(7)))
    after = crystals._trace.__wrapped__(*question)
    for a, b in zip(before, after, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Crystals(0.0, 1.0), "aspect"),
        (lambda: Crystals(1.0, 1.0, 70.0), "tilt_deg"),
        (lambda: COLUMN.trace_index(1.0, 10), "index in"),
        (lambda: COLUMN.trace_index(1.3, 0), "positive number"),
        (lambda: COLUMN.trace_index(1.3, 10, -1), "seed"),
        (lambda: COLUMN.trace_index(1.3, 10, 1, 0.7), "divide 180"),
        (lambda: COLUMN.trace(200.0, 10), "380 to 780"),
        (lambda: COLUMN.trace_index(1.3, 1), "too few"),
    ],
)
def test_bad_questions_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
