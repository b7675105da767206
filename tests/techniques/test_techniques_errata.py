"""Each erratum of the light beams with two readings: the parameter does what it says, with the numbers of the sheet."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from reference.scenes import FLOAT64, f4

import atmoref.truth as truth
from atmoref.pipeline import Pass
from atmoref.techniques.render import render

ANALYSIS = {"preset": "analysis"}


def picture(technique: dict[str, Any] | None = None, **tables: Any) -> np.ndarray:
    """Return an image of F4 in the preset `analysis`, float64."""
    chosen = {**ANALYSIS, **(technique or {})}
    return render(f4(technique=chosen, buffers=FLOAT64, **tables), threads=1).image


def surfaces(technique: dict[str, Any], **tables: Any) -> np.ndarray:
    """Return the opaque scene alone."""
    seen: dict[str, np.ndarray] = {}

    def watch(draw: str, p: Pass, bank: Any) -> None:
        if draw.endswith("opaque"):
            seen["frame"] = bank["frame"].values()

    render(f4(technique={**ANALYSIS, **technique}, buffers=FLOAT64, **tables), threads=1, watch=watch)
    return seen["frame"]


BLACK = [
    {"type": "sphere", "center_m": [0.0, 8.0, 0.0], "radius_m": 2.0, "albedo": 0.0},
    {"type": "ground", "height_m": 0.0, "albedo": 0.0},
]


def test_de1_surfaces_through_transmittance_or_printed_g() -> None:
    floor = [{"type": "ground", "height_m": 0.0, "albedo": 0.2}]
    at_45_m = {"position_m": [0.0, 27.0, -36.0], "look_at_m": [0.0, 0.0, 0.0], "vertical_fov_deg": 1.0}
    one = {"width": 1, "height": 1}
    right = surfaces({}, objects=floor, camera=at_45_m, image=one)[0, 0, 0]
    printed = surfaces({"surface_fog": "printed"}, objects=floor, camera=at_45_m, image=one)[0, 0, 0]
    unfogged = 0.2 / math.pi * 9430.0 * 0.99 * math.exp(-0.4) / 400.0
    assert right / unfogged == pytest.approx(math.exp(-0.9), rel=1e-9)
    assert right / unfogged == pytest.approx(0.4066, abs=5e-5)
    assert printed / unfogged == pytest.approx(0.0092, abs=5e-5)


def test_de2_the_source_has_the_albedo() -> None:
    fixed = {"interval_m": 1.2, "sub_plane_rule": "one"}
    right, printed = picture(fixed, objects=BLACK), picture({**fixed, "albedo_in_source": False}, objects=BLACK)
    np.testing.assert_allclose(printed * 0.9, right, rtol=1e-12)


@pytest.mark.parametrize("g", [0.0, 0.6])
def test_de3_the_scattering_angle(g: float) -> None:
    phase = {"type": "henyey_greenstein", "g": g} if g else {"type": "isotropic"}
    fixed = {"interval_m": 1.2, "sub_plane_rule": "one"}
    right = picture(fixed, phase=phase, objects=BLACK)
    wrong = picture({**fixed, "scattering_angle": "backward"}, phase=phase, objects=BLACK)
    if g == 0.0:
        np.testing.assert_array_equal(right, wrong)
    else:
        mirrored = picture({**fixed, "scattering_angle": "backward"}, phase={**phase, "g": -g}, objects=BLACK)
        np.testing.assert_allclose(right, mirrored, rtol=1e-12)
        lit = right > 0.0
        assert (np.abs(wrong[lit] / right[lit] - 1.0) > 0.1).mean() > 0.1


def test_de6_slabs_are_crossed_obliquely() -> None:
    paper, cosine = picture({"dt_mode": "paper"}, objects=BLACK), picture({"dt_mode": "cosine"}, objects=BLACK)
    tan_y, tan_x = math.tan(math.radians(18.0)), math.tan(math.radians(18.0)) * 30 / 45
    x = (2.0 * (np.arange(30) + 0.5) / 30 - 1.0) * tan_x
    y = (2.0 * (np.arange(45) + 0.5) / 45 - 1.0) * tan_y
    length = np.sqrt(1.0 + x[None, :] ** 2 + y[:, None] ** 2)[..., None]
    np.testing.assert_allclose(cosine, paper * length, rtol=1e-12)
    assert math.sqrt(1.0 + tan_x**2 + tan_y**2) == pytest.approx(1.073, abs=1e-3)


@pytest.mark.parametrize(("mode", "least", "most"), [
    ("paper", 1.0, 1.3), ("cosine", 0.0, 0.30), ("exact", 0.0, 0.30),  # 1.163, .283 and .278 % in the sheet
])  # fmt: skip
def test_de6_error_against_the_truth(mode: str, least: float, most: float) -> None:
    size = {"width": 100, "height": 150}
    image = np.clip(picture({"dt_mode": mode}, image=size), 0.0, 1.0)
    reference = np.clip(truth.solve(f4(image=size)).image, 0.0, 1.0)
    assert least <= 100.0 * abs(image - reference).sum() / reference.sum() <= most


def test_de15_coordinates_from_vertices() -> None:
    size = {"width": 100, "height": 150}
    pixel = np.clip(picture(image=size), 0.0, 1.0)

    def error(mesh: list[int]) -> float:
        vertex = np.clip(picture({"coordinates": "vertex", "mesh": mesh}, image=size), 0.0, 1.0)
        return 100.0 * float(abs(vertex - pixel).sum() / pixel.sum())

    assert 0.3 < error([10, 15]) < 0.9  # .60 % in the sheet
    assert 0.008 < error([60, 90]) < 0.032  # .016 %


def test_de33_sub_planes_behind_a_surface() -> None:
    """A low wall in the middle of slab 4, lit air on both sides: without the depth test f_h counts what it hides."""
    wall = [*BLACK, {"type": "box", "min_m": [-50.0, 0.0, -8.0], "max_m": [50.0, 6.0, -7.9], "albedo": 0.0}]
    tested, untested = picture(objects=wall), picture({"sub_plane_depth_test": False}, objects=wall)
    reference = truth.solve(f4(objects=wall)).image
    assert (untested >= tested).all()
    changed = untested > tested
    assert changed.mean() > 0.02
    errors = [float(abs(image - reference)[changed].sum() / reference[changed].sum()) for image in (tested, untested)]
    assert errors[0] < 0.3 * errors[1]


def test_de34_ambient_light() -> None:
    medium = {"ambient_radiance": [0.1, 0.2, 0.3], "extinction_per_m": [0.01, 0.02, 0.04]}
    dark = {"radiant_intensity_w_per_sr": 0.0}
    constant = picture(medium=medium, lights=dark)
    assert (constant == np.array([0.1, 0.2, 0.3])).all()
    saturating = picture({"ambient": "saturating"}, medium=medium, lights=dark)
    np.testing.assert_allclose(
        saturating, truth.solve(f4(medium=medium, lights=dark), ambient="saturating").image, rtol=1e-12
    )
    np.testing.assert_allclose(saturating[0, 0], [0.1, 0.2, 0.3], rtol=1e-15)  # the sky is infinitely far away
    assert (saturating[-1] < constant[-1] * [0.45, 0.7, 0.91]).all()  # the floor is near


def test_de10_positions_change_shadows_only() -> None:
    """With H = I_l = 1 all rules agree; a beam's edge moves with them."""
    images = {p: picture({"sub_plane_positions": p}, objects=BLACK) for p in ("printed", "left", "mid", "trap")}
    reference = truth.solve(f4(objects=BLACK)).image
    errors = {p: abs(np.clip(i, 0, 1) - np.clip(reference, 0, 1)).sum() / reference.sum() for p, i in images.items()}
    assert len({i.tobytes() for i in images.values()}) == 4
    assert errors["mid"] < errors["left"]
    assert max(errors.values()) < 0.008
