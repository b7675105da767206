"""What is there and what is this: ``scenes``, ``techniques``, ``schema``, ``validate``, ``info``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from atmoref.cli.rendering import Changes, SceneWord, TechniqueWord

if TYPE_CHECKING:
    from pydantic import BaseModel

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of lines.")]


def scenes(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Print this scene's file.")] = None,
    as_json: AsJson = False,
) -> None:
    """List the scenes that come with the package, or print one: a file to start from."""
    from atmoref.scene import bundled_names, bundled_text, load_scene

    if name is not None:
        typer.echo(bundled_text(name), nl=False)
        return
    rows = []
    for each in bundled_names():
        scene = load_scene(each)
        rows.append(
            {
                "name": each,
                "technique": scene.technique.name or "",
                "preset": scene.technique.preset,
                "width": scene.image.width,
                "height": scene.image.height,
                "lights": len(scene.lights),
                "about": _first_comment(bundled_text(each)),
            }
        )
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
        return
    for row in rows:
        size = f"{row['width']} x {row['height']}"
        typer.echo(f"{row['name']:<12}{size:<12}{row['technique']:<14}{row['about']}")


def _first_comment(text: str) -> str:
    first = text.partition("\n")[0]
    return first.removeprefix("#").strip() if first.startswith("#") else ""


def parameter_models() -> dict[str, type[BaseModel]]:
    """Return the parameter model of every technique, and of the truth."""
    from atmoref.cli.answering import TRUTH, TruthParameters
    from atmoref.techniques import TECHNIQUES
    from atmoref.techniques.render import technique_module

    models: dict[str, type[BaseModel]] = {name: technique_module(name).Parameters for name in TECHNIQUES}
    return {**models, TRUTH: TruthParameters}


def techniques(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Tell all about this one.")] = None,
    as_json: AsJson = False,
) -> None:
    """List the techniques; with NAME also their parameters, presets, and the formats of their buffers."""
    from atmoref.cli.failures import RequestError
    from atmoref.scene.errors import nearest

    models = parameter_models()
    if name is not None and name not in models:
        raise RequestError(f"no technique {name!r}{nearest(name, models)}; there are: {', '.join(models)}")
    told = {each: _technique(each, model) for each, model in models.items() if name in (None, each)}
    if as_json:
        typer.echo(json.dumps(told, indent=2))
        return
    for each, about in told.items():
        typer.echo(f"{each:<14}{about['about']}")
        if name is not None:
            _print_technique(about)


def _technique(name: str, model: type[BaseModel]) -> dict[str, Any]:
    from atmoref.cli.answering import TRUTH
    from atmoref.scene.describe import allowed, unit_of

    presets: dict[str, Any] = {}
    buffers: dict[str, Any] = {}
    about = "The same question answered by integration, with an error for every pixel."
    if name != TRUTH:
        from atmoref.techniques.beams_parameters import PRESETS
        from atmoref.techniques.render import technique_module

        module = technique_module(name)
        presets, buffers = PRESETS[name], module.BUFFERS
        about = (module.__doc__ or "").strip().partition("\n")[0]
    parameters = {
        key: {
            "default": field.default, "unit": unit_of(field), "allowed": allowed(field),
            "about": field.description or "",
            "presets": {preset: values[key] for preset, values in presets.items() if key in values},
        }
        for key, field in model.model_fields.items()
    }  # fmt: skip
    return {"about": about, "parameters": parameters, "buffers": buffers}


def _print_technique(about: dict[str, Any]) -> None:
    for key, field in about["parameters"].items():
        default = "left out" if field["default"] is None else json.dumps(field["default"])
        typer.echo(f"\n  {key} = {default}")
        typer.echo(f"      {field['about']}")
        typer.echo(f"      allowed: {field['allowed']}")
        for preset, value in field["presets"].items():
            typer.echo(f"      preset {preset}: {json.dumps(value)}")
    if about["buffers"]:
        typer.echo("\n  buffers and their formats, by preset:")
    for preset, formats in about["buffers"].items():
        typer.echo(f"      {preset}: " + ", ".join(f"{buffer} {fmt}" for buffer, fmt in formats.items()))


def schema() -> None:
    """Print the JSON Schema of scene files, with which editors complete and check them."""
    from atmoref.scene.schema import json_schema

    typer.echo(json.dumps(json_schema(parameter_models()), indent=2))


def validate(
    scene: SceneWord,
    technique: TechniqueWord = None,
    changes: Changes = None,
    resolved: Annotated[bool, typer.Option("--resolved", help="Print the scene with all defaults filled in.")] = False,
) -> None:
    """Check SCENE, its technique's parameters included; exit code 2 and a message if it is wrong."""
    from atmoref.cli.answering import check, chosen_technique
    from atmoref.scene import load_scene

    question = load_scene(scene, changes or ())
    name = chosen_technique(question, technique)
    check(question, name)
    if resolved:
        typer.echo(question.to_toml(), nl=False)
    else:
        typer.echo(f"{question.origin}: a correct scene for {name}, sha256 {question.digest()}")


def info(
    file: Annotated[str, typer.Argument(metavar="FILE", help="An image, a table, a scene file or a bundled name.")],
    as_json: AsJson = False,
) -> None:
    """Tell what FILE is and holds."""
    told = _info(file)
    if as_json:
        typer.echo(json.dumps(told, indent=2))
        return
    for key, value in told.items():
        if isinstance(value, dict):
            typer.echo(f"{key}:")
            for name, each in value.items():
                typer.echo(f"  {name}: {_line(each)}")
        else:
            typer.echo(f"{key}: {_line(value)}")


def _line(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {each}" for key, each in value.items())
    return ", ".join(str(each) for each in value) if isinstance(value, list) else str(value)


def _info(file: str) -> dict[str, Any]:
    from atmoref.images import READABLE, read
    from atmoref.scene import bundled_names, load_scene

    path = Path(file)
    suffix = path.suffix.lower()
    if file in bundled_names() or suffix not in READABLE:
        scene = load_scene(file)
        return {"kind": "scene", "name": scene.name, "sha256": scene.digest(), **scene.to_mapping()}
    if suffix == ".npz" and path.is_file():
        from atmoref.store import read_npz

        arrays = read_npz(path)
        if "__table__" in arrays:
            description = json.loads(arrays.pop("__table__").tobytes())
            shapes = {name: f"{array.dtype} {array.shape}" for name, array in arrays.items()}
            return {
                "kind": "table",
                **json.loads(description["table"]),
                "sha256": description["sha256"],
                "arrays": shapes,
            }
    image = read(path)
    height, width = image.shape
    channels = {name: _channel(plane) for name, plane in image.channels.items()}
    return {"kind": "image", "width": width, "height": height, "channels": channels, "attributes": image.attributes}


def _channel(plane: Any) -> dict[str, Any]:
    """Return type, range and mean of one channel, and how many of its numbers are not finite."""
    import numpy as np

    finite = plane[np.isfinite(plane)]
    told: dict[str, Any] = {"type": plane.dtype.name}
    if finite.size:
        told |= {"min": finite.min().item(), "max": finite.max().item(), "mean": float(finite.mean(dtype=np.float64))}
    if finite.size < plane.size:
        told["not_finite"] = int(plane.size - finite.size)
    return told
