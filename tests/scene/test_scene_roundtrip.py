"""Any correct scene survives being written as TOML and read again, to the last bit."""

import tomllib
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from atmoref.scene import load_scene, parse_scene, scene_from_mapping
from atmoref.scene.emit import to_toml

unit = st.floats(0.0, 1.0)
positive = st.floats(1e-6, 1e6)
coordinate = st.floats(-1e6, 1e6)
vector = st.lists(coordinate, min_size=3, max_size=3)
key = st.from_regex(r"[a-z][a-z0-9_]{0,12}", fullmatch=True)
text = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
scalar = st.booleans() | st.integers(-(2**70), 2**70) | st.floats(allow_nan=False, allow_infinity=False) | text
parameter = st.recursive(
    scalar, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(text, inner, max_size=3), max_leaves=6
)


def channels(number: st.SearchStrategy[float]) -> st.SearchStrategy[Any]:
    return number | st.lists(number, min_size=3, max_size=3)


def table(**entries: Any) -> st.SearchStrategy[dict[str, Any]]:
    """Return tables in which every key whose name ends in an underscore may be missing."""
    required = {name: value for name, value in entries.items() if not name.endswith("_")}
    optional = {name[:-1]: value for name, value in entries.items() if name.endswith("_")}
    return st.fixed_dictionaries(required, optional=optional)


@st.composite
def scenes(draw: st.DrawFn) -> dict[str, Any]:
    """Return correct scenes: objects lie below y = -10, light and eye above y = 0."""
    inner, outer = sorted(draw(st.lists(st.floats(0.01, 89.0), min_size=2, max_size=2)))
    light = table(
        type=st.just("spot"),
        position_m=st.tuples(coordinate, st.floats(1.0, 10.0), coordinate).map(list),
        direction=vector.filter(any),
        inner_half_angle_deg=st.just(inner),
        outer_half_angle_deg=st.just(outer),
        falloff_=st.sampled_from(["smoothstep_cosine", "linear_angle", "none"]),
        peak_=st.floats(1e-6, 1.0),
        radiant_intensity_w_per_sr=channels(st.floats(0.0, 1e20)),
    )
    corner = st.tuples(st.floats(-1e6, 0.0), st.floats(-1e6, -1e3), st.floats(-1e6, 0.0)).map(list)
    opposite = st.tuples(st.floats(1.0, 1e6), st.floats(-999.0, -11.0), st.floats(1.0, 1e6)).map(list)
    item = st.one_of(
        table(
            type=st.just("sphere"),
            center_m=st.tuples(coordinate, st.just(-20.0), coordinate).map(list),
            radius_m=st.floats(1e-6, 9.0),
            albedo=channels(unit),
        ),
        table(type=st.just("box"), min_m=corner, max_m=opposite, albedo=channels(unit)),
        table(type=st.just("ground"), height_m_=st.floats(-1e6, -10.0), albedo=channels(unit)),
    )
    formats = st.sampled_from(["unorm8", "unorm12", "float16", "float64"])
    names = st.text("abcxyz_", min_size=1, max_size=8)
    phase = st.sampled_from([{"type": "isotropic"}, {"type": "nishita_murky"}, {}]) | table(
        type=st.sampled_from(["henyey_greenstein", "cornette_shanks"]), g=st.floats(-0.999, 0.999)
    )
    whole = table(
        schema=st.just(1),
        image=table(width=st.integers(1, 8192), height=st.integers(1, 8192)),
        camera=table(
            position_m=st.tuples(coordinate, st.just(0.5), coordinate).map(list),
            look_at_m=st.just([0.0, 1e6, 3.0]),
            up=st.tuples(positive, st.just(0.0), st.just(0.0)).map(list).filter(lambda up: up[0] > 0),
            vertical_fov_deg=st.floats(0.01, 170.0),
            near_m_=st.floats(1e-6, 999.0),
        ),
        lights=st.lists(light, min_size=1, max_size=3),
        medium=table(
            extinction_per_m=channels(st.floats(0.0, 1e6)),
            single_scattering_albedo=channels(unit),
            phase_function_=phase,
            ambient_radiance_=channels(positive),
        ),
        objects_=st.lists(item, max_size=3),
        technique_=st.dictionaries(key.filter(lambda k: k not in ("name", "preset")), parameter, max_size=4),
        buffers_=st.dictionaries(names, st.fixed_dictionaries({"format": formats}), max_size=3),
    )
    scene = draw(whole)
    if draw(st.booleans()):
        scene.setdefault("technique", {})["name"] = draw(key)
        scene.setdefault("buffers", {})["format"] = draw(formats)
    return scene


@settings(max_examples=150, deadline=None)
@given(mapping=scenes())
def test_scene_to_toml_to_scene(mapping: dict[str, Any]) -> None:
    scene = scene_from_mapping(mapping)
    again = parse_scene(scene.to_toml())
    assert again == scene
    assert again.digest() == scene.digest()
    assert again.to_mapping() == scene.to_mapping()
    assert scene_from_mapping(tomllib.loads(to_toml(mapping))) == scene, "the writer alone"


@settings(max_examples=150, deadline=None)
@given(values=st.dictionaries(text, parameter, max_size=5))
def test_the_writer_writes_what_the_parser_of_python_reads(values: dict[str, Any]) -> None:
    assert tomllib.loads(to_toml(values)) == values


def test_bundled_scenes_round_trip() -> None:
    for name in ("fig4a", "fig4c", "two_lights", "quick"):
        scene = load_scene(name)
        assert parse_scene(scene.to_toml()) == scene
