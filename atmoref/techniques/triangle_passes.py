"""Triangles of a scene as passes: one set for all views, and for each view its records and the draw of all of them.

What the host computes here is float64 with + - * / and square roots, so that it has the same bits everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.blend import Mixed
from atmoref.buffers.formats import FORMATS
from atmoref.buffers.layout import allocate, needed_bytes
from atmoref.numerics.hierarchy import Hierarchy, hierarchy
from atmoref.numerics.vectors import Vec3, cross, dot, scaled
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene
from atmoref.stages.beam_planes import Window
from atmoref.stages.camera import Camera
from atmoref.stages.ray_cast import OCCLUDER, Solids
from atmoref.stages.shadow_map import ShadowUniforms
from atmoref.stages.triangles import (
    GROUP,
    RECORD,
    SLACK,
    Axes,
    Grid,
    Records,
    Surfaces,
    face_normals,
    rasterise,
    set_up_occluders,
    set_up_parallel_occluders,
    set_up_triangles,
)

if TYPE_CHECKING:
    from atmoref.techniques.setting import Setting

OCCLUDER_BYTES = 8 * (OCCLUDER + 2 * 9) + 40  # per triangle: record, boxes while the tree is made, nodes
Projection = Literal["perspective", "parallel"]


@dataclass(frozen=True, slots=True)
class TriangleSet:
    """All triangles of a scene, one object after the other.

    Parameters
    ----------
    vertices : (V, 3) float64
        Metres, world.
    faces : (F, 3) int32
    objects : (F,) int32
        Object of each triangle, by its place in the scene.
    normals : (3 F,) of the arithmetic
        Unit vectors, towards the side from which the corners run counter-clockwise.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    objects: NDArray[np.int32]
    normals: NDArray[Any]

    @staticmethod
    def of(scene: Scene, dtype: type[np.floating[Any]]) -> TriangleSet:
        """Return the triangles of a scene for an arithmetic."""
        vertices, faces, objects = [np.zeros((0, 3))], [np.zeros((0, 3), np.int32)], [np.zeros(0, np.int32)]
        before = 0
        for i in range(len(scene.objects)):
            part = scene.triangles(i)
            if part is None:
                continue
            vertices.append(part.vertices)
            faces.append(part.faces + np.int32(before))
            objects.append(np.full(len(part.faces), i, np.int32))
            before += len(part.vertices)
        points, corners = np.concatenate(vertices), np.concatenate(faces)
        normals = np.empty(3 * len(corners), dtype)
        face_normals(normals, points, corners)
        return TriangleSet(points, corners, np.concatenate(objects), normals)

    def tree(self) -> Hierarchy:
        """Return the tree of the triangles' boxes."""
        corners = self.vertices[self.faces]
        return hierarchy(corners.min(1), corners.max(1))

    @property
    def count(self) -> int:
        """How many triangles there are."""
        return len(self.faces)


def axes(origin: Vec3, right: Vec3, up: Vec3, axis: Vec3) -> Axes:
    """Return the view in which the point origin + z (x right + y up + axis) has the coordinates (x z, y z, z).

    Parallel views: origin + x right + y up + z axis has (x, y, z).  The three vectors may have any length and angles,
    short of lying in one plane.
    """
    volume = dot(right, cross(up, axis))
    return Axes(
        origin, scaled(cross(up, axis), 1.0 / volume), scaled(cross(axis, right), 1.0 / volume),
        scaled(cross(right, up), 1.0 / volume),
    )  # fmt: skip


def camera_view(camera: Camera, position: Vec3) -> tuple[Grid, Axes]:
    """Return the pixels and axes of the camera's picture; rays as in `stages.camera`."""
    grid = Grid(camera.step_x, camera.start_x, camera.tan_x, camera.step_y, camera.start_y, camera.tan_y, 0)
    right, up = (camera.right_x, camera.right_y, camera.right_z), (camera.up_x, camera.up_y, camera.up_z)
    return grid, axes(position, right, up, (camera.forward_x, camera.forward_y, camera.forward_z))


def shadow_view(u: ShadowUniforms, origin: Vec3, projection: Projection = "perspective") -> tuple[Grid, Axes]:
    """Return the texels and axes of a shadow map, whose rays are x right + y up + axis, x and y from -1 to 1."""
    grid = Grid(u.step, -1.0, 1.0, u.step, -1.0, 1.0, int(projection == "parallel"))
    right, up = (u.right_x, u.right_y, u.right_z), (u.up_x, u.up_y, u.up_z)
    return grid, axes(origin, right, up, (u.axis_x, u.axis_y, u.axis_z))


def records(
    triangles: TriangleSet, grid: Grid, view: Axes, width: int, height: int, dtype: type[np.floating[Any]]
) -> Records:
    """Return the triangles that a view can see, ready to be drawn in the arithmetic `dtype`."""
    count = triangles.count
    made = Records(
        np.empty((count, RECORD), dtype), np.empty((count, 4), np.int32), np.empty(count, np.int32),
        np.empty((count // GROUP + 1, 2), np.int32), np.zeros(1, np.int64),
    )  # fmt: skip
    set_up_triangles(made, triangles.vertices, triangles.faces, view, grid, width, height, slack(dtype))
    return made


def slack(dtype: type[np.floating[Any]]) -> float:
    """Return SLACK roundings of an arithmetic."""
    return SLACK * float(np.finfo(dtype).eps) / 2.0


def with_occluders(solids: Solids, triangles: TriangleSet, origin: Vec3, dtype: type[np.floating[Any]]) -> Solids:
    """Return solids that hold a tree of the triangles as well, for exact visibility from their origin.

    Boxes are wider than their triangles by some roundings of float32: no lane can miss the box of what it hits.
    """
    tree = triangles.tree()
    start = np.array(origin)
    near = tree.boxes - np.concatenate([start, start])
    pad = 1e-6 * np.abs(near).reshape(-1, 2, 3).max(1) + 1e-30
    made = np.empty((triangles.count, OCCLUDER))
    set_up_occluders(made, triangles.vertices, triangles.faces, tree.order, origin, slack(dtype))
    return solids._replace(
        nodes=np.hstack([near[:, :3] - pad, near[:, 3:] + pad]),
        links=np.stack([tree.skips, tree.first, tree.number], -1),
        triangles=made,
        triangle_ids=triangles.objects[tree.order],
    )


def with_parallel_occluders(
    solids: Solids, triangles: TriangleSet, view: Axes, dtype: type[np.floating[Any]]
) -> Solids:
    """Return solids that hold a tree of the triangles as well, for exact visibility in parallel light.

    Boxes are in the light's axes, and wider than their triangles by some roundings of float32.
    """
    apart = triangles.vertices - np.array(view.origin)
    corners = np.stack([sum_of_products(apart, axis) for axis in (view.right, view.up, view.axis)], -1)
    of_faces = corners[triangles.faces]
    tree = hierarchy(of_faces.min(1), of_faces.max(1))
    pad = 1e-6 * np.abs(tree.boxes).reshape(-1, 2, 3).max(1) + 1e-30
    made = np.empty((triangles.count, OCCLUDER))
    set_up_parallel_occluders(made, corners, triangles.faces, tree.order, slack(dtype))
    return solids._replace(
        nodes=np.hstack([tree.boxes[:, :3] - pad, tree.boxes[:, 3:] + pad]),
        links=np.stack([tree.skips, tree.first, tree.number], -1),
        triangles=made,
        triangle_ids=triangles.objects[tree.order],
    )


def sum_of_products(points: NDArray[np.float64], axis: Vec3) -> NDArray[np.float64]:
    """Return the products of points with a vector, added from left to right: the same bits everywhere."""
    return np.asarray(points[:, 0] * axis[0] + points[:, 1] * axis[1] + points[:, 2] * axis[2])


def no_surfaces(setting: Setting) -> Surfaces:
    """Return what kernels get without triangles."""
    nothing = np.zeros(1, setting.dtype)
    return Surfaces(0, nothing, np.zeros(1, np.int32), nothing)


def triangle_pass(
    setting: Setting,
    bank: Bank,
    triangles: TriangleSet,
    name: str,
    key: str,
    view: tuple[Grid, Axes],
    size: tuple[int, int],
    window: Callable[[int, int], Window] | None = None,
    rows: tuple[int, int] | None = None,
) -> tuple[Surfaces, Pass]:
    """Return what triangles leave at the pixels of a view, and the pass that draws them there.

    Parameters
    ----------
    setting : Setting
    bank : dict of Buffer
        Gets the buffer `key` of two channels: depth in metres (FAR where nothing is) and index of the triangle (-1).
    triangles : TriangleSet
        With at least one triangle.
    name : str
        Of the pass and its draw.
    key : str
    view : (Grid, Axes)
    size : (width, height)
    window : callable (row0, row1) -> Window, or None
        What to draw; None: all columns.
    rows : (row0, row1) or None
        What to draw; None: all rows.

    Raises
    ------
    OutOfMemory
    """
    width, height = size
    grid, place = view
    element = np.dtype(setting.dtype).itemsize
    needed = needed_bytes(width, height, 2, Mixed(), setting.point_arithmetic)
    needed += triangles.count * (RECORD * element + 5 * 4 + 3 * element + 4)
    setting.account.require(needed, f"buffer {key} ({width} x {height}, {triangles.count} triangles)", keep=True)
    buffer = allocate(key, FORMATS[setting.point_arithmetic], width, height, 2, Mixed(), setting.point_arithmetic)
    bank[key] = buffer
    made = records(triangles, grid, place, width, height, setting.dtype)

    def draw(d0: int, d1: int, row0: int, row1: int) -> None:
        part = Window(0, width, row0, row1, height, buffer.pitch, d0, d1, 0) if window is None else window(row0, row1)
        rasterise(buffer.data, setting.point_arith, grid, made, part)

    surfaces = Surfaces(1, buffer.data, triangles.objects, triangles.normals)
    return surfaces, Pass(name, (name,), height, draw, (key,), rows)
