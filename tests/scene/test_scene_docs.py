"""The reference page names every key with its unit, its default and its choices."""

from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from atmoref.scene import lights, models, objects
from atmoref.scene.camera import Camera
from atmoref.scene.describe import unit_of

PAGE = (Path(__file__).parents[2] / "docs" / "scene-files.md").read_text("utf-8")
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line.startswith("| `")]
TABLES: list[type[BaseModel]] = [
    models.Image,
    Camera,
    lights.Spot,
    lights.Projector,
    lights.Sun,
    lights.Window,
    models.PhaseFunction,
    models.Medium,
    objects.Sphere,
    objects.Box,
    objects.Ground,
    objects.Mesh,
    objects.HeightField,
    models.Technique,
    models.Buffers,
]
KEYS = [(table, name) for table in TABLES for name in table.model_fields]


def written(value: Any) -> str:
    """Return a default as the page writes it."""
    if isinstance(value, tuple) and len(set(value)) == 1:
        value = value[0]
    return f'`"{value}"`' if isinstance(value, str) else f"`{list(value) if isinstance(value, tuple) else value}`"


@pytest.mark.parametrize(("table", "name"), KEYS, ids=[f"{table.__name__}.{name}" for table, name in KEYS])
def test_the_page_tells_of_every_key(table: type[BaseModel], name: str) -> None:
    field = table.model_fields[name]
    rows = [row for row in ROWS if row[0] == f"`{name}`" and row[1] == unit_of(field)]
    choices = [word for word in get_args(field.annotation) if isinstance(word, str)]
    rows = [row for row in rows if all(f'`"{word}"`' in row[2] for word in choices)]
    assert rows, f"no row for {name} with its unit and choices"
    if isinstance(field.default, BaseModel) or field.default is None or field.is_required() or name == "g":
        return
    assert any(row[3] == written(field.default) for row in rows), f"no default {written(field.default)} for {name}"


def test_the_page_knows_no_other_keys() -> None:
    known = {name for _, name in KEYS} | {"schema", *models.SceneFile.model_fields}
    assert {row[0].strip("`") for row in ROWS} - known == {"phase_function` key", "window` key"}


def test_the_example_on_the_page_is_a_scene() -> None:
    from atmoref.scene import load_scene, parse_scene

    example = PAGE.split("```toml\n")[1].split("```")[0]
    scene = parse_scene(example)
    assert scene.camera == load_scene("fig4c").camera
    assert scene.objects[0] == load_scene("fig4c").objects[0]
