"""Three-vectors as tuples of Python floats: plain IEEE arithmetic, no BLAS, so the same bits on every machine."""

import math

Vec3 = tuple[float, float, float]


def dot(a: Vec3, b: Vec3) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def minus(a: Vec3, b: Vec3) -> Vec3:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scaled(a: Vec3, s: float) -> Vec3:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


def length(a: Vec3) -> float:
    """Return |a|."""
    return math.sqrt(dot(a, a))


def unit(a: Vec3) -> Vec3:
    """Return a / |a|; a must not be zero."""
    return scaled(a, 1.0 / length(a))
