# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""The previous method [Dobashi 2002, sec. 4.1]: every plane adds vertex colour g dt times light map times shadow.

One draw a plane.  g comes from the vertices of a fine mesh (quantised like any vertex colour) or from the pixel's own
ray.
"""

from typing import Any, NamedTuple

from numba import int32
from numpy.typing import NDArray

from atmoref._jit import device, kernel
from atmoref.lanes import N, any_lane, count_lanes, exp, lift, load, maximum, select, spread_int, sqrt
from atmoref.optics.lane_phase import lane_phase
from atmoref.stages.beam_planes import (
    MAIN_LIT_WAVES,
    MAIN_WAVES,
    SUB_SAMPLES,
    probe_values,
)
from atmoref.stages.camera import camera_ray
from atmoref.stages.main_plane import DT_PAPER, interpolate, mesh_corner
from atmoref.stages.spot_light import illuminate, light_ray, light_span
from atmoref.stages.target import Colour, add_colour, read_colour, write_colour


class VertexDraws(NamedTuple):
    """The planes of one light : eye-space depth and window depth in units of the depth buffer."""

    z: NDArray[Any]
    depth: NDArray[Any]


@device
def _attenuation(slab, switches, distance, path, mu, dt):
    """Return g dt = rho F(alpha) exp(-sigma_t (s + t)) / s^2 dt, three channels [eq. 3]."""
    common = lane_phase(switches.phase, slab.g, mu * slab.cosine) / (distance * distance) * dt
    r = slab.source_r * common * exp(path * slab.sigma_r * -1.0)
    g, b = r, r
    if switches.grey == 0:
        g = slab.source_g * common * exp(path * slab.sigma_g * -1.0)
        b = slab.source_b * common * exp(path * slab.sigma_b * -1.0)
    return r, g, b


@device
def plane_source(arith, slab, switches, colours, ray, corner, z, plane, count):
    """Return g dt of one plane, from the mesh or from the pixel."""
    vertices = (switches.mesh_x + 1) * (switches.mesh_y + 1)
    if switches.vertex != 0:
        r = interpolate(arith, switches, colours, plane * vertices, corner)
        g, b = r, r
        if switches.grey == 0:
            g = interpolate(arith, switches, colours, (count + plane) * vertices, corner)
            b = interpolate(arith, switches, colours, (2 * count + plane) * vertices, corner)
        return r, g, b
    x, y, w = ray.dx * z + slab.from_x, ray.dy * z + slab.from_y, ray.dz * z + slab.from_z
    distance = maximum(sqrt(x * x + y * y + w * w), 1e-6)
    mu = (ray.dx * x + ray.dy * y + ray.dz * w) / (distance * ray.length) * -1.0
    path = distance + z * ray.length
    if switches.parallel != 0:  # neither 1 / s^2 nor a way from the light (D-E13)
        mu = (ray.dx * slab.axis_x + ray.dy * slab.axis_y + ray.dz * slab.axis_z) / ray.length * -1.0
        distance, path = ray.length * 0.0 + 1.0, z * ray.length
    dt = slab.dt + ray.length * 0.0
    if switches.dt_mode != DT_PAPER:
        dt = dt * ray.length
    return _attenuation(slab, switches, distance, path, mu, dt)


@kernel
def vertex_planes(
    frame, depth, counters, probe, arith, form, rules, uniforms, maps, colours, grid, solids, draws, window
):
    """Draw planes [window.d0, window.d1) of one light into `frame`, planar (3, height, pitch)."""
    switches, slab_switches = uniforms.switches, uniforms.slab_switches
    camera, spot, slab = lift(arith, uniforms.camera), lift(arith, uniforms.spot), lift(arith, uniforms.slab)
    size = window.height * window.pitch
    count = draws.z.size
    air = spread_int(int32(-1))
    zero = lift(arith, 0.0)
    for row in range(window.row0, window.row1):
        waves, lit_waves, samples = 0, 0, 0
        for column in range(window.column0, window.column1, N):
            p = row * window.pitch + column
            ray = camera_ray(arith, camera, column, row)
            light = light_ray(spot, ray)
            span = light_span(switches, spot, light)
            corner = mesh_corner(arith, slab, slab_switches, grid, column, row)
            surface = lift(arith, load(depth, p))
            stored = read_colour(arith, frame, p, size)
            for k in range(window.d0, window.d1):
                waves += 1
                z = lift(arith, draws.z[k])
                if switches.skip != 0 and window.trace == 0:
                    reached = (z >= span.near) & (z <= span.far) & (lift(arith, draws.depth[k]) < surface)
                    if not any_lane(reached):
                        continue
                lit = illuminate(arith, switches, spot, maps, solids, ray, light, z, air)
                mask = lit.mask & (lift(arith, draws.depth[k]) < surface)
                f_r, f_g, f_b = zero, zero, zero
                if any_lane(mask) or switches.skip == 0:
                    lit_waves += 1
                    samples += count_lanes(mask)
                    f_r, f_g, f_b = plane_source(arith, slab, slab_switches, colours, ray, corner, z, k, count)
                    f_r = select(mask, f_r * lit.r, zero)
                    f_g = select(mask, f_g * lit.g, zero)
                    f_b = select(mask, f_b * lit.b, zero)
                    stored = add_colour(form, rules, stored, f_r, f_g, f_b)
                if window.trace != 0:
                    probe_values(probe, k, z, lit.u, lit.v, lit.w, mask, Colour(f_r, f_g, f_b), stored)
            write_colour(frame, p, size, stored)
        counters[row, MAIN_WAVES] += waves
        counters[row, MAIN_LIT_WAVES] += lit_waves
        counters[row, SUB_SAMPLES] += samples
