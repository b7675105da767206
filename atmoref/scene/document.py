"""The scene: a question about light in a medium, and how to answer it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from atmoref.memory import PROGRAM_BYTES, Account, allowed_bytes
from atmoref.scene import emit
from atmoref.scene.camera import Camera
from atmoref.scene.describe import found
from atmoref.scene.errors import SceneError, parse_model
from atmoref.scene.lights import Light, Projector, Sun
from atmoref.scene.models import PHASES_WITH_G, Buffers, Image, Medium, SceneFile, Technique
from atmoref.scene.objects import HeightField, Mesh, Object
from atmoref.scene.overrides import apply_overrides
from atmoref.scene.triangles import Triangles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SCHEMA = 1


@dataclass(frozen=True, slots=True)
class Files:
    """What the files of a scene hold, by index of the light or object, and their SHA-256 by name."""

    light_maps: Mapping[int, NDArray[np.float64]] = field(default_factory=dict, compare=False)
    triangles: Mapping[int, Triangles] = field(default_factory=dict, compare=False)
    digests: Mapping[str, str] = field(default_factory=dict)
    kept_bytes: int = field(default=0, compare=False)
    """What they take in memory, as estimated before they were read."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What is asked (image, camera, lights, medium, objects) and how to answer (technique, buffers).

    Made by ``load_scene``, ``parse_scene`` or ``scene_from_mapping``, which check it. Two scenes are equal when
    question and answer are; name and place of the file do not count.
    """

    image: Image
    camera: Camera
    lights: tuple[Light, ...]
    medium: Medium
    objects: tuple[Object, ...]
    technique: Technique
    buffers: Buffers
    name: str = field(default="scene", compare=False)
    path: Path | None = field(default=None, compare=False)
    origin: str = field(default="scene", compare=False)
    """What messages call the file."""
    files: Files = field(default_factory=Files, repr=False)
    """What the scene's files hold; equal when their contents are."""

    def light_map(self, index: int) -> NDArray[np.float64] | None:
        """Return the picture of light ``index``: (H, W, 3), linear, in [0, 1], row 0 at the top; None without one."""
        return self.files.light_maps.get(index)

    def triangles(self, index: int) -> Triangles | None:
        """Return the triangles of object ``index``, in metres in the world; None for one that has none."""
        return self.files.triangles.get(index)

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

        Over canonical JSON of the resolved scene, with the SHA-256 of each file that it names: keys sorted, numbers as
        exact hexadecimal, so that 1 and 1.0 agree and the order of keys, comments, and keys that repeat a default do
        not count.
        """
        content = {"files": self.files.digests} if self.files.digests else {}
        text = json.dumps(
            _canonical(self.to_mapping() | content), sort_keys=True, separators=(",", ":"), ensure_ascii=True
        )
        return hashlib.sha256(text.encode()).hexdigest()

    def with_overrides(self, overrides: Sequence[str]) -> Scene:
        """Return the scene with ``key.path=value`` applied; raises SceneError like ``load_scene``."""
        mapping = apply_overrides(self.to_mapping(), overrides, self.origin)
        return scene_from_mapping(mapping, origin=self.origin, name=self.name, path=self.path)


def scene_from_mapping(
    mapping: Mapping[str, Any],
    *,
    origin: str = "scene",
    name: str = "scene",
    path: Path | None = None,
    max_memory: int | None = None,
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
    max_memory
        Bytes of the whole process that the files of the scene may bring it to; None: half of what is available.

    Raises
    ------
    SceneError
        With a line for each problem.
    OutOfMemory
        The files that it names need more memory than allowed.
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
        files=_files(whole, path, Account(origin, allowed_bytes(max_memory))),
    )


def _files(whole: SceneFile, path: Path | None, account: Account) -> Files:
    """Return what the files that a scene names hold; they lie beside it, or in the current folder if it has no path."""
    if not any(isinstance(item, Projector | Sun | Mesh | HeightField) for item in (*whole.lights, *whole.objects)):
        return Files()
    from atmoref.scene import assets  # NumPy is not needed before

    folder, origin = Path.cwd() if path is None else path.parent, account.origin
    light_maps: dict[int, NDArray[np.float64]] = {}
    triangles: dict[int, Triangles] = {}
    digests: dict[str, str] = {}
    for i, light in enumerate(whole.lights):
        picture = light if isinstance(light, Projector) else light.window if isinstance(light, Sun) else None
        if picture is None or picture.image is None:
            continue
        key = f"lights[{i}].{'window.' if isinstance(light, Sun) else ''}image"
        light_maps[i] = assets.light_map(folder, picture.image, picture.image_encoding, key, origin, account)
        digests[picture.image] = assets.content_digest(assets.resolve(folder, picture.image, key, origin))
    for i, item in enumerate(whole.objects):
        if not isinstance(item, Mesh | HeightField):
            continue
        key = f"objects[{i}].path"
        if isinstance(item, Mesh):
            triangles[i] = assets.mesh_triangles(folder, item, key, origin, account)
        else:
            triangles[i] = assets.height_field_triangles(folder, item, key, origin, account)
        digests[item.path] = assets.content_digest(assets.resolve(folder, item.path, key, origin))
    return Files(light_maps, triangles, digests, account.kept - PROGRAM_BYTES)


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
