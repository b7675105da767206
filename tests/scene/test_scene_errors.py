"""Wrong scene files: every key wrong in type, range and unit gives one message with file, key path, found, allowed."""

import math
import time
from pathlib import Path
from typing import Any, Literal

import pytest

from atmoref.scene import SceneError, load_scene, parse_model, scene_from_mapping
from atmoref.scene.emit import to_toml
from atmoref.scene.fields import Table, quantity
from atmoref.scene.overrides import apply_overrides


def base() -> dict[str, Any]:
    """Return a correct scene with every key set."""
    return {
        "schema": 1,
        "image": {"width": 30, "height": 45, "wavelengths_nm": [680.0, 550.0, 440.0]},
        "camera": {
            "type": "perspective",
            "position_m": [0.0, 14.0, -45.0],
            "look_at_m": [0.0, 14.0, 0.0],
            "up": [0.0, 1.0, 0.0],
            "vertical_fov_deg": 36.0,
            "near_m": 0.1,
            "far_m": 1000.0,
        },
        "lights": [
            {
                "type": "spot",
                "position_m": [0.0, 20.0, 0.0],
                "direction": [0.0, -1.0, 0.0],
                "inner_half_angle_deg": 20.0,
                "outer_half_angle_deg": 34.0,
                "falloff": "smoothstep_cosine",
                "peak": 0.99,
                "radiant_intensity_w_per_sr": 9430.0,
            }
        ],
        "medium": {
            "extinction_per_m": 0.02,
            "single_scattering_albedo": 0.9,
            "phase_function": {"type": "henyey_greenstein", "g": 0.3},
            "ambient_radiance": 0.0,
        },
        "objects": [
            {"type": "sphere", "center_m": [0.0, 8.0, 0.0], "radius_m": 2.0, "albedo": 0.05},
            {"type": "box", "min_m": [3.0, 0.0, 0.0], "max_m": [4.0, 1.0, 1.0], "albedo": [0.1, 0.2, 0.3]},
            {"type": "ground", "height_m": 0.0, "albedo": 0.2},
        ],
        "technique": {"name": "beams", "preset": "paper", "delta_min_m": 0.1},
        "buffers": {
            "format": "unorm8",
            "arithmetic": "float32",
            "device": "ideal",
            "rounding": "half_up",
            "f_h": {"format": "unorm12"},
        },
    }


NUMBER, VECTOR, CHANNELS, INTEGER = "a finite number", "a list of three finite numbers", "one ", "an integer"
FORMATS = '"unorm8", "unorm10"'
# key, what is allowed, values out of range, the same key in a wrong unit or misspelt
KEYS: list[tuple[str, str, list[Any], str]] = [
    ("image.width", "an integer (pixels), >= 1, <= 16384", [0, -3, 16385, 10**9, 10**400, 300.0], "width_px"),
    ("image.height", "an integer (pixels), >= 1, <= 16384", [0, -1, 20000, 45.5], "heigth"),
    ("image.wavelengths_nm", "(nm)", [[680.0, 550.0], [0.0, 550.0, 440.0], 550.0], "wavelengths_um"),
    ("camera.type", '"perspective"', ["fisheye", "orthographic"], "kind"),
    ("camera.position_m", VECTOR, [[0.0, 1.0], [0.0, 1.0, 2.0, 3.0], [1e10, 0.0, 0.0]], "position_km"),
    ("camera.look_at_m", VECTOR, [[1.0], [0.0, -2e9, 0.0]], "look_at_ft"),
    ("camera.up", VECTOR, [[0.0, 1.0], [1e300, 0.0, 0.0]], "upwards"),
    ("camera.vertical_fov_deg", "(degrees), >= 0.01, <= 170", [0, 0.0, -36.0, 179.0, 180, 360.0], "vertical_fov_rad"),
    ("camera.near_m", "(m), >= 1e-6", [0.0, -1.0, 2e9], "near_cm"),
    ("camera.far_m", "(m), >= 1e-6, <= 1e9", [0.0, -5.0, 1e10], "far_km"),
    ("lights[0].type", '"spot", "projector", "sun"', ["point", "SPOT"], "kind"),
    ("lights[0].position_m", VECTOR, [[], [1.0, 2.0], [-1e12, 0.0, 0.0]], "position"),
    ("lights[0].direction", VECTOR, [[0.0, 1.0], [2e9, 0.0, 0.0]], "direction_m"),
    ("lights[0].inner_half_angle_deg", "(degrees), > 0, <= 89", [0.0, -1.0, 90.0], "inner_half_angle_rad"),
    ("lights[0].outer_half_angle_deg", "(degrees), > 0, <= 89", [0, 89.5, 179, -34.0], "outer_half_angle_rad"),
    ("lights[0].falloff", '"linear_angle", "none"', ["linear", "smoothstep"], "fall_off"),
    ("lights[0].peak", "> 0, <= 1", [0.0, -0.5, 1.0001, 99], "peek"),
    ("lights[0].radiant_intensity_w_per_sr", "(W/sr)", [-1.0, 1e21, [1.0, 2.0], [1.0, 2.0, -3.0]], "radiant_intensity"),
    ("medium.extinction_per_m", "(1/m)", [-0.02, 1e7, [0.02, 0.02], [0.1, 0.1, -1e-9]], "extinction_per_km"),
    ("medium.single_scattering_albedo", ">= 0 and <= 1", [-0.1, 1.5, [0.5, 2.0, 0.5]], "single_scatering_albedo"),
    ("medium.ambient_radiance", "(W/(m2 sr))", [-1.0, 1e30], "ambient"),
    ("medium.phase_function.type", '"henyey_greenstein", "rayleigh"', ["mie", "hg"], "kind"),
    ("medium.phase_function.g", "> -1, < 1", [-1, 1.0, 1, 7.5], "g_per_m"),
    ("objects[0].type", '"sphere", "box", "ground", "mesh", "height_field"', ["teapot", "spher"], "kind"),
    ("objects[0].center_m", VECTOR, [[0.0], [0.0, 0.0, 1e12]], "centre_m"),
    ("objects[0].radius_m", "(m), > 0", [0.0, -2.0, 1e12], "radius_mm"),
    ("objects[0].albedo", ">= 0 and <= 1", [-0.05, 1.05, [0.1, 0.1]], "albdo"),
    ("objects[1].min_m", VECTOR, [[0.0], [5e9, 0.0, 0.0]], "min_km"),
    ("objects[1].max_m", VECTOR, [[4.0, 1.0], [5e9, 2.0, 2.0]], "max"),
    ("objects[1].albedo", ">= 0 and <= 1", [2, [0.1, 0.1, 1.1]], "albedos"),
    ("objects[2].height_m", "(m), >= -1e9", [1e10, -1e10], "height_km"),
    ("objects[2].albedo", ">= 0 and <= 1", [1.01, -1], "albedo_percent"),
    ("technique.name", "text of lower-case letters", ["", "Beams", "beams\n", "no such thing", "../beams"], ""),
    ("technique.preset", '"paper", "corrected", "analysis"', ["best", "papre"], ""),
    ("buffers.format", FORMATS, ["unorm9", "rgba8", "half"], "frmat"),
    ("buffers.arithmetic", '"float32", "float64"', ["float16", "double"], "arithmetics"),
    ("buffers.device", '"ideal", "gl_llvmpipe", "geforce3", "geforce_fx"', ["rtx", "geforce"], "devise"),
    ("buffers.rounding", '"nearest_even", "half_up", "truncate"', ["up", "nearest"], "round"),
    ("buffers.f_h.format", FORMATS, ["unorm7"], "form"),
]


def cases() -> list[tuple[str, str, Any, str]]:
    """Return (case id, key path, bad value, allowed) for wrong type, range, NaN and infinity of every key."""
    rows: list[tuple[str, str, Any, str]] = []
    for key, permitted, out_of_range, _ in KEYS:
        numeric = not isinstance(out_of_range[0], str)
        wrong_types: list[Any] = [True, "36 deg", {"m": 1.0}] if numeric else [3, True, ["spot"]]
        if numeric:
            wrong_types += [math.nan, math.inf, -math.inf]
        rows += [(f"{key}={str(value)[:30]}", key, value, permitted) for value in [*out_of_range, *wrong_types]]
    return rows


def put(scene: dict[str, Any], key: str, value: Any) -> None:
    """Set the value at a key path."""
    *parents, last = key.replace("[", ".").replace("]", "").split(".")
    target: Any = scene
    for part in parents:
        target = target[int(part)] if part.isdigit() else target[part]
    target[last] = value


def message(path: Path) -> str:
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    cause = caught.value
    assert cause.__suppress_context__ or cause.__context__ is None, "the cause would be printed too"
    return str(caught.value)


def write(tmp_path: Path, scene: dict[str, Any]) -> Path:
    path = tmp_path / "bad.toml"
    path.write_text(to_toml(scene), encoding="utf-8")
    return path


def test_the_base_is_correct(tmp_path: Path) -> None:
    assert load_scene(write(tmp_path, base())).name == "bad"


def test_the_table_knows_every_key() -> None:
    """A new key must come with its bad values."""
    known = {key.replace("[0]", "").replace("[1]", "").replace("[2]", "") for key, *_ in KEYS}
    present = set()
    for table, content in base().items():
        for entry in content if isinstance(content, list) else [content] if isinstance(content, dict) else []:
            for name, value in entry.items():
                below = value if isinstance(value, dict) else {"": None}
                present |= {".".join(filter(None, (table, name, leaf))) for leaf in below}
    assert present - known == {"technique.delta_min_m"}
    assert len(cases()) > 60


@pytest.mark.parametrize(("key", "value", "permitted"), [row[1:] for row in cases()], ids=[row[0] for row in cases()])
def test_a_bad_value_is_named(tmp_path: Path, key: str, value: Any, permitted: str) -> None:
    scene = base()
    put(scene, key, value)
    text = message(write(tmp_path, scene))
    assert "bad.toml: " in text
    assert "\n" not in text, "one problem, one line"
    assert key in text
    assert "found " in text or "missing" in text
    assert "allowed" in text or "needed" in text
    assert permitted in text
    assert len(text) < 600
    assert "pydantic" not in text
    assert "Input should" not in text


@pytest.mark.parametrize(("key", "wrong"), [(key, wrong) for key, _, _, wrong in KEYS if wrong])
def test_a_wrong_unit_or_spelling_is_an_unknown_key(tmp_path: Path, key: str, wrong: str) -> None:
    """The key in another unit is unknown; the message lists the known ones and, where close, says which is meant."""
    scene = base()
    stem, _, name = key.rpartition(".")
    put(scene, f"{stem}.{wrong}", 1.0)
    text = message(write(tmp_path, scene))
    assert f"{stem}.{wrong}: unknown key" in text
    assert "found 1.0" in text
    assert name in text.split("allowed here: ")[1]
    if wrong not in ("kind", "upwards"):
        assert f"did you mean {name}?" in text


REQUIRED = [
    "schema",
    "image",
    "image.width",
    "image.height",
    "camera",
    "camera.position_m",
    "camera.look_at_m",
    "camera.vertical_fov_deg",
    "lights",
    "lights[0].type",
    "lights[0].position_m",
    "lights[0].direction",
    "lights[0].inner_half_angle_deg",
    "lights[0].outer_half_angle_deg",
    "lights[0].radiant_intensity_w_per_sr",
    "medium",
    "medium.extinction_per_m",
    "medium.single_scattering_albedo",
    "medium.phase_function.g",
    "objects[0].type",
    "objects[0].center_m",
    "objects[0].radius_m",
    "objects[0].albedo",
    "objects[1].min_m",
    "objects[1].max_m",
    "objects[2].albedo",
    "buffers.f_h.format",
]


@pytest.mark.parametrize("key", REQUIRED)
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    scene = base()
    *parents, last = key.replace("[", ".").replace("]", "").split(".")
    target: Any = scene
    for part in parents:
        target = target[int(part)] if part.isdigit() else target[part]
    del target[last]
    text = message(write(tmp_path, scene))
    assert f"bad.toml: {key}: missing; needed" in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("changes", "fragments"),
    [
        ({"image.width": 16384, "image.height": 16384}, ["image", "16384 x 16384", "<= 67108864 pixels"]),
        ({"camera.look_at_m": [0.0, 14.0, -45.0]}, ["camera.look_at_m", "another point"]),
        ({"camera.up": [0.0, 0.0, 0.0]}, ["camera.up", "non-zero"]),
        ({"camera.up": [0.0, 0.0, -2.0]}, ["camera.up", "parallel to the view"]),
        ({"camera.near_m": 5.0, "camera.far_m": 5.0}, ["camera.near_m", "found 5.0", "less than far_m, which is 5.0"]),
        ({"lights[0].inner_half_angle_deg": 35.0}, ["lights[0].inner_half_angle_deg", "35.0", "which is 34.0"]),
        ({"lights[0].direction": [0.0, 0.0, 0.0]}, ["lights[0].direction", "non-zero"]),
        ({"lights[0].position_m": [0.0, 14.0, -45.0]}, ["lights[0].position_m", "the camera's position"]),
        ({"lights[0].position_m": [0.0, 9.0, 0.0]}, ["lights[0].position_m", "inside objects[0] (sphere"]),
        ({"lights[0].position_m": [3.5, 0.5, 0.5]}, ["lights[0].position_m", "inside objects[1] (box"]),
        ({"camera.position_m": [0.0, 8.5, 0.5]}, ["camera.position_m", "inside objects[0] (sphere", "a point outside"]),
        ({"camera.position_m": [0.0, 8.0, 2.0]}, ["camera.position_m", "inside objects[0] (sphere"]),
        ({"camera.position_m": [3.5, 0.5, 0.5]}, ["camera.position_m", "inside objects[1] (box", "[4.0, 1.0, 1.0]"]),
        ({"camera.position_m": [3.0, 0.5, 0.5]}, ["camera.position_m", "inside objects[1] (box"]),
        ({"camera.position_m": [9.0, 0.0, 9.0]}, ["camera.position_m", "in the plane of objects[2] (ground"]),
        ({"objects[1].max_m": [4.0, 0.0, 1.0]}, ["objects[1].min_m", "in every coordinate"]),
        ({"objects[1].max_m": [2.0, 1.0, 1.0]}, ["objects[1].min_m", "less than max_m = [2.0, 1.0, 1.0]"]),
        ({"medium.phase_function": {"type": "rayleigh", "g": 0.3}}, ["medium.phase_function.g", "no g with rayleigh"]),
        ({"medium.phase_function": {"g": 0.3}}, ["medium.phase_function.g", "no g with isotropic"]),
        ({"lights": []}, ["lights", "one or more [[lights]]", '"spot"']),
        ({"lights": {"type": "spot"}}, ["lights", "found a table", "one or more [[lights]]"]),
        ({"objects": "sphere"}, ["objects", '"sphere"', "[[objects]] tables"]),
        ({"objects": [3]}, ["objects[0]", "found 3", "[[objects]] tables"]),
        ({"medium": 0.02}, ["medium", "found 0.02", "extinction_per_m"]),
        ({"medium.phase_function": "isotropic"}, ["medium.phase_function", "a table with the keys type, g"]),
        ({"technique": "beams"}, ["technique", '"beams"', "a table with the keys name, preset"]),
        ({"buffers": 8}, ["buffers", "found 8", "a table"]),
        ({"buffers.f_h": "unorm8"}, ["buffers.f_h", '"unorm8"', "format"]),
        ({"technique.delta_min_m": math.nan}, ["technique.delta_min_m", "found nan", "a finite number"]),
        ({"technique.sizes": [1.0, math.inf]}, ["technique.sizes[1]", "found inf"]),
        ({"schema": 2}, ["schema", "found 2", "allowed: 1"]),
        ({"schema": True}, ["schema", "found true", "allowed: 1"]),
        ({"schema": "1"}, ["schema", 'found "1"', "allowed: 1"]),
        ({"light": {}}, ["light: unknown key (did you mean lights?)", "allowed here: schema, image, camera"]),
        ({"sun": {"elevation_deg": 5.0}}, ["sun: unknown key", "lights, medium, objects, technique, buffers"]),
    ],
)
def test_contradictions_and_shapes_are_named(tmp_path: Path, changes: dict[str, Any], fragments: list[str]) -> None:
    scene = base()
    for key, value in changes.items():
        put(scene, key, value)
    text = message(write(tmp_path, scene))
    assert "bad.toml: " in text
    assert "\n" not in text
    for fragment in fragments:
        assert fragment in text


def test_several_problems_are_listed_each_on_a_line(tmp_path: Path) -> None:
    scene = base()
    put(scene, "image.width", 0)
    put(scene, "lights[0].peak", 2.0)
    put(scene, "objects[1].type", "teapot")
    put(scene, "objects[1].path", "teapot.obj")
    put(scene, "medium.extinction", 0.1)
    first, *lines = message(write(tmp_path, scene)).split("\n")
    assert first.endswith("bad.toml: 4 problems")
    keys = [line.strip().split(": ")[0] for line in lines]
    assert keys == ["image.width", "lights[0].peak", "medium.extinction", "objects[1].type"]


def test_a_flood_of_problems_is_cut(tmp_path: Path) -> None:
    scene = base()
    scene["objects"] = [{"type": "sphere", "center_m": [0, 0, 0], "radius_m": -1, "albedo": 3}] * 500
    text = message(write(tmp_path, scene))
    assert "1000 problems" in text
    assert "… and 980 more" in text
    assert len(text) < 5000


def test_a_file_full_of_problems_is_answered_at_once(tmp_path: Path) -> None:
    """Linear in the number of problems: a quadratic search takes minutes here."""
    path = write(tmp_path, base())
    with path.open("a", encoding="utf-8") as file:
        file.write("[technique.deep]\n")
        file.writelines(f"k{index} = nan\n" for index in range(20_000))
        file.writelines('[[objects]]\ntype="sphere"\nradius_m="x"\n' for _ in range(10_000))
    start = time.process_time()
    assert "problems" in message(path)
    assert time.process_time() - start < 20.0


def test_overrides_of_a_bad_kind_name_the_same_key(tmp_path: Path) -> None:
    path = write(tmp_path, base())
    with pytest.raises(SceneError, match=r"lights\[0\]\.peak: found 7; allowed: a finite number, > 0, <= 1"):
        load_scene(path, ["lights.0.peak=7"])


class Parameters(Table):
    """Parameters of an imagined technique, with every kind of field one may use."""

    planes: int = quantity("", "Count.", 40, ge=1, le=1000)
    delta_min_m: float = quantity("m", "Step.", 0.1, gt=0.0)
    base_distance_m: float | list[float] = quantity("m", "Length.", 20.0)
    rule: Literal["floor", "ceil"] = quantity("", "Rounding.", "floor")
    clamp: bool = quantity("", "Whether.", True)
    limit: float | None = quantity("", "Maybe.", None)


@pytest.mark.parametrize(
    ("mapping", "fragments"),
    [
        ({"planes": 10**9}, ["technique.planes: found 1000000000", "an integer, >= 1, <= 1000"]),
        ({"planes": 3.5}, ["technique.planes: found 3.5", "an integer"]),
        ({"delta_min_m": "x"}, ['technique.delta_min_m: found "x"', "a finite number (m), > 0"]),
        ({"base_distance_m": "x"}, ["technique.base_distance_m", "a finite number (m) or a list of (a finite number"]),
        ({"base_distance_m": [1.0, "x"]}, ["technique.base_distance_m[1]", 'found "x"']),
        ({"rule": "flor"}, ["technique.rule", 'one of "floor", "ceil" (did you mean floor?)']),
        ({"clamp": 1}, ["technique.clamp: found 1", "true or false"]),
        ({"limit": "none"}, ["technique.limit", "a finite number"]),
        ({"presett": "paper"}, ["technique.presett: unknown key (did you mean preset?)", "planes"]),
        ({"plane": 3}, ["technique.plane: unknown key (did you mean planes?)"]),
    ],
)
def test_techniques_get_the_same_messages(mapping: dict[str, Any], fragments: list[str]) -> None:
    with pytest.raises(SceneError) as caught:
        parse_model(Parameters, mapping, "fig.toml", "technique", known=("name", "preset"))
    for fragment in ["fig.toml: ", *fragments]:
        assert fragment in str(caught.value)
    assert "\n" not in str(caught.value)


def test_values_that_no_toml_holds_are_refused() -> None:
    scene = base()
    scene["technique"]["when"] = object()
    with pytest.raises(SceneError, match=r"technique\.when: found .*; allowed: numbers, text"):
        scene_from_mapping(scene)


def test_applying_overrides_leaves_the_source_alone() -> None:
    scene = base()
    apply_overrides(scene, ["lights.0.peak=0.5"], "x")
    assert scene == base()
