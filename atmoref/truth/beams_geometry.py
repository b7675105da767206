# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Rays, surfaces and visibility of the beams quadrature: exact tests against spheres, boxes and ground planes.

Points and directions are tuples of three floats. Nothing here is shared with the techniques, nor with the Monte Carlo.
A surface never shades itself: what is convex and lit from the front cannot, so the object that was hit is left out.
"""

from __future__ import annotations

import math

from atmoref._jit import subroutine
from atmoref.truth.beams_mesh import nearest_triangle, triangle_surface

__all__ = [
    "BOX",
    "GROUND",
    "MESH",
    "NOTHING",
    "SPHERE",
    "add",
    "box_span",
    "cross",
    "dot",
    "nearest_hit",
    "normal_and_albedo",
    "row",
    "scaled",
    "sees",
    "subtract",
]

NOTHING = 0
SPHERE = 1
BOX = 2
GROUND = 3
MESH = 4

_TOUCH = 1e-12  # relative: a segment that only grazes, starts or ends on a surface is not blocked by it


@subroutine
def row(table, i, column=0):
    """Return three neighbours of row ``i`` of a table as a point."""
    return table[i, column], table[i, column + 1], table[i, column + 2]


@subroutine
def add(a, b):
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@subroutine
def subtract(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@subroutine
def scaled(a, k):
    """Return a times k."""
    return a[0] * k, a[1] * k, a[2] * k


@subroutine
def dot(a, b):
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@subroutine
def cross(a, b):
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@subroutine
def _sphere_distance(start, d, center, radius):
    """Return the distance along a unit direction to a sphere's surface, infinite if it is missed or behind."""
    w = subtract(start, center)
    b = dot(w, d)
    off = subtract(w, scaled(d, b))  # foot of the perpendicular: no cancellation in the discriminant
    discriminant = radius * radius - dot(off, off)
    if discriminant <= 0.0:
        return math.inf
    h = math.sqrt(discriminant)
    c = dot(w, w) - radius * radius
    far = -b + h if b <= 0.0 else -c / (b + h)
    near = c / (-b + h) if b < 0.0 else -b - h
    if near > 0.0:
        return near
    return far if far > 0.0 else math.inf


@subroutine
def box_span(start, d, low, high):
    """Return where a line enters and leaves a box (parameters of ``d``); enter > leave if it misses."""
    enter = -math.inf
    leave = math.inf
    for i in range(3):
        if d[i] == 0.0:
            if start[i] <= low[i] or start[i] >= high[i]:
                return math.inf, -math.inf
        else:
            a = (low[i] - start[i]) / d[i]
            b = (high[i] - start[i]) / d[i]
            enter = max(enter, min(a, b))
            leave = min(leave, max(a, b))
    return enter, leave


@subroutine
def nearest_hit(objects, mesh, start, d):
    """Return (T, kind, index) of the first surface along a ray with unit direction; T is infinite for none."""
    best = math.inf
    kind = NOTHING
    index = -1
    for i in range(objects.spheres.shape[0]):
        t = _sphere_distance(start, d, row(objects.spheres, i), objects.spheres[i, 3])
        if t < best:
            best, kind, index = t, SPHERE, i
    for i in range(objects.boxes.shape[0]):
        enter, leave = box_span(start, d, row(objects.boxes, i), row(objects.boxes, i, 3))
        if enter < leave and leave > 0.0:
            t = enter if enter > 0.0 else leave
            if t < best:
                best, kind, index = t, BOX, i
    for i in range(objects.grounds.shape[0]):
        if d[1] != 0.0:
            t = (objects.grounds[i, 0] - start[1]) / d[1]
            if 0.0 < t < best:
                best, kind, index = t, GROUND, i
    t, triangle = nearest_triangle(mesh, start, d, best)
    if triangle >= 0:
        best, kind, index = t, MESH, triangle
    return best, kind, index


@subroutine
def _box_normal(p, low, high):
    """Return the outward normal of the box face that is nearest to a point on the surface."""
    best = math.inf
    axis = 0
    sign = 1.0
    for i in range(3):
        if abs(p[i] - low[i]) < best:
            best, axis, sign = abs(p[i] - low[i]), i, -1.0
        if abs(p[i] - high[i]) < best:
            best, axis, sign = abs(p[i] - high[i]), i, 1.0
    return (
        sign if axis == 0 else 0.0,
        sign if axis == 1 else 0.0,
        sign if axis == 2 else 0.0,
    )


@subroutine
def normal_and_albedo(objects, mesh, p, kind, index, d):
    """Return the outward unit normal and the albedo of the surface at ``p``; of grounds and meshes towards the eye."""
    if kind == MESH:
        return triangle_surface(mesh, index, d)
    if kind == SPHERE:
        n = subtract(p, row(objects.spheres, index))
        return scaled(n, 1.0 / math.sqrt(dot(n, n))), row(objects.spheres, index, 4)
    if kind == BOX:
        return _box_normal(p, row(objects.boxes, index), row(objects.boxes, index, 3)), row(objects.boxes, index, 6)
    return (0.0, -math.copysign(1.0, d[1]), 0.0), row(objects.grounds, index, 1)


@subroutine
def _sphere_blocks(light, w, center, radius):
    """Tell whether the segment from ``light`` along ``w`` (its whole length) passes through the sphere's inside."""
    to_center = subtract(center, light)
    ww = dot(w, w)
    k = dot(to_center, w) / ww if ww > 0.0 else 0.0
    gap = subtract(to_center, scaled(w, min(max(k, 0.0), 1.0)))
    return dot(gap, gap) < radius * radius * (1.0 - _TOUCH)


@subroutine
def sees(objects, light, p, skip_kind, skip_index):
    """Tell whether the light (a point) sees ``p``: the open segment meets no object, leaving out the one named.

    Meshes are not looked at.
    """
    w = subtract(p, light)
    for i in range(objects.grounds.shape[0]):
        side = (light[1] - objects.grounds[i, 0]) * (p[1] - objects.grounds[i, 0])
        if side < 0.0 and not (skip_kind == GROUND and skip_index == i):
            return False
    for i in range(objects.spheres.shape[0]):
        blocked = _sphere_blocks(light, w, row(objects.spheres, i), objects.spheres[i, 3])
        if blocked and not (skip_kind == SPHERE and skip_index == i):
            return False
    for i in range(objects.boxes.shape[0]):
        enter, leave = box_span(light, w, row(objects.boxes, i), row(objects.boxes, i, 3))
        blocked = max(enter, 0.0) + _TOUCH < min(leave, 1.0)
        if blocked and not (skip_kind == BOX and skip_index == i):
            return False
    return True
