"""Light of projectors against 40-digit arithmetic, brute force, its own refinement, and hostile cases."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from truth_pictures import beam_by_brute_force, only, pictured, projector, sun, unit, window, with_files
from truth_scenes import first_hit, ground, pixel_ray, scene, sphere

import atmoref.truth as truth
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate
from atmoref.truth.beams_projector import GAUSS_KRONROD_5
from atmoref.truth.beams_quadrature import quadrature, quadrature_along
from atmoref.truth.beams_question import ask
from atmoref.truth.quadrature_rules import gauss_legendre
from atmoref.truth.rows import make_crop

WHITE = np.ones((3, 4, 3))


def _along(s, start, direction, length=math.inf, **more):
    out = quadrature_along(ask(s), np.array([start]), np.array([direction]), np.array([length]), **more)
    return out["beam"][0], out["error"][0]


def _refined(s):
    size = s.image.width, s.image.height
    rule = gauss_legendre(42)
    return quadrature(ask(s), size[::-1], make_crop(None, *size), rule=rule, first_split=2, adaptive=False)


def test_the_small_rule_is_exact_to_its_degrees():
    x, fine, coarse = GAUSS_KRONROD_5.nodes, GAUSS_KRONROD_5.fine, GAUSS_KRONROD_5.coarse
    for degree in range(8):
        exact = 2.0 / (degree + 1) if degree % 2 == 0 else 0.0
        assert fine @ x**degree == pytest.approx(exact, abs=1e-15)
        assert degree > 3 or coarse @ np.where(coarse > 0, x, 0.0) ** degree == pytest.approx(exact, abs=1e-15)


@pytest.mark.parametrize(("sigma", "g"), [(1e-12, 0.0), (0.02, 0.0), (0.02, 0.8), (1.0, -0.5)])
def test_a_white_picture_is_a_pyramid_of_a_point_light(sigma, g):
    """The light 8 m above the ray, half angle 30°: lit from x = -8 tan 30° to 8 tan 30°."""
    s = with_files(
        scene([projector((0.0, 10.0, 0.0), (0.0, -1.0, 0.0))], extinction=(sigma,) * 3, phase="henyey_greenstein", g=g),
        {0: WHITE},
    )
    beam, error = _along(s, (-20.0, 2.0, 0.0), (1.0, 0.0, 0.0))
    mpmath.mp.dps = 30

    def f(x):
        r = mpmath.sqrt(64 + x * x)
        mu = -x / r
        p = (1 - mpmath.mpf(g) ** 2) / (4 * mpmath.pi * (1 + mpmath.mpf(g) ** 2 - 2 * g * mu) ** 1.5)
        return p * mpmath.exp(-sigma * (r + x + 20)) / (r * r)

    edge = 8 * mpmath.tan(mpmath.pi / 6)
    exact = 1000.0 * 0.9 * sigma * float(mpmath.quad(f, [-edge, 0, edge]))
    np.testing.assert_allclose(beam, exact, rtol=1e-13)
    assert (abs(beam - exact) <= error).all()


@pytest.mark.parametrize("across", [True, False])
def test_one_bright_texel_lights_where_the_picture_says(across):
    """Axis down, up = +z, so right = axis x up = -x: column 0 is at +x, row 0 at +z."""
    picture = np.zeros((4, 6, 3))
    picture[0, 1] = 1.0
    light = projector((0.0, 10.0, 0.0), (0.0, -1.0, 0.0), half=math.degrees(math.atan(0.6)))
    s = with_files(scene([light], extinction=(1e-12,) * 3), {0: picture})  # at 10 m: 12 m by 8 m, texels of 2 m
    x, z = 3.0, 3.0  # the texel's middle on y = 0
    ray = ((-50.0, 0.0, z), (1.0, 0.0, 0.0)) if across else ((x, 0.0, -50.0), (0.0, 0.0, 1.0))
    beam, _ = _along(s, *ray)

    def f(k):
        place = (k, z) if across else (x, k)
        share = max(0.0, 1.0 - abs(place[0] - x) / 2.0) * (
            1.0 if place[1] > z else max(0.0, 1.0 - (z - place[1]) / 2.0)
        )
        return share / (100.0 + place[0] ** 2 + place[1] ** 2)

    exact = 1000.0 * 0.9e-12 / (4.0 * math.pi) * float(mpmath.quad(f, [1.0, 3.0, 5.0] if across else [1.0, 3.0, 4.0]))
    np.testing.assert_allclose(beam, exact, rtol=1e-10)
    mirrored = ((-50.0, 0.0, -z), (1.0, 0.0, 0.0)) if across else ((-x, 0.0, -50.0), (0.0, 0.0, 1.0))
    assert (_along(s, *mirrored)[0] == 0.0).all()


def test_brute_force_agrees_with_solids_in_the_way():
    s = only(pictured(), 0)
    p = PHASE_FUNCTIONS["henyey_greenstein"]
    for column, row in ((24, 16), (12, 20), (30, 22), (15, 10)):
        a, d = pixel_ray(s, column, row)
        t = min(60.0, float(first_hit(s.objects, a, d)[0]))
        beam, _ = _along(s, a, d, 60.0)
        exact = beam_by_brute_force(s, 0, a, d, t, lambda mu: float(evaluate(p, 0.6, mu)))
        np.testing.assert_allclose(beam, exact, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (12, 17), (90, 160)])
def test_every_lit_pixel_agrees_with_its_own_refinement(size):
    s = pictured()
    slide = np.random.default_rng(5).random((*size, 3))
    glass = s.light_map(2)
    with_files(s, {0: slide, 2: glass})
    result, fine = truth.solve(s), _refined(s)
    lit = fine["beam"] > 0.0
    assert lit.any(axis=2).mean() > 0.9
    np.testing.assert_allclose(result.buffers["beam"], fine["beam"], rtol=1e-9)
    assert (abs(result.image - fine["image"]) <= result.error).all()
    assert result.stats["values_over_rtol"] == 0
    pyramid = truth.solve(only(s, 0))
    np.testing.assert_allclose(pyramid.buffers["beam"], _refined(only(s, 0))["beam"], rtol=1e-9, atol=1e-300)


def test_threads_and_crop_keep_the_bits():
    s = pictured()
    whole = truth.solve(s, threads=1)
    for threads in (2, 3):
        other = truth.solve(s, threads=threads)
        np.testing.assert_array_equal(other.image, whole.image)
        np.testing.assert_array_equal(other.error, whole.error)
    np.testing.assert_array_equal(truth.solve(s, crop=(5, 9, 20, 11)).image, whole.image[9:20, 5:25])


def test_a_picture_finer_than_the_ray_is_its_mean():
    """A checkerboard of 512 texels against grey."""
    board = np.indices((512, 512)).sum(axis=0) % 2
    s = with_files(scene([projector()], [ground()]), {0: np.repeat(board[..., None], 3, axis=2).astype(float)})
    grey = with_files(scene([projector()], [ground()]), {0: np.full((1, 1, 3), 0.5)})
    a, b = (
        truth.solve(s, crop=(10, 20, 10, 10)).buffers["beam"],
        truth.solve(grey, crop=(10, 20, 10, 10)).buffers["beam"],
    )
    np.testing.assert_allclose(a, b, rtol=2e-2)


def _noise(rows, columns):
    return np.random.default_rng(rows).random((rows, columns, 3))


HOSTILE = {
    "light on the axis of view": with_files(
        scene([projector((0.0, 14.0, 0.0), (0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0))], [ground()]), {0: _noise(8, 8)}),
    "shines at the eye": with_files(
        scene([projector((0.0, 14.0, 0.0), (0.0, 0.0, -1.0), up=(0.0, 1.0, 0.0))], [ground()]), {0: _noise(8, 8)}),
    "light in the eye": with_files(
        scene([projector((0.0, 14.0, -45.0), (0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0))], [ground()]), {0: _noise(8, 8)}),
    "black picture": with_files(scene([projector()], [ground()]), {0: np.zeros((5, 5, 3))}),
    "wide": with_files(scene([projector(half=89.0)], [ground()]), {0: _noise(31, 40)}),
    "narrow": with_files(scene([projector(half=0.01)], [ground()]), {0: _noise(31, 40)}),
    "a row of texels": with_files(scene([projector()], [ground()]), {0: _noise(1, 500)}),
    "far away": with_files(
        scene([projector((0.0, 1e6, 1e6), (0.0, -0.1, -1.0), 60.0)], [ground(-1e7)], extinction=(1e-7,) * 3),
        {0: _noise(9, 9)}),
    "optical depth 3000": with_files(scene([projector()], [ground()], extinction=(60.0,) * 3), {0: _noise(9, 9)}),
    "no extinction": with_files(scene([projector()], [ground()], extinction=(0.0,) * 3), {0: _noise(9, 9)}),
    "sun along the view": with_files(scene([sun((0.0, 0.0, 1.0)), sun((0.0, 0.0, -1.0))], [ground()])),
    "sun from the horizon": with_files(scene([sun((1.0, 0.0, 0.0))], [ground(), sphere((0.0, 0.0, 0.0), 3.0)])),
    "window edge-on to the rays": with_files(
        scene([sun((0.0, -1.0, 0.0), window=window((0.0, 14.0, 0.0)))], [ground()], height=45), {0: _noise(6, 6)}),
    "eye inside the prism": with_files(
        scene([sun((0.0, -1.0, 0.3), window=window((0.0, 30.0, -50.0)))], [ground()]), {0: _noise(6, 6)}),
    "window through a sphere": with_files(
        scene([sun((0.1, -1.0, 0.3), window=window())], [sphere((0.0, 20.0, 0.0), 3.0), ground()]), {0: _noise(6, 6)}),
    "sun at optical depth 3000": with_files(scene([sun()], [ground()], extinction=(60.0, 0.0, 1e-9))),
}  # fmt: skip


@pytest.mark.parametrize("name", list(HOSTILE))
def test_odd_questions_have_answers_with_an_error(name):
    s = HOSTILE[name]
    result, fine = truth.solve(s), _refined(s)
    assert not np.isnan(result.image).any()
    assert np.isfinite(result.error).all()
    assert (result.image >= 0.0).all()
    finite = np.isfinite(result.image)
    np.testing.assert_array_equal(finite, np.isfinite(fine["image"]))
    assert (abs(result.image[finite] - fine["image"][finite]) <= result.error[finite]).all()
    normal = finite & (fine["beam"] > 1e-290)
    np.testing.assert_allclose(result.buffers["beam"][normal], fine["beam"][normal], rtol=1e-9)


def test_a_lit_ray_through_the_light_is_infinite_and_a_black_one_is_not():
    picture = np.zeros((2, 2, 3))
    picture[..., 0] = 1.0
    light = projector((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0))
    s = with_files(scene([light]), {0: picture})
    beam, error = _along(s, (0.0, 0.0, -9.0), (0.0, 0.0, 1.0))
    assert beam[0] == math.inf
    assert beam[1] == beam[2] == 0.0
    assert (error == 0.0).all()
    behind, _ = _along(s, tuple(-9.0 * unit((0.0, 1.0, 0.01))), tuple(unit((0.0, 1.0, 0.01))))
    assert (behind == 0.0).all()


def test_what_is_behind_the_projector_is_dark():
    s = with_files(scene([projector(half=80.0)]), {0: WHITE})
    assert (_along(s, (-20.0, 21.0, 0.0), (1.0, 0.0, 0.0))[0] == 0.0).all()
