"""Say in words what a key of a scene file allows, from its pydantic field."""

from __future__ import annotations

import datetime
import re
import types
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

_MAX_SHOWN = 60


@dataclass(frozen=True, slots=True)
class Allowed:
    """Marker for ``Annotated``: the text that says what the value may be, where no rule below finds a good one."""

    text: str


def unit_of(field: FieldInfo) -> str:
    """Return the unit a field was declared with, or an empty string."""
    extra = field.json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def allowed(field: FieldInfo) -> str:
    """Return what a field allows: kind, unit, range, as one phrase."""
    return _phrase(field.annotation, field.metadata, unit_of(field), field.discriminator)


def allowed_kind(annotation: Any) -> str:
    """Return what a type allows, where no field declares it."""
    return _phrase(annotation, (), "")


def found(value: object) -> str:
    """Return a value as the user would recognise it from the file, shortened if it is long."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        keys = ", ".join(map(str, value)) or "none"
        return f"a table (keys: {shorten(keys)})"
    if isinstance(value, datetime.date | datetime.time):
        return f"the date or time {value}"
    if isinstance(value, str):
        return '"' + shorten(value.replace("\n", "\\n")) + '"'
    if isinstance(value, int) and value.bit_length() > 64:
        return f"an integer of {value.bit_length()} bits"
    if isinstance(value, list | tuple):
        return "[" + shorten(", ".join(map(found, value[:_MAX_SHOWN]))) + "]"
    return shorten(repr(value))


def shorten(text: str) -> str:
    """Return text cut to a readable length."""
    return text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 1] + "…"


def _phrase(annotation: Any, metadata: Iterable[Any], unit: str, discriminator: object = None) -> str:
    metadata = list(metadata)
    for mark in metadata:
        if isinstance(mark, Allowed):
            return mark.text + (f" ({unit})" if unit and f"({unit})" not in mark.text else "")
        if isinstance(mark, FieldInfo):
            return _phrase(annotation, [*mark.metadata], unit, mark.discriminator)
    if get_origin(annotation) is Annotated:
        inner, *marks = get_args(annotation)
        flat = [piece for mark in marks for piece in _pieces(mark)]
        tags = [mark.discriminator for mark in marks if isinstance(mark, FieldInfo) and mark.discriminator]
        return _phrase(inner, [*flat, *metadata], unit, tags[0] if tags else discriminator)
    return _kind(annotation, unit, discriminator) + _limits(metadata)


def _pieces(mark: Any) -> list[Any]:
    return list(mark.metadata) if isinstance(mark, FieldInfo) else [mark]


def _kind(annotation: Any, unit: str, discriminator: object) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    in_unit = f" ({unit})" if unit else ""
    if origin is Literal:
        return choice(arguments)
    if origin in (Union, types.UnionType):
        members = [member for member in arguments if member is not type(None)]
        if discriminator:
            return f"a table with {discriminator} = " + choice(tags(members, str(discriminator)))
        return " or ".join(dict.fromkeys(_phrase(member, (), unit) for member in members))
    if origin in (list, tuple):
        items = [item for item in arguments if item is not Ellipsis]
        count = "" if origin is list or Ellipsis in arguments else f"{len(items)} "
        return f"a list of {count}({_phrase(items[0], (), unit)})" if items else "a list"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "a table with the keys " + ", ".join(key_names(annotation))
    words = {bool: "true or false", int: "an integer", float: "a finite number", str: "text", dict: "a table"}
    return words.get(origin or annotation, "a value") + in_unit


def tags(members: Iterable[Any], discriminator: str) -> list[str]:
    """Return the values of the discriminator key over the members of a union of models."""
    return [str(tag) for member in members for tag in get_args(member.model_fields[discriminator].annotation)]


def choice(values: Iterable[object]) -> str:
    """Return 'one of "a", "b"'."""
    shown = [found(value) for value in values]
    return shown[0] if len(shown) == 1 else "one of " + ", ".join(shown)


def key_names(model: type[BaseModel]) -> list[str]:
    """Return the keys of a table as they are written in the file."""
    return [field.alias or name for name, field in model.model_fields.items()]


def _number(value: Any) -> str:
    """Return a limit as one writes it: 16384, 0.01, 1e9."""
    if not isinstance(value, int | float):
        return str(value)
    short = re.sub(r"e([+-])0*", r"e\1", f"{value:.2e}" if abs(value) >= 1e6 else f"{value:.10g}")
    short = re.sub(r"\.?0*e\+?", "e", short)
    return short if float(short) == value else repr(value)


def _limits(metadata: Iterable[Any]) -> str:
    words = {
        "gt": "> {}",
        "ge": ">= {}",
        "lt": "< {}",
        "le": "<= {}",
        "min_length": "at least {} of them",
        "max_length": "at most {} of them",
        "pattern": "matching {}",
    }
    parts = [
        text.format(_number(getattr(mark, name)))
        for mark in metadata
        for name, text in words.items()
        if getattr(mark, name, None) is not None
    ]
    return "".join(f", {part}" for part in parts)
