"""Formats of one channel: what a buffer can hold, and how reals become that and back.

A unorm format holds codes 0 ... top, of value code / top. A float format holds the float32 (float64) numbers that it
can represent. Layout is elsewhere; blends are in `blend`, whose lane functions give the same bits as `encode`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from atmoref.buffers.device import Device, Rounding, Rule, decode_factors, rule

Arithmetic = Literal["float32", "float64"]


@dataclass(frozen=True, slots=True)
class Format:
    """How one channel is stored.

    Parameters
    ----------
    name
        As written in scene files.
    kind
        `unorm` or `float`.
    bits
        Width of a channel; of r11g11b10f, of its widest.
    storage
        NumPy type of codes handed out; r11g11b10f is handed out as float32, whose numbers contain its own.
    mantissa_bits
        Explicit significand bits of a float format, one number or one for each channel.
    exponent_bits
        Of a float format; its bias is 2**(exponent_bits - 1) - 1.
    signed
        Can it hold negative numbers?
    """

    name: str
    kind: Literal["unorm", "float"]
    bits: int
    storage: type[np.generic]
    mantissa_bits: tuple[int, ...] = ()
    exponent_bits: int = 0
    signed: bool = False

    @property
    def top(self) -> int:
        """Greatest code of a unorm format."""
        if self.kind != "unorm":
            raise ValueError(f"{self.name} is a float format and has no codes")
        return (1 << self.bits) - 1

    @property
    def least_exponent(self) -> int:
        """The smallest normal number of a float format is 2**least_exponent."""
        return 2 - (1 << (self.exponent_bits - 1))

    def mantissa(self, channel: int = 0) -> int:
        """Return the explicit significand bits of a channel."""
        return self.mantissa_bits[min(channel, len(self.mantissa_bits) - 1)]

    def greatest(self, channel: int = 0) -> float:
        """Return the greatest finite number of a channel."""
        if self.kind == "unorm":
            return 1.0
        exponent = (1 << (self.exponent_bits - 1)) - 1
        return float(2.0**exponent * (2.0 - 2.0 ** -self.mantissa(channel)))


_ALL = (
    Format("unorm2", "unorm", 2, np.uint8),
    Format("unorm8", "unorm", 8, np.uint8),
    Format("unorm10", "unorm", 10, np.uint16),
    Format("unorm12", "unorm", 12, np.uint16),
    Format("unorm16", "unorm", 16, np.uint16),
    Format("depth24", "unorm", 24, np.uint32),
    Format("float16", "float", 16, np.float16, (10,), 5, True),
    Format("r11g11b10f", "float", 11, np.float32, (6, 6, 5), 5, False),
    Format("float32", "float", 32, np.float32, (23,), 8, True),
    Format("float64", "float", 64, np.float64, (52,), 11, True),
)
FORMATS: Final[Mapping[str, Format]] = MappingProxyType({f.name: f for f in _ALL})


def _round(r: Rule, x: NDArray[Any]) -> NDArray[Any]:
    """Round non-negative reals in units of a last place."""
    if r.even:
        return np.asarray(np.rint(x))
    whole = np.floor(x)
    return np.asarray(np.where((x - whole) + x.dtype.type(r.bias) >= 1, whole + x.dtype.type(1), whole))


def _encode_unorm(x: NDArray[Any], r: Rule) -> NDArray[Any]:
    """Codes, as integral reals of x's type."""
    real = x.dtype.type
    x = np.where(x > 0, np.minimum(x, real(1)), real(0))  # NaN gives 0
    codes = _round(r, x * real(r.top))
    return np.asarray(np.floor(codes * real(r.narrow))) if r.through else codes


def _encode_float(x: NDArray[Any], r: Rule) -> NDArray[Any]:
    """Numbers of a float format, in x's type."""
    real = x.dtype.type
    finite = np.isfinite(x)
    positive = x > 0
    size = np.where(finite, np.abs(x), real(0))
    if r.digits < np.finfo(x.dtype).nmant + 1:
        _, exponent = np.frexp(size)
        last_place = np.maximum(exponent, r.least_exponent + 1) - r.digits  # frexp's mantissa is below 1
        size = np.ldexp(_round(r, np.ldexp(size, -last_place)), last_place)
        size = np.where(size > r.greatest, real(r.overflow), size)
    size = np.where(np.isinf(x), real(np.inf), size)
    y = np.where(positive, size, np.maximum(-size, real(r.least)) + real(0))
    return np.asarray(np.where(np.isnan(x), real(np.nan), y))


def encode(
    values: ArrayLike, fmt: Format, device: Device, *, rounding: Rounding | None = None, channel: int = 0
) -> NDArray[Any]:
    """Return what a format stores for reals, with the bits of the lane function `blend.encode`.

    Parameters
    ----------
    values
        Any shape. float32 arrays are rounded as float32 arithmetic does (the product x * top is in float32), all else
        as float64.
    fmt, device
        Format and hardware.
    rounding
        Overrides the device's rule where that is open.
    channel
        Of r11g11b10f.

    Returns
    -------
    ndarray
        Of type `fmt.storage`: codes of a unorm format, numbers of a float format. NaN gives code 0, or NaN; -0 gives
        +0. Error: half a step for the nearest rules, one step for truncation (plus half an ulp of x * top).
    """
    x = np.asarray(values)
    if x.dtype != np.float32:
        x = x.astype(np.float64)
    r = rule(fmt, device, rounding, channel)
    with np.errstate(invalid="ignore", over="ignore", under="ignore"):
        stored = _encode_unorm(x, r) if fmt.kind == "unorm" else _encode_float(x, r)
        return np.asarray(stored).astype(fmt.storage)


def decode(codes: ArrayLike, fmt: Format) -> NDArray[np.float64]:
    """Return the values of codes: code / top of a unorm format (correctly rounded), else the number itself."""
    c = np.asarray(codes)
    if fmt.kind == "unorm":
        if not np.issubdtype(c.dtype, np.integer):
            raise ValueError(f"{fmt.name} is decoded from integer codes, not from {c.dtype}")
        return np.asarray(c.astype(np.float64) / fmt.top)
    return c.astype(np.float64)


def decode_as(codes: ArrayLike, fmt: Format, device: Device, dtype: DTypeLike) -> NDArray[Any]:
    """Return the values that a kernel of float32 or float64 arithmetic reads on a device, in that type.

    Up to 16 bits the bits are those of the lane function `blend.value`. Error: none where the device divides (correctly
    rounded), else 1 ulp in float32.
    """
    if fmt.kind == "unorm" and np.dtype(dtype) == np.float32:
        factor, rest = decode_factors(fmt, device)
        c = np.asarray(codes).astype(np.float32)
        return np.asarray(c / np.float32(fmt.top) if rest else c * np.float32(factor))
    return decode(codes, fmt).astype(dtype)


def named(name: str) -> Format:
    """Return the format of that name.

    Raises
    ------
    ValueError
        Names what is allowed.
    """
    if name not in FORMATS:
        raise ValueError(f"format is {name!r}, allowed: {', '.join(FORMATS)}")
    return FORMATS[name]
