"""What the keys of a scene file are made of: quantities with units, vectors, colours, the base of all tables."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict, WithJsonSchema

from atmoref.scene.describe import Allowed

FARTHEST_M = 1e9
BRIGHTEST = 1e20
DENSEST_PER_M = 1e6


class Table(BaseModel):
    """Base of every table: frozen, no unknown keys, no coercion, no NaN, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True)


def quantity(unit: str, description: str, default: Any = ..., **limits: Any) -> Any:
    """Return a pydantic field that knows its unit.

    Parameters
    ----------
    unit
        As shown to the user, e.g. ``m`` or ``degrees``; empty for pure numbers and names.
    description
        One sentence; goes into the JSON Schema.
    default
        The value when the key is left out; required without one.
    **limits
        ``gt ge lt le min_length max_length pattern alias`` of ``pydantic.Field``.
    """
    extra: dict[str, Any] | None = {"unit": unit} if unit else None
    text = f"{description} Unit: {unit}." if unit else description
    return Field(default, description=text, json_schema_extra=extra, **limits)


def _three(value: Any) -> Any:
    """Return one number three times; anything else as it is."""
    return (value, value, value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _channels_schema(minimum: float, maximum: float) -> WithJsonSchema:
    number = {"type": "number", "minimum": minimum, "maximum": maximum}
    return WithJsonSchema({"anyOf": [number, {"type": "array", "items": number, "minItems": 3, "maxItems": 3}]})


_Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
_Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
_Bright = Annotated[float, Field(ge=0.0, le=BRIGHTEST)]
_Dense = Annotated[float, Field(ge=0.0, le=DENSEST_PER_M)]

Vector = Annotated[
    tuple[_Coordinate, _Coordinate, _Coordinate],
    Strict(False),
    Allowed("a list of three finite numbers [x, y, z], each >= -1e9 and <= 1e9"),
]
"""Three coordinates, y up."""

Fractions = Annotated[
    tuple[_Fraction, _Fraction, _Fraction],
    Strict(False),
    BeforeValidator(_three),
    _channels_schema(0.0, 1.0),
    Allowed("one number or a list of three, each >= 0 and <= 1"),
]
"""One number in [0, 1] per colour channel; a single number stands for three equal ones."""

Radiances = Annotated[
    tuple[_Bright, _Bright, _Bright],
    Strict(False),
    BeforeValidator(_three),
    _channels_schema(0.0, BRIGHTEST),
    Allowed("one finite number or a list of three, each >= 0 and <= 1e20"),
]
"""A non-negative amount of light per colour channel."""

Extinctions = Annotated[
    tuple[_Dense, _Dense, _Dense],
    Strict(False),
    BeforeValidator(_three),
    _channels_schema(0.0, DENSEST_PER_M),
    Allowed("one finite number or a list of three, each >= 0 and <= 1e6"),
]
"""A non-negative extinction coefficient per colour channel."""

FileName = Annotated[
    str,
    Field(min_length=1, max_length=1024),
    Allowed("the name of a file in the folder of the scene file or below it"),
]
"""A file that belongs to a scene."""
BESIDE = "A file in the folder of the scene file or below it."
