"""Special values, types, and equality of the NumPy and lane bindings in every bit."""

import itertools
import subprocess
import sys

import numpy as np
import pytest

from atmoref import elementary
from atmoref._jit import kernel
from atmoref.lanes import N, atan2, cos, exp, load, log, sin, store, tan

KINDS = [np.float32, np.float64]
NAMES = ["exp", "log", "sin", "cos", "tan", "atan2"]


@kernel
def five(x, out):
    """Write exp, log, sin, cos and tan of x, one after the other."""
    n = x.size
    for i in range(0, n, N):
        v = load(x, i)
        store(out, i, exp(v))
        store(out, n + i, log(v))
        store(out, 2 * n + i, sin(v))
        store(out, 3 * n + i, cos(v))
        store(out, 4 * n + i, tan(v))


@kernel
def angles(y, x, out):
    """Write atan2 of vectors, and of weak scalars beside lanes."""
    n = x.size
    for i in range(0, n, N):
        store(out, i, atan2(load(y, i), load(x, i)))
        store(out, n + i, atan2(load(y, i), -0.5))
        store(out, 2 * n + i, atan2(1, load(x, i)))


def special(kind: type) -> np.ndarray:
    """Return what tends to go wrong, padded to whole registers."""
    info = np.finfo(kind)
    edges = [0.0, 1.0, 0.5, 2.0, np.pi / 4, np.pi / 2, np.sqrt(0.5), np.sqrt(2), info.max, info.tiny, info.eps]
    edges += [info.smallest_subnormal, 87.3, 88.7228, 88.73, 103.97, 104.1, 709.78, 709.79, 745.13, 745.2]
    edges += [2.0**20, 2.0**20 + 1, 1e30, np.inf, np.nan, 0.41421356, info.tiny * 0.75, info.max / 2]
    values = np.array([s * v for v in edges for s in (1, -1)]).astype(kind)
    return np.resize(values, -(-values.size // 32) * 32)


def mixed(kind: type) -> np.ndarray:
    """Return special values, random bit patterns and values of moderate size."""
    rng = np.random.default_rng(7)
    bits = rng.integers(0, np.iinfo(f"u{kind().itemsize}").max, 1 << 15, dtype=f"u{kind().itemsize}", endpoint=True)
    return np.concatenate([special(kind), bits.view(kind), rng.uniform(-110, 110, 1 << 15).astype(kind)])


def bits(x: np.ndarray) -> np.ndarray:
    return x.view(f"u{x.dtype.itemsize}")


@pytest.mark.parametrize("kind", KINDS)
def test_lanes_and_numpy_give_equal_bits(kind: type) -> None:
    x = mixed(kind)
    out = np.empty(5 * x.size, kind)
    five(x, out)
    for name, row in zip(NAMES, out.reshape(5, -1), strict=False):
        np.testing.assert_array_equal(bits(row), bits(getattr(elementary, name)(x)), err_msg=name)
    y = np.concatenate([np.repeat(special(kind), special(kind).size), mixed(kind)])
    x = np.concatenate([np.tile(special(kind), special(kind).size), np.roll(mixed(kind), 5)])
    out = np.empty(3 * x.size, kind)
    angles(y, x, out)
    for row, true in zip(
        out.reshape(3, -1),
        (elementary.atan2(y, x), elementary.atan2(y, -0.5), elementary.atan2(1, x)),
        strict=True,
    ):
        np.testing.assert_array_equal(bits(row), bits(true))


@pytest.mark.parametrize("kind", KINDS)
def test_special_values(kind: type) -> None:
    e = elementary
    inf, nan = kind(np.inf), kind(np.nan)
    for name in NAMES[:5]:
        assert np.isnan(getattr(e, name)(nan))
    assert (e.exp(kind(0)), e.exp(-inf), e.exp(inf), e.log(kind(1)), e.log(inf)) == (1, 0, inf, 0, inf)
    assert e.log(kind(0)) == e.log(kind(-0.0)) == -inf
    assert np.isnan(e.log(np.array([-1, -np.inf, -1e-30], kind))).all()
    assert (e.sin(kind(0)), e.cos(kind(0)), e.tan(kind(0))) == (0, 1, 0)
    for name in ("sin", "tan"):
        assert np.signbit(getattr(e, name)(kind(-0.0)))
    for name in ("sin", "cos", "tan"):
        limit = kind(e.TRIGONOMETRIC_LIMIT)
        beyond = np.array([np.nextafter(limit, inf), -np.nextafter(limit, inf), inf, -inf])
        assert np.isnan(getattr(e, name)(beyond)).all()
        assert np.isfinite(getattr(e, name)(np.array([limit, -limit]))).all()
    tiny = np.finfo(kind).smallest_subnormal
    assert (e.sin(tiny), e.tan(tiny), e.atan2(tiny, kind(1)), e.exp(tiny)) == (tiny, tiny, tiny, 1)


@pytest.mark.parametrize(
    ("kind", "zero_below", "least", "infinite_above"),
    [(np.float32, -103.98, -103.96, 88.73), (np.float64, -745.14, -745.13, 709.79)],
)
def test_exp_underflows_gradually_and_overflows(kind, zero_below, least, infinite_above) -> None:
    tiny = np.finfo(kind).smallest_subnormal
    assert elementary.exp(kind(zero_below)) == 0
    assert elementary.exp(kind(least)) == tiny
    assert np.isinf(elementary.exp(kind(infinite_above)))
    assert np.isfinite(elementary.exp(kind(infinite_above - 0.02)))
    x = np.linspace(zero_below, np.log(np.finfo(kind).tiny), 1000).astype(kind)
    steps = elementary.exp(x) / tiny
    assert (steps == np.rint(steps)).all()
    true = np.exp(x.astype(np.longdouble)) / np.longdouble(tiny)
    assert np.abs(steps - true).max() < 0.501 + (np.finfo(kind).eps * steps).max()


@pytest.mark.parametrize("kind", KINDS)
def test_atan2_has_the_quadrants_zeros_and_infinities_of_ieee(kind: type) -> None:
    sides = [-np.inf, -2.0, -0.0, 0.0, 2.0, np.inf]
    for y, x in itertools.product(sides, sides):
        got, true = elementary.atan2(kind(y), kind(x)), np.arctan2(np.float64(y), np.float64(x))
        assert got == kind(true), (y, x)
        assert np.signbit(got) == np.signbit(true), (y, x)
    for y, x in ((np.nan, 1.0), (1.0, np.nan), (np.nan, np.nan)):
        assert np.isnan(elementary.atan2(kind(y), kind(x)))


def test_types_follow_the_arguments() -> None:
    for name in NAMES[:5]:
        function = getattr(elementary, name)
        assert function(np.float32(0.5)).dtype == np.float32
        assert function(np.ones((2, 3), np.float32)).shape == (2, 3)
        assert function(0.5).dtype == function(1).dtype == function(np.float64(0.5)).dtype == np.float64
        for wrong in (np.float16(1), np.arange(3), np.array(["a"]), 1j):
            with pytest.raises(TypeError, match=name):
                function(wrong)
    assert elementary.atan2(np.float32(1), 2.0).dtype == np.float32
    assert elementary.atan2(np.float32(1), np.float64(2)).dtype == np.float64
    assert elementary.exp(np.empty(0, np.float32)).shape == (0,)


def test_non_contiguous_arrays() -> None:
    x = np.linspace(-5, 5, 64).reshape(8, 8)
    np.testing.assert_array_equal(elementary.exp(x[::2, ::3].T), elementary.exp(x)[::2, ::3].T)


def test_import_loads_no_numba() -> None:
    text = "import sys, atmoref.elementary, atmoref.store; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", text], check=False).returncode == 0
