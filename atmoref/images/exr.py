"""OpenEXR: ZIP compression, named channels, attributes; through the OpenEXR package."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.images.exr_header import read_header
from atmoref.images.image import Image, ImageError, check_size

NARROWED = "float32_of_float64"
CODE_TYPES = "code_types"
_STANDARD = frozenset(
    ("channels", "compression", "dataWindow", "displayWindow", "lineOrder", "pixelAspectRatio", "screenWindowCenter")
    + ("screenWindowWidth", "type", "name", "version", "chunkCount", "tiles", "view")
)
_LONGEST_NAME = 255


def write_exr(path: Path, image: Image) -> None:
    """Write all channels, ZIP-compressed: float16 and float32 as they are, codes as uint32, float64 rounded to float32.

    EXR has no float64 pixels: attribute ``float32_of_float64`` then names the channels that were rounded. Attribute
    ``code_types`` names the integer types, which `read_exr` restores. Float attributes are kept in double precision.

    Raises
    ------
    ImageError
        If a finite float64 value overflows float32, or a name is reserved or longer than 255 bytes.
    OSError
        If the file system refuses, for example because it is full.
    """
    import OpenEXR

    planes = {name: _stored(path, name, plane) for name, plane in image.channels.items()}
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= _header_attributes(path, image)
    with OpenEXR.File(header, planes) as file:
        try:
            file.write(str(path))
        except RuntimeError as error:
            raise _system_error(path, error) from error


def _system_error(path: Path, error: RuntimeError) -> OSError:
    """Return what OpenEXR met when it wrote: a full disk if its message says so, otherwise some fault of the device."""
    full = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    number = next((n for n in full if os.strerror(n) in str(error)), errno.EIO)
    return OSError(number, os.strerror(number), str(path))


def read_exr(path: Path, max_bytes: int) -> Image:
    """Read all channels and the attributes that are text or numbers; row 0 is the top row of the data window."""
    import OpenEXR

    header = read_header(path)
    check_size(path, header.width, header.height, header.bytes_per_pixel, max_bytes)
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            part = file.parts[0]
            channels = {name: np.array(channel.pixels) for name, channel in part.channels.items()}
            attributes = _plain(part.header)
    except (RuntimeError, ValueError, IndexError, TypeError, MemoryError) as error:
        raise ImageError.of(path, f"the OpenEXR data is damaged ({error})") from error
    try:
        types = json.loads(str(attributes.pop(CODE_TYPES, "{}")))
        for name, kind in types.items():
            channels[name] = _restored(channels[name], kind)
        return Image(channels, attributes)
    except (ImageError, ValueError, KeyError, AttributeError, TypeError) as error:
        raise ImageError.of(path, f"its content is not an image of atmoref ({error})") from error


def _stored(path: Path, name: str, plane: NDArray[Any]) -> NDArray[Any]:
    """Return one channel in a type that EXR has."""
    if len(name.encode()) > _LONGEST_NAME:
        raise ImageError.of(path, f"channel name {name[:32]}... is longer than {_LONGEST_NAME} bytes")
    if plane.dtype.kind == "u":
        return np.ascontiguousarray(plane, np.uint32)
    if plane.dtype != np.float64:
        return np.ascontiguousarray(plane)
    with np.errstate(over="ignore"):
        narrow = np.ascontiguousarray(plane, np.float32)
    if np.isinf(narrow).sum() != np.isinf(plane).sum():
        raise ImageError.of(path, f"channel {name} has values beyond float32; write .npz instead, which keeps float64")
    return narrow


def _restored(codes: NDArray[Any], kind: str) -> NDArray[Any]:
    """Return codes in the integer type they had before `write_exr` widened them."""
    if kind not in ("uint8", "uint16") or codes.dtype != np.uint32 or codes.max() > np.iinfo(kind).max:
        raise ImageError(f"its attribute {CODE_TYPES} does not fit the stored codes")
    return codes.astype(kind)


def _header_attributes(path: Path, image: Image) -> dict[str, Any]:
    narrowed = [name for name, plane in image.channels.items() if plane.dtype == np.float64]
    types = {
        name: plane.dtype.name for name, plane in image.channels.items() if plane.dtype.name in ("uint8", "uint16")
    }
    out: dict[str, Any] = {}
    for key, value in image.attributes.items():
        if key in _STANDARD or key == CODE_TYPES or not 0 < len(key.encode()) <= _LONGEST_NAME:
            raise ImageError.of(path, f"attribute name {key[:32]!r} cannot be used in an OpenEXR file")
        if isinstance(value, float):
            out[key] = np.array([value], np.float64)
        else:
            out[key] = value if isinstance(value, int) and -(2**31) <= value < 2**31 else str(value)
    if narrowed:
        out[NARROWED] = " ".join(narrowed)
    if types:
        out[CODE_TYPES] = json.dumps(types)
    return out


def _plain(header: Mapping[str, Any]) -> dict[str, str | float | int]:
    out: dict[str, str | float | int] = {}
    for key, value in header.items():
        if key in _STANDARD:
            continue
        if isinstance(value, (str, int, float)):
            out[key] = value
        elif isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind == "f":
            out[key] = float(value.reshape(-1)[0])
    return out
