# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Depth of the scene as the spotlight sees it: window depth a - b / w at each texel centre, nearest object."""

from typing import NamedTuple

from numba import int32

from atmoref._jit import kernel
from atmoref.buffers.blend import encode, write
from atmoref.lanes import N, lift, load, maximum, minimum, pixels, select, spread_int
from atmoref.stages.ray_cast import FAR, nearest_hit


class ShadowUniforms(NamedTuple):
    """The light's camera: world axes scaled by tan(outer), direction, window depth."""

    step: float  # 2 / size
    right_x: float
    right_y: float
    right_z: float
    up_x: float
    up_y: float
    up_z: float
    axis_x: float
    axis_y: float
    axis_z: float
    near: float
    depth_a: float
    depth_b: float


@kernel
def shadow_map(depth, arith, form, rule, uniforms, solids, surfaces, pitch, size, row0, row1):
    """Rasterise rows [row0, row1) of a (size, pitch) depth buffer; the empty texel is 1; nearer than `near` is 0.

    `surfaces` are the triangles as `rasterise` drew them into the same texels.
    """
    u = lift(arith, uniforms)
    for row in range(row0, row1):
        y = (lift(arith, spread_int(int32(row))) + 0.5) * u.step - 1.0
        for column in range(0, size, N):
            x = pixels(arith, int32(column)) * u.step - 1.0
            dx = x * u.right_x + y * u.up_x + u.axis_x
            dy = x * u.right_y + y * u.up_y + u.axis_y
            dz = x * u.right_z + y * u.up_z + u.axis_z
            hit = nearest_hit(arith, solids, dx, dy, dz)
            p = row * pitch + column
            t = hit.t
            if surfaces.on != 0:
                t = minimum(load(surfaces.drawn, p), t)
            w = maximum(t, u.near)
            window = minimum(maximum(u.depth_a - u.depth_b / w, 0.0), 1.0)
            window = select(t < FAR, window, 1.0)
            write(depth, p, encode(form, rule, window))
