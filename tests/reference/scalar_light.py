"""Rays, spotlights and solids of the references: which light a point receives."""

import functools
import math
from types import SimpleNamespace
from typing import Any

from reference.scalar_math import arithmetic, called, inlined

FAR = 1e30
BEYOND = 1e9


def make_solids(real: Any) -> SimpleNamespace:
    """Intersections with spheres, boxes and horizontal planes; parameters in units of the direction's length."""
    zero, one, far, tiny, more = real(0), real(1), real(FAR), real(1e-20), real(1.0 + 1e-3)

    @inlined
    def sphere(s, start, dx, dy, dz):
        x, y, z, radius = real(s[0]) - start[0], real(s[1]) - start[1], real(s[2]) - start[2], real(s[3])
        cx, cy, cz = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
        dd = dx * dx + dy * dy + dz * dz
        rest = dd * radius * radius - (cx * cx + cy * cy + cz * cz)
        if rest <= zero:
            return far
        along, root = x * dx + y * dy + z * dz, math.sqrt(rest)
        enter = (along - root) / dd
        return enter if enter > zero else (along + root) / dd

    @inlined
    def faces(low, high, start, d):
        if d < tiny and d > -tiny:
            d = tiny
        a, b = (real(low) - start) / d, (real(high) - start) / d
        return (a, b) if a < b else (b, a)

    @inlined
    def box(b, start, dx, dy, dz):
        """Nearest parameter ahead, and the axis that was entered."""
        x0, x1 = faces(b[0], b[3], start[0], dx)
        y0, y1 = faces(b[1], b[4], start[1], dy)
        z0, z1 = faces(b[2], b[5], start[2], dz)
        enter, leave = max(x0, y0, z0), min(x1, y1, z1)
        if not enter < leave:
            return far, 0
        axis = 0 if x0 >= max(y0, z0) else (1 if y0 >= z0 else 2)
        return (enter if enter > zero else leave), axis

    @inlined
    def ground(height, start, dy):
        return far if dy < tiny and dy > -tiny else (real(height) - start[1]) / dy

    @inlined
    def meets(b, ix, iy, iz):
        """Does the segment from parameter 0 to 1 meet a box?"""
        ax, bx, ay, by = real(b[0]) * ix, real(b[3]) * ix, real(b[1]) * iy, real(b[4]) * iy
        az, bz = real(b[2]) * iz, real(b[5]) * iz
        enter, leave = max(min(ax, bx), min(ay, by), min(az, bz)), min(max(ax, bx), max(ay, by), max(az, bz))
        return enter <= leave and leave > zero and enter < one

    @inlined
    def inverse(d):
        return one / tiny if d < tiny and d > -tiny else one / d

    @inlined
    def linear(record, k, dx, dy, dz):
        return real(record[k]) * dx + real(record[k + 1]) * dy + real(record[k + 2]) * dz

    @inlined
    def shaded(solids, dx, dy, dz, own):
        """Does a triangle cut the segment?  Looks into the box of every leaf."""
        reach, ix, iy, iz = max(abs(dx), abs(dy), abs(dz)), inverse(dx), inverse(dy), inverse(dz)
        for node in range(solids.nodes.shape[0]):
            if solids.links[node, 2] == 0 or not meets(solids.nodes[node], ix, iy, iz):
                continue
            for i in range(solids.links[node, 1], solids.links[node, 1] + solids.links[node, 2]):
                r = solids.triangles[i]
                slack = reach * real(r[12])
                least = more if solids.triangle_ids[i] == own else one
                if linear(r, 0, dx, dy, dz) + slack < zero or linear(r, 3, dx, dy, dz) + slack < zero:
                    continue
                if linear(r, 6, dx, dy, dz) + slack >= zero and linear(r, 9, dx, dy, dz) > least:
                    return True
        return False

    @called
    def occluded(solids, start, dx, dy, dz, own):
        """Does an object other than `own` cut the segment from start to start + d?"""
        for i in range(solids.spheres.shape[0]):
            if solids.sphere_ids[i] != own:
                t = sphere(solids.spheres[i], start, dx, dy, dz)
                if t > zero and t < one:
                    return True
        for i in range(solids.boxes.shape[0]):
            if solids.box_ids[i] != own:
                t, _ = box(solids.boxes[i], start, dx, dy, dz)
                if t > zero and t < one:
                    return True
        for i in range(solids.grounds.shape[0]):
            if solids.ground_ids[i] != own:
                t = ground(solids.grounds[i], start, dy)
                if t > zero and t < one:
                    return True
        return shaded(solids, dx, dy, dz, own)

    @called
    def nearest(solids, start, dx, dy, dz):
        """Nearest object ahead of the start: parameter (FAR: none), id (-1: none), outward normal."""
        best, found, nx, ny, nz = far, -1, zero, zero, zero
        for i in range(solids.spheres.shape[0]):
            s = solids.spheres[i]
            t = sphere(s, start, dx, dy, dz)
            if t > zero and t < best:
                per_radius = real(1.0 / s[3])
                best, found = t, solids.sphere_ids[i]
                nx = (dx * t - (real(s[0]) - start[0])) * per_radius
                ny = (dy * t - (real(s[1]) - start[1])) * per_radius
                nz = (dz * t - (real(s[2]) - start[2])) * per_radius
        for i in range(solids.boxes.shape[0]):
            t, axis = box(solids.boxes[i], start, dx, dy, dz)
            if t > zero and t < best:
                best, found, nx, ny, nz = t, solids.box_ids[i], zero, zero, zero
                if axis == 0:
                    nx = -one if dx > zero else one
                elif axis == 1:
                    ny = -one if dy > zero else one
                else:
                    nz = -one if dz > zero else one
        for i in range(solids.grounds.shape[0]):
            t = ground(solids.grounds[i], start, dy)
            if t > zero and t < best:
                best, found, nx, nz = t, solids.ground_ids[i], zero, zero
                ny = -one if dy > zero else one
        return best, found, nx, ny, nz

    return SimpleNamespace(occluded=occluded, nearest=nearest)


@functools.cache
def lighting(real: Any) -> SimpleNamespace:
    """Return rays, solids and `illuminate` in one precision."""
    a = arithmetic(real)
    zero, half, one, two, three = real(0), real(0.5), real(1), real(2), real(3)
    slightly_more, beyond = real(1.0 + 1e-5), real(-BEYOND)
    bilinear, shadow, atan2 = a.texture.bilinear, a.texture.shadow, a.atan2
    solids_of = make_solids(real)
    occluded = solids_of.occluded

    @inlined
    def camera_ray(camera, column, row):
        ex = ((real(column) + half) * camera.step_x + camera.start_x) * camera.tan_x
        ey = ((real(row) + half) * camera.step_y + camera.start_y) * camera.tan_y
        dx = ex * camera.right_x + ey * camera.up_x + camera.forward_x
        dy = ex * camera.right_y + ey * camera.up_y + camera.forward_y
        dz = ex * camera.right_z + ey * camera.up_z + camera.forward_z
        return ex, ey, dx, dy, dz, math.sqrt(ex * ex + ey * ey + one)

    @inlined
    def light_ray(spot, ray):
        ex, ey = ray[0], ray[1]
        return (
            ex * spot.u_x + ey * spot.u_y + spot.u_z,
            ex * spot.v_x + ey * spot.v_y + spot.v_z,
            ex * spot.w_x + ey * spot.w_y + spot.w_z,
        )

    @inlined
    def falloff(kind, spot, u, v, w, distance):
        if kind == 1:
            x, y = (u * two - one) * spot.tan_outer, (v * two - one) * spot.tan_outer
            radius = math.sqrt(x * x + y * y)
            angle = atan2(radius, one) if radius > zero else zero
            return spot.peak * min(max((spot.outer - angle) * spot.inverse_span, zero), one)
        part = min(max((w / distance - spot.cos_outer) * spot.inverse_cos_span, zero), one)
        return spot.peak * (part * part * (three - part * two))

    @inlined
    def sun_reaches(switches, spot, maps, solids, ray, z, own, u, v, w):
        """H of parallel light, from the window, or from far away without one."""
        unbounded = switches.unbounded != 0
        if switches.exact_visibility != 0:
            start = (ray[2] * z + spot.from_x, ray[3] * z + spot.from_y, ray[4] * z + spot.from_z)
            back = beyond if unbounded else -w
            return (
                zero
                if occluded(solids, start, back * spot.axis_x, back * spot.axis_y, back * spot.axis_z, own)
                else one
            )
        if unbounded:
            for i in range(solids.grounds.shape[0]):
                above = (ray[3] * z + spot.from_y) - real(solids.grounds[i])
                if own != solids.ground_ids[i] and above * spot.axis_y > zero:
                    return zero
            if u < zero or u > one or v < zero or v > one:
                return one
        return shadow(maps.shadow, u, v, w * spot.depth_b + spot.depth_a)

    @inlined
    def sunshine(switches, spot, maps, solids, ray, light, z, own):
        """I_l H of the sun: nothing is divided, and without a window every place is lit."""
        u, v, w = light[0] * z + spot.u_0, light[1] * z + spot.v_0, light[2] * z + spot.w_0
        if switches.unbounded == 0 and (w < spot.least_w or u < zero or u > one or v < zero or v > one):
            return zero, zero, zero
        visible = sun_reaches(switches, spot, maps, solids, ray, z, own, u, v, w)
        if not visible > zero:
            return zero, zero, zero
        u, v = min(max(u, zero), one), min(max(v, zero), one)
        r = bilinear(maps.light, 0, u, v) * visible
        if switches.grey_light != 0:
            return r, r, r
        return r, bilinear(maps.light, 1, u, v) * visible, bilinear(maps.light, 2, u, v) * visible

    @inlined
    def point_light(switches, spot, maps, solids, ray, light, z, own):
        """I_l H at eye + z d, three channels; all zero where no light arrives."""
        w = light[2] * z + spot.w_0
        if w < spot.least_w:
            return zero, zero, zero
        across, upward = light[0] * z + spot.u_0, light[1] * z + spot.v_0
        if across < zero or upward < zero or across > w * slightly_more or upward > w * slightly_more:
            return zero, zero, zero  # no division for what is clearly outside
        iw = one / w
        u, v = across * iw, upward * iw
        if u > one or v > one:
            return zero, zero, zero
        if switches.exact_visibility != 0 or switches.exact_distribution != 0:
            dx, dy, dz = ray[2] * z + spot.from_x, ray[3] * z + spot.from_y, ray[4] * z + spot.from_z
        if switches.exact_visibility != 0:
            if occluded(solids, (zero, zero, zero), dx, dy, dz, own):
                return zero, zero, zero
            visible = one
        else:
            visible = shadow(maps.shadow, u, v, spot.depth_a - (spot.depth_b + spot.bias * iw) * iw)
            if not visible > zero:
                return zero, zero, zero
        if switches.exact_distribution != 0:
            r = falloff(switches.falloff, spot, u, v, w, math.sqrt(dx * dx + dy * dy + dz * dz)) * visible
            return r, r, r
        r = bilinear(maps.light, 0, u, v) * visible
        if switches.grey_light != 0:
            return r, r, r
        return r, bilinear(maps.light, 1, u, v) * visible, bilinear(maps.light, 2, u, v) * visible

    @inlined
    def illuminate(switches, spot, maps, solids, ray, light, z, own):
        """I_l H at eye + z d, three channels; all zero where no light arrives."""
        if switches.parallel != 0:
            return sunshine(switches, spot, maps, solids, ray, light, z, own)
        return point_light(switches, spot, maps, solids, ray, light, z, own)

    return SimpleNamespace(
        arithmetic=a, nearest=solids_of.nearest, camera_ray=camera_ray, light_ray=light_ray, illuminate=illuminate
    )
