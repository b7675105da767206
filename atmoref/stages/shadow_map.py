# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Depth of the scene as the light sees it, nearest object at each texel centre: window depth a - b / w, or a + b w.

The first is that of a spotlight or projector, the second that of the sun, whose rays are parallel.
"""

from typing import NamedTuple

from numba import int32

from atmoref._jit import kernel
from atmoref.buffers.blend import encode, write
from atmoref.lanes import N, lift, load, maximum, minimum, pixels, select, spread_int
from atmoref.stages.ray_cast import FAR, Start, nearest_hit, origin


class ShadowUniforms(NamedTuple):
    """The light's camera: half the texture rectangle at unit depth, or half the sun's window; axis, window depth."""

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
def shadow_map(depth, arith, form, rule, uniforms, parallel, solids, surfaces, pitch, size, row0, row1):
    """Rasterise rows [row0, row1) of a (size, pitch) depth buffer; the empty texel is 1; nearer than `near` is 0.

    `surfaces` are the triangles as `rasterise` drew them into the same texels.
    """
    u = lift(arith, uniforms)
    zero = lift(arith, 0.0)
    for row in range(row0, row1):
        y = (lift(arith, spread_int(int32(row))) + 0.5) * u.step - 1.0
        for column in range(0, size, N):
            x = pixels(arith, int32(column)) * u.step - 1.0
            sx, sy, sz = x * u.right_x + y * u.up_x, x * u.right_y + y * u.up_y, x * u.right_z + y * u.up_z
            p = row * pitch + column
            if parallel != 0:
                t = nearest_hit(arith, solids, Start(sx, sy, sz), zero + u.axis_x, zero + u.axis_y, zero + u.axis_z).t
            else:
                t = nearest_hit(arith, solids, origin(arith), sx + u.axis_x, sy + u.axis_y, sz + u.axis_z).t
            if surfaces.on != 0:
                t = minimum(load(surfaces.drawn, p), t)
            w = maximum(t, u.near)
            window = u.depth_a + u.depth_b * w if parallel != 0 else u.depth_a - u.depth_b / w
            window = minimum(maximum(window, 0.0), 1.0)
            window = select(t < FAR, window, 1.0)
            write(depth, p, encode(form, rule, window))
