"""Scenes of triangles through whole techniques: a box is a box, pieces agree, memory is asked for first."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference.scenes import CUBE, f4, with_triangles

from atmoref import truth
from atmoref.memory import OutOfMemory
from atmoref.pipeline import Bank
from atmoref.scene import Technique, load_scene
from atmoref.techniques.render import render

BOX = {"type": "box", "min_m": [-3.0, 6.0, -2.0], "max_m": [1.0, 10.0, 2.0], "albedo": [0.3, 0.2, 0.1]}
GROUND = {"type": "ground", "height_m": 0.0, "albedo": 0.2}
CUBE_OF_BOX = {
    "type": "mesh", "path": "cube.obj", "scale": 4.0, "position_m": [-3.0, 6.0, -2.0], "albedo": [0.3, 0.2, 0.1],
}  # fmt: skip
SIZE = {"width": 150, "height": 225}


def pair(folder: Path, **tables: Any) -> tuple[Any, Any]:
    """Return one scene with an analytic box, and with a box of triangles."""
    (folder / "cube.obj").write_text(CUBE)
    one = f4(objects=[BOX, GROUND], image=SIZE, **tables)
    return one, f4(objects=[CUBE_OF_BOX, GROUND], image=SIZE, path=folder / "scene.toml", **tables)


SUN = {"type": "sun", "direction": [0.3, -0.8, 0.2], "irradiance_w_per_m2": 40.0}
WINDOW = {"center_m": [0.0, 15.0, 0.0], "across_m": [14.0, 0.0, 0.0], "up_m": [0.0, 0.0, 14.0]}
LIGHTS: dict[str, Any] = {"spot": {}, "sun": {"lights": [SUN]}, "window": {"lights": [{**SUN, "window": WINDOW}]}}


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("visibility", ["shadow_map", "exact"])
def test_a_box_of_triangles_looks_like_a_box(tmp_path: Path, visibility: str, light: str) -> None:
    a, b = (render(s) for s in pair(tmp_path, technique={"visibility": visibility}, **LIGHTS[light]))
    codes = [r.buffers["frame"].codes().astype(int) for r in (a, b)]
    off = np.abs(codes[0] - codes[1]).max(-1)
    assert codes[0].max() > 100
    assert (off > 0).mean() < 0.01
    assert (off <= 1).mean() >= 0.999
    depths = [r.buffers["depth"].values()[..., 0] for r in (a, b)]
    assert (np.abs(depths[0] - depths[1]) < 1e-6).mean() > 0.999
    np.testing.assert_array_less(0.02, (depths[0] < depths[0][0, 0]).mean())


@pytest.mark.parametrize("technique", ["beams", "beams_vertex", "beams_interleaved"])
def test_pieces_and_threads_agree(tmp_path: Path, technique: str) -> None:
    scene = with_triangles(tmp_path)
    whole = render(scene, technique=technique, threads=1)
    seen: list[str] = []
    for other in (
        render(scene, technique=technique, threads=3),
        render(scene, technique=technique, threads=1, watch=lambda draw, p, bank: seen.append(draw)),
    ):
        for name, buffer in whole.buffers.items():
            np.testing.assert_array_equal(buffer.codes(), other.buffers[name].codes(), err_msg=name)
    assert len(seen) == len(set(seen))
    assert "light_0/shadow_map/triangles" in seen
    assert sum(name.endswith("opaque/triangles") for name in seen) == (4 if technique == "beams_interleaved" else 1)


def test_a_crop_agrees_with_the_whole(tmp_path: Path) -> None:
    scene = with_triangles(tmp_path)
    whole = render(scene)
    part = render(scene, crop=(7, 11, 20, 25))
    np.testing.assert_array_equal(part.image, whole.image[11:36, 7:27])


def test_interleaved_pixels_see_what_pixels_of_the_whole_see(tmp_path: Path) -> None:
    """Depth of the small images, put together, is that of the whole but for the rounding of pixel centres."""
    scene = with_triangles(tmp_path, image={"width": 60, "height": 90}, buffers={"depth": {"format": "float32"}})
    keys = {"name": "beams_interleaved", "composition": "interleave", "images": 9, "planes": 4}
    small = render(dataclasses.replace(scene, technique=Technique.model_validate(keys))).buffers
    whole = render(scene, technique="beams").buffers["depth"].values()[..., 0]
    together = np.zeros_like(whole)
    for i in range(9):
        together[2 - i // 3 :: 3, i % 3 :: 3] = small[f"image_{i}/depth"].values()[..., 0]
    assert (np.abs(together - whole) < 1e-6).mean() > 0.999


def test_a_draw_of_triangles_can_be_replaced(tmp_path: Path) -> None:
    scene = with_triangles(tmp_path)
    whole = render(scene, threads=1)
    kept: dict[str, Any] = {}

    def watch(draw: str, p: Any, bank: Bank) -> None:
        if draw == "opaque/triangles":
            kept[draw] = bank["opaque/triangles/depth"].values()

    render(scene, threads=1, watch=watch)
    found = render(scene, threads=1, inject=kept)
    np.testing.assert_array_equal(found.image, whole.image)
    kept["opaque/triangles"] = kept["opaque/triangles"].copy()
    kept["opaque/triangles"][..., 0] = 1e30
    without = render(scene, threads=1, inject=kept)
    assert (without.image != whole.image).any()


def test_memory_is_asked_for_before_it_is_taken(tmp_path: Path) -> None:
    for rows in (3, 900):
        np.save(tmp_path / "plain.npy", np.zeros((rows, rows), np.float16))
        item = {"type": "height_field", "path": "plain.npy", "cell_m": 0.1, "height_scale_m": 1.0, "albedo": 0.3}
        scene = f4(objects=[item], path=tmp_path / "scene.toml")
        if rows == 3:
            render(scene, max_memory=300_000_000)
        else:
            exact = scene.with_overrides(["technique.preset=analysis"])
            with pytest.raises(OutOfMemory, match="exact visibility of 1616402 triangles"):
                render(exact, max_memory=525_000_000)


def test_mountains_in_sunlight_tend_to_the_truth() -> None:
    """Exact visibility of a height field of 131,072 triangles; planes end where 6e-6 of the haze is left."""
    small = ("image.width=60", "image.height=40")
    exact = truth.solve(load_scene("fig10a_shafts", small)).image
    off = []
    for interval_m in (16000, 2000):
        far = ("technique.base_distance_m=240000", "camera.far_m=250000", f"technique.interval_m={interval_m}")
        scene = load_scene("fig10a_shafts", (*small, *far, "buffers.format=float64", "technique.preset=analysis"))
        off.append(np.abs(render(scene).image - exact).sum() / exact.sum())
    assert off[1] < 0.004  # pixels at the mountains' edges among them
    assert off[1] < 0.5 * off[0]
