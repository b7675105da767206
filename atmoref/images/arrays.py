"""NPY and NPZ: NumPy's own files, read without pickle and with all sizes checked before loading."""

from __future__ import annotations

import ast
import io
import json
import math
import re
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from atmoref.images.image import Image, ImageError, check_size, from_rgb

ATTRIBUTES = "__attributes__"
_NUMBERS = re.compile(r"^[<>|=]?[biuf]\d{1,2}$")
_LONGEST_HEADER = 10_000
_EPOCH = (1980, 1, 1, 0, 0, 0)


def write_npz(path: Path, image: Image) -> None:
    """Write channels under their names, in their own type (float64 is kept), and attributes as JSON text in UTF-8.

    Equal images give equal bytes: members are in order and carry no time.
    """
    text = json.dumps(image.attributes, ensure_ascii=False).encode()
    members = {**image.channels, ATTRIBUTES: np.frombuffer(text, np.uint8)}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in members.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy", _EPOCH), "w", force_zip64=True) as member:
                content = io.BytesIO()
                npy_format.write_array(content, np.ascontiguousarray(array), allow_pickle=False)
                member.write(content.getbuffer())


def read_npy(path: Path, max_bytes: int) -> Image:
    """Read one array of shape (H, W) or (H, W, 1 to 4)."""
    with path.open("rb") as stream:
        array = _read_array(path, stream, path.stat().st_size, path.name, max_bytes)
    try:
        return from_rgb(array)
    except ImageError as error:
        raise ImageError.of(path, str(error)) from error


def read_npz(path: Path, max_bytes: int) -> Image:
    """Read channels that `write_npz` wrote, or another archive's planes; a lone (H, W, C) array becomes its colours."""
    arrays: dict[str, NDArray[Any]] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            total = sum(member.file_size for member in archive.infolist())
            if total > max_bytes:
                raise ImageError.of(path, f"holds {total} bytes when unpacked, more than the limit of {max_bytes}")
            for member in archive.infolist():
                if member.flag_bits & 1:
                    raise ImageError.of(path, f"member {member.filename} is encrypted")
                with archive.open(member) as stream:
                    name = member.filename.removesuffix(".npy")
                    arrays[name] = _read_array(path, stream, member.file_size, member.filename, max_bytes)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, RuntimeError) as error:
        raise ImageError.of(path, f"truncated, damaged or not an NPZ file ({error})") from error
    try:
        text = arrays.pop(ATTRIBUTES, np.frombuffer(b"{}", np.uint8)).tobytes()
        attributes = _attributes(text)
        if len(arrays) == 1 and next(iter(arrays.values())).ndim == 3:
            return from_rgb(next(iter(arrays.values())), attributes)
        channels = {name: from_rgb(array).channels["Y"] for name, array in arrays.items() if array.ndim == 2}
        if len(channels) != len(arrays):
            other = next(name for name in arrays if name not in channels)
            raise ImageError(f"array {other} of shape {arrays[other].shape} is not a plane")
        return Image(channels, attributes)
    except (ImageError, ValueError) as error:
        raise ImageError.of(path, str(error)) from error


def _attributes(text: bytes) -> dict[str, str | float | int]:
    found = json.loads(text.decode())
    if not isinstance(found, dict) or not all(isinstance(value, (str, int, float)) for value in found.values()):
        raise ImageError("the attributes are not a table of texts and numbers")
    return found


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, order and type of an NPY stream; its header is the text of a Python literal, read as no more.

    NumPy's own reader repairs headers of Python 2 with a tokenizer that raises errors of many kinds on damaged text.
    """
    version = npy_format.read_magic(stream)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ValueError(f"version {version} of the format is not known")
    size = 2 if version == (1, 0) else 4
    length = int.from_bytes(stream.read(size), "little")
    if length > _LONGEST_HEADER:
        raise ValueError(f"a header of {length} bytes")
    fields = ast.literal_eval(stream.read(length).decode("utf-8" if version == (3, 0) else "latin-1").strip())
    if not isinstance(fields, dict) or set(fields) != {"descr", "fortran_order", "shape"}:
        raise ValueError("its fields are not descr, fortran_order and shape")
    shape, fortran, kind = fields["shape"], fields["fortran_order"], fields["descr"]
    if not (isinstance(shape, tuple) and all(type(one) is int for one in shape) and isinstance(fortran, bool)):
        raise ValueError("its shape or order is of the wrong type")
    if not isinstance(kind, str) or not _NUMBERS.match(kind):
        raise ValueError(f"elements of type {kind!r}, records and objects among them, are not read")
    return shape, fortran, np.dtype(kind)


def _read_array(path: Path, stream: IO[bytes], size: int, name: str, max_bytes: int) -> NDArray[Any]:
    """Read one array from a stream of `size` bytes, after its header and size have been found sound."""
    try:
        shape, fortran, dtype = _header(stream)
    except (ValueError, EOFError, SyntaxError, TypeError, KeyError, RecursionError, MemoryError) as error:
        problem = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ImageError.of(path, f"{name} is truncated or has a wrong NPY header ({problem})") from error
    if not 1 <= len(shape) <= 3 or any(length < 0 for length in shape):
        raise ImageError.of(path, f"{name} has shape {shape}, expected a plane or an image")
    rest = math.prod(shape[2:]) * dtype.itemsize
    if len(shape) > 1:
        check_size(path, shape[1], shape[0], rest, max_bytes)
    expected = math.prod(shape) * dtype.itemsize
    found = size - stream.tell()
    if expected != found:
        what = "truncated" if found < expected else "longer than its header says"
        raise ImageError.of(path, f"{name} is {what}: shape {shape} of {dtype} takes {expected} bytes, found {found}")
    data = stream.read(expected)
    if len(data) != expected:
        raise ImageError.of(path, f"{name} is truncated: {expected} bytes expected, found {len(data)}")
    array = np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")
    return np.ascontiguousarray(array.astype(dtype.newbyteorder("="), copy=True))
