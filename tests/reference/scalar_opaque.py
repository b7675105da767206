"""Depth, opaque surfaces in fog and the shadow map, scalar."""

import functools
import math
from types import SimpleNamespace
from typing import Any

from reference.scalar_light import FAR, lighting
from reference.scalar_math import entry, inlined


@functools.cache
def opaque_loops(real: Any) -> SimpleNamespace:
    """Return `base`, `light` and `shadow_map` in one precision."""
    scene = lighting(real)
    a = scene.arithmetic
    exp, encode, add, phase = a.exp, a.store.encode, a.store.add, a.phase
    camera_ray, light_ray, illuminate, nearest = scene.camera_ray, scene.light_ray, scene.illuminate, scene.nearest
    zero, half, one, least, far = real(0), real(0.5), real(1), real(1e-6), real(FAR)
    per_pi = real(1.0 / math.pi)

    @inlined
    def nearest_surface(solids, surfaces, p, size, dx, dy, dz):
        """Nearest of solids and drawn triangles, whose normals are turned to the viewer."""
        t, found, nx, ny, nz = nearest(solids, (zero, zero, zero), dx, dy, dz)
        if surfaces.on != 0 and surfaces.drawn[p] < t:
            i = int(surfaces.drawn[p + size])
            t, found = surfaces.drawn[p], surfaces.objects[i]
            nx, ny, nz = surfaces.normals[3 * i], surfaces.normals[3 * i + 1], surfaces.normals[3 * i + 2]
            if nx * dx + ny * dy + nz * dz > zero:
                nx, ny, nz = -nx, -ny, -nz
        return t, found, nx, ny, nz

    @entry
    def base(frame, depth, frame_rules, depth_rule, uniforms, solids, surfaces, window):
        camera, surface = uniforms.camera, uniforms.surface
        size = window.height * window.pitch
        for row in range(window.row0, window.row1):
            for column in range(window.column0, window.column1):
                p = row * window.pitch + column
                ray = camera_ray(camera, column, row)
                t, found, _, _, _ = nearest_surface(solids, surfaces, p, size, ray[2], ray[3], ray[4])
                z = one
                if found >= 0:
                    z = min(max(camera.depth_a - camera.depth_b / max(t, least), zero), one)
                depth[p] = encode(depth_rule, z)
                r, g, b = surface.ambient_r, surface.ambient_g, surface.ambient_b
                if uniforms.surface_switches.ambient == 1:
                    path = min(t * ray[5], far)
                    r = r * (one - exp(-(path * surface.sigma_r)))
                    g = g * (one - exp(-(path * surface.sigma_g)))
                    b = b * (one - exp(-(path * surface.sigma_b)))
                frame[p] = encode(frame_rules[0], r)
                frame[p + size] = encode(frame_rules[1], g)
                frame[p + 2 * size] = encode(frame_rules[2], b)

    @entry
    def light(frame, rules, uniforms, maps, solids, surfaces, lit_solids, window):
        camera, spot, surface, choices = uniforms.camera, uniforms.spot, uniforms.surface, uniforms.surface_switches
        size = window.height * window.pitch
        for row in range(window.row0, window.row1):
            for column in range(window.column0, window.column1):
                p = row * window.pitch + column
                ray = camera_ray(camera, column, row)
                z, found, nx, ny, nz = nearest_surface(solids, surfaces, p, size, ray[2], ray[3], ray[4])
                if found < 0:
                    continue
                l_r, l_g, l_b = illuminate(
                    uniforms.switches, spot, maps, lit_solids, ray, light_ray(spot, ray), z, found
                )
                if not (l_r > zero or l_g > zero or l_b > zero):
                    continue
                x, y, w = ray[2] * z + spot.from_x, ray[3] * z + spot.from_y, ray[4] * z + spot.from_z
                s = max(math.sqrt(x * x + y * y + w * w), least)
                way = s
                if uniforms.switches.parallel != 0:
                    x, y, w, s, way = spot.axis_x, spot.axis_y, spot.axis_z, one, zero
                facing = -((nx * x + ny * y + nz * w) / s)
                if not facing > zero:
                    continue
                e, t = facing / (s * s) * per_pi, z * ray[5]
                for c in range(3):
                    sigma = (surface.sigma_r, surface.sigma_g, surface.sigma_b)[c]
                    fog = exp(-(t * sigma))
                    if choices.fog == 1:
                        mu = -((ray[2] * x + ray[3] * y + ray[4] * w) / (s * ray[5]))
                        peak = phase(choices.phase, surface.g, mu) / (s * s)
                        fog = (
                            fog * (surface.source_r, surface.source_g, surface.source_b)[c] * peak * exp(-(way * sigma))
                        )
                    strength = (surface.intensity_r, surface.intensity_g, surface.intensity_b)[c]
                    fog = fog * strength * exp(-(way * sigma)) * real(solids.albedo[3 * found + c])
                    at = p + c * size
                    frame[at] = add(rules[c], real(frame[at]), e * (l_r, l_g, l_b)[c] * fog)

    @entry
    def shadow_map(depth, rule, u, parallel, solids, surfaces, pitch, size, row0, row1):
        for row in range(row0, row1):
            y = (real(row) + half) * u.step - one
            for column in range(size):
                x = (real(column) + half) * u.step - one
                dx, dy, dz = x * u.right_x + y * u.up_x, x * u.right_y + y * u.up_y, x * u.right_z + y * u.up_z
                start = (dx, dy, dz)
                if parallel != 0:
                    dx, dy, dz = u.axis_x, u.axis_y, u.axis_z
                else:
                    start = (zero, zero, zero)
                    dx, dy, dz = dx + u.axis_x, dy + u.axis_y, dz + u.axis_z
                w, found, _, _, _ = nearest(solids, start, dx, dy, dz)
                if surfaces.on != 0 and surfaces.drawn[row * pitch + column] < w:
                    w, found = surfaces.drawn[row * pitch + column], 0
                window = one
                if found >= 0 and parallel != 0:
                    window = min(max(u.depth_a + u.depth_b * max(w, u.near), zero), one)
                elif found >= 0:
                    window = min(max(u.depth_a - u.depth_b / max(w, u.near), zero), one)
                depth[row * pitch + column] = encode(rule, window)

    return SimpleNamespace(base=base, light=light, shadow_map=shadow_map)
