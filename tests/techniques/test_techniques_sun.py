"""Projectors and suns through whole techniques: the truth is the limit, laws of light hold, pictures are upright."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference.scenes import FLOAT64, OPENING, PICTURED, SLIDE, SUN, f4, pictured

from atmoref import truth
from atmoref.scene import Scene, load_scene
from atmoref.techniques.render import render

LIGHTS = pytest.mark.parametrize("light", list(PICTURED))
SMALL = {"width": 20, "height": 15}
AIR: dict[str, Any] = {"image": SMALL, "buffers": FLOAT64, "objects": []}


def analysed(folder: Path, light: str, interval_m: float, **technique: Any) -> Scene:
    """Return one of the lights, answered by `analysis` in float64."""
    keys = {"preset": "analysis", "interval_m": interval_m, "epsilon": 0.0005, **technique}
    camera = {"near_m": 1e-4}  # the planes begin there
    return pictured(folder, light, buffers=FLOAT64, technique=keys, image=SMALL, camera=camera)


def lit(light: dict[str, Any] | list[dict[str, Any]], **tables: Any) -> np.ndarray:
    """Return the picture of light in air alone, in float64, by `analysis`."""
    chosen = {"preset": "analysis", "interval_m": 2.0, "epsilon": 0.01, "base_distance_m": 40.0}
    chosen |= tables.pop("technique", {})
    lights = light if isinstance(light, list) else [light]
    return render(f4(lights=lights, technique=chosen, **{**AIR, **tables}), threads=1).image


@LIGHTS
def test_refined_planes_tend_to_the_truth(tmp_path: Path, light: str) -> None:
    """Planes to 500 m, where 5e-5 of the haze is left; what remains are edges of shadows and of pictures."""
    off = []
    for interval_m in (4.0, 0.5):
        scene = analysed(tmp_path, light, interval_m, base_distance_m=500.0)
        exact = truth.solve(scene).image
        off.append(float(np.abs(render(scene).image - exact).sum() / exact.sum()))
    assert off[1] < 0.01
    assert off[1] < 0.5 * off[0]


@pytest.mark.parametrize("direction", [[0.2, -1.0, 0.3], [0.0, 0.0, 1.0], [0.0, 0.1, -1.0], [1.0, 0.0, 0.0]])
def test_the_suns_share_of_slabs_telescopes(direction: list[float]) -> None:
    """D-E13: without objects the sum over slabs is one integral: three slabs give what 48 give."""
    sun = {**SUN, "direction": direction}
    few, many = (lit(sun, technique={"interval_m": i, "base_distance_m": 30.0}) for i in (10.0, 0.625))
    np.testing.assert_allclose(few, many, rtol=1e-12)
    assert few.min() > 0.0


def test_lights_add() -> None:
    """M-9: two suns are the sum of each alone; twice the light is twice the picture."""
    other = {**SUN, "direction": [-0.4, -0.3, 0.1], "irradiance_w_per_m2": [5.0, 9.0, 2.0], "window": OPENING}
    keys = {"i_max": 1.0}
    apart = [lit(light, technique=keys) for light in (SUN, other)]
    np.testing.assert_allclose(lit([SUN, other], technique=keys), apart[0] + apart[1], rtol=1e-12)
    twice = {**other, "irradiance_w_per_m2": [10.0, 18.0, 4.0]}
    fixed = {"i_max": 1.0, "sub_plane_rule": "one"}
    np.testing.assert_allclose(lit(twice, technique=fixed), 2.0 * lit(other, technique=fixed), rtol=1e-12)


@LIGHTS
@pytest.mark.parametrize("buffers", [{"format": "unorm8"}, {"format": "float32"}, FLOAT64], ids=str)
def test_an_occluder_never_brightens(tmp_path: Path, light: str, buffers: dict[str, Any]) -> None:
    """M-10, by shadow map and exactly: black balls in the light of a scene without anything else."""
    dim = {**PICTURED[light], "irradiance_w_per_m2": 3.0} if light == "no window" else PICTURED[light]  # not saturated
    np.save(tmp_path / "slide.npy", np.random.default_rng(7).random((5, 7, 3)))
    tables = {"lights": [dim], "path": tmp_path / "scene.toml", "image": SMALL, "buffers": buffers}
    for visibility in ("exact", "shadow_map"):
        keys = {"preset": "analysis", "visibility": visibility, "shadow_map_size": 128, "shadow_filter": "nearest"}
        keys |= {"interval_m": 2.0, "epsilon": 0.02, "base_distance_m": 70.0}
        free = render(f4(objects=[], technique=keys, **tables), threads=1).image
        for center_m in ([0.0, 8.0, 0.0], [-4.0, 12.0, -3.0], [3.0, 5.0, 4.0]):
            ball = {"type": "sphere", "center_m": center_m, "radius_m": 1.5, "albedo": 0.0}
            hidden = render(f4(objects=[ball], technique=keys, **tables), threads=1).image
            assert (hidden <= free).all(), (visibility, center_m)
            assert (hidden < free).any(), (visibility, center_m)


@pytest.mark.parametrize("light", ["projector", "window"])
def test_pictures_are_not_mirrored(tmp_path: Path, light: str) -> None:
    """Red only in one quarter of the picture: light lies where the truth has it, not where a turn puts it."""
    picture = np.zeros((8, 8, 3))
    picture[:4, :4] = 1.0  # the upper left
    scenes = {}
    for name, texels in {"right": picture, "mirrored": picture[:, ::-1], "upside down": picture[::-1]}.items():
        np.save(tmp_path / "slide.npy", texels)
        keys = {"preset": "analysis", "interval_m": 1.0, "epsilon": 0.005, "base_distance_m": 40.0}
        scenes[name] = f4(
            objects=[{"type": "ground", "height_m": 0.0, "albedo": 0.2}], lights=[PICTURED[light]], image=SMALL,
            path=tmp_path / "scene.toml", technique=keys, buffers=FLOAT64,
        )  # fmt: skip
    exact = {name: truth.solve(scene).image for name, scene in scenes.items()}
    found = render(scenes["right"]).image
    off = {name: float(np.abs(found - image).sum() / exact["right"].sum()) for name, image in exact.items()}
    assert off["right"] < 0.05
    assert off["mirrored"] > 0.5
    assert off["upside down"] > 0.5


def test_the_slide_is_upright() -> None:
    """The bundled slide against the truth, right and turned."""
    scene = load_scene("slide", ("image.width=96", "image.height=64", "buffers.format=float32"))
    found, exact = render(scene).image.clip(0.0, 1.0), truth.solve(scene).image.clip(0.0, 1.0)
    off = np.abs(found - exact).sum() / exact.sum()
    assert off < 0.03
    assert np.abs(found[:, ::-1] - exact).sum() / exact.sum() > 10.0 * off
    assert np.abs(found[::-1] - exact).sum() / exact.sum() > 10.0 * off


@pytest.mark.parametrize("buffers", [{}, {"format": "float16"}, {"format": "float32"}], ids=str)
@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
def test_channels_are_alike_and_apart(tmp_path: Path, technique: str, buffers: dict[str, Any]) -> None:
    """Grey pictures have equal bits in all channels; a coloured one has in each what it has of that channel alone."""
    grey = np.random.default_rng(3).random((6, 6, 1)) * np.ones(3)
    colour = np.random.default_rng(4).random((6, 6, 3))

    def drawn(texels: np.ndarray) -> np.ndarray:
        np.save(tmp_path / "slide.npy", texels)
        keys = {"shadow_map_size": 64, "base_distance_m": 40.0} | ({"interval_m": 2.0} if technique == "beams" else {})
        scene = f4(lights=[SLIDE], image=SMALL, path=tmp_path / "scene.toml", technique=keys, buffers=buffers)
        return render(scene, technique=technique, threads=1).buffers["frame"].codes()

    bits = drawn(grey)
    assert bits.max() > 0
    np.testing.assert_array_equal(bits[..., 0], bits[..., 1])
    np.testing.assert_array_equal(bits[..., 0], bits[..., 2])
    whole = drawn(colour)
    for channel in range(3):
        alone = drawn(np.repeat(colour[..., channel : channel + 1], 3, -1))
        np.testing.assert_array_equal(whole[..., channel], alone[..., channel])


def test_a_sun_from_below_is_cut_by_the_ground_everywhere() -> None:
    """The ground has no end: beyond the shadow map, too, a sun that shines upwards does not get through."""
    below = {**SUN, "direction": [0.1, 1.0, 0.2]}
    floor = {"type": "ground", "height_m": 0.0, "albedo": 0.2}
    for visibility in ("exact", "shadow_map"):
        ball = {"type": "sphere", "center_m": [0.0, 8.0, 0.0], "radius_m": 1.0, "albedo": 0.1}
        assert lit(below, objects=[floor, ball], technique={"visibility": visibility}).max() == 0.0, visibility


ACROSS = {"center_m": [0.0, 14.0, -45.0], "across_m": [6.0, 0.0, 0.0], "up_m": [0.0, 6.0, 0.0]}  # around the eye
AWKWARD: dict[str, dict[str, Any]] = {
    "along the view": {"direction": [0.0, 0.0, 1.0], "window": ACROSS},
    "towards the eye": {"direction": [0.0, 0.0, -1.0], "window": {**ACROSS, "center_m": [0.0, 14.0, 5.0]}},
    "across the view": {"direction": [1.0, 0.0, 0.0], "window": {**OPENING, "up_m": [0.0, 3.0, 9.0]}},
    "window edge-on": {"direction": [0.0, -1.0, 0.0], "window": {**ACROSS, "center_m": [0.0, 18.0, -20.0],
                                                                  "up_m": [0.0, 1e-3, 6.0]}},
    "grazing": {"direction": [1.0, -1e-4, 1e-4], "window": {**OPENING, "across_m": [1.0, 0.0, 9.0]}},
    "through the ground": {"direction": [0.1, 1.0, 0.2]},
    "level": {"direction": [1.0, 0.0, 1e-6]},
}  # fmt: skip


@pytest.mark.parametrize("buffers", [{"format": "unorm8"}, {"format": "float32"}], ids=str)
@pytest.mark.parametrize("technique", ["beams", "beams_vertex"])
@pytest.mark.parametrize("place", AWKWARD)
def test_what_is_skipped_is_nothing(place: str, technique: str, buffers: dict[str, Any]) -> None:
    """Suns whose prism meets the view in awkward ways: the same bits with and without skips, in one or five threads."""
    found = []
    for skip, threads in ((True, 1), (False, 1), (True, 5)):
        keys = {"skip": skip, "shadow_map_size": 64, "base_distance_m": 50.0}
        keys |= {"interval_m": 2.0} if technique == "beams" else {"planes": 20}
        scene = f4(
            lights=[{**SUN, **AWKWARD[place]}], image={"width": 37, "height": 29}, technique=keys, buffers=buffers
        )
        found.append(render(scene, technique=technique, threads=threads).buffers["frame"].codes())
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    assert found[0].any() or place == "through the ground"
