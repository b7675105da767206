"""KTX2 files of uncompressed textures: one level, one layer, one face [Khronos KTX 2.0, sec. 3; Data Format 1.3].

Written here because the well-kept library does not install on a bare machine; other readers check it in tests.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.formats import Format

IDENTIFIER: Final = bytes([0xAB, 0x4B, 0x54, 0x58, 0x20, 0x32, 0x30, 0xBB, 0x0D, 0x0A, 0x1A, 0x0A])
_HEADER_BYTES: Final = 12 + 9 * 4 + 4 * 4 + 2 * 8 + 3 * 8
# Vulkan formats by (kind of number, bytes of a channel): R, RG, (none), RGBA
VK_FORMATS: Final = {
    ("unorm", 1): {1: 9, 2: 16, 4: 37}, ("unorm", 2): {1: 70, 2: 77, 4: 91},
    ("float", 2): {1: 76, 2: 83, 4: 97}, ("float", 4): {1: 100, 2: 103, 4: 109},
}  # fmt: skip
_CHANNEL_IDS: Final = (0, 1, 2, 15)  # R, G, B, A


def ktx2_bytes(texels: NDArray[np.generic], fmt: Format) -> bytes:
    """Return a KTX2 file of codes or numbers (H, W, C), row 0 first as stored; three channels get an alpha of 1.

    unorm8, unorm16, float16 and float32 keep their codes; other formats are given as float32 values by the caller.

    Raises
    ------
    ValueError
        A type that KTX2 holds in no plain format.
    """
    kind = "unorm" if texels.dtype.kind == "u" else "float"
    size = texels.dtype.itemsize
    if (kind, size) not in VK_FORMATS or (kind == "unorm" and fmt.bits != 8 * size):
        raise ValueError(f"{fmt.name} of type {texels.dtype} has no plain KTX2 format")
    if texels.shape[2] == 3:
        one = np.full((*texels.shape[:2], 1), fmt.top if kind == "unorm" else 1, texels.dtype)
        texels = np.concatenate([texels, one], -1)
    height, width, channels = texels.shape
    data = np.ascontiguousarray(texels, texels.dtype.newbyteorder("<")).tobytes()
    descriptor = _descriptor(kind, size, channels)
    writer = b"KTXwriter\0atmoref\0"
    entries = b"".join(
        struct.pack("<I", len(pair)) + pair + bytes(-len(pair) % 4) for pair in (b"KTXorientation\0rd\0", writer)
    )
    at_descriptor = _HEADER_BYTES
    at_entries = at_descriptor + len(descriptor)
    unit = size * channels
    step = unit * 4 // np.gcd(unit, 4)
    at_data = -(-(at_entries + len(entries)) // step) * step
    head = IDENTIFIER + struct.pack("<9I", VK_FORMATS[kind, size][channels], size, width, height, 0, 0, 1, 1, 0)
    head += struct.pack("<4I2Q", at_descriptor, len(descriptor), at_entries, len(entries), 0, 0)
    head += struct.pack("<3Q", at_data, len(data), len(data))
    body = head + descriptor + entries
    return body + bytes(at_data - len(body)) + data


def _descriptor(kind: str, size: int, channels: int) -> bytes:
    """Return the data format descriptor: one basic block, one sample a channel, linear, BT.709 primaries."""
    block = 24 + 16 * channels
    words = [4 + block, 0, 2 | (block << 16), 1 | (1 << 8) | (1 << 16), 0, size * channels, 0]
    signed, floating = 0x40, 0x80
    for channel in range(channels):
        identity = _CHANNEL_IDS[channel] | (signed | floating if kind == "float" else 0)
        if kind == "float":
            low, high = struct.unpack("<2I", struct.pack("<2f", -1.0, 1.0))
        else:
            low, high = 0, (1 << (8 * size)) - 1
        words += [8 * size * channel | (8 * size - 1) << 16 | identity << 24, 0, low, high]
    return struct.pack(f"<{len(words)}I", *words)


def write_ktx2(path: Path, texels: NDArray[np.generic], fmt: Format) -> None:
    """Write `ktx2_bytes`."""
    path.write_bytes(ktx2_bytes(texels, fmt))
