"""Write plain values as TOML: enough for a scene, read back to equal values by any TOML parser."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+\Z")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r", "\b": "\\b", "\f": "\\f"}


def to_toml(mapping: Mapping[str, Any]) -> str:
    """Return a TOML document: scalars first, then a [table] or [[tables]] for each mapping or list of mappings.

    Floats are written shortest and read back to the same bits. Tables below the second level are written inline.

    Raises
    ------
    TypeError
        For a value that is not text, number, truth value, sequence or mapping with text keys.
    """
    lines = [f"{_key(key)} = {_value(value)}" for key, value in mapping.items() if not _is_table(value)]
    for key, value in mapping.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{_key(key)}]", *_body(value)]
            lines += _tables_below(key, value)
        elif _is_table(value):
            for item in value:
                lines += ["", f"[[{_key(key)}]]", *(f"{_key(name)} = {_value(entry)}" for name, entry in item.items())]
    return "\n".join(lines).lstrip("\n") + "\n"


def _body(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {_value(value)}" for key, value in table.items() if not _is_long(value)]


def _tables_below(parent: str, table: Mapping[str, Any]) -> list[str]:
    lines: list[str] = []
    for key, value in table.items():
        if _is_long(value):
            lines += ["", f"[{_key(parent)}.{_key(key)}]"]
            lines += [f"{_key(name)} = {_value(entry)}" for name, entry in value.items()]
    return lines


def _is_long(value: Any) -> bool:
    return isinstance(value, Mapping)


def _is_table(value: Any) -> bool:
    if isinstance(value, Mapping):
        return True
    listed = isinstance(value, Sequence) and not isinstance(value, str)
    return listed and len(value) > 0 and all(isinstance(item, Mapping) for item in value)


def _key(key: str) -> str:
    if not isinstance(key, str):
        raise TypeError(f"TOML keys are text, not {key!r}")
    return key if _BARE_KEY.match(key) else _text(key)


def _text(value: str) -> str:
    pieces = [_ESCAPES.get(c) or (f"\\u{ord(c):04x}" if ord(c) < 32 or ord(c) == 127 else c) for c in value]
    return '"' + "".join(pieces) + '"'


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_value, value)) + "]"
    raise TypeError(f"TOML cannot hold {value!r}")
