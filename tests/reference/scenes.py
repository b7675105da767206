"""Small scenes for tests: the parameter set F4, edits of it, and random ones."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from atmoref.scene import Scene, SceneError, scene_from_mapping
from atmoref.scene.load import bundled_names, load_scene

FLOAT64 = {"format": "float64", "arithmetic": "float64"}
_F4: dict[str, Any] = {
    "schema": 1,
    "image": {"width": 30, "height": 45},
    "camera": {
        "type": "perspective", "position_m": [0.0, 14.0, -45.0], "look_at_m": [0.0, 14.0, 0.0], "up": [0.0, 1.0, 0.0],
        "vertical_fov_deg": 36.0,
    },
    "lights": [{
        "type": "spot", "position_m": [0.0, 20.0, 0.0], "direction": [0.0, -1.0, 0.0], "inner_half_angle_deg": 20.0,
        "outer_half_angle_deg": 34.0, "falloff": "smoothstep_cosine", "peak": 0.99,
        "radiant_intensity_w_per_sr": 9430.0,
    }],
    "medium": {
        "extinction_per_m": 0.02, "single_scattering_albedo": 0.9, "phase_function": {"type": "isotropic"},
        "ambient_radiance": 0.0,
    },
    "objects": [
        {"type": "sphere", "center_m": [0.0, 8.0, 0.0], "radius_m": 2.0, "albedo": 0.05},
        {"type": "ground", "height_m": 0.0, "albedo": 0.2},
    ],
    "technique": {"name": "beams", "v_ref_m": 3.85, "base_distance_m": 20.0},
    "buffers": {"format": "unorm8", "arithmetic": "float32"},
}  # fmt: skip


def f4(*, path: Path | None = None, **tables: Any) -> Scene:
    """Return the parameter set F4, 30 x 45 pixels, with keys of its tables replaced.

    A dict updates the table of that name (`lights` updates the first light, `phase` the phase function), a list takes a
    list's place.
    """
    mapping = copy.deepcopy(_F4)
    for name, change in tables.items():
        if name == "phase":
            mapping["medium"]["phase_function"] = change
        elif isinstance(change, list):
            mapping[name] = change
        elif name == "lights":
            mapping["lights"][0].update(change)
        elif name == "buffers" and change is FLOAT64:
            mapping["buffers"] = dict(change)
        else:
            mapping[name].update(change)
    return scene_from_mapping(mapping, name="f4", path=path)


CUBE = "".join(f"v {x} {y} {z}\n" for z in (0, 1) for y in (0, 1) for x in (0, 1)) + (
    "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
)
"""An OBJ file: the unit cube."""


def with_triangles(folder: Path, **tables: Any) -> Scene:
    """Return F4 with a mountain and a turned cube in place of its sphere and ground; their files go to a folder."""
    rows, columns = np.mgrid[0:21, 0:17]
    np.save(folder / "mountain.npy", (rows * columns % 5) / 4.0 + np.where(rows + columns > 17, 1.5, 0.0))
    (folder / "cube.obj").write_text(CUBE)
    objects = [
        {"type": "height_field", "path": "mountain.npy", "cell_m": 1.1, "height_scale_m": 1.5, "albedo": 0.3},
        {
            "type": "mesh", "path": "cube.obj", "scale": 3.0, "rotate_y_deg": 25.0, "position_m": [-2.0, 8.0, -1.0],
            "albedo": [0.05, 0.2, 0.4],
        },
        {"type": "sphere", "center_m": [0.0, 7.0, 0.5], "radius_m": 2.0, "albedo": 0.05},
    ]  # fmt: skip
    return f4(objects=objects, path=folder / "scene.toml", **tables)


def bundled(name: str, *overrides: str, width: int = 45, height: int = 64) -> Scene:
    """Return a bundled scene as a small picture."""
    return load_scene(name, [f"image.width={width}", f"image.height={height}", *overrides])


def mirrored_names() -> list[str]:
    """Return the bundled scenes that a technique answers (the others ask for the truth)."""
    return [n for n in bundled_names() if load_scene(n).technique.name != "truth"]


def _vectors(low: float, high: float) -> st.SearchStrategy[list[float]]:
    return st.lists(st.floats(low, high), min_size=3, max_size=3)


def _one_or_three(low: float, high: float) -> st.SearchStrategy[Any]:
    return st.floats(low, high) | st.lists(st.floats(low, high), min_size=3, max_size=3)


@st.composite
def _lights(draw: st.DrawFn) -> dict[str, Any]:
    outer = draw(st.floats(2.0, 80.0))
    return {
        "type": "spot", "position_m": draw(_vectors(-20.0, 20.0)), "direction": draw(_vectors(-1.0, 1.0)),
        "inner_half_angle_deg": outer * draw(st.sampled_from([0.01, 0.5, 1.0])), "outer_half_angle_deg": outer,
        "falloff": draw(st.sampled_from(["smoothstep_cosine", "linear_angle", "none"])),
        "peak": draw(st.floats(0.1, 1.0)), "radiant_intensity_w_per_sr": draw(_one_or_three(0.0, 2e4)),
    }  # fmt: skip


@st.composite
def _objects(draw: st.DrawFn) -> dict[str, Any]:
    kind, albedo = draw(st.sampled_from(["sphere", "box", "ground"])), draw(_one_or_three(0.0, 1.0))
    if kind == "sphere":
        return {
            "type": kind, "center_m": draw(_vectors(-15.0, 15.0)), "radius_m": draw(st.floats(0.1, 5.0)),
            "albedo": albedo,
        }  # fmt: skip
    if kind == "ground":
        return {"type": kind, "height_m": draw(st.floats(-25.0, 5.0)), "albedo": albedo}
    low = draw(_vectors(-15.0, 15.0))
    high = [x + draw(st.floats(0.125, 8.0)) for x in low]
    return {"type": kind, "min_m": low, "max_m": high, "albedo": albedo}


@st.composite
def _techniques(draw: st.DrawFn) -> dict[str, Any]:
    one_of = lambda *values: draw(st.sampled_from(values))
    shared = {
        "preset": one_of("paper", "corrected", "analysis"), "base_distance_m": draw(st.floats(2.0, 40.0)),
        "bounds": one_of("depth", "euclid"), "dt_mode": one_of("paper", "cosine"),
        "coordinates": one_of("vertex", "pixel"),
        "mesh": [draw(st.integers(1, 12)), draw(st.integers(1, 12))], "visibility": one_of("shadow_map", "exact"),
        "shadow_map_size": draw(st.integers(1, 70)), "shadow_filter": one_of("nearest", "pcf"),
        "shadow_bias_m": one_of(0.0, 0.1), "light_distribution": one_of("light_map", "exact"),
        "light_map_size": draw(st.integers(1, 40)), "albedo_in_source": draw(st.booleans()),
        "scattering_angle": one_of("forward", "backward"), "surface_fog": one_of("transmittance", "printed"),
        "ambient": one_of("constant", "saturating"),
    }  # fmt: skip
    if draw(st.booleans()):
        return shared | {
            "name": "beams_vertex",
            "planes": draw(st.integers(1, 30)),
            "plane_positions": one_of("left", "mid"),
        }
    return shared | {
        "name": "beams", "interval_m": draw(st.floats(0.7, 5.0)), "epsilon": draw(st.floats(0.02, 1.0)),
        "i_max": one_of(0.5, 1.0, 3.0), "plane_count": one_of("floor", "ceil"),
        "sub_plane_rule": one_of("floor", "ceil", "one"),
        "sub_plane_positions": one_of("printed", "left", "mid", "trap"),
        "sub_plane_weights": one_of("equal", "telescoped"), "sub_plane_depth_test": draw(st.booleans()),
        "f_h": one_of("mean", "printed"), "q": one_of("table", "table", "exact"),
        "q_table_size": draw(st.integers(2, 24)),
        "q_storage": one_of("clamped", "scaled", "overflow", "unclamped"),
    }  # fmt: skip


@st.composite
def scenes(draw: st.DrawFn, buffers: st.SearchStrategy[dict[str, Any]], most_sub_planes: int = 400) -> Scene:
    """Return random valid scenes that are quickly drawn; lights may shine anywhere, objects stand anywhere."""
    mapping = {
        "schema": 1,
        "image": {"width": draw(st.integers(1, 40)), "height": draw(st.integers(1, 14))},
        "camera": {
            "type": "perspective", "position_m": draw(_vectors(-30.0, 30.0)), "look_at_m": draw(_vectors(-5.0, 5.0)),
            "up": [draw(st.floats(-0.5, 0.5)), 1.0, 0.25], "vertical_fov_deg": draw(st.floats(5.0, 120.0)),
        },
        "lights": draw(st.lists(_lights(), min_size=1, max_size=2)),
        "medium": {
            "extinction_per_m": draw(_one_or_three(0.0, 0.3)),
            "single_scattering_albedo": draw(_one_or_three(0.0, 1.0)),
            "phase_function": draw(st.sampled_from([
                {"type": "isotropic"}, {"type": "rayleigh"}, {"type": "nishita_hazy"}, {"type": "nishita_murky"},
                {"type": "henyey_greenstein", "g": 0.6}, {"type": "cornette_shanks", "g": -0.4},
            ])),
            "ambient_radiance": draw(_one_or_three(0.0, 0.5)),
        },
        "objects": draw(st.lists(_objects(), max_size=3)),
        "technique": draw(_techniques()),
        "buffers": draw(buffers),
    }  # fmt: skip
    if mapping["technique"]["name"] == "beams_vertex":
        mapping["buffers"] = {k: v for k, v in mapping["buffers"].items() if k != "f_h"}  # it has none
    try:
        scene = scene_from_mapping(mapping)
        assume(_sub_planes(scene) <= most_sub_planes)
    except SceneError:
        assume(False)
    return scene


def _sub_planes(scene: Scene) -> int:
    """Return how many sub-planes a scene asks for."""
    from atmoref.techniques.beam_plan import beam_plan
    from atmoref.techniques.light_frames import light_frame
    from atmoref.techniques.render import parameters
    from atmoref.techniques.spotlights import source

    if scene.technique.name != "beams":
        return 0
    params: Any = parameters(scene, "beams")
    return sum(
        beam_plan(scene, light_frame(scene, i), params, i, source(scene, light, params), None).counts[1]
        for i, light in enumerate(scene.lights)
    )


SLIDE = {
    "type": "projector", "position_m": [-6.0, 18.0, -4.0], "direction": [0.4, -1.0, 0.3], "up": [0.3, 0.2, 1.0],
    "horizontal_half_angle_deg": 32.0, "image": "slide.npy", "peak": 0.9, "radiant_intensity_w_per_sr": 6000.0,
}  # fmt: skip
SUN: dict[str, Any] = {"type": "sun", "direction": [0.2, -1.0, 0.3], "irradiance_w_per_m2": [60.0, 50.0, 40.0]}
OPENING = {"center_m": [0.0, 16.0, -3.0], "across_m": [12.0, 1.0, 0.5], "up_m": [2.0, 3.0, 9.0], "peak": 0.8}
PICTURED: dict[str, dict[str, Any]] = {
    "projector": SLIDE,
    "window": {**SUN, "window": {**OPENING, "image": "slide.npy"}},
    "clear window": {**SUN, "window": OPENING},
    "no window": SUN,
}
"""Projector and suns: a rolled coloured picture, a window with one, a skew clear opening, light everywhere."""


def pictured(folder: Path, light: str, *, triangles: bool = False, **tables: Any) -> Scene:
    """Return F4, 40 x 30 pixels, in another light on sphere, box, ground and perhaps a mesh; files go to a folder."""
    slide = np.random.default_rng(7).random((5, 7, 3))
    slide[1:3, 2:4, 0] = 0.0  # no red: a lit place whose first channel is black
    np.save(folder / "slide.npy", slide)
    (folder / "cube.obj").write_text(CUBE)
    objects = [
        {"type": "sphere", "center_m": [0.0, 8.0, 0.0], "radius_m": 2.0, "albedo": 0.05},
        {"type": "box", "min_m": [3.0, 0.0, -3.0], "max_m": [5.0, 4.0, 1.0], "albedo": [0.3, 0.6, 0.4]},
        {"type": "ground", "height_m": 0.0, "albedo": 0.2},
    ]  # fmt: skip
    if triangles:
        objects.append(
            {"type": "mesh", "path": "cube.obj", "scale": 3.0, "rotate_y_deg": 25.0, "position_m": [-5.0, 6.0, -1.0],
             "albedo": [0.05, 0.2, 0.4]},
        )  # fmt: skip
    tables["image"] = {"width": 40, "height": 30, **tables.get("image", {})}
    tables["technique"] = {"base_distance_m": 40.0, **tables.get("technique", {})}
    return f4(objects=objects, lights=[PICTURED[light]], path=folder / "scene.toml", **tables)
