"""The slab loop of the light beams, scalar: for every pixel, for every slab, sub-planes into f_h, then f_h c_k q."""

import functools
import math
from typing import Any

from reference.scalar_light import lighting
from reference.scalar_math import called, entry, inlined


def make_q(real: Any, a: Any) -> Any:
    """q without a table: the angle delta = pi - alpha, split geometrically towards both ends."""
    exp, atan2, tan, phase = a.exp, a.atan2, a.tan, a.phase
    zero, half, one, four, quarter = real(0), real(0.5), real(1), real(4), real(0.25)
    pi, quarter_turn, near_forward, least_v = real(math.pi), real(math.pi / 2), real(0.05), real(1e-9)

    @called
    def q_exact(u, v, dt, sigma, kind, g, sign, nodes, weights):
        v = max(v, least_v)
        end = u + dt
        low = atan2(v, end)
        left = atan2(v * dt, u * end + v * v)
        high = low + left
        total = zero
        while left > zero:
            if low < quarter_turn:
                stop = min(low * four, quarter_turn)
            elif low < pi - near_forward:
                stop = pi - (pi - low) * quarter
            else:
                stop = low + near_forward
            if stop < high:
                step = stop - low
            else:
                step, stop = left, high
            piece = zero
            for n in range(nodes.size):
                t = tan((low + step * nodes[n]) * half)
                square = t * t
                mu = (square - one) / (square + one) * sign
                path = v / t - u
                piece = piece + phase(kind, g, mu) * exp(-(path * sigma)) * weights[n]
            total = total + piece * step
            low = stop
            left = left - step
        return total / v

    return q_exact


def make_sun(real: Any, a: Any) -> Any:
    """The sun's f_l / c_k of one channel: rho p(alpha) (1 - exp(-sigma_t dt)) / sigma_t."""
    exp, phase = a.exp, a.phase
    one, small = real(1), real(0.0625)
    per = tuple(real(1.0 / n) for n in range(1, 9))

    @inlined
    def lost(x):
        """(1 - exp(-x)) / x; by its series where that would cancel."""
        if not x < small:
            return (one - exp(-x)) / x
        part = one - x * per[7]
        part = one - x * per[6] * part
        part = one - x * per[5] * part
        part = one - x * per[4] * part
        part = one - x * per[3] * part
        part = one - x * per[2] * part
        return one - x * per[1] * part

    @inlined
    def sun(slab, choices, ray, sigma, source):
        mu = -((ray[2] * slab.axis_x + ray[3] * slab.axis_y + ray[4] * slab.axis_z) / ray[5])
        dt = slab.dt if choices.dt_mode == 0 else slab.dt * ray[5]
        return phase(choices.phase, slab.g, mu * slab.cosine) * dt * source * lost(dt * sigma)

    return sun


def make_mesh(real: Any, fma: Any) -> Any:
    """Attributes of the triangle a pixel lies in: barycentric, or as planes over the screen."""
    zero, half, one, edge = real(0), real(0.5), real(1), real(1.0 - 1e-5)

    @inlined
    def corner(slab, choices, grid, column, row):
        x = (real(column) + half) * slab.cells_x + slab.cell_x
        y = (real(row) + half) * slab.cells_y + slab.cell_y
        i, j = min(int(x), choices.mesh_x - 1), min(int(y), choices.mesh_y - 1)
        x, y = x - real(i), y - real(j)
        first = j * (choices.mesh_x + 1) + i
        right, above = first + 1, first + choices.mesh_x + 1
        if choices.screen == 0:
            if x + y <= one:
                return first, right, above, x, y, zero, zero, zero, zero, zero, zero, zero, zero
            return above + 1, above, right, one - x, one - y, zero, zero, zero, zero, zero, zero, zero, zero
        x0, x1, y0, y1 = real(grid.x[i]), real(grid.x[i + 1]), real(grid.y[j]), real(grid.y[j + 1])
        if x + y < edge:  # right, first, above
            a, b, c = right, first, above
            ax, ay, bx, by, cx, cy = x1, y0, x0, y0, x0, y1
        else:  # above, opposite, right
            a, b, c = above, above + 1, right
            ax, ay, bx, by, cx, cy = x0, y1, x1, y1, x1, y0
        ex, ey, fx, fy = ax - bx, ay - by, cx - ax, cy - ay
        r = one / (ex * fy - fx * ey)
        return (
            a, b, c, zero, zero, ex * r, ey * r, fx * r, fy * r, ax - half, ay - half, real(column), real(row),
        )  # fmt: skip

    @inlined
    def attribute(values, base, choices, corner):
        a, b, c = values[base + corner[0]], values[base + corner[1]], values[base + corner[2]]
        if choices.screen == 0:
            return a + corner[3] * (b - a) + corner[4] * (c - a)
        e, f = a - b, c - a
        dx = e * corner[8] - f * corner[6]
        dy = f * corner[5] - e * corner[7]
        start = a - (dx * corner[9] + dy * corner[10])
        return real(fma(dy, corner[12], real(fma(dx, corner[11], start))))

    return corner, attribute


@functools.cache
def slab_loop(real: Any) -> Any:
    """Return the loop in one precision; draws [0, last) of rows and columns of the window."""
    light = lighting(real)
    a = light.arithmetic
    exp, add, value, bilinear = a.exp, a.store.add, a.store.value, a.texture.bilinear
    camera_ray, light_ray, illuminate = light.camera_ray, light.light_ray, light.illuminate
    zero, one = real(0), real(1)
    q_exact, sun = make_q(real, a), make_sun(real, a)
    corner_of, attribute = make_mesh(real, a.texture.fma)

    @inlined
    def table(q, channel, slab, choices, u, v):
        x = min(max(u * slab.scale_u + slab.offset_u, zero), one)
        y = min(max(v * slab.scale_v + slab.offset_v, zero), one)
        found = bilinear(q.main, channel, x, y) * slab.range
        if choices.rest != 0:
            found = found + bilinear(q.rest, channel, x, y) * slab.rest
        return found

    @inlined
    def slow(c, sigma, source, slab, choices, q, mesh, nodes, weights, ray, corner, u, v, t, k, planes):
        """f_l = c_k q(u, v) of one channel, of the sun in closed form."""
        span = ray[5]
        if choices.vertex != 0:
            factor = attribute(mesh.c, (c * planes + k) * (choices.mesh_x + 1) * (choices.mesh_y + 1), choices, corner)
        else:
            factor = exp(-(t * sigma))
            if choices.parallel != 0:
                factor = factor * sun(slab, choices, ray, sigma, source)
            elif choices.dt_mode == 1:
                factor = factor * span
        if choices.parallel != 0:
            return factor
        if choices.exact_q == 0:
            return factor * table(q, c, slab, choices, u, v)
        dt = slab.dt * span if choices.dt_mode == 2 else slab.dt
        return factor * (source * q_exact(u, v, dt, sigma, choices.phase, slab.g, slab.cosine, nodes, weights))

    @inlined
    def loop(
        frame, fast, depth, rules, uniforms, switches, choices, maps, q, mesh, nodes, weights, solids, draws, window
    ):
        camera, spot, slab = uniforms.camera, uniforms.spot, uniforms.slab
        frame_rules, fast_rules = rules
        size, planes = window.height * window.pitch, draws.main_z.size
        vertices = (choices.mesh_x + 1) * (choices.mesh_y + 1)
        for row in range(window.row0, window.row1):
            for column in range(window.column0, window.column1):
                p = row * window.pitch + column
                ray = camera_ray(camera, column, row)
                lit = light_ray(spot, ray)
                span, surface = ray[5], depth[p]
                cx = ray[0] * slab.cross_ax + ray[1] * slab.cross_bx + slab.cross_cx
                cy = ray[0] * slab.cross_ay + ray[1] * slab.cross_by + slab.cross_cy
                cz = ray[0] * slab.cross_az + ray[1] * slab.cross_bz + slab.cross_cz
                v = math.sqrt(cx * cx + cy * cy + cz * cz) / span
                along = (ray[2] * slab.from_x + ray[3] * slab.from_y + ray[4] * slab.from_z) / span
                corner = corner_of(slab, choices, mesh.grid, column, row)
                r, g, b = real(frame[p]), real(frame[p + size]), real(frame[p + 2 * size])
                for k in range(planes):
                    if draws.first[k] + k >= window.d1:
                        break
                    h_r, h_g, h_b = zero, zero, zero
                    for s in range(draws.first[k], min(draws.first[k + 1], window.d1 - k)):
                        if not draws.depth[s] < surface:
                            continue
                        l_r, l_g, l_b = illuminate(switches, spot, maps, solids, ray, lit, draws.z[s], -1)
                        if l_r > zero or l_g > zero or l_b > zero:
                            h_r = add(fast_rules[0], h_r, l_r * draws.share[s])
                            if switches.grey_light == 0:
                                h_g = add(fast_rules[1], h_g, l_g * draws.share[s])
                                h_b = add(fast_rules[2], h_b, l_b * draws.share[s])
                    if switches.grey_light != 0:
                        h_g, h_b = h_r, h_r
                    main = draws.first[k + 1] + k
                    if main + 1 >= window.d1:
                        fast[p], fast[p + size], fast[p + 2 * size] = h_r, h_g, h_b
                    dark = h_r == zero and h_g == zero and h_b == zero
                    if main >= window.d1 or dark or not draws.main_depth[k] < surface:
                        continue
                    z = draws.main_z[k]
                    t = span * z
                    u_k, v_k = along + t, v
                    if choices.vertex != 0 and choices.parallel == 0:
                        u_k = attribute(mesh.u, k * vertices, choices, corner)
                        v_k = attribute(mesh.v, 0, choices, corner)
                    f_r = slow(
                        0, slab.sigma_r, slab.source_r, slab, choices, q, mesh, nodes, weights, ray, corner, u_k, v_k,
                        t, k, planes,
                    )  # fmt: skip
                    f_g, f_b = f_r, f_r
                    if choices.grey == 0:
                        f_g = slow(
                            1, slab.sigma_g, slab.source_g, slab, choices, q, mesh, nodes, weights, ray, corner, u_k,
                            v_k, t, k, planes,
                        )  # fmt: skip
                        f_b = slow(
                            2, slab.sigma_b, slab.source_b, slab, choices, q, mesh, nodes, weights, ray, corner, u_k,
                            v_k, t, k, planes,
                        )  # fmt: skip
                    r = add(frame_rules[0], r, f_r * value(fast_rules[0], h_r))
                    g = add(frame_rules[1], g, f_g * value(fast_rules[1], h_g))
                    b = add(frame_rules[2], b, f_b * value(fast_rules[2], h_b))
                frame[p], frame[p + size], frame[p + 2 * size] = r, g, b

    return loop


@functools.cache
def compiled_slab_loop(real: Any) -> Any:
    """Return the loop with every choice at run time: one binary per kind of buffer."""
    loop = slab_loop(real)

    @entry
    def slabs(frame, fast, depth, rules, uniforms, maps, q, mesh, nodes, weights, solids, draws, window):
        loop(
            frame, fast, depth, rules, uniforms, uniforms.switches, uniforms.slab_switches, maps, q, mesh, nodes,
            weights,
            solids, draws, window,
        )  # fmt: skip

    return slabs


def specialised_slab_loop(real: Any, switches: Any, choices: Any) -> Any:
    """Return the loop compiled for one set of choices, as a careful author of code for one scene would have it."""
    loop = slab_loop(real)

    @entry
    def slabs(frame, fast, depth, rules, uniforms, maps, q, mesh, nodes, weights, solids, draws, window):
        loop(
            frame, fast, depth, rules, uniforms, switches, choices, maps, q, mesh, nodes, weights, solids, draws, window
        )

    return slabs
