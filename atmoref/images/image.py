"""What an image file holds: named channels over one grid, and attributes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_BYTES = 1 << 30
"""Decoded size above which a file is refused before anything is allocated; a caller may state another limit."""

CHANNEL_TYPES = ("float16", "float32", "float64", "uint8", "uint16", "uint32")
COLOUR_ORDER = ("R", "G", "B", "A")
_UNORM = re.compile(r"^(?:unorm|depth)(\d+)$")


class ImageError(ValueError):
    """An image or its file cannot be used; the message names the file and says what is wrong."""

    @classmethod
    def of(cls, path: str | Path, problem: str) -> Self:
        """Return the error for one file."""
        return cls(f"{path}: {problem}")


class TooLarge(ImageError):
    """An image would take more memory when decoded than the caller allows: `needed` bytes."""

    needed: int = 0


@dataclass(frozen=True, slots=True)
class Image:
    """Channels over one grid of pixels, row 0 at the top, and what is known about them.

    Parameters
    ----------
    channels : mapping of str to (H, W) array
        Named as in an EXR file: ``R``, ``G``, ``B``, ``A``, ``Y``, or with a layer in front, ``stage.plane_007.R``.
        Element types are those of `CHANNEL_TYPES`. Unsigned integers are codes of a unorm format, floats are values.
    attributes : mapping of str to str, float or int
        Two are understood here. ``format``: the name of the format whose codes an integer channel holds (``unorm12``);
        without it the integer's own width counts. ``transfer``: ``linear``, ``srgb`` (values are encoded for display)
        or ``codes`` (stored codes, shown as they are).

    Raises
    ------
    ImageError
        If there is no channel or no pixel, or if channels differ in shape, are not planes, or have another type.
    """

    channels: dict[str, NDArray[Any]]
    attributes: dict[str, str | float | int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.channels:
            raise ImageError("an image needs at least one channel")
        shapes = {np.shape(plane) for plane in self.channels.values()}
        if len(shapes) != 1:
            told = ", ".join(f"{name} {np.shape(plane)}" for name, plane in list(self.channels.items())[:8])
            raise ImageError(f"channels differ in shape: {told}")
        shape = shapes.pop()
        if len(shape) != 2 or 0 in shape:
            raise ImageError(f"channels must be planes with at least one pixel, found shape {shape}")
        for name, plane in self.channels.items():
            if not name:
                raise ImageError("a channel has no name")
            if np.asarray(plane).dtype.name not in CHANNEL_TYPES:
                raise ImageError(
                    f"channel {name} has type {np.asarray(plane).dtype}, allowed are {', '.join(CHANNEL_TYPES)}"
                )

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = next(iter(self.channels.values())).shape
        return int(height), int(width)

    def rgb(self) -> NDArray[Any]:
        """Return the colour as (H, W, 3) in the stored type; a single channel, or ``Y``, becomes three equal ones."""
        names = colour_names(self.channels)
        planes = [self.channels[name] for name in names if not name.endswith("A")]
        return np.stack(planes * 3 if len(planes) == 1 else planes, axis=-1)

    def layer(self, name: str) -> Image:
        """Return the channels of one layer under their short names; `name` "" is the base layer."""
        prefix = f"{name}." if name else ""
        found = {
            key.removeprefix(prefix): plane
            for key, plane in self.channels.items()
            if key.startswith(prefix) and "." not in key.removeprefix(prefix)
        }
        if not found:
            raise ImageError(f"no layer {name!r}; layers are {', '.join(repr(one) for one in self.layers())}")
        return Image(found, dict(self.attributes))

    def layers(self) -> list[str]:
        """Return the names of all layers in the order of their channels; "" is the base layer."""
        return list(dict.fromkeys(name.rpartition(".")[0] for name in self.channels))

    def top(self, name: str) -> int | None:
        """Return the largest code of one channel, or None where it holds values instead of codes."""
        kind = self.channels[name].dtype
        if kind.kind != "u":
            return None
        stated = _UNORM.match(str(self.attributes.get("format", "")))
        bits = int(stated.group(1)) if stated else kind.itemsize * 8
        if not 1 <= bits <= kind.itemsize * 8:
            raise ImageError(f"format {self.attributes.get('format')} does not fit in channel {name} of type {kind}")
        return (1 << bits) - 1

    def values(self, name: str) -> NDArray[np.float64]:
        """Return one channel as float64; codes are divided by the largest code of their format."""
        top = self.top(name)
        plane = self.channels[name].astype(np.float64)
        return plane if top is None else plane / top


def from_rgb(array: ArrayLike, attributes: Mapping[str, str | float | int] | None = None) -> Image:
    """Return an image of an array of shape (H, W) or (H, W, C), C = 1 to 4: ``Y``, ``Y A``, ``R G B``, ``R G B A``.

    Raises
    ------
    ImageError
        If the array has another shape or type; signed integers and booleans are taken where their values fit.
    """
    whole = _channel_type(np.asarray(array))
    planes = whole[..., np.newaxis] if whole.ndim == 2 else whole
    if planes.ndim != 3 or not 1 <= planes.shape[2] <= 4:
        raise ImageError(f"expected an array of shape (H, W) or (H, W, 1 to 4), found {whole.shape}")
    names = {1: ("Y",), 2: ("Y", "A"), 3: COLOUR_ORDER[:3], 4: COLOUR_ORDER}[planes.shape[2]]
    channels = {name: np.ascontiguousarray(planes[..., at]) for at, name in enumerate(names)}
    return Image(channels, dict(attributes or {}))


def colour_names(channels: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    """Return the names of the colour channels in order, alpha last.

    Raises
    ------
    ImageError
        If there is neither ``R G B`` nor ``Y`` nor exactly one channel.
    """
    alpha = ("A",) if "A" in channels else ()
    if all(name in channels for name in COLOUR_ORDER[:3]):
        return (*COLOUR_ORDER[:3], *alpha)
    if "Y" in channels:
        return ("Y", *alpha)
    if len(channels) == 1:
        return tuple(channels)
    raise ImageError(f"no colour among the channels {', '.join(list(channels)[:8])}: expected R G B, Y, or one alone")


def check_size(path: str | Path, width: int, height: int, bytes_per_pixel: int, max_bytes: int) -> None:
    """Refuse an empty image, and one that would take more than `max_bytes` when decoded."""
    if width < 1 or height < 1:
        raise ImageError.of(path, f"the header states an empty image, {width} x {height}")
    if width * height * max(1, bytes_per_pixel) > max_bytes:
        error = TooLarge.of(
            path,
            f"the header states {width} x {height} pixels of {bytes_per_pixel} bytes, more than the limit of "
            f"{max_bytes / 2**20:.0f} MiB; nothing was allocated",
        )
        error.needed = width * height * max(1, bytes_per_pixel)
        raise error


def first_not_finite(image: Image) -> str | None:
    """Return the channel and place of the first NaN or infinity, as text, or None."""
    for name, plane in image.channels.items():
        if plane.dtype.kind == "f" and not np.isfinite(plane).all():
            row, column = (int(at) for at in np.argwhere(~np.isfinite(plane))[0])
            value = float(plane[row, column])
            told = "NaN" if math.isnan(value) else f"{value:+}"
            return f"{told} in channel {name} at x = {column}, y = {row}"
    return None


def _channel_type(array: NDArray[Any]) -> NDArray[Any]:
    """Return `array` in a channel's type: native order; booleans and integers become unsigned where they fit."""
    if array.dtype.name in CHANNEL_TYPES:
        return array.astype(array.dtype.newbyteorder("="), copy=False)
    if array.dtype.kind == "b":
        return array.astype(np.uint8)
    if array.dtype.kind in "iu" and array.size and array.min() >= 0 and array.max() <= 0xFFFFFFFF:
        return array.astype(np.uint32)
    raise ImageError(f"arrays of type {array.dtype} cannot be channels, allowed are {', '.join(CHANNEL_TYPES)}")
