"""The quadrature against closed forms, printed values, limits, and laws that radiance obeys."""

from __future__ import annotations

import itertools
import math

import mpmath
import numpy as np
import pytest
from scipy import integrate
from truth_scenes import asymmetric, box, everywhere, ground, question, scene, sphere, spot

import atmoref.truth as truth
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate
from atmoref.truth.beams_quadrature import quadrature_along
from atmoref.truth.beams_question import ask


def _airlight(v, first, last, sigma, *, g=0.0, phase="henyey_greenstein"):
    """Return beam term and error of a ray from u = first to u = last beside a bare point light, I_0 sigma_s = 1."""
    q = everywhere(question([spot((0.0, v, 0.0), radiant_intensity_w_per_sr=(1.0, 1.0, 1.0))], phase=phase, g=g))
    q = q._replace(
        medium=q.medium._replace(
            extinction=(sigma,) * 3, distinct=(sigma, 0.0, 0.0), scattering=(1.0,) * 3, group=(0, 0, 0), groups=1
        )
    )
    starts = np.array([[0.0, 0.0, first]])
    out = quadrature_along(q, starts, np.array([[0.0, 0.0, 1.0]]), np.array([last - first]))
    return out["beam"][0, 0], out["error"][0, 0]


@pytest.mark.parametrize(
    ("v", "g", "printed"),
    [
        (11.0, 0.0, 1.0212391432e-02),
        (11.0, 0.8, 1.2502455597e-02),
        (0.1, 0.0, 1.5850357340e00),
        (0.1, 0.8, 5.1192651173e00),
    ],
)
def test_printed_airlight(v, g, printed):
    """Eye 45 m before the light's foot, ray to 30 m behind it, sigma_t = 0.01 (values to 11 digits)."""
    assert _airlight(v, -45.0, 30.0, 0.01, g=g)[0] == pytest.approx(printed, rel=6e-11)


@pytest.mark.parametrize("v", [20.0, 1.0, 1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize(("first", "last"), [(-45.0, 30.0), (2.0, 9.0), (-9.0, -2.0), (-5.0, math.inf)])
def test_without_extinction_the_light_is_an_angle(v, first, last):
    """sigma_t = 0, isotropic: rho F (angle at the light) / v."""
    value, error = _airlight(v, first, last, 0.0, phase="isotropic")
    mpmath.mp.dps = 40
    angle = mpmath.atan2(last, v) - mpmath.atan2(first, v)
    exact = angle / (4 * mpmath.pi * mpmath.mpf(v))
    assert abs(value - exact) <= 4e-15 * exact + error
    assert error <= 1e-13 * value


@pytest.mark.parametrize("v", [1e-8, 1e-12, 0.0])
@pytest.mark.parametrize("sigma", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("g", [0.0, 0.8, -0.6])
def test_the_limit_of_a_ray_towards_the_light(v, sigma, g):
    """v -> 0 before the light: F(forward) e^(sigma u) (1/|u2| - 1/|u1|), times the dimming of the way to u = first."""
    first, last = -9.0, -2.0
    forward = evaluate(PHASE_FUNCTIONS["henyey_greenstein"], g, [1.0])[0]
    exact = forward * math.exp(-sigma * 9.0) * (1.0 / 2.0 - 1.0 / 9.0)
    assert _airlight(v, first, last, sigma, g=g)[0] == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("v", [1e-8, 1e-12, 0.0])
@pytest.mark.parametrize("sigma", [1e-6, 0.01, 0.3, 20.0])
def test_the_limit_of_a_ray_away_from_the_light(v, sigma):
    """v -> 0 behind the light: F(backward) e^(sigma u) [E2(2 sigma u)/u - E2(2 sigma w)/w]."""
    first, last = 2.0, 9.0
    backward = evaluate(PHASE_FUNCTIONS["henyey_greenstein"], 0.5, [-1.0])[0]
    mpmath.mp.dps = 30
    e2 = [mpmath.expint(2, 2 * mpmath.mpf(sigma) * u) / u for u in (first, last)]
    exact = float(backward * mpmath.exp(sigma * first) * (e2[0] - e2[1]))
    assert _airlight(v, first, last, sigma, g=0.5)[0] == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("v", [1e-2, 1e-4, 1e-6, 1e-8])
def test_past_the_light_radiance_grows_like_one_over_v(v):
    """rho F pi / v, less terms of order sigma log v."""
    sigma = 0.02
    value, error = _airlight(v, -3.0, 4.0, sigma, phase="isotropic")
    leading = math.exp(-3.0 * sigma) / (4.0 * v)
    assert value == pytest.approx(leading, rel=2.0 * v * (1.0 + abs(math.log(v))))
    assert error < 1e-9 * value


def test_through_the_light_radiance_is_infinite_where_lit_and_only_there():
    lit, error = _airlight(0.0, -3.0, 4.0, 0.02)
    assert lit == math.inf
    assert error == 0.0
    q = question([spot((0.0, 0.0, 0.0), (0.0, -1.0, 0.0))])  # the beam goes down, the ray across
    across = quadrature_along(q, np.array([[0.0, 0.0, -5.0]]), np.array([[0.0, 0.0, 1.0]]))
    assert (across["image"] == 0.0).all()
    down = quadrature_along(q, np.array([[0.0, 5.0, 0.0]]), np.array([[0.0, -1.0, 0.0]]))
    assert (down["beam"] == math.inf).all()
    assert np.clip(down["image"], 0.0, 1.0).tolist() == [[1.0, 1.0, 1.0]]
    dark = question([spot((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), radiant_intensity_w_per_sr=(1.0, 0.0, 1.0))])
    channels = quadrature_along(dark, np.array([[0.0, 5.0, 0.0]]), np.array([[0.0, -1.0, 0.0]]))["image"]
    assert channels.tolist() == [[math.inf, 0.0, math.inf]]


@pytest.mark.parametrize("tau", [1e-12, 1e-9, 1e-6])
def test_thin_media_approach_no_extinction(tau):
    sigma = tau / 50.0
    thin, _ = _airlight(3.0, -20.0, math.inf, sigma, g=0.6)
    none, _ = _airlight(3.0, -20.0, math.inf, 0.0, g=0.6)
    assert thin < none
    assert thin == pytest.approx(none, rel=4.0 * tau * (1.0 + abs(math.log(tau))))


@pytest.mark.parametrize("v", [2.0, 0.05])
def test_optical_depth_fifty(v):
    """Against mpmath in t, without any change of variable."""
    sigma, first, last = 1.0, -25.0, 25.0
    mpmath.mp.dps = 30

    def f(u):
        s = mpmath.sqrt(u * u + v * v)
        return mpmath.exp(-sigma * (s + u - first)) / (s * s * 4 * mpmath.pi)

    ends = [first, -10.0, -3.0, -1.0, -v, 0.0, v, 1.0, 3.0, 10.0, last]
    exact = mpmath.quad(f, sorted(set(ends)))
    value, error = _airlight(v, first, last, sigma, phase="isotropic")
    assert abs(value - exact) <= error + 1e-14 * exact
    assert error < 1e-9 * value


@pytest.mark.parametrize("g", [-0.95, -0.5, 0.0, 0.7, 0.95])
def test_the_power_scattered_to_one_side_is_known(g):
    """M-8 as seen from outside: parallel rays that start in the light's plane collect, over the plane,

    2 pi I_0 omega ∫ p(-cos theta) sin theta / (1 + cos theta) d(theta); isotropic I_0 omega ln(2) / 2.
    """
    sigma, omega, intensity = 0.05, 0.9, 7.0

    def per_angle(theta):
        p = evaluate(PHASE_FUNCTIONS["henyey_greenstein"], g, [-math.cos(theta)])[0]
        return p * math.sin(theta) / (1.0 + math.cos(theta))

    exact = 2.0 * math.pi * intensity * omega * integrate.quad(per_angle, 0.0, math.pi / 2.0, epsrel=1e-12)[0]
    if g == 0.0:
        assert exact == pytest.approx(intensity * omega * math.log(2.0) / 2.0, rel=1e-12)
    q = question([spot((0.0,) * 3, radiant_intensity_w_per_sr=(intensity,) * 3)], phase="henyey_greenstein", g=g,
                 extinction=(sigma,) * 3, albedo=(omega,) * 3)  # fmt: skip
    q = everywhere(q)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    total = 0.0
    ends = [0.0, *10.0 ** np.arange(-8.0, 3.1, 0.5)]  # v from 0 to 1000 m, 50 mean free paths
    for low, high in itertools.pairwise(ends):
        v = 0.5 * (low + high) + 0.5 * (high - low) * nodes
        starts = np.column_stack([v, 0.0 * v, 0.0 * v])
        beam = quadrature_along(q, starts, np.tile([0.0, 0.0, 1.0], (24, 1)))["beam"][:, 0]
        total += 0.5 * (high - low) * float(weights @ (2.0 * math.pi * v * beam))
    assert total == pytest.approx(exact, rel=3e-9)


def _rotation(seed: int) -> np.ndarray:
    m, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return m * np.sign(np.linalg.det(m))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rigid_motion_changes_nothing(seed):
    """M-7 with lights and a sphere (boxes and the ground know the axes)."""
    s = asymmetric()
    s.objects = s.objects[:1]
    q = ask(s)
    rng = np.random.default_rng(seed)
    starts = np.tile(s.camera.position_m, (200, 1)) + rng.normal(size=(200, 3))
    directions = rng.normal(size=(200, 3)) * [10.0, 6.0, 6.0] + [0.0, 8.0, 0.0] - starts
    turn, shift = _rotation(seed), rng.normal(size=3) * 20.0
    lights, spheres = q.lights.copy(), q.objects.spheres.copy()
    lights[:, :3] = lights[:, :3] @ turn.T + shift
    lights[:, 3:6] = lights[:, 3:6] @ turn.T
    spheres[:, :3] = spheres[:, :3] @ turn.T + shift
    moved = q._replace(lights=lights, objects=q.objects._replace(spheres=spheres))
    before = quadrature_along(q, starts, directions)
    after = quadrature_along(moved, starts @ turn.T + shift, directions @ turn.T)
    assert (before["beam"] > 0.0).sum() > 300
    scale = before["image"].max()
    np.testing.assert_allclose(after["image"], before["image"], rtol=1e-11, atol=1e-13 * scale)


def test_lights_add_and_scale():
    """M-9: I(a A + b B) = a I(A) + b I(B)."""
    s = asymmetric()
    both = truth.solve(s).image
    parts = 0.0
    for index, factor in ((0, 2.5), (1, 0.25)):
        one = asymmetric()
        one.lights = [one.lights[index]]
        parts = parts + factor * truth.solve(one).image
        s.lights[index].radiant_intensity_w_per_sr = tuple(
            factor * x for x in s.lights[index].radiant_intensity_w_per_sr
        )
    np.testing.assert_allclose(truth.solve(s).image, parts, rtol=1e-12)
    assert (both > 0.0).all(axis=2).sum() > 500


def test_an_occluder_never_brightens_and_darkens_something():
    """M-10, for the beam term."""
    s = asymmetric()
    lights, objects = s.lights, s.objects
    previous = truth.solve(scene(lights, [], width=48, height=32)).buffers["beam"]
    for count in range(1, len(objects) + 1):
        beam = truth.solve(scene(lights, objects[:count], width=48, height=32)).buffers["beam"]
        assert (beam <= previous * (1.0 + 1e-12)).all()
        assert beam.sum() < previous.sum()
        previous = beam


@pytest.mark.parametrize(
    "objects",
    [
        [sphere((0.5, 20.5, 0.0), 3.0)],
        [box((-1.0, 19.0, -1.0), (1.0, 21.0, 1.0))],
        [ground(19.0), ground(21.0)],
    ],
    ids=["sphere", "box", "between grounds"],
)
def test_a_light_that_is_shut_in_lights_nothing_outside(objects):
    image = truth.solve(scene([spot()], objects)).image
    assert (image == 0.0).all()


def test_a_light_on_a_sphere_lights_what_faces_away():
    on = scene([spot((0.0, 20.0, 0.0))], [sphere((0.0, 22.0, 0.0), 2.0)])
    free = scene([spot((0.0, 20.0, 0.0))], [])
    a, b = truth.solve(on), truth.solve(free)
    hit = a.image != b.image
    np.testing.assert_allclose(a.buffers["beam"][~hit], b.buffers["beam"][~hit])
    assert hit.sum() < 0.1 * hit.size


def test_outside_the_cone_all_is_black():
    behind = scene([spot((0.0, 14.0, -80.0), (0.0, 0.0, -1.0))], [])  # behind the camera, shining away
    assert (truth.solve(behind).image == 0.0).all()
    towards = scene([spot((0.0, 14.0, -80.0), (0.0, 0.0, 1.0), 40.0, 60.0)], [])  # behind the camera, over its shoulder
    assert (truth.solve(towards).image > 0.0).all()


def test_the_ambient_term_in_both_readings():
    """D-E34: constant, or saturating with distance; where nothing is hit it has saturated."""
    ambient = (0.3, 0.2, 0.1)
    s = scene([spot((0.0, -50.0, 0.0), (0.0, -1.0, 0.0))], [ground(0.0)], ambient=ambient, extinction=(0.02, 0.0, 0.05))
    constant = truth.solve(s).image
    np.testing.assert_allclose(constant, np.broadcast_to(ambient, constant.shape))
    saturating = truth.solve(s, ambient="saturating").image
    np.testing.assert_allclose(saturating[0], np.broadcast_to((0.3, 0.0, 0.1), saturating[0].shape))
    slope = 2.0 * (44.5 / 45.0) * math.tan(math.radians(18.0))  # lowest row: y = -(1 - 1/45) tan(18°)
    x = (2.0 * 0.5 / 30.0 - 1.0) * math.tan(math.radians(18.0)) * 30.0 / 45.0
    y = slope / 2.0 * (44.0 / 44.5)
    distance = 14.0 / y * math.sqrt(1.0 + x * x + y * y)
    exact = [0.3 * (1.0 - math.exp(-0.02 * distance)), 0.0, 0.1 * (1.0 - math.exp(-0.05 * distance))]
    np.testing.assert_allclose(saturating[-1, 0], exact, rtol=1e-12)
