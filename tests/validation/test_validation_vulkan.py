"""The Vulkan build under validation/vulkan against the mirror, on whatever Vulkan device is here (lavapipe in CI)."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from atmoref.judge.check import check
from atmoref.scene import load_scene
from validation.gl.agreement import stages, whole
from validation.gl.case import DEPTH_TOP, DEVICE, FORMATS, Unsupported, load
from validation.gl.dump import write_dump

try:
    BUILD: Any = importlib.import_module("validation.vulkan.build")
    GPU: Any = BUILD.context()
    MISSING = ""
except Exception as failure:  # no wgpu, no Vulkan, no driver: each has exceptions of its own
    BUILD = GPU = None
    MISSING = f"optional: no Vulkan ({failure}); make system-deps, pip install wgpu"

pytestmark = [
    pytest.mark.skipif(GPU is None, reason=MISSING),
    pytest.mark.skipif(GPU is not None and "llvmpipe" not in BUILD.name_of(GPU), reason="the rules are lavapipe's"),
]
SMALL = ("image.width=60", "image.height=90", "technique.coordinates=pixel")
SCENES = {
    "quick": ("technique.interval_m=3.0",),
    "two_lights": ("image.height=40", "technique.interval_m=4.0"),  # coloured fog, a box, two lights
    "fig9b": ("image.height=40", "technique.interval_m=3.0", "technique.preset=corrected"),  # the sun, a window
    "slide": ("image.height=40", "technique.interval_m=2.0"),  # a projector
}
SWITCHES = (
    ("technique.surface_fog=printed", "technique.ambient=saturating"),
    ("technique.q_storage=split", "technique.dt_mode=paper"),
    ("medium.phase_function={type='cornette_shanks', g=0.6}",),
)


def differing(name: str, *overrides: str) -> list[Any]:
    """Return the stages that differ in any bit, after asserting that something was drawn."""
    (case,) = load(name, (*SMALL, *overrides))
    build = BUILD.Build(GPU, case)
    found = [*stages(case, build), whole(case, build)]
    assert (case.codes("frame") > 0).mean() > 0.3
    assert len(found) > 10
    return [one for one in found if one.equal != one.pixels]


@pytest.mark.parametrize("fmt", FORMATS)
def test_every_stage_is_the_mirrors_in_every_bit(fmt: str) -> None:
    assert differing("quick", "technique.interval_m=3.0", f"buffers.format={fmt}") == []


@pytest.mark.parametrize("name", ["two_lights", "fig9b", "slide"])
def test_every_light_is_drawn_in_every_bit(name: str) -> None:
    assert differing(name, *SCENES[name], "buffers.format=float32") == []


@pytest.mark.parametrize("overrides", SWITCHES)
def test_switches_of_the_shaders_are_those_of_the_kernels(overrides: tuple[str, ...]) -> None:
    assert differing("quick", "technique.interval_m=5.0", "buffers.format=float32", *overrides) == []


def test_the_comparison_sees_a_reassociated_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without `kept` the compiler takes another order, and float32 shows it."""
    programs = importlib.import_module("validation.vulkan.programs")
    original = programs.source

    def unkept(name: str) -> str:
        return str(original(name)).replace("return bitcast<f32>(bitcast<u32>(x) ^ (", "return x; //")

    monkeypatch.setattr(programs, "source", unkept)
    assert differing("quick", "technique.interval_m=5.0", "buffers.format=float32") != []


def judged(folder: Path, name: str, overrides: tuple[str, ...]) -> Any:
    (case,) = load(name, overrides)
    write_dump(BUILD.Build(GPU, case), folder)
    return check(folder, load_scene(name, (*overrides, f"buffers.device={DEVICE}")))


@pytest.mark.parametrize("fmt", ["unorm8", "float32"])
def test_a_correct_build_has_no_pixel_outside(tmp_path: Path, fmt: str) -> None:
    found = judged(tmp_path, "quick", (*SMALL, *SCENES["quick"], f"buffers.format={fmt}"))
    assert found.passed
    assert sum(draw.off for draw in found.draws) == 0


@pytest.mark.slow
@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("name", SCENES)
def test_correct_builds_have_no_pixel_outside(tmp_path: Path, name: str, fmt: str) -> None:
    found = judged(tmp_path, name, (*SMALL, *SCENES[name], f"buffers.format={fmt}"))
    assert found.passed, [draw.name for draw in found.draws if not draw.passed]
    assert sum(draw.off for draw in found.draws) == 0


@pytest.mark.slow
@pytest.mark.parametrize("fmt", FORMATS)
def test_full_pictures(fmt: str) -> None:
    (case,) = load("fig4c", (f"buffers.format={fmt}", "technique.coordinates=pixel"))
    found = whole(case, BUILD.Build(GPU, case))
    assert found.equal == found.pixels, found


def test_depths_that_a_shader_sees_are_turned_into_their_codes() -> None:
    """Two devices: one divides by the top code, one multiplies by the float32 nearest to its inverse."""
    rng = np.random.default_rng(3)
    codes = np.concatenate([rng.integers(0, DEPTH_TOP - 1, 20000), [0, 1, 2**23 - 1, 2**23, 2**23 + 1, DEPTH_TOP]])
    divided = (codes / DEPTH_TOP).astype(np.float32)
    multiplied = codes.astype(np.float32) * np.float32(1.0 / DEPTH_TOP)
    np.testing.assert_array_equal(BUILD.by_division(divided), codes)
    np.testing.assert_array_equal(BUILD.by_product(multiplied), codes)
    assert (BUILD.by_division(multiplied) != codes).mean() > 0.1


def test_what_has_no_shader_is_refused() -> None:
    for overrides, technique, word in (((), "beams_vertex", "draws beams"), ((), None, "coordinates = pixel")):
        (case,) = load("fig4c", overrides, technique)
        with pytest.raises(Unsupported, match=word):
            BUILD.Build(GPU, case)
