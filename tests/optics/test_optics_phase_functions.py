"""Phase functions: unit integral, mean cosine, values by hand, and the same bits in every binding."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from atmoref._jit import kernel
from atmoref.optics import phase_functions
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate, phase

ASYMMETRIES = (-0.95, -0.6, 0.0, 0.3, 0.76, 0.95)
CASES = [(name, g) for name in PHASE_FUNCTIONS for g in (ASYMMETRIES if "gre" in name or "corn" in name else (0.0,))]

# Mean cosines in closed form: with x = (1 + mu)/2, the mean of mu over x^n is n / (n + 2).
MEAN_COSINE = {
    "isotropic": lambda g: 0.0,
    "rayleigh": lambda g: 0.0,
    "henyey_greenstein": lambda g: g,
    "nishita_hazy": lambda g: 0.5 * 8.0 / 10.0,
    "nishita_murky": lambda g: 0.5 * 32.0 / 34.0,
    "cornette_shanks": lambda g: 3.0 * g * (4.0 + g * g) / (5.0 * (2.0 + g * g)),
}


@kernel
def _scalar(kind, g, mu, out):
    for i in range(mu.size):
        out[i] = phase(kind, g, mu[i])


def _moments(name: str, g: float) -> tuple[float, float]:
    """Return integral and mean cosine by 32-node Gauss-Legendre on panels that shrink towards both peaks."""
    nodes, weights = leggauss(32)
    distance = np.array([1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001, 0.0])
    ends = np.concatenate([distance - 1.0, 1.0 - distance])
    ends = np.unique(ends)
    half = np.diff(ends)[:, None] / 2.0
    mu = ends[:-1, None] + half + half * nodes
    share = 2.0 * math.pi * half * weights * evaluate(PHASE_FUNCTIONS[name], g, mu)
    return math.fsum(share.ravel()), math.fsum((share * mu).ravel())


@pytest.mark.parametrize(("name", "g"), CASES)
def test_the_integral_over_the_sphere_is_one_and_the_mean_cosine_is_known(name, g):
    integral, mean = _moments(name, g)
    assert integral == pytest.approx(1.0, abs=2e-13)
    assert mean == pytest.approx(MEAN_COSINE[name](g), abs=2e-13)


@pytest.mark.parametrize(
    ("name", "g", "mu", "times_4pi"),
    [
        ("isotropic", 0.0, 0.3, 1.0),
        ("henyey_greenstein", 0.5, 1.0, 6.0),  # (1 - g²)/(1 - g)³ = (1 + g)/(1 - g)²
        ("henyey_greenstein", 0.5, -1.0, 0.5 / 2.25),
        ("henyey_greenstein", -0.5, -1.0, 6.0),
        ("henyey_greenstein", 0.5, 0.5, 0.75 / 0.75**1.5),
        ("rayleigh", 0.0, 1.0, 1.5),
        ("rayleigh", 0.0, 0.0, 0.75),
        ("nishita_hazy", 0.0, 1.0, 5.0),
        ("nishita_hazy", 0.0, 0.0, 0.5 + 4.5 / 256.0),
        ("nishita_murky", 0.0, 1.0, 17.0),
        ("nishita_murky", 0.0, -1.0, 0.5),
        ("nishita_murky", 0.0, 0.0, 0.5 + 16.5 / 2.0**32),
        ("cornette_shanks", 0.0, 0.5, 0.75 * 1.25),  # g = 0 is Rayleigh
        ("cornette_shanks", 0.5, 1.0, 1.5 * 0.75 / 2.25 * 2.0 / 0.125),
    ],
)
def test_values_by_hand(name, g, mu, times_4pi):
    assert evaluate(PHASE_FUNCTIONS[name], g, [mu])[0] * 4.0 * math.pi == pytest.approx(times_4pi, rel=4e-15)


def test_forward_over_backward_of_henyey_greenstein():
    forward, backward = evaluate(1, 0.76, [1.0, -1.0])
    assert forward / backward == pytest.approx((1.76 / 0.24) ** 3, rel=1e-13)


@pytest.mark.parametrize(("name", "g"), CASES)
def test_the_scalar_form_has_the_bits_of_the_array_form(name, g):
    mu = np.linspace(-1.0, 1.0, 1001)
    out = np.empty_like(mu)
    _scalar(PHASE_FUNCTIONS[name], g, mu, out)
    np.testing.assert_array_equal(out, evaluate(PHASE_FUNCTIONS[name], g, mu))
    assert (out > 0.0).all()


@pytest.mark.parametrize("g", [0.999, -0.999])
def test_nothing_cancels_at_the_peak(g):
    """At mu = ±1 the denominator is (1 - |g|)², which 1 + g² - 2 g mu loses digits of."""
    peak = evaluate(1, g, [math.copysign(1.0, g)])[0]
    exact = (1.0 + abs(g)) / (1.0 - abs(g)) ** 2 / (4.0 * math.pi)
    assert peak == pytest.approx(exact, rel=1e-15 / (1.0 - abs(g)))


def test_bad_questions_are_refused():
    with pytest.raises(ValueError, match="unknown phase function"):
        evaluate(17, 0.0, [0.0])
    with pytest.raises(ValueError, match="outside"):
        evaluate(1, 1.0, [0.0])
    with pytest.raises(AttributeError, match="nonsense"):
        _ = phase_functions.nonsense
