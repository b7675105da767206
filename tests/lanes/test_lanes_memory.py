"""Loads, stores and gathers of every element type; types and refusals."""

from typing import NamedTuple

import lane_kernels
import numba
import numpy as np
import pytest
from lane_kernels import kind_of
from numba.core.errors import TypingError

from atmoref import lanes
from atmoref._jit import kernel
from atmoref.buffers.device import DEVICES, decode_factors
from atmoref.buffers.formats import FORMATS
from atmoref.lanes import (
    Double,
    N,
    Single,
    all_lanes,
    any_lane,
    count_lanes,
    exp,
    first_lane,
    gather,
    gather_near,
    iota,
    lift,
    load,
    maximum,
    minimum,
    pixels,
    saturate,
    select,
    sqrt,
    square,
    store,
    sum_lanes,
)

ELEMENTS = [np.uint8, np.uint16, np.uint32, np.int32, np.float32, np.float64]


def content(kind: type, size: int) -> np.ndarray:
    """Return values over the whole range of a type."""
    rng = np.random.default_rng(13)
    if np.issubdtype(kind, np.integer):
        info = np.iinfo(kind)
        return rng.integers(info.min, info.max, size, dtype=kind, endpoint=True)
    return rng.normal(0, 1e6, size).astype(kind)


def registers(kind: type) -> type:
    """Return the type in which lanes hold an element."""
    return np.int32 if np.issubdtype(kind, np.unsignedinteger) else kind


@pytest.mark.parametrize("kind", ELEMENTS)
def test_gathers(kind: type) -> None:
    table = content(kind, 1001)
    table.flags.writeable = False
    index = np.random.default_rng(17).integers(0, 1000, 640, dtype=np.int32)
    index[:4] = [0, 999, 0, 999]
    out, first, second = (np.empty(index.size, registers(kind)) for _ in range(3))
    lane_kernels.fetch(table, index, out, first, second)
    expected = table.astype(registers(kind))
    np.testing.assert_array_equal(out, expected[index])
    np.testing.assert_array_equal(first, expected[index])
    np.testing.assert_array_equal(second, expected[index + 1])


@pytest.mark.parametrize("size", [3, N, 2 * N - 1, 2 * N + 1, 4 * N - 1, 4 * N, 4 * N + 1, 1001])
@pytest.mark.parametrize("kind", ELEMENTS)
def test_gathers_from_neighbours(kind: type, size: int) -> None:
    """Every width of a wave's footprint up to more than 4 N, rising, falling, mixed, one lane astray, at both ends."""
    table, rng = content(kind, size), np.random.default_rng(23)
    waves = []
    for width in range(1, min(4 * N + 3, size)):
        for start in {0, (size - 1 - width) // 2, size - 1 - width}:
            lanes = np.sort(rng.integers(0, width, N))
            lanes[[0, -1]] = 0, width - 1
            astray = lanes.copy()
            astray[N // 2] = size - 2 - start
            other = lanes.copy()
            other[N // 2] = -start  # before the first and the last lane
            waves += [start + w for w in (lanes, lanes[::-1], rng.permutation(lanes), astray, other)]
    index = np.concatenate(waves).astype(np.int32)
    assert index.min() >= 0
    assert index.max() == size - 2
    out, first, second = (np.empty(index.size, registers(kind)) for _ in range(3))
    lane_kernels.fetch_near(table, index, out, first, second)
    expected = table.astype(registers(kind))
    np.testing.assert_array_equal(out, expected[index])
    np.testing.assert_array_equal(first, expected[index])
    np.testing.assert_array_equal(second, expected[index + 1])


@pytest.mark.parametrize("bits", [8, 16])
def test_sums_with_an_exact_product_are_rounded_as_two_operations(bits: int) -> None:
    codes = np.arange(1 << bits, dtype=np.float32)
    a, b = (np.float32(f) for f in decode_factors(FORMATS[f"unorm{bits}"], DEVICES["ideal"]))
    np.testing.assert_array_equal((codes * a).astype(np.float64), codes.astype(np.float64) * np.float64(a))
    out = np.empty_like(codes)
    lane_kernels.scale_codes(codes, a, b, out)
    np.testing.assert_array_equal(out, codes * a + codes * b)


@pytest.mark.parametrize("kind", ELEMENTS)
def test_loads_and_stores_at_any_alignment(kind: type) -> None:
    source = content(kind, 1024 + 1)
    for shift in (0, 1, 3):
        target = np.zeros(1024, kind)
        lane_kernels.move(source, target, shift)
        moved = target.size - 32
        np.testing.assert_array_equal(target[shift : shift + moved], source[1 : 1 + moved])
        assert not target[:shift].any()
        assert not target[shift + moved :].any()
    held = np.empty(1024, registers(kind))
    lane_kernels.read_registers(source[:1024], held)
    np.testing.assert_array_equal(held, source[:1024].astype(registers(kind)))


def test_small_codes_are_stored_by_their_low_bits() -> None:
    source = content(np.int32, 256)
    for kind in (np.uint8, np.uint16, np.uint32):
        target = np.empty(256, kind)
        lane_kernels.read_registers(source, target)
        np.testing.assert_array_equal(target, source.astype(kind))


# ---- masks in numbers
@kernel
def census(x, limit, out):
    """Write per register: any, all, count."""
    for r in range(x.size // N):
        m = load(x, r * N) < limit
        out[r, 0], out[r, 1], out[r, 2] = any_lane(m), all_lanes(m), count_lanes(m)


def test_masks_are_counted() -> None:
    x = np.repeat(np.arange(33), N).reshape(33, N) + np.arange(N) * np.array([[0]] * 16 + [[1]] * 17)
    x = x.astype(np.float32)
    for limit in (-1.0, 0.5, 7.0, 20.0, 99.0):
        below = x < limit
        expected = np.stack([below.any(1), below.all(1), below.sum(1)], 1)
        out = np.empty((33, 3), np.int64)
        census(x.ravel(), limit, out)
        np.testing.assert_array_equal(out, expected)


# ---- integers of a wave
@kernel
def whole_waves(x, out):
    """Write per register: the first lane, the sum."""
    for r in range(x.size // N):
        lane = load(x, r * N)
        out[r, 0], out[r, 1] = first_lane(lane), sum_lanes(lane)


def test_first_lane_and_sum() -> None:
    x = np.random.default_rng(5).integers(-(2**26), 2**26, (40, N), np.int32)
    out = np.empty((40, 2), np.int64)
    whole_waves(x.ravel(), out)
    np.testing.assert_array_equal(out, np.stack([x[:, 0], x.sum(1, dtype=np.int64)], 1))


# ---- types
class Uniforms(NamedTuple):
    """Numbers, a flag, an absent table and nested tuples."""

    scale: float
    whole: int
    flag: bool
    table: object
    inner: tuple


@numba.njit(error_model="numpy")  # returns a list, for which kernels have no memory
def types_of(arith, x, u):
    """Return the types of expressions in which literals and uniforms stand."""
    a = lift(arith, load(x, 0))
    c = lift(arith, u)
    b = (1.0 - a) * 0.5 + 2 / square(a) - np.pi
    b = select(a > 0.1, maximum(minimum(b, 1), 0.0), 0.5)
    kinds = [kind_of(a), kind_of(b), kind_of(saturate(sqrt(b))), kind_of(c.scale), kind_of(c.whole)]
    kinds += [kind_of(c.inner[0]), kind_of(c.inner[1][0]), kind_of(pixels(arith, 0) + a), kind_of(exp(a * u.scale))]
    kinds += [kind_of(lift(arith, iota(3)) + 0.5), kind_of(a * u.whole + u.scale)]
    return kinds, c.flag, c.table is None, kind_of(a != a), kind_of(iota(0) * 2 + 1)


@pytest.mark.parametrize(("arith", "name"), [(Single(), "F32"), (Double(), "F64")])
@pytest.mark.parametrize("stored", [np.float32, np.float64, np.uint8])
def test_literals_and_uniforms_never_decide_the_precision(arith, name, stored) -> None:
    uniforms = Uniforms(0.1, 3, True, None, (0.2, (1, 2.5)))
    kinds, flag, absent, mask, whole = types_of(arith, np.ones(N, stored), uniforms)
    assert set(kinds) == {name}
    assert (flag, absent, mask, whole) == (True, True, "MASK", "I32")


@kernel
def lifted(arith, x, u, out):
    """Write the numbers of lifted uniforms, lanes of the other precision among them."""
    c = lift(arith, u)
    for i, v in enumerate((c.scale, c.whole, c.inner[0], c.inner[1][0], c.inner[1][1], lift(arith, load(x, 0)))):
        store(out, i * N, v)


def test_lift_rounds_to_nearest() -> None:
    uniforms = Uniforms(0.1, 16777217, False, None, (1e-46, (3, 1e39)))
    for arith, kind in ((Single(), np.float32), (Double(), np.float64)):
        out = np.empty(6 * N, kind)
        lifted(arith, np.full(N, 1 / 3), uniforms, out)
        with np.errstate(all="ignore"):
            expected = np.array([0.1, 16777217, 1e-46, 3, 1e39, 1 / 3]).astype(kind)
        np.testing.assert_array_equal(out, np.repeat(expected, N))


# ---- refusals
def refused(body, *arguments) -> str:
    """Return the message with which a kernel fails to compile."""
    with pytest.raises(TypingError) as caught:
        kernel(body)(*arguments)
    return str(caught.value)


def test_wrong_types_are_refused_at_compile_time() -> None:
    single, double, whole = np.zeros(N, np.float32), np.zeros(N), np.zeros(N, np.int32)
    assert "No implementation" in refused(lambda x, y: any_lane(load(x, 0) + load(y, 0) > 0), single, double)
    assert "No implementation" in refused(lambda x: any_lane((load(x, 0) > 0) + 1), single)
    assert "No implementation" in refused(lambda k: any_lane(load(k, 0) + 0.5 > 0), whole)
    assert "at least one lane" in refused(lambda x: any_lane(select(load(x, 0) > 0, 1.0, 0.0) > 0), single)
    assert "int32 lane of indices" in refused(lambda x: any_lane(gather(x, load(x, 0)) > 0), single)
    assert "int32 lane of indices" in refused(lambda x: any_lane(gather_near(x, load(x, 0)) > 0), single)
    assert "C-contiguous" in refused(lambda x: any_lane(load(x, 0) > 0), np.zeros((N, N)))
    assert "C-contiguous" in refused(lambda x: any_lane(load(x, 0) > 0), np.zeros(64)[::2])
    assert "C-contiguous" in refused(lambda x: any_lane(load(x, 0) > 0), np.zeros(N, np.int64))
    assert "store takes" in refused(lambda x, y: store(y, 0, load(x, 0)), double, single)
    constant = np.zeros(N)
    constant.flags.writeable = False
    assert "writable" in refused(lambda x, y: store(y, 0, load(x, 0)), double, constant)
    assert "lift takes" in refused(lambda arith, x: lift(arith, x), Single(), single)
    assert "No implementation" in refused(lambda x: lift(3, x), 1.0)
    assert "exp" in refused(lambda k: any_lane(exp(load(k, 0)) > 0), whole)


def test_public_functions_raise_outside_kernels() -> None:
    plain = {
        "N",
        "Lane",
        "Single",
        "Double",
        "Interval",
        "compiled_only",
        "overload",
        "is_lane",
        "is_real",
        "is_tag",
        "saturate",
    }
    names = [n for n in lanes.__all__ if n not in plain and not n.isupper()]
    assert len(names) > 35
    for name in names:
        with pytest.raises(TypeError, match="only in compiled kernels"):
            getattr(lanes, name)(1.0)


def test_kernels_have_no_python_twin() -> None:
    with pytest.raises(TypeError, match="only in compiled kernels"):
        census.py_func(np.zeros(N, np.float32), 0.5, None)
