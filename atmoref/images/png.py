"""PNG: codes as they are, or radiance as a display shows it; the file says which."""

from __future__ import annotations

import json
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.images import png16
from atmoref.images.image import Image, ImageError, check_size, colour_names, first_not_finite, from_rgb
from atmoref.images.tone import display_codes

KEYWORD = "atmoref"
_CODES = "codes as they are stored, not encoded for display"


def write_png(path: Path, image: Image, *, exposure: float, bits: int) -> None:
    """Write ``R G B``, ``R G B A``, ``Y`` or ``Y A``.

    Codes (unsigned integers of 8 or 16 bits) are written as they are, so that the file compares with a screenshot.
    Values are multiplied by `exposure`, clipped to [0, 1], sRGB-encoded and rounded to `bits`; alpha is clipped alone.
    Text chunk ``Description`` states which of the two it was; chunk ``atmoref`` holds the attributes as JSON.

    Raises
    ------
    ImageError
        For NaN or infinity (with the place), other channels, mixed types, or codes that take more than 16 bits.
    """
    names = colour_names(image.channels)
    if len(names) != len(image.channels):
        extra = [name for name in image.channels if name not in names]
        raise ImageError.of(path, f"PNG holds R G B [A] or Y [A]; channels {', '.join(extra[:8])} need .exr or .npz")
    problem = first_not_finite(image)
    if problem:
        raise ImageError.of(path, f"{problem}; PNG holds finite values only")
    kinds = {image.channels[name].dtype.name for name in names}
    attributes = dict(image.attributes)
    if kinds in ({"uint8"}, {"uint16"}):
        planes = np.stack([image.channels[name] for name in names], axis=-1)
        attributes.setdefault("transfer", "codes")
        told = _CODES + f", format {attributes.get('format', f'unorm{planes.dtype.itemsize * 8}')}"
    elif any(kind.startswith("uint") for kind in kinds):
        raise ImageError.of(path, f"channels of types {', '.join(sorted(kinds))} are not codes of 8 or of 16 bits")
    else:
        planes = _shown(path, image, names, exposure, bits)
        attributes |= {"transfer": "srgb", "exposure": float(exposure)}
        told = f"linear radiance times exposure {exposure:g}, clipped to [0, 1], sRGB-encoded"
    texts = [("Description", told), (KEYWORD, json.dumps(attributes))]
    _save(path, planes, texts, attributes["transfer"] == "srgb")


def read_png(path: Path, max_bytes: int) -> Image:
    """Read the codes; attribute ``transfer`` is what `write_png` wrote, ``srgb`` by its chunk, or ``unstated``."""
    with path.open("rb") as stream:
        start = stream.read(33)
    if start[:8] != png16.SIGNATURE:
        raise ImageError.of(path, "not a PNG file" if len(start) >= 8 else "truncated within its first 8 bytes")
    if len(start) < 33 or start[12:16] != b"IHDR":
        raise ImageError.of(path, "the PNG header is truncated or damaged")
    width, height, depth = struct.unpack(">IIB", start[16:25])
    check_size(path, width, height, 8 if depth == 16 else 4, max_bytes)
    chunks = png16.read_chunks(path)
    planes = png16.read_png16(path)[0] if depth == 16 else _through_pillow(path)
    attributes: dict[str, str | float | int] = {"transfer": "srgb" if b"sRGB" in chunks else "unstated"}
    try:
        for content in chunks.get(b"tEXt", []):
            keyword, _, text = content.partition(b"\0")
            if keyword == KEYWORD.encode():
                attributes |= json.loads(text.decode("latin-1"))
        return from_rgb(planes, attributes)
    except (ValueError, TypeError) as error:
        raise ImageError.of(path, f"its text chunk is damaged ({error})") from error


def _shown(path: Path, image: Image, names: tuple[str, ...], exposure: float, bits: int) -> NDArray[Any]:
    try:
        planes = [display_codes(image.channels[name], exposure, bits) for name in names if name != "A"]
    except ValueError as error:
        raise ImageError.of(path, str(error)) from error
    if "A" in names:
        top = (1 << bits) - 1
        alpha = np.clip(image.channels["A"].astype(np.float64), 0.0, 1.0)
        planes.append(np.floor(alpha * top + 0.5).astype(planes[0].dtype))
    return np.stack(planes, axis=-1)


def _save(path: Path, planes: NDArray[Any], texts: list[tuple[str, str]], srgb: bool) -> None:
    if planes.dtype == np.uint16:
        extra = [(b"sRGB", b"\0")] if srgb else []
        extra += [(b"tEXt", key.encode("latin-1") + b"\0" + text.encode("latin-1")) for key, text in texts]
        png16.write_png16(path, planes, extra)
        return
    from PIL import Image as Picture
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    if srgb:
        info.add(b"sRGB", b"\0")
    for key, text in texts:
        info.add_text(key, text)
    squeezed = planes[..., 0] if planes.shape[-1] == 1 else planes
    Picture.fromarray(np.ascontiguousarray(squeezed)).save(path, format="PNG", pnginfo=info)


def _through_pillow(path: Path) -> NDArray[Any]:
    from PIL import Image as Picture

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # sizes were checked above, against our own limit
            with Picture.open(path, formats=("PNG",)) as picture:
                picture.load()
                plain = {"P": "RGBA" if "transparency" in picture.info else "RGB", "1": "L"}
                return np.array(picture.convert(plain.get(picture.mode, picture.mode)))
    except (OSError, SyntaxError, ValueError, EOFError, struct.error, Picture.DecompressionBombError) as error:
        raise ImageError.of(path, f"truncated or damaged ({error})") from error
