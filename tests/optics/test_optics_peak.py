"""Phase functions without their peak: the sheet's numbers for cumulus, closed forms, both ways to integrate."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from atmoref.optics import legendre, orders, peak
from atmoref.optics.drops import cosines
from atmoref.optics.particles import DROPS
from atmoref.optics.phase_functions import evaluate

CUMULUS = DROPS["cumulus"]
# 450, 550, 650 nm, sheet sections 2 and 3 (B-E6, B-E7, B-E9); 4e8 drops per m^3
EXTINCTION = (0.0360, 0.0363, 0.0367)
REDUCED = (0.0211, 0.0221, 0.0231)
REMOVED = (0.413, 0.392, 0.370)
WHOLE_G, REDUCED_G = (0.853, 0.849, 0.843), (0.750, 0.752, 0.751)
WITHIN_5 = (0.46, 0.44, 0.43)
FORWARD = (0.959, 0.957, 0.955)
CASES = list(enumerate((450.0, 550.0, 650.0)))


@pytest.mark.parametrize(("i", "nm"), CASES)
def test_cumulus_without_its_peak_of_5_degrees(i, nm):
    """The sheet's index is not stated; 1.335 for all colours gives its g of 0.843 at 650 nm, where water has 1.3320.

    dg/dn is -0.7 (0.8460, 0.8429 for 1.331, 1.335): 0.003 of the index are 0.002 of g, and 0.003 of the reduced one.
    """
    a = CUMULUS.legendre(nm)
    found = peak.clamped(a, 5.0)
    extinction = 4e8 * CUMULUS.cross_sections(nm).extinction_m2
    assert extinction == pytest.approx(EXTINCTION[i], abs=1e-4)
    assert found.removed == pytest.approx(REMOVED[i], abs=2e-3)
    assert (1.0 - found.removed) * extinction == pytest.approx(REDUCED[i], abs=1e-4)
    assert a[1] == pytest.approx(WHOLE_G[i], abs=2.5e-3)
    assert found.legendre(2)[1] == pytest.approx(REDUCED_G[i], abs=4e-3)
    assert peak.share_within(a, 5.0) == pytest.approx(WITHIN_5[i], abs=6e-3)
    assert orders.forward_share(a) == pytest.approx(FORWARD[i], abs=1.5e-3)
    assert peak.share_within(a, 90.0) == pytest.approx(orders.forward_share(a), abs=1e-12)


@pytest.mark.parametrize("angle", [5.0, 40.0, 90.0])
def test_henyey_greenstein_against_adaptive_quadrature(angle):
    a = 0.8 ** np.arange(400.0)
    found = peak.clamped(a, angle)
    assert found.level == pytest.approx(float(evaluate(1, 0.8, cosines(angle))), rel=1e-12)

    def part(power: int, low: float, high: float) -> float:
        return quad(
            lambda t: 2.0 * math.pi * math.sin(t) * math.cos(t) ** power * float(found.phase_function(math.cos(t))),
            math.radians(low), math.radians(high), epsabs=1e-12, epsrel=1e-12, limit=200,
        )[0]  # fmt: skip

    whole = part(0, 0.0, angle) + part(0, angle, 180.0)
    assert whole == pytest.approx(1.0, abs=1e-10)
    a_reduced = found.legendre(30)
    assert a_reduced[0] == pytest.approx(1.0, abs=1e-12)
    assert a_reduced[1] == pytest.approx(part(1, 0.0, angle) + part(1, angle, 180.0), abs=1e-10)
    assert a_reduced[2] == pytest.approx(1.5 * (part(2, 0.0, angle) + part(2, angle, 180.0)) - 0.5, abs=1e-10)
    share = quad(lambda t: 2.0 * math.pi * math.sin(t) * float(evaluate(1, 0.8, math.cos(t))), 0.0, math.radians(angle))
    assert peak.share_within(a, angle) == pytest.approx(share[0], abs=1e-10)


def test_inside_the_cut_it_is_flat_outside_it_is_scaled():
    a = CUMULUS.legendre(550.0, 50)
    found = peak.clamped(a, 5.0)
    inside, outside = cosines([0.0, 1.0, 4.9, 5.0]), cosines([5.1, 30.0, 138.0, 180.0])
    np.testing.assert_array_equal(found.phase_function(inside), found.phase_function(cosines(5.0)))
    np.testing.assert_allclose(
        found.phase_function(outside), legendre.series(a, outside) / (1.0 - found.removed), rtol=1e-14
    )
    assert peak.share_within(a, 180.0) == pytest.approx(1.0, abs=1e-12)


def test_an_isotropic_function_has_no_peak():
    found = peak.clamped([1.0], 5.0)
    assert found.removed == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(found.legendre(4), [1.0, 0.0, 0.0, 0.0], atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 91.0, float("nan")])
def test_other_angles_are_refused(angle):
    with pytest.raises(ValueError, match="0 and 90"):
        peak.clamped([1.0, 0.5], angle)


def test_bad_questions_are_refused():
    with pytest.raises(ValueError, match="180"):
        peak.share_within([1.0], 181.0)
    with pytest.raises(ValueError, match="at least 1"):
        peak.clamped([1.0], 5.0).legendre(0)
    with pytest.raises(ValueError, match="as many values"):
        legendre.of_points([1.0], [0.0, 1.0], 1)
