"""The ladder: rungs add up to the whole error, and the last one is the scene's own picture."""

from pathlib import Path

import numpy as np
import pytest

from atmoref.images import read
from atmoref.judge.ladder import Ladder, errors, ladder
from atmoref.scene import load_scene
from atmoref.techniques.render import render

SMALL = ("image.width=48", "image.height=72")


@pytest.fixture(scope="module", params=["fig4c", "fig4b", "two_lights"])
def climbed(request: pytest.FixtureRequest) -> Ladder:
    return ladder(load_scene(request.param, SMALL))


def test_changes_of_all_rungs_add_up_to_picture_minus_truth(climbed: Ladder) -> None:
    total = sum(rung.change for rung in climbed.rungs)
    whole = climbed.rungs[-1].image - climbed.truth
    assert np.abs(total - whole).max() <= 4e-16 * len(climbed.rungs)  # one rounding a rung, of numbers up to 1


def test_the_last_rung_is_the_scenes_own_picture(climbed: Ladder) -> None:
    own = np.clip(render(climbed.scene).image, 0.0, 1.0)
    np.testing.assert_array_equal(climbed.rungs[-1].image, own)


def test_the_first_rung_is_the_nearest_to_the_truth_and_storage_comes_last(climbed: Ladder) -> None:
    means = [climbed.errors(r.image)["mean"] for r in climbed.rungs]
    assert means[0] <= 1.05 * min(means)
    assert climbed.rungs[0].kind == "discretisation"
    assert climbed.rungs[-1].kind == "storage"
    assert "unorm8" in climbed.rungs[-1].name


def test_each_rung_changes_something_and_names_are_distinct(climbed: Ladder) -> None:
    assert all(r.changes for r in climbed.rungs[1:])
    names = [r.name for r in climbed.rungs]
    assert len(set(names)) == len(names)
    assert all(name in climbed.table() for name in names)


def test_the_written_change_is_the_signed_difference(tmp_path: Path) -> None:
    climbed = ladder(load_scene("fig4c", ("image.width=24", "image.height=36")))
    climbed.write(tmp_path)
    for i, rung in enumerate(climbed.rungs):
        (path,) = tmp_path.glob(f"{i:02d}_*_change.exr")
        np.testing.assert_allclose(read(path).rgb(), rung.change, rtol=0, atol=1e-7)  # float32 in the file


def test_errors_by_hand() -> None:
    reference = np.array([[[0.5, 0.01, 2.0]]])
    image = np.array([[[0.4, 0.03, 9.0]]])
    e = errors(image, reference)
    assert e["mean"] == pytest.approx((0.1 + 0.02 + 0.0) / 3)
    assert e["sum_ratio"] == pytest.approx(0.12 / 1.51)
    assert e["mean_relative"] == pytest.approx((0.2 + 0.0) / 2)  # 0.01 is below 0.02
    assert e["worst"] == pytest.approx(0.1)
