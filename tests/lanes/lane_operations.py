"""Kernels that apply every operation of intervals to arrays, one result row after the other."""

import numpy as np

from atmoref._jit import device, kernel
from atmoref.lanes import (
    N,
    absolute,
    all_lanes,
    any_lane,
    atan2,
    barycentric,
    convert,
    cos,
    count_lanes,
    exp,
    floor,
    fma,
    gather,
    lane_not,
    lift,
    load,
    log,
    maximum,
    minimum,
    nominal,
    pixels,
    rint,
    saturate,
    select,
    sin,
    spread_int,
    sqrt,
    square,
    store,
    whole,
)

INT = np.int32
FLOAT64 = np.float64


@kernel
def interval_rows(arith, x, y, z, out):
    """Functions of reals; see `ROWS` of the tests.  Arguments are pairs of arrays."""
    n = x[0].size
    for i in range(0, n, N):
        a, b, c = load(x, i), load(y, i), load(z, i)
        d = a
        d += b
        d -= 0.25
        d *= b
        d /= 3
        rows = (
            a + b, a - b, a * b, a / b, -a, +a, 0.5 - a, 2 * a, 1 / b, a - 0.1, d,
            minimum(a, b), maximum(a, b), minimum(a, 0.0), maximum(0.0, a), absolute(a), square(a), rint(a), floor(a),
            sqrt(absolute(a)), exp(a), log(absolute(b)), sin(a), cos(a), atan2(a, b), atan2(a, 1.0), saturate(a),
            select(a < b, a, c), select(a <= 0.5, b, 0.5), select(True, 0.1, a), select(n < 0, a, b),
            fma(a, b, c), lift(arith, 0.1) * a, pixels(arith, INT(i)) + a * 0.0,
            barycentric(arith, a, b, c, lift(arith, 0.25), lift(arith, 0.5)),
        )  # fmt: skip
        for k, row in enumerate(rows):
            store(out, k * n + i, row)


@device
def flag(test, x):
    """Return {0, 1, [0, 1]}."""
    return select(test, x * 0.0 + 1.0, 0.0)


@kernel
def test_rows(x, y, out, totals):
    """Comparisons and masks; see `TESTS` of the tests; any, all and count of the first."""
    n = x[0].size
    for i in range(0, n, N):
        a, b = load(x, i), load(y, i)
        p, q, plain = a < b, a < 0.5, x[0].size > 0
        decided = a.lo < a.hi
        rows = (
            p, a <= b, a > b, a >= b, a == b, a != b, q, p & q, p | q, p ^ q, ~p, lane_not(q), p & decided, decided | q,
        )  # fmt: skip
        for k, row in enumerate(rows):
            store(out, k * n + i, flag(row, a))
        if plain:
            totals[i // N, 0] = 1 if any_lane(p) else 0
            totals[i // N, 1] = 1 if all_lanes(p) else 0
            totals[i // N, 2] = count_lanes(p)


@kernel
def choices(arith, x, y, table, out, middle):
    """Write table entries whose index is decided by intervals, and the middle of x."""
    for i in range(0, x[0].size, N):
        a, b = load(x, i), load(y, i)
        found = whole(arith, spread_int(INT(-1)))
        for k in range(3):
            found = select(a < b + k, spread_int(INT(k)), found)
        index = maximum(found, spread_int(INT(0))) * INT(2) + INT(1)
        value = lift(arith, gather(table, index))
        store(out, i, select(found >= spread_int(INT(0)), value, -1.0))
        store(middle, i, convert(FLOAT64, a) + nominal(convert(FLOAT64, a)) * 0.0)
