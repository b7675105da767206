"""What the host decides for the light beams: interval, planes, sub-planes, weights (M-24, D-E7 ... D-E12)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from reference.scenes import f4

from atmoref.techniques.beam_plan import shares, sub_plane_count, sub_plane_fractions
from atmoref.techniques.beams_parameters import BeamsParameters
from atmoref.techniques.render import prepare, render

F_L = (
    ".0318 .0371 .0438 .0521 .0625 .0756 .0917 .1106 .1310 .1496 .1610 .1604 .1473 .1262 .1031 .0820 .0645 .0508 .0402 "
    ".0320 .0258 .0209 .0172"
)
M_K = [3, 3, 4, 5, 6, 7, 9, 11, 13, 14, 16, 16, 14, 12, 10, 8, 6, 5, 4, 3, 2, 2, 1]


def plan(**tables: Any) -> dict[str, Any]:
    """Return what the plan of the first light decided."""
    found: dict[str, Any] = prepare(f4(**tables), None, None, None)[4]["lights"][0]
    return found


def test_m24_the_parameter_set_f4() -> None:
    p = plan()
    assert p["interval_m"] == pytest.approx(1.2, abs=1e-12)
    assert (p["main_planes"], p["sub_planes"]) == (23, 174)
    assert p["sub_planes_per_slab"] == M_K
    assert [f"{f:.4f}"[1:] for f in p["f_l_centre"]] == F_L.split()
    assert p["depth_m"] == pytest.approx([31.5098, 58.4902], abs=5e-5)


@pytest.mark.parametrize(("technique", "planes", "sub_planes"), [
    ({"sub_plane_rule": "ceil"}, 23, 197),
    ({"bounds": "euclid"}, 23, 165),
    ({"sub_plane_rule": "one"}, 23, 23),
    ({"plane_count": "ceil"}, 24, 175),
    ({"epsilon": 0.005}, 23, 355), ({"epsilon": 0.02}, 23, 83), ({"epsilon": 0.05}, 23, 33),
], ids=str)  # fmt: skip
def test_m24_other_readings(technique: dict[str, Any], planes: int, sub_planes: int) -> None:
    p = plan(technique=technique)
    assert (p["main_planes"], p["sub_planes"]) == (planes, sub_planes)
    if "bounds" in technique:  # D-E9
        assert p["depth_m"] == pytest.approx([34.480, 61.637], abs=5e-4)


@pytest.mark.parametrize(("intensity", "kept"), [(9400.0, False), (9411.0, True), (9453.0, True), (9465.0, False)])
def test_m24_the_window_of_intensities_that_give_174(intensity: float, kept: bool) -> None:
    p = plan(lights={"radiant_intensity_w_per_sr": intensity}, technique={"interval_m": 1.2})
    assert (p["sub_planes"] == 174) == kept


def test_m24_other_sets_with_the_printed_counts() -> None:
    ceil = plan(lights={"radiant_intensity_w_per_sr": 8572.0}, technique={"interval_m": 1.2, "sub_plane_rule": "ceil"})
    forward = plan(
        lights={"radiant_intensity_w_per_sr": 9092.0}, technique={"interval_m": 1.2},
        phase={"type": "henyey_greenstein", "g": 0.3},
    )  # fmt: skip
    low = plan(
        camera={"position_m": [0.0, 10.0, -45.0], "look_at_m": [0.0, 10.0, 0.0]}, technique={"interval_m": 1.2},
        lights={"radiant_intensity_w_per_sr": 21218.0},
    )  # fmt: skip
    assert [(p["main_planes"], p["sub_planes"]) for p in (ceil, forward, low)] == [(23, 174)] * 3


def test_de7_the_last_interval_that_does_not_exceed_or_the_first_that_does() -> None:
    assert plan(technique={"interval_rule": "first_above"})["interval_m"] == pytest.approx(1.3)
    assert plan(technique={"delta_max_m": 1.0})["interval_m"] == pytest.approx(1.0)
    assert plan(technique={"delta_min_m": 0.05})["interval_m"] == pytest.approx(1.2)  # max q is .9922 at 1.2
    assert plan(technique={"interval_m": 0.777})["interval_m"] == 0.777


def test_de8_the_interval_depends_on_where_the_rule_looks() -> None:
    found = [plan(technique={"v_ref_m": v})["interval_m"] for v in (3.0, 3.5, 3.85, 4.2)]
    assert found == sorted(found)
    assert found[0] < 1.2 <= found[2] < found[3]  # max q(1.2): 1.653, 1.207, .992, .829
    assert plan(technique={"v_ref_m": 0.01})["interval_m"] == pytest.approx(0.1)  # no multiple fits: delta_min is kept


def test_de9_count() -> None:
    for length, count in ((1.2, 23), (26.98, 2), (27.5, 1), (100.0, 1)):
        assert plan(technique={"interval_m": length})["main_planes"] == count


def test_de11_number_of_sub_planes() -> None:
    parameters = lambda rule: BeamsParameters.model_validate({"sub_plane_rule": rule})
    assert [sub_plane_count(0.137, parameters(rule)) for rule in ("one", "floor", "ceil")] == [1, 13, 14]
    assert [sub_plane_count(0.004, parameters(rule)) for rule in ("one", "floor", "ceil")] == [1, 1, 1]
    assert sub_plane_count(0.0, parameters("floor")) == 1


def _mean(f: Any, count: int, positions: str) -> float:
    at, cumulative, whole = sub_plane_fractions(count, positions)
    return math.fsum(w * f(x) for w, x in zip(shares(cumulative, whole, "equal", None), at, strict=True))


@pytest.mark.parametrize(
    ("positions", "error"), [("printed", 0.0417), ("mid", -0.0033), ("left", -0.0933), ("trap", 0.0104)]
)
def test_de10_errors_of_x_squared_with_five_sub_planes(positions: str, error: float) -> None:
    assert _mean(lambda x: x * x, 5, positions) - 1.0 / 3.0 == pytest.approx(error, abs=5.1e-5)
    if positions == "printed":
        for m in (2, 3, 5, 9):
            assert _mean(lambda x: x * x, m, "printed") - 1.0 / 3.0 == pytest.approx(1.0 / (6.0 * (m - 1)), rel=1e-12)


@pytest.mark.parametrize(("positions", "errors"), [
    ("printed", (2.2e-2, 1.0e-2, 4.9e-3)), ("left", (4.7e-2, 2.3e-2, 1.1e-2)), ("mid", (-1.2e-3, -2.9e-4, -7.3e-5)),
])  # fmt: skip
def test_m11_convergence(positions: str, errors: tuple[float, ...]) -> None:
    """Relative errors of the mean of e^(-3x)(1 + x^2) with 10, 20, 40 sub-planes; first order, mid second order."""
    f = lambda x: math.exp(-3.0 * x) * (1.0 + x * x)
    exact = (11.0 - 26.0 * math.exp(-3.0)) / 27.0 + 0.0
    exact = (1.0 - math.exp(-3.0)) / 3.0 + (2.0 - 17.0 * math.exp(-3.0)) / 27.0
    found = [_mean(f, n, positions) - exact for n in (10, 20, 40)]
    assert found == pytest.approx(list(errors), rel=0.06)
    rate = math.log2(found[1] / found[2])
    assert rate == pytest.approx(2.0 if positions == "mid" else 1.0, abs=0.2)


@pytest.mark.parametrize("positions", ["printed", "left", "mid", "trap"])
@pytest.mark.parametrize("count", [1, 2, 3, 7, 100])
def test_m11_weights_are_a_mean(positions: str, count: int) -> None:
    at, cumulative, whole = sub_plane_fractions(count, positions)
    assert len(at) == count
    assert 0.0 <= min(at) <= max(at) <= 1.0
    assert math.fsum(shares(cumulative, whole, "equal", None)) == pytest.approx(1.0, rel=1e-14)
    for top in (3, 255, 4095, 65535):
        codes = [w * top for w in shares(cumulative, whole, "telescoped", top)]
        assert codes == pytest.approx(np.rint(codes), abs=1e-9)
        assert round(math.fsum(codes)) == top


# ---- fully lit: the camera within a wide cone looks the way the light travels
def fully_lit(**tables: Any) -> dict[str, Any]:
    """Return tables of a scene in which every sample of every pixel receives I_l = H = 1."""
    base: dict[str, Any] = {
        "image": {"width": 7, "height": 5},
        "camera": {"position_m": [0.0, 0.5, 1.0], "look_at_m": [0.0, 0.5, 2.0], "vertical_fov_deg": 20.0},
        "lights": {
            "position_m": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0], "outer_half_angle_deg": 60.0,
            "inner_half_angle_deg": 60.0, "falloff": "none", "peak": 1.0,
        },
        "objects": [],
        "technique": {"interval_m": 30.0},
    }  # fmt: skip
    for name, change in tables.items():
        base[name] = {**base.get(name, {}), **change}
    return base


def _f_h(m: int, **tables: Any) -> np.ndarray:
    """Return f_h after m sub-planes of one fully lit slab, in codes or numbers."""
    f_l = plan(**fully_lit(**tables))["f_l_centre"][0]
    technique = {"epsilon": f_l / (m + 0.5), "sub_plane_weights": "equal", **tables.pop("technique", {})}
    scene = f4(**fully_lit(technique=technique, **tables))
    assert prepare(scene, None, None, None)[4]["lights"][0]["sub_planes"] == m
    codes = render(scene, threads=1).buffers["f_h"].codes()
    assert (codes == codes[0, 0, 0]).all()
    return codes[0, 0, 0]


@pytest.mark.parametrize(("m", "rounding", "value"), [
    (7, "nearest_even", 0.988), (11, "nearest_even", 0.992), (200, "nearest_even", 0.784), (8, "truncate", 0.973),
    (20, "truncate", 0.941), (100, "truncate", 0.784), (128, "truncate", 0.502), (300, "truncate", 0.0),
])  # fmt: skip
def test_de12_equal_weights_are_quantised(m: int, rounding: str, value: float) -> None:
    # a quantised weight times a light map of 255 / 255
    assert int(_f_h(m, buffers={"rounding": rounding})) / 255 == pytest.approx(value, abs=5e-4)


@pytest.mark.parametrize("m", [1, 7, 11, 100, 300])
@pytest.mark.parametrize("rounding", ["nearest_even", "truncate", "half_up"])
def test_de12_telescoped_weights_add_up(m: int, rounding: str) -> None:
    assert int(_f_h(m, buffers={"rounding": rounding}, technique={"sub_plane_weights": "telescoped"})) == 255


def test_de5_f_h_is_a_mean_or_dt_times_it() -> None:
    buffers = {"format": "float32", "light_map": {"format": "float32"}}
    assert float(_f_h(4, buffers=buffers)) == pytest.approx(1.0, abs=1e-6)
    assert float(_f_h(4, buffers=buffers, technique={"f_h": "printed"})) == pytest.approx(30.0, rel=1e-6)
