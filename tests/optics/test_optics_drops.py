"""Water drops: unit integral, convergence with the number of radii, moments of the sizes, both ways to sum."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from atmoref.optics import legendre, mie
from atmoref.optics.drops import Drops, cosines
from atmoref.optics.particles import DROPS
from atmoref.optics.refraction import air, water
from atmoref.optics.sizes import Lognormal, ModifiedGamma, OneSize

GRID = cosines(np.arange(1801) / 10.0)
CLOUD, CUMULUS, RAIN = DROPS["cloud"], DROPS["cumulus"], DROPS["rain"]


def _moments(sizes, count=4000):
    r, shares = sizes.radii(count)
    assert math.fsum(shares) == pytest.approx(1.0, abs=1e-14)
    return [math.fsum(shares * r**k) for k in (1, 2, 3)]


def test_moments_of_a_lognormal():
    """<r^k> = median^k exp(k^2 s^2 / 2), s = ln sigma_g; cut at 8 s."""
    s = math.log(1.2)
    for k, moment in enumerate(_moments(Lognormal(10e-6, 1.2, cut=8.0)), 1):
        assert moment == pytest.approx(10e-6**k * math.exp(0.5 * k * k * s * s), rel=1e-12)


def test_moments_of_the_cumulus():
    """Bouthors: mean radius 3 um, <r^2> = 13.5 um^2, effective radius 6 um."""
    mean, square, cube = _moments(CUMULUS.sizes)
    assert mean == pytest.approx(3e-6, rel=1e-5)
    assert square == pytest.approx(13.5e-12, rel=1e-5)
    assert cube / square == pytest.approx(6e-6, rel=1e-5)


@pytest.mark.parametrize("name", sorted(DROPS))
def test_extinction_is_near_the_geometric_limit(name):
    """Q_ext is 2 and (for these sizes) up to 15 % more."""
    drops = DROPS[name]
    found = drops.cross_sections(550.0, 60)
    r, shares = drops.sizes.radii(60)
    assert 1.0 < found.extinction_m2 / (2.0 * math.pi * math.fsum(shares * r * r)) < 1.15
    assert found.scattering_m2 == found.extinction_m2
    assert 0.84 < found.asymmetry < 0.90


@pytest.mark.parametrize("nm", [440.0, 550.0, 680.0])
@pytest.mark.parametrize("name", ["cloud", "cumulus"])
def test_the_integral_is_one_by_exact_quadrature(name, nm):
    """Scattering cross-sections come from the coefficients: nothing is normalised by the integral that is checked."""
    drops = DROPS[name]
    a = drops.legendre(nm, 100)
    found = drops.cross_sections(nm, 100)
    assert a[0] == pytest.approx(1.0, abs=1e-12)  # required 1e-6
    assert a[1] == pytest.approx(found.asymmetry, abs=1e-12)
    assert abs(a[-1]) < 1e-14
    assert (np.abs(a) <= 1.0 + 1e-12).all()
    mu, weights = legendre.gauss_nodes(2 * a.size)  # another rule, and through the series
    p = drops.phase_function(mu, nm, 100)
    assert (p > 0.0).all()
    assert 2.0 * math.pi * math.fsum(weights * p) == pytest.approx(1.0, abs=1e-12)


def test_series_and_angles_agree():
    direct = dataclasses.replace(CLOUD, through="angles")
    p, q = CLOUD.phase_function(GRID, 550.0, 50), direct.phase_function(GRID, 550.0, 50)
    np.testing.assert_allclose(p, q, rtol=1e-10)  # measured 8e-12


def test_the_average_is_that_of_single_spheres():
    r, shares = CUMULUS.sizes.radii(5)
    k = 2.0 * math.pi * float(air(550.0)) / 550e-9
    index = float(water(550.0))
    scattering = [math.pi * a * a * float(mie.efficiencies(index, k * a).scattering) for a in r]
    each = [mie.phase_function(index, k * a, GRID) for a in r]
    total = sum(s * c * p for s, c, p in zip(shares, scattering, each, strict=True))
    expected = total / sum(s * c for s, c in zip(shares, scattering, strict=True))
    np.testing.assert_allclose(CUMULUS.phase_function(GRID, 550.0, 5), expected, rtol=1e-9)


def _distance(drops, radii, reference, mu):
    d = drops.phase_function(mu, 550.0, radii) / reference - 1.0
    return float(np.sqrt(np.mean(d * d))), float(np.abs(d).max())


def test_the_cloud_converges_with_the_number_of_radii():
    """Measured rms over angles: 3.9 % (125), 1.6 % (250), 1.0 % (500), 0.42 % (1000 radii): first order."""
    reference = CLOUD.phase_function(GRID, 550.0, 8000)
    rms = {n: _distance(CLOUD, n, reference, GRID)[0] for n in (125, 250, 500, 1000, 2000)}
    assert rms[1000] < 0.006  # required for shipped tables: 0.01
    assert rms[2000] < 0.004
    assert all(rms[2 * n] < 0.8 * rms[n] for n in (125, 250, 500, 1000))
    assert rms[125] / rms[2000] > 8.0  # first order or better over a factor of 16


@pytest.mark.slow
def test_the_rain_converges_with_the_number_of_radii():
    mu = cosines(np.arange(100.0, 180.0, 0.25))
    reference = RAIN.phase_function(mu, 550.0, 2400)
    rms = [_distance(RAIN, n, reference, mu)[0] for n in (75, 150, 300, 600)]
    assert rms == sorted(rms, reverse=True)
    assert rms[2] < 0.035  # measured 5.3, 3.6, 2.7, 1.9 %: the square root of the number


def test_all_coefficients_that_count_are_kept():
    a = CLOUD.legendre(550.0, 200)
    assert np.flatnonzero(np.abs(a) > 1e-6).max() == pytest.approx(392, abs=8)  # the sheet: 392
    padded = CLOUD.legendre(550.0, 200, 1500)
    assert padded.shape == (1500,)
    np.testing.assert_array_equal(padded[: a.size], a)
    np.testing.assert_allclose(CLOUD.legendre(550.0, 200, 10), a[:10], rtol=0.0, atol=1e-12)  # fewer nodes


def test_mirrored_angles_have_mirrored_cosines():
    angles = np.arange(1801) / 10.0
    found = cosines(angles)
    assert found[0] == 1.0
    assert found[900] == 0.0
    assert found[1800] == -1.0
    np.testing.assert_allclose(found, np.cos(np.radians(angles)), atol=2e-16)
    assert np.unique(np.abs(found)).size < 1300  # most pairs share one evaluation


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Lognormal(10e-6, 1.0), "lognormal"),
        (lambda: Lognormal(-1.0, 1.2), "lognormal"),
        (lambda: ModifiedGamma(0.0, 2.0), "modified gamma"),
        (lambda: OneSize(0.0), "positive"),
        (lambda: OneSize(1e-6).radii(0), "at least 1"),
        (lambda: cosines([181.0]), "0 to 180"),
        (lambda: Drops(OneSize(3e-3), 1, 1.0).legendre(550.0), "too large"),
        (lambda: CLOUD.phase_function(0.0, 300.0), "380 to 780"),
        (lambda: Drops(OneSize(1.0), 1, 1.0).cross_sections(550.0), "size parameters"),
    ],
)
def test_bad_questions_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
