# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Adaptive quadrature over panels of the angle at a point light, whatever the light's distribution.

The variable is described in ``beams_integral.py``. For v -> 0 it is y = theta / v, which tends to 1/|u|. For u > 0 the
exponential dies as theta -> 0 within about sigma_t v: what is below e^-80 of the piece's end is cut off, and halving is
geometric near 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from atmoref._jit import subroutine

__all__ = ["MAX_PANELS_PER_PIECE", "Panels", "Settings", "first_panels", "integrator", "least_extinctions", "workspace"]

MAX_PANELS_PER_PIECE = 16
_STACK = 96
_MAX_DEPTH = 60
_CHOP = 32.0  # no first panel spans more than this ratio of theta
_NEGLIGIBLE = 80.0  # optical depth: exp(-80) = 2e-35
_PEAK = 1e-3  # theta within which every phase function of a scene is flat
_FLOOR = 1e-300  # absolute: below this nothing is refined


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
    slack: np.ndarray  # (pieces, 2) error of the ends of pieces that are ends of shadows of meshes
    shadows: np.ndarray  # (n, 4) see find_shadows()
    cell_ends: np.ndarray  # (cells, 2) see walk_cells()
    cells: np.ndarray
    span: np.ndarray  # (n, 3) a, b, sign of u
    kind: np.ndarray  # (n,)
    value: np.ndarray  # (n, 3)
    error: np.ndarray  # (n, 3) difference of the two rules
    noise: np.ndarray  # (n, 3) rounding
    stack: np.ndarray  # (_STACK, 3) a, b, share of the tolerance
    scratch: np.ndarray  # (5, 3)


def workspace(cuts: int, first_split: int, *, lines: int = 0, shadows: int = 0) -> Panels:
    """Return the work space of one thread.

    Parameters
    ----------
    cuts
        How many cuts a ray has at most from all but meshes and pictures.
    first_split
        As in :class:`Settings`.
    lines
        Of texel centres that a ray may cross.
    shadows
        Of meshes that there is room for.
    """
    pieces = cuts + 1 + shadows
    n = (pieces * MAX_PANELS_PER_PIECE + lines) * first_split
    return Panels(
        cuts=np.zeros(cuts),
        ends=np.zeros((pieces, 2)),
        classes=np.zeros(pieces, np.int64),
        slack=np.zeros((pieces, 2)),
        shadows=np.zeros((shadows, 4)),
        cell_ends=np.zeros((pieces + lines, 2)),
        cells=np.zeros(pieces + lines, np.int64),
        span=np.zeros((n, 3)),
        kind=np.zeros(n, np.int64),
        value=np.zeros((n, 3)),
        error=np.zeros((n, 3)),
        noise=np.zeros((n, 3)),
        stack=np.zeros((_STACK, 3)),
        scratch=np.zeros((5, 3)),
    )


@subroutine
def least_extinctions(medium):
    """Return the least extinction, and the least that is not 0; infinite for none."""
    least = thin = math.inf
    for i in range(medium.groups):
        least = min(least, medium.distinct[i])
        if medium.distinct[i] > 0.0:
            thin = min(thin, medium.distinct[i])
    return least, thin


@subroutine
def _angle(v, u):
    """Return theta at |u|, or 1/|u| where v = 0; infinite only for v = u = 0."""
    return math.atan2(v, abs(u)) if v > 0.0 else 1.0 / abs(u)


@subroutine
def first_panels(v, least, thin, start, end, kind, settings, work, n):
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
def _good(value, error, noise, noise_share, allowance, rtol, groups):
    """Tell whether a panel is within half of rtol of itself plus its share of the whole, or its error is rounding."""
    good = True
    for i in range(groups):
        good &= error[i] <= max(0.5 * rtol * (value[i] + allowance[i]), noise_share * noise[i]) + _FLOOR
    return good


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


def integrator(panel, noise_share):
    """Return the adaptive integration of an integrand.

    Parameters
    ----------
    panel
        A subroutine ``panel(medium, r, rule, a, b, sign, kind, value, error, noise)`` that integrates one panel.
    noise_share
        A panel is good as well if its error is below this share of its rounding. Where an integrand has no relative
        precision (a picture's next to black), halving would have no end without it.

    Returns
    -------
    integrate_panels
        A subroutine: see the text in it.
    """

    @subroutine
    def refine(medium, r, rule, settings, work, p, groups, whole, value, error, allowance, noise):
        """Divide panel ``p`` until it is good; replace its value, error and noise; return the panels computed."""
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
            panel(medium, r, rule, a, b, sign, kind, value, error, noise)
            computed += 1
            for i in range(groups):
                allowance[i] = share * whole[i]
            middle = _halfway(a, b)
            stuck = height + 2 > _STACK or share < 2.0**-_MAX_DEPTH or not a < middle < b
            if stuck or _good(value, error, noise, noise_share, allowance, settings.rtol, groups):
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
    def integrate_panels(medium, r, quick, rule, settings, work, n, groups, factor, value, error):
        """Set value and error (groups,) of n first panels times ``factor``; return how many panels were computed.

        All are computed by the rule ``quick``, and those that are not good enough again by ``rule``, in halves.
        """
        whole = work.scratch[0]
        for i in range(3):
            whole[i] = 0.0
        for p in range(n):
            a, b, sign = work.span[p, 0], work.span[p, 1], work.span[p, 2]
            panel(medium, r, quick, a, b, sign, work.kind[p], work.value[p], work.error[p], work.noise[p])
            for i in range(groups):
                whole[i] += work.value[p, i] / n
        computed = n
        if settings.adaptive:
            for p in range(n):
                if not _good(work.value[p], work.error[p], work.noise[p], noise_share, whole, settings.rtol, groups):
                    computed += refine(
                        medium, r, rule, settings, work, p, groups, whole, value, error, work.scratch[1],
                        work.scratch[2],
                    )  # fmt: skip
        _sum(work, n, groups, factor, value, error)
        return computed

    return integrate_panels
