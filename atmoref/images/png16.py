"""PNG with 16 bits per channel.

Pillow reads 16-bit colour as 8-bit without a word and cannot write it, and the package that can is no longer kept; so
this small part of the format stands here. 8 bits and less go through Pillow. Source: W3C PNG (third edition), clauses
5, 7, 9, 11.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.images.image import ImageError

SIGNATURE = b"\x89PNG\r\n\x1a\n"
COLOUR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}
_CHANNELS = {0: 1, 4: 2, 2: 3, 6: 4}


def write_png16(path: Path, planes: NDArray[np.uint16], extra: list[tuple[bytes, bytes]]) -> None:
    """Write (H, W, C) codes with C = 1 to 4; `extra` are chunks (name, content) that stand before the data."""
    height, width, channels = planes.shape
    rows = np.ascontiguousarray(planes, ">u2").view(np.uint8).reshape(height, width * channels * 2)
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    filtered[:, 0] = 2  # "up": each byte less the one above, modulo 256
    filtered[:, 1:] = rows
    filtered[1:, 1:] -= rows[:-1]
    header = struct.pack(">IIBBBBB", width, height, 16, COLOUR_TYPES[channels], 0, 0, 0)
    with path.open("wb") as stream:
        stream.write(SIGNATURE)
        for name, content in [
            (b"IHDR", header),
            *extra,
            (b"IDAT", zlib.compress(filtered.tobytes(), 6)),
            (b"IEND", b""),
        ]:
            stream.write(struct.pack(">I", len(content)) + name + content)
            stream.write(struct.pack(">I", zlib.crc32(name + content)))


def read_png16(path: Path) -> tuple[NDArray[np.uint16], dict[bytes, list[bytes]]]:
    """Return the (H, W, C) codes and all chunks by name; the size has been checked by the caller.

    Raises
    ------
    ImageError
        If the file is truncated, a checksum is wrong, or the image is interlaced.
    """
    chunks = read_chunks(path)
    width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", chunks[b"IHDR"][0])
    if depth != 16 or colour not in _CHANNELS or interlaced:
        raise ImageError.of(path, "interlaced or palette PNG files of 16 bits are not read")
    step = 2 * _CHANNELS[colour]
    expected = height * (1 + width * step)
    unpack = zlib.decompressobj()
    try:
        data = unpack.decompress(b"".join(chunks.get(b"IDAT", [])), expected + 1)
    except zlib.error as error:
        raise ImageError.of(path, f"the image data is damaged ({error})") from error
    if len(data) != expected:
        what = "truncated" if len(data) < expected else "longer than its header says"
        raise ImageError.of(path, f"the image data is {what}: {expected} bytes expected, found {len(data)}")
    filtered = np.frombuffer(data, np.uint8).reshape(height, 1 + width * step)
    if filtered[:, 0].max() > 4:
        raise ImageError.of(path, "the image data is damaged (unknown row filter)")
    rows = _unfiltered(filtered, step)
    return rows.view(">u2").astype(np.uint16).reshape(height, width, step // 2), chunks


def read_chunks(path: Path) -> dict[bytes, list[bytes]]:
    """Return the content of all chunks by name, after checking length and checksum of each."""
    content = path.read_bytes()
    chunks: dict[bytes, list[bytes]] = {}
    at = len(SIGNATURE)
    if content[:at] != SIGNATURE:
        raise ImageError.of(path, "not a PNG file")
    while b"IEND" not in chunks:
        if at + 12 > len(content):
            raise ImageError.of(path, f"truncated after {len(content)} bytes")
        length, name = struct.unpack_from(">I4s", content, at)
        end = at + 12 + length
        if end > len(content):
            raise ImageError.of(path, f"truncated: chunk {name!r} should end at byte {end} of {len(content)}")
        if zlib.crc32(content[at + 4 : end - 4]) != struct.unpack_from(">I", content, end - 4)[0]:
            raise ImageError.of(path, f"damaged: the checksum of chunk {name!r} at byte {at} is wrong")
        chunks.setdefault(name, []).append(content[at + 8 : end - 4])
        at = end
    if b"IHDR" not in chunks or len(chunks[b"IHDR"][0]) != 13:
        raise ImageError.of(path, "the PNG header is missing or damaged")
    return chunks


def _unfiltered(filtered: NDArray[Any], step: int) -> NDArray[np.uint8]:
    """Return the rows without their filters (clause 9.2); sums are modulo 256."""
    height, length = filtered.shape[0], filtered.shape[1] - 1
    rows = np.zeros((height + 1, length), np.uint8)
    for row in range(height):
        kind, above, here = int(filtered[row, 0]), rows[row], filtered[row, 1:]
        if kind == 0:
            rows[row + 1] = here
        elif kind == 1:
            rows[row + 1] = np.cumsum(here.reshape(-1, step), axis=0, dtype=np.uint8).reshape(-1)
        elif kind == 2:
            rows[row + 1] = here + above
        else:
            rows[row + 1] = _sequential(kind, here.tolist(), above.tolist(), step)
    return np.ascontiguousarray(rows[1:])


def _sequential(kind: int, here: list[int], above: list[int], step: int) -> list[int]:
    """Undo filter 3 (average) or 4 (Paeth) on one row, byte after byte."""
    out: list[int] = []
    for at, byte in enumerate(here):
        left = out[at - step] if at >= step else 0
        up = above[at]
        if kind == 3:
            guess = (left + up) // 2
        else:
            corner = above[at - step] if at >= step else 0
            far_left, far_up, far_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
            nearest_up = up if far_up <= far_corner else corner
            guess = left if far_left <= far_up and far_left <= far_corner else nearest_up
        out.append((byte + guess) & 0xFF)
    return out
