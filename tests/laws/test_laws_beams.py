"""Laws of light that every light-beam technique obeys, over formats (M-6, M-7, M-9, M-10, M-11, M-21 of the sheet)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.scenes import FLOAT64, f4

from atmoref.optics.phase_functions import PHASE_FUNCTIONS
from atmoref.pipeline import Pass
from atmoref.tables.q import Fog, q_values
from atmoref.techniques.render import render

TECHNIQUES = ("beams", "beams_vertex")
FORMATS = [
    {"format": "unorm8"}, {"format": "unorm8", "rounding": "truncate"}, {"format": "unorm12"}, {"format": "float32"},
    FLOAT64,
]  # fmt: skip
SMALL = {"width": 20, "height": 30}
GREY = {"type": "henyey_greenstein", "g": 0.4}


def _black(*objects: dict[str, Any]) -> list[dict[str, Any]]:
    return [{**o, "albedo": 0.0} for o in objects]


def _sphere(x: float, y: float, z: float, radius: float) -> dict[str, Any]:
    return {"type": "sphere", "center_m": [x, y, z], "radius_m": radius}


def _image(name: str, buffers: dict[str, Any], **tables: Any) -> np.ndarray:
    chosen = {"preset": "analysis", "interval_m": 1.2, "epsilon": 0.02, **tables.pop("technique", {})}
    return render(f4(image=SMALL, technique=chosen, buffers=buffers, **tables), technique=name, threads=1).image


@pytest.mark.parametrize("buffers", FORMATS, ids=str)
@pytest.mark.parametrize("technique", TECHNIQUES)
@given(
    x=st.floats(-8.0, 8.0), y=st.floats(2.0, 17.0), z=st.floats(-8.0, 8.0), radius=st.floats(0.2, 1.5),
    visibility=st.sampled_from(["exact", "shadow_map"]),
)  # fmt: skip
@settings(max_examples=12)
def test_m10_an_occluder_never_brightens_the_beam(
    technique: str, buffers: dict[str, Any], x: float, y: float, z: float, radius: float, visibility: str
) -> None:
    chosen = {"visibility": visibility, "shadow_map_size": 128, "shadow_filter": "nearest", "q_storage": "clamped"}
    free = _image(technique, buffers, objects=[], technique=chosen)
    hidden = _image(technique, buffers, objects=_black(_sphere(x, y, z, radius)), technique=chosen)
    assert (hidden <= free).all()
    if abs(x) < 2.0 and abs(z) < 2.0 and radius > 1.0 and "unorm8" not in buffers["format"]:
        assert (hidden < free).any()


@pytest.mark.parametrize("buffers", FORMATS, ids=str)
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_m10_without_visibility_nothing_is_scattered(technique: str, buffers: dict[str, Any]) -> None:
    """A plate across the cone, 1 m below the light; the camera sees only what is below."""
    plate = _black({"type": "box", "min_m": [-5.0, 18.5, -5.0], "max_m": [5.0, 19.0, 5.0]})
    camera = {"position_m": [0.0, 9.0, -45.0], "look_at_m": [0.0, 9.0, 0.0], "vertical_fov_deg": 12.0}
    assert not _image(technique, buffers, objects=plate, camera=camera).any()
    assert _image(technique, buffers, objects=[], camera=camera).mean() > 0.01


def _fully_lit(**more: Any) -> dict[str, Any]:
    return {
        "camera": {"position_m": [0.0, 0.5, 1.0], "look_at_m": [0.0, 0.5, 2.0], "vertical_fov_deg": 20.0},
        "lights": {
            "position_m": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0], "outer_half_angle_deg": 60.0,
            "inner_half_angle_deg": 60.0, "falloff": "none", "peak": 1.0, "radiant_intensity_w_per_sr": 100.0,
        },
        "objects": [], **more,
    }  # fmt: skip


def _rays() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return 1 / cos psi, and (u, v) at depth 0, of the pixels of the fully lit scene, relative to the light."""
    tan_y = math.tan(math.radians(10.0))
    x = (2.0 * (np.arange(20) + 0.5) / 20 - 1.0) * tan_y * 20 / 30
    y = -(2.0 * (np.arange(30) + 0.5) / 30 - 1.0) * tan_y
    x, y = np.broadcast_arrays(x[None, :], y[:, None])
    length = np.sqrt(1.0 + x * x + y * y)
    along = (y * 0.5 + 1.0) / length
    v = np.sqrt((0.5 - along * y / length) ** 2 + (along * x / length) ** 2 + (1.0 - along / length) ** 2)
    return length, along, v


@pytest.mark.parametrize("rule", ["printed", "left", "mid", "trap"])
@pytest.mark.parametrize("epsilon", [10.0, 0.5, 0.05])
def test_m10_all_lit_gives_f_h_of_one_and_the_sum_of_f_l(rule: str, epsilon: float) -> None:
    """f_h = 1 for every number of sub-planes and every rule; the image is the sum of f_l."""
    chosen = {
        "preset": "analysis",
        "interval_m": 1.2,
        "epsilon": epsilon,
        "sub_plane_positions": rule,
        "dt_mode": "exact",
    }
    scene = f4(image=SMALL, technique=chosen, buffers=FLOAT64, phase=GREY, **_fully_lit())
    means: list[np.ndarray] = []

    def watch(draw: str, p: Pass, bank: Any) -> None:
        if draw.endswith("/main"):
            means.append(bank["f_h"].values())

    result = render(scene, watch=watch, threads=1)
    np.testing.assert_allclose(np.stack(means), 1.0, rtol=1e-12)
    report = result.stats["lights"][0]
    z = report["depth_m"][0] + 1.2 * np.arange(report["main_planes"])
    length, along, v = (a[..., None] for a in _rays())
    fog = Fog(0.02, PHASE_FUNCTIONS["henyey_greenstein"], 0.4)
    f_l = np.stack([1.8 * np.exp(-0.02 * length * t) * q_at(along + length * t, v, 1.2 * length, fog) for t in z])
    np.testing.assert_allclose(result.image[..., :1], f_l.sum(0), rtol=1e-11)
    # M-6: which is the integral over all slabs at once, for any interval
    whole = 1.2 * len(z) * length
    at_once = 1.8 * np.exp(-0.02 * length * z[0]) * q_at(along + length * z[0], v, whole, fog)
    np.testing.assert_allclose(result.image[..., :1], at_once, rtol=1e-10)


def q_at(u: np.ndarray, v: np.ndarray, dt: np.ndarray, fog: Fog) -> np.ndarray:
    """q with a length of its own at each point."""
    return np.array(
        [
            q_values(np.array([a]), np.array([b]), float(c), fog)[0]
            for a, b, c in zip(u.flat, v.flat, dt.flat, strict=True)
        ]
    ).reshape(u.shape)


@pytest.mark.parametrize("technique", TECHNIQUES)
@given(
    a=st.floats(0.0, 1e4), b=st.floats(0.0, 1e4), x=st.floats(-10.0, 10.0), scale=st.sampled_from([0.25, 3.0, 1000.0]),
)  # fmt: skip
@settings(max_examples=15)
def test_m9_lights_add_up_and_scale(technique: str, a: float, b: float, x: float, scale: float) -> None:
    chosen = {"sub_plane_rule": "one"}

    def lights(*powers: float) -> list[dict[str, Any]]:
        cone = {
            "type": "spot",
            "inner_half_angle_deg": 10.0,
            "outer_half_angle_deg": 25.0,
            "falloff": "smoothstep_cosine",
        }
        at = [([x, 20.0, 0.0], [0.1, -1.0, 0.2]), ([-3.0, 15.0, 4.0], [0.3, -1.0, -0.1])]
        pairs = zip(at, powers, strict=True)
        return [{**cone, "position_m": p, "direction": d, "radiant_intensity_w_per_sr": i} for (p, d), i in pairs]

    def image(*powers: float) -> np.ndarray:
        return _image(technique, FLOAT64, lights=lights(*powers), technique=chosen)

    both = image(a, b)
    np.testing.assert_allclose(image(a, 0.0) + image(0.0, b), both, rtol=1e-12, atol=1e-300)
    np.testing.assert_allclose(image(scale * a, scale * b), scale * both, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("technique", TECHNIQUES)
@given(angle=st.floats(-math.pi, math.pi), shift=st.tuples(*[st.floats(-50.0, 50.0)] * 3))
@settings(max_examples=15)
def test_m7_the_world_may_be_moved(technique: str, angle: float, shift: tuple[float, float, float]) -> None:
    c, s = math.cos(angle), math.sin(angle)

    def turned(p: tuple[float, float, float]) -> list[float]:
        return [c * p[0] + s * p[2], p[1], c * p[2] - s * p[0]]

    def moved(p: tuple[float, float, float]) -> list[float]:
        return [a + b for a, b in zip(turned(p), shift, strict=True)]

    def image(move: Any, turn: Any) -> np.ndarray:
        return _image(
            technique, FLOAT64, objects=[], phase=GREY,
            camera={"position_m": move((3.0, 14.0, -45.0)), "look_at_m": move((0.0, 13.0, 0.0))},
            lights={"position_m": move((1.0, 20.0, 2.0)), "direction": turn((0.3, -1.0, 0.2))},
        )  # fmt: skip

    here, there = image(list, list), image(moved, turned)
    np.testing.assert_allclose(there, here, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("rounding", ["nearest_even", "truncate"])
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_m21_more_bits_come_nearer_to_float(technique: str, rounding: str) -> None:
    """The error is at most n/2 levels (n for truncation), plus what f_h brings in, and falls with the bits."""
    formats = {name: {"format": "float32"} for name in ("light_map", "vertex_colour")}
    chosen: dict[str, Any] = {"preset": "corrected", "sub_plane_weights": "equal"}
    if technique == "beams":
        formats |= {"q": {"format": "float32"}}
        chosen |= {"q_storage": "unclamped"}

    def result(fmt: str) -> Any:
        buffers = {"format": fmt, "arithmetic": "float32", **formats}
        if fmt != "float32":
            buffers["rounding"] = rounding
        return render(f4(image=SMALL, technique=chosen, buffers=buffers), technique=technique, threads=1)

    exact = result("float32")
    planes = exact.stats["lights"][0]["main_planes"]
    step = 0.5 if rounding == "nearest_even" else 1.0
    from_f_h = 0.0
    if technique == "beams":  # an error of f_h counts f_l, which below the middle is at most that of the middle ray
        report = exact.stats["lights"][0]
        f_l = 1.08 * np.array(report["f_l_centre"])  # 1 / cos psi <= 1.0735
        from_f_h = step * float((np.array(report["sub_planes_per_slab"]) * f_l).sum())
    below = np.zeros(exact.image.shape, bool)
    below[15:] = exact.image[15:] < 0.9
    means = []
    for bits in (8, 10, 12, 16):
        top = (1 << bits) - 1
        image = result(f"unorm{bits}").image
        error = np.abs(image - exact.image)[below]
        assert error.max() * top <= step * (planes + 2) + from_f_h
        means.append(float(error.mean()))
    assert means == sorted(means, reverse=True)
    assert means[-1] < means[0] / 100
