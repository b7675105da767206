# mypy: allow-untyped-defs, allow-untyped-calls
# (Numba and llvmlite are untyped)
"""Single instructions on lanes, each one LLVM operation or a few; `arith.py` gives the general names to some of them.

Every function here rounds at most once and gives the same bits on every processor.
"""

from typing import Any

from llvmlite import ir
from numba import types

from atmoref.lanes.registers import (
    F32,
    F64,
    I32,
    INT32,
    INT64,
    MASK,
    Lane,
    N,
    call_llvm,
    common,
    constant,
    instruction,
    is_lane,
    is_real,
    refuse,
    splat,
    spread,
    vector,
    weak,
)


def _suffix(kind: ir.VectorType) -> str:
    """Return how LLVM's overloaded intrinsics name a vector type: v16f32."""
    letter = {"float": "f32", "double": "f64"}.get(str(kind.element), str(kind.element))
    return f"v{kind.count}{letter}"


def _of_one_real(name: str) -> Any:
    """Return a function of one real lane that LLVM has under `name`."""

    def lane_function(typing: Any, x: Any) -> Any:
        if not is_real(x):
            return None
        return x(x), lambda ctx, b, sig, a: call_llvm(b, f"llvm.{name}.{_suffix(a[0].type)}", a[0].type, list(a))

    lane_function.__name__ = f"lane_{name}"
    return instruction(lane_function)


lane_rint, lane_floor, lane_sqrt, lane_abs = (_of_one_real(n) for n in ("rint", "floor", "sqrt", "fabs"))


def _extremum(name: str, sign: str) -> Any:
    """Return the minimum or maximum as x86 has it."""

    def extremum(typing: Any, x: Any, y: Any) -> Any:
        lane = common(x, y)
        if lane is None or lane == MASK:
            return None

        def emit(ctx: Any, b: Any, sig: Any, args: Any) -> Any:
            x, y = spread(b, sig, args)
            return b.select(b.fcmp_ordered(sign, x, y) if is_real(lane) else b.icmp_signed(sign, x, y), x, y)

        return lane(*weak(lane, x, y)), emit

    extremum.__name__ = name
    return instruction(extremum)


lane_min, lane_max = _extremum("lane_min", "<"), _extremum("lane_max", ">")


@instruction
def lane_abs_int(typing: Any, x: Any) -> Any:
    """Return |x| of an int32 lane; -2**31 stays."""

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        return b.select(b.icmp_signed("<", a[0], constant(a[0].type, 0)), b.neg(a[0]), a[0])

    return (I32(I32), emit) if x == I32 else None


@instruction
def lane_select(typing: Any, test: Any, x: Any, y: Any) -> Any:
    """Return x where test, else y; a scalar test is uniform."""
    lane = common(x, y)
    if lane is None or not (test == MASK or isinstance(test, types.Boolean)):
        raise refuse("select takes a mask or a boolean, then at least one lane and values of its type", test, x, y)
    where = test if test == MASK else types.boolean

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        return b.select(a[0], *[v if is_lane(t) else splat(b, v) for v, t in zip(a[1:], sig.args[1:], strict=True)])

    return lane(where, *weak(lane, x, y)), emit


# ---- masks
def _bits(b: Any, mask: ir.Value) -> ir.Value:
    return b.bitcast(mask, ir.IntType(N))


@instruction
def lane_any(typing: Any, mask: Any) -> Any:
    """Tell whether a mask is set in any lane."""
    emit = lambda ctx, b, sig, a: b.icmp_unsigned("!=", _bits(b, a[0]), ir.IntType(N)(0))
    return (types.boolean(MASK), emit) if mask == MASK else None


@instruction
def lane_all(typing: Any, mask: Any) -> Any:
    """Tell whether a mask is set in every lane."""
    emit = lambda ctx, b, sig, a: b.icmp_unsigned("==", _bits(b, a[0]), ir.IntType(N)(-1))
    return (types.boolean(MASK), emit) if mask == MASK else None


@instruction
def lane_not(typing: Any, mask: Any) -> Any:
    """Return the opposite of a mask (`~mask` is the same)."""
    return (MASK(MASK), lambda ctx, b, sig, a: b.not_(a[0])) if mask == MASK else None


@instruction
def lane_count(typing: Any, mask: Any) -> Any:
    """Return in how many lanes a mask is set, int64."""
    emit = lambda ctx, b, sig, a: call_llvm(b, "llvm.ctpop.i64", INT64, [b.zext(_bits(b, a[0]), INT64)])
    return (types.int64(MASK), emit) if mask == MASK else None


@instruction
def sum_lanes(typing: Any, x: Any) -> Any:
    """Return the sum of an int32 lane, int32."""
    if x != I32:
        raise refuse("sum_lanes takes an int32 lane", x)
    return types.int32(I32), lambda ctx, b, sig, a: call_llvm(b, f"llvm.vector.reduce.add.v{N}i32", INT32, [a[0]])


@instruction
def first_lane(typing: Any, x: Any) -> Any:
    """Return the int32 of the first lane, uniform over the wave."""
    if x != I32:
        raise refuse("first_lane takes an int32 lane", x)
    return types.int32(I32), lambda ctx, b, sig, a: b.extract_element(a[0], INT32(0))


# ---- conversions
@instruction
def to_int(typing: Any, x: Any) -> Any:
    """Round a real lane towards zero to int32; outside int32 (and for NaN) the result is unspecified: clamp first."""
    return (I32(x), lambda ctx, b, sig, a: b.fptosi(a[0], vector(types.int32))) if is_real(x) else None


@instruction
def round_int(typing: Any, x: Any) -> Any:
    """Round a real lane to the nearest int32, ties to even, by one addition of 1.5 * 2**23 (2**52).

    Valid for |x| < 2**22 (float32) or 2**31 (float64); outside the result is some integer.
    """
    if not is_real(x):
        return None
    whole, wide = vector(types.int32), ir.VectorType(INT64, N)

    def single(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        return b.sub(b.bitcast(b.fadd(a[0], constant(a[0].type, 12582912.0)), whole), constant(whole, 0x4B400000))

    def double(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        return b.trunc(b.bitcast(b.fadd(a[0], constant(a[0].type, 6755399441055744.0)), wide), whole)

    return I32(x), single if x == F32 else double


@instruction
def convert(typing: Any, element: Any, x: Any) -> Any:
    """Return a lane (or a scalar, spread) as lanes of `element`, numba.float32 or numba.float64; rounds to nearest."""
    target = element.dtype if isinstance(element, types.NumberClass) else element.instance_type
    out = Lane(target)
    if not is_real(out) or x == MASK or not (is_lane(x) or isinstance(x, types.Number | types.Boolean)):
        raise refuse("convert takes float32 or float64, then a number or a lane of numbers", element, x)

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        if not is_lane(x):
            return splat(b, a[1])
        if x == I32:
            return b.sitofp(a[1], vector(target))
        if x == out:
            return a[1]
        return b.fpext(a[1], vector(target)) if out == F64 else b.fptrunc(a[1], vector(target))

    return out(element, x if is_lane(x) else target), emit


@instruction
def spread_int(typing: Any, x: Any) -> Any:
    """Return an integer scalar in every lane, as int32."""
    if not isinstance(x, types.Integer):
        return None
    return I32(types.int32), lambda ctx, b, sig, a: splat(b, a[0])


@instruction
def iota(typing: Any, start: Any) -> Any:
    """Return start, start + 1, ... as int32."""
    if not isinstance(start, types.Integer):
        return None
    steps = ir.Constant(vector(types.int32), list(range(N)))
    return I32(types.int32), lambda ctx, b, sig, a: b.add(splat(b, a[0]), steps)


# ---- parts of a float
def _layout(lane: Lane) -> tuple[ir.VectorType, int, int]:
    """Return the integer vector, exponent bias and mantissa bits of a real lane."""
    bits, bias, mantissa = (INT32, 127, 23) if lane == F32 else (INT64, 1023, 52)
    return ir.VectorType(bits, N), bias, mantissa


@instruction
def power_of_two(typing: Any, like: Any, k: Any) -> Any:
    """Return 2**k in the type of `like`; k is an int32 lane within the normal exponents."""
    if not is_real(like) or k != I32:
        return None
    kind, bias, mantissa = _layout(like)

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        wide = a[1] if kind.element == INT32 else b.sext(a[1], kind)
        return b.bitcast(b.shl(b.add(wide, constant(kind, bias)), constant(kind, mantissa)), a[0].type)

    return like(like, I32), emit


@instruction
def from_int(typing: Any, like: Any, k: Any) -> Any:
    """Return an int32 lane in the real type of `like`."""
    if not is_real(like) or k != I32:
        return None
    return like(like, I32), lambda ctx, b, sig, a: b.sitofp(a[1], a[0].type)


@instruction
def exponent(typing: Any, x: Any) -> Any:
    """Return the unbiased exponent of a positive normal x, as int32: 2**e <= x < 2**(e + 1)."""
    if not is_real(x):
        return None
    kind, bias, mantissa = _layout(x)

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        e = b.sub(b.lshr(b.bitcast(a[0], kind), constant(kind, mantissa)), constant(kind, bias))
        return e if kind.element == INT32 else b.trunc(e, vector(types.int32))

    return I32(x), emit


@instruction
def significand(typing: Any, x: Any) -> Any:
    """Return x / 2**e in [1, 2) of a positive normal x."""
    if not is_real(x):
        return None
    kind, bias, mantissa = _layout(x)

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        fraction = b.and_(b.bitcast(a[0], kind), constant(kind, (1 << mantissa) - 1))
        return b.bitcast(b.or_(fraction, constant(kind, bias << mantissa)), a[0].type)

    return x(x), emit


@instruction
def copy_sign(typing: Any, size: Any, sign: Any) -> Any:
    """Return |size| with the sign of `sign`, zeros and NaN included."""
    lane = common(size, sign)
    if lane is None or not is_real(lane):
        return None

    def emit(ctx: Any, b: Any, sig: Any, args: Any) -> Any:
        x, y = spread(b, sig, args)
        return call_llvm(b, f"llvm.copysign.{_suffix(x.type)}", x.type, [x, y])

    return lane(*weak(lane, size, sign)), emit


# ---- others
@instruction
def stay_a_call(typing: Any) -> Any:
    """Keep the function that says this from being inlined, which LLVM otherwise does with whatever is small enough.

    For helpers that stand at hundreds of places of a kernel: inlined, they take most of the time of its compilation.
    """

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        b.function.attributes.discard("alwaysinline")  # Numba hands a caller's flag down to what it calls
        b.function.attributes.add("noinline")
        return ctx.get_dummy_value()

    return types.void(), emit


@instruction
def fma(typing: Any, x: Any, y: Any, z: Any) -> Any:
    """Return x y + z rounded once; for devices that fuse, since kernels otherwise never do.

    On processors without the instruction it is a library call per lane: the same bits, slowly.
    """
    lane = common(x, y, z)
    if lane is None or not is_real(lane):
        return None

    def emit(ctx: Any, b: Any, sig: Any, args: Any) -> Any:
        values = spread(b, sig, args)
        return call_llvm(b, f"llvm.fma.{_suffix(values[0].type)}", values[0].type, values)

    return lane(*weak(lane, x, y, z)), emit


@instruction
def add_to_exact(typing: Any, x: Any, y: Any, z: Any) -> Any:
    """Return x y + z where x y is exact: fused where the processor can, with the same bits where it cannot."""
    lane = common(x, y, z)
    if lane is None or not is_real(lane):
        return None

    def emit(ctx: Any, b: Any, sig: Any, args: Any) -> Any:
        first, second, third = spread(b, sig, args)
        return b.fadd(b.fmul(first, second, flags=("contract",)), third, flags=("contract",))

    return lane(*weak(lane, x, y, z)), emit


@instruction
def shift_right(typing: Any, x: Any, k: Any) -> Any:
    """Shift an int32 lane right by k bits, 0 <= k < 32, filling with zeros."""
    lane = common(x, k)
    if x != I32 or lane != I32:
        return None
    return I32(*weak(lane, x, k)), lambda ctx, b, sig, args: b.lshr(*spread(b, sig, args))


@instruction
def lerp_bytes(typing: Any, p: Any, q: Any, w: Any) -> Any:
    """Return p + ((w (q - p) + 128) >> 8) of two 8-bit channels at once.

    Each int32 holds two channels, in bits 0...7 and 16...23; the weight, 0...255, stands in both halves.
    """
    if not p == q == w == I32:
        return None
    half = ir.VectorType(ir.IntType(16), 2 * N)

    def emit(ctx: Any, b: Any, sig: Any, args: Any) -> Any:
        x, y, w = (b.bitcast(v, half) for v in args)
        total = b.add(b.add(b.shl(x, constant(half, 8)), constant(half, 128)), b.mul(w, b.sub(y, x)))
        return b.bitcast(b.lshr(total, constant(half, 8)), args[0].type)

    return I32(I32, I32, I32), emit
