# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Intervals: the third element of lanes.  A value is a pair of float32 lanes between which every correct device's lies.

What a device computes is a float32 number, so both ends are float32 lanes.  An operation maps them to the ends of all
results that the specifications allow (Vulkan, appendix "Precision and Operation of SPIR-V Instructions"; GLSL 4.60,
section 4.7.1, has the same numbers):

``+ - *``
    correctly rounded, in a direction that is not told: either neighbour of the exact result, and the exact product too,
    since x y + z may be fused.  An exact result is not widened, so codes and half-integers stay what they are.
``/``, ``sqrt``
    `DIVISION_ULP` and `SQRT_ULP`; a division whose divisor may be 0 may be anything.
comparisons
    {all, some, none} lane by lane, as a pair of masks; `select` joins both values where the test is undecided.

Three kinds of pairs: INTERVAL of reals, TRI of masks (certainly, possibly), RANGE of int32 (least, greatest; object ids
for example).  Lanes and weak scalars beside a pair are points; scalars round to float32, as a shader's literals do.
What is undefined in lanes (NaN, 0/0) is outside what intervals tell.
"""

import operator
from typing import Any, Final

from numba import types
from numba.core.typeconv.castgraph import Conversion
from numba.extending import lower_cast, make_attribute_wrapper, models, register_model

from atmoref._jit import device, subroutine
from atmoref.lanes import instructions as lane
from atmoref.lanes.registers import F32, F64, I32, MASK, Lane, N, compiled_only, instruction, overload

DIVISION_ULP: Final = 2.5
SQRT_ULP: Final = 5.0  # 1 / inversesqrt(x): 2.5 of the division, 2 of inversesqrt, rounded up
ULP: Final = 2.0**-23  # at least one ulp of x is |x| ULP
STEP: Final = 1.45 * 2.0**-24  # x + |x| STEP rounds to the next float32, beyond the denormals
LEAST_STEP: Final = 2.0**-148


class Pair(types.Type):
    """The Numba type of two lane values of one kind, `lo` and `hi`."""

    def __init__(self, name: str, part: Lane) -> None:
        self.part = part
        super().__init__(name=f"{name}x{N}")

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Return the type of a variable that holds either: a lane of the same kind becomes a pair."""
        return self if other == self.part else None

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Tell Numba that such a lane may become a pair."""
        return Conversion.safe if other == self.part else None


class PairModel(models.StructModel):
    """Two LLVM vectors."""

    def __init__(self, manager: Any, kind: Pair) -> None:
        super().__init__(manager, kind, [("lo", kind.part), ("hi", kind.part)])


class IntervalType(Pair):
    """lo <= value <= hi."""


class TriType(Pair):
    """lo: certainly true; hi: possibly true."""


class RangeType(Pair):
    """Least and greatest int32."""


INTERVAL, TRI, RANGE = IntervalType("interval", F32), TriType("tri", MASK), RangeType("range", I32)
_OF_PART: Final = {F32: INTERVAL, MASK: TRI, I32: RANGE}


def _insert(builder: Any, kind: Any, lo: Any, hi: Any) -> Any:
    return builder.insert_value(builder.insert_value(kind(None), lo, 0), hi, 1)


for _kind in (IntervalType, TriType, RangeType):
    register_model(_kind)(PairModel)
    make_attribute_wrapper(_kind, "lo", "lo")
    make_attribute_wrapper(_kind, "hi", "hi")

    @lower_cast(Lane, _kind)
    def _as_point(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
        return _insert(builder, context.get_value_type(toty), value, value)


@instruction
def pair(typing: Any, lo: Any, hi: Any) -> Any:
    """Return the pair of two lanes of one kind: an interval, a three-valued mask, or a range of integers."""
    kind = _OF_PART.get(lo)
    if kind is None or lo != hi:
        return None
    return kind(lo, hi), lambda ctx, b, sig, a: _insert(b, ctx.get_value_type(kind), a[0], a[1])


def is_interval(*values: types.Type) -> bool:
    """Tell whether one of the types is an interval and the others are intervals, real lanes or weak scalars."""
    return INTERVAL in values and all(v in (INTERVAL, F32, F64) or isinstance(v, types.Number) for v in values)


def is_range(*values: types.Type) -> bool:
    """Tell whether one of the types is a range and the others are ranges, int32 lanes or integers."""
    return RANGE in values and all(v in (RANGE, I32) or isinstance(v, types.Integer) for v in values)


def is_tri(*values: types.Type) -> bool:
    """Tell whether one of the types is a three-valued mask and the others are masks."""
    return TRI in values and all(v in (TRI, MASK) for v in values)


@compiled_only
def as_interval(x: Any) -> Any:
    """Return an interval as it is; a lane or a number is a point, rounded to float32."""


@overload(as_interval)
def _as_interval(x: Any) -> Any:
    if x == INTERVAL:
        return lambda x: x
    if x == F32:
        return lambda x: pair(x, x)

    def point(x: Any) -> Any:
        at = lane.convert(types.float32, x)
        return pair(at, at)

    return point


@compiled_only
def as_range(x: Any) -> Any:
    """Return a range as it is; an int32 lane or an integer is a point."""


@overload(as_range)
def _as_range(x: Any) -> Any:
    if x == RANGE:
        return lambda x: x
    if x == I32:
        return lambda x: pair(x, x)

    def point(x: Any) -> Any:
        at = lane.spread_int(x)
        return pair(at, at)

    return point


@compiled_only
def as_tri(x: Any) -> Any:
    """Return a three-valued mask as it is; a plain mask is decided everywhere."""


@overload(as_tri)
def _as_tri(x: Any) -> Any:
    return (lambda x: x) if x == TRI else (lambda x: pair(x, x))


# ---- outward rounding
@device
def below(x):
    """Return the float32 below x (of denormals, one or two below)."""
    return x - lane.lane_max(lane.lane_abs(x) * STEP, LEAST_STEP)


@device
def above(x):
    """Return the float32 above x (of denormals, one or two above)."""
    return x + lane.lane_max(lane.lane_abs(x) * STEP, LEAST_STEP)


@device
def _single(x):
    return lane.convert(types.float32, x)


@device
def _double(x):
    return lane.convert(types.float64, x)


@device
def outward(lo, hi):
    """Return the interval of two exact float64 ends; what is not a number says nothing."""
    a, b = _single(lo), _single(hi)
    a = lane.lane_select(_double(a) > lo, below(a), a)
    b = lane.lane_select(_double(b) < hi, above(b), b)
    return known(a, b)


@device
def known(lo, hi):
    """Return the interval of two ends; a NaN end is infinite."""
    return pair(
        lane.lane_select(lo == lo, lo, -float("inf")),
        lane.lane_select(hi == hi, hi, float("inf")),
    )


@device
def loosened(lo, hi, ulps, least):
    """Return the interval of two float64 ends, each moved outward by `ulps` of itself and by `least`."""
    a, b = lo - (lane.lane_abs(lo) * (ulps * ULP) + least), hi + (lane.lane_abs(hi) * (ulps * ULP) + least)
    return outward(a, b)


@device
def widened(x, size):
    """Return an interval moved outward by a float32 lane or number of at least 0 on either side."""
    return pair(below(x.lo - size), above(x.hi + size))


# ---- arithmetic
@device
def _sum_error(a, b, s):
    """Return a + b - s of s = fl(a + b), exactly [Knuth]."""
    t = s - a
    return (a - (s - t)) + (b - t)


@subroutine
def _add(a, b):
    lane.stay_a_call()
    lo, hi = a.lo + b.lo, a.hi + b.hi
    low, high = _sum_error(a.lo, b.lo, lo) < 0.0, _sum_error(a.hi, b.hi, hi) > 0.0
    return known(lane.lane_select(low, below(lo), lo), lane.lane_select(high, above(hi), hi))


@device
def _negate(a):
    return pair(0.0 - a.hi, 0.0 - a.lo)


@subroutine
def _subtract(a, b):
    lane.stay_a_call()
    return _add(a, _negate(b))


@device
def _limit_product(a, b):
    """Return a b of float64 lanes; an infinite end is a limit, so times 0 it is 0."""
    return lane.lane_select((a == 0.0) | (b == 0.0), 0.0, a * b)


@device
def _hull_of_products(a0, a1, b0, b1):
    p, q = _limit_product(a0, b0), _limit_product(a0, b1)
    r, s = _limit_product(a1, b0), _limit_product(a1, b1)
    lo = lane.lane_min(lane.lane_min(p, q), lane.lane_min(r, s))
    return lo, lane.lane_max(lane.lane_max(p, q), lane.lane_max(r, s))


@subroutine
def _multiply(a, b):
    lane.stay_a_call()
    lo, hi = _hull_of_products(_double(a.lo), _double(a.hi), _double(b.lo), _double(b.hi))
    return outward(lo, hi)  # products of two float32 are exact in float64


@subroutine
def _divide(a, b):
    lane.stay_a_call()
    pole = (b.lo <= 0.0) & (b.hi >= 0.0)
    c0, c1 = 1.0 / _double(b.hi), 1.0 / _double(b.lo)
    lo, hi = _hull_of_products(_double(a.lo), _double(a.hi), c0, c1)
    q = loosened(lo, hi, DIVISION_ULP, 3.0 * LEAST_STEP)
    return pair(lane.lane_select(pole, -float("inf"), q.lo), lane.lane_select(pole, float("inf"), q.hi))


def _operator(op: Any, fits: Any, as_pair: Any, code: Any, in_place: Any = None) -> None:
    """Register `code` for an operator of pairs, points and weak scalars."""
    for form in (op,) if in_place is None else (op, in_place):

        @overload(form)
        def _typed(a: Any, b: Any) -> Any:
            return (lambda a, b: code(as_pair(a), as_pair(b))) if fits(a, b) else None


for _op, _in_place, _code in (
    (operator.add, operator.iadd, _add),
    (operator.sub, operator.isub, _subtract),
    (operator.mul, operator.imul, _multiply),
    (operator.truediv, operator.itruediv, _divide),
):
    _operator(_op, is_interval, as_interval, _code, _in_place)


@overload(operator.neg)
def _neg(a: Any) -> Any:
    if a == RANGE:
        return lambda a: pair(-a.hi, -a.lo)
    return (lambda a: _negate(a)) if a == INTERVAL else None


@overload(operator.pos)
def _pos(a: Any) -> Any:
    return (lambda a: a) if a in (INTERVAL, RANGE) else None


# ---- ranges of integers
@device
def _multiply_range(a, b):
    p, q, r, s = a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi
    lo = lane.lane_min(lane.lane_min(p, q), lane.lane_min(r, s))
    return pair(lo, lane.lane_max(lane.lane_max(p, q), lane.lane_max(r, s)))


_operator(operator.add, is_range, as_range, device(lambda a, b: pair(a.lo + b.lo, a.hi + b.hi)), operator.iadd)
_operator(operator.sub, is_range, as_range, device(lambda a, b: pair(a.lo - b.hi, a.hi - b.lo)), operator.isub)
_operator(operator.mul, is_range, as_range, _multiply_range, operator.imul)


# ---- comparisons
@device
def _less(a, b):
    return pair(a.hi < b.lo, a.lo < b.hi)


@device
def _at_most(a, b):
    return pair(a.hi <= b.lo, a.lo <= b.hi)


@device
def _equal(a, b):
    return pair((a.lo == b.hi) & (a.hi == b.lo), (a.lo <= b.hi) & (b.lo <= a.hi))


@device
def _opposite(test):
    return pair(lane.lane_not(test.hi), lane.lane_not(test.lo))


for _fits, _as_pair in ((is_interval, as_interval), (is_range, as_range)):
    for _op, _code in (
        (operator.lt, _less),
        (operator.le, _at_most),
        (operator.gt, device(lambda a, b: _less(b, a))),
        (operator.ge, device(lambda a, b: _at_most(b, a))),
        (operator.eq, _equal),
        (operator.ne, device(lambda a, b: _opposite(_equal(a, b)))),
    ):
        _operator(_op, _fits, _as_pair, _code)

# ---- three-valued masks
_operator(operator.and_, is_tri, as_tri, device(lambda a, b: pair(a.lo & b.lo, a.hi & b.hi)), operator.iand)
_operator(operator.or_, is_tri, as_tri, device(lambda a, b: pair(a.lo | b.lo, a.hi | b.hi)), operator.ior)


@device
def _either(a, b):
    """Return a ^ b: certain only where both are decided."""
    undecided = (a.lo ^ a.hi) | (b.lo ^ b.hi)
    differ = a.lo ^ b.lo
    return pair(differ & lane.lane_not(undecided), differ | undecided)


_operator(operator.xor, is_tri, as_tri, _either, operator.ixor)


@overload(operator.invert)
def _invert(a: Any) -> Any:
    return (lambda a: _opposite(a)) if a == TRI else None
