"""What the rasteriser gets besides rectangles over the whole screen: meshes, and rectangles that a light can reach."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.stages.beam_planes import BeamUniforms

Rectangle = tuple[int, int, int, int]  # x, y, width, height; row 0 at the bottom


def mesh_corners(columns: int, rows: int, start: tuple[float, float] = (0.0, 0.0)) -> NDArray[np.float32]:
    """Return normalised device coordinates of a mesh's vertices, (vertices, 2), bottom row first.

    `start` is the mesh coordinate of the image's left and lower edge: not 0 in an interleaved image.
    """
    x = 2.0 * (np.arange(columns + 1) - start[0]) / columns - 1.0
    y = 2.0 * (np.arange(rows + 1) - start[1]) / rows - 1.0
    return np.stack([np.tile(x, rows + 1), np.repeat(y, columns + 1)], -1).astype(np.float32)


def mesh_triangles(columns: int, rows: int) -> NDArray[np.int32]:
    """Return vertex indices of all triangles, (triangles, 3); cells are cut from lower right to upper left."""
    j, i = np.divmod(np.arange(columns * rows), columns)
    first = j * (columns + 1) + i
    right, above = first + 1, first + columns + 1
    lower = np.stack([first, right, above], -1)
    upper = np.stack([above + 1, above, right], -1)
    return np.stack([lower, upper], 1).reshape(-1, 3).astype(np.int32)


def mesh_attributes(given: Mapping[str, Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return what the mirror's kernel interpolates: (planes, vertices, 2) u, v and (planes, vertices, 3) colours."""
    switches = given["uniforms"].slab_switches
    vertices = (switches.mesh_x + 1) * (switches.mesh_y + 1)
    mesh = given.get("mesh")
    colours = given["colours"] if mesh is None else mesh.c
    channels = 1 if switches.grey else 3
    colours = np.asarray(colours).reshape(channels, -1, vertices).astype(np.float32)
    colours = np.moveaxis(np.broadcast_to(colours, (3, *colours.shape[1:])), 0, -1)
    if mesh is None or switches.parallel:  # no reads of a q table
        return np.zeros((*colours.shape[:2], 2), np.float32), np.ascontiguousarray(colours)
    u = np.asarray(mesh.u).reshape(-1, vertices)
    uv = np.stack([u, np.broadcast_to(mesh.v, u.shape)], -1).astype(np.float32)
    return uv, np.ascontiguousarray(colours)


def pyramid_rectangles(uniforms: BeamUniforms, depths: NDArray[np.float64], size: tuple[int, int]) -> list[Rectangle]:
    """Return, for each plane, the pixels that a light's pyramid can reach: all where 0 <= u, v <= 1, and one more."""
    width, height = size
    camera, spot = uniforms.camera, uniforms.spot
    ex = ((np.arange(width) + 0.5) * camera.step_x + camera.start_x) * camera.tan_x
    ey = (((np.arange(height) + 0.5) * camera.step_y + camera.start_y) * camera.tan_y)[:, None]
    found = []
    for z in depths:
        u = (ex * spot.u_x + ey * spot.u_y + spot.u_z) * z + spot.u_0
        v = (ex * spot.v_x + ey * spot.v_y + spot.v_z) * z + spot.v_0
        w = (ex * spot.w_x + ey * spot.w_y + spot.w_z) * z + spot.w_0
        inside = (w > 0.0) & (u >= 0.0) & (u <= w) & (v >= 0.0) & (v <= w)
        rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
        if not rows.size:
            found.append((0, 0, 1, 1))
            continue
        x0, x1 = max(int(columns[0]) - 1, 0), min(int(columns[-1]) + 2, width)
        y0, y1 = max(int(rows[0]) - 1, 0), min(int(rows[-1]) + 2, height)
        found.append((x0, y0, x1 - x0, y1 - y0))
    return found


def hull(rectangles: Sequence[Rectangle]) -> Rectangle:
    """Return the smallest rectangle around several."""
    x0, y0 = min(r[0] for r in rectangles), min(r[1] for r in rectangles)
    x1, y1 = max(r[0] + r[2] for r in rectangles), max(r[1] + r[3] for r in rectangles)
    return x0, y0, x1 - x0, y1 - y0
