# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Rays against triangles for the beams quadrature: the first one hit, and whether any is in the way.

The test is watertight: edges are judged by differences of products that two neighbours compute with the same bits and
the opposite sign, so no ray slips between them.

Source: Woop, Benthin and Wald 2013, Watertight Ray/Triangle Intersection.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from atmoref._jit import subroutine

__all__ = ["OWN_SURFACE", "is_blocked", "nearest_triangle", "triangle_surface"]

OWN_SURFACE = 1e-9
"""Relative: a shadow ray from a surface overlooks triangles that are nearer to it than this times the size of the
scene's numbers there (distance to the eye plus greatest coordinate)."""

_TINY = 1e-300


class _Sheared(NamedTuple):
    """A ray in coordinates in which it runs along the axis where it is longest."""

    start: tuple[float, float, float]
    inverse: tuple[float, float, float]
    x: int
    y: int
    z: int
    shear_x: float
    shear_y: float
    shear_z: float


@subroutine
def _reciprocal(x):
    return 1.0 / (x if abs(x) > _TINY else math.copysign(_TINY, x))


@subroutine
def _sheared(start, d):
    z = 0
    if abs(d[1]) > abs(d[z]):
        z = 1
    if abs(d[2]) > abs(d[z]):
        z = 2
    x = (z + 1) % 3
    y = (z + 2) % 3
    inverse = (_reciprocal(d[0]), _reciprocal(d[1]), _reciprocal(d[2]))
    return _Sheared(start, inverse, x, y, z, d[x] / d[z], d[y] / d[z], 1.0 / d[z])


@subroutine
def _meets_box(boxes, i, ray, low, high):
    """Tell whether a ray is inside box ``i`` anywhere between two distances."""
    for k in range(3):
        a = (boxes[i, k] - ray.start[k]) * ray.inverse[k]
        b = (boxes[i, 3 + k] - ray.start[k]) * ray.inverse[k]
        low = max(low, min(a, b))
        high = min(high, max(a, b))
    return low <= high


@subroutine
def _distance(triangles, i, ray):
    """Return where along the ray triangle ``i`` is hit, behind the start as a negative number; infinite if missed."""
    az = triangles[i, ray.z] - ray.start[ray.z]
    bz = triangles[i, 3 + ray.z] - ray.start[ray.z]
    cz = triangles[i, 6 + ray.z] - ray.start[ray.z]
    ax = triangles[i, ray.x] - ray.start[ray.x] - ray.shear_x * az
    bx = triangles[i, 3 + ray.x] - ray.start[ray.x] - ray.shear_x * bz
    cx = triangles[i, 6 + ray.x] - ray.start[ray.x] - ray.shear_x * cz
    ay = triangles[i, ray.y] - ray.start[ray.y] - ray.shear_y * az
    by = triangles[i, 3 + ray.y] - ray.start[ray.y] - ray.shear_y * bz
    cy = triangles[i, 6 + ray.y] - ray.start[ray.y] - ray.shear_y * cz
    u = cx * by - cy * bx
    v = ax * cy - ay * cx
    w = bx * ay - by * ax
    if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
        return math.inf
    determinant = u + v + w
    if determinant == 0.0:
        return math.inf
    return ray.shear_z * (u * az + v * bz + w * cz) / determinant


@subroutine
def nearest_triangle(mesh, start, d, limit):
    """Return distance and index of the first triangle along a ray with unit direction, nearer than ``limit``.

    The limit and -1 if there is none, or no mesh.
    """
    if mesh is None:
        return limit, -1
    best = limit
    index = -1
    ray = _sheared(start, d)
    node = 0
    while node < mesh.tree.shape[0]:
        if not _meets_box(mesh.boxes, node, ray, 0.0, best):
            node = mesh.tree[node, 2]
            continue
        for i in range(mesh.tree[node, 0], mesh.tree[node, 1]):
            t = _distance(mesh.triangles, i, ray)
            if 0.0 < t < best:
                best, index = t, i
        node += 1
    return best, index


@subroutine
def is_blocked(mesh, start, d, low, high, skip):
    """Tell whether a triangle other than ``skip`` is hit between two distances along a ray with unit direction."""
    if mesh is None:
        return False
    ray = _sheared(start, d)
    node = 0
    while node < mesh.tree.shape[0]:
        if not _meets_box(mesh.boxes, node, ray, low, high):
            node = mesh.tree[node, 2]
            continue
        for i in range(mesh.tree[node, 0], mesh.tree[node, 1]):
            if i != skip and low < _distance(mesh.triangles, i, ray) < high:
                return True
        node += 1
    return False


@subroutine
def triangle_surface(mesh, i, d):
    """Return the unit normal of triangle ``i``, turned against the direction ``d``, and its albedo."""
    if mesh is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    triangles = mesh.triangles
    ax = triangles[i, 3] - triangles[i, 0]
    ay = triangles[i, 4] - triangles[i, 1]
    az = triangles[i, 5] - triangles[i, 2]
    bx = triangles[i, 6] - triangles[i, 0]
    by = triangles[i, 7] - triangles[i, 1]
    bz = triangles[i, 8] - triangles[i, 2]
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    k = math.copysign(1.0 / math.sqrt(x * x + y * y + z * z), -(x * d[0] + y * d[1] + z * d[2]))
    return (x * k, y * k, z * k), (triangles[i, 9], triangles[i, 10], triangles[i, 11])
