"""The equiangular sampler: its density integrates to 1, belongs to its samples, and flattens 1/s²."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy import integrate, stats

from atmoref._jit import kernel
from atmoref.transport.samplers import equiangular, equiangular_density

SEGMENTS = [(11.0, -45.0, 30.0), (0.1, -5.0, 7.0), (3.0, 2.0, 40.0), (3.0, -40.0, -2.0), (2.0, -1.0, math.inf)]


@kernel
def _sample(xi, v, a, b):
    return equiangular(xi, v, a, b)


@kernel
def _density(u, v, a, b):
    return equiangular_density(u, v, a, b)


@pytest.mark.parametrize(("v", "a", "b"), SEGMENTS)
def test_the_density_integrates_to_one(v, a, b):
    cuts = [c for c in (-v, 0.0, v) if a < c < b]
    ends = [a, *cuts, b]
    total = sum(
        integrate.quad(_density, lo, hi, (v, a, b), epsabs=0.0, epsrel=1e-12, limit=200)[0]
        for lo, hi in itertools.pairwise(ends)
    )
    assert total == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize(("v", "a", "b"), SEGMENTS)
def test_samples_follow_their_density(v, a, b):
    xi = (np.arange(4000) + 0.5) / 4000
    drawn = np.array([_sample(x, v, a, b) for x in xi])
    u, density = drawn.T
    assert ((u >= a) & (u <= b)).all()
    np.testing.assert_allclose(density, [_density(x, v, a, b) for x in u], rtol=1e-15)
    np.testing.assert_allclose(density * (v * v + u * u), density[0] * (v * v + u[0] ** 2), rtol=1e-13)
    inside = np.linspace(u[100], u[-100], 7)
    for x in inside:  # the share of samples below x is the integral of the density
        share = integrate.quad(_density, a if b < math.inf else max(a, -1e6), x, (v, a, b), points=None, limit=400)[0]
        assert (u < x).mean() == pytest.approx(share, abs=1e-3)
    assert (
        stats.kstest(np.arctan2(u, v), "uniform", (np.arctan2(a, v), np.arctan2(b, v) - np.arctan2(a, v))).pvalue > 0.9
    )


def test_the_estimate_of_one_over_s_squared_has_no_variance():
    v, a, b = 0.01, -3.0, 4.0
    exact = (math.atan2(b, v) - math.atan2(a, v)) / v
    for xi in (0.0, 0.1, 0.5, 0.999):
        u, density = _sample(xi, v, a, b)
        assert 1.0 / (v * v + u * u) / density == pytest.approx(exact, rel=1e-10)


def test_outside_the_segment_the_density_is_zero():
    assert _density(-1.1, 1.0, -1.0, 1.0) == 0.0
    assert _density(1.1, 1.0, -1.0, 1.0) == 0.0
