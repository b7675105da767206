# mypy: allow-untyped-defs, allow-untyped-calls
# (kernels: Numba infers their types)
"""Light of projectors scattered along view rays, by quadrature in the angle between lines of texel centres.

A ray crosses up to W + H lines of texel centres. Between two of them the integrand is analytic and hardly bends, so two
Gauss points inside five of Kronrod are tried first, and the rule of all other panels where these are not good enough.
Black cells are left out, constant ones joined. The three channels are integrated together.

Source: Dobashi, Yamamoto and Nishita 2002, eqs. (2), (3); Kronrod's extension of the two-point rule in closed form.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import kernel, subroutine
from atmoref.optics.phase_functions import phase
from atmoref.truth.beams_geometry import add, dot, row, scaled
from atmoref.truth.beams_light_maps import (
    Picture,
    cell_coefficients,
    clip_linear,
    picture_value,
    projector_at,
    walk_cells,
)
from atmoref.truth.beams_panels import MAX_PANELS_PER_PIECE, first_panels, integrator, least_extinctions
from atmoref.truth.beams_pieces import find_pieces, line_from_light
from atmoref.truth.beams_question import NO_FALLOFF, Light
from atmoref.truth.beams_shadows import shade_by_point
from atmoref.truth.quadrature_rules import Rule

__all__ = ["GAUSS_KRONROD_5", "projector_share", "projectors_kernel"]

GAUSS_KRONROD_5 = Rule(
    np.array([-math.sqrt(6.0 / 7.0), -math.sqrt(1.0 / 3.0), 0.0, math.sqrt(1.0 / 3.0), math.sqrt(6.0 / 7.0)]),
    np.array([98.0 / 495.0, 27.0 / 55.0, 28.0 / 45.0, 27.0 / 55.0, 98.0 / 495.0]),
    np.array([0.0, 1.0, 0.0, 1.0, 0.0]),
)
"""Two Gauss points inside five of Kronrod: exact up to degree 3 and 7."""

_ULP = 2.220446049250313e-16
_ULPS = 2.0


class _Ray(NamedTuple):
    """What the integrand needs, once per ray and projector; pairs are components along e and d of the line."""

    v: float
    foot: float
    x: tuple[float, float]  # X w = x · direction, in texels
    y: tuple[float, float]
    w: tuple[float, float]
    steep_x: float  # texels per radian, at most, times w
    steep_y: float
    texels: NDArray[Any]
    picture: Picture
    kind: int
    g: float
    phase_noise: float


@subroutine
def _components(line, vector):
    return dot(line.e, vector), dot(line.d, vector)


@subroutine
def _ray_constants(medium, light, line, texels):
    width, height = float(light.picture.width), float(light.picture.height)
    x = add(scaled(light.across, width), scaled(light.axis, 0.5 * (width + 1.0)))
    y = add(scaled(light.down, height), scaled(light.axis, 0.5 * (height + 1.0)))
    return _Ray(
        line.v,
        line.foot,
        _components(line, x),
        _components(line, y),
        _components(line, light.axis),
        width * (math.sqrt(dot(light.across, light.across)) + 0.5),
        height * (math.sqrt(dot(light.down, light.down)) + 0.5),
        texels,
        light.picture,
        medium.phase_kind,
        medium.phase_g,
        _ULPS * _ULP * (1.0 + abs(medium.phase_g) / (1.0 - abs(medium.phase_g)) ** 2),
    )


@subroutine
def _node(r, x, sign):
    """Return X, Y, w in the direction of a panel's node, phase function, path, and rounding in texels along X and Y."""
    if r.v > 0.0:
        sx = math.sin(x)
        cx = math.cos(x)
        path = r.v * (1.0 + cx) / sx if sign > 0.0 else r.v * sx / (1.0 + cx)
        lost = _ULPS * _ULP * (1.0 + abs(r.foot) * sx / r.v)
    else:
        sx = 0.0
        cx = 1.0
        path = 2.0 / x if sign > 0.0 else 0.0
        lost = _ULPS * _ULP
    d = sign * cx
    w = r.w[0] * sx + r.w[1] * d
    at_x = (r.x[0] * sx + r.x[1] * d) / w
    at_y = (r.y[0] * sx + r.y[1] * d) / w
    return at_x, at_y, phase(r.kind, r.g, -d), path + r.foot, lost * r.steep_x / w, lost * r.steep_y / w


@subroutine
def _bilinear(q, fx, fy, lost_x, lost_y):
    """Return I_l in a cell and its rounding error."""
    _, _, a, kx, ky, kxy = q
    rounding = (abs(kx) + abs(kxy)) * lost_x + (abs(ky) + abs(kxy)) * lost_y
    return max(a + kx * fx + ky * fy + kxy * fx * fy, 0.0), rounding


@subroutine
def _panel(medium, r, rule, a, b, sign, cell, value, error, noise):
    """Integrate one panel inside a cell; value, error and noise are per channel."""
    k0 = k1 = k2 = 0.0
    c0 = c1 = c2 = 0.0
    n0 = n1 = n2 = 0.0
    q0 = cell_coefficients(r.texels, r.picture, cell, 0)
    q1 = cell_coefficients(r.texels, r.picture, cell, 1)
    q2 = cell_coefficients(r.texels, r.picture, cell, 2)
    i, j = q0[0], q0[1]
    middle = 0.5 * (a + b)
    half = 0.5 * (b - a)
    tau1 = tau2 = 0.0
    dim1 = dim2 = 1.0
    for k in range(rule.nodes.shape[0]):
        at_x, at_y, f, path, lost_x, lost_y = _node(r, middle + half * rule.nodes[k], sign)
        fine = rule.fine[k] * f
        coarse = rule.coarse[k] * f
        tau0 = tau1 = tau2 = medium.extinction[0] * path
        dim0 = dim1 = dim2 = math.exp(-tau0)
        if medium.groups > 1:
            tau1, tau2 = medium.extinction[1] * path, medium.extinction[2] * path
            dim1, dim2 = math.exp(-tau1), math.exp(-tau2)
        share, lost = _bilinear(q0, at_x - i, at_y - j, lost_x, lost_y)
        k0 += fine * dim0 * share
        c0 += coarse * dim0 * share
        n0 += fine * dim0 * (lost + share * (r.phase_noise + _ULPS * _ULP * tau0))
        share, lost = _bilinear(q1, at_x - i, at_y - j, lost_x, lost_y)
        k1 += fine * dim1 * share
        c1 += coarse * dim1 * share
        n1 += fine * dim1 * (lost + share * (r.phase_noise + _ULPS * _ULP * tau1))
        share, lost = _bilinear(q2, at_x - i, at_y - j, lost_x, lost_y)
        k2 += fine * dim2 * share
        c2 += coarse * dim2 * share
        n2 += fine * dim2 * (lost + share * (r.phase_noise + _ULPS * _ULP * tau2))
    value[0], value[1], value[2] = half * k0, half * k1, half * k2
    error[0], error[1], error[2] = half * abs(k0 - c0), half * abs(k1 - c1), half * abs(k2 - c2)
    noise[0], noise[1], noise[2] = half * n0, half * n1, half * n2


_integrate_panels = integrator(_panel, 1.0)


@subroutine
def _picture_span(light, line, low, high):
    """Return the interval of u inside the pyramid of the picture, which is convex; empty (low >= high) for none."""
    half = scaled(light.axis, 0.5)
    for side in range(4):
        edge = light.across if side < 2 else light.down
        inward = add(half, scaled(edge, 1.0 if side % 2 == 0 else -1.0))
        low, high = clip_linear(line.v * dot(line.e, inward), dot(line.d, inward), low, high)
    return low, high


@subroutine
def projector_share(texels, light, w, c):
    """Return I_l (without peak) in channel ``c`` in the direction ``w`` from the light."""
    along = dot(light.axis, w)
    if not along > 0.0:
        return 0.0
    return picture_value(
        texels, light.picture, 0.5 + dot(light.across, w) / along, 0.5 + dot(light.down, w) / along, c
    )  # fmt: skip


@subroutine
def _lit_pieces(q, light, line, low, high, end_slack, work):
    """Return how many pieces of a ray a projector lights, up to texels; -1 if they do not fit."""
    end = high
    low, high = _picture_span(light, line, low, high)
    if not low < high:
        return 0
    bare = Light(light.position, light.axis, 0.0, math.pi, NO_FALLOFF, 1.0, light.intensity)
    pieces = find_pieces(q.objects, bare, line, low, high, work.cuts, work.ends, work.classes)
    return shade_by_point(q.mesh, line, pieces, work, end, end_slack)


@subroutine
def _panels_of(medium, texels, light, line, pieces, settings, work):
    """Fill the first panels of the lit pieces.

    Return their number, the number of cells, and a state: 0, -1 if they do not fit, 1 if the light itself is on the
    ray in a lit piece.
    """
    least, thin = least_extinctions(medium)
    r = _ray_constants(medium, light, line, texels)
    x, y, w = (line.v * r.x[0], r.x[1]), (line.v * r.y[0], r.y[1]), (line.v * r.w[0], r.w[1])
    cells = 0
    for i in range(pieces):
        cells = walk_cells(
            texels, light.picture, x, y, w, work.ends[i, 0], work.ends[i, 1], work.cell_ends, work.cells, cells
        )  # fmt: skip
        if cells < 0:
            return 0, 0, -1
    n = 0
    for i in range(cells):
        if n + MAX_PANELS_PER_PIECE * settings.first_split > work.kind.shape[0]:
            return 0, 0, -1
        n = first_panels(
            line.v, least, thin, work.cell_ends[i, 0], work.cell_ends[i, 1], work.cells[i], settings, work, n
        )  # fmt: skip
        if n < 0:
            return 0, cells, 1
    return n, cells, 0


@subroutine
def _add_slack(mesh, medium, texels, light, line, pieces, work, error):
    """Add to ``error`` (3,), per channel, what rounding of the ends of meshes' shadows can change."""
    if mesh is None:
        return
    for i in range(pieces):
        for side in range(2):
            slack = work.slack[i, side]
            if slack > 0.0:
                u = work.ends[i, side]
                s = math.sqrt(line.v * line.v + u * u)
                f = slack * phase(medium.phase_kind, medium.phase_g, -u / s) / (s * s)
                w = add(scaled(line.e, line.v), scaled(line.d, u))
                for c in range(3):
                    dim = math.exp(-medium.extinction[c] * max(s + u + line.foot, 0.0))
                    error[c] += f * dim * projector_share(texels, light, w, c)


@kernel
def projectors_kernel(
    beam, error, counters, q, rule, quick, settings, work, starts, directions, ends, slacks, rounding
):
    """Add the light (n, 3) of projectors scattered to the eye along rays up to their ends, and its error estimate.

    Return whether the work space was large enough; if not, what was added is worthless.
    """
    value = work.scratch[3]
    estimate = work.scratch[4]
    for i in range(starts.shape[0]):
        for which in range(q.projectors.shape[0]):
            light = projector_at(q.projectors, which)
            line = line_from_light(row(starts, i), row(directions, i), light.position)
            pieces = _lit_pieces(q, light, line, -line.foot, ends[i] - line.foot, slacks[i], work)
            if pieces < 0:
                return False
            n, cells, state = _panels_of(q.medium, q.texels, light, line, pieces, settings, work)
            if state < 0:
                return False
            if cells == 0:
                continue
            counters[i, 1] += cells
            counters[i, 2] = 1
            if state == 0:
                r = _ray_constants(q.medium, light, line, q.texels)
                factor = 1.0 / line.v if line.v > 0.0 else 1.0
                counters[i, 0] += _integrate_panels(
                    q.medium, r, quick, rule, settings, work, n, 3, factor, value, estimate
                )
                _add_slack(q.mesh, q.medium, q.texels, light, line, pieces, work, estimate)
            for c in range(3):
                scale = light.intensity[c] * q.medium.scattering[c]
                if state == 1 and scale > 0.0 and projector_share(q.texels, light, line.d, c) > 0.0:
                    beam[i, c] = math.inf
                elif state == 0 and scale > 0.0:
                    beam[i, c] += scale * value[c]
                    error[i, c] += scale * (estimate[c] + rounding * value[c])
    return True
