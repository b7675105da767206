"""`check`, `accept`, `export`, and what `compare` can write: exit codes, files, refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import SMALL, refused, run, well

from atmoref.images import Image, from_rgb, write
from atmoref.judge.dumps import MANIFEST

CHEAP = (*SMALL, "--set", "technique.interval_m=6.0", "--set", "technique.q_table_size=32")


@pytest.fixture(scope="module")
def dump(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("dumps") / "d"
    well("render", "quick", *CHEAP, "--stages", directory)
    return directory


def listing(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_a_dump_of_the_mirror_passes(dump: Path, tmp_path: Path) -> None:
    files = [tmp_path / f"r{suffix}" for suffix in (".html", ".json", ".xml", ".txt")]
    reports = [word for file in files for word in ("--report", file)]
    done = well("check", dump, "--scene", "quick", *CHEAP, *reports)
    assert done.out.startswith("verdict      passed")
    assert all(file.stat().st_size > 100 for file in files)
    assert json.loads(files[1].read_text())["verdict"] == "passed"


def test_a_wrong_build_is_exit_code_1_with_stage_and_cause(dump: Path) -> None:
    done = run("check", dump, "--scene", "quick", *CHEAP, "--set", "technique.shadow_bias_m=3.0", "--json")
    assert done.code == 1, done.err
    told = json.loads(done.out)
    assert told["verdict"] == "failed"
    assert told["first"].startswith("light_0/")
    assert told["diagnosis"]["kind"] == "shadow bias/compare"
    assert told["envelope"] is False


def test_rectangles_can_be_left_out(dump: Path, tmp_path: Path) -> None:
    arguments = ("check", dump, "--scene", "quick", *CHEAP, "--no-diagnose")
    well(*arguments, "--ignore", "0,0,24,10")
    refused(run(*arguments, "--ignore", "0,0,25,10"), 2, "--ignore", "24 x 36")
    refused(run(*arguments, "--ignore", "0,0,24,36"), 2, "no pixel")
    write(tmp_path / "m.png", from_rgb(np.ones((36, 24), np.uint8)))
    well(*arguments, "--mask", tmp_path / "m.png")


def test_wrong_checks_are_refused(dump: Path, tmp_path: Path) -> None:
    refused(run("check", tmp_path / "no", "--scene", "quick"), 2, "no such directory")
    refused(run("check", tmp_path, "--scene", "quick"), 2, MANIFEST)
    refused(run("check", dump, "--scene", "quick", *CHEAP, "--set", "image.height=37"), 2, "allowed: 24 x 37")
    refused(run("check", dump, "--scene", "quick", "--report", tmp_path / "r.pdf"), 2, "--report")
    other = run("check", dump, "--scene", "quick", *CHEAP, "--set", "technique.interval_m=12.0")
    refused(other, 2, "no draw named", "is it the scene")
    assert listing(tmp_path) == set()


def test_a_new_baseline_keeps_the_size_of_the_change(tmp_path: Path) -> None:
    codes = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    write(tmp_path / "a.png", from_rgb(codes, {"format": "unorm8"}))
    write(tmp_path / "b.png", from_rgb(codes + 2, {"format": "unorm8"}))
    base = tmp_path / "base.png"
    well("accept", tmp_path / "a.png", base, "--reason", "first")
    done = well("accept", tmp_path / "b.png", base, "--reason", "brighter by intent")
    assert "largest change 0.00784" in done.out
    first, second = json.loads((tmp_path / "base.png.record.json").read_text())
    assert "change" not in first
    assert second["reason"] == "brighter by intent"
    assert second["change"]["codes_off"] == {"+2": 48}
    assert second["replaces_sha256"] == first["sha256"]
    assert base.read_bytes() == (tmp_path / "b.png").read_bytes()
    refused(run("accept", tmp_path / "a.png", base, "--reason", " "), 2, "--reason")
    refused(run("accept", tmp_path / "a.png", tmp_path / "x.exr", "--reason", "r"), 2, "different kinds")
    write(tmp_path / "c.png", from_rgb(np.zeros((3, 3, 3), np.uint8)))
    refused(run("accept", tmp_path / "c.png", base, "--reason", "r"), 2, "sizes differ")
    assert base.read_bytes() == (tmp_path / "b.png").read_bytes()
    (tmp_path / "base.png.record.json").write_text("{")
    refused(run("accept", tmp_path / "a.png", base, "--reason", "r"), 2, "record.json")


def test_channels_of_any_name_can_be_compared(tmp_path: Path) -> None:
    plane = np.linspace(0.0, 1.0, 16, dtype=np.float32).reshape(4, 4)
    write(tmp_path / "t.exr", Image({"beauty.X": plane, "beauty.Y": plane * 2}))
    write(tmp_path / "r.exr", Image({"beauty.X": plane, "beauty.Y": plane}))
    pair = ("compare", tmp_path / "t.exr", tmp_path / "r.exr", "--abs", "0.001")
    assert well(*pair, "--channels", "beauty.X").code == 0
    assert run(*pair, "--channels", "beauty.X,beauty.Y").code == 1
    refused(run(*pair, "--channels", "Z"), 2, "has no 'Z'", "beauty.X")
    refused(run(*pair, "--channels", "a,a"), 2, "--channels")


def test_a_transfer_can_be_stated(tmp_path: Path) -> None:
    codes = np.linspace(0, 255, 64).reshape(8, 8).astype(np.uint8)
    linear = np.where(codes / 255 <= 0.04045, codes / 255 / 12.92, ((codes / 255 + 0.055) / 1.055) ** 2.4)
    np.save(tmp_path / "t.npy", (codes / 255).astype(np.float32))
    np.save(tmp_path / "r.npy", linear.astype(np.float32))
    pair = ("compare", tmp_path / "t.npy", tmp_path / "r.npy", "--abs", "0.0001")
    assert run(*pair).code == 1
    done = well(*pair, "--transfer", "srgb")
    assert "decoded to linear" in done.out


def test_compare_writes_pages_and_junit(tmp_path: Path) -> None:
    codes = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    write(tmp_path / "a.png", from_rgb(codes, {"format": "unorm8"}))
    write(tmp_path / "b.png", from_rgb(codes + 2, {"format": "unorm8"}))
    reports = ("--report", tmp_path / "r.html", "--report", tmp_path / "r.xml")
    done = run("compare", tmp_path / "a.png", tmp_path / "b.png", "--codes", "1", *reports)
    assert done.code == 1
    assert "outside the interval" in (tmp_path / "r.html").read_text()
    assert 'failures="1"' in (tmp_path / "r.xml").read_text()
    assert run("compare", tmp_path / "a.png", tmp_path / "b.png", "--codes", "1", "--ignore", "0,0,4,3").code == 1


def test_a_pack_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    well("export", "quick", *CHEAP, "-o", tmp_path / "pack")
    assert json.loads((tmp_path / "pack" / "manifest.json").read_text())["kind"] == "atmoref pack"
    well("export", "quick", *CHEAP, "-o", tmp_path / "pack")  # an earlier pack is replaced
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "x").write_text("")
    refused(run("export", "quick", *CHEAP, "-o", tmp_path / "mine"), 2, "holds other files")
    assert listing(tmp_path / "mine") == {"x"}
    assert {path.name for path in tmp_path.iterdir()} == {"pack", "mine"}


@pytest.mark.parametrize("suffix", [".npz", ".exr"])
def test_bounds_hold_what_their_device_draws(tmp_path: Path, suffix: str) -> None:
    """Of the scene's device alone, or of any: another device's picture lies in the envelope, and not in the first's."""
    own, other = tmp_path / "own.npz", tmp_path / "other.npz"
    device, envelope = tmp_path / f"device{suffix}", tmp_path / f"envelope{suffix}"
    well("render", "quick", *CHEAP, "-o", own)
    well("render", "quick", *CHEAP, "--set", "buffers.device=geforce_fx", "-o", other)
    told = json.loads(well("bounds", "quick", *CHEAP, "-o", device, "--json").out)
    wide = json.loads(well("bounds", "quick", *CHEAP, "--interval", "envelope", "-o", envelope, "--json").out)
    assert (told["interval"], wide["interval"]) == ("device", "envelope")
    assert 0.0 <= told["median"] <= told["percent_99"] <= told["greatest"] < wide["greatest"]
    assert wide["decided"] < told["decided"] <= 1.0
    assert "decided" in well("bounds", "quick", *CHEAP).out

    def judged(picture: Path, bounds: Path) -> int:
        return run("compare", picture, own, "--bounds", bounds, bounds).code

    assert [judged(own, device), judged(own, envelope)] == [0, 0]
    assert [judged(other, device), judged(other, envelope)] == [1, 0]


def test_wrong_bounds_are_refused(tmp_path: Path) -> None:
    refused(run("bounds", "quick", "--technique", "truth"), 2, "bounds", "a technique")
    refused(run("bounds", "quick", *CHEAP, "--interval", "exact"), 2, "--interval", "envelope")
    refused(run("bounds", "quick", *CHEAP, "-o", tmp_path / "b.png"), 2, "-o", ".npz")
    refused(run("bounds", "quick", *CHEAP, "--crop", "0,0,25,1"), 2, "24 x 36")
    assert listing(tmp_path) == set()
