"""How llvmpipe interpolates a vertex attribute: the rule, in NumPy, with its bits.

Found by trying orders of operations against attributes drawn into an RGBA32F target (Mesa 22.3.6, a machine with fused
multiply-add); everything is float32, `fma` rounds once.

1. Vertex on the screen: fma(ndc, half, half), half = width / 2 (height / 2).  Not ndc half + half: a vertex at pixel 30
   then stands at 29.999998, and that shift shows in the last bits of every attribute.
2. A triangle whose corners turn left on the screen (rows upwards) is set up as (v1, v0, v2).  With e = p0 - p1,
   f = p2 - p0 of that order and r = 1 / (e.x f.y - f.x e.y), the slopes are
   dx = (a0 - a1) (f.y r) - (a2 - a0) (e.y r) and dy = (a2 - a0) (e.x r) - (a0 - a1) (f.x r), no operation fused.
3. The value at the centre of pixel (0, 0), which may lie far outside: c = a0 - (dx (p0.x - 1/2) + dy (p0.y - 1/2)).
4. At pixel (i, j): fma(dy, j, fma(dx, i, c)).
5. A centre on the edge from lower right to upper left belongs to the triangle above it.

The mirror does so for the device `gl_llvmpipe`.  For others it interpolates in the triangle,
a + wb (b - a) + wc (c - a), and gives such a centre to the one below.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.gl.geometry import mesh_corners, mesh_triangles

Single = NDArray[np.float32]


def fma(a: Any, b: Any, c: Any) -> Single:
    """Return a b + c with one rounding (the product is exact in float64; the sum there has bits to spare)."""
    return (np.asarray(a, np.float64) * np.asarray(b, np.float64) + np.asarray(c, np.float64)).astype(np.float32)


def screen(ndc: Single, size: tuple[int, int]) -> Single:
    """Return vertices in pixels."""
    half = np.array(size, np.float32) * np.float32(0.5)
    return fma(ndc, half, half)


def planes(attribute: Single, positions: Single, triangles: NDArray[np.int32]) -> tuple[Single, Single, Single]:
    """Return (c, dx, dy) of every triangle: the attribute's plane over the screen."""
    v0, v1, v2 = triangles[:, 1], triangles[:, 0], triangles[:, 2]
    p0, e, f = positions[v0], positions[v0] - positions[v1], positions[v2] - positions[v0]
    r = np.float32(1.0) / (e[:, 0] * f[:, 1] - f[:, 0] * e[:, 1])
    e, f = e * r[:, None], f * r[:, None]
    a01, a20 = attribute[v0] - attribute[v1], attribute[v2] - attribute[v0]
    dx = a01 * f[:, 1] - a20 * e[:, 1]
    dy = a20 * e[:, 0] - a01 * f[:, 0]
    half = np.float32(0.5)
    return attribute[v0] - (dx * (p0[:, 0] - half) + dy * (p0[:, 1] - half)), dx, dy


def cover(columns: int, rows: int, size: tuple[int, int]) -> NDArray[np.int64]:
    """Return the triangle of every pixel, (H, W), row 0 at the bottom: exact, since it is decided in integers."""
    width, height = size
    x, y = (2 * np.arange(width) + 1) * columns, ((2 * np.arange(height) + 1) * rows)[:, None]
    i, j = x // (2 * width), y // (2 * height)
    across, upwards = x - 2 * width * i, y - 2 * height * j
    above = across * height + upwards * width >= 2 * width * height
    return 2 * (j * columns + i) + above


def interpolated(attribute: Single, mesh: tuple[int, int], size: tuple[int, int]) -> Single:
    """Return an attribute at every pixel centre, (H, W), row 0 at the bottom, as llvmpipe interpolates it.

    Parameters
    ----------
    attribute : (vertices,) float32, bottom row of the mesh first
    mesh : columns and rows of cells
    size : width and height, pixels
    """
    c, dx, dy = planes(attribute, screen(mesh_corners(*mesh), size), mesh_triangles(*mesh))
    at = cover(*mesh, size)
    i, j = np.arange(size[0], dtype=np.float32), np.arange(size[1], dtype=np.float32)[:, None]
    return fma(dy[at], j, fma(dx[at], i, c[at]))


def mirrored(attribute: Single, mesh: tuple[int, int], size: tuple[int, int]) -> Single:
    """Return the same as the mirror interpolates it for other devices (float32, nothing fused)."""
    (columns, rows), (width, height), one = mesh, size, np.float32(1.0)
    x = (np.arange(width, dtype=np.float32) + np.float32(0.5)) * np.float32(columns / width)
    y = ((np.arange(height, dtype=np.float32) + np.float32(0.5)) * np.float32(rows / height))[:, None]
    i, j = np.minimum(np.floor(x), columns - 1), np.minimum(np.floor(y), rows - 1)
    x, y = x - i, y - j
    lower = x + y <= one
    at = mesh_triangles(columns, rows)[2 * (j.astype(int) * columns + i.astype(int)) + np.where(lower, 0, 1)]
    # a triangle's corners are (first, right, above) below the edge and (opposite, above, right) beyond it
    a, b, c = attribute[at[..., 0]], attribute[at[..., 1]], attribute[at[..., 2]]
    wb, wc = np.where(lower, x, one - x), np.where(lower, y, one - y)
    return np.asarray(a + wb * (b - a) + wc * (c - a), np.float32)
