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

import numpy as np

from atmoref._jit import subroutine
from atmoref.optics.phase_functions import phase
from atmoref.truth.beams_geometry import cross, dot
from atmoref.truth.beams_pieces import EDGE
from atmoref.truth.beams_question import LINEAR_ANGLE

__all__ = ["MAX_PANELS_PER_PIECE", "Panels", "Settings", "integrate_pieces", "light_distribution", "workspace"]

MAX_PANELS_PER_PIECE = 16
_STACK = 96
_MAX_DEPTH = 60
_CHOP = 32.0  # no first panel spans more than this ratio of theta
_NEGLIGIBLE = 80.0  # optical depth: exp(-80) = 2e-35
_PEAK = 1e-3  # theta within which every phase function of a scene is flat
_FLOOR = 1e-300  # absolute: below this nothing is refined
_ULP = 2.220446049250313e-16
_ULPS = 2.0  # of rounding in one value of the integrand, apart from what its conditioning makes of it


class Settings(NamedTuple):
    """How finely to integrate; beyond ``rtol`` these are for cross-checks."""

    rtol: float
    first_split: int  # equal parts of every first panel
    adaptive: bool


class Panels(NamedTuple):
    """Work space: first panels, their values and errors per distinct extinction, and the refinement stack."""

    cuts: np.ndarray
    ends: np.ndarray
    classes: np.ndarray
    span: np.ndarray  # (n, 3) a, b, sign of u
    kind: np.ndarray  # (n,)
    value: np.ndarray  # (n, 3)
    error: np.ndarray  # (n, 3) difference of the two rules
    noise: np.ndarray  # (n, 3) rounding
    stack: np.ndarray  # (_STACK, 3) a, b, share of the tolerance
    scratch: np.ndarray  # (5, 3)


def workspace(capacity: int, first_split: int) -> Panels:
    """Return the work space of one thread for rays with at most ``capacity`` cuts."""
    n = (capacity + 1) * MAX_PANELS_PER_PIECE * first_split
    return Panels(
        cuts=np.zeros(capacity),
        ends=np.zeros((capacity + 1, 2)),
        classes=np.zeros(capacity + 1, np.int64),
        span=np.zeros((n, 3)),
        kind=np.zeros(n, np.int64),
        value=np.zeros((n, 3)),
        error=np.zeros((n, 3)),
        noise=np.zeros((n, 3)),
        stack=np.zeros((_STACK, 3)),
        scratch=np.zeros((5, 3)),
    )


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


@subroutine
def _angle(v, u):
    """Return theta at |u|, or 1/|u| where v = 0; infinite only for v = u = 0."""
    return math.atan2(v, abs(u)) if v > 0.0 else 1.0 / abs(u)


@subroutine
def _first_panels(v, least, thin, start, end, kind, settings, work, n):
    """Append the first panels of a lit piece [start, end] of u, which lies on one side of 0; return the new count.

    Panels shrink towards theta = 0 until nothing is left to change there: the phase function's peak (wider than
    1e-3), and for u > 0 the layers, as wide as sigma_t v, in which the exponentials die. ``least`` is the least
    extinction, ``thin`` the least that is not 0, if there is one. -1 means that the piece contains the light itself:
    its radiance is infinite.
    """
    sign = 1.0 if end > 0.0 else -1.0
    a = _angle(v, end) if sign > 0.0 else _angle(v, start)
    b = _angle(v, start) if sign > 0.0 else _angle(v, end)
    if b == math.inf:
        return -1
    scale = v if v > 0.0 else 1.0
    if sign > 0.0 and least > 0.0:
        a = max(a, 1.0 / (1.0 / b + 0.5 * _NEGLIGIBLE / (least * scale)))
    quiet = _PEAK if v > 0.0 else math.inf
    if sign > 0.0 and thin < math.inf:
        quiet = min(quiet, thin * scale * 2.0 / _NEGLIGIBLE)
    top = b
    for level in range(MAX_PANELS_PER_PIECE):
        last = level == MAX_PANELS_PER_PIECE - 1 or top <= _CHOP * a or top < quiet
        bottom = a if last else top / _CHOP
        for j in range(settings.first_split):
            work.span[n, 0] = bottom + (top - bottom) * j / settings.first_split
            work.span[n, 1] = bottom + (top - bottom) * (j + 1) / settings.first_split
            work.span[n, 2] = sign
            work.kind[n] = kind
            n += 1
        if last:
            break
        top = bottom
    return n


@subroutine
def _halfway(a, b):
    """Return where to divide a panel: in the geometric middle if it spans a large ratio."""
    if b > 4.0 * a:
        return max(math.sqrt(a * b), b / 64.0)
    return 0.5 * (a + b)


@subroutine
def _good(value, error, allowance, rtol, groups):
    """Tell whether a panel's error is within half of rtol times itself plus its share of the whole."""
    good = True
    for i in range(groups):
        good &= error[i] <= 0.5 * rtol * (value[i] + allowance[i]) + _FLOOR
    return good


@subroutine
def _refine(medium, r, rule, settings, work, p, whole, value, error, allowance, noise):
    """Divide panel ``p`` until it is good; replace its value, error and noise; return the panels computed."""
    groups = medium.groups
    sign = work.span[p, 2]
    kind = work.kind[p]
    work.stack[0, 0], work.stack[0, 1], work.stack[0, 2] = work.span[p, 0], work.span[p, 1], 1.0
    for i in range(groups):
        work.value[p, i] = 0.0
        work.error[p, i] = 0.0
        work.noise[p, i] = 0.0
    height = 1
    computed = 0
    while height > 0:
        height -= 1
        a, b, share = work.stack[height, 0], work.stack[height, 1], work.stack[height, 2]
        _panel(medium, r, rule, a, b, sign, kind, value, error, noise)
        computed += 1
        for i in range(groups):
            allowance[i] = share * whole[i]
        middle = _halfway(a, b)
        stuck = height + 2 > _STACK or share < 2.0**-_MAX_DEPTH or not a < middle < b
        if stuck or _good(value, error, allowance, settings.rtol, groups):
            for i in range(groups):
                work.value[p, i] += value[i]
                work.error[p, i] += error[i]
                work.noise[p, i] += noise[i]
            continue
        work.stack[height, 0], work.stack[height, 1], work.stack[height, 2] = a, middle, 0.5 * share
        work.stack[height + 1, 0], work.stack[height + 1, 1], work.stack[height + 1, 2] = middle, b, 0.5 * share
        height += 2
    return computed


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
    groups = medium.groups
    least = thin = math.inf
    for i in range(groups):
        least = min(least, medium.distinct[i])
        if medium.distinct[i] > 0.0:
            thin = min(thin, medium.distinct[i])
    n = 0
    for i in range(pieces):
        n = _first_panels(line.v, least, thin, work.ends[i, 0], work.ends[i, 1], work.classes[i], settings, work, n)
        if n < 0:
            for c in range(3):
                value[c] = math.inf
                error[c] = 0.0
            return 0
    r = _ray_constants(medium, light, line)
    whole = work.scratch[0]
    for i in range(3):
        whole[i] = 0.0
    for p in range(n):
        a, b, sign = work.span[p, 0], work.span[p, 1], work.span[p, 2]
        _panel(medium, r, rule, a, b, sign, work.kind[p], work.value[p], work.error[p], work.noise[p])
        for i in range(groups):
            whole[i] += work.value[p, i] / n
    computed = n
    if settings.adaptive:
        for p in range(n):
            if not _good(work.value[p], work.error[p], whole, settings.rtol, groups):
                computed += _refine(
                    medium, r, rule, settings, work, p, whole, value, error, work.scratch[1], work.scratch[2]
                )
    _sum(work, n, groups, 1.0 / line.v if line.v > 0.0 else 1.0, value, error)
    return computed


@subroutine
def _sum(work, n, groups, factor, value, error):
    for i in range(groups):
        value[i] = 0.0
        error[i] = 0.0
        for p in range(n):
            value[i] += work.value[p, i]
            error[i] += work.error[p, i] + work.noise[p, i]
        value[i] *= factor
        error[i] *= factor
