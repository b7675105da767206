# mypy: allow-untyped-defs, allow-untyped-calls
# (Numba and llvmlite are untyped)
"""Operators of lanes and weak scalars: `+ - * / < <= > >= == != & | ^ << >> ~` and unary minus.

Reals: `+ - * /` round once to the element type, comparisons with NaN are false except `!=`.  int32 lanes wrap around;
`>>` keeps the sign (see `shift_right` for the other).  Masks know `& | ^ ~` only.
"""

import operator
from collections.abc import Callable
from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from atmoref.lanes.registers import F32, F64, I32, MASK, Lane, common, constant, is_real, spread, weak

Emit = Callable[[ir.IRBuilder, ir.Value, ir.Value], ir.Value]

IN_PLACE: Final = {
    operator.add: operator.iadd,
    operator.sub: operator.isub,
    operator.mul: operator.imul,
    operator.truediv: operator.itruediv,
    operator.and_: operator.iand,
    operator.or_: operator.ior,
    operator.xor: operator.ixor,
    operator.lshift: operator.ilshift,
    operator.rshift: operator.irshift,
}


def _operator(
    op: Any, real: Emit | None, integer: Emit | None, mask: Emit | None = None, *, test: bool = False
) -> None:
    """Register a binary operator and its in-place form; `test` marks one whose result is a mask."""
    emits: dict[Any, Any] = {F32: real, F64: real, I32: integer, MASK: mask}

    class LaneOperator(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            lane = common(*args)
            if len(args) == 2 and lane and emits[lane]:
                return signature(MASK if test else lane, *weak(lane, *args))
            return None

    def lower(context: Any, builder: ir.IRBuilder, sig: Any, args: Any) -> ir.Value:
        return emits[common(*sig.args)](builder, *spread(builder, sig, args))

    for form in (op,) if test else (op, IN_PLACE[op]):
        infer_global(form)(type(f"Lane_{form.__name__}", (LaneOperator,), {"key": form}))
        for left, right in ((Lane, Lane), (Lane, types.Any), (types.Any, Lane)):
            lower_builtin(form, left, right)(lower)


def _unary(op: Any, fits: Callable[[types.Type], bool], emit: Callable[[ir.IRBuilder, ir.Value], ir.Value]) -> None:
    """Register an operator of one lane whose result has the lane's type."""

    @infer_global(op)
    class LaneOperator(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(args[0], args[0]) if len(args) == 1 and fits(args[0]) else None

    lower_builtin(op, Lane)(lambda context, builder, sig, args: emit(builder, args[0]))


def _plain(name: str) -> Emit:
    return lambda builder, x, y: getattr(builder, name)(x, y)


def _comparison(name: str, sign: str) -> Emit:
    return lambda builder, x, y: getattr(builder, name)(sign, x, y)


def _negate(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
    return builder.neg(x) if isinstance(x.type.element, ir.IntType) else builder.fneg(x)


def _invert(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
    return builder.xor(x, constant(x.type, -1))


_operator(operator.add, _plain("fadd"), _plain("add"))
_operator(operator.sub, _plain("fsub"), _plain("sub"))
_operator(operator.mul, _plain("fmul"), _plain("mul"))
_operator(operator.truediv, _plain("fdiv"), None)
_operator(operator.and_, None, _plain("and_"), _plain("and_"))
_operator(operator.or_, None, _plain("or_"), _plain("or_"))
_operator(operator.xor, None, _plain("xor"), _plain("xor"))
_operator(operator.lshift, None, _plain("shl"))
_operator(operator.rshift, None, _plain("ashr"))
for _op, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _operator(_op, _comparison("fcmp_ordered", _sign), _comparison("icmp_signed", _sign), test=True)
_operator(operator.ne, _comparison("fcmp_unordered", "!="), _comparison("icmp_signed", "!="), test=True)
_unary(operator.neg, lambda lane: is_real(lane) or lane == I32, _negate)
_unary(operator.pos, lambda lane: is_real(lane) or lane == I32, lambda builder, x: x)
_unary(operator.invert, lambda lane: lane in (MASK, I32), _invert)
