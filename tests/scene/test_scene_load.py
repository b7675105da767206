"""Reading scene files: hostile files, overrides, bundled scenes, digest, import."""

import errno
import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from atmoref.scene import SceneError, bundled_names, bundled_text, load_scene, parse_scene, scene_from_mapping

MINIMAL = """
schema = 1
[image]
width = 4
height = 3
[camera]
position_m = [0, 0, -5]
look_at_m = [0, 0, 0]
vertical_fov_deg = 40
[[lights]]
type = "spot"
position_m = [0, 3, 0]
direction = [0, -1, 0]
inner_half_angle_deg = 10
outer_half_angle_deg = 20
radiant_intensity_w_per_sr = 1
[medium]
extinction_per_m = 0
single_scattering_albedo = 1
"""


def message(path: str | Path, *overrides: str) -> str:
    with pytest.raises(SceneError) as caught:
        load_scene(path, overrides)
    return str(caught.value)


def test_defaults_are_as_documented() -> None:
    scene = parse_scene(MINIMAL)
    assert scene.image.wavelengths_nm == (680.0, 550.0, 440.0)
    assert (scene.camera.type, scene.camera.up) == ("perspective", (0.0, 1.0, 0.0))
    assert (scene.camera.near_m, scene.camera.far_m) == (0.1, 1000.0)
    light = scene.lights[0]
    assert (light.falloff, light.peak) == ("smoothstep_cosine", 1.0)
    assert light.radiant_intensity_w_per_sr == (1.0, 1.0, 1.0)
    assert (scene.medium.phase_function.type, scene.medium.phase_function.g) == ("isotropic", 0.0)
    assert scene.medium.ambient_radiance == (0.0, 0.0, 0.0)
    assert scene.objects == ()
    assert (scene.technique.name, scene.technique.preset, scene.technique.parameters) == (None, "corrected", {})
    buffers = scene.buffers
    assert (buffers.format, buffers.arithmetic, buffers.device, buffers.rounding) == (None, None, "ideal", None)
    assert buffers.per_buffer == {}


def test_integers_become_floats_and_one_number_three_channels() -> None:
    scene = parse_scene(MINIMAL)
    assert all(isinstance(value, float) for value in (*scene.camera.position_m, scene.camera.vertical_fov_deg))
    assert scene.medium.extinction_per_m == (0.0, 0.0, 0.0)


def test_limits_themselves_are_allowed() -> None:
    scene = parse_scene(
        MINIMAL,
        [
            "image.width=16384",
            "image.height=4096",
            "camera.vertical_fov_deg=170",
            "lights.0.inner_half_angle_deg=89",
            "lights.0.outer_half_angle_deg=89",
            "medium.extinction_per_m=1e6",
            'medium.phase_function={type="cornette_shanks", g=-0.999999}',
        ],
    )
    assert scene.image.width * scene.image.height == 1 << 26
    assert parse_scene(MINIMAL, ["image.width=1", "image.height=1", "camera.vertical_fov_deg=0.01"]).image.width == 1


def test_scenes_are_frozen_and_parameters_are_copies() -> None:
    scene = load_scene("fig4c")
    with pytest.raises(ValueError, match="frozen"):
        scene.image.width = 3  # type: ignore[misc]
    scene.technique.parameters["epsilon"] = 7
    assert scene.technique.parameters["epsilon"] == 0.01


def test_bundled_scenes_are_found_by_name() -> None:
    assert set(bundled_names()) >= {"fig4a", "fig4b", "fig4c", "fig4d", "two_lights", "quick"}
    for name in bundled_names():
        scene = load_scene(name)
        assert (scene.name, scene.path is not None and scene.path.name) == (name, f"{name}.toml")
        assert bundled_text(name).startswith("# "), "says what it shows"


@pytest.mark.parametrize("name", ["fig4a", "fig4b", "fig4c", "fig4d"])
def test_figure_4_is_parameter_set_f4(name: str) -> None:
    """Dobashi et al. 2002, Fig. 4: the paper gives 20 m, 300x450, 40 and 160 planes; the rest is the reconstruction."""
    scene = load_scene(name)
    (light,) = scene.lights
    sphere, ground = scene.objects
    assert (scene.image.width, scene.image.height) == (300, 450)
    assert (scene.camera.position_m, scene.camera.vertical_fov_deg) == ((0.0, 14.0, -45.0), 36.0)
    assert scene.camera.basis() == ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    assert (light.position_m, light.axis()) == ((0.0, 20.0, 0.0), (0.0, -1.0, 0.0))
    assert (light.inner_half_angle_deg, light.outer_half_angle_deg, light.peak) == (20.0, 34.0, 0.99)
    assert (light.falloff, light.radiant_intensity_w_per_sr) == ("smoothstep_cosine", (9430.0,) * 3)
    assert (scene.medium.extinction_per_m, scene.medium.single_scattering_albedo) == ((0.02,) * 3, (0.9,) * 3)
    assert (scene.medium.phase_function.type, scene.medium.ambient_radiance) == ("isotropic", (0.0, 0.0, 0.0))
    assert sphere.model_dump() == {
        "type": "sphere",
        "center_m": (0.0, 8.0, 0.0),
        "radius_m": 2.0,
        "albedo": (0.05,) * 3,
    }
    assert ground.model_dump() == {"type": "ground", "height_m": 0.0, "albedo": (0.2,) * 3}
    technique = {"fig4a": "beams_vertex", "fig4b": "beams_vertex", "fig4c": "beams", "fig4d": "truth"}[name]
    assert scene.technique.name == technique
    assert scene.technique.parameters.get("planes") == {"fig4a": 40, "fig4b": 160}.get(name)


def test_the_four_figures_and_quick_ask_the_same_question() -> None:
    questions = [
        [part for part in (scene.camera, *scene.lights, scene.medium, *scene.objects)]
        for scene in map(load_scene, ("fig4a", "fig4b", "fig4c", "fig4d", "quick"))
    ]
    assert all(question == questions[0] for question in questions)


def test_a_path_finds_a_file_and_a_name_wins_over_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("quick").write_text(MINIMAL, encoding="utf-8")
    assert load_scene("quick").image.width == 120
    assert load_scene("./quick").image.width == 4
    assert load_scene(Path("quick")).image.width == 4
    Path("mine.toml").write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    scene = load_scene("mine.toml")
    assert (scene.name, scene.path, scene.origin) == ("mine", Path("mine.toml"), "mine.toml")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    assert "did you mean fig4a" in message(tmp_path / "fig4.toml")
    assert "no such file or bundled scene" in message("qick")
    assert "did you mean quick?" in message("qick")
    assert all(name in message("nothing_like_it") for name in bundled_names())
    assert "is a directory" in message(tmp_path)
    assert "not a file name" in message("a\0b.toml")
    assert "cannot be read" in message("x" * 5000)
    (tmp_path / "file").write_text(MINIMAL, encoding="utf-8")
    assert "no such file" in message(tmp_path / "file" / "below.toml")
    os.mkfifo(tmp_path / "pipe.toml")
    assert "not a regular file" in message(tmp_path / "pipe.toml")
    assert "not a regular file" in message("/dev/zero")


def test_files_that_the_system_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop = tmp_path / "loop.toml"
    loop.symlink_to(loop)
    assert "cannot be read: " in message(loop)
    path = tmp_path / "secret.toml"
    path.write_text(MINIMAL, encoding="utf-8")

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")  # root may read everything, so chmod shows nothing

    monkeypatch.setattr(Path, "open", refuse)
    assert "secret.toml: cannot be read: Permission denied" in message(path)


@pytest.mark.parametrize(
    ("content", "fragments"),
    [
        (b"", ["schema: missing", "image: missing", "camera: missing", "lights: missing", "medium: missing"]),
        (b"schema = 1\n[image\nwidth = 3", ["not valid TOML", "line 2", "[image"]),
        (b"schema = 1\nschema = 1\n", ["not valid TOML", "line 2"]),
        (b"schema = 1\n[image]\nwidth = 3 pixels", ["line 3", "width = 3 pixels"]),
        (b'name = "never closed', ["not valid TOML"]),
        (b"\x89PNG\r\n\x1a\n\x00\x00", ["not a text file", "byte 0"]),
        ("größe = 1".encode("latin-1"), ["not a text file", "not UTF-8"]),
        (b"x = 1\x00", ["not valid TOML", "line 1"]),
        (b"x = " + b"[" * 100_000, ["nested too deeply"]),
        (b"x = " + b"9" * 5000, ["not valid TOML"]),
        (b"#" * 1_000_001, ["found 1000001 bytes", "at most 1000000"]),
        (b'{"schema": 1}', ["not valid TOML", "line 1"]),
        (MINIMAL.encode() + b"\n[technique]\nwhen = 1979-05-27", ["technique.when", "the date or time 1979-05-27"]),
        (MINIMAL.encode().replace(b"width = 4", b"width = 1979-05-27"), ["image.width", "1979-05-27"]),
    ],
)
def test_files_that_are_no_scene(tmp_path: Path, content: bytes, fragments: list[str]) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    text = message(path)
    for fragment in ["bad.toml: ", *fragments]:
        assert fragment in text
    assert len(text) < 1500


def test_a_huge_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.toml"
    with path.open("wb") as file:
        file.truncate(1 << 40)  # sparse
    assert "at most 1000000" in message(path)


def test_overrides_change_values_lists_and_create_keys() -> None:
    scene = load_scene(
        "fig4c",
        [
            "lights.0.peak=0.5",
            "lights.0.position_m.1 = 21",
            "technique.preset=analysis",
            'technique.name="beams"',
            "buffers.f_h.format=unorm12",
            "buffers.rounding=half_up",
            "medium.extinction_per_m=[0.01, 0.02, 0.03]",
            "technique.deep.key=true",
            "objects=[]",
        ],
    )
    assert scene.lights[0].peak == 0.5
    assert scene.lights[0].position_m == (0.0, 21.0, 0.0)
    assert (scene.technique.preset, scene.technique.name) == ("analysis", "beams")
    assert scene.buffers.per_buffer["f_h"].format == "unorm12"
    assert scene.buffers.rounding == "half_up"
    assert scene.medium.extinction_per_m == (0.01, 0.02, 0.03)
    assert scene.technique.parameters["deep"] == {"key": True}
    assert scene.objects == ()
    assert load_scene("fig4c").with_overrides(["lights.0.peak=0.5"]).lights[0].peak == 0.5


@pytest.mark.parametrize(
    ("override", "fragments"),
    [
        ("", ["not of the form key.path=value"]),
        ("lights", ["not of the form key.path=value"]),
        ("=3", ["not of the form"]),
        ("lights..peak=3", ["not of the form"]),
        ("a b=3", ["not of the form"]),
        ("image.width=", ['no value after "="']),
        ("image.width=1.2.3", ["neither TOML", "nor a bare word"]),
        ("image.width=[1", ["neither TOML"]),
        ("image.width=3\nimage.height=4", ["more than one value"]),
        ("lights.1.peak=0.5", ["lights is a list, found index 1", "allowed: 0 to 0"]),
        ("lights.-1.peak=0.5", ["lights is a list, found index -1"]),
        ("lights.first.peak=0.5", ["found index first"]),
        ("image.width.x=1", ["image.width is 300, which has nothing below it"]),
        ("medium.extinction_per_m.0=1", ["medium.extinction_per_m is 0.02"]),
    ],
)
def test_bad_overrides_are_named(override: str, fragments: list[str]) -> None:
    text = message("fig4c", override)
    assert "bundled scene fig4c: override" in text
    for fragment in fragments:
        assert fragment in text


def test_an_override_may_only_say_what_a_file_may() -> None:
    assert "camera.fov: unknown key (did you mean vertical_fov_deg?)" in message("fig4c", "camera.fov=30")
    assert "image.width: found nan" in message("fig4c", "image.width=nan")
    assert 'image.width: found "wide"' in message("fig4c", "image.width=wide")


def test_the_digest_is_of_question_and_answer_only(tmp_path: Path) -> None:
    scene = load_scene("fig4c")
    assert len(scene.digest()) == 64
    assert scene.digest() == load_scene("fig4c").digest()
    assert replace(scene, name="other", path=None, origin="elsewhere").digest() == scene.digest()
    shuffled = tmp_path / "shuffled.toml"
    text = scene.to_toml()
    head, *tables = text.split("\n\n[")
    shuffled.write_text(head + "\n\n[" + "\n\n[".join([tables[-1], *tables[:-1]]) + "# comment\n", encoding="utf-8")
    assert load_scene(shuffled).digest() == scene.digest()
    assert parse_scene(MINIMAL).digest() == parse_scene(MINIMAL, ["camera.near_m=0.1", "lights.0.peak=1"]).digest()


def test_the_digest_is_the_same_in_another_process() -> None:
    code = "import atmoref.scene as s; print(s.load_scene('two_lights').digest())"
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert outputs == {load_scene("two_lights").digest()}


def test_the_digest_is_sha256_of_canonical_json() -> None:
    """Written out by hand for the smallest scene, so that other programs can compute it."""
    one, zero = '{"number":"0x1.0000000000000p+0"}', '{"number":"0x0.0p+0"}'

    def number(value: float) -> str:
        return '{"number":"' + value.hex() + '"}'

    def three(text: str) -> str:
        return f"[{text},{text},{text}]"

    text = (
        '{"buffers":{"device":"ideal"},'
        f'"camera":{{"far_m":{number(1000.0)},"look_at_m":{three(zero)},"near_m":{number(0.1)},'
        f'"position_m":[{zero},{zero},{number(-5.0)}],"type":"perspective","up":[{zero},{one},{zero}],'
        f'"vertical_fov_deg":{number(40.0)}}},'
        f'"image":{{"height":{number(3.0)},"wavelengths_nm":[{number(680.0)},{number(550.0)},{number(440.0)}],'
        f'"width":{number(4.0)}}},'
        f'"lights":[{{"direction":[{zero},{number(-1.0)},{zero}],"falloff":"smoothstep_cosine",'
        f'"inner_half_angle_deg":{number(10.0)},"outer_half_angle_deg":{number(20.0)},"peak":{one},'
        f'"position_m":[{zero},{number(3.0)},{zero}],"radiant_intensity_w_per_sr":{three(one)},"type":"spot"}}],'
        f'"medium":{{"ambient_radiance":{three(zero)},"extinction_per_m":{three(zero)},'
        f'"phase_function":{{"type":"isotropic"}},"single_scattering_albedo":{three(one)}}},'
        f'"objects":[],"schema":{one},"technique":{{"preset":"corrected"}}}}'
    )
    assert parse_scene(MINIMAL).digest() == hashlib.sha256(text.encode()).hexdigest()


@pytest.mark.parametrize(
    "override",
    [
        "image.width=301",
        "image.wavelengths_nm=[680, 550, 441]",
        "camera.up=[0.001, 1, 0]",
        "camera.vertical_fov_deg=36.00000000000001",
        "camera.near_m=0.2",
        "lights.0.peak=0.98",
        "lights.0.falloff=none",
        "lights.0.radiant_intensity_w_per_sr=[9430, 9430, 9431]",
        "medium.ambient_radiance=1e-300",
        "medium.phase_function.type=rayleigh",
        "objects.0.radius_m=2.5",
        "objects.1.albedo=[0.2, 0.2, 0.3]",
        "technique.name=truth",
        "technique.preset=corrected",
        "technique.epsilon=0.02",
        "technique.seed=9007199254740993",
        "technique.flag=true",
        "buffers.format=unorm10",
        "buffers.arithmetic=float64",
        "buffers.device=gl_llvmpipe",
        "buffers.rounding=truncate",
        "buffers.f_h.format=unorm8",
    ],
)
def test_the_digest_sees_every_change(override: str) -> None:
    changed = load_scene("fig4c", [override])
    assert changed.digest() != load_scene("fig4c").digest()
    assert changed != load_scene("fig4c")


def test_neighbouring_big_integers_differ() -> None:
    digests = {load_scene("fig4c", [f"technique.seed={2**53 + k}"]).digest() for k in range(4)}
    assert len(digests) == 4
    assert len({parse_scene(MINIMAL, [f"technique.n={10**400 + k}"]).digest() for k in range(2)}) == 2


def test_order_of_objects_counts() -> None:
    mapping = load_scene("fig4c").to_mapping()
    mapping["objects"].reverse()
    assert scene_from_mapping(mapping).digest() != load_scene("fig4c").digest()


def test_import_is_light() -> None:
    """No Numba: the command line imports this room to say that a file is wrong."""
    code = "import sys, atmoref.scene; print(sorted({'numba', 'scipy', 'numpy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_names_are_those_of_the_rooms_that_own_them() -> None:
    """The scene repeats the names of formats, devices and phase functions, since it may not import those rooms."""
    from typing import get_args

    from atmoref.buffers.device import DEVICES
    from atmoref.buffers.formats import FORMATS
    from atmoref.optics.phase_functions import PHASE_FUNCTIONS
    from atmoref.scene import models

    assert set(get_args(models.FormatName)) == set(FORMATS)
    assert set(get_args(models.DeviceName)) == set(DEVICES)
    assert set(get_args(models.PhaseName)) == set(PHASE_FUNCTIONS)
