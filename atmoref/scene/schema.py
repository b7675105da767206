"""A JSON Schema of scene files, so that editors complete and check them while one types."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from atmoref.scene.models import SceneFile

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_AT = "#/$defs/"


def json_schema(technique_models: Mapping[str, type[BaseModel]]) -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a scene file.

    Parameters
    ----------
    technique_models
        The parameter model of every technique by name; ``scene`` itself knows no technique. An empty model stands for
        a technique without parameters.

    Returns
    -------
    dict
        Every key with its description, and with ``unit`` where it has one. A named technique admits its own
        parameters only; without a name (it is then given on the command line) any are admitted.
    """
    models: list[tuple[type[BaseModel], Literal["validation"]]] = [(SceneFile, "validation")]
    models += [(model, "validation") for model in technique_models.values()]
    references, document = models_json_schema(models, by_alias=True, ref_template=_AT + "{model}")
    definitions: dict[str, Any] = document["$defs"]
    targets = {model: str(reference["$ref"]).removeprefix(_AT) for (model, _), reference in references.items()}
    technique = definitions["Technique"]
    shared = technique["properties"]
    shared["name"] = {"description": shared["name"]["description"], "enum": sorted(technique_models)}
    technique["allOf"] = []
    for name, model in technique_models.items():
        own = copy.deepcopy(definitions[targets[model]])
        own["title"] = f"Parameters of {name}"
        own["properties"] = {**shared, **own.get("properties", {})}
        definitions[f"technique_{name}"] = own
        named = {"properties": {"name": {"const": name}}, "required": ["name"]}
        technique["allOf"].append({"if": named, "then": {"$ref": f"{_AT}technique_{name}"}})
    whole = definitions.pop(targets[SceneFile])
    for model in set(technique_models.values()):
        del definitions[targets[model]]
    for table in [whole, *definitions.values()]:
        table["properties"] = {key: _tidy(entry) for key, entry in table.get("properties", {}).items()}
    return {"$schema": DIALECT, **whole, "title": "atmoref scene", "$defs": definitions}


def _tidy(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return a key's schema without its made-up title, and without null, which TOML does not have."""
    entry = {key: value for key, value in entry.items() if key != "title"}
    if entry.get("default", 0) is None or isinstance(entry.get("default"), dict):
        del entry["default"]  # left out is left out; a table's defaults stand at its keys
    kinds = [kind for kind in entry.get("anyOf", ()) if kind != {"type": "null"}]
    if len(kinds) == 1:
        del entry["anyOf"]
        return {**kinds[0], **entry}
    if kinds:
        entry["anyOf"] = kinds
    return entry
