"""Triangles of meshes and height fields, as both the techniques and the truth take them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from atmoref.scene.camera import Vec3

_RADIANS = 3.141592653589793 / 180.0


class Triangles(NamedTuple):
    """Corners (V, 3) float64, in metres in the world, and three of their indices for each face, (F, 3) int32.

    No face is without area.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def with_area(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> tuple[Triangles, int]:
    """Return the triangles that have an area, and how many do not: their corners lie in a line or in one point."""
    import numpy as np

    a, b, c = (vertices[faces[:, i]] for i in range(3))
    u, v = b - a, c - a
    u = u / np.maximum(np.abs(u).max(1, initial=0.0), 1e-300)[:, None]  # products of small sides must not vanish
    v = v / np.maximum(np.abs(v).max(1, initial=0.0), 1e-300)[:, None]
    across = [u[:, i] * v[:, j] - u[:, j] * v[:, i] for i, j in ((1, 2), (2, 0), (0, 1))]
    kept = (across[0] != 0.0) | (across[1] != 0.0) | (across[2] != 0.0)
    return Triangles(vertices, np.ascontiguousarray(faces[kept], np.int32)), int(len(faces) - kept.sum())


def turned(vertices: NDArray[np.float64], rotate_y_deg: float) -> NDArray[np.float64]:
    """Return points turned about the y axis, from +z to +x; quarter turns are exact."""
    import numpy as np

    from atmoref.elementary import cos, sin

    quarters = round(rotate_y_deg / 90.0)
    rest = np.float64((rotate_y_deg - 90.0 * quarters) * _RADIANS)
    s, c = float(sin(rest)), float(cos(rest))
    for _ in range(quarters % 4):
        s, c = c, -s
    x, y, z = vertices[:, 0], vertices[:, 1], vertices[:, 2]
    return np.stack([x * c + z * s, y, z * c - x * s], -1)


def grid_triangles(heights_m: NDArray[np.float64], cell_m: float, center_m: Vec3) -> Triangles:
    """Return the triangles of heights (rows, columns) above `center_m`, two for each cell, seen from above first.

    Columns run along +x, rows along +z; a cell is cut from (row, column) to (row + 1, column + 1).
    """
    import numpy as np

    rows, columns = heights_m.shape
    x = center_m[0] + (np.arange(columns) - 0.5 * (columns - 1)) * cell_m
    z = center_m[2] + (np.arange(rows) - 0.5 * (rows - 1)) * cell_m
    x, z = np.broadcast_arrays(x[None, :], z[:, None])
    vertices = np.stack([x, center_m[1] + heights_m, z], -1).reshape(-1, 3)
    at = (
        np.arange(rows - 1, dtype=np.int32)[:, None] * np.int32(columns) + np.arange(columns - 1, dtype=np.int32)
    ).ravel()
    below, right = at + np.int32(columns), at + np.int32(1)
    faces = np.stack([at, below, below + 1, at, below + 1, right], -1).reshape(-1, 3)
    return Triangles(vertices, np.ascontiguousarray(faces, np.int32))
