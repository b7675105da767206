# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Surfaces and visibility of the beams Monte Carlo: crossings of segments with spheres, faces and triangles.

Written a second time on purpose, in another way than ``beams_geometry.py``, ``beams_mesh.py`` and ``beams_shadows.py``.
Only the tree of boxes over a mesh's triangles is the same.
"""

from __future__ import annotations

import math

from atmoref._jit import subroutine

__all__ = ["first_surface", "sun_visible", "visible"]

_END = 1e-9  # relative: crossings this near to a segment's end are its own surface


@subroutine
def _crosses_sphere(a, d, spheres, i, low, high):
    """Return the least crossing parameter in (low, high) of a + k d with a sphere's surface; infinite for none."""
    x, y, z = a[0] - spheres[i, 0], a[1] - spheres[i, 1], a[2] - spheres[i, 2]
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    b = 2.0 * (x * d[0] + y * d[1] + z * d[2])
    c = x * x + y * y + z * z - spheres[i, 3] * spheres[i, 3]
    root = b * b - 4.0 * square * c
    if root <= 0.0:
        return math.inf
    first = (-b - math.sqrt(root)) / (2.0 * square)
    second = (-b + math.sqrt(root)) / (2.0 * square)
    if low < first < high:
        return first
    return second if low < second < high else math.inf


@subroutine
def _crosses_box(a, d, boxes, i, low, high):
    """Return the least crossing parameter in (low, high) of a + k d with one of a box's six faces, and its axis."""
    best = math.inf
    axis = 0
    for k in range(6):
        n = k // 2
        plane = boxes[i, n] if k % 2 == 0 else boxes[i, n + 3]
        if d[n] == 0.0:
            continue
        t = (plane - a[n]) / d[n]
        j, m = (n + 1) % 3, (n + 2) % 3
        p = a[j] + t * d[j]
        r = a[m] + t * d[m]
        inside = boxes[i, j] < p < boxes[i, j + 3] and boxes[i, m] < r < boxes[i, m + 3]
        if inside and low < t < high and t < best:
            best, axis = t, n
    return best, axis


@subroutine
def _crosses_triangle(a, d, table, i):
    """Return the crossing parameter of a + k d with a triangle, infinite for none (Möller and Trumbore 1997)."""
    ux, uy, uz = table[i, 3] - table[i, 0], table[i, 4] - table[i, 1], table[i, 5] - table[i, 2]
    vx, vy, vz = table[i, 6] - table[i, 0], table[i, 7] - table[i, 1], table[i, 8] - table[i, 2]
    px, py, pz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
    determinant = ux * px + uy * py + uz * pz
    if determinant == 0.0:
        return math.inf
    wx, wy, wz = a[0] - table[i, 0], a[1] - table[i, 1], a[2] - table[i, 2]
    first = (wx * px + wy * py + wz * pz) / determinant
    qx, qy, qz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    second = (d[0] * qx + d[1] * qy + d[2] * qz) / determinant
    if first < 0.0 or second < 0.0 or first + second > 1.0:
        return math.inf
    return (vx * qx + vy * qy + vz * qz) / determinant


@subroutine
def _misses_box(a, d, boxes, i, low, high):
    """Tell whether a + k d is outside a box for every k in [low, high], by halves along each axis."""
    for k in range(3):
        begin, end = a[k] + low * d[k], a[k] + min(high, 1e30) * d[k]
        if max(begin, end) < boxes[i, k] or min(begin, end) > boxes[i, k + 3]:
            return True
        if d[k] != 0.0:
            first, second = (boxes[i, k] - a[k]) / d[k], (boxes[i, k + 3] - a[k]) / d[k]
            low, high = max(low, min(first, second)), min(high, max(first, second))
    return low > high


@subroutine
def _first_crossing(mesh, a, d, low, high, any_will_do):
    """Return the least crossing parameter in (low, high) of a + k d with a mesh, and the triangle; -1 for none."""
    best, index = math.inf, -1
    if mesh is None:
        return best, index
    node = 0
    while node < mesh.tree.shape[0]:
        if _misses_box(a, d, mesh.boxes, node, low, high):
            node = mesh.tree[node, 2]
            continue
        for i in range(mesh.tree[node, 0], mesh.tree[node, 1]):
            t = _crosses_triangle(a, d, mesh.triangles, i)
            if low < t < high:
                best, high, index = t, t, i
                if any_will_do:
                    return best, index
        node += 1
    return best, index


@subroutine
def _face(mesh, i, d):
    """Return the normal of a triangle, facing the eye, and its albedo."""
    if mesh is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    o = mesh.triangles[i]
    ux, uy, uz = o[3] - o[0], o[4] - o[1], o[5] - o[2]
    vx, vy, vz = o[6] - o[0], o[7] - o[1], o[8] - o[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(x * x + y * y + z * z)
    if x * d[0] + y * d[1] + z * d[2] > 0.0:
        length = -length
    return (x / length, y / length, z / length), (o[9], o[10], o[11])


@subroutine
def visible(objects, mesh, a, b):
    """Tell whether nothing crosses the segment between two points; surfaces at its ends do not count."""
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    high = 1.0 - _END
    for i in range(objects.spheres.shape[0]):
        if _crosses_sphere(a, d, objects.spheres, i, _END, high) < high:
            return False
    for i in range(objects.boxes.shape[0]):
        if _crosses_box(a, d, objects.boxes, i, _END, high)[0] < high:
            return False
    for i in range(objects.grounds.shape[0]):
        h = objects.grounds[i, 0]
        if abs(b[1] - h) > _END * abs(d[1]) and (a[1] < h) != (b[1] < h):
            return False
    return _first_crossing(mesh, a, d, _END, high, True)[1] < 0


@subroutine
def sun_visible(objects, mesh, p, axis, reach, size):
    """Tell whether nothing crosses the way from ``p`` against a sun's axis, ``reach`` metres or without end.

    What is nearer than 1e-9 of ``size`` metres is the surface that ``p`` lies on.
    """
    d = (-axis[0] * size, -axis[1] * size, -axis[2] * size)
    high = reach / size
    for i in range(objects.spheres.shape[0]):
        if _crosses_sphere(p, d, objects.spheres, i, _END, high) < high:
            return False
    for i in range(objects.boxes.shape[0]):
        if _crosses_box(p, d, objects.boxes, i, _END, high)[0] < high:
            return False
    for i in range(objects.grounds.shape[0]):
        if d[1] != 0.0 and _END < (objects.grounds[i, 0] - p[1]) / d[1] < high:
            return False
    return _first_crossing(mesh, p, d, _END, high, True)[1] < 0


@subroutine
def first_surface(objects, mesh, a, d):
    """Return distance, normal facing the eye, and albedo of the first surface from ``a`` along unit ``d``."""
    best = math.inf
    normal = (0.0, 0.0, 0.0)
    albedo = (0.0, 0.0, 0.0)
    for i in range(objects.spheres.shape[0]):
        t = _crosses_sphere(a, d, objects.spheres, i, 0.0, best)
        if t < best:
            best = t
            o = objects.spheres[i]
            normal = (
                (a[0] + t * d[0] - o[0]) / o[3],
                (a[1] + t * d[1] - o[1]) / o[3],
                (a[2] + t * d[2] - o[2]) / o[3],
            )
            albedo = (o[4], o[5], o[6])
    for i in range(objects.boxes.shape[0]):
        t, n = _crosses_box(a, d, objects.boxes, i, 0.0, best)
        if t < best:
            best = t
            face = -1.0 if d[n] > 0.0 else 1.0
            normal = (face if n == 0 else 0.0, face if n == 1 else 0.0, face if n == 2 else 0.0)
            albedo = (objects.boxes[i, 6], objects.boxes[i, 7], objects.boxes[i, 8])
    for i in range(objects.grounds.shape[0]):
        t = (objects.grounds[i, 0] - a[1]) / d[1] if d[1] != 0.0 else math.inf
        if 0.0 < t < best:
            best = t
            normal = (0.0, 1.0 if d[1] < 0.0 else -1.0, 0.0)
            albedo = (objects.grounds[i, 1], objects.grounds[i, 2], objects.grounds[i, 3])
    t, i = _first_crossing(mesh, a, d, 0.0, best, False)
    if i >= 0:
        best = t
        normal, albedo = _face(mesh, i, d)
    return best, normal, albedo
