"""The header of an OpenEXR file, read far enough to refuse a broken or huge one before the library sees it.

The library prints to the terminal on damaged files and allocates what the header claims. Layout: "OpenEXR File Layout",
version 2 (magic, version and flags, attributes, offset table, chunks).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from atmoref.images.image import ImageError

MAGIC = b"\x76\x2f\x31\x01"
_TILED, _LONG_NAMES, _DEEP, _MULTI_PART = 0x200, 0x400, 0x800, 0x1000
_ROWS_PER_CHUNK = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
_BYTES = {0: 4, 1: 2, 2: 4}
_MAX_ATTRIBUTE = 1 << 24


@dataclass(frozen=True, slots=True)
class Header:
    """What decides how much a file takes: its size in pixels and the bytes of one pixel over all channels."""

    width: int
    height: int
    bytes_per_pixel: int


def read_header(path: Path) -> Header:
    """Read and check the header and the table of chunks of a flat file with one part.

    Raises
    ------
    ImageError
        If it is no such file, if the header is damaged, or if a chunk lies beyond the end of the file.
    """
    with path.open("rb") as stream:
        start = stream.read(8)
        if len(start) < 8 or start[:4] != MAGIC:
            raise ImageError.of(path, "not an OpenEXR file, or truncated within its first 8 bytes")
        flags = struct.unpack("<I", start[4:])[0]
        if flags & 0xFF != 2:
            raise ImageError.of(path, f"version {flags & 0xFF} of the OpenEXR layout is not known")
        if flags & (_DEEP | _MULTI_PART):
            raise ImageError.of(path, "deep and multi-part OpenEXR files are not read, only flat images with one part")
        try:
            attributes = _attributes(stream)
            first_x, first_y, last_x, last_y = struct.unpack("<4i", attributes["dataWindow"])
            header = Header(last_x - first_x + 1, last_y - first_y + 1, _bytes_per_pixel(path, attributes["channels"]))
            rows = _ROWS_PER_CHUNK.get(attributes["compression"][0])
        except (struct.error, KeyError, IndexError, ValueError) as error:
            raise ImageError.of(path, f"the OpenEXR header is truncated or damaged ({error})") from error
        if not flags & _TILED and rows is not None and header.height > 0:
            _check_chunks(path, stream, (header.height + rows - 1) // rows)
    return header


def _attributes(stream: BinaryIO) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    while name := _text(stream):
        _text(stream)
        size = struct.unpack("<i", stream.read(4))[0]
        if not 0 <= size <= _MAX_ATTRIBUTE:
            raise ValueError(f"attribute {name} states {size} bytes")
        found[name] = stream.read(size)
        if len(found[name]) != size:
            raise ValueError(f"attribute {name} ends early")
    return found


def _text(stream: BinaryIO) -> str:
    letters = bytearray()
    while (letter := stream.read(1)) != b"\0":
        letters += letter
        if not letter or len(letters) > 255:
            raise ValueError("a name has no end")
    return letters.decode("utf-8", "replace")


def _bytes_per_pixel(path: Path, channels: bytes) -> int:
    total, at = 0, 0
    while channels[at] != 0:
        end = channels.index(0, at)
        kind, x_step, y_step = struct.unpack_from("<i4xii", channels, end + 1)
        if (x_step, y_step) != (1, 1):
            name = channels[at:end].decode("utf-8", "replace")
            raise ImageError.of(path, f"channel {name} is subsampled by {x_step} x {y_step}, which is not read")
        total += _BYTES[kind]
        at = end + 17
    return total


def _check_chunks(path: Path, stream: BinaryIO, count: int) -> None:
    """Refuse a file whose table of chunks, or a chunk, is not inside the file."""
    start = stream.tell()
    size = path.stat().st_size
    if start + 8 * count > size:
        raise ImageError.of(path, f"truncated: {count} chunks are announced, and not even their table is complete")
    for offset in struct.unpack(f"<{count}Q", stream.read(8 * count)):
        if not start + 8 * count <= offset <= size - 8:
            raise ImageError.of(path, f"truncated or damaged: a chunk should start at byte {offset} of {size}")
        stream.seek(offset + 4)
        length = struct.unpack("<i", stream.read(4))[0]
        if length < 0 or offset + 8 + length > size:
            raise ImageError.of(path, f"truncated: a chunk should end at byte {offset + 8 + length} of {size}")
