# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Stores and blends of intervals: what a buffer may hold after a draw, under the same names as in `blend`.

A register is an interval of codes (exact integers) or of numbers that the format can represent.  Stores and blends grow
with stored value and source, so the lower end comes from lower ends.  In their alpha they are linear apart from
rounding: both ends of alpha meet the same end of the data.

`device`: the device's own rule (`RuleBounds.rule`), order and products.  `envelope` joins to it everything that the
specifications permit:

unorm stores
    either of the two codes next to the real, an exact code being kept [OpenGL 4.6, 2.3.5.2; Vulkan, Fixed-Point Data
    Conversion].
unorm blends
    source and alpha stored to either code first and each product of codes rounded either way, or reals rounded once
    (which lies between).
float stores
    either of the two neighbours [Vulkan, 16-Bit Floating-Point Numbers; OpenGL 4.6, 2.3.4]; beyond the greatest number
    that or infinity.
reads of codes
    one ulp more on either side.
"""

from typing import Any, NamedTuple

from numba import types

from atmoref._jit import device, subroutine
from atmoref.buffers import blend
from atmoref.buffers.blend import cut, product, round_float, round_wide, working
from atmoref.buffers.device import Device, Rounding, Rule, rule
from atmoref.buffers.formats import Format
from atmoref.lanes import (
    INTERVAL,
    absolute,
    convert,
    exponent,
    floor,
    maximum,
    minimum,
    overload,
    pair,
    power_of_two,
    saturate,
    select,
    store,
)
from atmoref.lanes import instructions as lane
from atmoref.lanes.intervals import above, below


class RuleBounds(NamedTuple):
    """The rule of one channel for intervals: the device's, the same with float stores cut, and which interval."""

    rule: Rule
    cut: Rule
    envelope: bool


def rule_bounds(fmt: Format, device: Device, rounding: Rounding | None, channel: int, *, envelope: bool) -> RuleBounds:
    """Return `device.rule` for intervals; see there."""
    own = rule(fmt, device, rounding, channel)
    return RuleBounds(own, own._replace(even=False, bias=0.0, overflow=own.greatest), envelope)


# ---- ends of reals and codes
@device
def hull(a, b):
    """Return the least interval that contains both."""
    return pair(minimum(a.lo, b.lo), maximum(a.hi, b.hi))


@device
def point(x):
    """Return a lane as an interval."""
    return pair(x, x)


@device
def ceiling(x):
    """Return the least integer not below a lane."""
    return 0.0 - floor(0.0 - x)


@device
def rounded(own, code):
    """Return reals in units of a code as the device rounds them."""
    return pair(round_wide(own, code.lo), round_wide(own, code.hi))


@device
def either(code):
    """Return the codes next to reals in units of a code."""
    return pair(floor(code.lo), ceiling(code.hi))


@device
def working_codes(own, stored):
    """Return stored codes as blends compute with them."""
    return pair(working(own, stored.lo), working(own, stored.hi))


@device
def stored_codes(own, code):
    """Return working codes, cut at the greatest, as they are stored."""
    return pair(cut(own, minimum(code.lo, own.top)), cut(own, minimum(code.hi, own.top)))


@device
def source_code(top, x):
    """Return a real, clamped to [0, 1], in units of a code."""
    return minimum(maximum(x * top, 0.0), top)


# ---- float formats
@device
def _neighbours(limit, x):
    """Return the numbers of a small float format next to a lane: toward zero, and away from it."""
    size = absolute(x)
    inner = absolute(round_float(limit, size))
    place = maximum(exponent(maximum(inner, 2.0**-126)), limit.least_exponent) - (limit.digits - 1)
    outer = select(inner < size, inner + power_of_two(x, place), inner)
    return inner, select(outer > limit.greatest, limit.overflow_away, outer)


class Limit(NamedTuple):
    """Numbers of a small float format; as `Rule`, and what lies beyond the greatest."""

    even: bool
    bias: float
    digits: int
    least_exponent: int
    greatest: float
    overflow: float
    least: float
    overflow_away: float


@device
def _limit(bounds):
    own, r = bounds.rule, bounds.cut
    away = float("inf")
    if own.least == 0.0:
        away = own.greatest
    return Limit(r.even, r.bias, r.digits, r.least_exponent, r.greatest, r.overflow, r.least, away)


@device
def _either_float(bounds, x):
    """Return the numbers of the format between which any rounding of an interval lies."""
    limit = _limit(bounds)
    low_in, low_out = _neighbours(limit, x.lo)
    high_in, high_out = _neighbours(limit, x.hi)
    lo = select(x.lo < 0.0, 0.0 - low_out, low_in)
    hi = select(x.hi < 0.0, 0.0 - high_in, high_out)
    return pair(maximum(lo, limit.least), maximum(hi, limit.least))


@subroutine
def stored_float(bounds, x):
    """Return an interval of reals as a float format holds it."""
    lane.stay_a_call()
    own = bounds.rule
    if own.digits >= 24:
        return pair(x.lo + 0.0, x.hi + 0.0)
    result = pair(round_float(own, x.lo), round_float(own, x.hi))
    if bounds.envelope:
        result = hull(result, _either_float(bounds, x))
    return result


# ---- products of codes
@device
def _floor_product(top, a, b):
    """Return a b / top of two lanes of codes, rounded down, and rounded up."""
    q = convert(types.float64, a) * convert(types.float64, b) / top
    down = floor(q)
    return convert(types.float32, down), convert(types.float32, select(q > down, down + 1.0, down))


@device
def _weighted(own, s, a, d, b):
    """Return the device's s a + d b of lanes of codes."""
    return product(own, s, a) + product(own, d, b)


@device
def _joint(own, s, d, a):
    """Return s a + d (top - a) for intervals of codes: both ends of a with the same end of s and d.

    Between two ends that are more than a code apart, rounding of the two products may leave the hull by one code.
    """
    between = select(a.hi - a.lo > 1.0, a.lo * 0.0 + 1.0, 0.0)
    b0, b1 = own.top - a.hi, own.top - a.lo
    lo = minimum(_weighted(own, s.lo, a.lo, d.lo, b1), _weighted(own, s.lo, a.hi, d.lo, b0)) - between
    hi = maximum(_weighted(own, s.hi, a.lo, d.hi, b1), _weighted(own, s.hi, a.hi, d.hi, b0)) + between
    return pair(maximum(lo, _weighted(own, s.lo, a.lo, d.lo, b0)), minimum(hi, _weighted(own, s.hi, a.hi, d.hi, b1)))


@device
def _joint_either(top, s, d, a):
    """Return the same with products rounded either way."""
    between = select(a.hi - a.lo > 1.0, a.lo * 0.0 + 1.0, 0.0)
    p, _ = _floor_product(top, s.lo, a.lo)
    q, _ = _floor_product(top, d.lo, top - a.lo)
    r, _ = _floor_product(top, s.lo, a.hi)
    t, _ = _floor_product(top, d.lo, top - a.hi)
    lo = minimum(p + q, r + t) - between
    _, p = _floor_product(top, s.hi, a.lo)
    _, q = _floor_product(top, d.hi, top - a.lo)
    _, r = _floor_product(top, s.hi, a.hi)
    _, t = _floor_product(top, d.hi, top - a.hi)
    hi = maximum(p + q, r + t) + between
    return pair(maximum(lo, 0.0), hi)


@device
def _joint_real(s, d, a):
    """Return s a + d (1 - a) of intervals, both ends of a taken jointly."""
    x, y = point(a.lo), point(a.hi)
    both = hull(s * x + d * (1.0 - x), s * y + d * (1.0 - y))
    return pair(below(both.lo), above(both.hi))


@device
def _products(own, a, b):
    return pair(product(own, a.lo, b.lo), product(own, a.hi, b.hi))


@device
def _either_products(top, a, b):
    lo, _ = _floor_product(top, a.lo, b.lo)
    _, hi = _floor_product(top, a.hi, b.hi)
    return pair(lo, hi)


@device
def _rest(top, a):
    return pair(top - a.hi, top - a.lo)


@device
def _sum(a, b):
    return pair(a.lo + b.lo, a.hi + b.hi)


class Blend(NamedTuple):
    """A blend in codes by the device's rule, in codes with products rounded either way, and in reals.

    Each takes what is stored, source, alpha; a blend without alpha gets its source as one.
    """

    first: Any  # (rule, d, s, a)
    either: Any  # (top, d, s, a)
    real: Any  # (d, s, a), a in units of 1
    codes: bool = False  # alpha is a stored code


_ENCODE = Blend(device(lambda own, d, s, a: s), device(lambda top, d, s, a: s), device(lambda d, s, a: s))
_ADD = Blend(
    device(lambda own, d, s, a: _sum(d, s)), device(lambda top, d, s, a: _sum(d, s)), device(lambda d, s, a: s + d)
)
_OVER = Blend(
    device(lambda own, d, s, a: _joint(own, s, d, a)),
    device(lambda top, d, s, a: _joint_either(top, s, d, a)),
    device(lambda d, s, a: _joint_real(s, d, a)),
)
_OVER_PREMULTIPLIED = Blend(
    device(lambda own, d, s, a: _sum(s, _products(own, d, _rest(own.top, a)))),
    device(lambda top, d, s, a: _sum(s, _either_products(top, d, _rest(top, a)))),
    device(lambda d, s, a: s + d * (1.0 - a)),
)
_ADD_ALPHA = Blend(
    device(lambda own, d, s, a: _sum(d, _products(own, s, a))),
    device(lambda top, d, s, a: _sum(d, _either_products(top, s, a))),
    device(lambda d, s, a: s * a + d),
)
_MODULATE = Blend(
    device(lambda own, d, s, a: _products(own, d, a)),
    device(lambda top, d, s, a: _either_products(top, d, a)),
    device(lambda d, s, a: d * a),
)
_MODULATE_INVERSE = Blend(
    device(lambda own, d, s, a: _products(own, d, _rest(own.top, a))),
    device(lambda top, d, s, a: _either_products(top, d, _rest(top, a))),
    device(lambda d, s, a: d * (1.0 - a)),
)
_UNDER = Blend(
    device(lambda own, d, s, a: _sum(d, _products(own, s, _rest(own.top, a)))),
    device(lambda top, d, s, a: _sum(d, _either_products(top, s, _rest(top, a)))),
    device(lambda d, s, a: s * (1.0 - a) + d),
    codes=True,
)


def _unorm(kind: Blend) -> Any:
    """Return the function of one blend into unorm buffers."""
    first, each, real, codes = kind

    @subroutine
    def blended(bounds, stored, source, alpha):
        lane.stay_a_call()
        own = bounds.rule
        code = source_code(own.top, source)
        if own.first:
            a = working_codes(own, alpha) if codes else rounded(own, source_code(own.top, alpha))
            result = first(own, working_codes(own, stored), rounded(own, code), a)
        else:
            part = alpha * (1.0 / own.top) if codes else saturate(alpha)
            result = rounded(own, minimum(real(stored, code, part), own.top))
        result = stored_codes(own, result)
        if bounds.envelope:
            top = own.stored_top
            a = alpha if codes else either(source_code(top, alpha))
            allowed = each(top, stored, either(source_code(top, source)), a)
            result = hull(result, pair(minimum(allowed.lo, top), minimum(allowed.hi, top)))
        return result

    return blended


def _float(kind: Blend) -> Any:
    """Return the function of one blend into float buffers."""
    real = kind.real

    @subroutine
    def blended(bounds, stored, source, alpha):
        lane.stay_a_call()
        return stored_float(bounds, real(stored, source, alpha))

    return blended


def _chosen(kind: Blend) -> Any:
    unorm, real = _unorm(kind), _float(kind)

    @device
    def blended(bounds, stored, source, alpha):
        if bounds.rule.unorm:
            return unorm(bounds, stored, source, alpha)
        return real(bounds, stored, source, alpha)

    return blended


def _of_source(function: Any, kind: Blend) -> None:
    """Register a blend of one source under its name in `blend`."""
    code = _chosen(kind)

    @overload(function)
    def _typed(form: Any, rule: Any, stored: Any, source: Any) -> Any:
        if INTERVAL not in (stored, source):
            return None
        return lambda form, rule, stored, source: code(rule, stored, source, source)


def _of_source_and_alpha(function: Any, kind: Blend) -> None:
    code = _chosen(kind)

    def choose(form: Any, rule: Any, stored: Any, source: Any, alpha: Any) -> Any:
        if INTERVAL not in (stored, source, alpha):
            return None
        return lambda form, rule, stored, source, alpha: code(rule, stored, source, alpha)

    overload(function)(choose)


_of_source(blend.add, _ADD)
_of_source(blend.modulate, _MODULATE)
_of_source(blend.modulate_inverse, _MODULATE_INVERSE)
_of_source_and_alpha(blend.over, _OVER)
_of_source_and_alpha(blend.over_premultiplied, _OVER_PREMULTIPLIED)
_of_source_and_alpha(blend.add_alpha, _ADD_ALPHA)
_of_source_and_alpha(blend.under, _UNDER)
_encode_bounds = _chosen(_ENCODE)


@overload(blend.encode)
def _encode(form: Any, rule: Any, x: Any) -> Any:
    return (lambda form, rule, x: _encode_bounds(rule, x, x, x)) if x == INTERVAL else None


@subroutine
def code_value(bounds, stored):
    """Return what a read of stored codes or numbers gives."""
    lane.stay_a_call()
    own = bounds.rule
    if not own.unorm:
        return stored
    x = stored * own.inverse + stored * own.inverse_rest
    if bounds.envelope:
        x = pair(select(x.lo > 0.0, below(x.lo), x.lo), select(x.hi > 0.0, above(x.hi), x.hi))
    return x


@overload(blend.value)
def _value(form: Any, rule: Any, stored: Any) -> Any:
    return (lambda form, rule, stored: code_value(rule, stored)) if stored == INTERVAL else None


@overload(blend.write)
def _write(data: Any, at: Any, x: Any) -> Any:
    return (lambda data, at, x: store(data, at, x)) if x == INTERVAL else None
