# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Which parts of a view ray lie in the shadow of meshes: for each triangle an interval in closed form, and their union.

View ray and light span a plane, the fan. A triangle meets it in a segment; seen from the light, the segment covers one
interval of the ray. The ends are found from the triangle's corners alone, edges always from the corner below the fan to
the one above it, so that neighbours have the very same end and no light leaks between them. A corner exactly in the fan
counts as above it.

In the fan, ``a`` and ``b`` are coordinates across and along the view ray. Point light: the light at (0, 0), the ray at
a = v. Sun: the ray at a = 0, the sun towards a > 0 along (s, c).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from atmoref._jit import subroutine
from atmoref.truth.beams_geometry import cross, dot, scaled, subtract

__all__ = ["GAP", "find_shadows", "parallel_fan", "point_fan", "shade_by_point", "shade_by_sun", "subtract_shadows"]

GAP = 1e-12
"""Relative: two shadows with less light between them are one."""

_ULP = 2.220446049250313e-16
_ROUND = 8.0 * _ULP  # of one coordinate in the fan, relative to the numbers it comes from
_PAD = 1e-14


class Fan(NamedTuple):
    """The plane through a view ray and a light."""

    origin: tuple[float, float, float]  # the light; for the sun the ray's start
    m: tuple[float, float, float]  # normal
    e: tuple[float, float, float]
    d: tuple[float, float, float]  # of the ray
    v: float  # distance of the light, infinite for the sun
    s: float
    c: float
    window: tuple[float, float, float]  # distance behind the sun's window is window · P - behind; 0 and -1 without
    behind: float


class _End(NamedTuple):
    """A place in the fan: coordinates, distance behind the window, rounding error."""

    a: float
    b: float
    k: float
    error: float


@subroutine
def _across(d, e):
    """Return ``e`` made a unit vector across ``d``, and its length before; any one if there is none."""
    off = subtract(e, scaled(d, dot(e, d)))
    off = subtract(off, scaled(d, dot(off, d)))
    length = math.sqrt(dot(off, off))
    if length > 0.0:
        return scaled(off, 1.0 / length), length
    off = cross(d, (1.0, 0.0, 0.0)) if abs(d[0]) < 0.6 else cross(d, (0.0, 1.0, 0.0))
    return scaled(off, 1.0 / math.sqrt(dot(off, off))), 0.0


@subroutine
def point_fan(line):
    """Return the fan of a view ray and a point light (a :class:`Line`)."""
    e = line.e
    if line.v == 0.0:
        e, _ = _across(line.d, (0.0, 0.0, 0.0))
    return Fan(line.light, cross(e, line.d), e, line.d, line.v, 0.0, 0.0, (0.0, 0.0, 0.0), -1.0)


@subroutine
def parallel_fan(start, d, towards, window, behind):
    """Return the fan of a view ray and parallel light that comes from the unit direction ``towards``."""
    e, s = _across(d, towards)
    return Fan(start, cross(e, d), e, d, math.inf, s, dot(towards, d), window, behind)


@subroutine
def _foot(fan, end):
    """Return where on the ray the shadow of a place in the fan falls (not farther from the ray than the light)."""
    if fan.v < math.inf:
        return fan.v * end.b / end.a if end.a > 0.0 else math.copysign(math.inf, end.b)
    return end.b - end.a * fan.c / fan.s if end.a > 0.0 else end.b


@subroutine
def _foot_error(fan, end):
    """Return what rounding can move the shadow of a place by."""
    if fan.v < math.inf:
        return end.error * (fan.v / end.a) * (1.0 + abs(end.b) / end.a) if end.a > 0.0 else 0.0
    return end.error * (1.0 + (abs(fan.c) / fan.s if end.a > 0.0 else 0.0))


@subroutine
def _between(p, q, share):
    """Return a place on the way from p to q."""
    slope = abs(q.b - p.b) / abs(q.a - p.a) if q.a != p.a else 1.0
    error = max(p.error, q.error) * (1.0 + slope)
    return _End(p.a + share * (q.a - p.a), p.b + share * (q.b - p.b), p.k + share * (q.k - p.k), error)


@subroutine
def _cut_to(p, q, low, high):
    """Return p, or where the way from p to q enters low <= a <= high."""
    if p.a < low:
        cut = _between(p, q, (low - p.a) / (q.a - p.a))
        return _End(low, cut.b, cut.k, cut.error)
    if p.a > high:
        cut = _between(p, q, (p.a - high) / (p.a - q.a))
        return _End(high, cut.b, cut.k, cut.error)
    return p


@subroutine
def _crossing(below, above, h_below, h_above):
    """Return where an edge crosses the fan."""
    drop = h_above - h_below
    share = -h_below / drop
    a = below.a + share * (above.a - below.a)
    b = below.b + share * (above.b - below.b)
    length = abs(above.a - below.a) + abs(above.b - below.b)
    error = max(below.error, above.error) * (1.0 + length / drop)
    return _End(a, b, below.k + share * (above.k - below.k), error)


@subroutine
def _corner(triangles, i, corner, fan):
    """Return a corner's height over the fan, and its place seen across it."""
    p = (triangles[i, 3 * corner], triangles[i, 3 * corner + 1], triangles[i, 3 * corner + 2])
    w = subtract(p, fan.origin)
    size = abs(w[0]) + abs(w[1]) + abs(w[2]) + abs(p[0]) + abs(p[1]) + abs(p[2])
    return dot(w, fan.m), _End(dot(w, fan.e), dot(w, fan.d), dot(p, fan.window) - fan.behind, _ROUND * size)


@subroutine
def _shadow_of(fan, p, q):
    """Return the interval that a segment in the fan covers, and the error of its ends; (inf, -inf, ...) for none."""
    none = (math.inf, -math.inf, 0.0, 0.0)
    if p.k < 0.0 and q.k < 0.0:
        return none
    if p.k < 0.0:
        p = _between(p, q, p.k / (p.k - q.k))
    elif q.k < 0.0:
        q = _between(q, p, q.k / (q.k - p.k))
    if max(p.a, q.a) < 0.0 or min(p.a, q.a) > fan.v:
        return none
    p, q = _cut_to(p, q, 0.0, fan.v), _cut_to(q, p, 0.0, fan.v)
    if fan.v == 0.0:  # the ray runs through the light: dark from the triangle outwards
        return (p.b, math.inf, p.error, 0.0) if p.b > 0.0 else (-math.inf, p.b, 0.0, p.error)
    first, last = _foot(fan, p), _foot(fan, q)
    first_error, last_error = _foot_error(fan, p), _foot_error(fan, q)
    if first <= last:
        return first, last, first_error, last_error
    return last, first, last_error, first_error


@subroutine
def _triangle_shadow(triangles, i, fan):
    """Return the interval of the ray in the shadow of triangle ``i``, and the error of its ends."""
    h0, p0 = _corner(triangles, i, 0, fan)
    h1, p1 = _corner(triangles, i, 1, fan)
    h2, p2 = _corner(triangles, i, 2, fan)
    up0, up1, up2 = h0 >= 0.0, h1 >= 0.0, h2 >= 0.0
    if up0 == up1 and up1 == up2:
        return math.inf, -math.inf, 0.0, 0.0
    if up1 == up2:  # corner 0 alone
        h_lone, lone, h_a, a, h_b, b, up = h0, p0, h1, p1, h2, p2, up0
    elif up0 == up2:
        h_lone, lone, h_a, a, h_b, b, up = h1, p1, h2, p2, h0, p0, up1
    else:
        h_lone, lone, h_a, a, h_b, b, up = h2, p2, h0, p0, h1, p1, up2
    if up:
        return _shadow_of(fan, _crossing(a, lone, h_a, h_lone), _crossing(b, lone, h_b, h_lone))
    return _shadow_of(fan, _crossing(lone, a, h_lone, h_a), _crossing(lone, b, h_lone, h_b))


@subroutine
def _box_shadow(boxes, i, fan):
    """Return an interval that the shadows of everything in a box lie in; (inf, -inf) if the box misses the fan."""
    x = 0.5 * (boxes[i, 0] + boxes[i, 3]) - fan.origin[0]
    y = 0.5 * (boxes[i, 1] + boxes[i, 4]) - fan.origin[1]
    z = 0.5 * (boxes[i, 2] + boxes[i, 5]) - fan.origin[2]
    pad = _PAD * (abs(x) + abs(y) + abs(z))
    rx = 0.5 * (boxes[i, 3] - boxes[i, 0]) + pad
    ry = 0.5 * (boxes[i, 4] - boxes[i, 1]) + pad
    rz = 0.5 * (boxes[i, 5] - boxes[i, 2]) + pad
    m, e, d = fan.m, fan.e, fan.d
    if abs(x * m[0] + y * m[1] + z * m[2]) > rx * abs(m[0]) + ry * abs(m[1]) + rz * abs(m[2]):
        return math.inf, -math.inf
    a = x * e[0] + y * e[1] + z * e[2]
    ra = rx * abs(e[0]) + ry * abs(e[1]) + rz * abs(e[2])
    if a + ra < 0.0 or a - ra > fan.v:
        return math.inf, -math.inf
    b = x * d[0] + y * d[1] + z * d[2]
    rb = rx * abs(d[0]) + ry * abs(d[1]) + rz * abs(d[2])
    near, far = max(a - ra, 0.0), min(a + ra, fan.v)
    low, high = b - rb, b + rb
    if fan.v < math.inf:
        first = fan.v * low / (near if low < 0.0 else far)
        last = fan.v * high / (near if high > 0.0 else far)
    elif fan.s == 0.0:
        return -math.inf, math.inf
    else:
        slope = fan.c / fan.s
        first = low - max(near * slope, far * slope)
        last = high - min(near * slope, far * slope)
    first = first if first == first else -math.inf
    last = last if last == last else math.inf
    return first - _PAD * abs(first), last + _PAD * abs(last)


@subroutine
def _place(shadows, n, u):
    """Return how many of the sorted, disjoint shadows end before ``u``."""
    first, last = 0, n
    while first < last:
        middle = (first + last) // 2
        if shadows[middle, 1] < u:
            first = middle + 1
        else:
            last = middle
    return first


@subroutine
def _covered(shadows, n, low, high):
    i = _place(shadows, n, high)
    return i < n and shadows[i, 0] <= low


@subroutine
def _insert(shadows, n, low, high, low_error, high_error, size):
    """Unite an interval with the sorted, disjoint shadows; return their number, -1 if there is no room."""
    low_gap = GAP * (abs(low) + size) if low > -math.inf else 0.0
    high_gap = GAP * (abs(high) + size) if high < math.inf else 0.0
    i = _place(shadows, n, low - low_gap)
    j = i
    while j < n and shadows[j, 0] <= high + high_gap:
        if shadows[j, 0] <= low:
            low, low_error = shadows[j, 0], shadows[j, 2]
        if shadows[j, 1] >= high:
            high, high_error = shadows[j, 1], shadows[j, 3]
        j += 1
    if j == i:
        if n == shadows.shape[0]:
            return -1
        for k in range(n, i, -1):
            for column in range(4):
                shadows[k, column] = shadows[k - 1, column]
    elif j > i + 1:
        for k in range(j, n):
            for column in range(4):
                shadows[i + 1 + k - j, column] = shadows[k, column]
    shadows[i, 0], shadows[i, 1], shadows[i, 2], shadows[i, 3] = low, high, low_error, high_error
    return n + 1 - (j - i)


@subroutine
def find_shadows(mesh, fan, low, high, shadows):
    """Find where a view ray lies in the shadow of triangles.

    Parameters
    ----------
    mesh, fan
        The triangles; ray and light.
    low, high
        The part of the ray that counts; ``high`` may be infinite.
    shadows
        Filled: (n, 4) sorted, disjoint, closed intervals of the ray, and the rounding error of their ends.

    Returns
    -------
    n
        How many; -1 if they do not fit.
    """
    n = 0
    node = 0
    size = fan.v if fan.v < math.inf else 0.0
    while node < mesh.tree.shape[0]:
        first, last = _box_shadow(mesh.boxes, node, fan)
        first, last = max(first, low), min(last, high)
        if not first <= last or _covered(shadows, n, first, last):
            node = mesh.tree[node, 2]
            continue
        for i in range(mesh.tree[node, 0], mesh.tree[node, 1]):
            first, last, first_error, last_error = _triangle_shadow(mesh.triangles, i, fan)
            if first < last and last > low and first < high:
                n = _insert(shadows, n, first, last, first_error, last_error, size)
                if n < 0:
                    return -1
        node += 1
    return n


@subroutine
def subtract_shadows(shadows, n, pieces, ends, classes, slack):
    """Take shadows out of lit pieces, in place.

    Parameters
    ----------
    shadows, n
        From :func:`find_shadows`.
    pieces
        How many pieces ``ends`` (m, 2) and ``classes`` (m,) hold, in order.
    ends, classes
        What is left of them.
    slack
        Filled: (m, 2) error of each end, 0 where it is not the end of a shadow.

    Returns
    -------
    pieces
        Their new number; -1 if they do not fit.
    """
    room = ends.shape[0]
    write = room  # the results grow from the end of the arrays towards the pieces that are still to be read
    for piece in range(pieces - 1, -1, -1):
        low, high, found = ends[piece, 0], ends[piece, 1], classes[piece]
        high_slack = 0.0
        i = min(_place(shadows, n, high), n - 1)
        while True:
            while i >= 0 and shadows[i, 0] >= high:
                i -= 1
            cut = i >= 0 and shadows[i, 1] > low
            start = shadows[i, 1] if cut else low
            if start < high:
                if write <= piece:
                    return -1
                write -= 1
                ends[write, 0], ends[write, 1], classes[write] = start, high, found
                slack[write, 0], slack[write, 1] = shadows[i, 3] if cut else 0.0, high_slack
            if not cut or shadows[i, 0] <= low:
                break
            high, high_slack = shadows[i, 0], shadows[i, 2]
            i -= 1
    left = room - write
    for k in range(left):
        ends[k, 0], ends[k, 1], classes[k] = ends[write + k, 0], ends[write + k, 1], classes[write + k]
        slack[k, 0], slack[k, 1] = slack[write + k, 0], slack[write + k, 1]
    return left


@subroutine
def _mark_end(pieces, work, high, end_slack):
    """Note the rounding error of the ray's own end where it is lit; return the number of pieces."""
    if pieces > 0 and work.ends[pieces - 1, 1] == high:
        work.slack[pieces - 1, 1] = end_slack
    return pieces


@subroutine
def shade_by_point(mesh, line, pieces, work, high, end_slack):
    """Take what meshes shade from a point light out of the lit pieces in ``work``; return their number, -1 if too many.

    ``high`` is where the ray ends, ``end_slack`` the rounding error of that (0 where it is not a mesh's).
    """
    if mesh is None or pieces == 0:
        return pieces
    n = find_shadows(mesh, point_fan(line), work.ends[0, 0], work.ends[pieces - 1, 1], work.shadows)
    if n < 0:
        return -1
    left = subtract_shadows(work.shadows, n, pieces, work.ends, work.classes, work.slack)
    return _mark_end(left, work, high, end_slack)


@subroutine
def shade_by_sun(mesh, light, start, d, pieces, work, high, end_slack):
    """Take what meshes shade from a sun out of the lit pieces in ``work``; as :func:`shade_by_point`."""
    if mesh is None or pieces == 0:
        return pieces
    behind = dot(light.depth, light.center) if light.windowed else -1.0
    fan = parallel_fan(start, d, scaled(light.axis, -1.0), light.depth, behind)
    n = find_shadows(mesh, fan, work.ends[0, 0], work.ends[pieces - 1, 1], work.shadows)
    if n < 0:
        return -1
    left = subtract_shadows(work.shadows, n, pieces, work.ends, work.classes, work.slack)
    return _mark_end(left, work, high, end_slack)
