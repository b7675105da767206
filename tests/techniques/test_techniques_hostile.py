"""Odd but valid questions: every pixel is finite, and the preset `analysis`, made fine, agrees with the truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from reference.scenes import FLOAT64, f4

import atmoref.truth as truth
from atmoref.techniques.render import prepare, render

GROUND = [{"type": "ground", "height_m": 0.0, "albedo": 0.2}]
SMALL = {"width": 21, "height": 31}
# what differs from F4, the interval of the planes (m), and the greatest share of the light that may be missing or too
# much: what was measured, and a half more.  The near plane is at 1 mm, since a beam that holds the eye starts there.
CASES: dict[str, tuple[dict[str, Any], float, float]] = {
    "no extinction": ({"medium": {"extinction_per_m": 0.0}}, 0.2, 0.0001),
    "one channel without extinction": ({"medium": {"extinction_per_m": [0.0, 0.02, 0.2]}}, 0.1, 0.0005),
    "optical depth 50": ({"medium": {"extinction_per_m": 1.0}}, 0.1, 0.01),
    "no scattering": ({"medium": {"single_scattering_albedo": 0.0}}, 0.2, 1e-06),
    "forward peak": ({"phase": {"type": "henyey_greenstein", "g": 0.9}}, 0.1, 0.002),
    "backward peak": ({"phase": {"type": "henyey_greenstein", "g": -0.9}}, 0.1, 0.006),
    "the middle ray passes the light": (
        {"camera": {"position_m": [0.0, 20.0, -30.0], "look_at_m": [0.0, 20.0, 0.0]}}, 0.2, 0.0005,
    ),
    "the middle ray passes 1e-6 m beside the light": (
        {"camera": {"position_m": [0.0, 19.999999, -30.0], "look_at_m": [0.0, 19.999999, 0.0]}}, 0.2, 0.05,
    ),
    "looking into the light": (
        {"camera": {"position_m": [1.0, 1.0, -1.0], "look_at_m": [0.0, 20.0, 0.0], "up": [0.0, 0.0, 1.0]}}, 0.1, 0.005,
    ),
    "eye inside the beam": ({"camera": {"position_m": [0.0, 13.0, -2.0], "look_at_m": [3.0, 12.0, 30.0]}}, 0.2, 0.005),
    "eye beside the light, inside the beam": (
        {"camera": {"position_m": [0.0, 19.0, -0.2], "look_at_m": [1.0, 5.0, 3.0]}}, 0.2, 0.005,
    ),
    "light behind the camera": (
        {"camera": {"position_m": [0.0, 14.0, 3.0], "look_at_m": [0.0, 12.0, 30.0]}}, 0.2, 0.02,
    ),
    "light behind the camera, beam outside": (
        {"camera": {"position_m": [0.0, 14.0, 25.0], "look_at_m": [0.0, 14.0, 60.0]}}, 0.2, 0,
    ),
    "beam outside the image": ({"camera": {"look_at_m": [60.0, 14.0, -20.0]}}, 0.2, 0),
    "light in the shadow of a lit sphere": (
        {
            "lights": [
                {"type": "spot", "position_m": p, "direction": d, "inner_half_angle_deg": 10.0,
                 "outer_half_angle_deg": 25.0,
                 "falloff": "smoothstep_cosine", "peak": 1.0, "radiant_intensity_w_per_sr": 4000.0}
                for p, d in (([0.0, 20.0, 0.0], [0.0, -1.0, 0.0]), ([0.0, 5.0, 0.0], [0.3, -1.0, 0.0]))
            ],
        }, 0.1, 0.004,
    ),
    "narrow cone": ({"lights": {"inner_half_angle_deg": 0.5, "outer_half_angle_deg": 1.0}}, 0.01, 0.1),
    "wide cone": ({"lights": {"inner_half_angle_deg": 60.0, "outer_half_angle_deg": 80.0}}, 0.2, 0.001),
    "no light": ({"lights": {"radiant_intensity_w_per_sr": 0.0}}, 0.2, 0),
    "horizontal beam": ({"lights": {"direction": [0.0, 0.0, 1.0]}, "technique": {"base_distance_m": 300.0}}, 0.5, 0.02),
    "beam towards the eye": (
        {
            "lights": {"position_m": [0.0, 14.0, 20.0], "direction": [0.0, 0.0, -1.0]},
            "technique": {"base_distance_m": 70.0},
        },
        0.2, 0.01,
    ),
}  # fmt: skip


def _scene(changes: dict[str, Any], technique: dict[str, Any], buffers: dict[str, Any]) -> Any:
    merged = {
        **changes, "camera": {"near_m": 0.001, **changes.get("camera", {})},
        "technique": {**changes.get("technique", {}), **technique},
    }  # fmt: skip
    return f4(image=SMALL, buffers=buffers, **merged)


@pytest.mark.parametrize("name", list(CASES))
def test_fine_analysis_agrees_with_the_truth(name: str) -> None:
    changes, interval, allowed = CASES[name]
    fine = {"preset": "analysis", "interval_m": interval, "sub_plane_rule": "one", "dt_mode": "exact"}
    scene = _scene(changes, fine, FLOAT64)
    image, reference = render(scene).image, truth.solve(scene).image
    assert np.isfinite(image).all()
    image, reference = np.minimum(image, 4.0), np.minimum(reference, 4.0)  # white, where the truth may be infinite
    if "1e-6" in name:  # that ray is lit for 1e-6 m, between two planes
        assert reference[15, 10, 0] == 4.0
        image[15, 10] = reference[15, 10]
    assert abs(image - reference).sum() <= allowed * reference.sum() + 1e-12
    if "outside" in name or name == "no light":
        assert (image == 0.0).all() or name == "beam outside the image"


@pytest.mark.parametrize("preset", ["paper", "corrected"])
@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("name", list(CASES))
def test_8_bits_and_float32_are_finite_and_in_range(name: str, technique: str, preset: str) -> None:
    changes, _, _ = CASES[name]
    more = {"preset": preset, "interval_m": 1.0, "epsilon": 0.05}
    codes = render(_scene(changes, more, {}), technique=technique)
    assert codes.image.min() >= 0.0
    assert codes.image.max() <= 1.0
    floats = render(_scene(changes, more, {"format": "float32"}), technique=technique)
    assert np.isfinite(floats.image).all()
    assert floats.image.min() >= 0.0


def test_a_beam_outside_draws_nothing() -> None:
    changes, _, _ = CASES["light behind the camera, beam outside"]
    stats = render(_scene(changes, {}, {})).stats
    assert stats["lit_samples"] == 0
    report = prepare(_scene(changes, {}, {}), None, None, None)[4]
    assert report["lights"][0]["main_planes"] == 0
