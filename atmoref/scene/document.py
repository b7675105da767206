"""The scene: a question about light in a medium, and how to answer it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from atmoref.scene import emit
from atmoref.scene.camera import Camera
from atmoref.scene.describe import found
from atmoref.scene.errors import SceneError, parse_model
from atmoref.scene.models import (
    PHASES_WITH_G,
    Buffers,
    Image,
    Medium,
    Object,
    SceneFile,
    Spot,
    Technique,
)
from atmoref.scene.overrides import apply_overrides

SCHEMA = 1


@dataclass(frozen=True, slots=True)
class Scene:
    """What is asked (image, camera, lights, medium, objects) and how to answer (technique, buffers).

    Made by ``load_scene``, ``parse_scene`` or ``scene_from_mapping``, which check it. Two scenes are equal when
    question and answer are; name and place of the file do not count.
    """

    image: Image
    camera: Camera
    lights: tuple[Spot, ...]
    medium: Medium
    objects: tuple[Object, ...]
    technique: Technique
    buffers: Buffers
    name: str = field(default="scene", compare=False)
    path: Path | None = field(default=None, compare=False)
    origin: str = field(default="scene", compare=False)
    """What messages call the file."""

    def to_mapping(self) -> dict[str, Any]:
        """Return the resolved scene as plain values, defaults filled in; keys as in the file."""
        return {
            "schema": SCHEMA,
            "image": _plain(self.image),
            "camera": _plain(self.camera),
            "lights": [_plain(light) for light in self.lights],
            "medium": _plain(self.medium),
            "objects": [_plain(item) for item in self.objects],
            "technique": _plain(self.technique),
            "buffers": _plain(self.buffers),
        }

    def to_toml(self) -> str:
        """Return the resolved scene as a scene file; reading it back gives an equal scene, to the last bit."""
        return emit.to_toml(self.to_mapping())

    def digest(self) -> str:
        """Return the SHA-256, in hexadecimal, of question and answer.

        Over canonical JSON of the resolved scene: keys sorted, numbers as exact hexadecimal, so that 1 and 1.0 agree
        and the order of keys, comments, and keys that repeat a default do not count.
        """
        text = json.dumps(_canonical(self.to_mapping()), sort_keys=True, separators=(",", ":"), ensure_ascii=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def with_overrides(self, overrides: Sequence[str]) -> Scene:
        """Return the scene with ``key.path=value`` applied; raises SceneError like ``load_scene``."""
        mapping = apply_overrides(self.to_mapping(), overrides, self.origin)
        return scene_from_mapping(mapping, origin=self.origin, name=self.name, path=self.path)


def scene_from_mapping(
    mapping: Mapping[str, Any], *, origin: str = "scene", name: str = "scene", path: Path | None = None
) -> Scene:
    """Return the checked scene of plain values.

    Parameters
    ----------
    mapping
        As ``tomllib`` gives it.
    origin
        What messages call the file.
    name, path
        Kept in the scene.

    Raises
    ------
    SceneError
        With a line for each problem.
    """
    if "schema" in mapping and (isinstance(mapping["schema"], bool) or mapping["schema"] != SCHEMA):
        version = found(mapping["schema"])
        raise SceneError(f"{origin}: schema: found {version}; allowed: {SCHEMA} (all this version reads)")
    whole = parse_model(SceneFile, mapping, origin)
    return Scene(
        image=whole.image,
        camera=whole.camera,
        lights=whole.lights,
        medium=whole.medium,
        objects=whole.objects,
        technique=whole.technique,
        buffers=whole.buffers,
        name=name,
        path=path,
        origin=origin,
    )


def _plain(table: Any) -> Any:
    """Return a table as plain values, without keys that are not set and without a g that its phase function lacks."""
    values = table.model_dump(mode="python", exclude_none=True)
    phase = values.get("phase_function")
    if isinstance(table, Medium) and phase["type"] not in PHASES_WITH_G:
        del phase["g"]
    return _lists(values)


def _lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    return [_lists(item) for item in value] if isinstance(value, list | tuple) else value


def _canonical(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _canonical(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(item) for item in value]
    if isinstance(value, bool | str):
        return value
    if isinstance(value, int) and (value.bit_length() > 1000 or float(value) != value):
        return {"integer": str(value)}
    return {"number": (float(value) + 0.0).hex()}
