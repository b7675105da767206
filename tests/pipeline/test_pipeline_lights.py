"""Bits of projectors and suns on spheres, grounds, meshes and height fields: fused, threads, skips, every buffer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits_manifest import hashes
from reference.scenes import FLOAT64, PICTURED, SUN, f4, pictured, with_triangles

from atmoref.techniques.render import render

FORMATS: list[dict[str, Any]] = [{"format": "unorm8"}, {"format": "float32"}, FLOAT64]
SIZE = {"width": 37, "height": 29}


def keys_of(technique: str, **keys: Any) -> dict[str, Any]:
    """Return keys of a coarse picture."""
    planes = {"planes": 20} if technique == "beams_vertex" else {"interval_m": 2.0}
    return {"shadow_map_size": 64, "base_distance_m": 50.0} | planes | keys


def assert_bits(scene_of: Any, technique: str) -> None:
    """Draw by draw, in 2 and 5 threads, and without skips: every buffer as in one thread at once."""
    scene = scene_of(skip=True)
    seen: list[str] = []
    plain = hashes(render(scene, technique=technique, threads=1).buffers)
    others = {
        "dumped": render(scene, technique=technique, threads=1, watch=lambda draw, p, bank: seen.append(draw)),
        "two threads": render(scene, technique=technique, threads=2),
        "five threads": render(scene, technique=technique, threads=5),
        "no skips": render(scene_of(skip=False), technique=technique, threads=1),
    }
    for name, other in others.items():
        assert hashes(other.buffers) == plain, name
    assert len(seen) == len(set(seen)) >= 6  # a prism along the image plane may hold one plane only
    assert others["dumped"].buffers["frame"].values().any()


@pytest.mark.parametrize("buffers", FORMATS, ids=str)
@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("light", list(PICTURED))
def test_lights_on_solids_and_a_mesh(tmp_path: Path, light: str, technique: str, buffers: dict[str, Any]) -> None:
    assert_bits(
        lambda skip: pictured(
            tmp_path, light, triangles=True, image=SIZE, buffers=buffers, technique=keys_of(technique, skip=skip)
        ),
        technique,
    )


@pytest.mark.parametrize("buffers", FORMATS, ids=str)
@pytest.mark.parametrize("visibility", ["shadow_map", "exact"])
@pytest.mark.parametrize("light", ["projector", "clear window", "no window"])
def test_lights_on_a_height_field(tmp_path: Path, light: str, visibility: str, buffers: dict[str, Any]) -> None:
    np.save(tmp_path / "slide.npy", np.random.default_rng(7).random((5, 7, 3)))

    def scene_of(skip: bool) -> Any:
        keys = keys_of("beams", skip=skip, visibility=visibility)
        return with_triangles(tmp_path, lights=[PICTURED[light]], image=SIZE, buffers=buffers, technique=keys)

    assert_bits(scene_of, "beams")


EYE = {"position_m": [0.0, 14.0, -20.0], "look_at_m": [0.0, 14.0, 20.0], "vertical_fov_deg": 50.0}
WINDOW = {"center_m": [0.0, 18.0, -10.0], "across_m": [8.0, 0.0, 0.0], "up_m": [0.0, 0.0, 30.0], "peak": 0.9}
AROUND = {"center_m": [0.0, 14.0, -25.0], "across_m": [6.0, 0.0, 0.0], "up_m": [0.0, 6.0, 0.0]}
ADVERSE: dict[str, dict[str, Any]] = {
    "eye in the prism": {"direction": [0.1, -1.0, 0.2], "window": {**WINDOW, "center_m": [0.0, 18.0, -20.0]}},
    "eye in the prism, along the view": {"direction": [0.0, 0.0, 1.0], "window": AROUND},
    "against the view": {"direction": [0.0, 0.0, -1.0], "window": {**AROUND, "center_m": [0.0, 14.0, 5.0]}},
    "eye in the window's plane": {"direction": [0.0, -1.0, 0.0], "window": {**WINDOW, "center_m": [0.0, 14.0, 0.0]}},
    "eye on a side of the prism": {"direction": [0.0, -1.0, 0.0], "window": {**WINDOW, "center_m": [4.0, 18.0, 0.0]}},
    "in the image plane": {"direction": [0.0, -1.0, 0.0], "window": WINDOW},
    "in the image plane, sideways": {
        "direction": [1.0, 0.0, 0.0],
        "window": {"center_m": [-9.0, 12.0, -8.0], "across_m": [0.0, 0.0, 12.0], "up_m": [0.0, 9.0, 0.0]},
    },
    "a slit": {"direction": [0.2, -1.0, 0.3], "window": {**WINDOW, "across_m": [1.0, 0.0, 0.0]}},
    "grazing the ground": {"direction": [1.0, -1e-4, 1e-4]},
    "along the view, everywhere": {"direction": [0.0, 0.0, 1.0]},
}


@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("place", ADVERSE)
def test_prisms_that_meet_the_view_awkwardly(place: str, technique: str) -> None:
    """Spans of rays in the prism are 0/0 or infinite here; what they skip must still be dark."""
    for buffers in FORMATS:
        assert_bits(
            lambda skip, buffers=buffers: f4(
                lights=[{**SUN, **ADVERSE[place]}], camera=EYE, image=SIZE, buffers=buffers,
                technique=keys_of(technique, skip=skip, sub_plane_rule="one") if technique == "beams"
                else keys_of(technique, skip=skip),
            ),
            technique,
        )  # fmt: skip
