# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""What a kernel calls: every arithmetic behind one set of names.

A kernel takes a tag `arith`, `Single()` or `Double()`.  Only *sources* of values name it: `lift` (a uniform, a tuple of
uniforms, a table entry) and `pixels`.  All else follows from the operands, and literals are weak: `x * 0.5 + 1`.
The functions are overloads: another kind of value (intervals) registers its own code under the same names, and
no kernel changes.
"""

from typing import Any, NamedTuple

from numba import types

from atmoref._jit import device
from atmoref.lanes import instructions as lane
from atmoref.lanes.registers import I32, MASK, Lane, compiled_only, is_lane, is_real, overload, refuse


class Single(NamedTuple):
    """Tag: float32, as a shader computes."""


class Double(NamedTuple):
    """Tag: float64, the method itself."""


def is_tag(value: Any, tag: type) -> bool:
    """Tell whether a Numba type stands for a tag; compare types, never values (empty tuples are all equal)."""
    return isinstance(value, types.BaseNamedTuple) and getattr(value, "instance_class", None) is tag


# ---- sources
@compiled_only
def lift(arith: Any, x: Any) -> Any:
    """Return a number, an int32 or real lane, or a (named) tuple of them, as values of this arithmetic.

    A number fills every lane.  Booleans and None inside or outside tuples stay as they are: they steer, uniformly.
    """


def _lift_tuple(x: Any) -> Any:
    """Return code that lifts a tuple item by item, nested tuples included, and keeps its class."""
    items = "".join(f"lift(arith, x[{i}])," for i in range(len(x)))
    names: dict[str, Any] = {"lift": lift, "make": getattr(x, "instance_class", None)}
    named = isinstance(x, types.BaseNamedTuple)
    exec(f"def lift_items(arith, x):\n return {'make' if named else ''}({items})", names)
    return names["lift_items"]


@overload(lift)
def _lift(arith: Any, x: Any) -> Any:
    if isinstance(x, types.BaseTuple):
        return _lift_tuple(x)
    if isinstance(x, types.Boolean | types.NoneType):
        return lambda arith, x: x
    element = types.float64 if is_tag(arith, Double) else types.float32 if is_tag(arith, Single) else None
    if element is None:
        return None
    if not (x == I32 or is_real(x) or isinstance(x, types.Integer | types.Float)):
        raise refuse("lift takes numbers, lanes of numbers and tuples of them", x)
    return lambda arith, x: lane.convert(element, x)


@compiled_only
def pixels(arith: Any, start: Any) -> Any:
    """Return the centres of N neighbouring pixels: start + 1/2, start + 3/2, ..."""


@overload(pixels)
def _pixels(arith: Any, start: Any) -> Any:
    return lambda arith, start: lift(arith, lane.iota(start)) + 0.5


# ---- functions with one rule per kind of value
def _of_real(name: str, doc: str, code: Any) -> Any:
    """Return a public function of one real lane."""

    def stub(x: Any) -> Any: ...

    stub.__name__ = stub.__qualname__ = name
    stub.__doc__ = doc
    function = compiled_only(stub)

    @overload(function)
    def _typed(x: Any) -> Any:
        return (lambda x: code(x)) if is_real(x) else None

    return function


rint = _of_real("rint", "Round to the nearest integer, ties to even.", lane.lane_rint)
floor = _of_real("floor", "Round towards minus infinity.", lane.lane_floor)
sqrt = _of_real("sqrt", "Return the square root, correctly rounded; NaN for negative x.", lane.lane_sqrt)


@compiled_only
def square(x: Any) -> Any:
    """Return x x, for reals and int32."""


@compiled_only
def absolute(x: Any) -> Any:
    """Return |x|, for reals and int32."""


@compiled_only
def minimum(x: Any, y: Any) -> Any:
    """Return the lesser (reals and int32); where one is NaN, or both are zeros, the second."""


@compiled_only
def maximum(x: Any, y: Any) -> Any:
    """Return the greater (reals and int32); where one is NaN, or both are zeros, the second."""


@compiled_only
def select(test: Any, x: Any, y: Any) -> Any:
    """Return x where test, else y; test is a mask or a uniform boolean, x or y may be a weak scalar."""


@compiled_only
def any_lane(test: Any) -> Any:
    """Tell whether the mask is set in any lane."""


@compiled_only
def all_lanes(test: Any) -> Any:
    """Tell whether the mask is set in every lane."""


@compiled_only
def count_lanes(test: Any) -> Any:
    """Return in how many lanes the mask is set, int64."""


@compiled_only
def lane_not(test: Any) -> Any:
    """Return the opposite mask; `~test` is the same."""


@overload(square)
def _square(x: Any) -> Any:
    return (lambda x: x * x) if is_real(x) or x == I32 else None


@overload(absolute)
def _absolute(x: Any) -> Any:
    if x == I32:
        return lambda x: lane.lane_abs_int(x)
    return (lambda x: lane.lane_abs(x)) if is_real(x) else None


def _of_two(function: Any, code: Any) -> None:
    @overload(function)
    def _typed(x: Any, y: Any) -> Any:
        return (lambda x, y: code(x, y)) if is_lane(x, y) else None


_of_two(minimum, lane.lane_min)
_of_two(maximum, lane.lane_max)


@overload(select)
def _select(test: Any, x: Any, y: Any) -> Any:
    known = all(isinstance(v, Lane | types.Number | types.Boolean) for v in (test, x, y))
    return (lambda test, x, y: lane.lane_select(test, x, y)) if known else None


def _of_mask(function: Any, code: Any) -> None:
    @overload(function)
    def _typed(test: Any) -> Any:
        return (lambda test: code(test)) if test == MASK else None


_of_mask(any_lane, lane.lane_any)
_of_mask(all_lanes, lane.lane_all)
_of_mask(count_lanes, lane.lane_count)
_of_mask(lane_not, lane.lane_not)


@device
def saturate(x):
    """Return x clamped to [0, 1]; NaN gives 0."""
    return minimum(maximum(x, 0.0), 1.0)
