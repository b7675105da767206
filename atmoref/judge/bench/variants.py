"""Scenes with keys replaced, whatever the scene says itself."""

from __future__ import annotations

from typing import Any

from atmoref.scene import Scene, scene_from_mapping


def variant(scene: Scene, technique: str | None = None, **keys: Any) -> Scene:
    """Return the scene with keys of [technique] replaced, under a technique.

    Parameters
    ----------
    scene : Scene
    technique : str or None
        None: the scene's own. Another one starts from the preset: keys differ in meaning between techniques.
    keys
        Of [technique]; None removes one.

    Raises
    ------
    SceneError
    """
    mapping = scene.to_mapping()
    own = dict(mapping["technique"])
    if technique is not None and technique != own.get("name"):
        shared = {k: own[k] for k in ("preset", "base_distance_m", "shadow_bias_m") if own.get(k) is not None}
        own = {"name": technique, **shared}
    own.update(keys)
    mapping["technique"] = {k: v for k, v in own.items() if v is not None}
    return scene_from_mapping(mapping, origin=scene.origin, name=scene.name, path=scene.path)


def stored_as(scene: Scene, fmt: str) -> Scene:
    """Return the scene with frame, f_h and vertex colours in one format."""
    mapping = scene.to_mapping()
    kept = {k: mapping["buffers"][k] for k in ("device", "rounding") if mapping["buffers"].get(k) is not None}
    mapping["buffers"] = {**kept, "format": fmt}
    return scene_from_mapping(mapping, origin=scene.origin, name=scene.name, path=scene.path)


__all__ = ["stored_as", "variant"]
