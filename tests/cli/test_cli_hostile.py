"""Wrong requests: exit code 2 or 3, exactly one message that names file and key, no traceback, no file."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from cli_runs import refused, run

from atmoref.images import from_rgb, write
from atmoref.scene.emit import to_toml


def scene_table() -> ModuleType:
    """Return the scene room's table of bad values for every key."""
    path = Path(__file__).parents[1] / "scene" / "test_scene_errors.py"
    spec = importlib.util.spec_from_file_location("scene_errors_for_cli", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TABLE = scene_table()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory of a wrong request: it holds one image and must not change."""
    monkeypatch.chdir(tmp_path)
    write("i.png", from_rgb(np.arange(48, dtype=np.uint8).reshape(4, 4, 3), {"format": "unorm8"}))
    return tmp_path


def listing(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def bad_scene(folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    scene = TABLE.base()
    change(scene)
    path = folder / "bad.toml"
    path.write_text(to_toml(scene), encoding="utf-8")
    return path


def test_every_key_wrong_in_type_range_and_unit(folder: Path) -> None:
    """Some 300 scene files, through the command line."""
    cases = [(key, value) for _, key, value, _ in TABLE.cases()]
    cases += [(f"{key.rpartition('.')[0]}.{wrong}", 1.0) for key, _, _, wrong in TABLE.KEYS if wrong]
    assert len(cases) > 200
    for key, value in cases:
        path = bad_scene(folder, lambda scene, key=key, value=value: TABLE.put(scene, key, value))
        before = listing(folder)
        refused(run("render", path, "-o", "x.exr"), 2, "bad.toml", key)
        assert listing(folder) == before


@pytest.mark.parametrize("key", TABLE.REQUIRED)
def test_every_missing_key(folder: Path, key: str) -> None:
    def drop(scene: dict[str, Any]) -> None:
        *parents, last = key.replace("[", ".").replace("]", "").split(".")
        target: Any = scene
        for part in parents:
            target = target[int(part)] if part.isdigit() else target[part]
        del target[last]

    refused(run("validate", bad_scene(folder, drop)), 2, "bad.toml", f"{key}: missing")


PARAMETERS: list[tuple[str, str, list[str]]] = [
    ("beams", "interval_m", ["0", "-1", "1e7", "nan", "inf", "true", '"1 m"', "1e-7"]),
    ("beams", "delta_min_m", ["0", "-0.1", "1e7", "3.0", "nan", "[0.1]"]),
    ("beams", "delta_max_m", ["0", "0.01", "1e7", "inf", "two"]),
    ("beams", "v_ref_m", ["0", "-1", "1e9", "nan", "false"]),
    ("beams", "i_max", ["0", "-1", "1e7", "inf", "bright"]),
    ("beams", "interval_rule", ["last", "3", "true"]),
    ("beams", "plane_count", ["round", "23", "false"]),
    ("beams", "epsilon", ["0", "-0.01", "1e-12", "nan", "tiny"]),
    ("beams", "sub_plane_rule", ["round", "0"]),
    ("beams", "sub_plane_positions", ["middle", "1"]),
    ("beams", "sub_plane_weights", ["same", "[1, 1]"]),
    ("beams", "sub_plane_depth_test", ["1", "yes"]),
    ("beams", "f_h", ["printd", "0.5"]),
    ("beams", "q", ["tabel", "1"]),
    ("beams", "q_table_size", ["0", "1", "8193", "2.5", "big"]),
    ("beams", "q_least_v_m", ["0", "-1", "nan", "1e7"]),
    ("beams", "q_storage", ["clamp", "8"]),
    ("beams", "dt_mode", ["exact", "cosin", "0"]),
    ("beams", "base_distance_m", ["0", "-20", "[]", "[20, 20]", "[0]", "1e7", "nan", "far", "1e6"]),
    ("beams", "bounds", ["dept", "1"]),
    ("beams", "coordinates", ["vertices", "1"]),
    ("beams", "mesh", ["10", "[10]", "[0, 15]", "[10, 1025]", "[10.5, 15]", "fine"]),
    ("beams", "visibility", ["shadow", "1"]),
    ("beams", "shadow_map_size", ["0", "-1", "8193", "512.0", "10000000000"]),
    ("beams", "shadow_filter", ["linear", "4"]),
    ("beams", "shadow_bias_m", ["-0.1", "nan", "1e7", "none"]),
    ("beams", "shadow_near_m", ["0", "-1", "inf"]),
    ("beams", "light_distribution", ["map", "1"]),
    ("beams", "light_map_size", ["0", "9000", "1e2", "x"]),
    ("beams", "albedo_in_source", ["0", "no"]),
    ("beams", "scattering_angle", ["forwards", "1"]),
    ("beams", "surface_fog", ["none", "0"]),
    ("beams", "ambient", ["linear", "0.1"]),
    ("beams", "skip", ["1", "never"]),
    ("beams", "planes", ["40"]),
    ("beams_vertex", "planes", ["0", "-1", "4097", "1000000000", "40.0", "many"]),
    ("beams_vertex", "plane_positions", ["right", "0"]),
    ("beams_vertex", "epsilon", ["0.01"]),
    ("beams_vertex", "dt_mode", ["exakt"]),
    ("truth", "method", ["montecarlo", "1"]),
    ("truth", "rtol", ["0", "1", "1e-14", "nan"]),
    ("truth", "samples", ["0", "63", "65", "64.0", "100000000"]),
    ("truth", "seed", ["-1", "0.5"]),
    ("truth", "ambient", ["none"]),
    ("truth", "planes", ["40"]),
]


@pytest.mark.parametrize(("technique", "key", "values"), PARAMETERS, ids=lambda v: v if isinstance(v, str) else "")
def test_every_parameter_of_every_technique(folder: Path, technique: str, key: str, values: list[str]) -> None:
    scene = {"beams": "quick", "beams_vertex": "fig4a", "truth": "fig4d"}[technique]
    before = listing(folder)
    for value in values:
        done = run("render", scene, "--set", f"technique.{key}={value}", "-o", "x.exr")
        refused(done, 2, f"bundled scene {scene}: ", "technique", key if "needs" not in done.err else "main planes")
        assert listing(folder) == before


def test_nonsense_in_every_parameter_of_every_technique(folder: Path) -> None:
    """Values that no key takes; a technique that is added is tested without further edits."""
    from atmoref.cli.looking import parameter_models

    for technique, model in parameter_models().items():
        scene = bad_scene(folder, lambda scene, name=technique: scene.update(technique={"name": name}))
        for key in model.model_fields:
            for value in ("nan", "{ m = 1.0 }", '"no such word"', "1979-05-27"):
                done = run("render", scene, "--set", f"technique.{key}={value}", "-o", "x.exr")
                refused(done, 2, "bad.toml: ", f"technique.{key}")
    assert listing(folder) == {"bad.toml", "i.png"}


def test_the_table_knows_every_parameter() -> None:
    from atmoref.cli.looking import parameter_models

    models = parameter_models()
    for technique in {name for name, *_ in PARAMETERS}:
        known = {key for name, key, _ in PARAMETERS if name in (technique, technique.removesuffix("_vertex"))}
        assert set(models[technique].model_fields) <= known, technique


BIG = ("--set", "image.width=16000", "--set", "image.height=4000")
REQUESTS: list[tuple[str, int, tuple[str, ...]]] = [
    ("", 2, ("no command was given", "Usage")),
    ("rendr quick", 2, ("rendr", "did you mean 'render'")),
    ("render", 2, ("SCENE",)),
    ("render nowhere.toml", 2, ("nowhere.toml", "no such file")),
    ("render quik", 2, ("quik", "did you mean quick?")),
    ("render .", 2, ("directory",)),
    ("render /dev/null", 2, ("/dev/null",)),
    ("render i.png -o x.exr", 2, ("i.png",)),
    ("render quick extra", 2, ("extra",)),
    ("render quick --colour red", 2, ("--colour",)),
    ("render quick -o", 2, ("-o",)),
    ("render quick -o x.tif", 2, ("-o", "x.tif", ".exr, .npz, .png")),
    ("render quick -o x", 2, ("-o", ".exr")),
    ("render quick -o .", 2, ("-o",)),
    ("render quick -o missing/x.exr", 2, ("-o", "missing", "does not exist")),
    ("render quick -o /proc/x.exr", 3, ("/proc",)),
    ("render quick --png /proc/x.png", 3, ("/proc",)),
    ("render quick --stages /proc/x", 3, ("/proc",)),
    ("render quick --png x.exr", 2, ("--png", "x.exr", ".png")),
    ("render quick -o x.png --png x.png", 2, ("x.png",)),
    (
        "render quick -o x.exr --technique raytracing",
        2,
        ("quick", "--technique", "raytracing", "beams, beams_vertex", "truth"),
    ),
    ("render quick -o x.exr --technique beam", 2, ("--technique", "did you mean beams?")),
    ("render quick -o x.exr --technique truth --stages st", 2, ("--stages", "truth")),
    ("render quick -o x.exr --stages i.png", 2, ("--stages", "i.png")),
    ("render quick -o x.exr --stages .", 2, ("--stages",)),
    ("render quick -o x.exr --stages missing/st", 2, ("--stages", "missing")),
    ("render quick -o x.exr --threads 0", 2, ("--threads",)),
    ("render quick -o x.exr --threads -3", 2, ("--threads",)),
    ("render quick -o x.exr --threads 1.5", 2, ("--threads",)),
    ("render quick -o x.exr --threads 1000000000", 2, ("--threads",)),
    ("render quick -o x.exr --max-memory 0", 2, ("--max-memory", "500MB")),
    ("render quick -o x.exr --max-memory -1GB", 2, ("--max-memory",)),
    ("render quick -o x.exr --max-memory 5XB", 2, ("--max-memory", "5XB")),
    ("render quick -o x.exr --max-memory nan", 2, ("--max-memory",)),
    ("render quick -o x.exr --max-memory 1MB", 3, ("quick", "120 x 180", "--max-memory")),
    ("render quick -o x.exr --technique truth --max-memory 1MB", 3, ("quick", "120 x 180", "--max-memory")),
    ("render quick -o x.exr --max-memory 300MB --set technique.shadow_map_size=8192", 3, ("shadow_map",)),
    ("render quick -o x.exr --crop 0,0,0,5", 2, ("quick", "crop", "120 x 180")),
    ("render quick -o x.exr --crop 100,100,21,5", 2, ("quick", "crop")),
    ("render quick -o x.exr --crop -1,0,5,5", 2, ("--crop",)),
    ("render quick -o x.exr --crop 1,2,3", 2, ("--crop", "X,Y,WIDTH,HEIGHT")),
    ("render quick -o x.exr --crop 1e3,0,5,5", 2, ("--crop",)),
    ("render fig4d -o x.exr --crop 299,0,2,1", 2, ("fig4d", "crop")),
    ("render quick -o x.exr --stats xml", 2, ("--stats", "json")),
    ("render quick -o x.exr --exposure 0", 2, ("--exposure",)),
    ("render quick -o x.exr --exposure nan", 2, ("--exposure",)),
    ("render quick -o x.exr --set image.width", 2, ("quick", "image.width", "key.path=value")),
    ("render quick -o x.exr --set image.width=", 2, ("quick", "image.width")),
    ("render quick -o x.exr --set image.width=0", 2, ("quick", "image.width", "found 0")),
    ("render quick -o x.exr --set image.width=1e3", 2, ("quick", "image.width")),
    ("render quick -o x.exr --set lights.3.peak=0.5", 2, ("quick", "lights", "0 to 0")),
    ("render quick -o x.exr --set ligths.0.peak=0.5", 2, ("quick", "ligths")),
    ("render quick -o x.exr --set camera.vertical_fov_deg=179", 2, ("quick", "camera.vertical_fov_deg", "<= 170")),
    ("render quick -o x.exr --set lights.0.outer_half_angle_deg=0", 2, ("quick", "lights[0].outer_half_angle_deg")),
    ("render quick -o x.exr --set lights.0.outer_half_angle_deg=179", 2, ("lights[0].outer_half_angle_deg", "<= 89")),
    ("render quick -o x.exr --set camera.position_m=[0,8,1]", 2, ("camera.position_m", "inside objects[0] (sphere")),
    ("render quick -o x.exr --set camera.look_at_m=[0,14,-45]", 2, ("camera.look_at_m",)),
    ("render quick -o x.exr --set medium.extinction_per_m=nan", 2, ("medium.extinction_per_m", "nan")),
    ("render quick -o x.exr --set medium.extinction_per_m=-inf", 2, ("medium.extinction_per_m", "-inf")),
    ("render quick -o x.exr --set buffers.format=depth24", 2, ("quick", "buffers.format", "depth24", "unorm8")),
    ("render quick -o x.exr --set buffers.fh.format=unorm8", 2, ("quick", "buffers.fh", "no such buffer")),
    ("render quick -o x.exr --set buffers.frame.format=unorm8", 2, ("quick", "buffers.frame")),
    ("render quick -o x.exr --set buffers.depth.format=unorm8", 2, ("quick", "buffers.depth.format", "depth24")),
    ("render fig4a -o x.exr --set buffers.q.format=unorm8", 2, ("fig4a", "buffers.q", "vertex_colour")),
    (
        "render quick -o x.exr --set buffers.device=gl_llvmpipe --set buffers.rounding=truncate",
        2,
        ("quick", "buffers.rounding", "truncate", "gl_llvmpipe"),
    ),
    ("render quick -o x.exr --set lights.0.radiant_intensity_w_per_sr=1e21", 2, ("lights[0].radiant_intensity_w_per",)),
    ("trace quick", 2, ("--pixel",)),
    ("trace quick --pixel 5", 2, ("--pixel",)),
    ("trace quick --pixel 120 0", 2, ("quick", "--pixel", "0 to 119")),
    ("trace quick --pixel -1 0", 2, ("--pixel",)),
    ("trace quick --pixel a b", 2, ("--pixel",)),
    ("trace fig4d --pixel 1 1", 2, ("fig4d", "no draws")),
    ("compare i.png", 2, ("REFERENCE",)),
    ("compare i.png missing.exr", 2, ("missing.exr", "no such file")),
    ("compare i.png i.png --abs -1", 2, ("abs",)),
    ("compare i.png i.png --rel nan", 2, ("rel",)),
    ("compare i.png i.png --codes 0.5", 2, ("--codes",)),
    ("compare i.png i.png --bounds i.png", 2, ("--bounds",)),
    ("compare i.png i.png --layer deep", 2, ("i.png", "deep")),
    ("compare i.png i.png --mask i.png", 2, ("mask",)),
    ("compare i.png i.png --picture x.tif", 2, ("--picture", "x.tif")),
    ("compare i.png i.png --report x.pdf", 2, ("--report", "x.pdf", ".json")),
    ("compare i.png i.png --report missing/x.txt", 2, ("--report", "missing")),
    ("info missing.exr", 2, ("missing.exr", "no such file")),
    ("info missing", 2, ("missing",)),
    ("scenes quik", 2, ("quik", "quick")),
    ("techniques beam", 2, ("beam", "did you mean beams?")),
    ("validate quick --technique nothing", 2, ("quick", "--technique", "nothing")),
    ("validate quick --set buffers.fh.format=unorm8", 2, ("quick", "buffers.fh")),
    ("tables", 2, ("no command was given",)),
    ("tables burn", 2, ("burn",)),
    ("tables build quik", 2, ("quik",)),
    ("budget quik", 2, ("quik",)),
    ("budget fig4d", 2, ("fig4d", "truth")),
    ("budget quick -o i.png", 2, ("i.png",)),
    ("demo -o i.png", 2, ("i.png",)),
    ("demo -o /proc/x", 3, ("/proc/x",)),
    (" ".join(("render quick -o x.exr --max-memory 500MB", *BIG)), 3, ("quick", "16000 x 4000", "500 MB")),
    (" ".join(("render fig4d -o x.exr --max-memory 500MB", *BIG)), 3, ("fig4d", "16000 x 4000", "500 MB")),
]


@pytest.mark.parametrize(("line", "code", "fragments"), REQUESTS, ids=[line for line, *_ in REQUESTS])
def test_wrong_requests(folder: Path, line: str, code: int, fragments: tuple[str, ...]) -> None:
    before = listing(folder)
    start = time.monotonic()
    done = run(*line.split())
    refused(done, code, *(fragment for fragment in fragments if "did you mean" not in fragment))
    for fragment in fragments:
        assert fragment.lower() in done.err.lower()
    assert listing(folder) == before
    assert time.monotonic() - start < 60.0


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        (b"", "missing"),
        (b"\x00\x01\xff\xfe" * 100, "not a text file"),
        (b"schema = 1\nschema = 1\n", "line 2"),
        (b"schema = 1\n[image\n", "line 2"),
        (b"a = " + b"[" * 100_000, "nested too deeply"),
        (b"#" * 1_100_000, "1000000"),
        (b"schema = 99\n", "schema: found 99"),
        (b"\xef\xbb\xbfschema = 1\n", "image: missing"),
    ],
)
def test_files_that_are_no_scenes(folder: Path, content: bytes, fragment: str) -> None:
    (folder / "bad.toml").write_bytes(content)
    before = listing(folder)
    refused(run("render", "bad.toml", "-o", "x.exr"), 2, "bad.toml", fragment)
    assert listing(folder) == before


def test_an_unreadable_name_is_one_message(folder: Path) -> None:
    refused(run("render", "a\0b", "-o", "x.exr"), 2)
    refused(run("render", "x" * 5000), 2)
    refused(run("render", "\udcff\udcfe.toml"), 2)


def test_a_wrong_lane_width_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ATMOREF_LANES", "7")
    refused(run("render", "quick"), 2, "ATMOREF_LANES", "'7'", "1, 2, 4, 8, 16, 32")


def test_a_defect_is_one_message_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("here")

    monkeypatch.setattr("atmoref.scene.load_scene", broken)
    done = run("validate", "quick")
    assert done.code == 3
    assert done.err.count("\n") == 1
    assert "ZeroDivisionError: here (a defect of atmoref" in done.err
    monkeypatch.setenv("ATMOREF_TRACEBACK", "1")
    assert "Traceback" in run("validate", "quick").err


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (MemoryError(), 3, "out of memory"),
        (OSError(28, "No space left on device", "x.exr"), 3, "x.exr: No space left on device"),
        (PermissionError(13, "Permission denied", "/root/x"), 3, "/root/x: Permission denied"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_what_the_machine_refuses(monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int, text: str) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("atmoref.scene.load_scene", fail)
    done = run("validate", "quick")
    assert done.code == code
    assert text in done.err
    assert "Traceback" not in done.err
