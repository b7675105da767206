# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""What a buffer stores and holds after a blend: lane functions, bit for bit what a device does.

A kernel gets a code class `form` (compile time) and a `Rule` (run time, from `device.rule`). A register always holds a
real of the kernel's arithmetic: of a unorm format its code, an exact integer. Between draws a register may stay a
register: every function here returns what the buffer would hold, so one call over many draws equals one call each.

======  ======================================  ======================================================
class   array of a buffer                       formats
======  ======================================  ======================================================
Unorm   uint16, codes                           unorm2 ... unorm16
Exact   float32 (Single), float64 (Double)      the arithmetic's own float
Mixed   float32 (Single), float64 (Double)      any, by the rule: codes or numbers; exact integers to 2**24
======  ======================================  ======================================================

Unorm blends with quantise-first devices (all presets): source and alpha become codes s and a by the device's rounding,
then with M(a, b) the device's product of codes and sums cut at top

===================  ==============================  ======================================
`add`                ONE, ONE                        min(top, s + d)
`over`               SRC_ALPHA, ONE_MINUS_SRC_ALPHA  min(top, M(s, a) + M(d, top - a))
`over_premultiplied` ONE, ONE_MINUS_SRC_ALPHA        min(top, s + M(d, top - a))
`add_alpha`          SRC_ALPHA, ONE                  min(top, d + M(s, a))
`modulate`           ZERO, SRC_COLOR                 M(d, s), also DST_COLOR, ZERO and ZERO, SRC_ALPHA
`modulate_inverse`   ZERO, ONE_MINUS_SRC_ALPHA       M(d, top - a)
`under`              ONE_MINUS_DST_ALPHA, ONE        min(top, d + M(s, top - dst_alpha))
===================  ==============================  ======================================

On other devices, and into float formats, the same formulas stand for reals, with separate multiplications and additions
in the kernel's arithmetic, rounded once by the store. Unorm sources are clamped to [0, 1] first, NaN giving 0; sources
into float formats are not. depth24 is stored and read, never blended.
"""

from typing import Any, NamedTuple

from numba import types

from atmoref._jit import device
from atmoref.lanes import (
    F32,
    INTERVAL,
    absolute,
    compiled_only,
    convert,
    exponent,
    floor,
    is_tag,
    lift,
    load,
    maximum,
    minimum,
    overload,
    power_of_two,
    rint,
    saturate,
    select,
    shift_right,
    store,
    to_int,
)


class Unorm(NamedTuple):
    """Tag: every buffer holds codes of at most 16 bits."""


class Exact(NamedTuple):
    """Tag: every buffer holds the arithmetic's own float."""


class Mixed(NamedTuple):
    """Tag: any format; the rule tells which."""


FORMS = (Unorm, Exact, Mixed)


# ---- rounding
@device
def round_wide(rule, x):
    """Return a real x >= 0 as an integral real by the rule; unlike floor(x + 1/2), right beyond 2**23 as well."""
    whole = floor(x)
    return select(rule.even, rint(x), whole + select((x - whole) + rule.bias >= 1.0, whole * 0.0 + 1.0, 0.0))


@compiled_only
def round_code(form: Any, rule: Any, x: Any) -> Any:
    """Return a real 0 <= x <= top, in units of a code, as an integral real by the rule."""


@overload(round_code)
def _round_code(form: Any, rule: Any, x: Any) -> Any:
    if is_tag(form, Unorm):
        return lambda form, rule, x: select(rule.even, rint(x), floor(x + rule.bias))
    return lambda form, rule, x: round_wide(rule, x)


@compiled_only
def round_float(rule: Any, x: Any) -> Any:
    """Return a real as a float format holds it."""


@overload(round_float)
def _round_float(rule: Any, x: Any) -> Any:
    own, largest = (24, 2.0**128 - 2.0**104) if x == F32 else (53, 2.0**1023 * (2 - 2.0**-52))

    def impl(rule: Any, x: Any) -> Any:
        if rule.digits >= own:
            return x + 0.0  # -0 becomes +0
        size = minimum(absolute(x), 2.0 * rule.greatest)  # a NaN becomes finite here and is put back below
        last_place = maximum(exponent(size), rule.least_exponent) - (rule.digits - 1)
        size = round_wide(rule, size * power_of_two(x, 0 - last_place)) * power_of_two(x, last_place)
        size = select(size > rule.greatest, rule.overflow, size)
        size = select(absolute(x) > largest, absolute(x), size)
        y = select(x > 0.0, size, maximum(0.0 - size, rule.least) + 0.0)
        return select(x == x, y, x)

    return impl


# ---- unorm
@device
def clamped_code(rule, x):
    """Return a real, clamped to [0, 1], in units of a working code; NaN gives 0."""
    return minimum(maximum(x * rule.top, 0.0), rule.top)


@device
def working(rule, stored):
    """Return a stored code as blends compute with it: of 16 bits where the device goes through them."""
    if rule.through:
        return stored / rule.narrow + floor(stored * rule.carry)
    return stored


@device
def cut(rule, code):
    """Return a working code as it is stored."""
    if rule.through:
        return floor(code * rule.narrow)
    return code


@compiled_only
def product(rule: Any, a: Any, b: Any) -> Any:
    """Return the device's product of two working codes of at most 16 bits."""


@overload(product)
def _product(rule: Any, a: Any, b: Any) -> Any:
    real = a.element

    def impl(rule: Any, a: Any, b: Any) -> Any:
        t = to_int(a) * to_int(b) + rule.before  # below 2**32, hence logical shifts
        return convert(real, shift_right(t + shift_right(t, rule.bits) + rule.after, rule.bits))

    return impl


@device
def encode_unorm(form, rule, x):
    """Return the code of a real."""
    return cut(rule, round_code(form, rule, clamped_code(rule, x)))


@device
def add_unorm(form, rule, stored, source):
    """ONE, ONE."""
    x = clamped_code(rule, source)
    if rule.plain:
        return minimum(stored + rint(x), rule.top)
    d = working(rule, stored)
    x = select(rule.first, d + round_code(form, rule, x), round_code(form, rule, d + x))
    return cut(rule, minimum(x, rule.top))


@device
def round_once(form, rule, code):
    """Store a blend computed in reals, in units of a code."""
    return round_code(form, rule, minimum(code, rule.top))


@device
def over_unorm(form, rule, stored, source, alpha):
    """SRC_ALPHA, ONE_MINUS_SRC_ALPHA."""
    if rule.first:
        s, a = round_code(form, rule, clamped_code(rule, source)), round_code(form, rule, clamped_code(rule, alpha))
        d = product(rule, working(rule, stored), rule.top - a)
        return cut(rule, minimum(product(rule, s, a) + d, rule.top))
    a = saturate(alpha)
    return round_once(form, rule, clamped_code(rule, source) * a + stored * (1.0 - a))


@device
def over_premultiplied_unorm(form, rule, stored, source, alpha):
    """ONE, ONE_MINUS_SRC_ALPHA."""
    if rule.first:
        s, a = round_code(form, rule, clamped_code(rule, source)), round_code(form, rule, clamped_code(rule, alpha))
        return cut(rule, minimum(s + product(rule, working(rule, stored), rule.top - a), rule.top))
    return round_once(form, rule, clamped_code(rule, source) + stored * (1.0 - saturate(alpha)))


@device
def add_alpha_unorm(form, rule, stored, source, alpha):
    """SRC_ALPHA, ONE."""
    if rule.first:
        s, a = round_code(form, rule, clamped_code(rule, source)), round_code(form, rule, clamped_code(rule, alpha))
        return cut(rule, minimum(working(rule, stored) + product(rule, s, a), rule.top))
    return round_once(form, rule, clamped_code(rule, source) * saturate(alpha) + stored)


@device
def modulate_unorm(form, rule, stored, source):
    """ZERO, SRC_COLOR."""
    if rule.first:
        return cut(rule, product(rule, working(rule, stored), round_code(form, rule, clamped_code(rule, source))))
    return round_once(form, rule, stored * saturate(source))


@device
def modulate_inverse_unorm(form, rule, stored, alpha):
    """ZERO, ONE_MINUS_SRC_ALPHA."""
    if rule.first:
        a = round_code(form, rule, clamped_code(rule, alpha))
        return cut(rule, product(rule, working(rule, stored), rule.top - a))
    return round_once(form, rule, stored * (1.0 - saturate(alpha)))


@device
def under_unorm(form, rule, stored, source, stored_alpha):
    """ONE_MINUS_DST_ALPHA, ONE."""
    if rule.first:
        s = round_code(form, rule, clamped_code(rule, source))
        room = rule.top - working(rule, stored_alpha)
        return cut(rule, minimum(working(rule, stored) + product(rule, s, room), rule.top))
    return round_once(form, rule, clamped_code(rule, source) * (1.0 - stored_alpha * (1 / rule.top)) + stored)


# ---- float
@device
def add_float(stored, source):
    """ONE, ONE."""
    return source + stored


@device
def over_float(stored, source, alpha):
    """SRC_ALPHA, ONE_MINUS_SRC_ALPHA."""
    return source * alpha + stored * (1.0 - alpha)


@device
def over_premultiplied_float(stored, source, alpha):
    """ONE, ONE_MINUS_SRC_ALPHA."""
    return source + stored * (1.0 - alpha)


@device
def add_alpha_float(stored, source, alpha):
    """SRC_ALPHA, ONE."""
    return source * alpha + stored


@device
def modulate_float(stored, source):
    """ZERO, SRC_COLOR."""
    return stored * source


@device
def modulate_inverse_float(stored, alpha):
    """ZERO, ONE_MINUS_SRC_ALPHA."""
    return stored * (1.0 - alpha)


@device
def under_float(stored, source, stored_alpha):
    """ONE_MINUS_DST_ALPHA, ONE."""
    return source * (1.0 - stored_alpha) + stored


# ---- what kernels call
def _of_source(name: str, doc: str, unorm: Any, real: Any) -> Any:
    """Return a public blend of one source operand."""

    def stub(form: Any, rule: Any, stored: Any, source: Any) -> Any: ...

    stub.__name__ = stub.__qualname__ = name
    stub.__doc__ = doc
    function = compiled_only(stub)

    @overload(function)
    def _chosen(form: Any, rule: Any, stored: Any, source: Any) -> Any:
        if INTERVAL in (stored, source):
            return None  # `interval_blend`
        if is_tag(form, Unorm):
            return lambda form, rule, stored, source: unorm(form, rule, stored, source)
        if is_tag(form, Exact):
            return lambda form, rule, stored, source: real(stored, source) + 0.0

        def mixed(form: Any, rule: Any, stored: Any, source: Any) -> Any:
            if rule.unorm:
                return unorm(form, rule, stored, source)
            return round_float(rule, real(stored, source))

        return mixed

    return function


def _of_source_and_alpha(name: str, doc: str, unorm: Any, real: Any) -> Any:
    """Return a public blend of a source and an alpha."""

    def stub(form: Any, rule: Any, stored: Any, source: Any, alpha: Any) -> Any: ...

    stub.__name__ = stub.__qualname__ = name
    stub.__doc__ = doc
    function = compiled_only(stub)

    @overload(function)
    def _chosen(form: Any, rule: Any, stored: Any, source: Any, alpha: Any) -> Any:
        if INTERVAL in (stored, source, alpha):
            return None
        if is_tag(form, Unorm):
            return lambda form, rule, stored, source, alpha: unorm(form, rule, stored, source, alpha)
        if is_tag(form, Exact):
            return lambda form, rule, stored, source, alpha: real(stored, source, alpha) + 0.0

        def mixed(form: Any, rule: Any, stored: Any, source: Any, alpha: Any) -> Any:
            if rule.unorm:
                return unorm(form, rule, stored, source, alpha)
            return round_float(rule, real(stored, source, alpha))

        return mixed

    return function


_RETURNS = """

    `form` is the code class, `rule` the device's rule of the channel's format. Returns what the buffer then holds.
    """
add = _of_source("add", "Blend ONE, ONE (d + s): additive, saturating in unorm." + _RETURNS, add_unorm, add_float)
modulate = _of_source(
    "modulate",
    "Blend ZERO, SRC_COLOR (d s); also DST_COLOR, ZERO, and with an alpha as source ZERO, SRC_ALPHA." + _RETURNS,
    modulate_unorm,
    modulate_float,
)
modulate_inverse = _of_source(
    "modulate_inverse",
    "Blend ZERO, ONE_MINUS_SRC_ALPHA (d (1 - a)); the source is the alpha." + _RETURNS,
    modulate_inverse_unorm,
    modulate_inverse_float,
)
over = _of_source_and_alpha(
    "over",
    "Blend SRC_ALPHA, ONE_MINUS_SRC_ALPHA (s a + d (1 - a)); the alpha channel has its alpha as source." + _RETURNS,
    over_unorm,
    over_float,
)
over_premultiplied = _of_source_and_alpha(
    "over_premultiplied",
    "Blend ONE, ONE_MINUS_SRC_ALPHA (s + d (1 - a)): over with a premultiplied source." + _RETURNS,
    over_premultiplied_unorm,
    over_premultiplied_float,
)
add_alpha = _of_source_and_alpha(
    "add_alpha", "Blend SRC_ALPHA, ONE (s a + d): additive with a weight." + _RETURNS, add_alpha_unorm, add_alpha_float
)
under = _of_source_and_alpha(
    "under",
    "Blend ONE_MINUS_DST_ALPHA, ONE (s (1 - dst_alpha) + d): front to back. The last argument is the register of the"
    "\n    destination's alpha before the draw, a code in unorm." + _RETURNS,
    under_unorm,
    under_float,
)


@compiled_only
def encode(form: Any, rule: Any, x: Any) -> Any:
    """Return what the buffer holds after a write of the real x without blending."""


@compiled_only
def value(form: Any, rule: Any, stored: Any) -> Any:
    """Return the real that a later read gives: of a unorm code its value on the device, else the number itself."""


@overload(encode)
def _encode(form: Any, rule: Any, x: Any) -> Any:
    if x == INTERVAL:
        return None
    if is_tag(form, Unorm):
        return lambda form, rule, x: encode_unorm(form, rule, x)
    if is_tag(form, Exact):
        return lambda form, rule, x: x + 0.0

    def mixed(form: Any, rule: Any, x: Any) -> Any:
        if rule.unorm:
            return encode_unorm(form, rule, x)
        return round_float(rule, x)

    return mixed


@overload(value)
def _value(form: Any, rule: Any, stored: Any) -> Any:
    if stored == INTERVAL:
        return None
    if is_tag(form, Exact):
        return lambda form, rule, stored: stored
    divides = stored != F32

    def unorm(form: Any, rule: Any, stored: Any) -> Any:
        if divides:
            return stored / rule.stored_top
        return stored * rule.inverse + stored * rule.inverse_rest

    def mixed(form: Any, rule: Any, stored: Any) -> Any:
        if not rule.unorm:
            return stored
        if divides:
            return stored / rule.stored_top
        return stored * rule.inverse + stored * rule.inverse_rest

    return unorm if is_tag(form, Unorm) else mixed


# ---- memory
@compiled_only
def read(arith: Any, data: Any, at: Any) -> Any:
    """Return N neighbours of a buffer as registers: reals of the arithmetic, of unorm buffers their codes."""


@compiled_only
def write(data: Any, at: Any, x: Any) -> Any:
    """Write registers to N neighbours of a buffer, the opposite of `read`."""


@overload(read)
def _read(arith: Any, data: Any, at: Any) -> Any:
    return lambda arith, data, at: lift(arith, load(data, at))


@overload(write)
def _write(data: Any, at: Any, x: Any) -> Any:
    if x == INTERVAL:
        return None
    if isinstance(data.dtype, types.Integer):
        return lambda data, at, x: store(data, at, to_int(x))
    dtype = data.dtype
    return lambda data, at, x: store(data, at, convert(dtype, x))
