# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Texture reads in kernels: nearest, bilinear, trilinear, projective, shadow compare.

A texture's first row is v = 0; texel i has its centre at (i + 1/2) / width. Pictures whose row 0 is the top are flipped
by the caller. Addressing is clamp to edge: texels stand padded by one all round, so that no index is clamped, and *u, v
(and w) must be in [0, 1]* when they arrive (`lanes.saturate`; NaN would read anywhere). What is zero outside, as a
light map is, is masked by the caller with `inside`, before the clamp.

Three linear filters, chosen at run time by the texture:

exact
    x = u width - 1/2, weight x - floor(x), a + weight (b - a), along x, then y, then z.
fused
    The same with one rounding, fma(weight, b - a, a).
bytes
    8-bit weights and results: x = round(u (256 width)) - 128, texel x >> 8, weight x & 255,
    a + ((weight (b - a) + 128) >> 8) in codes. 256 steps between two texels; within 2 codes of the exact bilinear
    filter and 3 of the trilinear one (less than one per axis; 1.45 and 1.87 measured on random textures).
"""

import inspect
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from atmoref._jit import device
from atmoref.buffers.device import Device, Filter, decode_factors
from atmoref.buffers.formats import Format, decode_as, encode
from atmoref.lanes import (
    F32,
    Interval,
    add_to_exact,
    compiled_only,
    floor,
    fma,
    gather,
    gather_near,
    gather_pair,
    gather_pair_near,
    is_tag,
    lerp_bytes,
    lift,
    overload,
    round_int,
    saturate,
    select,
    shift_right,
    to_int,
)

EXACT: Final = 0
FUSED: Final = 1
BYTES: Final = 2
MODES: Final = {"exact": EXACT, "fused": FUSED, "bytes": BYTES}
EVEN = np.int32(0x00FF00FF)


class Texture(NamedTuple):
    """What a kernel needs to read a texture; made by `texture`."""

    data: Any  # values, flat: channel, slice, row, column, each row, column and (3-D) slice padded by one
    packed: Any  # int32, the same texels as RGBA8 with red in the low byte; one element where no filter needs it
    width: int
    height: int
    depth: int
    row: int  # elements from one row to the next
    slab: int  # from one slice to the next
    plane: int  # from one channel to the next
    mode: int  # EXACT, FUSED, BYTES
    pcf: bool  # a shadow compare filters four results
    clamp_reference: bool  # it clamps its reference to [0, 1]
    inverse: float  # value of a code that the filter `bytes` returns: code * inverse + code * inverse_rest
    inverse_rest: float
    quads: bool  # `packed` holds 2 x 2 footprints of codes


def _channels_first(values: ArrayLike, volume: bool) -> NDArray[Any]:
    """Return (C, D, H, W) from (H, W) or (H, W, C), or a volume's (D, H, W) or (D, H, W, C)."""
    texels = np.asarray(values)
    spatial = 3 if volume else 2
    if texels.ndim not in (spatial, spatial + 1):
        raise ValueError(f"a {spatial}-D texture has {spatial} or {spatial + 1} axes, found shape {texels.shape}")
    if texels.ndim == spatial:
        texels = texels[..., None]
    if 0 in texels.shape or texels.shape[-1] > 4:
        raise ValueError(f"a texture has at least one texel and 1 ... 4 channels, found shape {texels.shape}")
    texels = np.moveaxis(texels, -1, 0)
    return texels if volume else texels[:, None]


def _codes(texels: NDArray[Any], fmt: Format, device: Device) -> NDArray[Any]:
    """Return (C, D, H, W) codes or numbers as the format stores them."""
    if np.issubdtype(texels.dtype, np.integer):
        if fmt.kind != "unorm":
            raise ValueError(f"integers are codes, which format {fmt.name} does not have")
        if texels.min() < 0 or texels.max() > fmt.top:
            raise ValueError(f"{fmt.name} has codes 0 ... {fmt.top}, found {texels.min()} ... {texels.max()}")
        return texels.astype(fmt.storage)
    return np.stack([encode(t, fmt, device, channel=c) for c, t in enumerate(texels)])


def _chosen_filter(fmt: Format, device: Device, filter: Filter | None) -> Filter:
    """Return the filter asked for, or the device's for this format."""
    chosen = filter or (device.bytes_filter if fmt.name == "unorm8" else device.filter)
    if chosen not in MODES:
        raise ValueError(f"filter is {chosen!r}, allowed: {', '.join(MODES)}")
    if chosen == "bytes" and fmt.name != "unorm8":
        raise ValueError(f"filter 'bytes' reads 8-bit codes, format {fmt.name} has none")
    return chosen


def _packed(codes: NDArray[Any]) -> NDArray[np.int32]:
    """Return (C, ...) codes of 8 bits as flat RGBA8, red in the low byte."""
    words = np.zeros(codes[0].size, np.uint32)
    for c, channel in enumerate(codes):
        words |= channel.ravel().astype(np.uint32) << np.uint32(8 * c)
    return words.view(np.int32)


def texture(
    values_or_codes: ArrayLike,
    fmt: Format,
    device: Device,
    arith_dtype: DTypeLike = np.float32,
    filter: Filter | None = None,
    *,
    volume: bool = False,
    compare: Literal["nearest", "pcf"] = "nearest",
) -> Texture:
    """Return a texture for kernels.

    Parameters
    ----------
    values_or_codes
        (H, W) or (H, W, C), C = 1 ... 4; row 0 is v = 0. With `volume` (D, H, W) or (D, H, W, C); slice 0 is w = 0.
        Integers are codes; reals are encoded by the device.
    fmt, device
        How the texels are stored, and by what hardware they are read.
    arith_dtype
        float32 or float64: the arithmetic of the kernel that reads.
    filter
        Overrides the device's choice for this format.
    volume
        Is it three-dimensional?
    compare
        How `shadow_compare` reads it.

    Raises
    ------
    ValueError
        A shape, code, filter or type that a texture cannot have, or more than 2**31 elements.
    """
    real = np.dtype(arith_dtype)
    if real not in (np.float32, np.float64):
        raise ValueError(f"textures are read in float32 or float64, not in {real}")
    chosen = _chosen_filter(fmt, device, filter)
    if compare not in ("nearest", "pcf"):
        raise ValueError(f"compare is {compare!r}, allowed: nearest, pcf")
    texels = _channels_first(values_or_codes, volume)
    channels, depth, height, width = texels.shape
    if chosen == "bytes" and max(depth, height, width) >= 1 << 14:
        raise ValueError(f"filter 'bytes' takes at most 16383 texels each way, found {texels.shape[1:]}")
    padding = ((0, 0), (1, 1) if volume else (0, 0), (1, 1), (1, 1))
    row, slab = width + 2, (width + 2) * (height + 2)
    plane = slab * (depth + 2 if volume else 1)
    if channels * plane >= 1 << 31:
        raise ValueError(f"a texture of shape {texels.shape} has more elements than a 32-bit index reaches")
    codes = np.pad(_codes(texels, fmt, device), padding, mode="edge")
    quads = fmt.name == "unorm8" and chosen != "bytes" and not volume
    packed = _packed(codes) if chosen == "bytes" else _quads(codes) if quads else np.zeros(1, np.int32)
    data = np.ascontiguousarray(decode_as(codes, fmt, device, real).ravel())
    clamps = device.clamp_shadow_reference and fmt.kind == "unorm"
    mode = MODES[chosen]
    factors = decode_factors(fmt, device) if fmt.kind == "unorm" else (1.0, 0.0)
    return Texture(
        data, packed, width, height, depth, row, slab, plane, mode, compare == "pcf", clamps, *factors, quads
    )  # fmt: skip


def _quads(codes: NDArray[Any]) -> NDArray[np.int32]:
    """Return, for each texel of each channel, the codes of its 2 x 2 footprint in the four bytes of a word."""
    footprints = np.pad(codes.astype(np.uint32), ((0, 0), (0, 0), (0, 1), (0, 1)), mode="edge")
    a, b = footprints[..., :-1, :-1], footprints[..., :-1, 1:]
    c, d = footprints[..., 1:, :-1], footprints[..., 1:, 1:]
    return np.ascontiguousarray(a | b << 8 | c << 16 | d << 24).ravel().view(np.int32)


def for_lanes(code: Any) -> Any:
    """Return the public name of a helper of lanes, under which intervals have code of their own."""
    function = compiled_only(code)

    def choose(*types: Any) -> Any:
        return None if is_tag(types[0], Interval) else code

    choose.__signature__ = inspect.signature(code)  # type: ignore[attr-defined]
    overload(function)(choose)
    return function


# ---- the usual case
@for_lanes
def usual_maps(arith, shadow, light):
    """Return whether references are clamped and the light map has 8 bits, filtered in floats."""
    return shadow.clamp_reference and light.quads and light.mode == EXACT


@for_lanes
def as_usual(arith, tex):
    """Return one of `usual_maps` with its choices as constants, so that a loop's compiler sees one way only."""
    return Texture(
        tex.data, tex.packed, tex.width, tex.height, tex.depth, tex.row, tex.slab, tex.plane,
        EXACT, tex.pcf, True, tex.inverse, tex.inverse_rest, True,
    )  # fmt: skip


# ---- coordinates
@device
def project(x, y, w):
    """Return (x / w, y / w) as devices do: both times one reciprocal."""
    inverse = 1.0 / w
    return x * inverse, y * inverse


@device
def inside(u, v):
    """Return the mask of coordinates within the texture, borders included; NaN is outside."""
    return (u >= 0.0) & (u <= 1.0) & (v >= 0.0) & (v <= 1.0)


@device
def lerp(tex, weight, a, b):
    """Return the linear interpolation of the texture's filter."""
    if tex.mode == FUSED:
        return fma(weight, b - a, a)
    return a + weight * (b - a)


@device
def lerp_quad(tex, wx, wy, a, b, c, d):
    """Return the bilinear interpolation of a footprint, along x first."""
    if tex.mode == FUSED:
        return fused_quad(wx, wy, a, b, c, d)
    return exact_quad(wx, wy, a, b, c, d)


@device
def fused_quad(wx, wy, a, b, c, d):
    """Return the bilinear interpolation with one rounding each."""
    low = fma(wx, b - a, a)
    return fma(wy, fma(wx, d - c, c) - low, low)


@device
def exact_quad(wx, wy, a, b, c, d):
    """Return the bilinear interpolation with separate multiplications and additions."""
    low = a + wx * (b - a)
    return low + wy * (c + wx * (d - c) - low)


@device
def footprint(tex, u, v):
    """Return the index of the lower left texel of a bilinear footprint, and the weights of the others."""
    x, y = u * tex.width - 0.5, v * tex.height - 0.5
    fx, fy = floor(x), floor(y)
    return to_int(fy) * tex.row + to_int(fx) + (tex.row + 1), x - fx, y - fy


@device
def byte_axis(u, size):
    """Return the lower texel and the weight of the 8-bit filter along one axis; the weight in both halves."""
    x = round_int(u * (size * 256)) - 128
    weight = x & 255
    return x >> 8, weight | (weight << 16)


@compiled_only
def byte_value(tex: Any, x: Any) -> Any:
    """Return the values of codes of 8 bits, given as reals."""


@overload(byte_value)
def _byte_value(tex: Any, x: Any) -> Any:
    if x == F32:
        return lambda tex, x: add_to_exact(x, tex.inverse, x * tex.inverse_rest)  # exact by `decode_factors`
    return lambda tex, x: x / 255.0


# ---- filters
@device
def texel(tex, u, v):
    """Return the index of the texel at (u, v)."""
    return to_int(v * tex.height) * tex.row + to_int(u * tex.width) + (tex.row + 1)


@for_lanes
def nearest(arith, tex, channel, u, v):
    """Return the texel at (u, v)."""
    return lift(arith, gather(tex.data, texel(tex, u, v) + channel * tex.plane))


@device
def quad(arith, tex, index, wx, wy):
    """Return the bilinear filter of four texels from `index`."""
    a, b = lift(arith, gather_pair(tex.data, index))
    c, d = lift(arith, gather_pair(tex.data, index + tex.row))
    return lerp_quad(tex, wx, wy, a, b, c, d)


@device
def byte_footprint(arith, tex, index, wx, wy):
    """Return what `quad` returns of an 8-bit texture, from one gather of four codes instead of four of values."""
    return quad_of_bytes(arith, tex, gather(tex.packed, index), wx, wy)


@device
def quad_of_bytes(arith, tex, word, wx, wy):
    """Return the bilinear filter of the four codes in a word."""
    return lerp_quad(tex, wx, wy, *codes_of_word(arith, tex, word))


@device
def codes_of_word(arith, tex, word):
    """Return the values of the four codes in a word."""
    a, b = byte_value(tex, lift(arith, word & 255)), byte_value(tex, lift(arith, (word >> 8) & 255))
    c = byte_value(tex, lift(arith, (word >> 16) & 255))
    return a, b, c, byte_value(tex, lift(arith, shift_right(word, 24)))


@device
def byte_quad(tex, index, shift, wx, wy):
    """Return the 8-bit filter of channels `shift` and `shift` + 16 bits, in codes, packed as they were."""
    a, b = gather_pair(tex.packed, index)
    c, d = gather_pair(tex.packed, index + tex.row)
    low = lerp_bytes((a >> shift) & EVEN, (b >> shift) & EVEN, wx)
    return lerp_bytes(low, lerp_bytes((c >> shift) & EVEN, (d >> shift) & EVEN, wx), wy)


@for_lanes
def bilinear(arith, tex, channel, u, v):
    """Return one channel of the bilinear filter at (u, v)."""
    if tex.mode == BYTES:
        (x, wx), (y, wy) = byte_axis(u, tex.width), byte_axis(v, tex.height)
        code = byte_quad(tex, y * tex.row + x + (tex.row + 1), 8 * channel, wx, wy)
        return byte_value(tex, lift(arith, code & 255))
    index, wx, wy = footprint(tex, u, v)
    if tex.quads:
        return byte_footprint(arith, tex, index + channel * tex.plane, wx, wy)
    return quad(arith, tex, index + channel * tex.plane, wx, wy)


@for_lanes
def bilinear_pair(arith, tex, channel, a, b):
    """Return `bilinear` at two places (us, vs); the reads stand side by side, for each waits for all before it."""
    if tex.quads and tex.mode != BYTES:
        index_a, x_a, y_a = footprint(tex, a[0], a[1])
        index_b, x_b, y_b = footprint(tex, b[0], b[1])
        plane = channel * tex.plane
        word_a, word_b = gather_near(tex.packed, index_a + plane), gather_near(tex.packed, index_b + plane)
        codes_a, codes_b = codes_of_word(arith, tex, word_a), codes_of_word(arith, tex, word_b)
        if tex.mode == FUSED:
            return fused_quad(x_a, y_a, *codes_a), fused_quad(x_b, y_b, *codes_b)
        return exact_quad(x_a, y_a, *codes_a), exact_quad(x_b, y_b, *codes_b)
    return bilinear(arith, tex, channel, a[0], a[1]), bilinear(arith, tex, channel, b[0], b[1])


@for_lanes
def bilinear3(arith, tex, u, v):
    """Return the first three channels of the bilinear filter at (u, v)."""
    if tex.mode == BYTES:
        (x, wx), (y, wy) = byte_axis(u, tex.width), byte_axis(v, tex.height)
        index = y * tex.row + x + (tex.row + 1)
        rb, g = byte_quad(tex, index, 0, wx, wy), byte_quad(tex, index, 8, wx, wy)
        return (
            byte_value(tex, lift(arith, rb & 255)),
            byte_value(tex, lift(arith, g & 255)),
            byte_value(tex, lift(arith, rb >> 16)),
        )
    index, wx, wy = footprint(tex, u, v)
    if tex.quads:
        return (
            byte_footprint(arith, tex, index, wx, wy),
            byte_footprint(arith, tex, index + tex.plane, wx, wy),
            byte_footprint(arith, tex, index + 2 * tex.plane, wx, wy),
        )
    return (
        quad(arith, tex, index, wx, wy),
        quad(arith, tex, index + tex.plane, wx, wy),
        quad(arith, tex, index + 2 * tex.plane, wx, wy),
    )


@device
def three_quads(arith, tex, wx, wy, words):
    """Return the bilinear filter of three channels from the words of their footprints."""
    return (
        lerp_quad(tex, wx, wy, *codes_of_word(arith, tex, words[0])),
        lerp_quad(tex, wx, wy, *codes_of_word(arith, tex, words[1])),
        lerp_quad(tex, wx, wy, *codes_of_word(arith, tex, words[2])),
    )


@for_lanes
def bilinear3_pair(arith, tex, a, b):
    """Return `bilinear3` at two places (us, vs), the reads side by side."""
    if tex.quads and tex.mode != BYTES:
        at, x_a, y_a = footprint(tex, a[0], a[1])
        to, x_b, y_b = footprint(tex, b[0], b[1])
        second, third = tex.plane, 2 * tex.plane
        words_a = (
            gather_near(tex.packed, at),
            gather_near(tex.packed, at + second),
            gather_near(tex.packed, at + third),
        )
        words_b = (
            gather_near(tex.packed, to),
            gather_near(tex.packed, to + second),
            gather_near(tex.packed, to + third),
        )
        return three_quads(arith, tex, x_a, y_a, words_a), three_quads(arith, tex, x_b, y_b, words_b)
    return bilinear3(arith, tex, a[0], a[1]), bilinear3(arith, tex, b[0], b[1])


@for_lanes
def trilinear(arith, tex, channel, u, v, w):
    """Return one channel of the trilinear filter of a volume at (u, v, w)."""
    if tex.mode == BYTES:
        (x, wx), (y, wy), (z, wz) = byte_axis(u, tex.width), byte_axis(v, tex.height), byte_axis(w, tex.depth)
        index = z * tex.slab + y * tex.row + x + (tex.slab + tex.row + 1)
        near = byte_quad(tex, index, 8 * channel, wx, wy)
        code = lerp_bytes(near, byte_quad(tex, index + tex.slab, 8 * channel, wx, wy), wz)
        return byte_value(tex, lift(arith, code & 255))
    index, wx, wy = footprint(tex, u, v)
    z = w * tex.depth - 0.5
    fz = floor(z)
    index = to_int(fz) * tex.slab + index + (tex.slab + channel * tex.plane)
    near = quad(arith, tex, index, wx, wy)
    return lerp(tex, z - fz, near, quad(arith, tex, index + tex.slab, wx, wy))


@device
def shadow_reference(tex, reference):
    """Return a reference as the device compares it: clamped to [0, 1] where it does so.

    Else everything beyond the light's far plane would be dark.
    """
    if tex.clamp_reference:
        return saturate(reference)
    return reference


@for_lanes
def shadow_compare(arith, tex, u, v, reference):
    """Return 1 where reference <= stored depth (channel 0), else 0; with PCF the bilinear filter of four results."""
    reference = shadow_reference(tex, reference)
    one = lift(arith, 1.0)
    if not tex.pcf:
        return select(reference <= nearest(arith, tex, 0, u, v), one, 0.0)
    index, wx, wy = footprint(tex, u, v)
    a, b = lift(arith, gather_pair_near(tex.data, index))
    c, d = lift(arith, gather_pair_near(tex.data, index + tex.row))
    below_a, below_b = select(reference <= a, one, 0.0), select(reference <= b, one, 0.0)
    return lerp_quad(tex, wx, wy, below_a, below_b, select(reference <= c, one, 0.0), select(reference <= d, one, 0.0))


@for_lanes
def shadow_pair(arith, tex, a, b, reference_a, reference_b):
    """Return `shadow_compare` at two places (us, vs), the reads side by side."""
    if tex.pcf:
        first = shadow_compare(arith, tex, a[0], a[1], reference_a)
        return first, shadow_compare(arith, tex, b[0], b[1], reference_b)
    index_a, index_b = texel(tex, a[0], a[1]), texel(tex, b[0], b[1])
    depth_a, depth_b = lift(arith, gather_near(tex.data, index_a)), lift(arith, gather_near(tex.data, index_b))
    one = lift(arith, 1.0)
    first = select(shadow_reference(tex, reference_a) <= depth_a, one, 0.0)
    return first, select(shadow_reference(tex, reference_b) <= depth_b, one, 0.0)
