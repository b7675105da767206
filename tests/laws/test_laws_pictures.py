"""Laws of light with pictures and meshes, through the techniques: M-9, linear in the picture; M-10, meshes darken."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference.scenes import CUBE, FLOAT64, PICTURED, f4

from atmoref.techniques.render import render

TECHNIQUES = ("beams", "beams_vertex", "beams_interleaved")
KEYS: dict[str, Any] = {"preset": "analysis", "interval_m": 1.5, "base_distance_m": 60.0}
SMALL = {"width": 24, "height": 32}


def _image(folder: Path, light: str, technique: str, slide: np.ndarray, *objects: dict[str, Any]) -> np.ndarray:
    np.save(folder / "slide.npy", slide)
    (folder / "cube.obj").write_text(CUBE)
    scene = f4(
        image=SMALL, objects=list(objects), lights=[PICTURED[light]], buffers=FLOAT64, path=folder / "scene.toml",
        technique=KEYS | ({} if technique == "beams_vertex" else {"sub_plane_rule": "one"}),
    )  # fmt: skip
    return render(scene, technique=technique, threads=1).image


@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize("light", ["projector", "window"])
def test_m9_the_image_is_linear_in_the_picture(tmp_path: Path, light: str, technique: str) -> None:
    random = np.random.default_rng(31)
    a, b = random.random((5, 7, 3)), random.random((5, 7, 3))
    ground = {"type": "ground", "height_m": 0.0, "albedo": 0.4}
    of_a, of_b = (_image(tmp_path, light, technique, slide, ground) for slide in (a, b))
    mixed = _image(tmp_path, light, technique, 0.3 * a + 0.6 * b, ground)
    assert (np.abs(of_a - of_b) > 1e-3 * mixed.max()).any()
    np.testing.assert_allclose(0.3 * of_a + 0.6 * of_b, mixed, rtol=1e-12, atol=1e-15 * mixed.max())
    assert not _image(tmp_path, light, technique, np.zeros((5, 7, 3)), ground).any()


@pytest.mark.parametrize("visibility", ["exact", "shadow_map"])
@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize("light", sorted(PICTURED))
def test_m10_a_mesh_never_brightens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, light: str, technique: str, visibility: str
) -> None:
    monkeypatch.setitem(KEYS, "visibility", visibility)
    slide = np.random.default_rng(7).random((5, 7, 3))
    free, darker = _image(tmp_path, light, technique, slide), False
    for x in (-4.0, 0.0, 3.0):
        cube = {"type": "mesh", "path": "cube.obj", "scale": 4.0, "position_m": [x, 9.0, -1.0], "albedo": 0.0}
        hidden = _image(tmp_path, light, technique, slide, cube)
        assert (hidden <= free).all()
        darker = darker or bool((hidden < free).any())
    assert darker
