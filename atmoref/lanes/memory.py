# mypy: allow-untyped-defs, allow-untyped-calls
# (Numba and llvmlite are untyped)
"""Lanes from and to arrays.

Arrays are 1-D and C-contiguous, of float32, float64, int32, uint8, uint16 or uint32.  Unsigned codes come as int32
lanes (uint32 with its bits kept).  Nothing is checked against the array's length: callers pad and clamp.
"""

from typing import Any

from llvmlite import ir
from numba import types

from atmoref.lanes.registers import (
    I1,
    I32,
    INT32,
    INT64,
    LLVM_ELEMENT,
    Lane,
    N,
    call_llvm,
    constant,
    instruction,
    is_lane,
    refuse,
    vector,
)

ELEMENTS = (types.float32, types.float64, types.int32, types.uint8, types.uint16, types.uint32)
CODES = (types.uint8, types.uint16, types.uint32)


class VectorGep(ir.instructions.Instruction):
    """A getelementptr with a vector of indices, which llvmlite's own lacks."""

    def __init__(self, parent: Any, base: ir.Value, index: ir.Value, element: ir.Type) -> None:
        super().__init__(parent, ir.VectorType(base.type, N), "getelementptr", [base, index])
        self.element = element

    def descr(self, buf: list[str]) -> None:
        """Write the instruction's text."""
        base, index = (f"{o.type} {o.get_reference()}" for o in self.operands)
        buf.append(f"getelementptr {self.element}, {base}, {index}\n")


def _element(array: Any) -> Any:
    """Return the element of an array that lanes can use, or refuse."""
    if isinstance(array, types.Array) and array.ndim == 1 and array.layout == "C" and array.dtype in ELEMENTS:
        return array.dtype
    raise refuse("lanes need a 1-D C-contiguous array of float32, float64, int32, uint8, uint16 or uint32", array)


def _register(element: Any) -> Lane:
    """Return the lane type in which elements of an array are held."""
    return I32 if element in CODES else Lane(element)


def _pointer(context: Any, builder: Any, array: Any, value: Any, element: ir.Type) -> ir.Value:
    return builder.bitcast(context.make_array(array)(context, builder, value).data, element.as_pointer())


def _widen(builder: Any, data: ir.Value) -> ir.Value:
    """Return small codes as int32; other elements stay."""
    kind = data.type.element
    return builder.zext(data, vector(types.int32)) if isinstance(kind, ir.IntType) and kind.width < 32 else data


def _emit_gather(b: Any, base: ir.Value, index: ir.Value, stride: ir.Type, kind: ir.Type, align: int) -> ir.Value:
    """Load N values of `kind` from base + index * sizeof(stride)."""
    address = VectorGep(b.block, base, index, stride)
    b._insert(address)
    letter = {"float": "f32", "double": "f64"}.get(str(kind), str(kind))
    result = ir.VectorType(kind, N)
    every = ir.Constant(ir.VectorType(I1, N), [1] * N)
    args = [address, INT32(align), every, ir.Constant(result, ir.Undefined)]
    return call_llvm(b, f"llvm.masked.gather.v{N}{letter}.v{N}p0", result, args)


@instruction
def gather(typing: Any, table: Any, index: Any) -> Any:
    """Return table[index], lane by lane; index is an int32 lane."""
    element = _element(table)
    if index != I32:
        raise refuse("gather takes an int32 lane of indices", index)
    kind = LLVM_ELEMENT[element]

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        base = _pointer(ctx, b, sig.args[0], a[0], kind)
        return _widen(b, _emit_gather(b, base, a[1], kind, kind, element.bitwidth // 8))

    return _register(element)(table, I32), emit


@instruction
def gather_pair(typing: Any, table: Any, index: Any) -> Any:
    """Return (table[index], table[index + 1]), lane by lane; 4-byte elements take one 8-byte gather."""
    element = _element(table)
    if index != I32:
        raise refuse("gather_pair takes an int32 lane of indices", index)
    kind = LLVM_ELEMENT[element]
    lane = _register(element)

    def at_once(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        both = _emit_gather(b, _pointer(ctx, b, sig.args[0], a[0], INT32), a[1], INT32, INT64, 4)
        high = b.lshr(both, constant(both.type, 32))
        parts = [b.bitcast(b.trunc(v, vector(types.int32)), vector(lane.element)) for v in (both, high)]
        return ctx.make_tuple(b, sig.return_type, parts)

    def in_turn(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        base = _pointer(ctx, b, sig.args[0], a[0], kind)
        places = (a[1], b.add(a[1], constant(a[1].type, 1)))
        parts = [_widen(b, _emit_gather(b, base, p, kind, kind, element.bitwidth // 8)) for p in places]
        return ctx.make_tuple(b, sig.return_type, parts)

    return types.UniTuple(lane, 2)(table, I32), at_once if element.bitwidth == 32 else in_turn


@instruction
def load(typing: Any, array: Any, start: Any) -> Any:
    """Return array[start : start + N] as a lane."""
    element = _element(array)
    kind = vector(element)

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        place = b.gep(_pointer(ctx, b, sig.args[0], a[0], kind.element), [a[1]])
        return _widen(b, b.load(b.bitcast(place, kind.as_pointer()), align=element.bitwidth // 8))

    return _register(element)(array, types.intp), emit


@instruction
def store(typing: Any, array: Any, start: Any, lane: Any) -> Any:
    """Write a lane to array[start : start + N]; int32 lanes fit unsigned arrays, by their low bits."""
    element = _element(array)
    kind = vector(element)
    if not array.mutable or not is_lane(lane) or lane != _register(element):
        raise refuse(f"store takes a writable array and lanes of {_register(element)}", array, lane)

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        place = b.gep(_pointer(ctx, b, sig.args[0], a[0], kind.element), [a[1]])
        data = a[2] if a[2].type == kind else b.trunc(a[2], kind)
        b.store(data, b.bitcast(place, kind.as_pointer()), align=element.bitwidth // 8)
        return ctx.get_dummy_value()

    return types.void(array, types.intp, lane), emit
