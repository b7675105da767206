"""Kernels that apply every lane operation to arrays, one result row after the other."""

import numpy as np
from numba import types

from atmoref._jit import device, kernel
from atmoref.lanes import (
    F32,
    F64,
    I32,
    MASK,
    N,
    absolute,
    add_to_exact,
    compiled_only,
    convert,
    copy_sign,
    exponent,
    floor,
    fma,
    from_int,
    gather,
    gather_near,
    gather_pair,
    gather_pair_near,
    iota,
    lane_not,
    lerp_bytes,
    lift,
    load,
    maximum,
    minimum,
    overload,
    pixels,
    power_of_two,
    rint,
    round_int,
    select,
    shift_right,
    significand,
    spread_int,
    sqrt,
    square,
    store,
    to_int,
)

INT = np.int32


@device
def flag(mask):
    """Return a mask as 0 and 1."""
    return select(mask, spread_int(INT(1)), spread_int(INT(0)))


@kernel
def real_rows(x, y, z, out):
    """Arithmetic of real lanes; see `REAL` for the rows."""
    n = x.size
    for i in range(0, n, N):
        a, b, c = load(x, i), load(y, i), load(z, i)
        d = a
        d += b
        d -= 0.25
        d *= b
        d /= 3
        rows = (
            a + b, a - b, a * b, a / b, -a, +a, 0.5 - a, 2 * a, 1 / a, a - 0.1, d,
            minimum(a, b), maximum(a, b), minimum(a, 0.0), maximum(0.0, a),
            absolute(a), square(a), rint(a), floor(a), sqrt(a), copy_sign(a, b), copy_sign(1.0, b),
            select(a < b, a, b), select(a < b, a, 0.5), select(True, 0.1, a), select(n < 0, a, b),
            fma(a, b, c), fma(a, 3.0, 0.1),
        )  # fmt: skip
        for k, row in enumerate(rows):
            store(out, k * n + i, row)


@kernel
def test_rows(x, y, out):
    """Comparisons and masks; see `TESTS` for the rows."""
    n = x.size
    for i in range(0, n, N):
        a, b = load(x, i), load(y, i)
        p, q = a < b, a < 0.5
        rows = (
            p, a <= b, a > b, a >= b, a == b, a != b, a != a, a > 0.5, q,
            p & q, p | q, p ^ q, ~p, lane_not(q), p & True, q | False,
        )  # fmt: skip
        for k, row in enumerate(rows):
            store(out, k * n + i, flag(row))


@kernel
def integer_rows(x, y, out):
    """int32 lanes; see `INTEGER` for the rows."""
    n = x.size
    for i in range(0, n, N):
        a, b = load(x, i), load(y, i)
        k = b & 31
        rows = (
            a + b, a - b, a * b, -a, ~a, 7 - a, a * 3, a & b, a | b, a ^ b, a & 255,
            a << k, a >> k, shift_right(a, k), a << 3, a >> 5, shift_right(a, 5),
            minimum(a, b), maximum(a, b), minimum(a, 9), maximum(-9, a), absolute(a), square(a),
            select(a < b, a, b), select(a == b, 1, b), flag(a != b), flag(a >= 3), flag(a <= b), flag(a > b),
            iota(INT(i)), spread_int(i),
        )  # fmt: skip
        for r, row in enumerate(rows):
            store(out, r * n + i, row)


@kernel
def blend_bytes(p, q, weight, out):
    """Write lerp_bytes of two packed channels with one weight for all."""
    w = spread_int(weight * 0x10001)
    for i in range(0, p.size, N):
        store(out, i, lerp_bytes(load(p, i), load(q, i), w))


@kernel
def conversion_rows(arith, x, k, real, whole):
    """Between reals and integers; see `test_lanes_operations`."""
    n = x.size
    for i in range(0, n, N):
        a, b = load(x, i), load(k, i)
        for r, row in enumerate((lift(arith, b), from_int(a, b), lift(arith, i), pixels(arith, INT(i)))):
            store(real, r * n + i, row)
        small = absolute(a)
        for r, row in enumerate((power_of_two(a, b & 63), significand(small))):
            store(real, (r + 4) * n + i, row)
        for r, row in enumerate((to_int(a), round_int(a), exponent(small))):
            store(whole, r * n + i, row)


@kernel
def cast(x, single, double):
    """Write real lanes in both precisions."""
    for i in range(0, x.size, N):
        store(single, i, convert(types.float32, load(x, i)))
        store(double, i, convert(types.float64, load(x, i)))


@kernel
def fetch(table, index, out, first, second):
    """Write table[index], then both results of gather_pair."""
    for i in range(0, index.size, N):
        at = load(index, i)
        store(out, i, gather(table, at))
        low, high = gather_pair(table, at)
        store(first, i, low)
        store(second, i, high)


@kernel
def fetch_near(table, index, out, first, second):
    """Write what `fetch` writes, by the functions that look for neighbours."""
    for i in range(0, index.size, N):
        at = load(index, i)
        store(out, i, gather_near(table, at))
        low, high = gather_pair_near(table, at)
        store(first, i, low)
        store(second, i, high)


@kernel
def scale_codes(codes, a, b, out):
    """Write codes a + codes b, by a product that is exact."""
    for i in range(0, codes.size, N):
        c = load(codes, i)
        store(out, i, add_to_exact(c, a, c * b))


@kernel
def move(source, target, shift):
    """Load at any alignment, store at another."""
    for i in range(0, target.size - 32, N):
        store(target, i + shift, load(source, i + 1))


@kernel
def read_registers(source, target):
    """Write what `load` puts into registers."""
    for i in range(0, source.size, N):
        store(target, i, load(source, i))


@compiled_only
def kind_of(x):
    """Return the name of a lane's type."""


@overload(kind_of)
def _kind_of(x):
    name = {F32: "F32", F64: "F64", I32: "I32", MASK: "MASK"}.get(x, "other")
    return lambda x: name
