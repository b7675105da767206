# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""exp, log, sin, cos, tan and atan2 of lanes: the algorithms of `atmoref.elementary`, bit for bit.

Accuracy and domains are stated there.
"""

from typing import Any

from numba import types

from atmoref import elementary
from atmoref._jit import device
from atmoref.lanes import instructions as lane
from atmoref.lanes.arith import absolute, maximum, minimum, rint, select
from atmoref.lanes.registers import F32, F64, common, compiled_only, overload


@device
def _widen(x):
    return lane.convert(types.float64, x)


@device
def _narrow(x):
    return lane.convert(types.float32, x)


OPS = elementary.Ops(
    function=device,
    select=select,
    minimum=minimum,
    maximum=maximum,
    absolute=absolute,
    rint=rint,
    copy_sign=lane.copy_sign,
    to_int=lane.to_int,
    from_int=lane.from_int,
    power_of_two=lane.power_of_two,
    exponent=lane.exponent,
    significand=lane.significand,
    widen=_widen,
    narrow=_narrow,
)
_SINGLE, _DOUBLE = elementary.bind(OPS)


@compiled_only
def exp(x: Any) -> Any:
    """Return e**x; the result underflows gradually to 0 and overflows to infinity."""


@compiled_only
def log(x: Any) -> Any:
    """Return the natural logarithm; log(0) is -inf, NaN for x < 0."""


@compiled_only
def sin(x: Any) -> Any:
    """Return the sine of x radians; NaN for |x| > 2**20."""


@compiled_only
def cos(x: Any) -> Any:
    """Return the cosine of x radians; NaN for |x| > 2**20."""


@compiled_only
def tan(x: Any) -> Any:
    """Return the tangent of x radians; NaN for |x| > 2**20."""


@compiled_only
def atan2(y: Any, x: Any) -> Any:
    """Return the angle of the vector (x, y) in radians, from -pi to pi; one of both may be a weak scalar."""


def _of_one(function: Any, name: str) -> None:
    code = {F32: getattr(_SINGLE, name), F64: getattr(_DOUBLE, name)}

    @overload(function)
    def _typed(x: Any) -> Any:
        chosen = code.get(x)
        return (lambda x: chosen(x)) if chosen else None


for _function, _name in ((exp, "exp"), (log, "log"), (sin, "sin"), (cos, "cos"), (tan, "tan")):
    _of_one(_function, _name)


@overload(atan2)
def _atan2(y: Any, x: Any) -> Any:
    kind = common(y, x)
    if kind not in (F32, F64):
        return None
    element, chosen = (types.float32, _SINGLE.atan2) if kind == F32 else (types.float64, _DOUBLE.atan2)
    return lambda y, x: chosen(lane.convert(element, y), lane.convert(element, x))
