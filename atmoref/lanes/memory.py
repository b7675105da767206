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
    splat,
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


def _permutes(ctx: Any, element: Any) -> bool:
    """Return whether the processor can pick N elements out of 2 N in one instruction."""
    return N == 16 and element.bitwidth == 32 and "+avx512f" in getattr(ctx.codegen(), "_tm_features", "")


class _Window:
    """The 2 N or 4 N elements of a table from its lowest index on, as N-wide loads to permute."""

    def __init__(self, b: Any, base: ir.Value, room: ir.Value, index: ir.Value) -> None:
        """`room` elements of the table may stand before the window."""
        self.b, self.wide = b, ir.VectorType(base.type.pointee, N)
        first, last = b.extract_element(index, INT32(0)), b.extract_element(index, INT32(N - 1))
        low = b.select(b.icmp_signed("<", first, last), first, last)
        low = b.select(b.icmp_signed("<", low, room), low, room)
        self.base, self.low, self.offset = base, low, b.sub(index, splat(b, low))

    def holds(self, size: int) -> ir.Value:
        """Return whether all lanes' elements are among the first `size`."""
        near = self.b.icmp_unsigned("<", self.offset, constant(self.offset.type, size))
        mask = self.b.bitcast(near, ir.IntType(N))
        return self.b.icmp_unsigned("==", mask, mask.type(-1))

    def pick(self, count: int, loads: int) -> list[ir.Value]:
        """Return the elements at offset + 0 ... count - 1 out of 2 or 4 loads."""
        b = self.b
        start = b.bitcast(b.gep(self.base, [b.sext(self.low, INT64)]), self.wide.as_pointer())
        window = [b.load(b.gep(start, [INT32(i)]), align=4) for i in range(loads)]
        name = f"llvm.x86.avx512.vpermi2var.{'ps' if isinstance(self.wide.element, ir.FloatType) else 'd'}.512"
        picked = []
        for i in range(count):
            place = b.add(self.offset, constant(self.offset.type, i))
            pairs = zip(window[::2], window[1::2], strict=True)
            halves = [call_llvm(b, name, self.wide, [low, place, high]) for low, high in pairs]
            upper = b.icmp_unsigned(">=", place, constant(place.type, 2 * N))
            picked.append(halves[0] if loads == 2 else b.select(upper, halves[1], halves[0]))
        return picked


def _emit_near(ctx: Any, b: Any, sig: Any, a: Any, kind: ir.Type, count: int) -> list[ir.Value]:
    """Return table[index + 0 ... count - 1], each out of a window of 2 N or 4 N elements, or else by a gather."""
    array = ctx.make_array(sig.args[0])(ctx, b, a[0])
    base, index = b.bitcast(array.data, kind.as_pointer()), a[1]
    room = b.trunc(b.sub(array.nitems, array.nitems.type(4 * N)), INT32)
    window = _Window(b, base, room, index)
    enough = b.icmp_signed(">=", room, INT32(0))
    join = b.append_basic_block("joined")
    ways = []
    for loads in (2, 4):
        inside, outside = b.append_basic_block("near"), b.append_basic_block("apart")
        b.cbranch(b.and_(window.holds(loads * N + 1 - count), enough), inside, outside)
        b.position_at_end(inside)
        ways.append((window.pick(count, loads), b.block))
        b.branch(join)
        b.position_at_end(outside)
    places = [b.add(index, constant(index.type, i)) for i in range(count)]
    ways.append(([_emit_gather(b, base, place, kind, kind, 4) for place in places], b.block))
    b.branch(join)
    b.position_at_end(join)
    results = [b.phi(window.wide) for _ in range(count)]
    for lanes, block in ways:
        for result, lane in zip(results, lanes, strict=True):
            result.add_incoming(lane, block)
    return results


@instruction
def gather_near(typing: Any, table: Any, index: Any) -> Any:
    """Return what `gather` returns, sooner where all lanes read from 4 N neighbours of a table, or 2 N.

    Neighbouring pixels read neighbouring texels, and a texture's rows often run along the picture's.  A gather of 16
    elements takes 30 cycles, two loads and a permutation a third of that (measured on Sapphire Rapids).
    """
    element = _element(table)
    if index != I32:
        raise refuse("gather_near takes an int32 lane of indices", index)
    kind = LLVM_ELEMENT[element]

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        if _permutes(ctx, element):
            return _emit_near(ctx, b, sig, a, kind, 1)[0]
        base = _pointer(ctx, b, sig.args[0], a[0], kind)
        return _widen(b, _emit_gather(b, base, a[1], kind, kind, element.bitwidth // 8))

    return _register(element)(table, I32), emit


def _gather_pair(table: Any, index: Any, name: str) -> Any:
    """Return signature and code of `gather_pair`."""
    element = _element(table)
    if index != I32:
        raise refuse(f"{name} takes an int32 lane of indices", index)
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
def gather_pair(typing: Any, table: Any, index: Any) -> Any:
    """Return (table[index], table[index + 1]), lane by lane; 4-byte elements take one 8-byte gather."""
    return _gather_pair(table, index, "gather_pair")


@instruction
def gather_pair_near(typing: Any, table: Any, index: Any) -> Any:
    """Return what `gather_pair` returns, sooner where all lanes read from 4 N neighbours of a table, or 2 N."""
    signature, elsewhere = _gather_pair(table, index, "gather_pair_near")
    element = _element(table)

    def emit(ctx: Any, b: Any, sig: Any, a: Any) -> Any:
        if _permutes(ctx, element):
            return ctx.make_tuple(b, sig.return_type, _emit_near(ctx, b, sig, a, LLVM_ELEMENT[element], 2))
        return elsewhere(ctx, b, sig, a)

    return signature, emit


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
