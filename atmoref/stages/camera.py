# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""The vertex stage of a full-screen pass: a lane of pixels as rays of the camera.

Rows count from the bottom (OpenGL).  A ray's parameter is eye-space depth z, so a screen-parallel plane has one z and
P = eye + z (forward + ex right + ey up); `length` is |P - eye| / z = 1 / cos psi.
"""

from typing import Any, NamedTuple

from numba import int32

from atmoref._jit import device
from atmoref.lanes import lift, pixels, spread_int, sqrt


class Camera(NamedTuple):
    """Uniforms of the camera: half-extents of the image plane at z = 1, twice the pixel pitch, world axes."""

    tan_x: float
    tan_y: float
    step_x: float  # 2 / width
    step_y: float  # 2 / height
    right_x: float
    right_y: float
    right_z: float
    up_x: float
    up_y: float
    up_z: float
    forward_x: float
    forward_y: float
    forward_z: float
    start_x: float  # image-plane coordinate, in half-extents, of the left and lower edge: -1, or an interleaved image's
    start_y: float
    depth_a: float  # window depth of eye-space depth z: depth_a - depth_b / z, in [0, 1] from near to far
    depth_b: float


class Ray(NamedTuple):
    """Lanes: image-plane coordinates, world direction per unit of z, its length."""

    ex: Any
    ey: Any
    dx: Any
    dy: Any
    dz: Any
    length: Any


@device
def camera_ray(arith, camera, column, row):
    """Return rays through the centres of N pixels that start at (column, row); camera is lifted."""
    ex = (pixels(arith, int32(column)) * camera.step_x + camera.start_x) * camera.tan_x
    ey = ((lift(arith, spread_int(int32(row))) + 0.5) * camera.step_y + camera.start_y) * camera.tan_y
    dx = ex * camera.right_x + ey * camera.up_x + camera.forward_x
    dy = ex * camera.right_y + ey * camera.up_y + camera.forward_y
    dz = ex * camera.right_z + ey * camera.up_z + camera.forward_z
    return Ray(ex, ey, dx, dy, dz, sqrt(ex * ex + ey * ey + 1.0))
