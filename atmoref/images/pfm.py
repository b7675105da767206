"""PFM: the portable float map, read only."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from atmoref.images.image import Image, ImageError, check_size, from_rgb

_HEADER = re.compile(rb"^(PF|Pf)\s+(\d{1,9})\s+(\d{1,9})\s+([-+0-9.eE]{1,32})[ \t\r]*\n")


def read_pfm(path: Path, max_bytes: int) -> Image:
    """Read a grey (``Pf``) or colour (``PF``) map; rows are turned so that row 0 is the top one.

    The sign of the scale states the byte order; its magnitude is handed on as attribute ``pfm_scale`` and not applied.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        header = _HEADER.match(stream.read(256))
        if header is None:
            raise ImageError.of(path, "not a PFM file, or its header is damaged")
        width, height, channels = int(header[2]), int(header[3]), 3 if header[1] == b"PF" else 1
        try:
            scale = float(header[4])
        except ValueError:
            scale = 0.0
        if scale == 0.0 or not np.isfinite(scale):
            raise ImageError.of(path, f"the scale {header[4].decode()!r} is not a number other than zero")
        check_size(path, width, height, 4 * channels, max_bytes)
        expected, found = width * height * channels * 4, size - header.end()
        if found < expected:
            raise ImageError.of(
                path, f"truncated: {width} x {height} x {channels} takes {expected} bytes, found {found}"
            )
        stream.seek(header.end())
        data = np.frombuffer(stream.read(expected), "<f4" if scale < 0 else ">f4")
    upright = data.reshape(height, width, channels)[::-1].astype(np.float32)
    attributes: dict[str, str | float | int] = {"transfer": "linear", "pfm_scale": abs(scale)}
    return from_rgb(upright, attributes)
