"""The perspective camera: its keys, its basis, its rays.

Right-handed world, y up, metres. The camera's right is forward x up, so a camera looking along +z has +x on its left.
A roll is a tilted ``up``. Pixel (column, row) has its centre at (column + 1/2, row + 1/2); row 0 is the top row.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, Self

from pydantic import model_validator

from atmoref.scene.errors import contradiction
from atmoref.scene.fields import FARTHEST_M, Table, Vector, quantity

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Vec3 = tuple[float, float, float]
_LEAST_SINE = 1e-6


def unit_vector(v: Vec3) -> Vec3:
    """Return v / |v|; only division and square root, so the same bits everywhere.

    Scaled by the largest component first: no overflow, and no underflow to a zero length. v must not be zero.
    """
    top = max(abs(v[0]), abs(v[1]), abs(v[2]))
    x, y, z = v[0] / top, v[1] / top, v[2] / top
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length + 0.0, y / length + 0.0, z / length + 0.0)  # + 0: no negative zeros


def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


class Camera(Table):
    """A pinhole with square pixels."""

    type: Literal["perspective"] = quantity("", "Kind of camera.", "perspective")
    position_m: Vector = quantity("m", "The eye [x, y, z].")
    look_at_m: Vector = quantity("m", "A point in the middle of the picture [x, y, z].")
    up: Vector = quantity("", "What is up in the picture; tilt it to roll the camera. Any length.", (0.0, 1.0, 0.0))
    vertical_fov_deg: float = quantity("degrees", "Whole opening angle from bottom to top edge.", ge=0.01, le=170.0)
    near_m: float = quantity("m", "Depth in front of which nothing is drawn.", 0.1, ge=1e-6, le=FARTHEST_M)
    far_m: float = quantity("m", "Depth behind which nothing is drawn.", 1000.0, ge=1e-6, le=FARTHEST_M)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.position_m == self.look_at_m:
            raise contradiction(("look_at_m",), f"{list(self.look_at_m)}, the camera's position_m", "another point (m)")
        if not self.near_m < self.far_m:
            raise contradiction(("near_m",), f"{self.near_m}", f"less than far_m, which is {self.far_m} (m)")
        if self.up == (0.0, 0.0, 0.0):
            raise contradiction(("up",), "[0, 0, 0]", "a direction of non-zero length")
        side = cross(self._forward(), unit_vector(self.up))
        if max(map(abs, side)) < _LEAST_SINE:
            raise contradiction(("up",), f"{list(self.up)}, parallel to the view", "a direction across the view")
        return self

    def _forward(self) -> Vec3:
        eye, target = self.position_m, self.look_at_m
        return unit_vector((target[0] - eye[0], target[1] - eye[1], target[2] - eye[2]))

    def basis(self) -> tuple[Vec3, Vec3, Vec3]:
        """Return the unit vectors (right, up, forward); right = forward x up.

        Only + - * / and square roots: the same bits on every machine. Orthogonal to a few 1e-16 unless ``up`` is
        almost parallel to the view.
        """
        forward = self._forward()
        right = unit_vector(cross(forward, unit_vector(self.up)))
        return right, unit_vector(cross(right, forward)), forward


def pixel_to_camera_plane(camera: Camera, width: int, height: int, x: float, y: float) -> tuple[float, float]:
    """Return (ex, ey): right and up offsets, at unit depth, of the picture point x, y.

    Parameters
    ----------
    camera
        Only its opening angle counts.
    width, height
        Picture size in pixels.
    x, y
        Pixels from the left and from the *top* edge; centre of pixel (column, row) is (column + 0.5, row + 0.5).

    Notes
    -----
    Uses the platform's tangent: for truths and tests. Mirrors compute their own, which has the same bits everywhere.
    """
    half = math.tan(math.radians(camera.vertical_fov_deg) / 2.0)
    return (2.0 * x / width - 1.0) * half * (width / height), (1.0 - 2.0 * y / height) * half


def ray_directions(camera: Camera, width: int, height: int) -> NDArray[np.float64]:
    """Return the ray through every pixel centre, (height, width, 3), row 0 at the top.

    Not normalised: forward + ex * right + ey * up, so that a parameter along the ray is *depth* in metres.
    Error: a few ulp; uses NumPy's tangent, so for truths and tests only (see ``pixel_to_camera_plane``).
    """
    import numpy as np

    right, up, forward = (np.array(axis) for axis in camera.basis())
    half = np.tan(np.deg2rad(camera.vertical_fov_deg) / 2.0)
    ex = (2.0 * (np.arange(width) + 0.5) / width - 1.0) * half * (width / height)
    ey = (1.0 - 2.0 * (np.arange(height) + 0.5) / height) * half
    rays: NDArray[np.float64] = forward + ex[None, :, None] * right + ey[:, None, None] * up
    return rays
