"""What hardware decides: rounding on store, products of blends, filter weights, the shadow reference.

The specifications leave these open, so each is a field of `Device`; `rule` turns a device and a format into the
numbers that a kernel gets as uniforms.

What is the same on every device here: a NaN stored as unorm gives 0, a float format keeps it (r11g11b10f as well);
-0 is stored as +0; denormals are kept; blends into float formats are separate multiplications and additions, without
fused multiply-add, rounded once by the store.

Presets
-------
ideal
    The specifications read strictly: nearest even everywhere, blend sources quantised before the blend (as fixed-point
    hardware does, on which Dobashi et al. 2002 drew), products of codes are the correctly rounded real product, exact
    filter weights.
gl_llvmpipe
    Mesa 22.3.6 llvmpipe as measured, bit for bit. unorm10 goes through 16 bits (rounded to 16, cut to 10); float16 and
    r11g11b10f are cut toward zero; a unorm code is read as code * float32(1 / top). Formats outside `Device.measured`
    fall back on the rules of `ideal` and are no statement about Mesa, which has neither of them by itself: unorm12 is
    kept in 16 bits there, unorm2 is only the alpha of unorm10.
geforce3, geforce_fx
    ASSUMED, from general knowledge of fixed-point blenders of the time; nothing was measured and no claim rests on
    them. Both filter 8-bit textures with 8 bits. geforce3 cuts products and stores (truncation), its 9-bit register
    combiners are ignored; geforce_fx adds one half and cuts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, get_args

import numpy as np

if TYPE_CHECKING:
    from atmoref.buffers.formats import Format

Rounding = Literal["nearest_even", "half_up", "truncate"]
Product = Literal["rounded", "two_step"]
Filter = Literal["exact", "fused", "bytes"]
Decode = Literal["divided", "multiplied"]
ROUNDINGS: Final[tuple[str, ...]] = get_args(Rounding)
FILTERS: Final[tuple[str, ...]] = get_args(Filter)


@dataclass(frozen=True, slots=True)
class Budget:
    """By how much a correct build may leave the mirror beyond the roundings of its own arithmetic.

    What is allowed to single operations, from + to exp, is the specifications' and the same for every device: see
    `lanes.intervals` and `lanes.interval_functions`.

    Parameters
    ----------
    coordinate
        Of a texture coordinate in [0, 1], absolute.  Two ulps below 1: a rounding of the hardware's own, and one of
        its reciprocal.  Assumed; llvmpipe needs none.
    attribute
        Of an interpolated vertex attribute, as a fraction of the greatest magnitude at the triangle's corners.
        Measured on llvmpipe: 3e-6 of colours up to 1 and 8e-6 m of coordinates up to some 40 m (docs/validation-gl.md).
    weight
        Of barycentric weights, absolute, in cells of the mesh.  Assumed: vertices stand on whole pixels.
    weight_permitted
        The same for the envelope: 1/256 of a pixel in a cell of four, vertices being snapped to 8 bits below the pixel.
    """

    coordinate: float = 2.0**-22
    attribute: float = 2.0**-18
    weight: float = 2.0**-16
    weight_permitted: float = 2.0**-10


@dataclass(frozen=True, slots=True)
class Device:
    """What one piece of hardware decides.

    Parameters
    ----------
    name
        As written in scene files and in every output.
    rounding
        How a real becomes a unorm code. The three rules act on the product x * top in the arithmetic of the kernel.
    rounding_is_open
        May a scene override `rounding`?
    float_rounding
        How a real becomes a small float. `truncate` goes toward zero; a finite overflow then gives the largest finite
        value instead of infinity. r11g11b10f always overflows to its largest value.
    quantise_first
        Is a blend's source (its alpha too) stored to a code before the blend computes with codes? If not, the blend is
        computed in reals and rounded once.
    product
        Codes a, b of n bits: `rounded` is a b / top by the device's rounding; `two_step` is Mesa's
        (t + (t >> n) + half) >> n of t = a b, which differs from the nearest code in 24 of 65536 pairs of 8 bits.
    decode
        Value of a unorm code in float32: `divided` is code / top, correctly rounded; `multiplied` is the code times the
        rounded 1 / top, 1 ulp off for half of all codes of 8 bits. In float64 always code / top.
    through_16_bits
        Formats that are blended and rounded as 16-bit codes, then cut.
    bytes_filter
        Filter of textures of format unorm8: `bytes` has 8-bit weights and 8-bit results.
    filter
        Filter of all other textures: `exact` is a + w (b - a), `fused` the same with one rounding.
    clamp_shadow_reference
        Is the reference of a shadow compare clamped to [0, 1] where the depth format is unorm?
    interpolation
        Vertex attributes: `triangle` is a + wb (b - a) + wc (c - a) with barycentric weights; `screen` a plane over the
        screen: its slopes and its value at the centre of pixel (0, 0) from the triangle's set-up, two fused steps from
        there, and a pixel centre on the edge of two triangles belongs to the upper one.
    measured
        Formats whose rules were measured on the device; empty for a device that is a definition or an assumption.
    assumed
        Was nothing measured?
    budget
        What is left open to correct builds on it; read by intervals alone.
    """

    name: str
    rounding: Rounding = "nearest_even"
    rounding_is_open: bool = True
    float_rounding: Rounding = "nearest_even"
    quantise_first: bool = True
    product: Product = "rounded"
    decode: Decode = "divided"
    through_16_bits: frozenset[str] = frozenset()
    bytes_filter: Filter = "exact"
    filter: Filter = "exact"
    clamp_shadow_reference: bool = True
    interpolation: Literal["triangle", "screen"] = "triangle"
    measured: frozenset[str] = frozenset()
    assumed: bool = False
    budget: Budget = Budget()

    def __post_init__(self) -> None:
        for key, allowed in (("rounding", ROUNDINGS), ("float_rounding", ROUNDINGS)):
            if getattr(self, key) not in allowed:
                raise ValueError(f"device {self.name}: {key} is {getattr(self, key)!r}, allowed: {', '.join(allowed)}")
        if self.through_16_bits and not self.quantise_first:
            raise ValueError(f"device {self.name}: blending through 16 bits means that sources are quantised first")


_PRESETS = (
    Device("ideal"),
    Device(
        "gl_llvmpipe",
        rounding_is_open=False,
        float_rounding="truncate",
        product="two_step",
        decode="multiplied",
        through_16_bits=frozenset({"unorm10"}),
        bytes_filter="bytes",
        filter="fused",
        interpolation="screen",
        measured=frozenset({"unorm8", "unorm10", "unorm16", "depth24", "float16", "r11g11b10f", "float32"}),
    ),
    Device("geforce3", rounding="truncate", bytes_filter="bytes", assumed=True),
    Device("geforce_fx", rounding="half_up", bytes_filter="bytes", assumed=True),
)
DEVICES: Final[Mapping[str, Device]] = MappingProxyType({d.name: d for d in _PRESETS})


class Rule(NamedTuple):
    """A device's treatment of one format, as run-time uniforms; every format has the same types, so nothing recompiles.

    A *working* code is what blends compute with: the stored code, or its expansion to 16 bits.
    """

    unorm: bool  # else a float format
    even: bool  # nearest even; else floor(x + bias)
    bias: float
    first: bool  # sources are quantised before the blend
    top: float  # greatest working code
    through: bool  # stored codes are working codes cut by `narrow`
    plain: bool  # nearest even, sources first, stored codes as they are: what most devices do, without further tests
    bits: int  # of a working code
    before: int  # a product of codes: t = a b + before, (t + (t >> bits) + after) >> bits
    after: int
    stored_top: float  # greatest stored code
    inverse: float  # the value of a code in float32 is code * inverse + code * inverse_rest
    inverse_rest: float
    narrow: float  # stored = floor(working * narrow); working = stored / narrow + floor(stored * carry)
    carry: float
    digits: int  # significand bits of a float format, the leading one included
    least_exponent: int  # its smallest normal number is 2**least_exponent
    greatest: float  # its greatest finite number
    overflow: float  # what a finite number beyond it becomes
    least: float  # lower clamp: 0 for unsigned formats


def decode_factors(fmt: Format, device: Device) -> tuple[float, float]:
    """Return (a, b): the value of a unorm code in float32 is code * a + code * b.

    `divided`: a + b = 1 / top with a short enough that code * a is exact. The sum then is code / top correctly rounded
    for every code of 2 ... 16 bits (tests enumerate them), and within 1 ulp for depth24. `multiplied`: b = 0.
    """
    bits, top = fmt.bits, fmt.top
    if device.decode == "multiplied" and fmt.name in device.measured:
        return float(np.float32(1.0 / top)), 0.0
    short = max(24 - bits, 1)
    scale = 2.0 ** (bits + short - 1)
    a = float(int(scale / top)) / scale
    return a, 1.0 / top - a


def _unorm_rule(fmt: Format, device: Device, rounding: Rounding) -> Rule:
    bits, top = fmt.bits, fmt.top
    through = fmt.name in device.through_16_bits
    work = 16 if through else bits
    half = 1 << (work - 1)
    if device.product == "two_step" and fmt.name in device.measured:
        before, after = 0, half
    elif rounding == "truncate":
        before, after = 0, 1
    else:  # a b / top is never a tie, top being odd: nearest even and half up agree
        before, after = half, 0
    inverse, rest = decode_factors(fmt, device)
    return Rule(
        unorm=True,
        even=rounding == "nearest_even",
        bias=0.5 if rounding == "half_up" else 0.0,
        first=device.quantise_first,
        top=float((1 << work) - 1),
        through=through,
        plain=device.quantise_first and not through and rounding == "nearest_even",
        bits=work,
        before=before,
        after=after,
        stored_top=float(top),
        inverse=inverse,
        inverse_rest=rest,
        narrow=2.0 ** (bits - work),
        carry=2.0 ** (work - 2 * bits) if through else 0.0,
        digits=0,
        least_exponent=0,
        greatest=0.0,
        overflow=0.0,
        least=0.0,
    )


def _float_rule(fmt: Format, rounding: Rounding, channel: int) -> Rule:
    greatest = fmt.greatest(channel)
    saturates = rounding == "truncate" or not fmt.signed
    return Rule(
        unorm=False,
        even=rounding == "nearest_even",
        bias=0.5 if rounding == "half_up" else 0.0,
        first=False,
        top=1.0,
        through=False,
        plain=False,
        bits=0,
        before=0,
        after=0,
        stored_top=1.0,
        inverse=1.0,
        inverse_rest=0.0,
        narrow=1.0,
        carry=0.0,
        digits=fmt.mantissa(channel) + 1,
        least_exponent=fmt.least_exponent,
        greatest=greatest,
        overflow=greatest if saturates else float("inf"),
        least=float("-inf") if fmt.signed else 0.0,
    )


def rule(fmt: Format, device: Device, rounding: Rounding | None = None, channel: int = 0) -> Rule:
    """Return the uniforms by which kernels store, read and blend one channel of a format on a device.

    Parameters
    ----------
    fmt
        The format of the buffer.
    device
        The hardware.
    rounding
        Overrides the device's rule of both unorm and float formats; None keeps it.
    channel
        Matters for r11g11b10f alone, whose third channel has one bit less.

    Raises
    ------
    ValueError
        An unknown rounding, one given for a device that leaves no choice, or a channel out of range.
    """
    if rounding is not None:
        if rounding not in ROUNDINGS:
            raise ValueError(f"rounding is {rounding!r}, allowed: {', '.join(ROUNDINGS)}")
        if not device.rounding_is_open:
            raise ValueError(
                f"rounding {rounding!r} contradicts device {device.name!r}, whose rounding is measured and fixed; "
                "leave rounding out, or take a device that leaves it open (ideal, geforce3, geforce_fx)"
            )
    if not 0 <= channel <= 3:
        raise ValueError(f"channel is {channel}, allowed: 0 ... 3")
    if fmt.kind == "unorm":
        return _unorm_rule(fmt, device, rounding or device.rounding)
    return _float_rule(fmt, rounding or device.float_rounding, channel)
