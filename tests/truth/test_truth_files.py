"""Projectors and suns as scene files have them, with pictures from files."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from truth_pictures import beam_by_brute_force
from truth_scenes import first_hit, pixel_ray

import atmoref.truth as truth
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate
from atmoref.scene import load_scene

SCENE = """
schema = 1
[image]
width = 24
height = 16
[camera]
type = "perspective"
position_m = [3.0, 9.0, -38.0]
look_at_m = [0.5, 8.0, 0.0]
up = [0.15, 1.0, 0.0]
vertical_fov_deg = 36.0
[[lights]]
type = "projector"
position_m = [-9.0, 15.0, 4.0]
direction = [0.6, -1.0, -0.3]
up = [0.1, 0.2, 1.0]
horizontal_half_angle_deg = 30.0
image = "slide.npy"
peak = 0.9
radiant_intensity_w_per_sr = [900.0, 500.0, 200.0]
[[lights]]
type = "sun"
elevation_deg = 50.0
azimuth_deg = 200.0
irradiance_w_per_m2 = [9.0, 5.0, 4.0]
window = { center_m = [0.0, 14.0, 4.0], across_m = [9.0, 0.0, 1.0], up_m = [0.0, 6.0, 1.0], image = "slide.npy" }
[[lights]]
type = "sun"
direction = [0.3, -1.0, 0.2]
irradiance_w_per_m2 = 1.0
[medium]
extinction_per_m = 0.02
single_scattering_albedo = 0.9
phase_function = { type = "henyey_greenstein", g = 0.4 }
ambient_radiance = 0.0
[[objects]]
type = "ground"
albedo = 0.3
[technique]
name = "beams"
"""


@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_scene_file_is_answered(tmp_path, which):
    np.save(tmp_path / "slide.npy", np.random.default_rng(0).random((6, 9, 3)).astype(np.float32))
    (tmp_path / "pictures.toml").write_text(SCENE)
    s = load_scene(tmp_path / "pictures.toml")
    one = _only(s, which)
    beam = truth.solve(one).buffers["beam"]
    assert beam.max() > 0.0
    p = PHASE_FUNCTIONS["henyey_greenstein"]
    for column, row in ((5, 9), (12, 12), (17, 5)):
        a, d = pixel_ray(s, column, row)
        t = float(min(first_hit(s.objects, a, d)[0], 400.0))
        exact = beam_by_brute_force(s, which, a, d, t, lambda mu: float(evaluate(p, 0.4, mu)))
        rest = 1e-3 if t == 400.0 else 1e-9  # exp(-8): the brute force ends there
        np.testing.assert_allclose(beam[row, column], exact, rtol=rest, atol=1e-12)


def _only(s, which):
    names = ("name", "image", "camera", "objects", "medium")
    one = SimpleNamespace(**{name: getattr(s, name) for name in names}, triangles=s.triangles)
    one.lights = [s.lights[which]]
    one.light_map = lambda i: s.light_map(which)
    return one
