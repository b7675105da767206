"""The adaptive quadrature against a fixed one, sixteen times finer, along random rays in random scenes.

A third of the rays pass within 0.1 m to 1e-10 m of a light; extinctions span six decades and may be 0 in one channel
only; cones fall off within a thousandth of a degree or over sixty.
"""

from __future__ import annotations

import numpy as np
import pytest
from truth_scenes import box, ground, scene, sphere, spot

from atmoref.truth.beams_quadrature import quadrature_along
from atmoref.truth.beams_question import ask
from atmoref.truth.quadrature_rules import gauss_legendre

RAYS = 240


def _random_scene(rng: np.random.Generator):
    lights = []
    for _ in range(rng.integers(1, 3)):
        inner = rng.uniform(1.0, 85.0)
        outer = min(89.0, inner + rng.choice([0.0, 1e-3, 1.0, 20.0, 60.0]))
        falloff = str(rng.choice(["smoothstep_cosine", "linear_angle", "none"]))
        lights.append(spot(tuple(rng.normal(size=3) * 6.0), tuple(rng.normal(size=3)), inner, outer, falloff=falloff))
    things = [sphere(tuple(rng.normal(size=3) * 6.0), rng.uniform(0.1, 3.0)) for _ in range(rng.integers(0, 3))]
    if rng.random() < 0.5:
        corner = rng.normal(size=3) * 6.0
        things.append(box(tuple(corner), tuple(corner + rng.uniform(0.2, 4.0, 3))))
    if rng.random() < 0.5:
        things.append(ground(float(rng.normal() * 5.0)))
    extinction = tuple(10.0 ** rng.uniform(-5.0, 1.5, 3) * (rng.random(3) < 0.9))
    g = float(rng.choice([0.0, 0.6, -0.6, 0.95, -0.95]))
    return scene(lights, things, extinction=extinction, phase="henyey_greenstein", g=g)


def _random_rays(rng: np.random.Generator, s) -> tuple[np.ndarray, np.ndarray]:
    starts = rng.normal(size=(RAYS, 3)) * 10.0
    targets = rng.normal(size=(RAYS, 3)) * 6.0
    near = RAYS // 3
    offsets = 10.0 ** rng.uniform(-10.0, -1.0, (near, 1)) * rng.normal(size=(near, 3))
    targets[:near] = np.array(s.lights[0].position_m) + offsets
    return starts, targets - starts


def _check(seeds: range) -> int:
    lit = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        s = _random_scene(rng)
        q = ask(s)
        starts, directions = _random_rays(rng, s)
        found = quadrature_along(q, starts, directions)
        fine = quadrature_along(q, starts, directions, rule=gauss_legendre(42), first_split=8, adaptive=False)["beam"]
        use = (fine > 1e-280) & np.isfinite(fine)
        off = abs(found["beam"] - fine)[use]
        assert (off <= found["error"][use] + 1e-12 * fine[use]).all(), seed
        assert (off <= 1e-9 * fine[use]).all(), seed
        np.testing.assert_array_equal(np.isinf(found["beam"]), np.isinf(fine))
        lit += int(use.sum())
    return lit


def test_random_rays():
    assert _check(range(30)) > 6000


@pytest.mark.slow
def test_many_random_rays():
    assert _check(range(1000, 1400)) > 80000
