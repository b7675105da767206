"""The OpenGL builds under validation/gl against the mirror, on whatever EGL device is here (Mesa llvmpipe in CI)."""

from __future__ import annotations

import importlib
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import atmoref.scene
from atmoref.scene import load_scene
from atmoref.scene.emit import to_toml
from validation.gl.agreement import agreement, attributes, stages, steps, whole
from validation.gl.case import FORMATS, Unsupported, load
from validation.gl.clock import planes
from validation.gl.interpolation import cover, interpolated
from validation.gl.programs import source

try:
    BUILD: Any = importlib.import_module("validation.gl.build")
    CONTEXT: Any = BUILD.context()
    MISSING = ""
except Exception as failure:  # no moderngl, no EGL, no driver: each has exceptions of its own
    BUILD = CONTEXT = None
    MISSING = f"optional: no OpenGL ({failure}); make system-deps, pip install moderngl"

needs_device = pytest.mark.skipif(CONTEXT is None, reason=MISSING)

SMALL = ("image.width=60", "image.height=90")
BUNDLED = Path(atmoref.scene.__file__).parent / "bundled"
LLVMPIPE = CONTEXT is not None and "llvmpipe" in CONTEXT.info["GL_RENDERER"]
known_device = pytest.mark.skipif(CONTEXT is not None and not LLVMPIPE, reason="the rules are those of llvmpipe")
ENOUGH = 0.999  # of the pixels, equal in every bit; measured 1.0 for coordinates per pixel


def every_stage(scene: str, *overrides: str, technique: str | None = None, **options: bool) -> tuple[list[Any], float]:
    """Return the agreement of every stage and the frame's mean, after asserting that something was drawn."""
    (case,) = load(scene, (*SMALL, *overrides), technique)
    build = BUILD.Build(CONTEXT, case, **options)
    found = [*stages(case, build), whole(case, build)]
    frame = case.codes("frame").astype(np.float64)
    assert (frame > 0.0).mean() > 0.3
    return found, float(frame.mean())


@needs_device
@known_device
@pytest.mark.parametrize("fmt", FORMATS)
def test_every_stage_is_the_mirrors_in_every_bit(fmt: str) -> None:
    found, _ = every_stage("quick", f"buffers.format={fmt}", "technique.interval_m=3.0")
    assert min(f.fraction for f in found) >= ENOUGH, [f for f in found if f.equal != f.pixels]


@needs_device
@known_device
@pytest.mark.parametrize(
    ("scene", "overrides"),
    [
        ("two_lights", ("image.height=40", "technique.interval_m=4.0")),  # coloured fog, a box, two lights
        ("quick", ("technique.surface_fog=printed", "technique.ambient=saturating", "technique.interval_m=5.0")),
        ("quick", ("technique.q_storage=split", "technique.interval_m=5.0", "technique.dt_mode=paper")),
        ("quick", ("medium.phase_function={type='henyey_greenstein', g=0.6}", "technique.name=beams_vertex",
                   "technique.preset=corrected", "technique.planes=12")),
    ],
)  # fmt: skip
def test_switches_of_the_shaders_are_those_of_the_kernels(scene: str, overrides: tuple[str, ...]) -> None:
    technique = "beams_vertex" if any("beams_vertex" in o for o in overrides) else None
    kept = tuple(o for o in overrides if "technique.name" not in o and (technique is None or "preset" not in o))
    found, _ = every_stage(scene, *kept, technique=technique)
    assert min(f.fraction for f in found) >= ENOUGH, [f for f in found if f.equal != f.pixels]


@needs_device
@known_device
@pytest.mark.parametrize("options", [{"discard": False}, {"scissor": True}], ids=str)
def test_ways_to_draw_less_leave_the_picture(options: dict[str, bool]) -> None:
    found, _ = every_stage("quick", "technique.interval_m=3.0", **options)
    assert min(f.fraction for f in found) >= ENOUGH


@needs_device
def test_the_comparison_sees_another_exp() -> None:
    """The device's own exp is ulps away: in float32 most lit pixels change, by little."""
    found, _ = every_stage("quick", "buffers.format=float32", "technique.interval_m=3.0", native_exp=True)
    assert 0.3 < found[-1].fraction < 0.9
    assert found[-1].apart < 1e-4


@needs_device
@known_device
def test_vertex_attributes_follow_the_stated_rule() -> None:
    (case,) = load("fig4c", ("technique.interval_m=6.0",))
    build = BUILD.Build(CONTEXT, case)
    found = list(attributes(case, build.lights[0]))
    assert {f.fraction for f in found if f.stage.endswith("llvmpipe")} == {1.0}
    assert max(f.apart for f in found) < 1e-4  # metres, and colours: the mirror's rule is roundings away


@needs_device
@known_device
@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
def test_the_mirror_interpolates_a_mesh_as_the_device_does(technique: str) -> None:
    """Every bit in float32; a fragment that interpolates within the triangle, as other devices may, is seen."""
    overrides = ("technique.coordinates=vertex", "technique.mesh=[7,11]", "buffers.format=float32")
    extra = ("technique.interval_m=5.0",) if technique == "beams" else ("technique.planes=9",)
    same, _ = every_stage("quick", *overrides, *extra, technique=technique)
    assert {f.fraction for f in same} == {1.0}
    other, _ = every_stage("quick", *overrides, *extra, technique=technique, mesh_in_shader=True)
    assert min(f.fraction for f in other) < 1.0


def test_a_linear_attribute_is_interpolated_exactly() -> None:
    """Closed form: x of the screen itself, on a mesh whose cells are a power of two wide."""
    mesh, size = (4, 2), (32, 16)
    x = np.tile(np.arange(5, dtype=np.float32) * np.float32(8.0), 3)
    expected = np.broadcast_to(np.arange(32) + 0.5, (16, 32))
    np.testing.assert_array_equal(interpolated(x, mesh, size), expected)


def test_centres_on_an_edge_belong_to_the_triangle_above() -> None:
    at = cover(1, 1, (4, 4))
    np.testing.assert_array_equal(at, [[0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 1, 1], [1, 1, 1, 1]])


def test_steps_count_representable_numbers() -> None:
    for kind in (np.float16, np.float32):
        tiny = np.nextafter(kind(0), kind(1))
        values = np.array([-tiny, -0.0, 0.0, tiny, 1.0, np.nextafter(kind(1), kind(2))], kind)
        found = steps(values)
        assert list(np.diff(found)[[0, 1, 2, 4]]) == [1, 0, 1, 1]
    one = agreement("one", np.array([[[3, 5, 7]]], np.uint8), np.array([[[3, 9, 7]]], np.uint8))
    assert (one.pixels, one.equal, one.worst, one.apart) == (1, 0, 4, 4.0)


def test_arrays_of_another_shape_or_type_are_refused() -> None:
    with pytest.raises(ValueError, match="beside"):
        agreement("one", np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3), np.uint16))


def test_what_has_no_shader_is_refused() -> None:
    with pytest.raises(Unsupported, match="shadow_map"):
        load("quick", (*SMALL, "technique.visibility=exact"))
    with pytest.raises(Unsupported, match="frame"):
        load("quick", (*SMALL, "buffers.format=unorm12"))
    with pytest.raises(Unsupported, match="not triangles"):
        load("fig10a_shafts", SMALL)


@needs_device
@known_device
@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("change", ["window", "no window", "from below"])
def test_the_sun_is_drawn_in_every_bit(tmp_path: Path, change: str, technique: str) -> None:
    """Through stained glass, everywhere, and from under the ground, which has no end and keeps it out."""
    mapping = load_scene("fig9b").to_mapping()
    planes = {"interval_m": 3.0} if technique == "beams" else {"planes": 9}
    mapping["technique"] = {"name": technique, "preset": "corrected", "mesh": [5, 7], **planes}
    mapping["medium"]["ambient_radiance"] = 0.02
    sun = mapping["lights"][0]
    shutil.copy(BUNDLED / "fig9b_window.png", tmp_path)
    if change != "window":
        mapping["lights"] = [{k: v for k, v in sun.items() if k != "window"} | {"irradiance_w_per_m2": 8.0}]
    if change == "from below":
        mapping["lights"][0]["direction"] = [0.2, 0.5, 0.8]
    path = tmp_path / "sun.toml"
    path.write_text(to_toml(mapping))
    for more in (("buffers.format=unorm8",), ("buffers.format=float32",), ("technique.coordinates=vertex",)):
        same, _ = every_stage(str(path), "image.height=40", *more)
        assert {f.fraction for f in same} == {1.0}, more


@needs_device
@known_device
@pytest.mark.parametrize("fmt", ["unorm8", "float32"])
def test_a_projector_is_drawn_in_every_bit(fmt: str) -> None:
    size = ("image.width=60", "image.height=40", "technique.interval_m=2.0")
    found, _ = every_stage("slide", *size, f"buffers.format={fmt}", "technique.coordinates=pixel")
    assert min(f.fraction for f in found) >= ENOUGH, [f for f in found if f.equal != f.pixels]


def test_shaders_include_what_they_name() -> None:
    text = source("main_plane.frag", {"VERTEX": 0})
    assert text.startswith("#version 430\n#define VERTEX 0\n")
    assert "struct Camera" in text
    assert "#include" not in text


@needs_device
@known_device
@pytest.mark.slow
@pytest.mark.parametrize("coordinates", ["pixel", "vertex"])
@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("scene", ["fig4a", "fig4c", "two_lights"])
def test_full_pictures(scene: str, fmt: str, coordinates: str) -> None:
    """At least 99.9 % of the pixels at all targets; measured: all of them."""
    (case,) = load(scene, (f"buffers.format={fmt}", f"technique.coordinates={coordinates}"))
    found = whole(case, BUILD.Build(CONTEXT, case))
    assert found.fraction >= ENOUGH, found


@needs_device
@known_device
@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "overrides", "least"),
    [
        ("fig4c", (), 6.0),
        ("fig4c", ("technique.skip=false",), 3.0),
        ("fig4b", (), 6.0),
    ],
    ids=["23/174", "23/174 without skips", "160 planes"],
)
def test_the_mirror_is_several_times_faster(scene: str, overrides: tuple[str, ...], least: float) -> None:
    """CPU time of the planes, one thread each, median of 11 in turns."""
    (case,) = load(scene, ("buffers.format=unorm8", "technique.coordinates=pixel", *overrides))
    times = planes(case, BUILD.Build(CONTEXT, case), 11)
    assert times.ratio >= least, times
