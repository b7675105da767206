"""The quadrature against SciPy on pixels, with visibility in plain Python and breakpoints found by bisection."""

from __future__ import annotations

import math

import numpy as np
import pytest
from truth_scenes import asymmetric, beam_by_brute_force, first_hit, pixel_ray, scene, sphere, spot, surface_by_hand

import atmoref.truth as truth
from atmoref.scene import load_scene


def _henyey_greenstein(g):
    return lambda mu: (1.0 - g * g) / (4.0 * math.pi * (1.0 + g * g - 2.0 * g * mu) ** 1.5)


def _check(s, pixels, phase, rtol):
    result = truth.solve(s, threads=1)
    lit = 0
    for column, row in pixels:
        a, d = pixel_ray(s, column, row)
        length, _ = first_hit(s.objects, a, d)
        channels = (0, 2)
        beams = beam_by_brute_force(s, a, d, min(length, 1000.0), channels, phase)
        for channel, beam in zip(channels, beams, strict=True):
            got = result.buffers["beam"][row, column, channel]
            assert got == pytest.approx(beam, rel=rtol, abs=1e-14), (column, row, channel)
            surface = surface_by_hand(s, a, d, channel)
            ambient = s.medium.ambient_radiance[channel]
            assert result.buffers["surface"][row, column, channel] == pytest.approx(surface, rel=1e-11)
            assert result.image[row, column, channel] == pytest.approx(beam + surface + ambient, rel=rtol, abs=1e-14)
            lit += beam > 0.0
    assert lit >= len(pixels)


def test_two_coloured_lights_a_box_and_a_rolled_camera():
    pixels = [(5, 4), (14, 12), (20, 20), (24, 27), (30, 9), (33, 22), (36, 16)]
    _check(asymmetric(), pixels, _henyey_greenstein(0.6), 1e-10)


def test_the_bundled_two_lights():
    s = load_scene("two_lights", ["image.width=24", "image.height=16"])
    kind, g = s.medium.phase_function.type, s.medium.phase_function.g
    phase = _henyey_greenstein(g if kind == "henyey_greenstein" else 0.0)
    assert kind in ("isotropic", "henyey_greenstein")
    _check(s, [(5, 4), (9, 7), (13, 8), (17, 6), (15, 11)], phase, 1e-10)


def test_the_camera_agrees_with_the_scene():
    s = load_scene("two_lights")
    a, d = pixel_ray(s, 17, 5)
    right, up, forward = (np.array(v) for v in s.camera.basis())
    from atmoref.truth.beams_question import ask

    q = ask(s)
    for mine, theirs in zip((q.camera.right, q.camera.up, q.camera.forward), (right, up, forward), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-15)
    assert float(d @ forward) > 0.0
    np.testing.assert_allclose(a, s.camera.position_m)


@pytest.mark.parametrize("falloff", ["smoothstep_cosine", "linear_angle", "none"])
def test_falloffs_and_a_sphere_in_the_beam(falloff):
    s = scene([spot(falloff=falloff, peak=0.7)], [sphere((1.0, 8.0, 0.5), 2.0)], width=12, height=18)
    _check(s, [(6, 5), (5, 9), (7, 12), (4, 11)], lambda mu: 1.0 / (4.0 * math.pi), 1e-10)
