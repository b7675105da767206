"""The embedded pair of rules integrates polynomials exactly up to its two degrees, and no further."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from atmoref.truth.quadrature_rules import GAUSS_KRONROD_21, gauss_legendre


def _moment(weights: np.ndarray, degree: int) -> Fraction:
    nodes = GAUSS_KRONROD_21.nodes
    return sum((Fraction(w) * Fraction(x) ** degree for w, x in zip(weights, nodes, strict=True)), Fraction(0))


@pytest.mark.parametrize("degree", range(33))
def test_exact_up_to_the_degree(degree):
    exact = Fraction(2, degree + 1) if degree % 2 == 0 else Fraction(0)
    assert abs(_moment(GAUSS_KRONROD_21.fine, degree) - exact) < (1e-15 if degree < 32 else 1e-7)
    if degree < 20:
        assert abs(_moment(GAUSS_KRONROD_21.coarse, degree) - exact) < 1e-15
    if degree == 20:
        assert abs(_moment(GAUSS_KRONROD_21.coarse, degree) - exact) > 1e-7


def test_the_coarse_rule_is_gauss_legendre():
    nodes, weights = leggauss(10)
    held = GAUSS_KRONROD_21.coarse != 0.0
    np.testing.assert_allclose(np.sort(GAUSS_KRONROD_21.nodes[held]), nodes, rtol=1e-14)
    np.testing.assert_allclose(np.sort(GAUSS_KRONROD_21.coarse[held]), np.sort(weights), rtol=1e-13)


def test_the_cross_check_rule_estimates_no_error():
    rule = gauss_legendre(7)
    np.testing.assert_array_equal(rule.fine, rule.coarse)
    assert rule.fine.sum() == pytest.approx(2.0, abs=1e-14)
