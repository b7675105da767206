"""Every lane operation against NumPy, on random and on awkward values."""

from fractions import Fraction

import lane_kernels
import mpmath
import numpy as np
import pytest
from mpmath.libmp import from_rational

from atmoref.lanes import Double, N, Single

KINDS = [np.float32, np.float64]


def special(kind: type) -> np.ndarray:
    info = np.finfo(kind)
    edges = [0.0, 0.5, 1.0, 1.5, 2.5, 0.1, 3.0, info.max, info.tiny, info.smallest_subnormal, info.eps, np.inf, np.nan]
    return np.array([s * v for v in edges for s in (1, -1)] + [2.0**22, 2.0**23 + 1, 8388609.5, -0.49999997]).astype(
        kind
    )


def operands(kind: type) -> tuple[np.ndarray, np.ndarray]:
    """Return all pairs of special values, random bit patterns, and moderate values; a multiple of 32."""
    s, rng = special(kind), np.random.default_rng(11)
    code = f"u{kind().itemsize}"
    raw = [rng.integers(0, np.iinfo(code).max, 1 << 12, dtype=code, endpoint=True).view(kind) for _ in "xy"]
    mild = [rng.uniform(-8, 8, 1 << 12).astype(kind) for _ in "xy"]
    x, y = (np.concatenate(p) for p in zip((np.repeat(s, s.size), np.tile(s, s.size)), raw, mild, strict=True))
    size = x.size // 32 * 32
    return x[-size:].copy(), y[-size:].copy()


def assert_same(got: np.ndarray, true: np.ndarray, name: object) -> None:
    """Equal bits, or both NaN (whose sign and payload are not defined)."""
    code = f"u{got.dtype.itemsize}"
    assert got.dtype == true.dtype, name
    same = (got.view(code) == true.view(code)) | ((got != got) & (true != true))
    assert same.all(), (name, np.flatnonzero(~same)[:5], got[~same][:5], true[~same][:5])


def in_place(a, b):
    d = a + b
    d = d - a.dtype.type(0.25)
    d = d * b
    return d / a.dtype.type(3)


REAL = {
    "a + b": lambda a, b: a + b,
    "a - b": lambda a, b: a - b,
    "a * b": lambda a, b: a * b,
    "a / b": lambda a, b: a / b,
    "-a": lambda a, b: -a,
    "+a": lambda a, b: a,
    "0.5 - a": lambda a, b: a.dtype.type(0.5) - a,
    "2 * a": lambda a, b: a + a,
    "1 / a": lambda a, b: a.dtype.type(1) / a,
    "a - 0.1": lambda a, b: a - a.dtype.type(0.1),
    "in place": in_place,
    "minimum": lambda a, b: np.where(a < b, a, b),
    "maximum": lambda a, b: np.where(a > b, a, b),
    "minimum(a, 0)": lambda a, b: np.where(a < 0, a, a.dtype.type(0)),
    "maximum(0, a)": lambda a, b: np.where(a < 0, a.dtype.type(0), a),
    "absolute": lambda a, b: np.abs(a),
    "square": lambda a, b: a * a,
    "rint": lambda a, b: np.rint(a),
    "floor": lambda a, b: np.floor(a),
    "sqrt": lambda a, b: np.sqrt(a),
    "copy_sign": np.copysign,
    "copy_sign(1, b)": lambda a, b: np.copysign(a.dtype.type(1), b),
    "select": lambda a, b: np.where(a < b, a, b),
    "select weak": lambda a, b: np.where(a < b, a, a.dtype.type(0.5)),
    "select true": lambda a, b: np.full_like(a, 0.1),
    "select uniform": lambda a, b: b,
}
TESTS = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "a != a": lambda a, b: np.isnan(a),
    "0.5 < a": lambda a, b: a > 0.5,
    "a < 0.5": lambda a, b: a < 0.5,
    "&": lambda a, b: (a < b) & (a < 0.5),
    "|": lambda a, b: (a < b) | (a < 0.5),
    "^": lambda a, b: (a < b) ^ (a < 0.5),
    "~": lambda a, b: ~(a < b),
    "lane_not": lambda a, b: ~(a < 0.5),
    "& True": lambda a, b: a < b,
    "| False": lambda a, b: a < 0.5,
}
shift = lambda b: b & 31
logical = lambda a, k: (a.view(np.uint32) >> np.uint32(k)).view(np.int32)
INTEGER = {
    "a + b": lambda a, b: a + b,
    "a - b": lambda a, b: a - b,
    "a * b": lambda a, b: a * b,
    "-a": lambda a, b: -a,
    "~a": lambda a, b: ~a,
    "7 - a": lambda a, b: 7 - a,
    "a * 3": lambda a, b: a * 3,
    "&": lambda a, b: a & b,
    "|": lambda a, b: a | b,
    "^": lambda a, b: a ^ b,
    "a & 255": lambda a, b: a & 255,
    "<<": lambda a, b: a << shift(b),
    ">>": lambda a, b: a >> shift(b),
    "shift_right": lambda a, b: (a.view(np.uint32) >> shift(b).view(np.uint32)).view(np.int32),
    "a << 3": lambda a, b: a << 3,
    "a >> 5": lambda a, b: a >> 5,
    "shift_right 5": lambda a, b: logical(a, 5),
    "minimum": np.minimum,
    "maximum": np.maximum,
    "minimum 9": lambda a, b: np.minimum(a, 9),
    "maximum -9": lambda a, b: np.maximum(-9, a),
    "absolute": lambda a, b: np.abs(a),
    "square": lambda a, b: a * a,
    "select": lambda a, b: np.where(a < b, a, b),
    "select weak": lambda a, b: np.where(a == b, 1, b),
    "!=": lambda a, b: a != b,
    ">=": lambda a, b: a >= 3,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    "iota": lambda a, b: np.arange(a.size),
    "spread_int": lambda a, b: np.arange(a.size) // N * N,
}


@pytest.mark.parametrize("kind", KINDS)
def test_reals(kind: type) -> None:
    x, y = operands(kind)
    out = np.empty((len(REAL) + 2) * x.size, kind)
    lane_kernels.real_rows(x, y, np.ones_like(x), out)
    rows = out.reshape(-1, x.size)
    with np.errstate(all="ignore"):
        for row, (name, function) in zip(rows, REAL.items(), strict=False):
            assert_same(row, np.asarray(function(x, y)), name)


@pytest.mark.parametrize("kind", KINDS)
def test_fma_rounds_once(kind: type) -> None:
    rng = np.random.default_rng(3)
    x, y = ((rng.uniform(1, 2, 640) * rng.choice([-1, 1], 640)).astype(kind) for _ in "xy")
    z = (-x * y * (1 + rng.integers(-2, 3, 640) * 2.0 ** rng.integers(-30, 0, 640))).astype(kind)
    out = np.empty((len(REAL) + 2) * x.size, kind)
    lane_kernels.real_rows(x, y, z, out)
    bits = np.finfo(kind).nmant + 1
    three = [x, np.full_like(x, 3)], [y, x], [z, np.full_like(x, 0.1)]
    exact = [
        [Fraction(float(p)) * Fraction(float(q)) + Fraction(float(r)) for p, q, r in zip(a, b, c, strict=True)]
        for a, b, c in zip(*three, strict=True)
    ]
    for row, values in zip(out.reshape(-1, x.size)[-2:], exact, strict=True):
        true = [float(mpmath.mpf(from_rational(v.numerator, v.denominator, bits, "n"))) if v else 0.0 for v in values]
        np.testing.assert_array_equal(row, np.array(true, kind))
    apart = (x * y + z) != out.reshape(-1, x.size)[-2]
    assert apart.any()  # the operands tell fused from separate


@pytest.mark.parametrize("kind", KINDS)
def test_comparisons_and_masks(kind: type) -> None:
    x, y = operands(kind)
    out = np.empty(len(TESTS) * x.size, np.int32)
    lane_kernels.test_rows(x, y, out)
    for row, (name, function) in zip(out.reshape(-1, x.size), TESTS.items(), strict=True):
        np.testing.assert_array_equal(row, function(x, y), err_msg=name)


def test_integers() -> None:
    rng, info = np.random.default_rng(5), np.iinfo(np.int32)
    edges = np.array([0, 1, -1, 3, 31, 255, info.max, info.min + 1, info.min], np.int32)
    x = np.concatenate([np.repeat(edges, 9), rng.integers(info.min, info.max, 1 << 10, dtype=np.int32), edges, edges])
    y = np.concatenate([np.tile(edges, 9), rng.integers(info.min, info.max, 1 << 10, dtype=np.int32), edges, edges])
    x, y = x[: x.size // 32 * 32].copy(), y[: x.size // 32 * 32].copy()
    out = np.empty(len(INTEGER) * x.size, np.int32)
    lane_kernels.integer_rows(x, y, out)
    rows = out.reshape(-1, x.size)
    with np.errstate(all="ignore"):
        for row, (name, function) in zip(rows, INTEGER.items(), strict=True):
            np.testing.assert_array_equal(row, function(x, y), err_msg=name)


def test_lerp_of_bytes_is_exact_for_every_pair_and_weight() -> None:
    p, q = (v.astype(np.int32).ravel() for v in np.mgrid[0:256, 0:256])
    out = np.empty_like(p)
    for weight in range(256):
        lane_kernels.blend_bytes(p | (q << 16), q | (p << 16), weight, out)
        up, down = (a + ((weight * (b - a) + 128) >> 8) for a, b in ((p, q), (q, p)))
        assert (out == (up | (down << 16))).all()


@pytest.mark.parametrize("arith", [Single(), Double()], ids=["float32", "float64"])
def test_conversions(arith) -> None:
    kind = np.float32 if isinstance(arith, Single) else np.float64
    rng = np.random.default_rng(9)
    x = np.concatenate([rng.uniform(-(2.0**21), 2.0**21, 992), np.arange(-16, 16) + 0.5]).astype(kind)
    k = np.concatenate([rng.integers(-(1 << 31), 1 << 31, 992), np.arange(-16, 16)]).astype(np.int32)
    real, whole = np.empty(6 * x.size, kind), np.empty(3 * x.size, np.int32)
    lane_kernels.conversion_rows(arith, x, k, real, whole)
    real, whole = real.reshape(6, -1), whole.reshape(3, -1)
    significand, exponent = np.frexp(np.abs(x))
    at = np.arange(x.size)
    rows = [k, k, at // N * N, at + 0.5, 2.0 ** (k & 63), significand * 2]
    for got, true in zip(real, rows, strict=True):
        np.testing.assert_array_equal(got, np.asarray(true).astype(kind))
    for got, true in zip(whole, (np.trunc(x), np.rint(x), exponent - 1), strict=True):
        np.testing.assert_array_equal(got, true)


@pytest.mark.parametrize("kind", KINDS)
def test_precisions_convert_by_rounding_to_nearest(kind: type) -> None:
    with np.errstate(all="ignore"):
        ties = np.array([1 + 2.0**-24, 1 + 3 * 2.0**-24, 3.4028235677973366e38, 1e-46]).astype(kind)
    x = np.concatenate([np.resize(ties, 32), operands(kind)[0]])
    single, double = np.empty(x.size, np.float32), np.empty(x.size, np.float64)
    lane_kernels.cast(x, single, double)
    with np.errstate(all="ignore"):
        assert_same(single, x.astype(np.float32), "float32")
        assert_same(double, x.astype(np.float64), "float64")
