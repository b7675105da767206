# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""The vertex stage of the previous method: g dt at the mesh vertices of every plane [Dobashi 2002, eq. 3].

Always in float64, as the host of 2002 computed vertex colours; they are quantised when they are stored.
"""

from typing import NamedTuple

from atmoref._jit import kernel
from atmoref.lanes import Double, N, exp, lift, load, maximum, sqrt, store
from atmoref.optics.lane_phase import lane_phase
from atmoref.stages.camera import Camera


class VertexUniforms(NamedTuple):
    """Uniforms of one light's vertices (float; metres, 1/m, W/(sr m))."""

    camera: Camera
    from_x: float  # eye - light, world axes
    from_y: float
    from_z: float
    dt: float
    g: float
    cosine: float  # +1, or -1 for the wrong scattering angle of D-E3
    axis_x: float  # unit vector of the light's travel
    axis_y: float
    axis_z: float


@kernel
def vertex_colours(out, ex, ey, z, sigma, source, uniforms, phase, stretch, parallel, count):
    """Fill out[channel, plane, vertex] (flat, N elements longer) with rho F(alpha) exp(-sigma_t (s + t)) / s^2 dt.

    ex, ey : image-plane coordinates of the `count` vertices, padded to a multiple of N; z : depths of the planes, m;
    sigma, source : per channel; stretch : 1 if dt is to be divided by cos psi (D-E6); parallel : 1 for the sun,
    which has neither 1 / s^2 nor s (D-E13).  Each lane store may run into the
    next plane, which is written after it.
    """
    arith = Double()
    u = lift(arith, uniforms)
    c = u.camera
    for channel in range(sigma.size):
        sigma_t, strength = lift(arith, sigma[channel]), lift(arith, source[channel])
        for k in range(z.size):
            depth = lift(arith, z[k])
            start = (channel * z.size + k) * count
            for i in range(0, count, N):
                x, y = load(ex, i), load(ey, i)
                span = sqrt(x * x + y * y + 1.0)
                dx = x * c.right_x + y * c.up_x + c.forward_x
                dy = x * c.right_y + y * c.up_y + c.forward_y
                dz = x * c.right_z + y * c.up_z + c.forward_z
                px, py, pz = dx * depth + u.from_x, dy * depth + u.from_y, dz * depth + u.from_z
                distance = maximum(sqrt(px * px + py * py + pz * pz), 1e-6)
                mu = (dx * px + dy * py + dz * pz) / (distance * span) * -1.0
                path = distance + depth * span
                if parallel != 0:
                    mu = (dx * u.axis_x + dy * u.axis_y + dz * u.axis_z) / span * -1.0
                    distance, path = span * 0.0 + 1.0, depth * span
                common = lane_phase(phase, u.g, mu * u.cosine) / (distance * distance) * u.dt
                if stretch != 0:
                    common = common * span
                store(out, start + i, common * strength * exp(path * sigma_t * -1.0))
