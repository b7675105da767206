"""Hostile pictures, meshes and heights through the command: one message, exit code 2 or 3, and no file."""

from __future__ import annotations

import itertools
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import process, refused, run

from atmoref.scene.emit import to_toml
from atmoref.scene.triangles import grid_triangles

SUN = {"type": "sun", "direction": [0.2, -1.0, 0.3], "irradiance_w_per_m2": 30.0}
SLIDE = {
    "type": "projector", "position_m": [0.0, 9.0, 0.0], "direction": [0.0, -1.0, 0.1], "up": [0.0, 0.0, 1.0],
    "horizontal_half_angle_deg": 30.0, "image": "slide.npy", "radiant_intensity_w_per_sr": 100.0,
}  # fmt: skip
WINDOW = {"center_m": [0.0, 9.0, 0.0], "across_m": [4.0, 0.0, 0.0], "up_m": [0.0, 0.0, 4.0], "image": "slide.npy"}
PRESETS = ("paper", "analysis")
FIELD = {"type": "height_field", "path": "h.npy", "cell_m": 0.1, "height_scale_m": 1.0, "albedo": 0.3}
MESH = {"type": "mesh", "path": "m.obj", "albedo": 0.3}


def asking(folder: Path, light: dict[str, Any] = SUN, item: dict[str, Any] | None = None) -> None:
    """Write a scene of a light and perhaps an object."""
    scene = {
        "schema": 1,
        "image": {"width": 24, "height": 18},
        "camera": {"position_m": [0.0, 3.0, -9.0], "look_at_m": [0.0, 3.0, 0.0], "vertical_fov_deg": 40.0},
        "lights": [light],
        "medium": {"extinction_per_m": 0.1, "single_scattering_albedo": 0.9},
        "objects": [item] if item else [],
    }
    (folder / "bad.toml").write_text(to_toml(scene), encoding="utf-8")


def holding(value: float, *shape: int) -> np.ndarray:
    found = np.full(shape, 0.5)
    found.flat[found.size // 2] = value
    return found


def refused_without_a_file(folder: Path, code: int, *fragments: str, options: tuple[str, ...] = ()) -> None:
    before = {path.name for path in folder.iterdir()}
    for technique in ("beams", "beams_vertex", "beams_interleaved", "truth"):
        done = run("render", folder / "bad.toml", "-o", folder / "x.exr", "--technique", technique, *options)
        refused(done, code, *fragments)
        assert {path.name for path in folder.iterdir()} == before


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf], ids=str)
def test_arrays_that_are_not_finite(tmp_path: Path, value: float) -> None:
    np.save(tmp_path / "h.npy", holding(value, 5, 5))
    asking(tmp_path, item=FIELD)
    refused_without_a_file(tmp_path, 2, "bad.toml", "objects[0].path", "h.npy", "row 2, column 2")
    np.save(tmp_path / "slide.npy", holding(value, 5, 7, 3))
    for light, key in ((SLIDE, "lights[0].image"), ({**SUN, "window": WINDOW}, "lights[0].window.image")):
        asking(tmp_path, light)
        refused_without_a_file(tmp_path, 2, "bad.toml", key, "slide.npy")


def test_files_that_are_damaged_or_elsewhere(tmp_path: Path) -> None:
    for name in ("slide.npy", "h.npy", "m.obj"):
        (tmp_path / name).write_bytes(b"\x93NUMPY\x01\x00" + bytes(range(256)))
    for light, item in ((SLIDE, None), ({**SUN, "window": WINDOW}, None), (SUN, FIELD), (SUN, MESH)):
        asking(tmp_path, light, item)
        refused_without_a_file(tmp_path, 2, "bad.toml")
        key = "image" if item is None else "path"
        for path in ("../h.npy", "/etc/passwd", "none.npy"):
            if "window" in light:
                asking(tmp_path, {**SUN, "window": {**WINDOW, key: path}})
            else:
                asking(tmp_path, light | ({} if item else {key: path}), item and item | {key: path})
            refused_without_a_file(tmp_path, 2, "bad.toml", key)


def test_a_field_beyond_the_memory(tmp_path: Path) -> None:
    np.save(tmp_path / "h.npy", np.zeros((900, 900), np.float16))
    asking(tmp_path, item=FIELD)
    before = {path.name for path in tmp_path.iterdir()}
    output = ("render", tmp_path / "bad.toml", "-o", tmp_path / "x.exr", "--set", "technique.shadow_map_size=64")
    refused(run(*output, "--max-memory", "400MB"), 3, "objects[0].path", "h.npy", "530.2 MB", "--max-memory")
    analysis = ("--set", "technique.preset=analysis")
    refused(run(*output, "--max-memory", "535MB", *analysis), 3, "1616402 triangles", "--max-memory")
    truth = ("render", tmp_path / "bad.toml", "-o", tmp_path / "x.exr", "--technique", "truth")
    refused(run(*truth, "--max-memory", "535MB"), 3, "1616402 triangles", "--max-memory")
    assert {path.name for path in tmp_path.iterdir()} == before


def least_memory(*request: str | Path) -> tuple[int, float]:
    """Return the least limit in MB under which a request is answered, and the memory in MB that it then takes."""
    limit = 100
    for _ in range(8):
        done = process(*request, "--stats", "json", "--max-memory", f"{limit}MB")
        if done.code == 0:
            return limit, json.loads(done.out)["peak_memory_mb"] * 1.048576
        refused(done, 3, "--max-memory")
        needed = re.search(r"would need ([0-9.]+) MB", done.err)
        assert needed, done.err
        assert float(needed[1]) > limit, done.err
        limit = math.ceil(float(needed[1]) + 0.1)
    raise AssertionError(f"still refused with {limit} MB")


QUICK = [("nothing", "paper"), ("m.obj", "paper"), ("slide.npy", "analysis"), ("4096", "paper")]
SLOW = itertools.product(["nothing", "h.npy", "m.obj", "m.ply", "m.stl", "m.glb", "slide.npy", "4096"], PRESETS)


@pytest.mark.parametrize(
    ("kind", "preset"), QUICK + [pytest.param(*c, marks=pytest.mark.slow) for c in SLOW if c not in QUICK]
)
def test_what_is_allowed_is_enough_and_is_kept_to(tmp_path: Path, kind: str, preset: str) -> None:
    """Under the least limit that a scene is answered with, the process stays below it, and not far below."""
    light, item, settings = SUN, None, (f"technique.preset={preset}",)
    if kind == "slide.npy":
        np.save(tmp_path / kind, np.full((2000, 2000, 3), 0.5))
        light = SLIDE
    elif kind == "4096":
        settings += ("technique.shadow_map_size=4096",)
    elif kind != "nothing":
        heights = np.cumsum(np.random.default_rng(5).normal(0.0, 0.02, (300, 300)), 1)
        np.save(tmp_path / "h.npy", heights)
        item = FIELD
        if kind != "h.npy":
            trimesh = pytest.importorskip("trimesh")
            made = grid_triangles(heights, 0.1, (0.0, 0.0, 0.0))
            trimesh.Trimesh(made.vertices, made.faces, process=False).export(tmp_path / kind)
            item = MESH | {"path": kind}
    asking(tmp_path, light, item)
    changes = [word for text in settings for word in ("--set", text)]
    request = ("render", tmp_path / "bad.toml", "-o", tmp_path / "x.exr", *changes)
    assert process(*request).code == 0  # compiles what is not compiled yet
    limit, taken = least_memory(*request)
    assert 0.4 * limit <= taken <= limit


def test_a_huge_shadow_map_of_a_sun(tmp_path: Path) -> None:
    asking(tmp_path)
    options = ("--max-memory", "300MB", "--set", "technique.shadow_map_size=8192")
    refused(run("render", tmp_path / "bad.toml", "-o", tmp_path / "x.exr", *options), 3, "shadow_map", "--max-memory")
    assert {path.name for path in tmp_path.iterdir()} == {"bad.toml"}
