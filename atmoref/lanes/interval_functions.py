# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""The functions of `arith`, `functions` and `memory` for intervals, three-valued masks and ranges of integers.

Transcendental functions are monotone between the points that are looked at, so the ends are computed with the functions
of lanes (whose own error is below `OWN_ULP`) and moved outward by what the specifications allow a device:

========  =============================================  ==============================================
exp       `EXP_ULP` + `EXP_ULP_PER_X` |x| ulp            Vulkan, appendix A: (3 + 2 |x|) ulp
log       `LOG_ULP` ulp, `LOG_ABSOLUTE` in [1/2, 2]      Vulkan, appendix A: 3 ulp, 2**-21
sin, cos  `TRIGONOMETRIC_ABSOLUTE`                       Vulkan 1.1, appendix A: 2**-11 in [-pi, pi]
atan2     `ATAN2_ULP` ulp                                Vulkan 1.1, appendix A: 4096 ulp
========  =============================================  ==============================================
"""

from typing import Any, Final, NamedTuple

from numba import types

from atmoref._jit import device, subroutine
from atmoref.lanes import arith, functions, memory
from atmoref.lanes import instructions as lane
from atmoref.lanes.intervals import (
    INTERVAL,
    RANGE,
    SQRT_ULP,
    TRI,
    as_interval,
    as_range,
    is_interval,
    is_range,
    loosened,
    outward,
    pair,
    widened,
)
from atmoref.lanes.registers import I32, compiled_only, instruction, is_lane, is_real, overload

OWN_ULP: Final = 1.0  # measured: 0.868 of exp, 0.835 of log, 0.500 of the others (docs/decisions/0004-lanes.md)
EXP_ULP: Final = 3.0
EXP_ULP_PER_X: Final = 2.0
LOG_ULP: Final = 3.0
LOG_ABSOLUTE: Final = 2.0**-21
TRIGONOMETRIC_ABSOLUTE: Final = 2.0**-11
TRIGONOMETRIC_ROOM: Final = TRIGONOMETRIC_ABSOLUTE + 2.0**-23  # and what our own sines are off, OWN_ULP below 1
ATAN2_ULP: Final = 4096.0
LEAST: Final = 2.0**-146  # absolute, for denormal results
HALF_TURN: Final = 3.141592653589793


class Interval(NamedTuple):
    """Tag: enclosures of what a float32 device may compute; the numbers are the device's budgets (`Device`)."""

    coordinate: float  # of a texture coordinate, absolute
    attribute: float  # of an interpolated vertex attribute, as a fraction of the corners' magnitude
    weight: float  # of its barycentric weights, absolute


@instruction
def apart(typing: Any, arith: Any) -> Any:
    """Keep the function that says this a function of its own in kernels of intervals, whose code is long otherwise."""

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        if _is_tag(arith):
            b.function.attributes.discard("alwaysinline")
            b.function.attributes.add("noinline")
        return ctx.get_dummy_value()

    return types.void(arith), emit


# ---- sources
@overload(arith.lift)
def _lift(arith: Any, x: Any) -> Any:
    if not _is_tag(arith):
        return None
    if x in (INTERVAL, RANGE, TRI):
        return lambda arith, x: x
    if x == I32 or is_real(x) or isinstance(x, types.Integer | types.Float):
        return lambda arith, x: as_interval(x)
    return None


def _is_tag(value: Any) -> bool:
    return arith.is_tag(value, Interval)


@compiled_only
def whole(arith: Any, x: Any) -> Any:
    """Return an int32 lane as an integer of this arithmetic: of intervals a range, since a choice may be undecided."""


@overload(whole)
def _whole(arith: Any, x: Any) -> Any:
    return (lambda arith, x: as_range(x)) if _is_tag(arith) else (lambda arith, x: x)


# ---- functions with one rule per kind of value
def _of_interval(function: Any, code: Any) -> None:
    """Register code for a function of one interval."""

    @overload(function)
    def _typed(x: Any) -> Any:
        return (lambda x: code(x)) if x == INTERVAL else None


@subroutine
def _sqrt(x):
    lane.stay_a_call()
    lo = lane.lane_sqrt(lane.convert(types.float64, lane.lane_max(x.lo, 0.0)))
    hi = lane.lane_sqrt(lane.convert(types.float64, lane.lane_max(x.hi, 0.0)))
    root = loosened(lo, hi, SQRT_ULP, 0.0)
    return pair(lane.lane_max(root.lo, 0.0), root.hi)


@device
def _absolute(x):
    a, b = lane.lane_abs(x.lo), lane.lane_abs(x.hi)
    crosses = (x.lo <= 0.0) & (x.hi >= 0.0)
    return pair(lane.lane_select(crosses, 0.0, lane.lane_min(a, b)), lane.lane_max(a, b))


@device
def _square(x):
    size = _absolute(x)
    return size * size


@device
def _ends(function, x, ulps, least):
    """Return the interval of an increasing function's values at both ends."""
    lo, hi = lane.convert(types.float64, function(x.lo)), lane.convert(types.float64, function(x.hi))
    return loosened(lo, hi, ulps, least)


@subroutine
def _exp(x):
    lane.stay_a_call()
    size = lane.lane_min(lane.lane_max(lane.lane_abs(x.lo), lane.lane_abs(x.hi)), 128.0)
    ulps = lane.convert(types.float64, size) * EXP_ULP_PER_X + (EXP_ULP + OWN_ULP)
    lo = lane.convert(types.float64, functions.exp(x.lo))
    hi = lane.convert(types.float64, functions.exp(x.hi))
    e = loosened(lo, hi, ulps, ulps * LEAST)
    return pair(lane.lane_max(e.lo, 0.0), e.hi)


@subroutine
def _log(x):
    lane.stay_a_call()
    lo = lane.convert(types.float64, functions.log(lane.lane_max(x.lo, 0.0)))
    hi = lane.convert(types.float64, functions.log(lane.lane_max(x.hi, 0.0)))
    return loosened(lo, hi, LOG_ULP + OWN_ULP, LOG_ABSOLUTE)


@subroutine
def _turning(x, function, first):
    """Return the range of sin or cos, whose maxima lie at `first` + 2 pi k and minima half a turn later."""
    lane.stay_a_call()
    a, b = lane.convert(types.float64, x.lo), lane.convert(types.float64, x.hi)
    p, q = lane.convert(types.float64, function(x.lo)), lane.convert(types.float64, function(x.hi))
    slack = 1e-6 * lane.lane_max(lane.lane_abs(a), lane.lane_abs(b)) + 1e-6
    up = lane.lane_floor((b + slack - first) * (0.5 / HALF_TURN)) * (2.0 * HALF_TURN) + first >= a - slack
    down = lane.lane_floor((b + slack - first) * (0.5 / HALF_TURN) - 0.5) * (2.0 * HALF_TURN) + (first + HALF_TURN)
    hi = lane.lane_select(up, 1.0, lane.lane_max(p, q)) + TRIGONOMETRIC_ROOM
    lo = lane.lane_select(down >= a - slack, -1.0, lane.lane_min(p, q)) - TRIGONOMETRIC_ROOM
    ends = outward(lane.lane_max(lo, -1.0), lane.lane_min(hi, 1.0))
    far = lane.lane_max(lane.lane_abs(x.lo), lane.lane_abs(x.hi)) > 1e6  # lanes give NaN there
    return pair(lane.lane_select(far, -1.0, ends.lo), lane.lane_select(far, 1.0, ends.hi))


@device
def _sin(x):
    return _turning(x, functions.sin, 0.5 * HALF_TURN)


@device
def _cos(x):
    return _turning(x, functions.cos, 0.0)


@subroutine
def _atan2(y, x):
    lane.stay_a_call()
    a, b = functions.atan2(y.lo, x.lo), functions.atan2(y.lo, x.hi)
    c, d = functions.atan2(y.hi, x.lo), functions.atan2(y.hi, x.hi)
    lo = lane.lane_min(lane.lane_min(a, b), lane.lane_min(c, d))
    hi = lane.lane_max(lane.lane_max(a, b), lane.lane_max(c, d))
    angle = loosened(
        lane.convert(types.float64, lo), lane.convert(types.float64, hi), ATAN2_ULP + OWN_ULP, LEAST * ATAN2_ULP
    )
    cut = (y.lo <= 0.0) & (y.hi >= 0.0) & (x.lo <= 0.0)  # the box touches the cut, or the origin
    return pair(lane.lane_select(cut, -3.1416, angle.lo), lane.lane_select(cut, 3.1416, angle.hi))


for _function, _code in (
    (arith.rint, device(lambda x: pair(lane.lane_rint(x.lo), lane.lane_rint(x.hi)))),
    (arith.floor, device(lambda x: pair(lane.lane_floor(x.lo), lane.lane_floor(x.hi)))),
    (arith.sqrt, _sqrt),
    (arith.absolute, _absolute),
    (arith.square, _square),
    (functions.exp, _exp),
    (functions.log, _log),
    (functions.sin, _sin),
    (functions.cos, _cos),
):
    _of_interval(_function, _code)


@overload(functions.atan2)
def _atan2_of(y: Any, x: Any) -> Any:
    return (lambda y, x: _atan2(as_interval(y), as_interval(x))) if is_interval(y, x) else None


def _extremum(function: Any, code: Any, fits: Any, as_pair: Any) -> None:
    """Register code for the lesser or the greater of two pairs."""

    @overload(function)
    def _typed(x: Any, y: Any) -> Any:
        if not fits(x, y):
            return None

        def ends(x: Any, y: Any) -> Any:
            a, b = as_pair(x), as_pair(y)
            return pair(code(a.lo, b.lo), code(a.hi, b.hi))

        return ends


for _fits, _as_pair in ((is_interval, as_interval), (is_range, as_range)):
    _extremum(arith.minimum, lane.lane_min, _fits, _as_pair)
    _extremum(arith.maximum, lane.lane_max, _fits, _as_pair)


@overload(lane.fma)
def _fma(x: Any, y: Any, z: Any) -> Any:
    return (lambda x, y, z: x * y + z) if is_interval(x, y, z) else None


# ---- choices
@subroutine
def _choose(test, x, y):
    """Return x where certainly, y where certainly not, else the hull of both."""
    lane.stay_a_call()
    both = test.hi & lane.lane_not(test.lo)
    lo = lane.lane_select(test.hi, x.lo, y.lo)
    hi = lane.lane_select(test.hi, x.hi, y.hi)
    return pair(
        lane.lane_select(both, lane.lane_min(x.lo, y.lo), lo), lane.lane_select(both, lane.lane_max(x.hi, y.hi), hi)
    )


@device
def _choose_by_mask(test, x, y):
    return pair(lane.lane_select(test, x.lo, y.lo), lane.lane_select(test, x.hi, y.hi))


@overload(arith.select)
def _select(test: Any, x: Any, y: Any) -> Any:
    whole = all(v in (RANGE, I32) or isinstance(v, types.Integer) for v in (x, y)) and is_lane_or_pair(x, y)
    if test == TRI:
        as_pair = as_range if whole else as_interval
        return lambda test, x, y: _choose(test, as_pair(x), as_pair(y))
    if is_range(x, y):
        return lambda test, x, y: _choose_by_mask(test, as_range(x), as_range(y))
    return (lambda test, x, y: _choose_by_mask(test, as_interval(x), as_interval(y))) if is_interval(x, y) else None


def is_lane_or_pair(*values: Any) -> bool:
    """Tell whether one of the types is a lane or a range."""
    return is_lane(*values) or RANGE in values


def _of_tri(function: Any, code: Any) -> None:
    @overload(function)
    def _typed(test: Any) -> Any:
        return (lambda test: code(test)) if test == TRI else None


_of_tri(arith.any_lane, device(lambda test: lane.lane_any(test.hi)))  # possibly
_of_tri(arith.all_lanes, device(lambda test: lane.lane_all(test.lo)))  # certainly
_of_tri(arith.count_lanes, device(lambda test: lane.lane_count(test.hi)))
_of_tri(arith.lane_not, device(lambda test: ~test))


@compiled_only
def possible(test: Any) -> Any:
    """Return a mask as it is, of a three-valued one where it may be set: for counting."""


@overload(possible)
def _possible(test: Any) -> Any:
    return (lambda test: test.hi) if test == TRI else (lambda test: test)


@compiled_only
def nominal(x: Any) -> Any:
    """Return a value as it is, of an interval its middle: for choices between branches that agree where they meet.

    Which triangle of a mesh holds a pixel, for example: whichever is taken, the attribute is the same on the edge.
    """


@overload(nominal)
def _nominal(x: Any) -> Any:
    if x == INTERVAL:
        return lambda x: x.lo + (x.hi - x.lo) * 0.5
    return (lambda x: x) if is_real(x) else None


@compiled_only
def unchanged(x: Any, y: Any) -> Any:
    """Return the mask of x == y, for a y made from x by a clamp: of intervals certain where both ends stayed."""


@overload(unchanged)
def _unchanged(x: Any, y: Any) -> Any:
    if x == INTERVAL:
        return lambda x, y: pair((x.lo == y.lo) & (x.hi == y.hi), (x.lo <= y.hi) & (y.lo <= x.hi))
    return lambda x, y: x == y


@overload(lane.convert)
def _convert(element: Any, x: Any) -> Any:
    """Return the middle of an interval as a lane: what a probe shows."""
    return (lambda element, x: lane.convert(element, nominal(x))) if x == INTERVAL else None


# ---- interpolation
@compiled_only
def barycentric(arith: Any, a: Any, b: Any, c: Any, weight_b: Any, weight_c: Any) -> Any:
    """Return a + weight_b (b - a) + weight_c (c - a): a vertex attribute within a triangle."""


@overload(barycentric)
def _barycentric(arith: Any, a: Any, b: Any, c: Any, weight_b: Any, weight_c: Any) -> Any:
    if not _is_tag(arith):
        return lambda arith, a, b, c, weight_b, weight_c: a + weight_b * (b - a) + weight_c * (c - a)

    def enclosed(arith: Any, a: Any, b: Any, c: Any, weight_b: Any, weight_c: Any) -> Any:
        inside = a + widened(weight_b, arith.weight) * (b - a) + widened(weight_c, arith.weight) * (c - a)
        size = lane.lane_max(_size(a), lane.lane_max(_size(b), _size(c))) * arith.attribute
        return widened(inside, size)

    return enclosed


@device
def _size(x):
    return lane.lane_max(lane.lane_abs(x.lo), lane.lane_abs(x.hi))


# ---- memory
def _is_pair_of_arrays(value: Any) -> bool:
    return isinstance(value, types.UniTuple) and value.count == 2 and isinstance(value.dtype, types.Array)


@overload(memory.load)
def _load(array: Any, start: Any) -> Any:
    if not _is_pair_of_arrays(array):
        return None
    return lambda array, start: pair(
        lane.convert(types.float32, memory.load(array[0], start)),
        lane.convert(types.float32, memory.load(array[1], start)),
    )


@overload(memory.store)
def _store(array: Any, start: Any, lane: Any) -> Any:
    if not _is_pair_of_arrays(array) or lane != INTERVAL:
        return None

    def ends(array: Any, start: Any, lane: Any) -> Any:
        memory.store(array[0], start, lane.lo)
        memory.store(array[1], start, lane.hi)

    return ends


@overload(memory.gather)
def _gather(table: Any, index: Any) -> Any:
    if index != RANGE:
        return None

    def hull(table: Any, index: Any) -> Any:
        lo = hi = lane.convert(types.float32, memory.gather(table, index.lo))
        at = index.lo + 1
        while lane.lane_any(at <= index.hi):
            value = lane.convert(types.float32, memory.gather(table, lane.lane_min(at, index.hi)))
            lo, hi = lane.lane_min(lo, value), lane.lane_max(hi, value)
            at = at + 1
        return pair(lo, hi)

    return hull
