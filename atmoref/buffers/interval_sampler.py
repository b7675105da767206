# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Texture reads of intervals: hulls over the box of their coordinates, under the same names as in `sampler`.

Coordinates widen by the device's budget (`Interval.coordinate`).  A linear filter is linear in each coordinate between
texel centres, so its extremes over a box lie at corners and kinks: both ends of the weight meet the same end of the
texels, and a texel centre within the box counts as it is.  A box that spans more than two cells of an axis (where a
surface is undecided, for example) reads the texture's least and greatest texel.  Texels themselves may be intervals: a
shadow map that was drawn.

`device`: the filter that the texture states, in its own order; `bytes` to the code.  `envelope`: weights may be off by
`WEIGHT` of a texel, and a texture of 8-bit codes may be filtered in 8 bits, one rounding of half a code an axis.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import device, subroutine
from atmoref.buffers import sampler
from atmoref.buffers.sampler import BYTES, Texture
from atmoref.lanes import (
    Interval,
    floor,
    gather,
    is_tag,
    maximum,
    minimum,
    overload,
    pair,
    rint,
    saturate,
    select,
    to_int,
)
from atmoref.lanes import instructions as lane
from atmoref.lanes.intervals import above, below, widened

WEIGHT: Final = 1.0 / 256.0
HALF_CODE: Final = 0.5


class TextureBounds(NamedTuple):
    """What a kernel needs to read a texture in intervals; texels are values, or codes where the filter is `bytes`."""

    low: NDArray[np.float32]  # flat and padded as `Texture.data`
    high: NDArray[np.float32]
    width: int
    height: int
    depth: int
    row: int
    slab: int
    plane: int
    mode: int
    pcf: bool
    clamp_reference: bool
    inverse: float  # value of a texel: texel * inverse + texel * inverse_rest; 1 and 0 where texels are values
    inverse_rest: float
    least: float  # texel
    greatest: float
    envelope: bool
    code: float  # a step of 8 bits in texels, 0 where no filter of 8 bits is permitted


def texture_bounds(low: Texture, high: Texture, *, eight_bits: bool, envelope: bool) -> TextureBounds:
    """Return a texture for kernels of intervals, from textures of its least and greatest texels.

    `eight_bits`: it holds 8-bit codes, which the specifications let a device filter in 8 bits.
    """
    codes = low.mode == BYTES
    ends = [_codes(t) if codes else np.asarray(t.data, np.float32) for t in (low, high)]
    factors = (low.inverse, low.inverse_rest) if codes else (1.0, 0.0)
    step = (1.0 if codes else 1.0 / 255.0) if eight_bits else 0.0
    return TextureBounds(
        ends[0], ends[1], low.width, low.height, low.depth, low.row, low.slab, low.plane, low.mode, low.pcf,
        low.clamp_reference, *factors, float(ends[0].min()), float(ends[1].max()), envelope, step,
    )  # fmt: skip


def _codes(texels: Texture) -> NDArray[np.float32]:
    """Return the codes of a texture that is filtered in 8 bits, channel after channel."""
    words = texels.packed.view(np.uint32)
    channels = texels.data.size // texels.plane
    return np.concatenate([(words >> np.uint32(8 * c) & np.uint32(255)).astype(np.float32) for c in range(channels)])


class Axis(NamedTuple):
    """A box along one axis, lanes: first texel, weights at both ends, a texel centre between them, more than one."""

    first: Any
    start: Any
    end: Any
    kink: Any
    far: Any


# ---- coordinates
@device
def _coordinate(arith, x):
    """Return a coordinate as it may reach the texture unit, within [0, 1]."""
    return saturate(widened(x, arith.coordinate))


@device
def _axis(x, size, bytes_filter, slack):
    """Return the box of a coordinate; `slack` in texels.  Weights are 0 ... 1, or 0 ... 256 of the 8-bit filter."""
    unit = x.lo * 0.0 + 1.0
    if bytes_filter:
        unit = unit * 256.0
        steps = x * (size * 256.0)
        lo, hi = rint(steps.lo) - 128.0, rint(steps.hi) - 128.0
    else:
        texels = x * float(size) - 0.5
        lo, hi = maximum(texels.lo - slack, -0.5), minimum(texels.hi + slack, size - 0.5)
    first, last = floor(lo / unit), floor(hi / unit)
    start, end = lo - first * unit, hi - last * unit
    if not bytes_filter:  # the subtraction may round
        start, end = maximum(below(start), 0.0), minimum(above(end), 1.0)
    return Axis(to_int(first), start, end, last > first, last > first + 1.0)


# ---- texels
@device
def _row(tex, index):
    """Return low and high ends of three neighbouring texels; one beyond the last texel is never used."""
    end = tex.low.size - 1
    first, second, third = minimum(index, end), minimum(index + 1, end), minimum(index + 2, end)
    low = (gather(tex.low, first), gather(tex.low, second), gather(tex.low, third))
    return low, (gather(tex.high, first), gather(tex.high, second), gather(tex.high, third))


@device
def _compared(row, reference):
    """Return a row of depths as results of reference <= depth."""
    (a, b, c), (d, e, f) = row
    one, least, greatest = a * 0.0 + 1.0, reference.lo, reference.hi
    certain = (select(greatest <= a, one, 0.0), select(greatest <= b, one, 0.0), select(greatest <= c, one, 0.0))
    return certain, (select(least <= d, one, 0.0), select(least <= e, one, 0.0), select(least <= f, one, 0.0))


# ---- filters
@device
def _lerp(weight, a, b, bytes_filter):
    """Return the filter between two lanes of texels at one weight: an interval, a point with the 8-bit filter."""
    if bytes_filter:
        code = floor((a * 256.0 + weight * (b - a) + 128.0) * (1.0 / 256.0))
        return pair(code, code)
    return pair(a, a) + pair(weight, weight) * (pair(b, b) - pair(a, a))


@subroutine
def _over_axis(axis, low, high, bytes_filter):
    """Return the hull of the filter along one axis: ends of the box, and the texel between them."""
    lane.stay_a_call()
    after = (select(axis.kink, low[1], low[0]), select(axis.kink, low[2], low[1]))
    p, q = _lerp(axis.start, low[0], low[1], bytes_filter), _lerp(axis.end, after[0], after[1], bytes_filter)
    lo = minimum(minimum(p.lo, q.lo), select(axis.kink, low[1], p.lo))
    after = (select(axis.kink, high[1], high[0]), select(axis.kink, high[2], high[1]))
    p, q = _lerp(axis.start, high[0], high[1], bytes_filter), _lerp(axis.end, after[0], after[1], bytes_filter)
    return lo, maximum(maximum(p.hi, q.hi), select(axis.kink, high[1], p.hi))


@device
def _most(axis, a, b, c):
    """Return the greatest of the texels that a box uses along one axis."""
    return maximum(maximum(a, b), select(axis.kink, c, b))


@device
def _most_low(axis, row):
    """Return the opposite of the least."""
    low = row[0]
    return _most(axis, 0.0 - low[0], 0.0 - low[1], 0.0 - low[2])


@subroutine
def _slice(tex, index, x, y, bytes_filter, room, compares, reference):
    """Return the ends of the bilinear filter from the texel `index`, in texels; compared first where that is asked.

    `room` on either side, but a filter never leaves the hull of its texels.
    """
    lane.stay_a_call()
    near, middle, far = _row(tex, index), _row(tex, index + tex.row), _row(tex, index + 2 * tex.row)
    if compares:
        near, middle, far = _compared(near, reference), _compared(middle, reference), _compared(far, reference)
    a, b = _over_axis(x, near[0], near[1], bytes_filter)
    c, d = _over_axis(x, middle[0], middle[1], bytes_filter)
    e, f = _over_axis(x, far[0], far[1], bytes_filter)
    lo, hi = _over_axis(y, (a, c, e), (b, d, f), bytes_filter)
    if room > 0.0:
        lo = maximum(lo - room, 0.0 - _most(y, _most_low(x, near), _most_low(x, middle), _most_low(x, far)))
        hi = minimum(hi + room, _most(y, _most(x, *near[1]), _most(x, *middle[1]), _most(x, *far[1])))
    return lo, hi


@subroutine
def _planar(tex, channel, u, v, bytes_filter, slack, room, compares, reference):
    """Return the hull of the two-dimensional filter, in texels."""
    lane.stay_a_call()
    x, y = _axis(u, tex.width, bytes_filter, slack), _axis(v, tex.height, bytes_filter, slack)
    index = y.first * tex.row + x.first + (tex.row + 1 + channel * tex.plane)
    lo, hi = _slice(tex, index, x, y, bytes_filter, room, compares, reference)
    least, greatest = tex.least, tex.greatest
    if compares:
        least, greatest = 0.0, 1.0
    far = x.far | y.far
    return pair(select(far, least, lo), select(far, greatest, hi))


@subroutine
def _solid(tex, channel, u, v, w, bytes_filter, slack, room):
    """Return the hull of the three-dimensional filter, in texels."""
    lane.stay_a_call()
    x, y = _axis(u, tex.width, bytes_filter, slack), _axis(v, tex.height, bytes_filter, slack)
    z = _axis(w, tex.depth, bytes_filter, slack)
    index = z.first * tex.slab + y.first * tex.row + x.first + (tex.slab + tex.row + 1 + channel * tex.plane)
    a, b = _slice(tex, index, x, y, bytes_filter, room, False, u)
    c, d = _slice(tex, index + tex.slab, x, y, bytes_filter, room, False, u)
    e, f = _slice(tex, index + 2 * tex.slab, x, y, bytes_filter, room, False, u)
    lo, hi = _over_axis(z, (a, c, e), (b, d, f), bytes_filter)
    if room > 0.0:  # the last rounding, between two slices
        lo = maximum(lo - 0.5 * room, 0.0 - _most(z, 0.0 - a, 0.0 - c, 0.0 - e))
        hi = minimum(hi + 0.5 * room, _most(z, b, d, f))
    far = x.far | y.far | z.far
    return pair(select(far, tex.least, lo), select(far, tex.greatest, hi))


@device
def _joined(own, permitted):
    """Return the envelope: the device's own filter and any other of at least 8 bits."""
    return pair(minimum(own.lo, permitted.lo), maximum(own.hi, permitted.hi))


@device
def _value(tex, x):
    """Return the value of an interval of texels."""
    if tex.inverse == 1.0:
        return x
    return x * tex.inverse + x * tex.inverse_rest


@subroutine
def bilinear_hull(arith, tex, channel, u, v):
    """Return one channel of the bilinear filter over a box."""
    lane.stay_a_call()
    u, v = _coordinate(arith, u), _coordinate(arith, v)
    result = _planar(tex, channel, u, v, tex.mode == BYTES, 0.0, 0.0, False, u)
    if tex.envelope:
        result = _joined(result, _planar(tex, channel, u, v, False, WEIGHT, 2.0 * HALF_CODE * tex.code, False, u))
    return _value(tex, result)


@subroutine
def trilinear_hull(arith, tex, channel, u, v, w):
    """Return one channel of the trilinear filter over a box."""
    lane.stay_a_call()
    u, v, w = _coordinate(arith, u), _coordinate(arith, v), _coordinate(arith, w)
    result = _solid(tex, channel, u, v, w, tex.mode == BYTES, 0.0, 0.0)
    if tex.envelope:
        result = _joined(result, _solid(tex, channel, u, v, w, False, WEIGHT, 2.0 * HALF_CODE * tex.code))
    return _value(tex, result)


@device
def _cells(x, size, slack):
    """Return the first texel that a box may hit, whether the next may be hit too, and whether more."""
    texels = x * float(size)
    first, last = floor(maximum(texels.lo - slack, 0.0)), floor(texels.hi + slack)
    return to_int(first), to_int(minimum(last, first + 1.0)) - to_int(first), last > first + 1.0


@subroutine
def nearest_hull(arith, tex, channel, u, v):
    """Return the texels that a box may hit, in texels."""
    lane.stay_a_call()
    slack = 0.0
    if tex.envelope:
        slack = WEIGHT
    column, right, wide = _cells(_coordinate(arith, u), tex.width, slack)
    line, up, tall = _cells(_coordinate(arith, v), tex.height, slack)
    index = line * tex.row + column + (tex.row + 1 + channel * tex.plane)
    above_it = index + up * tex.row
    lo = minimum(gather(tex.low, index), gather(tex.low, index + right))
    lo = minimum(lo, minimum(gather(tex.low, above_it), gather(tex.low, above_it + right)))
    hi = maximum(gather(tex.high, index), gather(tex.high, index + right))
    hi = maximum(hi, maximum(gather(tex.high, above_it), gather(tex.high, above_it + right)))
    far = wide | tall
    return pair(select(far, tex.least, lo), select(far, tex.greatest, hi))


@subroutine
def shadow_hull(arith, tex, u, v, reference):
    """Return {0, 1, [0, 1]}, or the filter of four such results."""
    lane.stay_a_call()
    if tex.clamp_reference:
        reference = saturate(reference)
    if not tex.pcf:
        depth = nearest_hull(arith, tex, 0, u, v)
        one = depth.lo * 0.0 + 1.0
        return pair(select(reference.hi <= depth.lo, one, 0.0), select(reference.lo <= depth.hi, one, 0.0))
    u, v = _coordinate(arith, u), _coordinate(arith, v)
    slack = 0.0
    if tex.envelope:
        slack = WEIGHT
    return _planar(tex, 0, u, v, False, slack, 0.0, True, reference)


# ---- under the names of `sampler`
def _is_interval(arith: Any) -> bool:
    return is_tag(arith, Interval)


@overload(sampler.usual_maps)
def _usual_maps(arith: Any, shadow: Any, light: Any) -> Any:
    if not is_tag(arith, Interval):
        return None
    return lambda arith, shadow, light: False


@overload(sampler.as_usual)
def _as_usual(arith: Any, tex: Any) -> Any:
    if not is_tag(arith, Interval):
        return None
    return lambda arith, tex: tex


@overload(sampler.nearest)
def _nearest(arith: Any, tex: Any, channel: Any, u: Any, v: Any) -> Any:
    if not _is_interval(arith):
        return None
    return lambda arith, tex, channel, u, v: _value(tex, nearest_hull(arith, tex, channel, u, v))


@overload(sampler.bilinear)
def _bilinear(arith: Any, tex: Any, channel: Any, u: Any, v: Any) -> Any:
    if not _is_interval(arith):
        return None
    return lambda arith, tex, channel, u, v: bilinear_hull(arith, tex, channel, u, v)


@overload(sampler.bilinear_pair)
def _bilinear_pair(arith: Any, tex: Any, channel: Any, a: Any, b: Any) -> Any:
    if not _is_interval(arith):
        return None
    return lambda arith, tex, channel, a, b: (
        bilinear_hull(arith, tex, channel, a[0], a[1]),
        bilinear_hull(arith, tex, channel, b[0], b[1]),
    )


@overload(sampler.bilinear3_pair)
def _bilinear3_pair(arith: Any, tex: Any, a: Any, b: Any) -> Any:
    if not is_tag(arith, Interval):
        return None
    return lambda arith, tex, a, b: (
        sampler.bilinear3(arith, tex, a[0], a[1]),
        sampler.bilinear3(arith, tex, b[0], b[1]),
    )


@overload(sampler.shadow_pair)
def _shadow_pair(arith: Any, tex: Any, a: Any, b: Any, reference_a: Any, reference_b: Any) -> Any:
    if not _is_interval(arith):
        return None
    return lambda arith, tex, a, b, reference_a, reference_b: (
        shadow_hull(arith, tex, a[0], a[1], reference_a),
        shadow_hull(arith, tex, b[0], b[1], reference_b),
    )


@overload(sampler.bilinear3)
def _bilinear3(arith: Any, tex: Any, u: Any, v: Any) -> Any:
    if not _is_interval(arith):
        return None

    def channels(arith: Any, tex: Any, u: Any, v: Any) -> Any:
        r, g = bilinear_hull(arith, tex, 0, u, v), bilinear_hull(arith, tex, 1, u, v)
        return r, g, bilinear_hull(arith, tex, 2, u, v)

    return channels


@overload(sampler.trilinear)
def _trilinear(arith: Any, tex: Any, channel: Any, u: Any, v: Any, w: Any) -> Any:
    if not _is_interval(arith):
        return None
    return lambda arith, tex, channel, u, v, w: trilinear_hull(arith, tex, channel, u, v, w)


@overload(sampler.shadow_compare)
def _shadow_compare(arith: Any, tex: Any, u: Any, v: Any, reference: Any) -> Any:
    if not _is_interval(arith):
        return None
    return lambda arith, tex, u, v, reference: shadow_hull(arith, tex, u, v, reference)
