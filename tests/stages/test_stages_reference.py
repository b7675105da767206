"""Every stage equals its scalar reference, bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.replay import differences
from reference.scenes import FLOAT64, PICTURED, bundled, pictured, scenes, with_triangles

SINGLE = ("buffers.format=float32", "buffers.arithmetic=float32")
FIGURES = ["fig4a", "fig4b", "fig4c", "quick", "two_lights"]
UNORM = st.builds(
    lambda f, d, r: (
        {"format": f, "arithmetic": "float32", "device": d} | ({"rounding": r} if d == "ideal" and r else {})
    ),
    st.sampled_from(["unorm2", "unorm8", "unorm8", "unorm10", "unorm12", "unorm16"]),
    st.sampled_from(["ideal", "ideal", "gl_llvmpipe", "geforce3", "geforce_fx"]),
    st.sampled_from([None, "nearest_even", "half_up", "truncate"]),
)


def assert_equal(scene: Any, technique: str | None = None) -> None:
    found = differences(scene, technique)
    assert found
    assert {name: wrong for name, (total, wrong, _) in found.items() if wrong} == {}, found


@pytest.mark.parametrize("preset", ["paper", "corrected", "analysis"])
@pytest.mark.parametrize("name", FIGURES)
def test_bundled_scenes_in_8_bits(name: str, preset: str) -> None:
    eight_bits = ("buffers.format=unorm8", "buffers.arithmetic=float32")
    assert_equal(bundled(name, f"technique.preset={preset}", *eight_bits, width=61, height=50))


@pytest.mark.parametrize("name", ["fig4c", "fig4b", "two_lights"])
def test_whole_pictures(name: str) -> None:
    size = {"fig4c": (300, 450), "fig4b": (300, 450), "two_lights": (480, 320)}[name]
    assert_equal(bundled(name, width=size[0], height=size[1]))


@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("preset", ["paper", "corrected", "analysis"])
def test_float32_buffers(technique: str, preset: str) -> None:
    formats = [f"buffers.{n}.format=float32" for n in ("light_map", "vertex_colour")]
    storage = ["technique.q_storage=unclamped", "buffers.q.format=float32"] if technique == "beams" else []
    scene = bundled("two_lights", *SINGLE, f"technique.preset={preset}", *formats, *storage)
    assert_equal(scene, technique)


@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("preset", ["corrected", "analysis"])
def test_float64(technique: str, preset: str) -> None:
    scene = bundled(
        "two_lights", "buffers.format=float64", "buffers.arithmetic=float64", f"technique.preset={preset}", width=33
    )
    assert_equal(scene, technique)


@pytest.mark.parametrize("overrides", [
    ["buffers.device=gl_llvmpipe"],
    ["buffers.device=geforce3"],
    ["buffers.format=unorm10", "buffers.device=gl_llvmpipe"],
    ["buffers.format=unorm2", "buffers.rounding=half_up"],
    ["technique.coordinates=vertex", "technique.dt_mode=cosine", "technique.q_storage=scaled"],
    ["technique.q=exact", "technique.dt_mode=exact", "technique.f_h=printed"],
    ["technique.surface_fog=printed", "technique.ambient=saturating", "technique.scattering_angle=backward"],
    ["technique.sub_plane_depth_test=false", "technique.sub_plane_positions=trap"],
    ["technique.light_distribution=exact", "lights.0.falloff=linear_angle", "lights.1.falloff=none"],
], ids=" ".join)  # fmt: skip
def test_options(overrides: list[str]) -> None:
    assert_equal(bundled("two_lights", *overrides, width=33, height=24))


@pytest.mark.parametrize(
    ("technique", "buffers"),
    [("beams", {}), ("beams", {"format": "float32"}), ("beams", FLOAT64), ("beams_interleaved", {})],
    ids=["unorm8", "float32", "float64", "interleaved"],
)
def test_triangles(tmp_path: Path, technique: str, buffers: dict[str, str]) -> None:
    keys = {"preset": "analysis" if buffers is FLOAT64 else "corrected", "visibility": "shadow_map"}
    found = differences(with_triangles(tmp_path, buffers=buffers, technique=keys | {"shadow_map_size": 64}), technique)
    assert found["rasterise"][0] > 0
    assert {stage: wrong for stage, (total, wrong, _) in found.items() if wrong} == {}, found


@pytest.mark.parametrize("buffers", [{}, FLOAT64], ids=["unorm8", "float64"])
def test_triangles_with_exact_visibility(tmp_path: Path, buffers: dict[str, str]) -> None:
    keys = {"preset": "analysis" if buffers is FLOAT64 else "corrected", "visibility": "exact"}
    assert_equal(with_triangles(tmp_path, buffers=buffers, technique=keys))


LIGHT_BUFFERS = {"unorm8": {}, "float32": {"format": "float32"}, "float64": FLOAT64}
FOGS: list[dict[str, Any]] = [
    {"phase": {"type": "nishita_hazy"}},
    {"phase": {"type": "henyey_greenstein", "g": 0.6}, "medium": {"extinction_per_m": [0.02, 0.03, 0.05]}},
]


def assert_light_equals(folder: Path, light: str, preset: str, buffers: str, technique: str) -> None:
    """With a mesh wherever shadows come from a map; exactly without one."""
    keys = {"preset": preset, "shadow_map_size": 64}
    if technique == "beams":
        keys |= {"interval_m": 2.0, "epsilon": 0.05}
    for fog in FOGS:
        scene = pictured(
            folder, light, triangles=preset != "analysis", buffers=LIGHT_BUFFERS[buffers], technique=keys, **fog
        )
        assert_equal(scene, technique)


@pytest.mark.parametrize("light", list(PICTURED))
def test_projector_and_suns(tmp_path: Path, light: str) -> None:
    assert_light_equals(tmp_path, light, "corrected", "unorm8", "beams")
    assert_light_equals(tmp_path, light, "paper", "unorm8", "beams_vertex")


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("buffers", sorted(LIGHT_BUFFERS))
@pytest.mark.parametrize("preset", ["paper", "corrected", "analysis"])
@pytest.mark.parametrize("light", list(PICTURED))
def test_projector_and_suns_in_every_class(
    tmp_path: Path, light: str, preset: str, buffers: str, technique: str
) -> None:
    assert_light_equals(tmp_path, light, preset, buffers, technique)


@given(scene=scenes(UNORM))
@settings(max_examples=60)
def test_random_scenes_in_unorm_formats(scene: Any) -> None:
    assert_equal(scene)


@given(scene=scenes(st.just({"format": "float32", "arithmetic": "float32"})))
@settings(max_examples=30)
def test_random_scenes_in_float32(scene: Any) -> None:
    assert_equal(scene)


@given(scene=scenes(st.just({"format": "float64", "arithmetic": "float64"})))
@settings(max_examples=30)
def test_random_scenes_in_float64(scene: Any) -> None:
    assert_equal(scene)


@pytest.mark.parametrize("fmt", ["float16", "r11g11b10f"])
def test_small_floats(fmt: str) -> None:
    assert_equal(bundled("two_lights", f"buffers.format={fmt}", width=33, height=24))


MIXED = st.builds(
    lambda f, h, d: {"format": f, "f_h": {"format": h}, "arithmetic": "float32", "device": d},
    st.sampled_from(["float16", "r11g11b10f", "unorm8"]),
    st.sampled_from(["float16", "r11g11b10f", "float32"]),
    st.sampled_from(["ideal", "gl_llvmpipe"]),
)


@pytest.mark.slow
@given(scene=scenes(MIXED))
@settings(max_examples=100)
def test_random_scenes_in_mixed_formats(scene: Any) -> None:
    assert_equal(scene)


@pytest.mark.slow
@given(
    scene=scenes(st.sampled_from([{"format": f, "arithmetic": "float64"} for f in ("unorm8", "unorm12", "float16")]))
)
@settings(max_examples=100)
def test_random_scenes_in_float64_arithmetic_on_other_formats(scene: Any) -> None:
    assert_equal(scene)


def test_the_comparison_notices_one_bit() -> None:
    from unittest import mock

    from reference import replay

    scene = bundled("quick", width=17, height=20)
    real = replay.STAGES["beam_planes"]

    def wrong(call: dict[str, Any]) -> None:
        real[1](call)
        call["frame"][0] += np.uint16(1)

    with mock.patch.dict(replay.STAGES, {"beam_planes": (real[0], wrong, real[2])}):
        assert differences(scene)["beam_planes"][1:] == (1, 1.0)
