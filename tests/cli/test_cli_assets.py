"""Hostile pictures, meshes and heights through the command: one message, exit code 2 or 3, and no file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import refused, run

from atmoref.scene.emit import to_toml

SUN = {"type": "sun", "direction": [0.2, -1.0, 0.3], "irradiance_w_per_m2": 30.0}
SLIDE = {
    "type": "projector", "position_m": [0.0, 9.0, 0.0], "direction": [0.0, -1.0, 0.1], "up": [0.0, 0.0, 1.0],
    "horizontal_half_angle_deg": 30.0, "image": "slide.npy", "radiant_intensity_w_per_sr": 100.0,
}  # fmt: skip
WINDOW = {"center_m": [0.0, 9.0, 0.0], "across_m": [4.0, 0.0, 0.0], "up_m": [0.0, 0.0, 4.0], "image": "slide.npy"}
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
    options = ("--max-memory", "100MB", "--set", "technique.shadow_map_size=64")
    done = run("render", tmp_path / "bad.toml", "-o", tmp_path / "x.exr", *options)
    refused(done, 3, "1616402 triangles", "--max-memory")
    assert {path.name for path in tmp_path.iterdir()} == before


def test_a_huge_shadow_map_of_a_sun(tmp_path: Path) -> None:
    asking(tmp_path)
    options = ("--max-memory", "80MB", "--set", "technique.shadow_map_size=8192")
    refused(run("render", tmp_path / "bad.toml", "-o", tmp_path / "x.exr", *options), 3, "shadow_map", "--max-memory")
    assert {path.name for path in tmp_path.iterdir()} == {"bad.toml"}
