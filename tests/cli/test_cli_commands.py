"""The commands that tell, compare, and keep tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import run, well

from atmoref.images import from_rgb, read, write
from atmoref.scene import bundled_names, bundled_text, load_scene, parse_scene
from atmoref.store import load_or_build
from atmoref.techniques import TECHNIQUES


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a cache directory of one's own, for tables; kernels stay where they are, which is settled at import."""
    import atmoref._jit

    assert atmoref._jit.CACHE_DIRECTORY.is_dir()
    monkeypatch.setenv("ATMOREF_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_help_and_version() -> None:
    text = well("--help").out
    for name in ("render", "trace", "compare", "scenes", "techniques", "schema", "validate", "info", "doctor"):
        assert f"\n  {name}" in text
        assert "Usage: atmoref " + name in well(name, "--help").out
    assert well("--version").out.startswith("atmoref 0.")


def test_bench() -> None:
    told = well("bench", "quick", "--quick", "--rounds", "1", "--set", "image.width=24", "--set", "image.height=36")
    assert "error against time, 24 x 36 pixels, frame unorm8" in told.out
    assert all(f"| {name}" in told.out for name in (*TECHNIQUES, "truth"))
    again = well("bench", "quick", "--quick", "--rounds", "1", "--pixels", "512", "--json").out
    assert [c["technique"] for c in json.loads(again)["costs"]] == list(TECHNIQUES)


def test_scenes() -> None:
    listed = well("scenes").out
    for name in bundled_names():
        assert name in listed
    assert well("scenes", "fig4c").out == bundled_text("fig4c")
    assert [row["name"] for row in json.loads(well("scenes", "--json").out)] == bundled_names()


def test_techniques() -> None:
    listed = well("techniques").out
    assert all(name in listed for name in (*TECHNIQUES, "truth"))
    told = json.loads(well("techniques", "--json").out)
    beams = told["beams"]["parameters"]
    assert beams["epsilon"]["default"] == 0.01
    assert beams["dt_mode"]["presets"]["paper"] == "paper"
    assert beams["shadow_bias_m"]["unit"] == "m"
    assert told["beams"]["buffers"]["paper"]["f_h"] == "frame"
    text = well("techniques", "beams").out
    assert all(f"  {key} = " in text for key in beams)
    assert "samples = 256" in well("techniques", "truth").out


def test_schema_knows_every_technique() -> None:
    schema = json.loads(well("schema").out)
    assert schema["$schema"].startswith("https://json-schema.org/")
    assert {f"technique_{name}" for name in (*TECHNIQUES, "truth")} <= set(schema["$defs"])


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_scenes_are_valid(name: str) -> None:
    assert load_scene(name).digest() in well("validate", name).out


def test_validate_prints_the_whole_scene() -> None:
    text = well("validate", "quick", "--set", "lights.0.peak=0.5", "--resolved").out
    assert parse_scene(text) == load_scene("quick", ["lights.0.peak=0.5"])


def test_validate_knows_the_techniques_parameters(tmp_path: Path) -> None:
    assert well("validate", "quick", "--technique", "truth").code == 0
    done = run("validate", "quick", "--set", "technique.epsilom=1")
    assert done.code == 2
    assert "technique.epsilom: unknown key (did you mean epsilon?)" in done.err


def test_info(tmp_path: Path, cache: Path) -> None:
    assert json.loads(well("info", "fig4c", "--json").out)["sha256"] == load_scene("fig4c").digest()
    (tmp_path / "s.toml").write_text(bundled_text("quick"))
    assert "kind: scene" in well("info", tmp_path / "s.toml").out
    image = from_rgb(np.linspace(0.0, 2.0, 60).reshape(4, 5, 3), {"device": "ideal"})
    for suffix in (".exr", ".npz"):
        write(tmp_path / f"i{suffix}", image)
        told = json.loads(well("info", tmp_path / f"i{suffix}", "--json").out)
        assert (told["kind"], told["width"], told["height"]) == ("image", 5, 4)
        assert told["channels"]["B"]["max"] == 2.0
        assert told["attributes"]["device"] == "ideal"
    load_or_build("example", 3, {"size_m": 0.1}, lambda: {"numbers": np.arange(6.0)})
    (table,) = (cache / "tables").glob("*.npz")
    told = json.loads(well("info", table, "--json").out)
    assert (told["kind"], told["version"], told["parameters"]) == ("example", 3, {"size_m": {"float": (0.1).hex()}})


def test_doctor() -> None:
    told = json.loads(well("doctor", "--json").out)
    assert told["processor"]["lane_width"] in (1, 2, 4, 8, 16, 32)
    assert told["versions"]["numpy"] == np.__version__
    assert "tested" in told["platform"]["support"]
    assert len(told["cache"]["kernel_key"]) == 24
    assert Path(told["cache"]["shipped_tables"]).is_dir()
    assert set(told["extras"]) == {"report", "mesh", "cluster", "vdb", "gpu", "peers"}
    assert "lane_width" in well("doctor").out


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    """Return two 8-bit frames that differ by two codes at one place, as a PNG of codes and an EXR of values."""
    codes = np.arange(20 * 30 * 3).reshape(20, 30, 3).astype(np.uint8)
    other = codes.copy()
    other[7, 11, 1] += 2
    write(tmp_path / "a.png", from_rgb(codes, {"format": "unorm8"}))
    write(tmp_path / "b.exr", from_rgb(other / 255.0, {"format": "unorm8"}))
    return tmp_path / "a.png", tmp_path / "b.exr"


@pytest.mark.parametrize(
    ("limits", "code", "word"),
    [
        ((), 0, "measured"),
        (("--codes", 2), 0, "passed"),
        (("--codes", 1), 1, "failed"),
        (("--abs", 0.008), 0, "passed"),
        (("--abs", 0.007), 1, "failed"),
        (("--rel", 1e-6), 1, "failed"),
    ],
)
def test_compare(pair: tuple[Path, Path], limits: tuple[object, ...], code: int, word: str) -> None:
    done = run("compare", *pair, *limits)
    assert (done.code, done.err) == (code, "")
    assert done.out.startswith(f"verdict      {word}")
    told = json.loads(run("compare", *pair, *limits, "--json").out)
    assert told["verdict"] == word
    assert (told["worst"]["x"], told["worst"]["y"]) == (11, 7)


def test_compare_writes_picture_and_report(pair: tuple[Path, Path], tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("d.png", "r.json", "r.txt")]
    assert run("compare", *pair, "--codes", 1, "--picture", files[0], "--report", files[1]).code == 1
    assert run("compare", *pair, "--codes", 1, "--report", files[2]).code == 1
    shown = read(files[0]).rgb().astype(int)
    assert np.ptp(shown[7, 11]) > 100  # coloured at one place only
    shown[7, 11] = 255
    assert shown.min() > 240
    assert json.loads(files[1].read_text())["verdict"] == "failed"
    assert files[2].read_text().startswith("verdict      failed")


def test_compare_with_bounds_mask_and_layers(pair: tuple[Path, Path], tmp_path: Path) -> None:
    test = read(pair[1]).rgb().astype(np.float64)
    write(tmp_path / "lo.npz", from_rgb(test - 0.001))
    write(tmp_path / "hi.npz", from_rgb(test + 0.001))
    bounds = ("--bounds", tmp_path / "lo.npz", tmp_path / "hi.npz")
    assert run("compare", pair[1], pair[1], *bounds).code == 0
    assert run("compare", pair[0], pair[1], *bounds).code == 1
    mask = np.ones((20, 30), np.uint8)
    mask[7, 11] = 0
    write(tmp_path / "m.png", from_rgb(mask))
    assert run("compare", *pair, "--codes", 0, "--mask", tmp_path / "m.png").code == 0


def test_tables(cache: Path) -> None:
    assert well("tables", "build", "quick", "fig4d").out == "1 tables built, 1 there\n"
    assert well("tables", "build", "quick").out == "0 tables built, 1 there\n"
    *shipped, entry = json.loads(well("tables", "list", "--json").out)
    assert {one["kind"] for one in shipped} == {"scattered"}
    there = len(shipped) + 1
    assert entry["kind"] == "q"
    assert entry["parameters"]["sigma_t_per_m"] == {"float": (0.02).hex()}
    assert entry["file"].startswith(str(cache))
    assert f"{there} tables" in well("tables", "list").err
    assert well("tables", "verify").out == f"{there} tables, 0 damaged\n"
    path = Path(entry["file"])
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    done = run("tables", "verify")
    assert done.code == 1
    assert "1 damaged" in done.out
    assert well("tables", "build", "quick").out == "1 tables built, 1 there\n"
    assert well("tables", "clear").out == "1 tables removed\n"
    assert list((cache / "tables").glob("*.npz")) == []


def test_a_damaged_table_is_reported_and_built_again(cache: Path, tmp_path: Path) -> None:
    small = ("--set", "image.width=24", "--set", "image.height=36")
    well("render", "quick", *small, "-o", tmp_path / "a.npz")
    (table,) = (cache / "tables").glob("*.npz")
    table.write_bytes(table.read_bytes()[:1000])
    done = well("render", "quick", *small, "-o", tmp_path / "b.npz")
    assert "a stored table is unusable and is built again" in done.err
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


class Rungs:
    """What a ladder offers."""

    def table(self) -> str:
        return "rung  error"

    def to_dict(self) -> dict[str, str]:
        return {"scene": "quick"}

    def write(self, directory: Path) -> None:
        (directory / "rung.exr").touch()


def test_budget_and_demo_print_what_their_rooms_return(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from atmoref.judge import figure4 as figure
    from atmoref.judge import ladder

    monkeypatch.setattr(figure, "figure4", lambda directory, progress: f"measured into {Path(directory).name}")
    monkeypatch.setattr("atmoref.scene.bundled_names", lambda: ["fig4a"])
    assert well("demo", "-o", tmp_path / "demo" / "deep").out == "measured into deep\n"
    monkeypatch.setattr(ladder, "ladder", lambda scene, threads, progress: Rungs())
    assert well("budget", "quick").out == "rung  error\n"
    assert json.loads(well("budget", "quick", "--json", "-o", tmp_path / "budget").out) == {"scene": "quick"}
    assert (tmp_path / "budget" / "rung.exr").exists()


@pytest.mark.slow
def test_budget_and_demo(tmp_path: Path) -> None:
    small = ("--set", "image.width=8", "--set", "image.height=12")
    told = json.loads(well("budget", "quick", *small, "--json", "-o", tmp_path / "budget").out)
    assert told["scene"] == "quick"
    assert any((tmp_path / "budget").iterdir())
    assert "(c') corrected" in well("demo", "-o", tmp_path / "demo").out
    files = {path.name for path in (tmp_path / "demo").iterdir()}
    panels = {f"fig4{key}{suffix}" for key in "abcd" for suffix in (".exr", ".png")}
    assert panels | {"quick.exr", "quick.png", "two_lights.exr", "two_lights.png", "figure4.png"} <= files
