"""The JSON Schema for editors: says yes to what the loader takes, no to what it refuses, and explains every key."""

import re
from typing import Any, Literal

import pytest

from atmoref.scene import bundled_names, load_scene
from atmoref.scene.fields import Table, quantity
from atmoref.scene.schema import DIALECT, json_schema


class Beams(Table):
    """Parameters as a technique would declare them."""

    delta_min_m: float = quantity("m", "Least spacing.", 0.1, gt=0.0)
    delta_max_m: float = quantity("m", "Greatest spacing.", 2.0, gt=0.0)
    v_ref_m: float = quantity("m", "Distance.", 3.85, gt=0.0)
    i_max: float = quantity("", "Limit.", 1.0)
    epsilon: float = quantity("", "Share.", 0.01)
    sub_plane_rule: Literal["floor", "ceil"] = quantity("", "Rounding.", "floor")
    base_distance_m: float | list[float] = quantity("m", "Length.", 20.0)
    bounds: Literal["depth", "euclid"] = quantity("", "Extent.", "depth")
    interval_m: float | None = quantity("m", "Spacing.", None, gt=0.0)
    shadow_map_size: int = quantity("texels", "Edge.", 512, ge=1)
    planes: int | None = quantity("", "Count.", None, ge=1)
    images: int | None = quantity("", "Count.", None, ge=1)
    shadow_bias_m: float = quantity("m", "Bias.", 0.1, ge=0.0)
    composition: Literal["average", "interleave"] = quantity("", "What becomes of images.", "average")


class Nothing(Table):
    """No parameters."""


SCHEMA = json_schema({"beams": Beams, "beams_vertex": Beams, "beams_interleaved": Beams, "truth": Nothing})
KINDS: dict[str, Any] = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
}
KEYWORDS = {
    *("$ref", "$defs", "$schema", "type", "const", "enum", "title", "description", "default", "unit", "discriminator"),
    *("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "minLength", "maxLength", "pattern"),
    *("items", "prefixItems", "minItems", "maxItems", "properties", "required", "additionalProperties"),
    *("anyOf", "oneOf", "allOf", "if", "then"),
}


def valid(value: Any, schema: Any) -> bool:
    """Return whether a value fits: the few keywords of JSON Schema that ours uses, straight from the standard."""
    if schema is True or schema is False:
        return bool(schema)
    assert set(schema) <= KEYWORDS, set(schema) - KEYWORDS
    tests = [
        "$ref" not in schema or valid(value, SCHEMA["$defs"][schema["$ref"].removeprefix("#/$defs/")]),
        "type" not in schema or (isinstance(value, KINDS[schema["type"]]) and (value is not True)),
        "const" not in schema or value == schema["const"],
        "enum" not in schema or value in schema["enum"],
        all(valid(value, part) for part in schema.get("allOf", ())),
        "anyOf" not in schema or any(valid(value, part) for part in schema["anyOf"]),
        "oneOf" not in schema or sum(valid(value, part) for part in schema["oneOf"]) == 1,
        "if" not in schema or not valid(value, schema["if"]) or valid(value, schema["then"]),
    ]
    if not all(tests):
        return False
    if isinstance(value, dict):
        return _valid_table(value, schema)
    if isinstance(value, list):
        heads = schema.get("prefixItems", [])
        each = [*heads, *[schema.get("items", True)] * max(0, len(value) - len(heads))]
        sized = schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 10**9)
        return sized and all(valid(item, part) for item, part in zip(value, each, strict=False))
    if isinstance(value, str):
        return re.search(schema.get("pattern", ""), value) is not None
    above = value >= schema.get("minimum", value) and (
        "exclusiveMinimum" not in schema or value > schema["exclusiveMinimum"]
    )
    below = value <= schema.get("maximum", value) and (
        "exclusiveMaximum" not in schema or value < schema["exclusiveMaximum"]
    )
    return above and below


def _valid_table(value: dict[str, Any], schema: dict[str, Any]) -> bool:
    properties = schema.get("properties", {})
    other = schema.get("additionalProperties", True)
    return all(name in value for name in schema.get("required", ())) and all(
        valid(item, properties.get(name, other)) for name, item in value.items()
    )


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_scenes_fit(name: str) -> None:
    assert valid(load_scene(name).to_mapping(), SCHEMA)


@pytest.mark.parametrize(
    ("change", "fits"),
    [
        ({}, True),
        ({"image": {"width": 0, "height": 3}}, False),
        ({"image": {"width": 3}}, False),
        ({"image": {"width": 3, "height": 3, "depth": 3}}, False),
        ({"lights": []}, False),
        ({"medium": {"extinction_per_m": 0.1, "single_scattering_albedo": [0.1, 0.2, 0.3]}}, True),
        ({"medium": {"extinction_per_m": 0.1, "single_scattering_albedo": [0.1, 0.2]}}, False),
        ({"medium": {"extinction_per_m": 0.1, "single_scattering_albedo": 1.5}}, False),
        ({"objects": [{"type": "mesh", "path": "teapot.obj"}]}, False),
        ({"objects": [{"type": "ground", "albedo": 0.5}]}, True),
        ({"technique": {"name": "beams", "epsilon": 0.02}}, True),
        ({"technique": {"name": "beams", "epsilan": 0.02}}, False),
        ({"technique": {"name": "truth", "epsilon": 0.02}}, False),
        ({"technique": {"name": "sky"}}, False),
        ({"technique": {"epsilon": 0.02}}, True),
        ({"buffers": {"f_h": {"format": "unorm12"}}}, True),
        ({"buffers": {"f_h": {"format": "unorm13"}}}, False),
        ({"buffers": {"fromat": "unorm8"}}, False),
        ({"buffers": {"format": "unorm9"}}, False),
        ({"sun": {}}, False),
    ],
)
def test_the_schema_agrees_with_the_loader(change: dict[str, Any], fits: bool) -> None:
    assert valid(load_scene("fig4c").to_mapping() | change, SCHEMA) is fits


def test_every_key_is_described_and_has_its_unit() -> None:
    tables = {"": SCHEMA, **SCHEMA["$defs"]}
    assert SCHEMA["$schema"] == DIALECT
    assert len(tables) > 10
    for table, content in tables.items():
        for name, entry in content["properties"].items():
            assert entry.get("description", "").endswith("."), f"{table}.{name} is not described"
            suffixes = {"_m": "m", "_per_m": "1/m", "_deg": "degrees", "_nm": "nm", "_w_per_sr": "W/sr"}
            units = [unit for suffix, unit in suffixes.items() if name.endswith(suffix)]
            assert not units or entry["unit"] == units[-1], f"{table}.{name}"


def test_toml_has_no_null_and_neither_has_the_schema() -> None:
    assert "null" not in str(SCHEMA)
    assert "None" not in str(SCHEMA)


def test_techniques_may_share_a_model_and_may_be_none() -> None:
    assert json_schema({})["$defs"]["Technique"]["properties"]["name"]["enum"] == []
    assert "Beams" not in SCHEMA["$defs"]
