# mypy: allow-untyped-defs, allow-untyped-calls
# (Numba and llvmlite are untyped)
"""Lane types: a register of N elements, one per pixel of a wave, as one LLVM vector.

Elements are float32, float64, int32 or boolean (a mask).  Scalars beside lanes are *weak*: in `lane op scalar` the
scalar takes the lane's element type, so neither a literal nor a uniform decides the precision.
"""

import functools
from collections.abc import Callable
from typing import Any, Final

from llvmlite import ir
from numba import extending, types
from numba.core import extending as core_extending
from numba.core.errors import TypingError
from numba.extending import models, register_model

from atmoref._jit import LANES

N: Final = LANES
"""Lanes in a register, fixed at import (`ATMOREF_LANES`, 16 by default)."""

I1, INT32, INT64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)
LLVM_ELEMENT: Final = {
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
    types.int32: INT32,
    types.boolean: I1,
    types.uint8: ir.IntType(8),
    types.uint16: ir.IntType(16),
    types.uint32: INT32,
}


class Lane(types.Type):
    """The Numba type of N values of one element type."""

    def __init__(self, element: Any) -> None:
        self.element = element
        super().__init__(name=f"{element}x{N}")


F32, F64, I32, MASK = (Lane(e) for e in (types.float32, types.float64, types.int32, types.boolean))


def vector(element: types.Type) -> ir.VectorType:
    """Return the LLVM vector of N elements of a Numba type."""
    return ir.VectorType(LLVM_ELEMENT[element], N)


@register_model(Lane)
class LaneModel(models.PrimitiveModel):
    """In memory and in registers a lane value is one LLVM vector."""

    def __init__(self, manager: Any, lane: Lane) -> None:
        super().__init__(manager, lane, vector(lane.element))


def is_lane(*values: types.Type) -> bool:
    """Tell whether any of the types is a lane type."""
    return any(isinstance(v, Lane) for v in values)


def is_real(lane: types.Type) -> bool:
    """Tell whether a type is a lane of float32 or float64."""
    return isinstance(lane, Lane) and isinstance(lane.element, types.Float)


def common(*values: types.Type) -> Lane | None:
    """Return the one lane type of lanes and weak scalars, or None when lanes disagree or a scalar does not fit.

    Any number fits a lane of reals, integers fit int32 lanes, booleans fit masks.
    """
    lanes = {v for v in values if isinstance(v, Lane)}
    if len(lanes) != 1:
        return None
    (lane,) = lanes
    fits = types.Number if is_real(lane) else types.Boolean if lane == MASK else types.Integer
    return lane if all(isinstance(v, Lane | fits) for v in values) else None


def weak(lane: Lane, *values: types.Type) -> list[types.Type]:
    """Return argument types in which Numba casts each weak scalar to the lane's element."""
    return [v if is_lane(v) else lane.element for v in values]


# ---- LLVM values
def splat(builder: ir.IRBuilder, scalar: ir.Value) -> ir.Value:
    """Put one scalar into every lane."""
    kind = ir.VectorType(scalar.type, N)
    empty = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(empty, scalar, INT32(0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(INT32, N), [0] * N))


def constant(kind: ir.VectorType, value: float) -> ir.Constant:
    """Return a vector constant with the same value in every lane."""
    return ir.Constant(kind, [value] * kind.count)


def spread(builder: ir.IRBuilder, sig: Any, args: Any) -> list[ir.Value]:
    """Return all arguments of a call as vectors."""
    return [v if is_lane(t) else splat(builder, v) for v, t in zip(args, sig.args, strict=True)]


def call_llvm(builder: ir.IRBuilder, name: str, result: ir.Type, args: list[ir.Value]) -> ir.Value:
    """Call an LLVM intrinsic, declared on first use."""
    module = builder.module
    kind = ir.FunctionType(result, [a.type for a in args])
    return builder.call(module.globals.get(name) or ir.Function(module, kind, name), args)


# ---- names that exist in kernels only
_Intrinsic: Any = core_extending._Intrinsic  # typed as final; only its message is replaced


class Instruction(_Intrinsic):
    """A Numba intrinsic that says what is wrong when plain Python calls it."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Refuse."""
        raise TypeError(f"{self._name} exists only in compiled kernels")


def instruction(definition: Callable[..., Any]) -> Any:
    """Make a function of kernels from `definition(typing, *types) -> (signature, emit)`; see `numba.intrinsic`."""
    made = Instruction(definition.__name__, definition)
    made._register()
    return made


def compiled_only(stub: Callable[..., Any]) -> Any:
    """Make the public name of an overloaded function; called from plain Python it raises TypeError."""

    @functools.wraps(stub)
    def raises(*args: Any, **kwargs: Any) -> Any:
        raise TypeError(f"{stub.__name__} exists only in compiled kernels")

    return raises


def overload(stub: Any) -> Any:
    """Register code for a stub as `numba.extending.overload` does, for annotated functions too.

    Numba wants equal signatures, annotations included; here they are dropped first.
    """

    def register(choose: Any) -> Any:
        choose.__annotations__ = {}

        @functools.wraps(choose)
        def typed(*args: Any, **kwargs: Any) -> Any:
            code = choose(*args, **kwargs)
            if code is not None:
                code.__annotations__ = {}
            return code

        return extending.overload(stub, jit_options={"forceinline": True, "error_model": "numpy"})(typed)

    return register


def refuse(what: str, *values: types.Type) -> TypingError:
    """Return the error of a lane function that got types it is not made for."""
    return TypingError(f"{what}; found {', '.join(map(str, values))}")
