"""Mie scattering: published values, multiprecision, closed forms at both ends, and the same bits anywhere."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from reference import mie_multiprecision as exact

from atmoref.optics import mie

# Wiscombe 1979, cases of MIEV0: m, x, Q_sca, g, to the digits printed. For m = 1.5 + i, x = 10,000 two sets of
# digits are in circulation: 1.236574, 0.846310 (Prahl's Mie programs in C) and 1.236575, 0.846309 (miepython's tests of
# MIEV0). Both programs compute 1.2365743 and 0.8463100.
PUBLISHED = [
    (0.75, 10.0, "2.232265", "0.896473"),
    (0.75, 1000.0, "1.997908", "0.844944"),
    (1.33 + 1e-5j, 1.0, "0.093923", "0.184517"),
    (1.33 + 1e-5j, 100.0, "2.096594", "0.868959"),
    (1.33 + 1e-5j, 10000.0, "1.723857", "0.907840"),
    (1.5 + 1j, 100.0, "1.283697", "0.850252"),
    (1.5 + 1j, 10000.0, "1.236574", "0.846310"),
    (10.0 + 10j, 100.0, "1.836785", "0.556215"),
    (10.0 + 10j, 10000.0, "1.795393", "0.548194"),
]


@pytest.mark.parametrize(("m", "x", "scattering", "asymmetry"), PUBLISHED)
def test_published_values_to_all_printed_digits(m, x, scattering, asymmetry):
    found = mie.efficiencies(m, x)
    assert f"{float(found.scattering):.6f}" == scattering
    assert f"{float(found.asymmetry):.6f}" == asymmetry


def _random_spheres(seed: int, count: int, most: float) -> list[tuple[complex, float]]:
    """Sizes and indices spread over their decades, from nearly transparent to m = 3 + 10 i; every second absorbs."""
    rng = np.random.default_rng(seed)
    return [
        (
            complex(1.0 + 10.0 ** rng.uniform(-4.0, math.log10(2.0)), k % 2 * 10.0 ** rng.uniform(-9.0, 1.0)),
            10.0 ** rng.uniform(-4.0, math.log10(most)),
        )
        for k in range(count)
    ]


@pytest.mark.parametrize(("m", "x"), _random_spheres(11, 40, 200.0))
def test_random_spheres_are_those_of_multiprecision(m, x):
    sphere = exact.solve(m, x, int(mie.number_of_terms(x)) + 6)
    found = [float(v) for v in mie.efficiencies(m, x)]
    expected = exact.efficiencies(sphere)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-50)  # measured 2.1e-11, most 1e-14
    np.testing.assert_allclose(found[:3], expected[:3], rtol=1e-11, atol=1e-50)  # measured 1.9e-12, m = 1.00013
    mu = np.array([1.0, 0.999, 0.5, 0.01, -0.3, -0.99, -1.0])
    s1, s2 = mie.amplitudes(m, x, mu)
    for i, cosine in enumerate(mu):
        e1, e2 = exact.amplitudes(sphere, float(cosine))
        assert max(abs(s1[i] - e1), abs(s2[i] - e2)) <= 1e-9 * max(abs(e1), abs(e2))  # measured 1.7e-10, where dark


@pytest.mark.parametrize("m", [0.75, 1.33 + 1e-5j, 1.0001, 1.6 + 0.3j, 3.0])
def test_coefficients_of_a_large_sphere_are_those_of_multiprecision(m):
    x = 1000.0
    sphere = exact.solve(m, x, int(mie.number_of_terms(x)) + 6)
    a, b = mie.coefficients(m, x)
    for n in (1, 2, 250, 500, 750, 990, 1000, 1020):
        assert abs(a[n - 1] - complex(sphere.a[n - 1])) < 1e-12  # measured 1e-13
        assert abs(b[n - 1] - complex(sphere.b[n - 1])) < 1e-12
    assert abs(a[-1]) < 1e-15
    assert abs(complex(sphere.a[a.size])) < 1e-15  # the first one left out


@pytest.mark.slow
def test_backscatter_of_a_raindrop_is_that_of_multiprecision():
    m, x = 1.33 + 1e-5j, 15000.0
    sphere = exact.solve(m, x, int(mie.number_of_terms(x)) + 6)
    np.testing.assert_allclose(mie.efficiencies(m, x), exact.efficiencies(sphere), rtol=1e-10)  # measured 2.6e-11
    for mu in (-0.99, -1.0):
        s1, s2 = mie.amplitudes(m, x, mu)
        np.testing.assert_allclose([s1, s2], exact.amplitudes(sphere, mu), rtol=1e-9)  # measured 4e-10


@pytest.mark.parametrize(("m", "x"), [(1.33, 1000.0), (1.5, 1500.5), (1.0001, 777.7)])
def test_backscatter_of_large_spheres(m, x):
    """Measured 9e-10 at worst, where 777 terms cancel to 1e-5 of their size (m = 1.0001)."""
    sphere = exact.solve(m, x, int(mie.number_of_terms(x)) + 6)
    found, expected = float(mie.efficiencies(m, x).backscatter), exact.efficiencies(sphere)[3]
    assert found == pytest.approx(expected, rel=1e-8)
    s1, s2 = mie.amplitudes(m, x, -1.0)
    assert s1 == -s2
    assert 4.0 * abs(complex(s1)) ** 2 / x**2 == pytest.approx(found, rel=1e-8)


@pytest.mark.parametrize("m", [1.0 + 10j, 3.0 + 10j, 1.5 + 0.1j])
def test_backscatter_of_a_large_absorber_is_fresnels(m):
    """Geometrical optics: what comes back is what is reflected at normal incidence; the next order is 1/x."""
    fresnel = abs((m - 1.0) / (m + 1.0)) ** 2
    assert float(mie.efficiencies(m, 15000.0).backscatter) == pytest.approx(fresnel, rel=1e-6)


@pytest.mark.parametrize("m", [1.0001, 1.33, 1.33 + 1e-9j, 1.5 + 1j, 3.0 + 10j])
def test_small_spheres_are_rayleighs(m):
    """Q_sca = 8/3 x^4 |K|^2, Q_abs = 4 x Im K, K = (m^2 - 1)/(m^2 + 2), P = 3/16 pi (1 + mu^2); next order x^2."""
    x = 1e-5
    k = (m - 1.0) * (m + 1.0) / (m * m + 2.0)
    found = mie.efficiencies(m, x)
    assert float(found.scattering) == pytest.approx(8.0 / 3.0 * x**4 * abs(k) ** 2, rel=1e-7)
    assert float(found.absorption) == pytest.approx(4.0 * x * complex(k).imag, rel=1e-7)
    assert abs(float(found.asymmetry)) < 1e-9 * (1.0 + abs(m) ** 2)
    mu = np.linspace(-1.0, 1.0, 21)
    np.testing.assert_allclose(
        mie.phase_function(m, x, mu), 3.0 / (16.0 * math.pi) * (1.0 + mu * mu), rtol=1e-8 * (1.0 + abs(m) ** 2)
    )


def test_nothing_is_nan_over_the_whole_domain():
    sizes = np.concatenate([np.geomspace(1e-4, 15000.0, 23), [1.0, 2.0, 3.0, math.pi, 2.0 * math.pi, 1000.0]])
    for real in (1.0001, 1.33, 2.0, 3.0):
        for imaginary in (0.0, 1e-12, 1e-3, 10.0):
            found = mie.efficiencies(complex(real, imaginary), sizes)
            assert all(np.isfinite(v).all() for v in found)
            assert (found.scattering > 0.0).all()
            assert (found.absorption > 0.0).all() if imaginary else (found.absorption == 0.0).all()
            assert (np.abs(found.asymmetry) < 1.0).all()
    for x in (1e-4, 0.37, 8.0, 15000.0):
        p = mie.phase_function(1.33 + 1e-9j, x, np.array([1.0, 0.0, -0.5, -1.0]))
        assert np.isfinite(p).all()
        assert (p > 0.0).all()


@pytest.mark.parametrize(("m", "x"), [(1.33, 0.1), (1.33, 30.0), (1.5 + 0.1j, 150.0)])
def test_the_integral_over_the_sphere_is_one_and_the_mean_cosine_is_g(m, x):
    nodes, weights = leggauss(2 * int(mie.number_of_terms(x)))
    share = 2.0 * math.pi * weights * mie.phase_function(m, x, nodes)
    assert math.fsum(share) == pytest.approx(1.0, abs=1e-9)  # NumPy's rule: measured 7e-11
    assert math.fsum(share * nodes) == pytest.approx(float(mie.efficiencies(m, x).asymmetry), abs=1e-9)


@pytest.mark.parametrize(("m", "x"), [(1.33, 50.0), (1.5 + 0.1j, 700.0)])
def test_the_optical_theorem(m, x):
    s1, _ = mie.amplitudes(m, x, 1.0)
    assert 4.0 / x**2 * complex(s1).real == pytest.approx(float(mie.efficiencies(m, x).extinction), rel=1e-12)


def test_intensities_are_the_sum_over_spheres():
    mu = np.cos(np.linspace(0.0, math.pi, 97))
    sizes, weights = np.array([0.3, 12.0, 130.0]), np.array([5.0, 0.25, 1e-3])
    total = np.zeros_like(mu)
    for x, weight in zip(sizes, weights, strict=True):
        s1, s2 = mie.amplitudes(1.34, x, mu)
        total += weight * (np.abs(s1) ** 2 + np.abs(s2) ** 2)
    np.testing.assert_allclose(mie.intensities(1.34, sizes, weights, mu), total, rtol=1e-13)


def _digest() -> str:
    mu = np.linspace(-1.0, 1.0, 301)
    sizes = np.geomspace(1e-3, 300.0, 40)
    found = mie.intensities(1.334 + 1e-8j, sizes, sizes**-3.0, mu)
    return hashlib.sha256(found.tobytes() + np.array(mie.efficiencies(1.334 + 1e-8j, sizes)).tobytes()).hexdigest()


def test_threads_and_batches_leave_the_bits(monkeypatch):
    before = _digest()
    monkeypatch.setattr(mie, "_threads", lambda: 7)
    monkeypatch.setattr(mie, "BATCH_BYTES", 40000)
    assert _digest() == before
    monkeypatch.setattr(mie, "_threads", lambda: 1)
    assert _digest() == before


@pytest.mark.parametrize(
    ("m", "x", "message"),
    [
        (1.33 - 0.1j, 1.0, "refractive index"),
        (0.0, 1.0, "refractive index"),
        (21.0, 1.0, "refractive index"),
        (complex("nan"), 1.0, "refractive index"),
        (1.33, 0.0, "size parameters"),
        (1.33, 5e4, "size parameters"),
        (1.33, float("nan"), "size parameters"),
    ],
)
def test_bad_questions_are_refused(m, x, message):
    with pytest.raises(ValueError, match=message):
        mie.efficiencies(m, x)


def test_bad_cosines_and_weights_are_refused():
    with pytest.raises(ValueError, match="cosines"):
        mie.phase_function(1.33, 1.0, [1.1])
    with pytest.raises(ValueError, match="shape"):
        mie.intensities(1.33, [1.0, 2.0], [1.0], [0.5])


def test_a_sphere_of_the_mediums_index_scatters_nothing():
    found = mie.efficiencies(1.0, [0.1, 10.0])
    for value in found[:4]:
        np.testing.assert_allclose(value, 0.0, atol=1e-25)
