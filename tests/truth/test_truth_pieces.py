"""Where a ray is lit: the splitting against dense sampling with visibility in plain Python."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from truth_scenes import box, emitted, first_hit, ground, scene, sphere, spot, visible

from atmoref._jit import kernel
from atmoref.truth.beams_geometry import nearest_hit
from atmoref.truth.beams_pieces import EDGE, FULL, cut_capacity, find_pieces, line_from_light
from atmoref.truth.beams_question import ask, light_at


@kernel
def _pieces(q, start, d, cuts, ends, classes):
    """Return the number of lit pieces of light 0, the light's foot on the ray, and where the ray ends."""
    light = light_at(q.lights, 0)
    line = line_from_light(start, d, light.position)
    distance, _, _ = nearest_hit(q.objects, q.mesh, start, d)
    n = find_pieces(q.objects, light, line, -line.foot, distance - line.foot, cuts, ends, classes)
    return n, line.foot, distance


def _lit_pieces(s, start, d):
    """Return the lit pieces [a, b] of a ray in t, their classes, and where the ray ends."""
    q = ask(s)
    room = cut_capacity(*(len(table) for table in q.objects))
    ends, classes = np.zeros((room + 1, 2)), np.zeros(room + 1, np.int64)
    n, foot, distance = _pieces(q, tuple(map(float, start)), tuple(map(float, d)), np.zeros(room), ends, classes)
    return ends[:n] + foot, classes[:n], distance


coordinate = st.floats(-8.0, 8.0).map(lambda x: round(x, 3))
point = st.tuples(coordinate, coordinate, coordinate)
size = st.floats(0.2, 4.0).map(lambda x: round(x, 3))
spheres = st.builds(sphere, point, size)
boxes = st.builds(lambda p, a, b, c: box(p, (p[0] + a, p[1] + b, p[2] + c)), point, size, size, size)
grounds = st.builds(ground, coordinate)
objects = st.lists(st.one_of(spheres, boxes), max_size=4).flatmap(
    lambda things: st.lists(grounds, max_size=1).map(lambda more: things + more)
)
lights = st.builds(
    lambda position, direction, inner, more, falloff: spot(
        position, direction, inner, min(inner + more, 89.0), falloff=falloff
    ),
    point,
    point.filter(lambda v: v != (0.0, 0.0, 0.0)),
    st.floats(2.0, 80.0),
    st.floats(0.0, 40.0),
    st.sampled_from(["smoothstep_cosine", "linear_angle", "none"]),
)


def _inside(things, p) -> bool:
    for thing in things:
        if thing.type == "sphere" and math.dist(p, thing.center_m) <= thing.radius_m:
            return True
        if thing.type == "box" and all(a <= x <= b for a, x, b in zip(thing.min_m, p, thing.max_m, strict=True)):
            return True
    return False


def _on_a_ground(things, *points) -> bool:
    return any(thing.type == "ground" and thing.height_m == p[1] for thing in things for p in points)


@settings(max_examples=80)
@given(light=lights, things=objects, start=point, towards=point)
def test_lit_pieces_are_where_sampling_sees_light(light, things, start, towards):
    if start == towards or _inside(things, start) or _on_a_ground(things, start, light.position_m):
        return
    d = np.array(towards) - np.array(start)
    d /= np.linalg.norm(d)
    a = np.array(start)
    s = scene([light], things)
    pieces, classes, distance = _lit_pieces(s, start, d)
    expected, _ = first_hit(things, a, d)
    assert distance == expected or math.isclose(distance, expected, rel_tol=1e-9)
    inner = math.cos(math.radians(light.inner_half_angle_deg))
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    for t in np.linspace(0.0, min(distance, 60.0), 142)[1:-1]:
        if min((abs(t - e) for e in pieces.ravel()), default=1.0) < 1e-6:
            continue
        p = a + t * d
        w = p - np.array(light.position_m)
        cosine = float(w @ axis) / np.linalg.norm(w)
        lit = emitted(light, p) > 0.0 and visible(things, light, p)
        if not _robust(light, things, p):
            continue
        holds = [k for k, (low, high) in enumerate(pieces) if low < t < high]
        assert len(holds) == lit, (t, pieces)
        if lit and light.falloff != "none" and abs(cosine - inner) > 1e-9:
            assert classes[holds[0]] == (FULL if cosine > inner else EDGE)


def _robust(light, things, p) -> bool:
    """Tell whether lit or not survives a nudge of the place, so that rounding cannot decide it."""
    answers = set()
    for nudge in ((1e-7, 0.0, 0.0), (0.0, 1e-7, 0.0), (0.0, 0.0, 1e-7), (-1e-7, -1e-7, -1e-7)):
        moved = p + np.array(nudge)
        answers.add(emitted(light, moved) > 0.0 and visible(things, light, moved))
    return len(answers) == 1


@settings(max_examples=40)
@given(light=lights, things=objects, start=point, towards=point)
def test_pieces_are_in_order_and_apart(light, things, start, towards):
    if start == towards or _inside(things, start) or _on_a_ground(things, start, light.position_m):
        return
    d = np.array(towards) - np.array(start)
    d /= np.linalg.norm(d)
    pieces, _, distance = _lit_pieces(scene([light], things), start, d)
    flat = pieces.ravel()
    assert (np.diff(flat) >= 0.0).all()
    assert ((flat > -1e-9) & (flat <= distance * (1.0 + 1e-12) + 1e-9)).all()
    foot = float((np.array(light.position_m) - np.array(start)) @ d)
    assert not ((pieces[:, 0] < foot - 1e-9) & (pieces[:, 1] > foot + 1e-9)).any()


def test_the_shadow_of_a_sphere_ends_at_its_tangents():
    """A light above a sphere, the ray level below it: the gap is as wide as the tangent cone."""
    s = scene([spot((0.0, 10.0, 0.0), outer=60.0, inner=59.0)], [sphere((0.0, 5.0, 0.0), 3.0)])
    pieces, classes, _ = _lit_pieces(s, (-20.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    half = 10.0 * 3.0 / 4.0  # tan = 3/4 where sin = 3/5
    np.testing.assert_allclose(pieces[classes == FULL].ravel() - 20.0, [
        -10.0 * math.tan(math.radians(59.0)), -half, half, 10.0 * math.tan(math.radians(59.0))
    ], rtol=1e-13)  # fmt: skip


def test_the_shadow_of_a_box_ends_at_its_edges():
    s = scene(
        [spot((0.0, 10.0, 0.0), outer=70.0, inner=70.0, falloff="none")], [box((-1.0, 4.0, -1.0), (2.0, 5.0, 1.0))]
    )
    pieces, _, _ = _lit_pieces(s, (-40.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    wide = 10.0 * math.tan(math.radians(70.0))
    np.testing.assert_allclose(pieces.ravel() - 40.0, [-wide, -2.0, 4.0, wide], rtol=1e-13)
