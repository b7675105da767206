# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Triangles into a picture of depth and index, by homogeneous edge functions, without clipping.

With corners a, b, c in the axes of the view and a pixel's ray d = (x, y, 1), the functions (a x b).d, (b x c).d and
(c x a).d have the sign of a.(b x c) inside the triangle and in front of the eye, wherever its corners are: one behind
the eye needs no clipping.  With n across the plane, 1 / z = n.d / n.a.  A parallel view has corners (x, y, 1), the
same functions, and a depth that is linear in x and y.

The set-up computes in float64 and scales every function to |A| x_most + |B| y_most + |C| = 1.  Two triangles share an
edge's function with the sign turned, since its corners are taken in the order of their indices.  C is then raised by
SLACK roundings, more than evaluation can lose: every pixel that is inside in exact arithmetic is found, so surfaces
have no cracks, neither along edges nor at corners, where edge functions alone would leave some.  What is found beyond
an edge lies within a thousandth of a pixel, inside the box of the triangle's pixels and between its nearest and
farthest depth.  Of two hits the nearer wins, of equal ones the triangle that comes first.

Source: Olano, Greer, Triangle Scan Conversion using 2D Homogeneous Coordinates, Graphics Hardware 1997.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import int32
from numpy.typing import NDArray

from atmoref._jit import device, kernel
from atmoref.lanes import (
    N,
    any_lane,
    apart,
    gather,
    iota,
    lift,
    load,
    maximum,
    minimum,
    pixels,
    select,
    spread_int,
    store,
    to_int,
)
from atmoref.stages.ray_cast import FAR, Hit, nearest_hit, origin

GROUP = 64  # triangles that are left out together where their rows are not drawn
RECORD = 14  # three edge functions, depth function, nearest and farthest depth
SLACK = 8  # roundings of one operation, of some 4.5 that evaluation takes
LEAST_Z_M = 1e-6  # nearer to the eye than this nothing is seen
EDGE_ON = 1e30  # a plane function beyond it: the eye lies in the triangle's plane
PAD = 0.02  # pixels that a box is wider than its triangle, for roundings of pixel coordinates


class Grid(NamedTuple):
    """Pixel centres of a view: x = ((column + 1/2) step_x + start_x) scale_x, and y likewise; row 0 at the bottom."""

    step_x: float
    start_x: float
    scale_x: float
    step_y: float
    start_y: float
    scale_y: float
    parallel: int  # 0: depth is 1 / (V.d), 1: depth is V.d


class Axes(NamedTuple):
    """From the world to a view, float64: x = right.(P - origin), y = up.(P - origin), z = axis.(P - origin).

    `right` and `up` are divided by the image plane's scale, so that x / z (parallel: x) is a pixel's coordinate.
    """

    origin: tuple[float, float, float]
    right: tuple[float, float, float]
    up: tuple[float, float, float]
    axis: tuple[float, float, float]


class Records(NamedTuple):
    """Triangles that a view can see, in their order: what the set-up makes and `rasterise` reads."""

    functions: NDArray[Any]  # (triangles, RECORD), of the arithmetic
    boxes: NDArray[np.int32]  # (triangles, 4): first row, row after the last, the same of columns
    indices: NDArray[np.int32]  # (triangles,)
    rows: NDArray[np.int32]  # (groups, 2): first row, row after the last
    number: NDArray[np.int64]  # (1,): how many of them are there


class Surfaces(NamedTuple):
    """What `rasterise` left at every pixel, and what it stands for; `on` = 0 without any triangles."""

    on: int
    drawn: NDArray[Any]  # plane of depth, plane of index
    objects: NDArray[np.int32]  # object of each triangle
    normals: NDArray[Any]  # (3 triangles,): unit normals, either side, of the arithmetic


class Linear(NamedTuple):
    """Lanes: x X + y Y + one, of a pixel (X, Y)."""

    x: Any
    y: Any
    one: Any


@device
def _across(origin, axis, vertices, i):
    """Return one coordinate of a corner in the view."""
    x, y, z = vertices[i, 0] - origin[0], vertices[i, 1] - origin[1], vertices[i, 2] - origin[2]
    return x * axis[0] + y * axis[1] + z * axis[2]


@device
def _corner(axes, vertices, i, parallel):
    """Return (x, y, w, z) of a corner: w is z, in a parallel view 1."""
    z = _across(axes.origin, axes.axis, vertices, i)
    x, y = _across(axes.origin, axes.right, vertices, i), _across(axes.origin, axes.up, vertices, i)
    return x, y, (1.0 if parallel else z), z


@device
def _edge(p, q, first):
    """Return p x q, computed from the corner that comes first, so that q x p is its exact opposite."""
    if first:
        a, b, sign = p, q, 1.0
    else:
        a, b, sign = q, p, -1.0
    x, y, w = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return sign * (a[1] * w - a[2] * y), sign * (a[2] * x - a[0] * w), sign * (a[0] * y - a[1] * x)


@device
def _plane(a, b, c, parallel):
    """Return the depth function, and a number of the triangle's sign (0: seen edge-on).

    Parallel: z = a_z - (n_x (x - a_x) + n_y (y - a_y)) / n_z; else 1 / z = n.d / n.a.
    """
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[3] - a[3]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[3] - a[3]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    if parallel:
        kx, ky = -(nx / nz), -(ny / nz)
        return kx, ky, a[3] - (kx * a[0] + ky * a[1]), nz
    volume = nx * a[0] + ny * a[1] + nz * a[3]
    return nx / volume, ny / volume, nz / volume, volume


@device
def _reach(a, b, c, axis, parallel):
    """Return the least and the greatest image coordinate of what lies in front of the eye."""
    if parallel:
        return min(a[axis], b[axis], c[axis]), max(a[axis], b[axis], c[axis])
    low, high = np.inf, -np.inf
    corners = (a, b, c)
    for i in range(3):
        p, q = corners[i], corners[(i + 1) % 3]
        if p[3] >= LEAST_Z_M:
            low, high = min(low, p[axis] / p[3]), max(high, p[axis] / p[3])
        if (p[3] >= LEAST_Z_M) != (q[3] >= LEAST_Z_M):  # where the side enters: z is LEAST_Z_M
            part = (LEAST_Z_M - p[3]) / (q[3] - p[3])
            cut = (p[axis] + part * (q[axis] - p[axis])) / LEAST_Z_M
            low, high = min(low, cut), max(high, cut)
    return low, high


@device
def _pixels(low, high, step, start, scale, count):
    """Return the first pixel, and the one after the last, whose centre can lie between two image coordinates."""
    first = (low / scale - start) / step - 0.5 - PAD
    last = (high / scale - start) / step - 0.5 + PAD
    if not (first <= last and last >= 0.0 and first <= count - 1.0):  # also NaN
        return 0, 0
    return int(np.ceil(max(first, 0.0))), int(np.floor(min(last, count - 1.0))) + 1


@device
def _put_edge(functions, at, place, edge, sign, most_x, most_y, slack):
    """Write one edge function, scaled and loosened."""
    size = abs(edge[0]) * most_x + abs(edge[1]) * most_y + abs(edge[2])
    scale = sign / size if size > 0.0 else 0.0
    functions[at, place] = edge[0] * scale
    functions[at, place + 1] = edge[1] * scale
    functions[at, place + 2] = edge[2] * scale + slack


@kernel
def set_up_triangles(records, vertices, faces, axes, grid, width, height, slack):
    """Write the records of the triangles that can cover a pixel centre.

    `vertices` (V, 3) float64 and `faces` (F, 3) int32 as in the scene; `slack` is SLACK roundings of the arithmetic.
    Triangles seen edge-on cover nothing; what lies behind the eye (parallel: behind the plane z = 0) is left out.
    """
    parallel = grid.parallel != 0
    most_x = max(abs(grid.start_x), abs(width * grid.step_x + grid.start_x)) * grid.scale_x
    most_y = max(abs(grid.start_y), abs(height * grid.step_y + grid.start_y)) * grid.scale_y
    count = 0
    for face in range(faces.shape[0]):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        a = _corner(axes, vertices, i, parallel)
        b = _corner(axes, vertices, j, parallel)
        c = _corner(axes, vertices, k, parallel)
        far = max(a[3], b[3], c[3])
        if not far > 0.0:
            continue
        low, high = _reach(a, b, c, 1, parallel)
        row0, row1 = _pixels(low, high, grid.step_y, grid.start_y, grid.scale_y, height)
        if row0 >= row1:
            continue
        low, high = _reach(a, b, c, 0, parallel)
        column0, column1 = _pixels(low, high, grid.step_x, grid.start_x, grid.scale_x, width)
        if column0 >= column1:
            continue
        vx, vy, vz, sign = _plane(a, b, c, parallel)
        if not (abs(vx) < EDGE_ON and abs(vy) < EDGE_ON and abs(vz) < EDGE_ON and sign != 0.0):
            continue
        sign = 1.0 if sign > 0.0 else -1.0
        functions = records.functions
        _put_edge(functions, count, 0, _edge(a, b, i < j), sign, most_x, most_y, slack)
        _put_edge(functions, count, 3, _edge(b, c, j < k), sign, most_x, most_y, slack)
        _put_edge(functions, count, 6, _edge(c, a, k < i), sign, most_x, most_y, slack)
        functions[count, 9], functions[count, 10], functions[count, 11] = vx, vy, vz
        functions[count, 12] = max(min(a[3], b[3], c[3]), LEAST_Z_M)
        functions[count, 13] = max(far, LEAST_Z_M)
        records.boxes[count, 0], records.boxes[count, 1] = row0, row1
        records.boxes[count, 2], records.boxes[count, 3] = column0, column1
        records.indices[count] = face
        rows, group = records.rows, count // GROUP
        rows[group, 0] = row0 if count % GROUP == 0 else min(rows[group, 0], row0)
        rows[group, 1] = row1 if count % GROUP == 0 else max(rows[group, 1], row1)
        count += 1
    records.number[0] = count


@device
def _from(vertices, i, origin):
    """Return a corner relative to a point, as `_plane` takes it."""
    x, y, z = vertices[i, 0] - origin[0], vertices[i, 1] - origin[1], vertices[i, 2] - origin[2]
    return x, y, z, z


@kernel
def set_up_occluders(records, vertices, faces, order, origin, slack):
    """Write triangles, in a given order, as a point sees them: (triangles, OCCLUDER) float64.

    Three edge functions of a direction d, scaled to at most 1 where all |d| are, and positive inside; n / n.a; SLACK
    roundings of the arithmetic.  A triangle that is seen edge-on shades nothing.
    """
    for at in range(order.shape[0]):
        i, j, k = faces[order[at], 0], faces[order[at], 1], faces[order[at], 2]
        a, b, c = _from(vertices, i, origin), _from(vertices, j, origin), _from(vertices, k, origin)
        vx, vy, vz, sign = _plane(a, b, c, False)
        if not (abs(vx) < EDGE_ON and abs(vy) < EDGE_ON and abs(vz) < EDGE_ON and sign != 0.0):
            vx, vy, vz = 0.0, 0.0, 0.0
        sign = 1.0 if sign > 0.0 else -1.0
        _put_edge(records, at, 0, _edge(a, b, i < j), sign, 1.0, 1.0, 0.0)
        _put_edge(records, at, 3, _edge(b, c, j < k), sign, 1.0, 1.0, 0.0)
        _put_edge(records, at, 6, _edge(c, a, k < i), sign, 1.0, 1.0, 0.0)
        records[at, 9], records[at, 10], records[at, 11], records[at, 12] = vx, vy, vz, slack


@kernel
def set_up_parallel_occluders(records, corners, faces, order, slack):
    """Write triangles, in a given order, as parallel light sees them: (triangles, OCCLUDER) float64.

    `corners` (V, 3) are in the light's axes (x, y, depth).  Three edge functions of (x, y, 1), scaled to at most 1
    where |x| and |y| are, and positive inside; the depth, of (x, y, 1); SLACK roundings of the arithmetic.  A triangle
    that is seen edge-on shades nothing.
    """
    for at in range(order.shape[0]):
        i, j, k = faces[order[at], 0], faces[order[at], 1], faces[order[at], 2]
        a = corners[i, 0], corners[i, 1], 1.0, corners[i, 2]
        b = corners[j, 0], corners[j, 1], 1.0, corners[j, 2]
        c = corners[k, 0], corners[k, 1], 1.0, corners[k, 2]
        vx, vy, vz, sign = _plane(a, b, c, True)
        if not (abs(vx) < EDGE_ON and abs(vy) < EDGE_ON and abs(vz) < EDGE_ON and sign != 0.0):
            vx, vy, vz = 0.0, 0.0, EDGE_ON
        sign = 1.0 if sign > 0.0 else -1.0
        _put_edge(records, at, 0, _edge(a, b, i < j), sign, 1.0, 1.0, 0.0)
        _put_edge(records, at, 3, _edge(b, c, j < k), sign, 1.0, 1.0, 0.0)
        _put_edge(records, at, 6, _edge(c, a, k < i), sign, 1.0, 1.0, 0.0)
        records[at, 9], records[at, 10], records[at, 11], records[at, 12] = vx, vy, vz, slack


@kernel
def face_normals(normals, vertices, faces):
    """Write the unit normals of triangles, (3 F,), towards the side from which the corners run counter-clockwise.

    Of triangles of any size: their sides are scaled first.  Zero for a triangle that is a line.
    """
    for face in range(faces.shape[0]):
        a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
        ux, uy, uz, vx, vy, vz = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
        u, v = max(abs(ux), abs(uy), abs(uz), 1e-300), max(abs(vx), abs(vy), abs(vz), 1e-300)
        ux, uy, uz, vx, vy, vz = ux / u, uy / u, uz / u, vx / v, vy / v, vz / v
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        size = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
        normals[3 * face], normals[3 * face + 1], normals[3 * face + 2] = nx / size, ny / size, nz / size


@device
def _function(arith, functions, i, place):
    """Return one function of a triangle, the same in all lanes."""
    return Linear(
        lift(arith, functions[i, place]), lift(arith, functions[i, place + 1]), lift(arith, functions[i, place + 2])
    )


@device
def _clear(arith, drawn, window):
    """Nothing is at FAR, with the index -1."""
    size = window.height * window.pitch
    far = lift(arith, spread_int(int32(0))) + FAR
    for row in range(window.row0, window.row1):
        for column in range(window.column0, window.column1, N):
            store(drawn, row * window.pitch + column, far)
            store(drawn, row * window.pitch + column + size, far * 0.0 - 1.0)


@device
def _draw(arith, drawn, view, parallel, records, window, i):
    """Draw one triangle: nearer than what is there."""
    functions, boxes, size = records.functions, records.boxes, window.height * window.pitch
    row0, row1 = max(boxes[i, 0], window.row0), min(boxes[i, 1], window.row1)
    column0, column1 = boxes[i, 2], boxes[i, 3]
    start, stop = max(column0 // N * N, window.column0), min(column1, window.column1)
    if row0 >= row1 or start >= stop:
        return
    a, b, c = _function(arith, functions, i, 0), _function(arith, functions, i, 3), _function(arith, functions, i, 6)
    v = _function(arith, functions, i, 9)
    nearest, farthest = lift(arith, functions[i, 12]), lift(arith, functions[i, 13])
    index = lift(arith, spread_int(int32(records.indices[i])))
    for column in range(start, stop, N):
        x = (pixels(arith, int32(column)) * view.step_x + view.start_x) * view.scale_x
        at = iota(int32(column))
        boxed = (at >= int32(column0)) & (at < int32(column1))
        a_x, b_x, c_x, v_x = a.x * x, b.x * x, c.x * x, v.x * x
        for row in range(row0, row1):
            y = ((lift(arith, spread_int(int32(row))) + 0.5) * view.step_y + view.start_y) * view.scale_y
            inside = (a_x + (a.y * y + a.one) >= 0.0) & (b_x + (b.y * y + b.one) >= 0.0)
            inside = inside & (c_x + (c.y * y + c.one) >= 0.0) & boxed
            if not any_lane(inside):
                continue
            depth = v_x + (v.y * y + v.one)
            inside = inside & (depth > 0.0)
            if parallel == 0:
                depth = (x * 0.0 + 1.0) / depth
            depth = maximum(minimum(depth, farthest), nearest)
            p = row * window.pitch + column
            held = load(drawn, p)
            nearer = inside & (depth < held)
            store(drawn, p, select(nearer, depth, held))
            store(drawn, p + size, select(nearer, index, load(drawn, p + size)))


@kernel
def rasterise(drawn, arith, grid, records, window):
    """Draw all triangles into rows and columns of a window: nearest depth, and index of the triangle that has it.

    `drawn` holds two planes of `window.height` rows.  Replaces what was there.
    """
    view, count = lift(arith, grid), records.number[0]
    _clear(arith, drawn, window)
    for group in range((count + GROUP - 1) // GROUP):
        if records.rows[group, 0] < window.row1 and records.rows[group, 1] > window.row0:
            for i in range(group * GROUP, min((group + 1) * GROUP, count)):
                _draw(arith, drawn, view, grid.parallel, records, window, i)


@device
def nearest_surface(arith, solids, surfaces, p, size, dx, dy, dz):
    """Return the nearest of the solids and of the triangles drawn at pixels p: at equal depth the solid.

    A triangle's normal points to where it is seen from.
    """
    apart(arith)
    hit = nearest_hit(arith, solids, origin(arith), dx, dy, dz)
    if surfaces.on == 0:
        return hit
    t = load(surfaces.drawn, p)
    nearer = t < hit.t
    if not any_lane(nearer):
        return hit
    index = maximum(to_int(load(surfaces.drawn, p + size)), spread_int(int32(0)))
    nx = gather(surfaces.normals, index * int32(3))
    ny = gather(surfaces.normals, index * int32(3) + int32(1))
    nz = gather(surfaces.normals, index * int32(3) + int32(2))
    turn = select(nx * dx + ny * dy + nz * dz > 0.0, dx * 0.0 - 1.0, 1.0)
    return Hit(
        select(nearer, t, hit.t),
        select(nearer, gather(surfaces.objects, index), hit.id),
        select(nearer, nx * turn, hit.nx),
        select(nearer, ny * turn, hit.ny),
        select(nearer, nz * turn, hit.nz),
    )
