"""Bundled scenes of the paper's figures 9 and 10: their counts of planes, and their pictures from the script."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from atmoref.scene import load_scene
from atmoref.techniques.render import prepare

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "atmoref" / "scene" / "bundled"
SPEC = importlib.util.spec_from_file_location("scene_pictures", ROOT / "validation" / "scene_pictures.py")
assert SPEC is not None
assert SPEC.loader is not None
scene_pictures = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scene_pictures)


@pytest.mark.parametrize("name", sorted(scene_pictures.PICTURES))
def test_the_script_makes_the_pictures(name: str) -> None:
    with Image.open(FOLDER / name) as stored:
        np.testing.assert_array_equal(np.asarray(stored), scene_pictures.PICTURES[name]())
    assert (FOLDER / name).stat().st_size < 300_000


def test_no_other_pictures_lie_beside_the_scenes() -> None:
    assert {path.name for path in FOLDER.glob("*.png")} == set(scene_pictures.PICTURES)


def test_the_slide_differs_from_its_reflections_and_turns() -> None:
    picture = scene_pictures.slide().astype(int)
    for other in (picture[::-1], picture[:, ::-1], picture[::-1, ::-1]):
        assert np.abs(other - picture).mean() > 30.0


@pytest.mark.parametrize(
    ("name", "counts"),
    [("fig9a", [(9, 309), (13, 174), (16, 162)]), ("fig9b", [(30, 263)]), ("fig10a_shafts", [(30, 135)])],
)
def test_planes_are_as_many_as_in_the_paper(name: str, counts: list[tuple[int, int]]) -> None:
    """Sheet of the paper, section 4; chosen by intensities and spacings, so a check of the files, not of the rules."""
    scene = load_scene(name)
    assert (scene.image.width, scene.image.height) == (720, 480)
    lights = prepare(scene, None, None, None)[-1]["lights"]
    assert [(light["main_planes"], light["sub_planes"]) for light in lights] == counts
