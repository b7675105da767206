"""``atmoref render`` and ``atmoref trace``: files, attributes, stages, statistics."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import SMALL, run, well
from PIL import Image as Picture

import atmoref
from atmoref.images import read
from atmoref.scene import load_scene

SCENE = load_scene("quick", ["image.width=24", "image.height=36"])


@pytest.fixture(scope="module")
def image() -> np.ndarray:
    return atmoref.render(SCENE).image


def test_values_and_picture(tmp_path: Path, image: np.ndarray) -> None:
    exr, npz, png = tmp_path / "a.exr", tmp_path / "a.npz", tmp_path / "a.png"
    assert well("render", "quick", *SMALL, "-o", exr, "--png", png).out == ""
    well("render", "quick", *SMALL, "-o", npz)
    np.testing.assert_array_equal(read(npz).rgb(), image)
    np.testing.assert_array_equal(read(exr).rgb(), image.astype(np.float32))
    with Picture.open(png) as picture:  # a screenshot of the frame buffer
        np.testing.assert_array_equal(np.asarray(picture), np.rint(image * 255.0).astype(np.uint8))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.exr", "a.npz", "a.png"]


def test_attributes_say_how_it_was_made(tmp_path: Path) -> None:
    well("render", "quick", *SMALL, "-o", tmp_path / "a.exr", "--set", "buffers.device=gl_llvmpipe")
    told = read(tmp_path / "a.exr").attributes
    scene = SCENE.with_overrides(["buffers.device=gl_llvmpipe"])
    expected = {
        "scene": "quick", "scene_sha256": scene.digest(), "atmoref_version": atmoref.__version__, "technique": "beams",
        "preset": "corrected", "format": "unorm8", "device": "gl_llvmpipe", "arithmetic": "float32",
        "units": "W m-2 sr-1",
    }  # fmt: skip
    assert expected.items() <= told.items()
    assert "f_h=unorm8" in str(told["formats"])


def test_without_outputs_two_files_take_the_scenes_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    well("render", "quick", *SMALL)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["quick.exr", "quick.png"]


def test_a_crop_is_a_part_of_the_whole(tmp_path: Path, image: np.ndarray) -> None:
    well("render", "quick", *SMALL, "--crop", "5,7,13,11", "-o", tmp_path / "a.npz", "--threads", "1")
    np.testing.assert_array_equal(read(tmp_path / "a.npz").rgb(), image[7:18, 5:18])


def test_statistics_are_json_alone_on_stdout() -> None:
    stats = json.loads(well("render", "quick", *SMALL, "--stats", "json").out)
    assert stats["draws"] == 4 + sum(light["main_planes"] + light["sub_planes"] for light in stats["lights"])
    assert stats["sub_plane_waves_skipped"] <= stats["sub_plane_waves"]
    assert stats["pass_wall_s"].keys() == stats["pass_cpu_s"].keys()
    assert 50.0 < stats["peak_memory_mb"] < 4000.0
    assert stats["provenance"]["scene"] == "quick"
    assert "sub_planes" in well("render", "quick", *SMALL, "--stats", "text").out


@pytest.mark.parametrize("scene", ["quick", "fig4d"])
def test_truth_answers_every_scene(tmp_path: Path, scene: str) -> None:
    size = ("--set", "image.width=6", "--set", "image.height=9")
    well("render", scene, *size, "--technique", "truth", "-o", tmp_path / "t.npz", "--png", tmp_path / "t.png")
    found = read(tmp_path / "t.npz")
    expected = atmoref.truth(load_scene(scene, size[1::2]))
    np.testing.assert_array_equal(found.layer("").rgb(), expected.image)
    assert expected.error is not None
    np.testing.assert_array_equal(found.layer("error").rgb(), expected.error)
    assert found.attributes["technique"] == "truth"
    assert found.attributes["scene_sha256"] == load_scene(scene, size[1::2]).digest()
    assert read(tmp_path / "t.png").attributes["transfer"] == "srgb"


def test_parameters_of_the_truth(tmp_path: Path) -> None:
    size = ("--set", "image.width=3", "--set", "image.height=4")
    method = ("--set", "technique.method=monte_carlo", "--set", "technique.samples=64", "--set", "technique.seed=3")
    well("render", "fig4d", *size, *method, "-o", tmp_path / "t.npz")
    expected = atmoref.truth(load_scene("fig4d", size[1::2]), method="monte_carlo", samples=64, seed=3)
    np.testing.assert_array_equal(read(tmp_path / "t.npz").layer("").rgb(), expected.image)


def test_stages_are_what_the_buffers_held(tmp_path: Path) -> None:
    """Against a watch of our own; the last frame is the picture; hashes are those of the codes."""
    frames: dict[str, np.ndarray] = {}
    result = atmoref.render(SCENE, watch=lambda draw, step, bank: frames.update({draw: bank["frame"].codes()}))
    well("render", "quick", *SMALL, "--stages", tmp_path / "st")
    manifest = json.loads((tmp_path / "st" / "manifest.json").read_text())
    entries = {entry["draw"]: entry for entry in manifest["draws"] if entry["draw"]}
    files = {path.name for path in (tmp_path / "st").iterdir()}
    assert files == {entry["file"] for entry in manifest["draws"]} | {"manifest.json"}
    planes = [entry for entry in manifest["draws"] if entry["buffer"] == "frame"]
    assert len(planes) == 2 + result.stats["lights"][0]["main_planes"]
    for entry in planes:
        codes = frames[entry["draw"]]
        assert entry["sha256"] == hashlib.sha256(codes.tobytes()).hexdigest()
        stored = read(tmp_path / "st" / entry["file"]).rgb()
        np.testing.assert_array_equal(np.rint(stored * 255.0), codes)
    np.testing.assert_array_equal(frames[planes[-1]["draw"]], np.rint(result.image * 255.0))
    gathered = [entry for entry in manifest["draws"] if entry["buffer"] == "f_h"]
    assert len(gathered) == len([n for n in result.stats["lights"][0]["sub_planes_per_slab"] if n])
    assert {"light_0.q.exr", "light_0.light_map.exr", "light_0.shadow_map.exr", "opaque.depth.exr"} <= files
    assert manifest["scene_sha256"] == SCENE.digest()
    assert entries["light_0/shadow_map"]["format"] == "depth24"


def test_24_bit_depths_are_identified_by_their_values(tmp_path: Path) -> None:
    well("render", "quick", *SMALL, "--stages", tmp_path / "st")
    manifest = json.loads((tmp_path / "st" / "manifest.json").read_text())
    for entry in manifest["draws"]:
        if entry["format"] == "depth24":
            (plane,) = read(tmp_path / "st" / entry["file"]).channels.values()
            codes = np.rint(plane.astype(np.float64) * (2**24 - 1)).astype("<u4")
            assert hashlib.sha256(codes.tobytes()).hexdigest() == entry["sha256"]


def test_stages_of_a_crop_and_of_an_earlier_dump(tmp_path: Path) -> None:
    whole, part = tmp_path / "whole", tmp_path / "part"
    well("render", "quick", *SMALL, "--stages", whole)
    well("render", "quick", *SMALL, "--stages", part)
    well("render", "quick", *SMALL, "--stages", part, "--crop", "3,5,16,8")  # takes the place of the earlier one
    name = "light_0.slab_010.main.exr"
    np.testing.assert_array_equal(read(part / name).rgb(), read(whole / name).rgb()[5:13, 3:19])
    assert json.loads((part / "manifest.json").read_text())["crop"] == [3, 5, 16, 8]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["part", "whole"]


def test_stages_never_replace_other_files(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("x")
    (tmp_path / "file").write_text("x")
    for name in ("mine", "file"):
        done = run("render", "quick", *SMALL, "--stages", tmp_path / name)
        assert done.code == 2
        assert "--stages" in done.err
        assert name in done.err
    assert (tmp_path / "mine" / "thesis.tex").read_text() == "x"


@pytest.mark.parametrize(("scene", "x", "y"), [("quick", 11, 14), ("quick", 23, 35), ("fig4a", 17, 20)])
def test_trace_agrees_with_the_dump(tmp_path: Path, scene: str, x: int, y: int) -> None:
    """Codes at the pixel, draw by draw; and every sum that was stored follows from what was drawn."""
    small = (*SMALL, "--set", "technique.planes=7") if scene == "fig4a" else SMALL
    told = json.loads(well("trace", scene, *small, "--pixel", x, y, "--json").out)
    well("render", scene, *small, "--stages", tmp_path / "st")
    manifest = json.loads((tmp_path / "st" / "manifest.json").read_text())
    files = {entry["draw"]: entry["file"] for entry in manifest["draws"] if entry["buffer"] in ("frame", "f_h")}
    draws = told["draws"]
    seen = 0
    before = [0.0, 0.0, 0.0]
    for draw in draws:
        if draw["draw"] in files:
            seen += 1
            codes = np.rint(read(tmp_path / "st" / files[draw["draw"]]).rgb()[y, x] * 255.0)
            np.testing.assert_array_equal(codes, draw["stored"])
        np.testing.assert_allclose(np.array(draw["stored"]) / 255.0, draw["value"], rtol=1e-12)
        if draw["buffer"] == "frame":
            if draw["drawn"] is not None and draw["lit"] is not None:
                added = np.rint(np.array(draw["drawn"]) * 255.0)
                assert np.abs(np.minimum(before + added, 255.0) - draw["stored"]).max() <= 1.0
                assert draw["lit"] or max(draw["drawn"]) == 0.0
            before = draw["stored"]
    assert seen > 8
    depths = [draw["inputs"]["depth_m"] for draw in draws if draw["draw"].endswith("main")]
    if scene == "quick":
        np.testing.assert_allclose(np.diff(depths), 1.2, rtol=1e-5)


def test_trace_as_a_table() -> None:
    lines = well("trace", "quick", *SMALL, "--pixel", 11, 14).out.splitlines()
    assert "pixel 11 14" in lines[0]
    assert any(line.startswith("light_0/slab_003/main") for line in lines)
