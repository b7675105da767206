"""Read the files that a scene names: pictures of lights, meshes, height fields."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import exp, log
from atmoref.images import Image, ImageError, read
from atmoref.scene.errors import SceneError
from atmoref.scene.objects import HeightField, Mesh
from atmoref.scene.triangles import Triangles


def resolve(folder: Path, file: str, key: str, origin: str) -> Path:
    """Return the place of a file that a scene names; it lies in the scene's folder or below.

    Raises
    ------
    SceneError
        For a path that leaves the folder, also through a link, or a file that is not there.
    """
    path = (folder / file).resolve()
    if Path(file).is_absolute() or not path.is_relative_to(folder.resolve()):
        raise SceneError(
            f'{origin}: {key}: found "{file}"; allowed: a file in the folder of the scene file or below it'
        )
    if not path.is_file():
        raise SceneError(f'{origin}: {key}: found "{file}"; no such file in {folder}')
    return path


def content_digest(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def light_map(folder: Path, file: str, encoding: str | None, key: str, origin: str) -> NDArray[np.float64]:
    """Return the picture (H, W, 3) of a light, linear, in [0, 1], row 0 at the top."""
    path = resolve(folder, file, key, origin)
    try:
        picture = read(path)
    except ImageError as error:
        raise SceneError(f"{origin}: {key}: {error}") from None
    values = np.stack([picture.values(name) for name in _colours(picture, file, key, origin)], axis=-1)
    if not (values >= 0.0).all() or not (values <= 1.0).all():
        raise SceneError(f'{origin}: {key}: "{file}" holds values outside [0, 1] or NaN; allowed: 0 to 1')
    if (encoding or ("srgb" if path.suffix.lower() == ".png" else "linear")) == "srgb":
        values = _linear(values)
    values.setflags(write=False)
    return values


def _colours(picture: Image, file: str, key: str, origin: str) -> tuple[str, str, str]:
    """Return the names of a picture's red, green and blue channels, which are one for a grey picture."""
    names = set(picture.channels)
    if names == {"R", "G", "B"}:
        return ("R", "G", "B")
    if len(names) == 1:
        (grey,) = names
        return (grey, grey, grey)
    listed = ", ".join(sorted(names))
    raise SceneError(f'{origin}: {key}: "{file}" has the channels {listed}; allowed: R, G, B, or a single one')


def _linear(encoded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sRGB values in [0, 1] made linear (IEC 61966-2-1:1999, 5.2), the same bits on every machine."""
    curve = exp(2.4 * log((np.maximum(encoded, 0.04045) + 0.055) / 1.055))
    return np.where(encoded <= 0.04045, encoded / 12.92, np.minimum(curve, 1.0))


def mesh_triangles(folder: Path, item: Mesh, key: str, origin: str) -> Triangles:
    """Return the triangles of a mesh, in metres in the world."""
    raise SceneError(f"{origin}: {key}: meshes cannot be read yet")


def height_field_triangles(folder: Path, item: HeightField, key: str, origin: str) -> Triangles:
    """Return the triangles of a height field, in metres in the world."""
    raise SceneError(f"{origin}: {key}: height fields cannot be read yet")
