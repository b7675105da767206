# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Where along a view ray a spotlight's light changes its formula, and which of the pieces between are lit.

A line is described from the light: P(u) - L = v e + u d with d the unit view direction, e the unit vector from the
light to the line's nearest point and v their distance. Every place where visibility or the falloff can change is a
root in u of a plane, cone or sphere equation; both nappes are taken, a root too many does no harm. Between roots
nothing changes, so one exact test at any inner point decides a whole piece.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from atmoref._jit import subroutine
from atmoref.truth.beams_geometry import add, cross, dot, row, scaled, sees, subtract
from atmoref.truth.beams_question import NO_FALLOFF

__all__ = [
    "EDGE",
    "FULL",
    "Line",
    "cut_capacity",
    "find_pieces",
    "keep_cut",
    "line_from_light",
    "point_on",
    "sort_cuts",
]

FULL = 2  # class of a piece: inside the inner cone (or no falloff), intensity constant
EDGE = 1  # between inner and outer cone
DARK = 0

_MERGE_ROOM = 8


class Line(NamedTuple):
    """A view ray as seen from one light (see the module)."""

    light: tuple[float, float, float]
    d: tuple[float, float, float]
    e: tuple[float, float, float]  # zero when v is
    v: float
    foot: float  # distance from the eye to the line's nearest point: t = u + foot


def cut_capacity(spheres: int, boxes: int, grounds: int) -> int:
    """Return how many split points one ray and one light can have at most."""
    return _MERGE_ROOM + 4 * spheres + 18 * boxes + grounds


@subroutine
def line_from_light(start, d, light):
    """Return the line of a view ray from ``start`` along the unit direction ``d``, as seen from the light."""
    w = subtract(start, light)
    along = dot(w, d)
    off = subtract(w, scaled(d, along))
    rest = dot(off, d)  # once more, so that e and d are orthogonal to rounding even where v is small
    off = subtract(off, scaled(d, rest))
    v = math.sqrt(dot(off, off))
    e = scaled(off, 1.0 / v) if v > 0.0 else (0.0, 0.0, 0.0)
    return Line(light, d, e, v, -(along + rest))


@subroutine
def point_on(line, u):
    """Return P(u)."""
    return add(line.light, add(scaled(line.e, line.v), scaled(line.d, u)))


@subroutine
def keep_cut(cuts, n, u, low, high):
    """Append a split point if it lies inside the interval, and return the new count."""
    if low < u < high and n < cuts.shape[0]:
        cuts[n] = u
        return n + 1
    return n


@subroutine
def _cone_roots(line, axis, cosine, sine):
    """Return the two roots in u of the double cone around ``axis`` with its tip in the light, NaN if there are none.

    With A = e·axis, D = d·axis and N = (e×d)·axis: (D² - c²) u² + 2 A D v u + (A² - c²) v² = 0, whose discriminant is
    c² v² (sin² - N²). In this form nothing cancels for thin cones.
    """
    a_e = dot(line.e, axis)
    a_d = dot(line.d, axis)
    a_n = abs(dot(cross(line.e, line.d), axis))
    if a_n > sine:
        return math.nan, math.nan
    h = cosine * line.v * math.sqrt((sine - a_n) * (sine + a_n))
    b = a_e * a_d * line.v
    m = -(b + math.copysign(h, b))
    square = (a_d - cosine) * (a_d + cosine)
    constant = (a_e - cosine) * (a_e + cosine) * line.v * line.v
    return m / square, constant / m


@subroutine
def _plane_root(line, normal, point):
    """Return the u where the line crosses the plane through ``point``; infinite or NaN if it is parallel."""
    away = subtract(point, line.light)
    return (dot(away, normal) - line.v * dot(line.e, normal)) / dot(line.d, normal)


@subroutine
def _cut_at_spheres(objects, line, cuts, n, low, high):
    """Split at each sphere and at the cone from the light that touches it."""
    for i in range(objects.spheres.shape[0]):
        radius = objects.spheres[i, 3]
        to_center = subtract(row(objects.spheres, i), line.light)
        distance = math.sqrt(dot(to_center, to_center))
        if distance > radius:
            sine = radius / distance
            cosine = math.sqrt((distance - radius) * (distance + radius)) / distance
            u1, u2 = _cone_roots(line, scaled(to_center, 1.0 / distance), cosine, sine)
            n = keep_cut(cuts, n, u1, low, high)
            n = keep_cut(cuts, n, u2, low, high)
        nearest = dot(to_center, line.d)
        gap = subtract(subtract(to_center, scaled(line.e, line.v)), scaled(line.d, nearest))
        half = math.sqrt(max(radius * radius - dot(gap, gap), 0.0))
        n = keep_cut(cuts, n, nearest - half, low, high)
        n = keep_cut(cuts, n, nearest + half, low, high)
    return n


@subroutine
def _cut_at_boxes(objects, line, cuts, n, low, high):
    """Split at the 6 planes of each box's faces and at the 12 planes through the light and an edge."""
    for i in range(objects.boxes.shape[0]):
        a = row(objects.boxes, i)
        b = row(objects.boxes, i, 3)
        for axis in range(3):
            d = line.d[axis]
            at = line.light[axis] + line.v * line.e[axis]
            n = keep_cut(cuts, n, (a[axis] - at) / d, low, high)
            n = keep_cut(cuts, n, (b[axis] - at) / d, low, high)
        for corner in range(4):  # the edges along x, y and z at each of the four corners of the other two axes
            low_1 = corner % 2 == 0
            low_2 = corner < 2
            x = a[0] if low_1 else b[0]
            y = a[1] if low_2 else b[1]
            z = a[2] if low_1 else b[2]
            n = keep_cut(cuts, n, _edge_root(line, (a[0], y, z), (1.0, 0.0, 0.0)), low, high)
            n = keep_cut(cuts, n, _edge_root(line, (x, a[1], a[2] if low_2 else b[2]), (0.0, 1.0, 0.0)), low, high)
            n = keep_cut(cuts, n, _edge_root(line, (x, y, a[2]), (0.0, 0.0, 1.0)), low, high)
    return n


@subroutine
def _edge_root(line, corner, along):
    """Return the u where the line crosses the plane through the light and an edge."""
    return _plane_root(line, cross(subtract(corner, line.light), along), line.light)


@subroutine
def _cosine_at(line, axis, u):
    """Return the cosine between the light's axis and the way to P(u); NaN at the light itself."""
    s = math.sqrt(line.v * line.v + u * u)
    return (line.v * dot(line.e, axis) + u * dot(line.d, axis)) / s


@subroutine
def _inner_point(a, b):
    """Return a place strictly between a and b, of which b may be infinite."""
    return 0.5 * (a + b) if b < math.inf else a + 1.0 + abs(a)


@subroutine
def sort_cuts(cuts, n):
    """Sort the first n split points."""
    for i in range(1, n):
        x = cuts[i]
        j = i
        while j > 0 and cuts[j - 1] > x:
            cuts[j] = cuts[j - 1]
            j -= 1
        cuts[j] = x


@subroutine
def _beam_span(light, line, low, high, cuts):
    """Return the interval of u inside the light's outer cone, which is convex; empty (low >= high) if there is none."""
    if light.outer >= math.pi:
        return low, high
    axis = light.axis
    cosine = math.cos(light.outer)
    u1, u2 = _cone_roots(line, axis, cosine, math.sin(light.outer))
    cuts[0] = low
    n = keep_cut(cuts, 1, 0.0, low, high)
    n = keep_cut(cuts, n, u1, low, high)
    n = keep_cut(cuts, n, u2, low, high)
    sort_cuts(cuts, n)
    first = math.inf
    last = -math.inf
    for i in range(n):
        end = cuts[i + 1] if i + 1 < n else high
        if end > cuts[i] and _cosine_at(line, axis, _inner_point(cuts[i], end)) > cosine:
            first = min(first, cuts[i])
            last = max(last, end)
    return first, last


@subroutine
def _classify(objects, light, line, u, inner_cosine):
    """Return the class of the piece around u, by exact tests at that place."""
    if not sees(objects, line.light, point_on(line, u), -1, -1):
        return DARK
    plateau = light.falloff == NO_FALLOFF or light.outer >= math.pi
    if plateau or _cosine_at(line, light.axis, u) >= inner_cosine:
        return FULL
    return EDGE


@subroutine
def find_pieces(objects, light, line, low, high, cuts, ends, classes):
    """Find the lit pieces of one ray for one light.

    Parameters
    ----------
    objects, light
        The opaque things, the light.
    line
        The ray as seen from the light.
    low, high
        Part of the ray that counts, in u; ``high`` may be infinite.
    cuts
        Work space of :func:`cut_capacity` values.
    ends, classes
        Filled: (n, 2) ends of the lit pieces in u, and EDGE or FULL for each. Neighbours of one class are one piece;
        no piece contains u = 0 inside.

    Returns
    -------
    n
        The number of lit pieces.
    """
    low, high = _beam_span(light, line, low, high, cuts)
    if not low < high:
        return 0
    n = 0
    n = keep_cut(cuts, n, 0.0, low, high)
    if light.outer < math.pi and light.falloff != NO_FALLOFF:
        inner = light.inner
        u1, u2 = _cone_roots(line, light.axis, math.cos(inner), math.sin(inner))
        n = keep_cut(cuts, n, u1, low, high)
        n = keep_cut(cuts, n, u2, low, high)
    n = _cut_at_spheres(objects, line, cuts, n, low, high)
    n = _cut_at_boxes(objects, line, cuts, n, low, high)
    for i in range(objects.grounds.shape[0]):
        n = keep_cut(cuts, n, _plane_root(line, (0.0, 1.0, 0.0), (0.0, objects.grounds[i, 0], 0.0)), low, high)
    sort_cuts(cuts, n)
    return _collect(objects, light, line, low, high, cuts, n, ends, classes)


@subroutine
def _collect(objects, light, line, low, high, cuts, n, ends, classes):
    """Classify what lies between the sorted cuts, merge equal neighbours, and return how many lit pieces there are."""
    inner_cosine = math.cos(light.inner)
    count = 0
    previous = DARK
    for i in range(n + 1):
        a = cuts[i - 1] if i > 0 else low
        b = cuts[i] if i < n else high
        if not a < b:
            continue
        found = _classify(objects, light, line, _inner_point(a, b), inner_cosine)
        if found != DARK:
            if found == previous and a != 0.0:
                ends[count - 1, 1] = b
            else:
                ends[count, 0] = a
                ends[count, 1] = b
                classes[count] = found
                count += 1
        previous = found
    return count
