"""Read the files that a scene names: pictures of lights, meshes, height fields."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import exp, log
from atmoref.images import ImageError, TooLarge, read
from atmoref.memory import Account
from atmoref.scene.describe import found
from atmoref.scene.errors import SceneError
from atmoref.scene.fields import FARTHEST_M
from atmoref.scene.mesh_files import MOST_BYTES, MOST_TRIANGLES, SUFFIXES, MeshProblem, read_mesh
from atmoref.scene.objects import HeightField, Mesh
from atmoref.scene.triangles import Triangles, grid_triangles, turned, with_area

PICTURES = (".png", ".exr", ".npy")
LARGEST_SIDE = 8192
_DECODED_COPIES = 3  # of a picture's own bytes while its channels are taken apart
_PICTURE_BYTES = 160  # per pixel of a light's picture while it is made linear (measured: 6 x 3 float64, and masks)
_SAMPLE_BYTES = 420  # per sample of a height field while its triangles are made (measured: 400)
_READER_BYTES = 64_000_000  # trimesh and what it imports
_MESH_COPIES = {".obj": 10, ".ply": 20, ".stl": 15, ".glb": 20, ".gltf": 20}  # of a file's bytes while it is read


def resolve(folder: Path, file: str, key: str, origin: str) -> Path:
    """Return the place of a file that a scene names; it lies in the scene's folder or below.

    Raises
    ------
    SceneError
        For a path that leaves the folder, also through a link, or a file that is not there or no regular file.
    """
    shown = found(file if file.isprintable() else ascii(file)[1:-1])
    try:
        path = (folder / file).resolve()
        outside = Path(file).is_absolute() or ".." in Path(file).parts or not path.is_relative_to(folder.resolve())
        if outside:
            raise SceneError(
                f"{origin}: {key}: found {shown}; allowed: a file in the folder of the scene file or below it"
            )
        if not path.is_file():
            state = "is a directory" if path.is_dir() else "is no regular file" if path.exists() else "no such file"
            raise SceneError(f"{origin}: {key}: found {shown}; {state} in {folder}; allowed: a file there")
    except (OSError, RuntimeError) as error:  # names that are too long, links in a circle
        reason = getattr(error, "strerror", None) or "a link in a circle"
        raise SceneError(f"{origin}: {key}: found {shown}; not a file name: {reason}") from None
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{origin}: {key}: found {shown}; not a file name: {error}") from None
    return path


def content_digest(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def light_map(
    folder: Path, file: str, encoding: str | None, key: str, origin: str, account: Account
) -> NDArray[np.float64]:
    """Return the picture (H, W, 3) of a light, linear, in [0, 1], row 0 at the top.

    Raises
    ------
    SceneError
        The file cannot be read, or is no picture of 1 or 3 channels from 0 to 1.
    OutOfMemory
    """
    path = resolve(folder, file, key, origin)
    planes = _planes(path, file, key, origin, account, _PICTURE_BYTES)
    colours = [planes[name] for name in ("R", "G", "B")] if set(planes) == {"R", "G", "B"} else [*planes.values()] * 3
    if len(colours) != 3:
        raise _refused(origin, key, file, f"has the channels {', '.join(planes)}", "R, G, B, or a single one")
    values = np.stack(colours, axis=-1)
    if not (values >= 0.0).all() or not (values <= 1.0).all():
        raise _refused(origin, key, file, f"holds {_outlier(values, 0.0, 1.0)}", "values from 0 to 1")
    if (encoding or ("srgb" if path.suffix.lower() == ".png" else "linear")) == "srgb":
        values = _linear(values)
    values.setflags(write=False)
    account.require(values.nbytes, f"{key}: {found(file)}", keep=True)
    return values


def _refused(origin: str, key: str, file: str, what: str, allowed: str) -> SceneError:
    return SceneError(f"{origin}: {key}: {found(file)} {what}; allowed: {allowed}")


def _outlier(values: NDArray[np.float64], low: float, high: float) -> str:
    """Return the first value outside of a range, and where it is."""
    place = np.argwhere(~((values >= low) & (values <= high)))[0]
    return f"{values[tuple(place)]:.9g} at row {place[0]}, column {place[1]}"


def _planes(
    path: Path, file: str, key: str, origin: str, account: Account, bytes_per_pixel: int
) -> dict[str, NDArray[np.float64]]:
    """Return the channels of a picture: codes of a PNG divided by the greatest, numbers of other files as they are."""
    if path.suffix.lower() not in PICTURES:
        raise _refused(origin, key, file, "is no picture", f"one of {', '.join(PICTURES)}")
    most = LARGEST_SIDE * LARGEST_SIDE * 16
    try:
        picture = read(path, max_bytes=min(most, account.room // _DECODED_COPIES))
    except TooLarge as error:
        account.require(_DECODED_COPIES * error.needed, f"{key}: {found(file)}")
        raise SceneError(f"{origin}: {key}: {error}; allowed: a picture") from None
    except ImageError as error:
        raise SceneError(f"{origin}: {key}: {error}; allowed: a picture") from None
    if max(picture.shape) > LARGEST_SIDE:
        height, width = picture.shape
        raise _refused(origin, key, file, f"has {width} x {height} pixels", f"at most {LARGEST_SIDE} each way")
    account.require(math.prod(picture.shape) * bytes_per_pixel, f"{key}: {found(file)}")
    for name, plane in picture.channels.items():
        if path.suffix.lower() != ".png" and plane.dtype.kind != "f":
            raise _refused(origin, key, file, f"holds {plane.dtype} in channel {name}", "real numbers, or a PNG")
    return {name: picture.values(name) for name in picture.channels}


def _linear(encoded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sRGB values in [0, 1] made linear (IEC 61966-2-1:1999, 5.2), the same bits on every machine."""
    curve = exp(2.4 * log((np.maximum(encoded, 0.04045) + 0.055) / 1.055))
    return np.where(encoded <= 0.04045, encoded / 12.92, np.minimum(curve, 1.0))


def mesh_triangles(folder: Path, item: Mesh, key: str, origin: str, account: Account) -> Triangles:
    """Return the triangles of a mesh, in metres in the world; those without area are left out.

    Raises
    ------
    SceneError
        The file cannot be read as a mesh, or a corner is not finite, or farther away than FARTHEST_M.
    MissingExtra
        Without trimesh.
    OutOfMemory
    """
    path = resolve(folder, item.path, key, origin)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise _refused(origin, key, item.path, "is no mesh", f"one of {', '.join(SUFFIXES)}")
    try:
        if (size := path.stat().st_size) > MOST_BYTES:
            raise _refused(origin, key, item.path, f"has {size} bytes", f"at most {MOST_BYTES}")
        needed = _READER_BYTES + _MESH_COPIES[suffix] * size
        account.require(needed, f"{key}: {found(item.path)} of {size} bytes", keep=True)  # the heap does not shrink
        vertices, faces = read_mesh(path.read_bytes(), suffix)
    except MeshProblem as error:
        text = str(error)
        raise SceneError(
            f"{origin}: {key}: {found(item.path)} {text}{'' if 'allowed: ' in text else '; allowed: a sound mesh'}"
        ) from None
    except OSError as error:
        raise SceneError(f"{origin}: {key}: {found(item.path)} cannot be read: {error.strerror}") from None
    with np.errstate(all="ignore"):
        points = turned(vertices * item.scale, item.rotate_y_deg) + np.array(item.position_m)
    return _checked(points, faces, item.path, key, origin)


def height_field_triangles(folder: Path, item: HeightField, key: str, origin: str, account: Account) -> Triangles:
    """Return the triangles of a height field, in metres in the world.

    Raises
    ------
    SceneError
        The file cannot be read, has not one channel of 2 x 2 samples or more, or has heights that are not finite or
        farther away than FARTHEST_M.
    OutOfMemory
    """
    path = resolve(folder, item.path, key, origin)
    planes = _planes(path, item.path, key, origin, account, _SAMPLE_BYTES)
    if len(planes) != 1:
        raise _refused(origin, key, item.path, f"has the channels {', '.join(planes)}", "a single one")
    (heights,) = planes.values()
    rows, columns = heights.shape
    if rows < 2 or columns < 2:
        raise _refused(origin, key, item.path, f"has {columns} x {rows} samples", "at least 2 x 2")
    if 2 * (rows - 1) * (columns - 1) > MOST_TRIANGLES:
        raise _refused(
            origin, key, item.path, f"has {columns} x {rows} samples", f"at most {MOST_TRIANGLES} triangles, 2 a cell"
        )
    if not np.isfinite(heights).all():
        raise _refused(origin, key, item.path, f"holds {_outlier(heights, -1e308, 1e308)}", "finite heights")
    with np.errstate(all="ignore"):
        made = grid_triangles(heights * item.height_scale_m, item.cell_m, item.center_m)
    account.require(made.vertices.nbytes + made.faces.nbytes, f"{key}: {found(item.path)}", keep=True)
    return _checked(made.vertices, made.faces, item.path, key, origin)


def _checked(
    vertices: NDArray[np.float64], faces: NDArray[np.integer[Any]], file: str, key: str, origin: str
) -> Triangles:
    """Return triangles for a scene, read-only: finite corners, in reach, with an area."""
    used = np.unique(faces)
    near: NDArray[np.bool_] = np.all(np.isfinite(vertices) & (np.abs(vertices) <= FARTHEST_M), axis=1)
    if not near[used].all():
        first = int(used[np.argmin(near[used])])
        place = ", ".join(f"{x:.9g}" for x in vertices[first])
        raise _refused(origin, key, file, f"has corner {first} at [{place}] m", f"finite, within {FARTHEST_M:g} m")
    made, dropped = with_area(np.where(near[:, None], vertices, 0.0), faces)
    if not len(made.faces):
        told = f"holds no triangles, apart from {dropped} without area" if dropped else "holds no triangles"
        raise _refused(origin, key, file, told, "at least one")
    for array in made:
        array.setflags(write=False)
    return made
