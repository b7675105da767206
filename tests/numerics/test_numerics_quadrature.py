"""Gauss-Legendre rules and three-vectors against multiprecision and exact integers."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from atmoref.numerics import vectors
from atmoref.numerics.quadrature import gauss_legendre


def _legendre(n: int, x: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
    before, now = mpmath.mpf(1), x
    for k in range(2, n + 1):
        before, now = now, ((2 * k - 1) * x * now - (k - 1) * before) / k
    return now, n * (x * now - before) / (x * x - 1)


def _exact_rule(n: int) -> tuple[list[mpmath.mpf], list[mpmath.mpf]]:
    """Nodes and weights on [0, 1] with 40 digits."""
    nodes, weights = [], []
    with mpmath.workdps(40):
        for i in range(n):
            x = -mpmath.cos(mpmath.pi * (mpmath.mpf(i) + 0.75) / (n + 0.5))
            for _ in range(8):
                value, slope = _legendre(n, x)
                x -= value / slope
            _, slope = _legendre(n, x)
            nodes.append((1 + x) / 2)
            weights.append(1 / ((1 - x * x) * slope * slope))
    return nodes, weights


@pytest.mark.parametrize("n", [2, 3, 4, 5, 8, 16, 21, 32, 64, 128])
def test_nodes_and_weights_are_those_of_multiprecision(n: int) -> None:
    nodes, weights = gauss_legendre(n)
    exact_nodes, exact_weights = _exact_rule(n)
    assert max(abs(float(a - mpmath.mpf(float(b)))) for a, b in zip(exact_nodes, nodes, strict=True)) < 2e-15
    worst = max(abs(float((a - mpmath.mpf(float(b))) / a)) for a, b in zip(exact_weights, weights, strict=True))
    assert worst < (1e-13 if n <= 64 else 5e-13)


@pytest.mark.parametrize("n", [2, 3, 7, 16, 32])
def test_a_rule_of_n_nodes_is_exact_to_degree_2n_less_1(n: int) -> None:
    nodes, weights = gauss_legendre(n)
    for degree in range(2 * n):
        assert math.fsum(weights * nodes**degree) == pytest.approx(1.0 / (degree + 1), rel=1e-14)
    assert abs(math.fsum(weights * nodes ** (2 * n)) - 1.0 / (2 * n + 1)) > 1e-21


def test_rules_are_ascending_symmetric_and_cannot_be_changed() -> None:
    for n in (2, 9, 512):
        nodes, weights = gauss_legendre(n)
        assert (np.diff(nodes) > 0).all()
        assert nodes[0] > 0.0
        assert nodes[-1] < 1.0
        np.testing.assert_allclose(nodes + nodes[::-1], 1.0, rtol=0, atol=2e-16)
        np.testing.assert_array_equal(weights, weights[::-1])
        assert math.fsum(weights) == pytest.approx(1.0, abs=1e-14)
        assert not nodes.flags.writeable
        assert not weights.flags.writeable


@pytest.mark.parametrize("n", [-1, 0, 1, 513])
def test_other_sizes_are_refused(n: int) -> None:
    with pytest.raises(ValueError, match=f"not {n}"):
        gauss_legendre(n)


_whole = st.tuples(*[st.integers(-1000, 1000).map(float)] * 3)


@given(a=_whole, b=_whole, s=st.integers(-9, 9).map(float))
def test_vector_algebra_is_exact_for_whole_numbers(a: vectors.Vec3, b: vectors.Vec3, s: float) -> None:
    c = vectors.cross(a, b)
    assert vectors.dot(a, c) == vectors.dot(b, c) == 0.0
    assert vectors.dot(c, c) == vectors.dot(a, a) * vectors.dot(b, b) - vectors.dot(a, b) ** 2  # Lagrange
    assert vectors.minus(a, vectors.scaled(b, s)) == tuple(x - s * y for x, y in zip(a, b, strict=True))
    assert vectors.length(a) == pytest.approx(math.hypot(*a), rel=1e-15)
    if any(a):
        assert vectors.length(vectors.unit(a)) == pytest.approx(1.0, abs=3e-16)
