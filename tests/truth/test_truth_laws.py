"""Laws of light (M-9: linear in lights and pictures; M-10: an occluder never brightens) for random scenes."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from truth_pictures import mesh, only, pictured, projector, sun, window, with_files
from truth_scenes import scene, spot

import atmoref.truth as truth
from atmoref.truth.beams_quadrature import quadrature_along
from atmoref.truth.beams_question import ask

settings.register_profile("truth", deadline=None, max_examples=30, derandomize=True)
PROFILE = settings.get_profile("truth")

seeds = st.integers(0, 2**32 - 1)


def _rays(random, n=12):
    return random.normal(size=(n, 3)) * 8.0 + np.array([0.0, 8.0, 0.0]), random.normal(size=(n, 3))


def _solve(s, rays, limit=40.0):
    return quadrature_along(ask(s), *rays, np.full(len(rays[0]), limit), rtol=1e-13)


def _lights(random):
    """Return one light of each kind with random places, directions and pictures."""
    across = random.normal(size=3) * 6.0
    lights = [
        projector(tuple(random.normal(size=3) * 5.0 + np.array([0.0, 15.0, 0.0])), tuple(random.normal(size=3)), 35.0),
        sun(tuple(random.normal(size=3))),
        sun((0.1, -1.0, 0.2), window=window((0.0, 14.0, 0.0), tuple(across), tuple(random.normal(size=3) * 6.0))),
        spot(tuple(random.normal(size=3) * 5.0 + np.array([0.0, 15.0, 0.0])), (0.1, -1.0, 0.0)),
    ]
    return lights, {0: random.random((4, 5, 3)), 2: random.random((3, 2, 3))}


def _triangles(random, n=30):
    corners = random.normal(size=(n, 1, 3)) * 5.0 + np.array([0.0, 8.0, 0.0])
    return (corners + random.normal(size=(n, 3, 3)) * 2.0).reshape(-1, 3), np.arange(3 * n, dtype=np.int32).reshape(
        n, 3
    )


@PROFILE
@given(seed=seeds)
def test_lights_add(seed):
    """M-9: the beam of all lights is the sum of the beams of each."""
    random = np.random.default_rng(seed)
    lights, pictures = _lights(random)
    rays = _rays(random)
    s = with_files(scene(lights, [mesh()]), pictures, {0: _triangles(random)})
    whole = _solve(s, rays)
    parts = [_solve(only(s, i), rays) for i in range(len(lights))]
    for name in ("beam", "surface"):
        total = sum(part[name] for part in parts)
        np.testing.assert_allclose(whole[name], total, rtol=1e-12, atol=1e-12 * total.max())


@PROFILE
@given(seed=seeds, a=st.floats(0.0, 0.5), b=st.floats(0.0, 0.5), windowed=st.booleans())
def test_pictures_are_linear(seed, a, b, windowed):
    """M-9: I(a A + b B) = a I(A) + b I(B)."""
    random = np.random.default_rng(seed)
    lights, _ = _lights(random)
    first, second = random.random((2, 5, 6, 3))
    rays = _rays(random)
    triangles = {0: _triangles(random, 8)}

    def solve(picture):
        return _solve(with_files(scene([lights[2 if windowed else 0]], [mesh()]), {0: picture}, triangles), rays)

    mixed, one, two = solve(a * first + b * second), solve(first), solve(second)
    for name in ("beam", "surface"):
        total = a * one[name] + b * two[name]
        np.testing.assert_allclose(mixed[name], total, rtol=1e-12, atol=1e-12 * total.max(initial=0.0))


@PROFILE
@given(seed=seeds)
def test_an_occluder_never_brightens_the_beam(seed):
    """M-10; rays end at fixed places, or at the occluder."""
    random = np.random.default_rng(seed)
    lights, pictures = _lights(random)
    rays = _rays(random)
    vertices, faces = _triangles(random)
    for i, light in enumerate(lights):
        before = None
        for count in (0, 1, 5, 30):
            s = with_files(scene([light], [mesh()]), {0: pictures.get(i)}, {0: (vertices, faces[:count])})
            beam = _solve(s, rays)["beam"]
            assert (beam >= 0.0).all()
            if before is not None:
                assert (beam <= before * (1.0 + 1e-12) + 1e-12 * before.max()).all()
            before = beam


def test_a_black_picture_and_a_shut_box_are_dark():
    s = with_files(scene([projector(), sun(window=window())]), {0: np.zeros((3, 3, 3)), 1: np.zeros((2, 2, 3))})
    assert (truth.solve(s).image == 0.0).all()


def test_a_brighter_picture_is_never_darker():
    s = pictured()
    before = truth.solve(s).buffers["beam"]
    pictures = {i: s.light_map(i) for i in (0, 2)}
    with_files(s, {i: np.minimum(picture + 0.1, 1.0) for i, picture in pictures.items()})
    assert (truth.solve(s).buffers["beam"] >= before * (1.0 - 1e-9)).all()
