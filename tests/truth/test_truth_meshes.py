"""Triangles: the same as solids that they are, no leaks, shadows by brute force, odd triangles, a stated error."""

from __future__ import annotations

import itertools
import math
import time

import numpy as np
import pytest
from truth_pictures import (
    ball_triangles,
    blocked,
    box_triangles,
    field_triangles,
    mesh,
    pictured,
    projector,
    sun,
    unit,
    window,
    with_files,
)
from truth_scenes import asymmetric, ground, scene, sphere, spot

import atmoref.truth as truth
from atmoref.truth.beams_hierarchy import build_hierarchy
from atmoref.truth.beams_pieces import line_from_light
from atmoref.truth.beams_quadrature import quadrature_along
from atmoref.truth.beams_question import ask
from atmoref.truth.beams_shadows import find_shadows, parallel_fan, point_fan

GREY = (0.5, 0.5, 0.5)


def _beam(s, starts, directions, limits=None):
    return quadrature_along(ask(s), np.array(starts, float), np.array(directions, float), limits)["beam"]


@pytest.mark.parametrize("make", [asymmetric, pictured])
def test_a_box_of_triangles_is_a_box(make):
    solid, faces = make(), make()
    box = solid.objects[1]
    faces.objects[1] = mesh(box.albedo)
    faces.triangles = {1: box_triangles(box.min_m, box.max_m)}.get
    a, b = truth.solve(solid), truth.solve(faces)
    np.testing.assert_allclose(b.buffers["beam"], a.buffers["beam"], rtol=1e-9)
    np.testing.assert_allclose(b.buffers["surface"], a.buffers["surface"], rtol=1e-9)
    assert (abs(a.image - b.image) <= a.error + b.error).all()


@pytest.mark.parametrize("make", [asymmetric, pictured])
def test_a_flat_field_is_the_ground(make):
    solid, field = make(), make()
    for s in (solid, field):
        s.camera.position_m, s.camera.look_at_m = (3.0, 19.0, -38.0), (0.5, 0.0, 0.0)  # no horizon in sight
    field.objects[2] = mesh(solid.objects[2].albedo)
    field.triangles = {2: field_triangles(np.zeros((23, 31)), 20.0)}.get
    a, b = truth.solve(solid), truth.solve(field)
    np.testing.assert_allclose(b.buffers["beam"], a.buffers["beam"], rtol=1e-9)
    np.testing.assert_allclose(b.buffers["surface"], a.buffers["surface"], rtol=1e-9)


@pytest.mark.parametrize("light", [spot(), sun((0.3, -1.0, 0.2))], ids=["spot", "sun"])
def test_a_ball_of_triangles_tends_to_the_sphere(light):
    """Inscribed: too small by O(h²), and so are its shadow and what is in it."""

    def total(thing, triangles=None):
        s = with_files(scene([light], [thing], extinction=(0.05,) * 3, width=40, height=60), triangles={0: triangles})
        return truth.solve(s).buffers["beam"].sum()

    exact = total(sphere((0.0, 8.0, 0.0), 3.0))
    errors = [total(mesh(), ball_triangles((0.0, 8.0, 0.0), 3.0, n)) - exact for n in (8, 16, 32)]
    orders = [math.log2(abs(a / b)) for a, b in itertools.pairwise(errors)]
    assert abs(errors[-1]) < 1e-3 * exact
    assert np.allclose(orders, 2.0, atol=0.5), (errors, orders)


LEAK_DIRECTIONS = [
    (1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0),
    (1.0, 0.0, 1.0),
    (1.0, 0.0, -1.0),
    (2.0, 0.0, 1.0),
    (3.0, 0.1, 7.0),
]


@pytest.mark.parametrize("flat", [True, False])
def test_no_light_leaks_through_edges_and_corners(flat):
    """Rays under a field that run along its edges and through its corners, lights straight above them."""
    heights = np.zeros((33, 33)) if flat else np.random.default_rng(2).random((33, 33))
    lights = [
        sun((0.0, -1.0, 0.0)), sun((1.0, -1.0, 0.0)), sun((1.0, -1.0, 1.0)),
        spot((0.0, 9.0, 0.0), inner=70.0, outer=80.0), spot((1.5, 6.0, 2.0), inner=70.0, outer=80.0),
        projector((2.0, 5.0, 2.0), half=40.0),
    ]  # fmt: skip
    s = with_files(scene(lights, [mesh()]), {5: np.ones((2, 2, 3))}, {0: field_triangles(heights, 1.0)})
    starts, directions = [], []
    for d in LEAK_DIRECTIONS:
        for x, z in itertools.product((-1.0, 0.0, 0.5, 2.0), (0.0, 1.0, 0.25)):
            starts.append(np.array([x, -1.0, z]) - 2.0 * np.array(d))
            directions.append(unit(d))
    beam = _beam(s, starts, directions, np.full(len(starts), 4.0))
    assert (beam == 0.0).all()


def _brute_intervals(vertices, faces, a, d, source, low, high, n=150):
    """Return places on a ray and whether each is in shadow; ``source(p)`` is where light that comes to p starts."""
    at = np.linspace(low, high, n + 2)[1:-1]
    return at, np.array([blocked(vertices, faces, source(a + t * d), a + t * d) for t in at])


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["point", "sun", "window"])
def test_shadows_of_random_triangles_are_those_of_brute_force(kind, seed):
    random = np.random.default_rng(seed)
    vertices = random.normal(size=(90, 3)) * 5.0
    faces = random.integers(0, 90, (60, 3)).astype(np.int32)  # some degenerate
    tree = build_hierarchy([(vertices, faces, GREY)])
    a, d = random.normal(size=3) * 6.0, unit(random.normal(size=3))
    shadows = np.zeros((64, 4))
    length = 15.0
    axis = unit(random.normal(size=3))
    behind = -2.0
    if kind == "point":
        light = random.normal(size=3) * 4.0
        line = line_from_light(tuple(a), tuple(d), tuple(light))
        n = find_shadows(tree, point_fan(line), -line.foot, length - line.foot, shadows)
        shadows[:n, :2] += line.foot
        at, dark = _brute_intervals(vertices, faces, a, d, lambda p: light, 0.0, length)
    else:
        windowed = kind == "window"
        normal = tuple(axis) if windowed else (0.0, 0.0, 0.0)
        fan = parallel_fan(tuple(a), tuple(d), tuple(-axis), normal, behind if windowed else -1.0)
        n = find_shadows(tree, fan, 0.0, length, shadows)

        def source(p):
            return p - (max(float(p @ axis) - behind, 0.0) if windowed else 1e3) * axis

        at, dark = _brute_intervals(vertices, faces, a, d, source, 0.0, length)
        if windowed:  # before the window nothing is asked
            keep = (a + at[:, None] * d) @ axis > behind
            at, dark = at[keep], dark[keep]
    assert (np.diff(shadows[:n, :2].ravel()) > 0.0).all()
    found = ((shadows[:n, 0] < at[:, None]) & (at[:, None] < shadows[:n, 1])).any(axis=1)
    near = (abs(shadows[:n, :2].ravel() - at[:, None]) < 1e-9).any(axis=1)
    assert ((found == dark) | near).all()


def test_a_ray_through_the_light_is_dark_beyond_triangles():
    s = with_files(
        scene([spot((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 70.0, 80.0)], [mesh()], extinction=(0.02,) * 3),
        triangles={0: (np.array([[-1.0, -1.0, 5.0], [2.0, -1.0, 5.0], [-1.0, 2.0, 5.0]]), np.array([[0, 1, 2]]))},
    )
    q = ask(s)
    out = quadrature_along(q, np.array([[0.0, 0.0, 20.0]]), np.array([[0.0, 0.0, -1.0]]), np.array([14.0]))
    assert (out["image"] == 0.0).all()  # from behind the triangle up to 1 m before it
    other = quadrature_along(q, np.array([[0.0, 0.0, 4.0]]), np.array([[0.0, 0.0, 1.0]]))
    sees = quadrature_along(ask(scene(s.lights)), np.array([[0.0, 0.0, 4.0]]), np.array([[0.0, 0.0, 1.0]]), np.ones(1))
    np.testing.assert_allclose(other["beam"], sees["beam"], rtol=1e-12)


def test_triangles_without_area_do_nothing():
    point, needle = [[1.0, 5.0, 0.0]] * 3, [[-3.0, 6.0, 0.0], [0.0, 6.0, 0.0], [3.0, 6.0, 0.0]]
    vertices = np.array([*point, *needle])
    for light in (spot(), sun(), sun((0.0, -1.0, 0.0))):
        plain = truth.solve(scene([light], [ground()]))
        odd = truth.solve(
            with_files(scene([light], [ground(), mesh()]), triangles={1: (vertices, np.arange(6).reshape(2, 3))})
        )
        np.testing.assert_allclose(odd.image, plain.image, rtol=1e-9)
        assert np.isfinite(odd.error).all()


def test_a_mesh_without_triangles_is_nothing():
    empty = (np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    with_it = truth.solve(with_files(scene([spot()], [ground(), mesh()]), triangles={1: empty}))
    np.testing.assert_array_equal(with_it.image, truth.solve(scene([spot()], [ground()])).image)


def test_more_shadows_than_there_is_room_for_are_found():
    """A grating of 700 slats on one ray."""
    x = np.arange(700) * 0.1 - 35.0
    vertices = np.array([[a + b, 10.0, c] for a in x for b, c in ((0.0, -1.0), (0.05, -1.0), (0.05, 1.0), (0.0, 1.0))])
    faces = np.array([[4 * i + j for j in f] for i in range(700) for f in ((0, 1, 2), (0, 2, 3))])
    s = with_files(scene([sun((0.0, -1.0, 0.0))], [mesh()], extinction=(1e-9,) * 3), triangles={0: (vertices, faces)})
    beam = _beam(s, [(-35.0, 5.0, 0.0)], [(1.0, 0.0, 0.0)], np.array([70.0]))
    np.testing.assert_allclose(beam, 35.0 * 0.9e-9 * 10.0 / (4.0 * math.pi), rtol=1e-7)


def test_the_error_covers_what_rounding_moves():
    """The same scene a million metres away: shadow edges move by rounding, and the estimate says so."""

    def make(far):
        shift = np.array([far, far, far])
        vertices, faces = field_triangles(8.0 * np.random.default_rng(4).random((9, 9)), 2.0, (far, far, far))
        camera = {
            "position_m": tuple(np.array([0.0, 14.0, -45.0]) + shift),
            "look_at_m": tuple(np.array([0.0, 5.0, 0.0]) + shift),
        }
        return with_files(scene([sun((0.3, -1.0, 0.2))], [mesh()], camera=camera), triangles={0: (vertices, faces)})

    near, far = truth.solve(make(0.0)), truth.solve(make(2.0**20))
    moved = abs(near.buffers["beam"] - far.buffers["beam"])
    assert moved.max() > 0.0
    assert np.mean(moved <= near.error + far.error) > 0.99
    assert far.error.max() > 100.0 * near.error.max()


@pytest.mark.slow
def test_a_million_triangles_are_quick():
    rows = 708
    heights = np.random.default_rng(0).random((rows, rows)).cumsum(axis=0).cumsum(axis=1) * 1e-3
    vertices, faces = field_triangles(heights, 0.1)
    build_hierarchy([(vertices[:9], faces[:1] * 0, GREY)])
    before = time.process_time()
    build_hierarchy([(vertices, faces, GREY)])
    assert time.process_time() - before < 4.0  # measured 1.0


def test_windows_and_meshes_together_against_a_refined_grid():
    """A leaf behind the window shades; one before the window (towards the sun) does not."""
    leaf = np.array([[-1.0, 0.0, -1.0], [3.0, 0.0, -1.0], [-1.0, 0.0, 3.0]])
    s = scene([sun((0.0, -1.0, 0.0), window=window((0.0, 20.0, 0.0)))], [mesh()], extinction=(0.1,) * 3)
    gamma = 10.0 * 0.09 / (4.0 * math.pi) / 0.1
    whole = gamma * (math.exp(-1.5) - math.exp(-2.5))
    for height, dark in ((25.0, 0.0), (15.0, gamma * (math.exp(-1.9) - math.exp(-2.2)))):
        with_files(s, triangles={0: (leaf + np.array([0.0, height, 0.0]), np.array([[0, 1, 2]]))})
        beam = _beam(s, [(-20.0, 5.0, 0.0)], [(1.0, 0.0, 0.0)])
        np.testing.assert_allclose(beam[0], whole - dark, rtol=1e-13)
