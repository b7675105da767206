# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
r"""The light that one lit piece of a view ray scatters to the eye, by adaptive quadrature in the angle at the light.

With s² = u² + v² the 1/s² of eq. (3) makes du / s² = d(theta) / v, where theta = atan2(v, \|u\|) is the angle between
the view line and the way from the light. It is the scattering angle before the light's foot (u < 0) and its
supplement behind it (u > 0), so that no digits are lost near either end:

    I = (1/v) ∫ p(±cos theta) I_l exp(-sigma_t (path + foot)) d(theta),
    path = s + u = v tan(theta/2) for u < 0 and v / tan(theta/2) for u > 0.

The integrand is analytic in theta: I_l's cosine is A sin(theta) ± D cos(theta). For v -> 0 the variable y = theta / v
tends to 1/\|u\|, path to 0 or 2 \|u\|, and the same code runs in y. For u > 0 the exponential dies as theta -> 0 within
about sigma_t v: what is below e^-80 of the piece's end is cut off, and halving is geometric near 0.

Source: Dobashi, Yamamoto and Nishita 2002, eqs. (2), (3); the change of variable as in the airlight integral of Sun,
Ramamoorthi, Narasimhan and Nayar 2005.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from atmoref._jit import subroutine
from atmoref.optics.phase_functions import phase
from atmoref.truth.beams_geometry import cross, dot
from atmoref.truth.beams_panels import first_panels, integrator, least_extinctions
from atmoref.truth.beams_pieces import EDGE
from atmoref.truth.beams_question import LINEAR_ANGLE

__all__ = ["add_slack", "integrate_pieces", "light_distribution"]

_ULP = 2.220446049250313e-16
_ULPS = 2.0  # of rounding in one value of the integrand, apart from what its conditioning makes of it


class _Ray(NamedTuple):
    """What the integrand needs, once per ray and light."""

    v: float
    foot: float
    a_e: float  # e · axis
    a_d: float  # d · axis
    cross_e: tuple[float, float, float]
    cross_d: tuple[float, float, float]
    falloff: int
    cos_inner: float
    cos_outer: float
    inner: float
    outer: float
    kind: int
    g: float
    phase_noise: float  # relative rounding of the phase function


@subroutine
def _ray_constants(medium, light, line):
    axis = light.axis
    return _Ray(
        line.v,
        line.foot,
        dot(line.e, axis),
        dot(line.d, axis),
        cross(line.e, axis),
        cross(line.d, axis),
        light.falloff,
        math.cos(light.inner),
        math.cos(light.outer),
        light.inner,
        light.outer,
        medium.phase_kind,
        medium.phase_g,
        _ULPS * _ULP * (1.0 + abs(medium.phase_g) / (1.0 - abs(medium.phase_g)) ** 2),
    )


@subroutine
def light_distribution(falloff, cosine, sine, cos_inner, cos_outer, inner, outer):
    """Return the share of the peak intensity between inner and outer cone, at an angle given by cosine and sine."""
    if falloff == LINEAR_ANGLE:
        share = (outer - math.atan2(sine, cosine)) / (outer - inner)
        return min(max(share, 0.0), 1.0)
    x = min(max((cosine - cos_outer) / (cos_inner - cos_outer), 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@subroutine
def _share_at(r, sx, cx):
    """Return I_l / peak in the falloff zone and its rounding error; ``cx`` carries the sign of u.

    The error counts that the ray's place is known to rounding at the eye's distance: it decides where a ray only
    grazes the cone and I_l is next to nothing.
    """
    cosine = r.a_e * sx + r.a_d * cx
    sine = 0.0
    if r.falloff == LINEAR_ANGLE:
        x = r.cross_e[0] * sx + r.cross_d[0] * cx
        y = r.cross_e[1] * sx + r.cross_d[1] * cx
        z = r.cross_e[2] * sx + r.cross_d[2] * cx
        sine = math.sqrt(x * x + y * y + z * z)
    share = light_distribution(r.falloff, cosine, sine, r.cos_inner, r.cos_outer, r.inner, r.outer)
    lost = _ULPS * _ULP * (1.0 + (abs(r.foot) * sx / r.v if r.v > 0.0 else 0.0))
    if r.falloff == LINEAR_ANGLE:
        return share, lost / (r.outer - r.inner)
    x = min(max((cosine - r.cos_outer) / (r.cos_inner - r.cos_outer), 0.0), 1.0) + lost
    return share, lost * 6.0 * x / (r.cos_inner - r.cos_outer)


@subroutine
def _panel(medium, r, rule, a, b, sign, kind, value, error, noise):
    """Integrate one panel [a, b] of theta (of 1/|u| where v = 0): set value, error, noise (3,) per extinction."""
    k0 = k1 = k2 = 0.0
    c0 = c1 = c2 = 0.0
    n0 = n1 = n2 = 0.0
    groups = medium.groups
    middle = 0.5 * (a + b)
    half = 0.5 * (b - a)
    for i in range(rule.nodes.shape[0]):
        x = middle + half * rule.nodes[i]
        if r.v > 0.0:
            sx = math.sin(x)
            cx = math.cos(x)
            path = r.v * (1.0 + cx) / sx if sign > 0.0 else r.v * sx / (1.0 + cx)
        else:
            sx = 0.0
            cx = 1.0
            path = 2.0 / x if sign > 0.0 else 0.0
        f = phase(r.kind, r.g, -sign * cx)
        rounding = f * r.phase_noise
        if kind == EDGE:
            share, lost = _share_at(r, sx, sign * cx)
            rounding = rounding * share + f * lost
            f *= share
        path += r.foot
        fine = rule.fine[i]
        coarse = rule.coarse[i]
        tau = medium.distinct[0] * path
        dim = math.exp(-tau)
        k0 += fine * f * dim
        c0 += coarse * f * dim
        n0 += fine * dim * (rounding + f * _ULPS * _ULP * tau)
        if groups > 1:
            tau = medium.distinct[1] * path
            dim = math.exp(-tau)
            k1 += fine * f * dim
            c1 += coarse * f * dim
            n1 += fine * dim * (rounding + f * _ULPS * _ULP * tau)
        if groups > 2:
            tau = medium.distinct[2] * path
            dim = math.exp(-tau)
            k2 += fine * f * dim
            c2 += coarse * f * dim
            n2 += fine * dim * (rounding + f * _ULPS * _ULP * tau)
    value[0], value[1], value[2] = half * k0, half * k1, half * k2
    error[0], error[1], error[2] = half * abs(k0 - c0), half * abs(k1 - c1), half * abs(k2 - c2)
    noise[0], noise[1], noise[2] = half * n0, half * n1, half * n2


_integrate_panels = integrator(_panel, 0.0)


@subroutine
def integrate_pieces(medium, light, line, pieces, rule, settings, work, value, error):
    """Integrate the lit pieces of one ray for one light, for unit I_0 sigma_s peak.

    Parameters
    ----------
    medium, light, line
        The medium, the light, the ray as seen from it.
    pieces
        How many pieces ``work.ends`` and ``work.classes`` hold.
    rule, settings, work
        Rules, tolerance, work space.
    value, error
        (3,) filled: integral and error estimate (1/m² · 1/sr · m) per distinct extinction. Infinite with error 0 where
        the ray meets the light itself in a lit piece.

    Returns
    -------
    panels
        How many panels were computed.
    """
    least, thin = least_extinctions(medium)
    n = 0
    for i in range(pieces):
        n = first_panels(line.v, least, thin, work.ends[i, 0], work.ends[i, 1], work.classes[i], settings, work, n)
        if n < 0:
            for c in range(3):
                value[c] = math.inf
                error[c] = 0.0
            return 0
    r = _ray_constants(medium, light, line)
    factor = 1.0 / line.v if line.v > 0.0 else 1.0
    return _integrate_panels(medium, r, rule, rule, settings, work, n, medium.groups, factor, value, error)


@subroutine
def add_slack(mesh, medium, light, line, pieces, work, error):
    """Add to ``error`` (3,), per distinct extinction, what rounding of the ends of meshes' shadows can change."""
    if mesh is None:
        return
    r = _ray_constants(medium, light, line)
    for i in range(pieces):
        for side in range(2):
            slack = work.slack[i, side]
            if slack > 0.0:
                u = work.ends[i, side]
                s = math.sqrt(line.v * line.v + u * u)
                f = slack * phase(r.kind, r.g, -u / s) / (s * s)
                if work.classes[i] == EDGE:
                    f *= _share_at(r, line.v / s, u / s)[0]
                for c in range(medium.groups):
                    error[c] += f * math.exp(-medium.distinct[c] * max(s + u + line.foot, 0.0))
