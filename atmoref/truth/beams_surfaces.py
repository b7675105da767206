# mypy: allow-untyped-defs, allow-untyped-calls
# (kernels: Numba infers their types)
"""The first surface along each ray and the light that it sends to the eye.

I_b = albedo/pi · sum over lights E max(0, cos):
    E = I_0 I_l H exp(-sigma_t s) / s² for point lights, E_0 I_l H for suns.

Source: Dobashi, Yamamoto and Nishita 2002, eqs. (1)-(3) with errata D-E1, D-E2, D-E3, D-E13.
"""

from __future__ import annotations

import math

from atmoref._jit import kernel, subroutine
from atmoref.truth.beams_geometry import (
    MESH,
    NOTHING,
    add,
    dot,
    nearest_hit,
    normal_and_albedo,
    row,
    scaled,
    sees,
    subtract,
)
from atmoref.truth.beams_integral import light_distribution
from atmoref.truth.beams_light_maps import projector_at, sun_at
from atmoref.truth.beams_mesh import OWN_SURFACE, is_blocked
from atmoref.truth.beams_projector import projector_share
from atmoref.truth.beams_question import NO_FALLOFF, light_at
from atmoref.truth.beams_sun import sun_share
from atmoref.truth.beams_sun_pieces import sun_reaches

_ROUND = 2e-15  # of a point on a mesh, relative to the numbers it comes from

__all__ = ["pictured_surfaces_kernel", "surfaces_kernel"]


@subroutine
def _reach(light, p):
    """Return I_l in the direction of a point."""
    if light.outer >= math.pi:
        return light.peak
    w = subtract(p, light.position)
    cosine = dot(w, light.axis) / math.sqrt(dot(w, w))
    inner = math.cos(light.inner)
    outer = math.cos(light.outer)
    if not cosine > outer:
        return 0.0
    if light.falloff == NO_FALLOFF or cosine >= inner:
        return light.peak
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return light.peak * light_distribution(light.falloff, cosine, sine, inner, outer, light.inner, light.outer)


@subroutine
def _is_open(q, hit, distance, towards, reach):
    """Tell whether meshes leave the way from the surface point open, up to ``reach`` metres along unit ``towards``."""
    p, kind, index = hit
    offset = OWN_SURFACE * (distance + max(abs(p[0]), abs(p[1]), abs(p[2]))) if kind == MESH else 0.0
    return not is_blocked(q.mesh, p, towards, offset, reach, index if kind == MESH else -1)


@subroutine
def _sees_point(q, hit, distance, position, w, s):
    """Tell whether a light at ``position`` = p + w, s metres away, shines on the surface point."""
    p, kind, index = hit
    if not sees(q.objects, position, p, kind, index):
        return False
    return _is_open(q, hit, distance, scaled(w, 1.0 / s), s)


@subroutine
def _add_spots(surface, q, hit, distance, normal, albedo):
    """Add the light of spots."""
    p = hit[0]
    for which in range(q.lights.shape[0]):
        light = light_at(q.lights, which)
        w = subtract(light.position, p)
        ss = dot(w, w)
        s = math.sqrt(ss)
        cosine = dot(w, normal) / s
        if not cosine > 0.0:
            continue
        share = _reach(light, p)
        if share == 0.0 or not _sees_point(q, hit, distance, light.position, w, s):
            continue
        for c in range(3):
            dim = math.exp(-q.medium.extinction[c] * (s + distance))
            surface[c] += albedo[c] / math.pi * light.intensity[c] * share * cosine * dim / ss


@subroutine
def _add_projectors(surface, q, hit, distance, normal, albedo):
    """Add the light of projectors."""
    p = hit[0]
    for which in range(q.projectors.shape[0]):
        projector = projector_at(q.projectors, which)
        w = subtract(projector.position, p)
        ss = dot(w, w)
        s = math.sqrt(ss)
        cosine = dot(w, normal) / s
        if not cosine > 0.0 or not _sees_point(q, hit, distance, projector.position, w, s):
            continue
        for c in range(3):
            share = projector_share(q.texels, projector, scaled(w, -1.0), c)
            dim = math.exp(-q.medium.extinction[c] * (s + distance))
            surface[c] += albedo[c] / math.pi * projector.intensity[c] * share * cosine * dim / ss


@subroutine
def _add_suns(surface, q, hit, distance, normal, albedo):
    """Add the light of suns."""
    p, kind, index = hit
    for which in range(q.suns.shape[0]):
        light = sun_at(q.suns, which)
        back = scaled(light.axis, -1.0)
        cosine = dot(back, normal)
        reach = dot(light.depth, subtract(p, light.center)) if light.windowed else math.inf
        if not cosine > 0.0 or not reach >= 0.0 or not sun_reaches(q.objects, light, p, reach, kind, index):
            continue
        if not _is_open(q, hit, distance, back, reach):
            continue
        for c in range(3):
            share = sun_share(q.texels, light, p, c)
            dim = math.exp(-q.medium.extinction[c] * distance)
            surface[c] += albedo[c] / math.pi * light.irradiance[c] * share * cosine * dim


@kernel
def surfaces_kernel(surface, ends, slacks, hits, q, starts, directions):
    """Shorten the rays to their first surface, and set the light (n, 3) of spots that it sends to the eye.

    ``hits`` (n, 2) is set to kind and index of the surface, ``slacks`` (n,) to the rounding error (m) of the distance
    to a mesh, 0 for other surfaces.
    """
    for i in range(starts.shape[0]):
        for c in range(3):
            surface[i, c] = 0.0
        start = row(starts, i)
        d = row(directions, i)
        distance, kind, index = nearest_hit(q.objects, q.mesh, start, d)
        if ends[i] < distance:
            kind = NOTHING
        hits[i, 0], hits[i, 1] = kind, index
        if kind == NOTHING:
            continue
        ends[i] = distance
        p = add(start, scaled(d, distance))
        normal, albedo = normal_and_albedo(q.objects, q.mesh, p, kind, index, d)
        if kind == MESH:
            size = distance + abs(p[0]) + abs(p[1]) + abs(p[2])
            slacks[i] = _ROUND * size / max(abs(dot(normal, d)), 1e-9)
        _add_spots(surface[i], q, (p, kind, index), distance, normal, albedo)


@kernel
def pictured_surfaces_kernel(surface, ends, hits, q, starts, directions):
    """Add the light (n, 3) of projectors and suns that surfaces send to the eye, after :func:`surfaces_kernel`."""
    for i in range(starts.shape[0]):
        if hits[i, 0] == NOTHING:
            continue
        d = row(directions, i)
        p = add(row(starts, i), scaled(d, ends[i]))
        normal, albedo = normal_and_albedo(q.objects, q.mesh, p, hits[i, 0], hits[i, 1], d)
        hit = (p, hits[i, 0], hits[i, 1])
        _add_projectors(surface[i], q, hit, ends[i], normal, albedo)
        _add_suns(surface[i], q, hit, ends[i], normal, albedo)
