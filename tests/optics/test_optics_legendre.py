"""Legendre series: rules against multiprecision, coefficients and sums against closed forms."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from atmoref.optics import legendre
from atmoref.optics.phase_functions import evaluate


def _exact_node(n: int, i: int) -> tuple[float, float]:
    """Return node i from the forward end and its weight, with 40 digits, by Newton's method."""
    with mpmath.workdps(40):
        x = mpmath.cos(mpmath.pi * (mpmath.mpf(i) + 0.75) / (n + 0.5))
        slope = mpmath.mpf(1)
        for _ in range(8):
            before, now = mpmath.mpf(1), x
            for k in range(2, n + 1):
                before, now = now, ((2 * k - 1) * x * now - (k - 1) * before) / k
            slope = n * (x * now - before) / (x * x - 1)
            x -= now / slope
        return float(x), float(2 / ((1 - x * x) * slope * slope))


@pytest.mark.parametrize(("n", "i"), [(2, 0), (5, 0), (5, 2), (64, 3), (561, 0), (561, 137), (2000, 0), (2000, 999)])
def test_nodes_and_weights_are_those_of_multiprecision(n, i):
    mu, weights = legendre.gauss_nodes(n)
    node, weight = _exact_node(n, i)
    assert abs(mu[i] - node) <= 2.3e-16
    assert weights[i] == pytest.approx(weight, rel=1e-12)
    assert (mu[n - 1 - i], weights[n - 1 - i]) == (-mu[i], weights[i])


@pytest.mark.parametrize("n", [2, 3, 8, 101, 1500])
def test_a_rule_is_exact_for_its_degree(n):
    mu, weights = legendre.gauss_nodes(n)
    assert (np.diff(mu) < 0.0).all()
    for power in {0, 2, min(20, 2 * n - 2)}:
        assert math.fsum(weights * mu**power) == pytest.approx(2.0 / (power + 1.0), rel=1e-13)


@pytest.mark.parametrize("g", [-0.6, 0.0, 0.5, 0.85])
def test_henyey_greenstein_has_powers_of_g(g):
    """a_l = g^l; 400 nodes leave what |g|^800 leaves."""
    mu, _ = legendre.gauss_nodes(401)
    a = legendre.coefficients(evaluate(1, g, mu), 300)
    np.testing.assert_allclose(a, g ** np.arange(300.0), rtol=0.0, atol=2e-14)
    cosines = np.linspace(-1.0, 1.0, 41).reshape(1, 41)
    np.testing.assert_allclose(legendre.series(g ** np.arange(801.0), cosines), evaluate(1, g, cosines), rtol=1e-12)


def test_rayleigh_has_two_coefficients():
    mu, _ = legendre.gauss_nodes(7)
    np.testing.assert_allclose(
        legendre.coefficients(evaluate(2, 0.0, mu), 6), [1.0, 0.0, 0.1, 0.0, 0.0, 0.0], atol=1e-15
    )
    np.testing.assert_allclose(legendre.series([1.0, 0.0, 0.1], mu), evaluate(2, 0.0, mu), rtol=1e-15)


def test_the_suns_disc_has_the_factors_of_the_sheet():
    found = legendre.of_disc(0.25, 4001)
    for degree, factor in ((0, 1.0), (100, 0.976), (500, 0.511), (2000, 0.062), (4000, -0.018)):
        assert found[degree] == pytest.approx(factor, abs=6e-4)
    assert np.flatnonzero(found < 0.0)[0] == pytest.approx(878, abs=1)
    cosine = mpmath.cos(mpmath.radians(0.25))
    for degree in (1, 500):
        exact = (mpmath.legendre(degree - 1, cosine) - mpmath.legendre(degree + 1, cosine)) / (
            (2 * degree + 1) * (1 - cosine)
        )
        assert found[degree] == pytest.approx(float(exact), rel=1e-11)


def test_bins_have_the_coefficients_of_what_is_constant_in_them():
    edges = np.linspace(0.0, 180.0, 1801)
    flat = legendre.of_bins(np.full(1800, 0.25 / math.pi), edges, 40)
    np.testing.assert_allclose(flat, np.eye(1, 40)[0], atol=1e-13)
    middles = 0.5 * (edges[1:] + edges[:-1])
    found = legendre.of_bins(evaluate(1, 0.7, np.cos(np.radians(middles))), edges, 30)
    np.testing.assert_allclose(found, 0.7 ** np.arange(30.0), atol=1e-5)  # the bins' width squared


def test_bad_questions_are_refused():
    with pytest.raises(ValueError, match="ascending"):
        legendre.of_bins([1.0], [0.0, 0.0], 3)
    with pytest.raises(ValueError, match="ascending"):
        legendre.of_bins([1.0, 2.0], [0.0, 1.0], 3)
    with pytest.raises(ValueError, match="nodes"):
        legendre.gauss_nodes(1)
    with pytest.raises(ValueError, match="nodes"):
        legendre.coefficients(np.ones((2, 2)), 1)
    with pytest.raises(ValueError, match="at least 1"):
        legendre.coefficients(np.ones(4), 0)
    with pytest.raises(ValueError, match="cosines"):
        legendre.series([1.0], [1.5])
