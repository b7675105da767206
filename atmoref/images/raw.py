"""Raw texels with a JSON sidecar: ``NAME.raw`` beside ``NAME.json``, as reference packs hold them."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from atmoref.images.image import CHANNEL_TYPES, Image, ImageError, check_size, from_rgb

MOST_SIDECAR = 1 << 20
_TYPE = re.compile(r"^[<>|][uf][1248]$")


def read_raw(path: Path, max_bytes: int) -> Image:
    """Read texels (H, W, C), channels together; the sidecar states what they are.

    Its keys: ``width``, ``height``, ``channels`` (1 to 4), ``type`` (``|u1``, ``<u2``, ``<f2``, ``<f4``, ...: byte
    order, kind, bytes), and, if wanted, ``origin`` (``top``, the default, or ``bottom``), ``format`` and ``transfer``.
    """
    told = _sidecar(path, path.with_suffix(".json"))
    width, height, channels = (told[key] for key in ("width", "height", "channels"))
    dtype = np.dtype(told["type"])
    check_size(path, width, height, channels * dtype.itemsize, max_bytes)
    expected, found = math.prod((width, height, channels, dtype.itemsize)), path.stat().st_size
    if expected != found:
        what = "truncated" if found < expected else "longer than its sidecar says"
        raise ImageError.of(path, f"{what}: {expected} bytes expected, found {found}")
    texels = np.frombuffer(path.read_bytes(), dtype).reshape(height, width, channels)
    if told.get("origin", "top") == "bottom":
        texels = texels[::-1]
    kept: dict[str, str | float | int] = {key: told[key] for key in ("format", "transfer") if key in told}
    return from_rgb(np.ascontiguousarray(texels.astype(dtype.newbyteorder("="))), kept)


def _sidecar(path: Path, sidecar: Path) -> dict[str, Any]:
    if not sidecar.is_file():
        raise ImageError.of(path, f"raw texels need a sidecar {sidecar.name} with width, height, channels and type")
    if sidecar.stat().st_size > MOST_SIDECAR:
        raise ImageError.of(sidecar, f"{sidecar.stat().st_size} bytes, more than the limit of {MOST_SIDECAR}")
    try:
        told = json.loads(sidecar.read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise ImageError.of(sidecar, f"no JSON ({error})") from error
    if not isinstance(told, dict):
        raise ImageError.of(sidecar, "is no table")
    for key, most in (("width", 1 << 20), ("height", 1 << 20), ("channels", 4)):
        if type(told.get(key)) is not int or not 1 <= told[key] <= most:
            raise ImageError.of(sidecar, f"{key}: found {str(told.get(key))[:60]}; allowed: 1 to {most}")
    kind = told.get("type")
    if not isinstance(kind, str) or not _TYPE.match(kind) or np.dtype(kind).newbyteorder("=").name not in CHANNEL_TYPES:
        raise ImageError.of(sidecar, f"type: found {str(kind)[:60]}; allowed: |u1, <u2, <u4, <f2, <f4, <f8")
    choices = {"origin": ("top", "bottom"), "transfer": ("linear", "srgb", "codes")}
    for key, allowed in choices.items():
        if key in told and told[key] not in allowed:
            raise ImageError.of(sidecar, f"{key}: found {str(told[key])[:60]}; allowed: {', '.join(allowed)}")
    if "format" in told and not isinstance(told["format"], str):
        raise ImageError.of(sidecar, "format: allowed: a text")
    return told
