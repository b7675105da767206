"""The kinds of object: sphere, box, ground, mesh, height field."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from atmoref.scene.describe import found
from atmoref.scene.errors import contradiction
from atmoref.scene.fields import BESIDE, FARTHEST_M, FileName, Fractions, Table, Vector, quantity

MESHES = ("mesh", "height_field")
"""Kinds that are made of triangles."""


class Sphere(Table):
    """A solid sphere."""

    type: Literal["sphere"] = quantity("", "Kind of object.")
    center_m: Vector = quantity("m", "Centre [x, y, z].")
    radius_m: float = quantity("m", "Radius.", gt=0.0, le=FARTHEST_M)
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")


class Box(Table):
    """A solid box with faces along the axes."""

    type: Literal["box"] = quantity("", "Kind of object.")
    min_m: Vector = quantity("m", "Corner with the least coordinates [x, y, z].")
    max_m: Vector = quantity("m", "Corner with the greatest coordinates [x, y, z].")
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not all(low < high for low, high in zip(self.min_m, self.max_m, strict=True)):
            below = f"less than max_m = {found(self.max_m)} in every coordinate (m)"
            raise contradiction(("min_m",), found(self.min_m), below)
        return self


class Ground(Table):
    """The plane y = height, seen from both sides."""

    type: Literal["ground"] = quantity("", "Kind of object.")
    height_m: float = quantity("m", "Height y of the plane.", 0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")


class Mesh(Table):
    """Triangles from a file; both sides reflect."""

    type: Literal["mesh"] = quantity("", "Kind of object.")
    path: FileName = quantity("", f"OBJ, PLY, STL, GLB or glTF, in metres and y up. {BESIDE}")
    scale: float = quantity("", "Factor on the file's coordinates, first.", 1.0, gt=0.0, le=FARTHEST_M)
    rotate_y_deg: float = quantity("degrees", "Turn about the y axis, from +z to +x, second.", 0.0, ge=-360.0, le=360.0)
    position_m: Vector = quantity("m", "Where the file's origin goes [x, y, z], last.", (0.0, 0.0, 0.0))
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")


class HeightField(Table):
    """Heights on a grid: columns along +x, rows along +z; each cell is two triangles.

    A cell is cut from (row, column) to (row + 1, column + 1). Both sides reflect.
    """

    type: Literal["height_field"] = quantity("", "Kind of object.")
    path: FileName = quantity("", f"Heights, one channel (PNG: 0 to 1; EXR, NPY: as they are). {BESIDE}")
    cell_m: float = quantity("m", "From one sample to the next.", gt=0.0, le=FARTHEST_M)
    height_scale_m: float = quantity("m", "Height where the file says 1.", ge=-FARTHEST_M, le=FARTHEST_M)
    center_m: Vector = quantity("m", "Middle of the grid, where the file says 0 [x, y, z].", (0.0, 0.0, 0.0))
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")


Object = Sphere | Box | Ground | Mesh | HeightField
