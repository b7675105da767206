"""Integrals of what a table of angles means, and phase functions whose peak is taken out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from atmoref.optics.analytic import Formula
from atmoref.optics.drops import Drops
from atmoref.optics.single import hat_weights, normalised
from atmoref.optics.sizes import Lognormal

UNEVEN = np.array([0.0, 0.01, 0.5, 3.0, 20.0, 21.0, 90.0, 140.0, 179.99, 180.0])


def test_weights_integrate_linear_interpolation() -> None:
    """Against adaptive quadrature of the interpolation itself; a constant gives the sphere."""
    values = np.random.default_rng(2).random(UNEVEN.size)

    def integrand(theta: float) -> float:
        return 2.0 * math.pi * math.sin(theta) * float(np.interp(math.degrees(theta), UNEVEN, values))

    expected, _ = quad(integrand, 0.0, math.pi, points=np.radians(UNEVEN)[1:-1], limit=200, epsabs=1e-13)
    assert float(hat_weights(UNEVEN) @ values) == pytest.approx(expected, rel=1e-12)
    assert hat_weights(UNEVEN).sum() == pytest.approx(4.0 * math.pi, rel=1e-13)
    assert hat_weights(UNEVEN, 90.0).sum() == pytest.approx(2.0 * math.pi, rel=1e-13)
    scaled, whole = normalised(values, UNEVEN)
    assert whole == pytest.approx(expected, rel=1e-12)
    assert float(hat_weights(UNEVEN) @ scaled) == pytest.approx(1.0, rel=1e-14)


def test_angles_that_are_no_grid_are_refused() -> None:
    for angles in ([0.0, 90.0], [1.0, 180.0], [0.0, 90.0, 90.0, 180.0], [0.0]):
        with pytest.raises(ValueError, match="0 to 180"):
            hat_weights(angles)
    with pytest.raises(ValueError, match="none of the angles"):
        hat_weights([0.0, 180.0], 90.0)


@pytest.mark.parametrize("g", [-0.6, 0.0, 0.9])
def test_formulas_have_their_coefficients(g: float) -> None:
    """Henyey-Greenstein: g^l. Cornette-Shanks: its known mean cosine, and a_0 = 1."""
    hg = Formula("henyey_greenstein", 1e-12, g).single(550.0, [0.0, 180.0]).rest
    np.testing.assert_allclose(hg, g ** np.arange(float(hg.size)), atol=1e-14)
    cs = Formula("cornette_shanks", 1e-12, g).single(550.0, [0.0, 180.0]).rest
    assert cs[0] == pytest.approx(1.0, abs=1e-12)
    assert cs[1] == pytest.approx(3.0 * g * (4.0 + g * g) / (5.0 * (2.0 + g * g)), abs=1e-12)


def test_wrong_formulas_are_refused() -> None:
    with pytest.raises(ValueError, match="allowed: isotropic"):
        Formula("mie", 1e-12)
    with pytest.raises(ValueError, match=r"0\.98"):
        Formula("henyey_greenstein", 1e-12, 0.99)


def test_drops_beyond_their_peak_keep_norm_and_mean_cosine() -> None:
    """Half of the light is diffracted (Babinet); peak and rest together have the cross-sections' mean cosine."""
    drops = Drops(Lognormal(0.2e-3, 1.2, 2.0), radii=60, extinction_m2=1.0, through="angles")
    found = drops.beyond_peak(550.0, 60)
    a = found.legendre(3)
    assert 0.48 < found.delta < 0.5
    assert a[0] == pytest.approx(1.0, abs=1e-12)
    whole = found.delta + (1.0 - found.delta) * a[1]
    assert whole == pytest.approx(
        drops.cross_sections(550.0).asymmetry, abs=5e-4
    )  # a delta where P has a cap of 1 degree
    parts = drops.split(550.0, 3)
    assert parts.delta == found.delta
    np.testing.assert_array_equal(parts.rest, a)
