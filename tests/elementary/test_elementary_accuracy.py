"""Errors in units in the last place, against long double (float32) and mpmath (float64)."""

import mpmath
import numpy as np
import pytest
from exhaustive_kernels import walk, worst_exp, worst_log

from atmoref import elementary

# the bounds that the module's docstring states
BOUNDS = {
    np.float32: {"exp": 0.87, "log": 0.84, "sin": 0.501, "cos": 0.501, "tan": 0.501, "atan2": 0.501},
    np.float64: {"exp": 0.87, "log": 0.80, "sin": 0.80, "cos": 0.80, "tan": 1.4, "atan2": 1.75},
}
LIMIT = elementary.TRIGONOMETRIC_LIMIT


def single_arguments(name: str) -> np.ndarray:
    """Return over two million float32: every exponent, and the range in which a function does its work."""
    rng = np.random.default_rng(2002)
    bits = np.arange(0, 1 << 31, 1 << 11, dtype=np.uint32)
    x = (bits + rng.integers(0, 1 << 11, bits.size, dtype=np.uint32)).view(np.float32)
    x = x[np.isfinite(x)]
    if name == "exp":
        return np.concatenate([x[x < 88.7], -x[x < 103.9], rng.uniform(-103.9, 88.7, 1 << 21).astype(np.float32)])
    if name == "log":
        return np.concatenate([x[x > 0], rng.uniform(0.5, 2.0, 1 << 21).astype(np.float32)])
    x = x[x <= LIMIT]
    return np.concatenate([x, -x, rng.uniform(-8192, 8192, 1 << 20).astype(np.float32)])


def single_errors(got: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return errors of float32 in units in the last place of the true value, which is long double."""
    with np.errstate(all="ignore"):
        ulp = np.exp2(np.maximum(np.floor(np.log2(np.abs(true))), -126) - 23)
    return np.where(got == true, 0, np.abs(got - true) / ulp)


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="long double is no wider than float64 here")
@pytest.mark.parametrize("name", ["exp", "log", "sin", "cos", "tan"])
def test_float32_error(name: str) -> None:
    x = single_arguments(name)
    assert x.size >= 2_000_000
    got = getattr(elementary, name)(x)
    assert got.dtype == np.float32
    true = getattr(np, name)(x.astype(np.longdouble))
    assert single_errors(got, true).max() <= BOUNDS[np.float32][name]


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="long double is no wider than float64 here")
def test_float32_error_of_atan2() -> None:
    rng = np.random.default_rng(2002)
    y, x = ((rng.uniform(-1, 1, 1 << 20) * 2.0 ** rng.integers(-30, 30, 1 << 20)).astype(np.float32) for _ in "yx")
    true = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble))
    assert single_errors(elementary.atan2(y, x), true).max() <= BOUNDS[np.float32]["atan2"]


def double_arguments(name: str) -> tuple[np.ndarray, ...]:
    """Return about 20,000 float64 arguments, the awkward ones among them."""
    rng = np.random.default_rng(1970)
    n = 6000
    scaled = rng.uniform(-1, 1, n) * 2.0 ** rng.uniform(-60, 0, n)
    if name == "exp":
        return (np.concatenate([rng.uniform(-708, 709.7, 2 * n), scaled, np.linspace(-745, -708, 500)]),)
    if name == "log":
        wide = np.exp(rng.uniform(-708, 709, n))
        return (np.concatenate([rng.uniform(0.5, 2, n), wide, 1 + 0.9 * scaled, [5e-324, 1e-310, 1.7e308]]),)
    if name == "atan2":
        y, x = (np.concatenate([rng.uniform(-1, 1, n), scaled, 2.0 ** rng.uniform(-1000, 1000, n)]) for _ in "yx")
        return rng.permutation(y), x
    # floats next to multiples of pi/4, where the reduced argument is almost nothing
    k = np.concatenate([np.arange(1, 5000), rng.integers(1, int(LIMIT / np.pi * 4), n)])
    with mpmath.workprec(160):
        near = np.array([float(int(m) * mpmath.pi / 4) for m in k])
    return (np.concatenate([rng.uniform(-1e4, 1e4, n), scaled * LIMIT, near]),)


@pytest.mark.parametrize("name", ["exp", "log", "sin", "cos", "tan", "atan2"])
def test_float64_error(name: str) -> None:
    arguments = double_arguments(name)
    got = getattr(elementary, name)(*arguments)
    function = getattr(mpmath, name)
    worst = 0.0
    with mpmath.workprec(160):
        for value, *point in zip(got.tolist(), *(a.tolist() for a in arguments), strict=True):
            true = function(*map(mpmath.mpf, point))
            worst = max(worst, float(abs(value - true) / mpmath.mpf(float(np.spacing(abs(float(true)))))))
    assert worst <= BOUNDS[np.float64][name]


def test_exp_and_log_of_float32_ascend_and_keep_their_bounds_in_every_binade() -> None:
    """Long runs of neighbouring values; `test_every_float32` leaves none out."""
    for start in np.linspace(-100.0, -1.0, 12):
        error, descents = walk(worst_exp, start, start * (1 + 2.0**-7))
        assert (error <= 0.87, descents) == (True, 0)
    for start in np.geomspace(1e-38, 1e38, 12):
        error, descents = walk(worst_log, start, start * (1 + 2.0**-7))
        assert (error <= 0.84, descents) == (True, 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "first", "last", "bound"),
    [(worst_exp, -0.0, -104.0, 0.87), (worst_exp, 0.0, 88.72283, 0.87), (worst_log, 1e-45, 3.4028235e38, 0.84)],
)
def test_every_float32(function, first, last, bound) -> None:
    error, descents = walk(function, first, last)
    assert error <= bound
    assert descents == 0


def relative_error(terms, exact, weight, first, last) -> float:
    """Return the greatest |exact(z) - polynomial(z)| * weight(z), over a grid that misses zero."""
    with mpmath.workprec(200):
        grid = [mpmath.mpf(first) + (mpmath.mpf(last) - first) * (2 * i + 1) / 400 for i in range(200)]
        return float(max(abs(exact(z) - sum(c * z**n for n, c in enumerate(terms))) * weight(z) for z in grid))


def test_polynomials_approximate_what_they_are_named_for() -> None:
    """Their own error is a small part of an ulp, 2**-24 (float32) or 2**-53 (float64) relative to the result."""
    m = mpmath

    def of_log(z):
        s = m.sqrt(z)
        return (m.log((1 + s) / (1 - s)) / s - 2) / z

    of_exp = lambda r: (m.exp(r) - 1 - r) / r**2
    of_sin = lambda z: (m.sin(m.sqrt(z)) / m.sqrt(z) - 1) / z
    of_cos = lambda z: (m.cos(m.sqrt(z)) - 1 + z / 2) / z**2
    of_atan = lambda z: (m.atan(m.sqrt(z)) / m.sqrt(z) - 1) / z
    e = elementary
    half, s2, q2, t2 = np.log(2) / 2, 0.02944, (np.pi / 4) ** 2, 0.41421356**2
    assert relative_error(e.EXP_SINGLE.terms, of_exp, lambda r: r * r, -half, half) < 2.0**-29
    assert relative_error(e.EXP_DOUBLE.terms, of_exp, lambda r: r * r, -half, half) < 2.0**-57
    assert relative_error(e.LOG_SINGLE.terms, of_log, lambda z: z / 2, 0, s2) < 2.0**-30
    assert relative_error(e.LOG_DOUBLE.terms, of_log, lambda z: z / 2, 0, s2) < 2.0**-57
    assert relative_error(e.SIN_TERMS, of_sin, lambda z: z, 0, q2) < 2.0**-56
    assert relative_error(e.COS_TERMS, of_cos, lambda z: z * z, 0, q2) < 2.0**-57
    assert relative_error(e.ATAN_TERMS, of_atan, lambda z: z, 0, t2) < 2.0**-56


def test_split_constants_sum_up_and_multiply_exactly() -> None:
    with mpmath.workprec(250):
        assert abs(sum(map(mpmath.mpf, elementary.HALF_PI)) - mpmath.pi / 2) < 2.0**-150
        assert abs(sum(map(mpmath.mpf, elementary.QUARTER_PI)) - mpmath.pi / 4) < 2.0**-104
        assert abs(sum(map(mpmath.mpf, elementary.LN2_DOUBLE)) - mpmath.log(2)) < 2.0**-85
        assert abs(sum(map(mpmath.mpf, elementary.LN2_SINGLE)) - mpmath.log(2)) < 2.0**-43
    for part in elementary.HALF_PI[:3]:
        significand = int(np.frexp(part)[0] * 2**53)
        assert significand % (1 << 20) == 0  # 33 bits: times 20 bits fits 53
    assert int(np.frexp(elementary.LN2_DOUBLE[0])[0] * 2**53) % (1 << 11) == 0
    assert int(np.frexp(elementary.LN2_SINGLE[0])[0] * 2**24) % (1 << 8) == 0
    assert int(np.frexp(elementary.QUARTER_PI[0])[0] * 2**53) % (1 << 3) == 0
