"""Every operation of intervals encloses what a float32 device may compute, and widens no more than it says."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import lane_operations as kernels
import mpmath
import numpy as np
import pytest

from atmoref.lanes import Interval, N
from atmoref.lanes.interval_functions import ATAN2_ULP, LOG_ABSOLUTE, LOG_ULP, TRIGONOMETRIC_ABSOLUTE
from atmoref.lanes.intervals import DIVISION_ULP, SQRT_ULP

F = np.float32
EXACT = Interval(0.0, 0.0, 0.0)
ROWS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "a + b": lambda a, b, c: a + b,
    "a - b": lambda a, b, c: a - b,
    "a * b": lambda a, b, c: a * b,
    "a / b": lambda a, b, c: a / b,
    "-a": lambda a, b, c: -a,
    "+a": lambda a, b, c: a,
    "0.5 - a": lambda a, b, c: F(0.5) - a,
    "2 * a": lambda a, b, c: a + a,
    "1 / b": lambda a, b, c: F(1) / b,
    "a - 0.1": lambda a, b, c: a - F(0.1),
    "in place": lambda a, b, c: (a + b - F(0.25)) * b / F(3),
    "minimum": lambda a, b, c: np.minimum(a, b),
    "maximum": lambda a, b, c: np.maximum(a, b),
    "minimum(a, 0)": lambda a, b, c: np.minimum(a, F(0)),
    "maximum(0, a)": lambda a, b, c: np.maximum(a, F(0)),
    "absolute": lambda a, b, c: np.abs(a),
    "square": lambda a, b, c: a * a,
    "rint": lambda a, b, c: np.rint(a),
    "floor": lambda a, b, c: np.floor(a),
    "sqrt": lambda a, b, c: np.sqrt(np.abs(a)),
    "exp": lambda a, b, c: np.exp(a.astype(np.float64)),
    "log": lambda a, b, c: np.log(np.abs(b).astype(np.float64)),
    "sin": lambda a, b, c: np.sin(a.astype(np.float64)),
    "cos": lambda a, b, c: np.cos(a.astype(np.float64)),
    "atan2": lambda a, b, c: np.arctan2(a.astype(np.float64), b.astype(np.float64)),
    "atan2(a, 1)": lambda a, b, c: np.arctan(a.astype(np.float64)),
    "saturate": lambda a, b, c: np.clip(a, F(0), F(1)),
    "select": lambda a, b, c: np.where(a < b, a, c),
    "select weak": lambda a, b, c: np.where(a <= F(0.5), b, F(0.5)),
    "select true": lambda a, b, c: np.full_like(a, 0.1),
    "select uniform": lambda a, b, c: b,
    "fma": lambda a, b, c: (a.astype(np.float64) * b + c).astype(F),
    "lift": lambda a, b, c: F(0.1) * a,
    "pixels": lambda a, b, c: np.arange(a.shape[-1], dtype=F) + F(0.5) + a * F(0),
    "barycentric": lambda a, b, c: a + F(0.25) * (b - a) + F(0.5) * (c - a),
}
TESTS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "<": lambda a, b, w: a < b,
    "<=": lambda a, b, w: a <= b,
    ">": lambda a, b, w: a > b,
    ">=": lambda a, b, w: a >= b,
    "==": lambda a, b, w: a == b,
    "!=": lambda a, b, w: a != b,
    "< 0.5": lambda a, b, w: a < F(0.5),
    "&": lambda a, b, w: (a < b) & (a < F(0.5)),
    "|": lambda a, b, w: (a < b) | (a < F(0.5)),
    "^": lambda a, b, w: (a < b) ^ (a < F(0.5)),
    "~": lambda a, b, w: ~(a < b),
    "lane_not": lambda a, b, w: ~(a < F(0.5)),
    "& mask": lambda a, b, w: (a < b) & w,
    "mask |": lambda a, b, w: w | (a < F(0.5)),
}
Ends = tuple[np.ndarray, np.ndarray]


def _special() -> np.ndarray:
    edges = [0.0, 0.5, 1.0, 1.5, 2.5, 0.1, 3.0, 88.0, 1e-20, 1e20, 2.0**-126, 2.0**-149, 2.0**23 + 1, 255.0, 254.5]
    return np.array([s * v for v in edges for s in (1, -1)], F)


def _intervals(seed: int, width: float, size: int = 4096) -> tuple[Ends, Ends, Ends]:
    """Return three operands: special values, then random ones of many sizes; width 0 gives points."""
    rng = np.random.default_rng(seed)
    operands = []
    for _ in range(3):
        centre = (rng.uniform(-8.0, 8.0, size) * 2.0 ** rng.integers(-8, 4, size)).astype(F)
        centre[: size // 4] = rng.choice(_special(), size // 4)
        spread = (np.abs(centre) * rng.uniform(0.0, width, size)).astype(F)
        spread[size // 4 : size // 2] *= F(1e-6)
        operands.append((centre - spread, centre + spread))
    return operands[0], operands[1], operands[2]


def _run(seed: int, width: float) -> tuple[tuple[Ends, Ends, Ends], dict[str, Ends]]:
    operands = _intervals(seed, width)
    n = operands[0][0].size
    out = (np.zeros(len(ROWS) * n, F), np.zeros(len(ROWS) * n, F))
    kernels.interval_rows(EXACT, *operands, out)
    return operands, {name: (out[0].reshape(-1, n)[k], out[1].reshape(-1, n)[k]) for k, name in enumerate(ROWS)}


def _samples(seed: int, operands: tuple[Ends, ...]) -> list[np.ndarray]:
    """Return float32 numbers within the operands, ends among them, (samples, n)."""
    rng = np.random.default_rng(seed)
    drawn = []
    for low, high in operands:
        part = rng.uniform(0.0, 1.0, (24, low.size))
        part[:8] = rng.integers(0, 2, (8, low.size))
        inner = (low + part * (high.astype(np.float64) - low)).astype(F)
        drawn.append(np.clip(inner, low, high))
    return drawn


@pytest.mark.parametrize("width", [0.0, 0.3])
@pytest.mark.parametrize("name", ROWS)
def test_every_operation_encloses_what_float32_computes(name: str, width: float) -> None:
    operands, results = _run(5, width)
    low, high = results[name]
    with np.errstate(all="ignore"):
        value = ROWS[name](*_samples(6, operands))
    told = ~np.isnan(value)  # of 0/0 and the like nothing is told
    assert ((value >= low) & (value <= high) | ~told)[np.isfinite(value) | told].all()
    assert (low <= high).all()


def _below(x: np.ndarray) -> np.ndarray:
    return np.nextafter(x, F(-np.inf))


def test_sums_and_products_take_in_both_neighbours_and_the_exact_product() -> None:
    """Correctly rounded in an untold direction, fused or not: exact rationals beside both ends."""
    ((a, _), (b, _), _), results = _run(9, 0.0)
    for name, exact in (("a + b", lambda x, y: x + y), ("a - b", lambda x, y: x - y), ("a * b", lambda x, y: x * y)):
        low, high = results[name]
        for i in range(0, a.size, 3):
            true = exact(Fraction(float(a[i])), Fraction(float(b[i])))
            if abs(true) > 2**127:
                continue
            assert Fraction(float(low[i])) <= true <= Fraction(float(high[i])), (name, a[i], b[i])
            if low[i] == high[i]:
                assert Fraction(float(low[i])) == true
            elif abs(true) > Fraction(2) ** -120:  # the two neighbours, no more
                assert _below(high[i]) == low[i], (name, a[i], b[i])


def test_codes_stay_exact() -> None:
    codes = np.arange(1 << 16, dtype=F)
    y = np.full_like(codes, 0.5)
    out = (np.zeros(len(ROWS) * codes.size, F), np.zeros(len(ROWS) * codes.size, F))
    kernels.interval_rows(EXACT, (codes, codes), (y, y), (y, y), out)
    rows = [end.reshape(-1, codes.size) for end in out]
    for k, name in enumerate(ROWS):
        if name in ("a + b", "a - b", "a * b", "-a", "2 * a", "rint", "floor", "minimum", "maximum"):
            np.testing.assert_array_equal(rows[0][k], rows[1][k], name)


def _ulp(x: np.ndarray) -> np.ndarray:
    return np.spacing(np.abs(x).astype(F)).astype(np.float64)


@pytest.mark.parametrize(
    ("name", "ulps"), [("a / b", DIVISION_ULP), ("1 / b", DIVISION_ULP), ("sqrt", 4.5)], ids=["a/b", "1/b", "sqrt"]
)
def test_division_and_root_leave_room_for_what_is_permitted(name: str, ulps: float) -> None:
    """4.5 ulp: 2.5 of 1 / x after 2 of inversesqrt."""
    ((a, _), (b, _), _), results = _run(11, 0.0)
    low, high = (end.astype(np.float64) for end in results[name])
    with np.errstate(all="ignore"):
        true = {"a / b": a / b.astype(np.float64), "1 / b": 1 / b.astype(np.float64)}.get(
            name, np.sqrt(np.abs(a, dtype="f8"))
        )
    usual = np.isfinite(true) & (np.abs(true) < 2.0**126) & (np.abs(true) > 2.0**-120)
    room = ulps * _ulp(true[usual])
    assert (low[usual] <= true[usual] - room).all()
    assert (high[usual] >= true[usual] + room).all()
    assert ((high - low)[usual] <= 2.0 * (2.0 * max(ulps, SQRT_ULP) + 2.0) * _ulp(true[usual])).all()


@pytest.mark.parametrize("name", ["exp", "log", "sin", "cos", "atan2"])
def test_transcendentals_leave_room_for_what_is_permitted(name: str) -> None:
    """Against 40 digits."""
    ((a, _), (b, _), _), results = _run(13, 0.0)
    low, high = results[name]
    with mpmath.workdps(40):
        for i in range(0, a.size, 5):
            x, y = mpmath.mpf(float(a[i])), mpmath.mpf(float(b[i]))
            if name == "exp" and abs(x) < 80:
                true, room = mpmath.exp(x), (3 + 2 * abs(x)) * mpmath.mpf(2) ** -23 * mpmath.exp(x) / 2
            elif name == "log" and y != 0:
                true = mpmath.log(abs(y))
                room = LOG_ULP * mpmath.mpf(2) ** -24 * abs(true)
                room = LOG_ABSOLUTE if 0.5 <= abs(y) <= 2.0 else room
            elif name in ("sin", "cos") and abs(x) < 1e6:
                true, room = getattr(mpmath, name)(x), TRIGONOMETRIC_ABSOLUTE
            elif name == "atan2" and not (x == 0 and y <= 0):
                true = mpmath.atan2(x, y)
                room = ATAN2_ULP * mpmath.mpf(2) ** -24 * abs(true)
            else:
                continue
            allowed = [true - room, true + room]
            if name in ("sin", "cos"):
                allowed = [max(allowed[0], -1), min(allowed[1], 1)]
            assert float(low[i]) <= allowed[0], (name, a[i], b[i])
            assert allowed[1] <= float(high[i]), (name, a[i], b[i])


@pytest.mark.parametrize("name", TESTS)
def test_comparisons_are_certain_only_where_all_agree(name: str) -> None:
    x, y, _ = _intervals(17, 0.5)
    n = x[0].size
    out, totals = (np.zeros(len(TESTS) * n, F), np.zeros(len(TESTS) * n, F)), np.zeros((n // N, 3), np.int64)
    kernels.test_rows(x, y, out, totals)
    k = list(TESTS).index(name)
    certain, possible = out[0].reshape(-1, n)[k] == 1.0, out[1].reshape(-1, n)[k] == 1.0
    a, b = _samples(18, (x, y))
    found = TESTS[name](a, b, x[0] < x[1])
    assert (found | ~certain).all()
    assert (~found | possible).all()
    assert (certain | ~possible).mean() > 0.3  # most are decided
    points = (x[0] == x[1]) & (y[0] == y[1])
    np.testing.assert_array_equal(certain[points], possible[points])
    if name == "<":
        waves = possible.reshape(-1, N)
        np.testing.assert_array_equal(totals[:, 0], waves.any(1))
        np.testing.assert_array_equal(totals[:, 1], certain.reshape(-1, N).all(1))
        np.testing.assert_array_equal(totals[:, 2], waves.sum(1))


def test_undecided_integers_are_ranges_and_gather_the_hull() -> None:
    x, y, _ = _intervals(19, 0.5, 512)
    table = np.array([9.0, 3.0, 9.0, 7.0, 9.0, 5.0], F)
    out, middle = (np.zeros(512, F), np.zeros(512, F)), np.zeros(512)
    kernels.choices(EXACT, x, y, table, out, middle)
    a, b = _samples(20, (x, y))
    found = np.full(a.shape, -1)
    for k in range(3):
        found = np.where(a < b + F(k), k, found)
    value = np.where(found >= 0, table[np.maximum(found, 0) * 2 + 1], -1.0)
    assert ((value >= out[0]) & (value <= out[1])).all()
    same = (x[0] == x[1]) & (y[0] == y[1]) & (np.abs(x[0]) < 1e6) & (np.abs(y[0]) < 1e6) & (np.abs(y[0]) > 1e-3)
    np.testing.assert_array_equal(out[0][same], out[1][same])
    assert ((middle >= x[0]) & (middle <= x[1])).all()


def test_division_by_what_may_be_zero_may_be_anything() -> None:
    x = (np.full(N, 1.0, F), np.full(N, 2.0, F))
    y = (np.full(N, -1e-3, F), np.full(N, 1e-3, F))
    out = (np.zeros(len(ROWS) * N, F), np.zeros(len(ROWS) * N, F))
    kernels.interval_rows(EXACT, x, y, y, out)
    k = list(ROWS).index("a / b")
    assert np.isneginf(out[0].reshape(-1, N)[k]).all()
    assert np.isposinf(out[1].reshape(-1, N)[k]).all()
