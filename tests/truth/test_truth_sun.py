"""Sunlight against closed forms, 40-digit arithmetic and brute force: bare, through windows, with and without end."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from truth_pictures import beam_by_brute_force, pictured, sun, window, with_files
from truth_scenes import ground, pixel_ray, scene, sphere

import atmoref.truth as truth
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate
from atmoref.truth.beams_quadrature import quadrature_along
from atmoref.truth.beams_question import ask
from atmoref.truth.beams_sun import exponential_moments


def _along(s, start, direction, length=None):
    out = quadrature_along(
        ask(s), np.array([start]), np.array([direction]), None if length is None else np.array([length])
    )
    return out["beam"][0], out["error"][0]


@pytest.mark.parametrize("tau", [0.0, 1e-300, 1e-12, 1e-3, 0.5, 1.9999, 2.0, 7.0, 40.0, 800.0])
def test_moments_of_the_exponential(tau):
    mpmath.mp.dps = 40
    for j, value in enumerate(exponential_moments(tau)):
        exact = mpmath.hyp1f1(j + 1, j + 2, -mpmath.mpf(tau)) / (j + 1)
        assert value == pytest.approx(float(exact), rel=2e-15)


@pytest.mark.parametrize("sigma", [1e-14, 1e-6, 0.02, 3.0])
@pytest.mark.parametrize("length", [1e-3, 30.0, 1e5, math.inf])
@pytest.mark.parametrize("g", [0.0, 0.76])
def test_without_objects_the_beam_is_in_closed_form(sigma, length, g):
    """gamma (1 - exp(-sigma T)) / sigma with gamma = E_0 sigma_s p(alpha) (erratum D-E13)."""
    s = scene([sun((0.3, -1.0, 0.4), (2.0, 3.0, 5.0))], extinction=(sigma,) * 3, phase="henyey_greenstein", g=g)
    direction = np.array([0.2, 0.3, 1.0]) / math.sqrt(1.13)
    cosine = -float(np.array(s.lights[0].axis()) @ direction)
    p = (1.0 - g * g) / (4.0 * math.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)
    beam, error = _along(s, (0.0, 5.0, 0.0), direction, length)
    exact = np.array([2.0, 3.0, 5.0]) * 0.9 * p * -math.expm1(-sigma * length)
    np.testing.assert_allclose(beam, exact, rtol=4e-15)
    assert (error <= 1e-14 * beam).all()
    assert (abs(beam - exact) <= error).all()


def test_forward_and_backward_differ_as_henyey_and_greenstein_say():
    """((1 + g) / (1 - g))³ = 394.4 for g = 0.76 (erratum D-E13)."""
    s = scene([sun((0.0, 0.0, 1.0))], phase="henyey_greenstein", g=0.76)
    forward, backward = (_along(s, (0.0, 0.0, 0.0), (0.0, 0.0, z))[0][0] for z in (-1.0, 1.0))
    assert forward / backward == pytest.approx((1.76 / 0.24) ** 3, rel=1e-12)


def test_a_medium_without_extinction_scatters_nothing():
    s = scene([sun()], extinction=(0.0, 0.0, 0.02))
    beam, _ = _along(s, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert beam[0] == beam[1] == 0.0
    assert beam[2] > 0.0


def test_scattering_without_extinction_is_infinite_on_a_ray_without_end():
    q = ask(scene([sun()], extinction=(0.0,) * 3))
    q = q._replace(medium=q.medium._replace(scattering=(1.0,) * 3))
    out = quadrature_along(q, np.zeros((2, 3)), np.array([[0.0, 1.0, 0.0]] * 2), np.array([math.inf, 7.0]))
    assert np.isinf(out["beam"][0]).all()
    assert (out["error"][0] == 0.0).all()
    np.testing.assert_allclose(out["beam"][1], 7.0 * 10.0 / (4.0 * math.pi), rtol=1e-14)


@pytest.mark.parametrize("texel", [(0, 0), (0, 3), (1, 2), (2, 3)])
def test_a_window_with_one_bright_texel_is_a_tent(texel):
    """Orientation and closed form: row 0 at the top edge (the end of up_m), column 0 at the left edge."""
    picture = np.zeros((3, 4, 3))
    picture[texel] = (1.0, 0.5, 0.25)
    s = scene([sun((0.0, -1.0, 0.0), window=window((0.0, 9.0, 0.0), (8.0, 0.0, 0.0), (0.0, 0.0, 6.0), 0.5))])
    with_files(s, {0: picture})
    z = (
        3.0 - 2.0 * (texel[0] + 0.5) + 0.3
    )  # 0.15 texels from the row's middle: factor 0.85, or 1 beyond the last middle
    beam, _ = _along(s, (-20.0, 2.0, z), (1.0, 0.0, 0.0), 40.0)
    column = -4.0 + 2.0 * (texel[1] + 0.5)
    high = 0.85 if texel[0] > 0 else 1.0
    mpmath.mp.dps = 30

    def tent(x):
        flat = (x < column and texel[1] == 0) or (x > column and texel[1] == 3)
        return (1.0 if flat else max(0.0, 1.0 - abs(x - column) / 2.0)) * mpmath.exp(-0.02 * (x + 20.0))

    ends = sorted({max(-4.0, column - 2.0), column, min(4.0, column + 2.0)})
    exact = 0.5 * high * 10.0 * 0.018 / (4.0 * math.pi) * float(mpmath.quad(tent, ends))
    np.testing.assert_allclose(beam, exact * np.array([1.0, 0.5, 0.25]), rtol=1e-13)


def test_a_clear_window_is_a_prism_and_ends_at_its_plane():
    s = scene([sun((0.5, -1.0, 0.0), window=window(across=(4.0, 0.0, 0.0), up=(0.0, 0.0, 2.0)))], extinction=(0.1,) * 3)
    with_files(s)
    beam, _ = _along(s, (-20.0, 10.0, 0.7), (1.0, 0.0, 0.0))  # 10 m below: the prism from x = 3 to x = 7
    gamma = 10.0 * 0.09 / (4.0 * math.pi)
    np.testing.assert_allclose(beam, gamma * (math.exp(-2.3) - math.exp(-2.7)) / 0.1, rtol=1e-14)
    assert (_along(s, (-20.0, 10.0, 1.1), (1.0, 0.0, 0.0))[0] == 0.0).all()
    upwards, _ = _along(s, (0.0, 17.0, 0.0), (0.0, 1.0, 0.0))  # lit from x + (20 - y)/2 = 2 on, below the window
    np.testing.assert_allclose(upwards, gamma * -math.expm1(-0.3) / 0.1, rtol=1e-14)


@pytest.mark.parametrize("direction", [(0.5, -1.0, 0.0), (-0.5, 1.0, 0.0)])
def test_a_ray_along_the_light_may_be_lit_without_end(direction):
    picture = np.random.default_rng(0).random((5, 6, 3))
    s = with_files(scene([sun((0.5, -1.0, 0.0), window=window())]), {0: picture})
    length = None if direction[1] < 0.0 else 4.0
    beam, _ = _along(s, (1.0, 19.0, 0.5), direction, length)
    bare, _ = _along(scene([sun((0.5, -1.0, 0.0))]), (1.0, 19.0, 0.5), direction, length)
    assert (beam > 0.0).all()
    share = beam / bare
    if length is None:
        assert ((picture.min() <= share) & (share <= picture.max())).all()
    else:  # the window ends the beam 1 m above
        assert (share < 0.5).all()


def test_brute_force_agrees_with_solids_in_the_way():
    s = pictured()
    p = PHASE_FUNCTIONS["henyey_greenstein"]
    for column, row in ((24, 16), (12, 20), (33, 12), (40, 25)):
        a, d = pixel_ray(s, column, row)
        length = 60.0
        for which in (1, 2):
            one = pictured()
            one.lights = [s.lights[which]]
            one.light_map = lambda i, k=which: s.light_map(k)
            out = quadrature_along(ask(one), a[None], d[None], np.array([length]))
            t = min(length, float(_end(one, a, d)))
            exact = beam_by_brute_force(s, which, a, d, t, lambda mu: float(evaluate(p, 0.6, mu)))
            np.testing.assert_allclose(out["beam"][0], exact, rtol=1e-9, atol=1e-12)


def _end(s, a, d):
    from truth_scenes import first_hit

    return first_hit(s.objects, a, d)[0]


def test_the_ground_under_the_sun_reflects_by_its_cosine():
    s = scene([sun((0.0, -0.6, 0.8), (1.0, 2.0, 4.0))], [ground(0.0, (0.5, 0.5, 0.5))], extinction=(1e-9,) * 3)
    result = truth.solve(s)
    np.testing.assert_allclose(
        result.buffers["surface"][-1, 15], 0.5 / math.pi * 0.6 * np.array([1.0, 2.0, 4.0]), rtol=1e-6
    )
    s.lights = [sun((0.0, 0.6, 0.8))]  # from below
    assert (truth.solve(s).image == 0.0).all()


def test_a_sphere_throws_a_cylinder():
    s = scene([sun((0.0, -1.0, 0.0))], [sphere((0.0, 8.0, 0.0), 2.0)], extinction=(0.05,) * 3)
    beam, _ = _along(s, (-20.0, 3.0, 1.2), (1.0, 0.0, 0.0))  # half a chord of 1.6 m
    gamma = 10.0 * 0.045 / (4.0 * math.pi) / 0.05
    exact = gamma * (1.0 - math.exp(-0.05 * 18.4) + math.exp(-0.05 * 21.6))
    np.testing.assert_allclose(beam, exact, rtol=1e-14)
