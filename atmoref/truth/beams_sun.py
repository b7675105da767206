# mypy: allow-untyped-defs, allow-untyped-calls
# (kernels: Numba infers their types)
r"""Sunlight scattered along view rays, in closed form.

With parallel light gamma = E_0 sigma_s p(alpha) is constant along a ray (erratum D-E13), and between two lines of texel
centres I_l is a polynomial of degree two in t. With tau = sigma_t h on a piece of length h

    ∫_0^h (q0 + q1 t + q2 t²) exp(-sigma_t t) dt = q0 h phi_0 + q1 h² phi_1 + q2 h³ phi_2,
    phi_j = ∫_0^1 y^j exp(-tau y) dy.

For small tau: phi_2 by its series of positive terms, the others from it without cancellation; for large tau the other
way round. Light is not attenuated on its way from the sun. A lit ray without end has the integral exp(-sigma_t t) /
sigma_t; with sigma_t = 0 it is infinite (the medium of a scene then scatters nothing, and 0 is the answer).

Source: Dobashi, Yamamoto and Nishita 2002, eq. (3) with erratum D-E13.
"""

from __future__ import annotations

import math

from atmoref._jit import kernel, subroutine
from atmoref.optics.phase_functions import phase
from atmoref.truth.beams_geometry import dot, row, subtract
from atmoref.truth.beams_light_maps import cell_coefficients, picture_value, sun_at, walk_cells
from atmoref.truth.beams_shadows import shade_by_sun
from atmoref.truth.beams_sun_pieces import find_sun_pieces, sun_ray

__all__ = ["exponential_moments", "sun_share", "suns_kernel"]

_ULP = 2.220446049250313e-16
_ULPS = 8.0  # of rounding in a texel coordinate, relative to the numbers it comes from
_SERIES = 2.0


@subroutine
def exponential_moments(tau):
    """Return ∫_0^1 y^j exp(-tau y) dy for j = 0, 1, 2 and finite tau >= 0, to 1e-15."""
    dim = math.exp(-tau)
    if tau >= _SERIES:
        phi0 = -math.expm1(-tau) / tau
        phi1 = (phi0 - dim) / tau
        return phi0, phi1, (2.0 * phi1 - dim) / tau
    term = total = 1.0 / 3.0
    k = 4.0
    while term > 1e-17 * total:
        term *= tau / k
        total += term
        k += 1.0
    phi2 = dim * total
    phi1 = 0.5 * (tau * phi2 + dim)
    return tau * phi1 + dim, phi1, phi2


@subroutine
def sun_share(texels, light, p, c):
    """Return I_l (without peak) in channel ``c`` at a place."""
    if not light.windowed:
        return texels[light.picture.first, c]
    w = subtract(p, light.center)
    if not dot(light.depth, w) >= 0.0:
        return 0.0
    return picture_value(texels, light.picture, 0.5 + dot(light.across, w), 0.5 + dot(light.down, w), c)


@subroutine
def _map_line(light, edge, size, ray):
    """Return the coefficients of a texel coordinate along a ray, and its rounding."""
    w = subtract(ray.start, light.center)
    first = (0.5 + dot(edge, w)) * size + 0.5
    return (first, dot(edge, ray.d) * size), _ULPS * _ULP * size * (1.0 + math.sqrt(dot(edge, edge) * dot(w, w)))


@subroutine
def _add_cell(medium, texels, picture, cell, x, y, lost, a, b, value, error):
    """Add one piece inside a cell to the integrals (3,) of I_l exp(-sigma_t t) and their errors."""
    h = b - a
    if h == math.inf:  # without end I_l is constant
        for c in range(3):
            whole = math.exp(-medium.extinction[c] * a) / medium.extinction[c]
            value[c] += texels[cell, c] * whole if texels[cell, c] > 0.0 else 0.0
        return
    phi0 = phi1 = phi2 = dim = 0.0
    for c in range(3):
        if c == 0 or medium.groups > 1:
            phi0, phi1, phi2 = exponential_moments(medium.extinction[c] * h)
            dim = h * math.exp(-medium.extinction[c] * a)
        i, j, q, kx, ky, kxy = cell_coefficients(texels, picture, cell, c)
        fx, fy = x[0] + x[1] * a - i, y[0] + y[1] * a - j
        gx, gy = x[1] * h, y[1] * h
        q0 = q + kx * fx + ky * fy + kxy * fx * fy
        q1 = kx * gx + ky * gy + kxy * (fx * gy + fy * gx)
        value[c] += dim * (q0 * phi0 + q1 * phi1 + kxy * gx * gy * phi2)
        error[c] += dim * phi0 * lost * (abs(kx) + abs(ky) + abs(kxy))


@subroutine
def _integrate(medium, texels, light, ray, pieces, work, value, error):
    """Set the integrals (3,) over the lit pieces; return the number of cells, -1 if they do not fit."""
    picture = light.picture
    x, lost_x = _map_line(light, light.across, float(picture.width), ray)
    y, lost_y = _map_line(light, light.down, float(picture.height), ray)
    for c in range(3):
        value[c] = error[c] = 0.0
    cells = 0
    for i in range(pieces):
        a, b = work.ends[i, 0], work.ends[i, 1]
        cells = walk_cells(texels, picture, x, y, (1.0, 0.0), a, b, work.cell_ends, work.cells, cells)
        if cells < 0:
            return -1
    for k in range(cells):
        a, b = work.cell_ends[k, 0], work.cell_ends[k, 1]
        lost = lost_x + lost_y + _ULPS * _ULP * (abs(x[1]) + abs(y[1])) * (a if b == math.inf else b)
        _add_cell(medium, texels, picture, work.cells[k], x, y, lost, a, b, value, error)
    return cells


@subroutine
def _add_slack(mesh, medium, texels, light, ray, pieces, work, error):
    """Add to ``error`` (3,) what rounding of the ends of meshes' shadows can change."""
    if mesh is None:
        return
    for i in range(pieces):
        for side in range(2):
            slack = work.slack[i, side]
            if slack > 0.0:
                t = work.ends[i, side]
                p = (ray.start[0] + t * ray.d[0], ray.start[1] + t * ray.d[1], ray.start[2] + t * ray.d[2])
                for c in range(3):
                    error[c] += slack * math.exp(-medium.extinction[c] * t) * sun_share(texels, light, p, c)


@subroutine
def _lit_pieces(q, light, ray, end, end_slack, work):
    """Return how many pieces of a ray a sun lights, up to texels; -1 if they do not fit."""
    pieces = find_sun_pieces(q.objects, light, ray, 0.0, end, work.cuts, work.ends, work.classes)
    return shade_by_sun(q.mesh, light, ray.start, ray.d, pieces, work, end, end_slack)


@kernel
def suns_kernel(beam, error, counters, q, work, starts, directions, ends, slacks, rounding):
    """Add the light (n, 3) of suns scattered to the eye along rays up to their ends, and its error estimate.

    Return whether the work space was large enough; if not, what was added is worthless.
    """
    value = work.scratch[3]
    estimate = work.scratch[4]
    for i in range(starts.shape[0]):
        for which in range(q.suns.shape[0]):
            light = sun_at(q.suns, which)
            ray = sun_ray(light, row(starts, i), row(directions, i))
            pieces = _lit_pieces(q, light, ray, ends[i], slacks[i], work)
            if pieces == 0:
                continue
            cells = _integrate(q.medium, q.texels, light, ray, pieces, work, value, estimate) if pieces > 0 else -1
            if cells < 0:
                return False
            if cells == 0:
                continue
            _add_slack(q.mesh, q.medium, q.texels, light, ray, pieces, work, estimate)
            counters[i, 1] += cells
            counters[i, 2] = 1
            f = phase(q.medium.phase_kind, q.medium.phase_g, -dot(light.axis, ray.d))
            for c in range(3):
                scale = light.irradiance[c] * q.medium.scattering[c] * f
                if scale > 0.0:
                    beam[i, c] += scale * value[c]
                    if value[c] < math.inf:
                        error[i, c] += scale * (estimate[c] + rounding * value[c])
    return True
