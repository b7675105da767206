"""Change a scene from the command line: ``lights.0.peak=0.5``."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from atmoref.scene.describe import found
from atmoref.scene.errors import SceneError

_BARE_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_./+-]*\Z")
_KEY = re.compile(r"[A-Za-z0-9_-]+\Z")
_INDEX = re.compile(r"[0-9]{1,9}\Z")
_FORM = "allowed: key.path=value, e.g. lights.0.peak=0.5 or technique.preset=paper"


def apply_overrides(mapping: Mapping[str, Any], overrides: Sequence[str], origin: str) -> dict[str, Any]:
    """Return a copy of plain scene values with each ``key.path=value`` set, in order.

    Parameters
    ----------
    mapping
        As ``tomllib`` gives it; left as it is.
    overrides
        Keys and list indices joined by dots; the value in TOML syntax, bare words standing for text. Missing keys and
        tables are created; a list grows by none.
    origin
        File name for messages.

    Raises
    ------
    SceneError
        Naming the override and what is wrong with it.
    """
    result: dict[str, Any] = copy.deepcopy(dict(mapping))
    for override in overrides:
        if not isinstance(override, str):
            raise SceneError(f"{origin}: override {override!r}: not text; {_FORM}")
        place = f"{origin}: override {found(override)}"
        path, equals, text = override.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(_KEY.match(key) for key in keys):
            raise SceneError(f"{place}: not of the form key.path=value; {_FORM}")
        _put(result, keys, _value(text.strip(), place), place)
    return result


def _value(text: str, place: str) -> Any:
    if not text:
        raise SceneError(f'{place}: no value after "="; an empty text is written ""')
    try:
        document = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        if _BARE_WORD.match(text):
            return text
        message = f'{place}: the value is neither TOML (0.5, [1, 2, 3], true, "text") nor a bare word; {_FORM}'
        raise SceneError(message) from None
    if set(document) != {"value"}:
        raise SceneError(f"{place}: more than one value; {_FORM}")
    return document["value"]


def _put(target: Any, keys: list[str], value: Any, place: str) -> None:
    """Set one value below a table; walks through tables and lists and creates missing tables."""
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        walked = ".".join(keys[:depth])
        if isinstance(target, list):
            if not _INDEX.match(key) or int(key) >= len(target):
                valid = f"0 to {len(target) - 1}" if target else "none, it is empty"
                raise SceneError(f"{place}: {walked} is a list, found index {key}; allowed: {valid}")
            if last:
                target[int(key)] = value
            else:
                target = target[int(key)]
        elif isinstance(target, dict):
            if last:
                target[key] = value
            else:
                target = target.setdefault(key, {})
        else:
            raise SceneError(f"{place}: {walked} is {found(target)}, which has nothing below it")
