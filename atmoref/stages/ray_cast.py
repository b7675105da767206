# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Rays against spheres, boxes and ground planes, in lanes: what a GPU build rasterises, without tessellation."""

from typing import Any, NamedTuple

import numpy as np
from numba import int32
from numpy.typing import NDArray

from atmoref._jit import device, subroutine
from atmoref.lanes import absolute, any_lane, apart, lift, maximum, minimum, select, spread_int, sqrt, whole

NOTHING = -1
OCCLUDER = 13  # three edge functions, plane function, slack
SELF = 1e-3  # over this last part of the way to a point of its own, a mesh does not shade it
OWN = 64.0  # times the slack of a depth: in the sun, a mesh does not shade points of its own that are nearer behind it
FAR = 1e30  # metres: farther than any scene, finite in float32


class Solids(NamedTuple):
    """Objects relative to one origin (eye or light), so that differences of large numbers are taken in float64.

    Object i of the scene has the id i; `albedo` is indexed by it.
    """

    spheres: NDArray[np.float64]  # (n, 4): centre - origin, radius
    sphere_ids: NDArray[np.int32]
    boxes: NDArray[np.float64]  # (n, 6): lower corner - origin, upper corner - origin
    box_ids: NDArray[np.int32]
    grounds: NDArray[np.float64]  # (n,): height - origin height
    ground_ids: NDArray[np.int32]
    albedo: NDArray[np.float64]  # (objects, 3)
    nodes: NDArray[np.float64]  # (nodes, 6): boxes around triangles, lower and upper corner - origin, or in its axes
    links: NDArray[np.int32]  # (nodes, 3): next node when missed, first triangle, how many (0: children follow)
    triangles: NDArray[np.float64]  # (n, OCCLUDER), see `stages.triangles.set_up_occluders`
    triangle_ids: NDArray[np.int32]


class Hit(NamedTuple):
    """Nearest hit of each lane: ray parameter (FAR if none), object id (NOTHING), unit normal towards the outside."""

    t: Any
    id: Any
    nx: Any
    ny: Any
    nz: Any


class Start(NamedTuple):
    """Where rays start, relative to the origin of the solids: lanes, or the origin itself."""

    x: Any
    y: Any
    z: Any


@device
def origin(arith):
    """Return the origin of the solids as the start of rays; differences to it cost nothing."""
    zero = lift(arith, 0.0)
    return Start(zero, zero, zero)


@device
def sphere_roots(arith, sphere, start, dx, dy, dz):
    """Return whether the line meets the sphere, and both parameters.

    sqrt(d.d r^2 - |c x d|^2) loses no digits far away.
    """
    x, y, z = lift(arith, sphere[0]) - start.x, lift(arith, sphere[1]) - start.y, lift(arith, sphere[2]) - start.z
    radius = lift(arith, sphere[3])
    along = x * dx + y * dy + z * dz
    cx, cy, cz = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
    dd = dx * dx + dy * dy + dz * dz
    rest = dd * radius * radius - (cx * cx + cy * cy + cz * cz)
    root = sqrt(maximum(rest, 0.0))
    return rest > 0.0, (along - root) / dd, (along + root) / dd


@device
def _slab(arith, low, high, start, d):
    """Entry and exit parameters of one pair of box planes; a parallel ray inside counts as (-FAR, FAR)."""
    safe = select((d < 1e-20) & (d > -1e-20), 1e-20, d)
    a, b = (lift(arith, low) - start) / safe, (lift(arith, high) - start) / safe
    return minimum(a, b), maximum(a, b)


@device
def box_roots(arith, box, start, dx, dy, dz):
    """Return whether the line meets the box, both parameters, and the three entries (for the normal)."""
    x0, x1 = _slab(arith, box[0], box[3], start.x, dx)
    y0, y1 = _slab(arith, box[1], box[4], start.y, dy)
    z0, z1 = _slab(arith, box[2], box[5], start.z, dz)
    enter = maximum(maximum(x0, y0), z0)
    leave = minimum(minimum(x1, y1), z1)
    return enter < leave, enter, leave, x0, y0, z0


@device
def ground_root(arith, height, start, dy):
    """Return the parameter at which a ray meets the plane y = height; FAR when parallel."""
    parallel = (dy < 1e-20) & (dy > -1e-20)
    return select(parallel, FAR, (lift(arith, height) - start.y) / select(parallel, 1e-20, dy))


@device
def _first(enter, leave):
    """Return the nearer parameter ahead of the origin (an origin inside sees the exit)."""
    return select(enter > 0.0, enter, leave)


@device
def between(meets, enter, leave):
    """Return the mask of lanes whose open segment from parameter 0 to 1 the object cuts."""
    t = _first(enter, leave)
    return meets & (t > 0.0) & (t < 1.0)


@device
def _meets_box(arith, box, ix, iy, iz):
    """Return the mask of lanes whose segment from parameter 0 to 1 meets a box; i are inverses of the direction."""
    ax, bx = lift(arith, box[0]) * ix, lift(arith, box[3]) * ix
    ay, by = lift(arith, box[1]) * iy, lift(arith, box[4]) * iy
    az, bz = lift(arith, box[2]) * iz, lift(arith, box[5]) * iz
    enter = maximum(maximum(minimum(ax, bx), minimum(ay, by)), minimum(az, bz))
    leave = minimum(minimum(maximum(ax, bx), maximum(ay, by)), maximum(az, bz))
    return (enter <= leave) & (leave > 0.0) & (enter < 1.0)


@device
def _inverse(d):
    """Return 1 / d, finite."""
    return (d * 0.0 + 1.0) / select((d < 1e-20) & (d > -1e-20), 1e-20, d)


@device
def _linear(arith, record, place, dx, dy, dz):
    """Return a function of a triangle at d."""
    return lift(arith, record[place]) * dx + lift(arith, record[place + 1]) * dy + lift(arith, record[place + 2]) * dz


@device
def occluded_by_triangles(arith, solids, dx, dy, dz, own, blocked):
    """Return `blocked`, and where a triangle cuts the segment from the origin to d.

    The plane function is the inverse of the parameter of the hit.  A lane's answer does not hang on its neighbours':
    what a box has kept out is not looked at, also where another lane needs that box.
    """
    apart(arith)
    reach = maximum(maximum(absolute(dx), absolute(dy)), absolute(dz))
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    node = 0
    while node < solids.nodes.shape[0]:
        near = _meets_box(arith, solids.nodes[node], ix, iy, iz) & ~blocked
        if not any_lane(near):
            node = solids.links[node, 0]
            continue
        for i in range(solids.links[node, 1], solids.links[node, 1] + solids.links[node, 2]):
            record = solids.triangles[i]
            slack = reach * lift(arith, record[12])
            inside = (_linear(arith, record, 0, dx, dy, dz) + slack >= 0.0) & near
            inside = inside & (_linear(arith, record, 3, dx, dy, dz) + slack >= 0.0)
            inside = inside & (_linear(arith, record, 6, dx, dy, dz) + slack >= 0.0)
            least = select(own == spread_int(solids.triangle_ids[i]), reach * 0.0 + (1.0 + SELF), 1.0)
            blocked = blocked | (inside & (_linear(arith, record, 9, dx, dy, dz) > least))
        node += 1
    return blocked


@device
def parallel_occluded_by_triangles(arith, solids, x, y, w, least_w, own, blocked):
    """Return `blocked`, and where a triangle lies between the depths `least_w` and w of parallel light at (x, y).

    Nodes and triangles are in the light's own axes, see `stages.triangles.set_up_parallel_occluders`.
    """
    apart(arith)
    one = x * 0.0 + 1.0
    reach = maximum(maximum(absolute(x), absolute(y)), one)
    node = 0
    while node < solids.nodes.shape[0]:
        box = solids.nodes[node]
        near = (x >= lift(arith, box[0])) & (x <= lift(arith, box[3])) & (y >= lift(arith, box[1])) & ~blocked
        near = near & (y <= lift(arith, box[4])) & (w > lift(arith, box[2])) & (lift(arith, box[5]) > least_w)
        if not any_lane(near):
            node = solids.links[node, 0]
            continue
        for i in range(solids.links[node, 1], solids.links[node, 1] + solids.links[node, 2]):
            record = solids.triangles[i]
            slack = reach * lift(arith, record[12])
            inside = (_linear(arith, record, 0, x, y, one) + slack >= 0.0) & near
            inside = inside & (_linear(arith, record, 3, x, y, one) + slack >= 0.0)
            inside = inside & (_linear(arith, record, 6, x, y, one) + slack >= 0.0)
            depth = _linear(arith, record, 9, x, y, one)
            size = absolute(lift(arith, record[9])) + absolute(lift(arith, record[10])) + absolute(depth)
            room = (size + absolute(w)) * lift(arith, record[12]) * OWN
            room = select(own == spread_int(solids.triangle_ids[i]), room, 0.0)
            blocked = blocked | (inside & (depth > least_w) & (depth + room < w))
        node += 1
    return blocked


@subroutine
def occluded(arith, solids, start, dx, dy, dz, own):
    """Return the mask: does any object other than `own` cut the segment from start to start + d?  Exact visibility.

    Triangles may belong to `own`, and want the origin as the start.
    """
    return occluded_by_triangles(arith, solids, dx, dy, dz, own, _occluded(arith, solids, start, dx, dy, dz, own))


@subroutine
def parallel_occluded(arith, solids, start, dx, dy, dz, x, y, w, least_w, own):
    """Return `occluded` in parallel light: triangles are asked in its axes, where the start is (x, y, w)."""
    blocked = _occluded(arith, solids, start, dx, dy, dz, own)
    return parallel_occluded_by_triangles(arith, solids, x, y, w, least_w, own, blocked)


@device
def _occluded(arith, solids, start, dx, dy, dz, own):
    """Return `occluded` without triangles."""
    apart(arith)
    blocked = own < spread_int(int32(-2))
    for i in range(solids.spheres.shape[0]):
        meets, enter, leave = sphere_roots(arith, solids.spheres[i], start, dx, dy, dz)
        blocked = blocked | (between(meets, enter, leave) & (own != spread_int(solids.sphere_ids[i])))
    for i in range(solids.boxes.shape[0]):
        meets, enter, leave, _, _, _ = box_roots(arith, solids.boxes[i], start, dx, dy, dz)
        blocked = blocked | (between(meets, enter, leave) & (own != spread_int(solids.box_ids[i])))
    for i in range(solids.grounds.shape[0]):
        t = ground_root(arith, solids.grounds[i], start, dy)
        blocked = blocked | ((t > 0.0) & (t < 1.0) & (own != spread_int(solids.ground_ids[i])))
    return blocked


@device
def _sign(test, d):
    """Return the outward normal's component on the box axis that `test` says was entered."""
    return select(test, select(d > 0.0, d * 0.0 - 1.0, d * 0.0 + 1.0), 0.0)


@device
def nearest_hit(arith, solids, start, dx, dy, dz):
    """Return the nearest object ahead of the start along d (not necessarily a unit vector)."""
    apart(arith)
    zero = dx * 0.0
    t, nx, ny, nz = zero + FAR, zero, zero, zero
    found = whole(arith, spread_int(int32(NOTHING)))
    for i in range(solids.spheres.shape[0]):
        meets, enter, leave = sphere_roots(arith, solids.spheres[i], start, dx, dy, dz)
        s = _first(enter, leave)
        nearer = meets & (s > 0.0) & (s < t)
        scale = lift(arith, 1.0 / solids.spheres[i, 3])
        t = select(nearer, s, t)
        found = select(nearer, spread_int(solids.sphere_ids[i]), found)
        nx = select(nearer, (dx * s - (lift(arith, solids.spheres[i, 0]) - start.x)) * scale, nx)
        ny = select(nearer, (dy * s - (lift(arith, solids.spheres[i, 1]) - start.y)) * scale, ny)
        nz = select(nearer, (dz * s - (lift(arith, solids.spheres[i, 2]) - start.z)) * scale, nz)
    for i in range(solids.boxes.shape[0]):
        meets, enter, leave, x0, y0, z0 = box_roots(arith, solids.boxes[i], start, dx, dy, dz)
        s = _first(enter, leave)
        nearer = meets & (s > 0.0) & (s < t)
        on_x = x0 >= maximum(y0, z0)
        on_y = (y0 >= z0) & ~on_x
        t = select(nearer, s, t)
        found = select(nearer, spread_int(solids.box_ids[i]), found)
        nx = select(nearer, _sign(on_x, dx), nx)
        ny = select(nearer, _sign(on_y, dy), ny)
        nz = select(nearer, _sign(~(on_x | on_y), dz), nz)
    for i in range(solids.grounds.shape[0]):
        s = ground_root(arith, solids.grounds[i], start, dy)
        nearer = (s > 0.0) & (s < t)
        t = select(nearer, s, t)
        found = select(nearer, spread_int(solids.ground_ids[i]), found)
        nx, nz = select(nearer, 0.0, nx), select(nearer, 0.0, nz)
        ny = select(nearer, select(dy > 0.0, zero - 1.0, zero + 1.0), ny)
    return Hit(t, found, nx, ny, nz)
