"""The previous method, scalar: for every pixel every plane adds vertex colour times light map times shadow."""

import functools
import math
from typing import Any

from reference.scalar_light import lighting
from reference.scalar_math import entry, inlined
from reference.scalar_slabs import make_mesh


@functools.cache
def vertex_loop(real: Any) -> Any:
    """Return the loop in one precision; draws [window.d0, window.d1)."""
    light = lighting(real)
    a = light.arithmetic
    exp, add, phase = a.exp, a.store.add, a.phase
    camera_ray, light_ray, illuminate = light.camera_ray, light.light_ray, light.illuminate
    zero, one, least = real(0), real(1), real(1e-6)
    corner_of, attribute = make_mesh(real, a.texture.fma)

    @inlined
    def source(c, strength, sigma, choices, colours, corner, common, path, k, planes):
        if choices.vertex != 0:
            return attribute(colours, (c * planes + k) * (choices.mesh_x + 1) * (choices.mesh_y + 1), choices, corner)
        return strength * common * exp(-(path * sigma))

    @inlined
    def loop(frame, depth, rules, uniforms, switches, choices, maps, colours, grid, solids, draws, window):
        camera, spot, slab = uniforms.camera, uniforms.spot, uniforms.slab
        size, planes = window.height * window.pitch, draws.z.size
        for row in range(window.row0, window.row1):
            for column in range(window.column0, window.column1):
                p = row * window.pitch + column
                ray = camera_ray(camera, column, row)
                lit = light_ray(spot, ray)
                corner = corner_of(slab, choices, grid, column, row)
                r, g, b = real(frame[p]), real(frame[p + size]), real(frame[p + 2 * size])
                for k in range(window.d0, window.d1):
                    z = draws.z[k]
                    if not draws.depth[k] < depth[p]:
                        continue
                    l_r, l_g, l_b = illuminate(switches, spot, maps, solids, ray, lit, z, -1)
                    if not (l_r > zero or l_g > zero or l_b > zero):
                        continue
                    common, path = zero, zero
                    if choices.vertex == 0:
                        x, y, w = ray[2] * z + slab.from_x, ray[3] * z + slab.from_y, ray[4] * z + slab.from_z
                        s = max(math.sqrt(x * x + y * y + w * w), least)
                        mu, path = -((ray[2] * x + ray[3] * y + ray[4] * w) / (s * ray[5])), s + z * ray[5]
                        if choices.parallel != 0:
                            mu = -((ray[2] * slab.axis_x + ray[3] * slab.axis_y + ray[4] * slab.axis_z) / ray[5])
                            s, path = one, z * ray[5]
                        dt = slab.dt if choices.dt_mode == 0 else slab.dt * ray[5]
                        common = phase(choices.phase, slab.g, mu * slab.cosine) / (s * s) * dt
                    f_r = source(0, slab.source_r, slab.sigma_r, choices, colours, corner, common, path, k, planes)
                    f_g, f_b = f_r, f_r
                    if choices.grey == 0:
                        f_g = source(1, slab.source_g, slab.sigma_g, choices, colours, corner, common, path, k, planes)
                        f_b = source(2, slab.source_b, slab.sigma_b, choices, colours, corner, common, path, k, planes)
                    r = add(rules[0], r, f_r * l_r)
                    g = add(rules[1], g, f_g * l_g)
                    b = add(rules[2], b, f_b * l_b)
                frame[p], frame[p + size], frame[p + 2 * size] = r, g, b

    return loop


@functools.cache
def compiled_vertex_loop(real: Any) -> Any:
    """Return the loop with every choice at run time."""
    loop = vertex_loop(real)

    @entry
    def planes(frame, depth, rules, uniforms, maps, colours, grid, solids, draws, window):
        loop(
            frame,
            depth,
            rules,
            uniforms,
            uniforms.switches,
            uniforms.slab_switches,
            maps,
            colours,
            grid,
            solids,
            draws,
            window,
        )

    return planes


def specialised_vertex_loop(real: Any, switches: Any, choices: Any) -> Any:
    """Return the loop compiled for one set of choices."""
    loop = vertex_loop(real)

    @entry
    def planes(frame, depth, rules, uniforms, maps, colours, grid, solids, draws, window):
        loop(frame, depth, rules, uniforms, switches, choices, maps, colours, grid, solids, draws, window)

    return planes
