"""Projector and sun in scene files: what is read, what is refused, and where the sun stands."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from atmoref.images import from_rgb, write
from atmoref.scene import Scene, SceneError, scene_from_mapping
from atmoref.scene.lights import sun_axis

PROJECTOR = {
    "type": "projector",
    "position_m": [0.0, 4.0, 0.0],
    "direction": [0.0, -1.0, 0.5],
    "horizontal_half_angle_deg": 20.0,
    "image": "slide.npy",
    "radiant_intensity_w_per_sr": 10.0,
}
WINDOW = {"center_m": [0.0, 3.0, 5.0], "across_m": [2.0, 0.0, 0.0], "up_m": [0.0, 3.0, 0.0]}
SUN = {"type": "sun", "elevation_deg": 30.0, "azimuth_deg": 180.0, "irradiance_w_per_m2": [3.0, 2.0, 1.0]}
SLIDE = np.linspace(0.0, 1.0, 24).reshape(2, 4, 3)


def scene_with(folder: Path, light: dict[str, Any]) -> Scene:
    """Return a scene lit by one light, beside a slide."""
    np.save(folder / "slide.npy", SLIDE)
    mapping = {
        "schema": 1,
        "image": {"width": 8, "height": 8},
        "camera": {"position_m": [0.0, 1.0, 9.0], "look_at_m": [0.0, 1.0, 0.0], "vertical_fov_deg": 40.0},
        "lights": [light],
        "medium": {"extinction_per_m": 0.1, "single_scattering_albedo": 0.9},
    }
    return scene_from_mapping(mapping, origin="try.toml", path=folder / "try.toml")


@pytest.mark.parametrize(
    ("azimuth", "towards"), [(0.0, (0, 0, -1)), (90.0, (1, 0, 0)), (180.0, (0, 0, 1)), (270.0, (-1, 0, 0))]
)
def test_azimuth_runs_from_north_to_east(azimuth: float, towards: tuple[float, float, float]) -> None:
    axis = np.array(sun_axis(30.0, azimuth))
    high = math.radians(30.0)
    expected = np.array(towards) * math.cos(high) + np.array([0.0, math.sin(high), 0.0])
    np.testing.assert_allclose(-axis, expected, atol=3e-16)


def test_a_picture_is_read_as_it_is_or_through_the_srgb_curve(tmp_path: Path) -> None:
    found = scene_with(tmp_path, PROJECTOR).light_map(0)
    assert found is not None
    np.testing.assert_array_equal(found, SLIDE)
    assert not found.flags.writeable
    codes = np.array([[[0, 128, 255], [10, 11, 12]]], np.uint8)
    write(tmp_path / "slide.png", from_rgb(codes))
    found = scene_with(tmp_path, PROJECTOR | {"image": "slide.png"}).light_map(0)
    assert found is not None
    curve = [c / 255 / 12.92 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in codes.ravel().tolist()]
    np.testing.assert_allclose(found.ravel(), curve, rtol=1e-14)
    plain = scene_with(tmp_path, PROJECTOR | {"image": "slide.png", "image_encoding": "linear"}).light_map(0)
    assert plain is not None
    np.testing.assert_allclose(plain.ravel(), codes.ravel() / 255.0, rtol=1e-15)


def test_the_picture_counts_in_the_digest(tmp_path: Path) -> None:
    first = scene_with(tmp_path, PROJECTOR)
    np.save(tmp_path / "other.npy", SLIDE[::-1])
    (tmp_path / "there").mkdir()
    same = scene_with(tmp_path / "there", PROJECTOR)
    assert first.digest() == same.digest()
    assert first == same
    (tmp_path / "slide.npy").write_bytes((tmp_path / "other.npy").read_bytes())
    changed = first.with_overrides([])
    assert changed.digest() != first.digest()
    assert changed != first


def test_scenes_without_files_keep_their_digest(tmp_path: Path) -> None:
    assert scene_with(tmp_path, SUN).files.digests == {}


@pytest.mark.parametrize(
    ("light", "words"),
    [
        (PROJECTOR | {"image": "none.png"}, ["lights[0].image", "none.png", "no such file"]),
        (PROJECTOR | {"image": "../slide.npy"}, ["lights[0].image", "in the folder of the scene file"]),
        (PROJECTOR | {"image": "/etc/passwd"}, ["lights[0].image", "in the folder of the scene file"]),
        (PROJECTOR | {"image": ""}, ["lights[0].image", "the name of a file"]),
        (PROJECTOR | {"image": 3}, ["lights[0].image", "found 3"]),
        (PROJECTOR | {"image_encoding": "gamma"}, ["lights[0].image_encoding", '"srgb", "linear"']),
        (PROJECTOR | {"up": [0.0, -2.0, 1.0]}, ["lights[0].up", "parallel to direction"]),
        (PROJECTOR | {"up": [0.0, 0.0, 0.0]}, ["lights[0].up", "non-zero length"]),
        (PROJECTOR | {"direction": [0, 0, 0]}, ["lights[0].direction", "non-zero length"]),
        (PROJECTOR | {"horizontal_half_angle_deg": 90.0}, ["horizontal_half_angle_deg", "<= 89"]),
        (PROJECTOR | {"horizontal_half_angle_deg": 0.0}, ["horizontal_half_angle_deg", "> 0"]),
        (PROJECTOR | {"peak": 1.5}, ["lights[0].peak", "<= 1"]),
        (PROJECTOR | {"falloff": "none"}, ["lights[0].falloff", "unknown key"]),
        (PROJECTOR | {"position_m": [0.0, 1.0, 9.0]}, ["lights[0].position_m", "camera's position"]),
        (SUN | {"direction": [0.0, -1.0, 0.0]}, ["lights[0]", "either direction, or elevation_deg and azimuth_deg"]),
        ({k: v for k, v in SUN.items() if k != "azimuth_deg"}, ["lights[0]", "either direction, or elevation_deg"]),
        ({"type": "sun", "irradiance_w_per_m2": 1.0}, ["lights[0]", "found none of them"]),
        (SUN | {"elevation_deg": 91.0}, ["elevation_deg", "<= 90"]),
        (SUN | {"irradiance_w_per_m2": -1.0}, ["irradiance_w_per_m2", ">= 0"]),
        (SUN | {"radiant_intensity_w_per_sr": 1.0}, ["radiant_intensity_w_per_sr", "unknown key"]),
        (SUN | {"window": {}}, ["lights[0].window.center_m", "missing"]),
        (SUN | {"window": WINDOW | {"across_m": [0, 0, 0]}}, ["lights[0].window.across_m", "non-zero length"]),
        (SUN | {"window": WINDOW | {"up_m": [1.0, 0, 0]}}, ["lights[0].window.up_m", "parallel to across_m"]),
        (SUN | {"window": WINDOW | {"image": "none.exr"}}, ["lights[0].window.image", "no such file"]),
        (SUN | {"window": WINDOW | {"image_encoding": "srgb"}}, ["window.image_encoding", "without an image"]),
        (SUN | {"window": WINDOW | {"across_m": [0, 1, 2], "up_m": [0, -1, 1]}, "direction": [0.0, 0.0, -1.0],
                "elevation_deg": None}, ["lights[0]"]),
    ],
)  # fmt: skip
def test_a_wrong_light_is_refused(tmp_path: Path, light: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(SceneError) as caught:
        scene_with(tmp_path, light)
    for word in ("try.toml", *words):
        assert word in str(caught.value)


def test_a_window_that_the_light_grazes_is_refused(tmp_path: Path) -> None:
    sun = {k: v for k, v in SUN.items() if not k.endswith("_deg")} | {"direction": [1.0, -2.0, 0.0], "window": WINDOW}
    with pytest.raises(SceneError, match="grazes the window"):
        scene_with(tmp_path, sun)


def _link(folder: Path) -> None:
    (folder / "slide.npy").unlink()
    (folder / "slide.npy").symlink_to("/etc/hostname")


def _out_of_range(folder: Path) -> None:
    np.save(folder / "slide.npy", SLIDE * 1.5)


def _not_a_number(folder: Path) -> None:
    np.save(folder / "slide.npy", np.where(SLIDE > 0.5, np.nan, SLIDE))


def _cut_off(folder: Path) -> None:
    (folder / "slide.npy").write_bytes((folder / "slide.npy").read_bytes()[:100])


def _pickled(folder: Path) -> None:
    np.save(folder / "slide.npy", np.array([{"a": 1}], object), allow_pickle=True)


def _folder(folder: Path) -> None:
    (folder / "slide.npy").unlink()
    (folder / "slide.npy").mkdir()


@pytest.mark.parametrize("damage", [_link, _out_of_range, _not_a_number, _cut_off, _pickled, _folder])
def test_a_damaged_picture_is_refused(tmp_path: Path, damage: Callable[[Path], None]) -> None:
    scene = scene_with(tmp_path, PROJECTOR)
    damage(tmp_path)
    with pytest.raises(SceneError, match=r"lights\[0\]\.image") as caught:
        scene.with_overrides([])
    assert "slide.npy" in str(caught.value)
