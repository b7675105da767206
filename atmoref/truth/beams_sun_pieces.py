# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Which pieces of a view ray the sun lights: cuts in closed form, and one exact test for each piece between them.

With P(t) = start + t d, what the sun's light passes on the way to P is the segment from P back to Q(t), where it comes
through the window's plane, or back for ever. Both ends are linear in t. Visibility can change where P or Q crosses a
surface, and where the segment touches a sphere or a box's edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from atmoref._jit import subroutine
from atmoref.truth.beams_geometry import (
    BOX,
    GROUND,
    SPHERE,
    add,
    box_span,
    cross,
    dot,
    row,
    scaled,
    subtract,
)
from atmoref.truth.beams_light_maps import clip_linear
from atmoref.truth.beams_pieces import keep_cut, sort_cuts

__all__ = ["LIT", "SunRay", "find_sun_pieces", "sun_cut_capacity", "sun_ray", "sun_reaches", "window_span"]

LIT = 1
_TOUCH = 1e-12  # relative: light that only grazes a surface is not blocked by it


class SunRay(NamedTuple):
    """A view ray under a sun, and the way of Q (for a sun without window P's own)."""

    start: tuple[float, float, float]
    d: tuple[float, float, float]
    gate: tuple[float, float, float]  # Q(0)
    gate_d: tuple[float, float, float]  # dQ/dt
    depth: float  # of P(0) behind the window
    depth_d: float


def sun_cut_capacity(spheres: int, boxes: int, grounds: int) -> int:
    """Return how many split points one ray and one sun can have at most."""
    return 6 * spheres + 24 * boxes + 2 * grounds


@subroutine
def sun_ray(light, start, d):
    """Return a view ray as seen from the sun."""
    depth = dot(light.depth, subtract(start, light.center))
    depth_d = dot(light.depth, d)
    gate = subtract(start, scaled(light.axis, depth))
    return SunRay(start, d, gate, subtract(d, scaled(light.axis, depth_d)), depth, depth_d)


@subroutine
def window_span(light, ray, low, high):
    """Return the interval of t lit through the window, if nothing is in the way; empty (low >= high) for none."""
    if not light.windowed:
        return low, high
    w = subtract(ray.start, light.center)
    low, high = clip_linear(ray.depth, ray.depth_d, low, high)
    for side in range(4):
        edge = light.across if side < 2 else light.down
        sign = 1.0 if side % 2 == 0 else -1.0
        low, high = clip_linear(0.5 + sign * dot(edge, w), sign * dot(edge, ray.d), low, high)
    return low, high


@subroutine
def _keep_sphere(cuts, n, away, d, radius, low, high):
    """Split where |away + t d| is the radius."""
    square = dot(d, d)
    if square == 0.0:
        return n
    foot = -dot(away, d) / square
    gap = add(away, scaled(d, foot))
    half = math.sqrt(max(radius * radius - dot(gap, gap), 0.0) / square)
    n = keep_cut(cuts, n, foot - half, low, high)
    return keep_cut(cuts, n, foot + half, low, high)


@subroutine
def _cut_at_spheres(objects, light, ray, cuts, n, low, high):
    for i in range(objects.spheres.shape[0]):
        center = row(objects.spheres, i)
        radius = objects.spheres[i, 3]
        w = subtract(ray.start, center)
        n = _keep_sphere(cuts, n, w, ray.d, radius, low, high)
        off = subtract(w, scaled(light.axis, dot(w, light.axis)))
        d = subtract(ray.d, scaled(light.axis, dot(ray.d, light.axis)))
        n = _keep_sphere(cuts, n, off, d, radius, low, high)
        if light.windowed:
            n = _keep_sphere(cuts, n, subtract(ray.gate, center), ray.gate_d, radius, low, high)
    return n


@subroutine
def _cut_at_boxes(objects, light, ray, cuts, n, low, high):
    for i in range(objects.boxes.shape[0]):
        a = row(objects.boxes, i)
        b = row(objects.boxes, i, 3)
        for axis in range(3):
            for side in range(2):
                face = a[axis] if side == 0 else b[axis]
                n = keep_cut(cuts, n, (face - ray.start[axis]) / ray.d[axis], low, high)
                if light.windowed:
                    n = keep_cut(cuts, n, (face - ray.gate[axis]) / ray.gate_d[axis], low, high)
        for corner in range(4):  # the edges along x, y and z at each of the four corners of the other two axes
            x = a[0] if corner % 2 == 0 else b[0]
            y = a[1] if corner < 2 else b[1]
            z = a[2] if corner % 2 == 0 else b[2]
            n = keep_cut(cuts, n, _edge_root(light, ray, (a[0], y, z), (1.0, 0.0, 0.0)), low, high)
            n = keep_cut(
                cuts, n, _edge_root(light, ray, (x, a[1], a[2] if corner < 2 else b[2]), (0.0, 1.0, 0.0)), low, high
            )
            n = keep_cut(cuts, n, _edge_root(light, ray, (x, y, a[2]), (0.0, 0.0, 1.0)), low, high)
    return n


@subroutine
def _edge_root(light, ray, corner, along):
    """Return where the ray crosses the plane of light that passes an edge."""
    normal = cross(light.axis, along)
    return dot(subtract(corner, ray.start), normal) / dot(ray.d, normal)


@subroutine
def sun_reaches(objects, light, p, reach, skip_kind, skip_index):
    """Tell whether sunlight comes to ``p`` from ``reach`` metres before it, infinite without window.

    The object named (the surface that ``p`` lies on) is left out; meshes are not looked at.
    """
    back = scaled(light.axis, -1.0)
    for i in range(objects.grounds.shape[0]):
        above = p[1] - objects.grounds[i, 0]
        far = above + back[1] * reach if back[1] != 0.0 else above
        if above * far < 0.0 and not (skip_kind == GROUND and skip_index == i):
            return False
    for i in range(objects.spheres.shape[0]):
        to_center = subtract(row(objects.spheres, i), p)
        k = min(max(dot(to_center, back), 0.0), reach)
        gap = subtract(to_center, scaled(back, k))
        blocked = dot(gap, gap) < objects.spheres[i, 3] * objects.spheres[i, 3] * (1.0 - _TOUCH)
        if blocked and not (skip_kind == SPHERE and skip_index == i):
            return False
    for i in range(objects.boxes.shape[0]):
        enter, leave = box_span(p, back, row(objects.boxes, i), row(objects.boxes, i, 3))
        blocked = min(leave, reach) - max(enter, 0.0) > _TOUCH * (leave - enter)
        if enter < leave and blocked and not (skip_kind == BOX and skip_index == i):
            return False
    return True


@subroutine
def find_sun_pieces(objects, light, ray, low, high, cuts, ends, classes):
    """Find the lit pieces of one ray for one sun, up to meshes and texels.

    Parameters
    ----------
    objects, light, ray
        The opaque things, the sun, the ray.
    low, high
        Part of the ray that counts; ``high`` may be infinite.
    cuts
        Work space of :func:`sun_cut_capacity` values.
    ends, classes
        Filled: (n, 2) ends of the lit pieces in t, and LIT for each. Neighbours are one piece.

    Returns
    -------
    n
        The number of lit pieces.
    """
    low, high = window_span(light, ray, low, high)
    if not low < high:
        return 0
    n = _cut_at_spheres(objects, light, ray, cuts, 0, low, high)
    n = _cut_at_boxes(objects, light, ray, cuts, n, low, high)
    for i in range(objects.grounds.shape[0]):
        h = objects.grounds[i, 0]
        n = keep_cut(cuts, n, (h - ray.start[1]) / ray.d[1], low, high)
        if light.windowed:
            n = keep_cut(cuts, n, (h - ray.gate[1]) / ray.gate_d[1], low, high)
    sort_cuts(cuts, n)
    count = 0
    for i in range(n + 1):
        a = cuts[i - 1] if i > 0 else low
        b = cuts[i] if i < n else high
        if not a < b:
            continue
        middle = 0.5 * (a + b) if b < math.inf else a + 1.0 + abs(a)
        reach = ray.depth + middle * ray.depth_d if light.windowed else math.inf
        if not sun_reaches(objects, light, add(ray.start, scaled(ray.d, middle)), reach, -1, -1):
            continue
        if count > 0 and ends[count - 1, 1] == a:
            ends[count - 1, 1] = b
        else:
            ends[count, 0], ends[count, 1], classes[count] = a, b, LIT
            count += 1
    return count
