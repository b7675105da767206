"""What holds for every particle by name; a new one is tested here without further edits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from atmoref.optics import legendre, orders
from atmoref.optics.air import AIR
from atmoref.optics.particles import PARTICLES
from atmoref.optics.phase_functions import evaluate

WAVELENGTHS = (680.0, 550.0, 440.0)
# Riley et al. 2004, Table 2
TABLE_2 = {"cloud": 6.28e-10, "rain": 6.28e-6, "ice": 1.82e-6, "snow": 1.41e-5}
QUICK = [name for name in PARTICLES if name != "rain"]  # 300 radii and 35,000 terms take 20 s a wavelength


@pytest.mark.parametrize("name", sorted(TABLE_2))
def test_extinction_is_that_of_table_2(name):
    assert PARTICLES[name].extinction_m2 == TABLE_2[name]


def test_air_has_the_cross_sections_of_table_2():
    """R-E12: printed for 650, 515, 440 nm; they are those of 680, 550, 440 nm, as in Table 3 with 2.55e25 per m^3."""
    for nm, printed, sea_level in ((680.0, 2.28e-31, 5.8e-6), (550.0, 5.33e-31, 1.35e-5), (440.0, 1.30e-30, 3.31e-5)):
        found = AIR.cross_sections(nm)
        assert found.extinction_m2 == pytest.approx(printed, rel=2e-3)
        assert 2.55e25 * found.scattering_m2 == pytest.approx(sea_level, rel=7e-3)
    mu = np.linspace(-1.0, 1.0, 9)
    np.testing.assert_array_equal(AIR.phase_function(mu, 550.0), evaluate(2, 0.0, mu))
    with pytest.raises(ValueError, match="380 to 780"):
        AIR.split(300.0, 3)


@pytest.mark.parametrize("nm", WAVELENGTHS)
@pytest.mark.parametrize("name", QUICK)
def test_every_particle_is_normalised_and_forgets_the_direction(name, nm):
    """M-1, M-2, M-5: unit integral with the peak, mean cosine g^n, F_n falling (or 1/2) and above 1/2."""
    parts = PARTICLES[name].split(nm, 1000)
    assert 0.0 <= parts.delta < 1.0
    assert parts.rest.shape == (1000,)
    assert parts.rest[0] == pytest.approx(1.0, abs=1e-9)  # required 1e-6
    g = parts.delta + (1.0 - parts.delta) * float(parts.rest[1])
    assert -1e-12 < g < 0.95
    before = 1.0
    for n in (1, 2, 5, 26):
        peak, rest = orders.split_power(parts, n)
        assert peak + rest[0] == pytest.approx(1.0, abs=1e-9)
        assert peak + rest[1] == pytest.approx(g**n, abs=1e-9)
        share = peak + rest[0] * orders.forward_share(rest / rest[0])
        assert 0.5 - 1e-9 <= share <= before + 1e-9
        before = share


@pytest.mark.parametrize("name", [n for n in QUICK if n not in ("ice", "snow")])
def test_nothing_is_negative(name):
    """The series is whole; those of crystals stand for steps between bins and ring there."""
    mu, weights = legendre.gauss_nodes(1500)
    p = legendre.series(PARTICLES[name].split(550.0, 1000).rest, mu)
    assert (p > 0.0).all()
    assert 2.0 * math.pi * math.fsum(weights * p) == pytest.approx(1.0, abs=1e-9)
