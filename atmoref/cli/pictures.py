"""A result as files: values as EXR or NPZ, a picture as PNG, each with its provenance."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.cli.failures import RequestError
from atmoref.images import WRITABLE, Image, from_rgb, write
from atmoref.scene import Result

Attributes = dict[str, str | float | int]
_BRIGHTER_THAN_WHITE = 1e30  # what a picture shows for a radiance that is infinite


def check_output(option: str, path: Path | None, suffixes: tuple[str, ...] = WRITABLE) -> None:
    """Refuse a file that cannot be written, before anything is computed.

    Raises
    ------
    RequestError
        Wrong suffix, missing directory, or a directory in the file's place.
    OSError
        The directory cannot be written.
    """
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise RequestError(f"{option}: found {str(path)!r}; allowed: a file name that ends in {', '.join(suffixes)}")
    if path.is_dir():
        raise RequestError(f"{option}: {path} is a directory; allowed: a file name")
    check_directory(option, path.parent)


def check_directory(option: str, directory: Path) -> None:
    """Refuse a directory that is missing, or in which no file can be made; raises as `check_output`."""
    if not directory.is_dir():
        raise RequestError(f"{option}: the directory {directory} does not exist; make it first")
    try:
        with tempfile.NamedTemporaryFile(dir=directory, prefix=".atmoref-"):
            pass
    except OSError as error:
        raise OSError(error.errno, f"no file can be written there ({error.strerror})", str(directory)) from None


def attributes(provenance: Mapping[str, Any]) -> Attributes:
    """Return a result's provenance as attributes of an image file."""
    told: Attributes = {}
    for key, value in provenance.items():
        name = "atmoref_version" if key == "version" else key
        if isinstance(value, Mapping):
            told[name] = ", ".join(f"{k}={v}" for k, v in value.items())
        elif isinstance(value, list | tuple):
            told[name] = ", ".join(str(v) for v in value)
        else:
            told[name] = value if isinstance(value, str | float | int) else str(value)
        if told[name] == "":
            del told[name]
    formats = provenance.get("formats", {})
    if "frame" in formats:
        told["format"] = formats["frame"]
    return told


def bounds_image(result: Result) -> Image:
    """Return the bounds of a result in intervals, float64: layers low and high."""
    assert result.bounds is not None
    planes = {
        f"{layer}.{name}": np.ascontiguousarray(end[..., i])
        for layer, end in zip(("low", "high"), result.bounds, strict=True)
        for i, name in enumerate("RGB")
    }
    return Image(planes, attributes(result.provenance) | {"content": "least and greatest linear radiance"})


def values_image(result: Result) -> Image:
    """Return the linear values of a result, float64; an error stands in channels error.R ..., bounds in low.R, high.R.

    Of intervals the values are the middle.
    """
    image = from_rgb(result.image, attributes(result.provenance) | {"content": "linear radiance"})
    if result.bounds is not None:
        return Image({**image.channels, **bounds_image(result).channels}, image.attributes)
    if result.error is None:
        return image
    errors = {f"error.{name}": np.ascontiguousarray(result.error[..., i]) for i, name in enumerate("RGB")}
    return Image({**image.channels, **errors}, image.attributes)


def picture(result: Result) -> Image:
    """Return what a PNG holds: the codes of a unorm frame as they are, otherwise values for display."""
    codes = frame_codes(result)
    if codes is not None:
        return from_rgb(codes, attributes(result.provenance))
    shown = np.nan_to_num(result.image, posinf=_BRIGHTER_THAN_WHITE)
    return from_rgb(shown, attributes(result.provenance))


def frame_codes(result: Result) -> NDArray[Any] | None:
    """Return the frame's codes, (H, W, 3) of the crop that the result shows, or None where it holds no codes."""
    frame = result.buffers.get("frame")
    if frame is None or frame.format.kind != "unorm" or result.bounds is not None:
        return None
    return np.asarray(np.rint(result.image * frame.format.top).astype(frame.format.storage))


def write_result(path: Path, result: Result, exposure: float = 1.0) -> None:
    """Write a result; the suffix decides between values (.exr, .npz) and a picture (.png)."""
    if path.suffix.lower() == ".png":
        write(path, picture(result), exposure=exposure)
    else:
        write(path, values_image(result))
