# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Samplers: where along a segment to look, with the density of that choice."""

from __future__ import annotations

import math

from atmoref._jit import subroutine

__all__ = ["equiangular", "equiangular_density"]


@subroutine
def equiangular(xi, offset_m, start_m, end_m):
    """Return a place ``u`` (m) on a line, and its density (1/m), with equal chance for equal angles at a point light.

    Parameters
    ----------
    xi
        Uniform in [0, 1).
    offset_m
        Distance of the light from the line, > 0.
    start_m, end_m
        The segment, measured along the line from the foot of the light's perpendicular; ``end_m`` may be infinite.

    Returns
    -------
    u, density
        density = offset / (angle · (offset² + u²)), so 1/s² over it is constant. Within 1e-14 relative, but for the
        cancellation of the two end angles, which loses digits where the segment is seen under a small angle.

    Source: Kulla and Fajardo 2012, equi-angular sampling.
    """
    first = math.atan2(start_m, offset_m)
    angle = math.atan2(end_m, offset_m) - first
    u = offset_m * math.tan(first + xi * angle)
    u = min(max(u, start_m), end_m)
    return u, offset_m / (angle * (offset_m * offset_m + u * u))


@subroutine
def equiangular_density(u, offset_m, start_m, end_m):
    """Return the density (1/m) with which :func:`equiangular` picks ``u`` of the segment; 0 outside it."""
    if u < start_m or u > end_m:
        return 0.0
    angle = math.atan2(end_m, offset_m) - math.atan2(start_m, offset_m)
    return offset_m / (angle * (offset_m * offset_m + u * u))
