"""Pictures of triangles for tests: drawn by the stage, and by an independent test of every ray; a script for processes.

    python triangle_pictures.py

prints the SHA-256 of some pictures.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.lanes import Double, N, Single
from atmoref.stages.beam_planes import Window
from atmoref.stages.ray_cast import FAR
from atmoref.stages.triangles import Axes, Grid, face_normals, rasterise
from atmoref.techniques.triangle_passes import TriangleSet, axes, records

Vectors = NDArray[np.float64]


def perspective(width: int, height: int, tan_y: float = 0.4) -> Grid:
    """Return the pixels of an upright camera."""
    return Grid(2.0 / width, -1.0, tan_y * width / height, 2.0 / height, -1.0, tan_y, 0)


def parallel(width: int, height: int, half: float = 1.0) -> Grid:
    """Return the pixels of a view of parallel rays."""
    return Grid(2.0 / width, -1.0, half * width / height, 2.0 / height, -1.0, half, 1)


def looking_along_z() -> Axes:
    """Return the axes of the world."""
    return axes((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def tilted(origin: tuple[float, float, float] = (0.3, -0.2, 0.1)) -> Axes:
    """Return orthogonal axes that are none of the world's."""
    f = np.array([0.3, -0.4, 1.0]) / np.sqrt(1.25)
    r = np.cross(f, [0.0, 1.0, 0.0])
    r /= np.sqrt(r @ r)
    u = np.cross(r, f)
    right, up, forward = ((float(v[0]), float(v[1]), float(v[2])) for v in (r, u, f))
    return axes(origin, right, up, forward)


def triangle_set(vertices: Any, faces: Any, dtype: Any = np.float32) -> TriangleSet:
    """Return triangles of one object."""
    points, corners = np.array(vertices, np.float64).reshape(-1, 3), np.array(faces, np.int32).reshape(-1, 3)
    normals = np.empty(3 * len(corners), dtype)
    face_normals(normals, points, corners)
    return TriangleSet(points, corners, np.zeros(len(corners), np.int32), normals)


def drawn(
    triangles: TriangleSet, grid: Grid, view: Axes, width: int, height: int, dtype: Any, bands: int = 1
) -> tuple[Vectors, NDArray[np.int64]]:
    """Return depth and index by the stage, (height, width), row 0 at the bottom."""
    pitch = -(-width // N) * N
    out = np.full(2 * height * pitch, np.nan, dtype)
    made = records(triangles, grid, view, width, height, dtype)
    tag = Single() if dtype is np.float32 else Double()
    for row0, row1 in itertools.pairwise(height * b // bands for b in range(bands + 1)):
        rasterise(out, tag, grid, made, Window(0, width, row0, row1, height, pitch, 0, 1, 0))
    depth, index = out.reshape(2, height, pitch)[:, :, :width]
    return depth.astype(np.float64), index.astype(np.int64)


def pixel_rays(grid: Grid, view: Axes, width: int, height: int) -> tuple[Vectors, Vectors]:
    """Return start and direction of every pixel's ray in the world, (height, width, 3), float64."""
    x = ((np.arange(width) + 0.5) * grid.step_x + grid.start_x) * grid.scale_x
    y = ((np.arange(height) + 0.5) * grid.step_y + grid.start_y) * grid.scale_y
    x, y = np.meshgrid(x, y)
    right, up, axis = np.linalg.inv(np.array([view.right, view.up, view.axis])).T
    offset = x[..., None] * right + y[..., None] * up
    if grid.parallel:
        return np.array(view.origin) + offset, np.broadcast_to(axis, offset.shape)
    return np.broadcast_to(np.array(view.origin), offset.shape), offset + axis


def cast(triangles: TriangleSet, starts: Vectors, rays: Vectors) -> tuple[Vectors, NDArray[np.int64], Vectors]:
    """Return depth, index, and how near the hit is to an edge or any edge to the ray, by Moeller and Trumbore's test.

    The third is the least distance of a barycentric coordinate from 0, over all triangles in front: where it is small,
    rounding may decide.
    """
    depth = np.full(rays.shape[:2], FAR)
    index = np.full(rays.shape[:2], -1)
    margin = np.full(rays.shape[:2], np.inf)
    for i, face in enumerate(triangles.faces):
        a, b, c = triangles.vertices[face]
        p = np.cross(rays, c - a)
        det = p @ (b - a)
        with np.errstate(all="ignore"):
            s = starts - a
            v = (s * p).sum(-1) / det
            q = np.cross(s, b - a)
            w = (rays * q).sum(-1) / det
            t = (q @ (c - a)) / det
        ahead = np.isfinite(t) & (t > 0.0)
        least = np.minimum(np.minimum(v, w), 1.0 - v - w)
        hit = ahead & (least >= 0.0) & (t < depth)
        depth, index = np.where(hit, t, depth), np.where(hit, i, index)
        margin = np.minimum(margin, np.where(np.isfinite(least), np.abs(least), 0.0))
    return depth, index, margin


def soup(seed: int, count: int, *, through: bool) -> TriangleSet:
    """Return random triangles in front of the eye, or all around it and through its plane."""
    rng = np.random.default_rng(seed)
    centre = rng.uniform(-4.0, 4.0, (count, 1, 3)) + (0.0 if through else np.array([0.0, 0.0, 8.0]))
    corners = centre + rng.normal(0.0, 3.0 if through else 1.0, (count, 3, 3))
    return triangle_set(corners.reshape(-1, 3), np.arange(3 * count))


def main() -> None:
    """Print the hashes of pictures in both arithmetics and both projections."""
    found = {}
    for dtype in (np.float32, np.float64):
        for name, grid in (("perspective", perspective(53, 37)), ("parallel", parallel(53, 37, 5.0))):
            for through in (False, True):
                depth, index = drawn(soup(5, 200, through=through), grid, tilted(), 53, 37, dtype, bands=3)
                content = depth.tobytes() + index.astype(np.int64).tobytes()
                found[f"{name} {dtype.__name__} {through}"] = hashlib.sha256(content).hexdigest()
    print(json.dumps(found))


if __name__ == "__main__":
    main()
