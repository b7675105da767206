"""Scalar arithmetic of one precision for the references: elementary functions, stores, blends, texture reads.

`arithmetic(np.float32)` gives functions in which every constant is a float32: a bare 0.5 would go on in float64.
"""

import functools
import math
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np

from atmoref import elementary

# without reference counting of the textures' arrays, which would cost more than the arithmetic
inlined: Any = numba.njit(error_model="numpy", forceinline=True, _nrt=False)  # type: ignore[call-arg]
called: Any = numba.njit(error_model="numpy", _nrt=False)  # type: ignore[call-arg]
entry: Any = numba.njit(error_model="numpy", nogil=True, _nrt=False)  # type: ignore[call-arg]


def lower(real: Any, tree: Any) -> Any:
    """Return a tree of uniforms with its floats in the arithmetic's precision."""
    if isinstance(tree, tuple):
        parts = [lower(real, item) for item in tree]
        return type(tree)(*parts) if hasattr(tree, "_fields") else tuple(parts)
    if not isinstance(tree, float):
        return tree
    with np.errstate(over="ignore"):  # limits of wider formats
        return real(tree)


def make_exp(real: Any) -> Any:
    """e**x by argument reduction and a polynomial, one rounding per operation."""
    c = elementary.EXP_SINGLE if real is np.float32 else elementary.EXP_DOUBLE
    least, most, high, low, per_ln2 = (real(v) for v in (c.least, c.most, c.ln2_high, c.ln2_low, 1.4426950408889634))
    terms = tuple(real(t) for t in c.terms)
    whole, bias, digits = (np.int32, 127, 23) if real is np.float32 else (np.int64, 1023, 52)
    one, count = real(1), len(terms)

    @inlined
    def power_of_two(n):
        return whole((n + bias) << digits).view(real)

    @inlined
    def exp(x):
        if x < least:
            x = least
        if x > most:
            x = most
        k = np.rint(x * per_ln2)
        a, b = x - k * high, k * low
        r = a - b
        tail = terms[count - 1]
        for i in range(count - 2, -1, -1):
            tail = tail * r + terms[i]
        value = one + (r + (r * r * tail + ((a - r) - b)))
        n = int(k)
        half = n >> 1
        return value * power_of_two(half) * power_of_two(n - half)

    return exp


@called
def atan2_double(y, x):
    """The angle of (x, y), finite arguments, y > 0."""
    steep, left = abs(y) > abs(x), math.copysign(1.0, x) < 0.0
    big, small = (abs(y), abs(x)) if steep else (abs(x), abs(y))
    eighths = 0.0
    if small == big:
        z, eighths = 0.0, 1.0
    elif small > big * 0.41421356:
        z, eighths = (small - big) / (small + big), 1.0
    else:
        z = small / big
    if steep != left:
        z, eighths = -z, -eighths
    if steep:
        eighths += 2.0
    elif left:
        eighths += 4.0
    square = z * z
    tail = elementary.ATAN_TERMS[-1]
    for i in range(len(elementary.ATAN_TERMS) - 2, -1, -1):
        tail = tail * square + elementary.ATAN_TERMS[i]
    high, low = elementary.QUARTER_PI
    return math.copysign(eighths * high + (z + (z * square * tail + eighths * low)), y)


@inlined
def _two_sum(a, b):
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@called
def tan_double(x):
    """The tangent, 0 < |x| < 2**20, as a quotient of sine and cosine with the parts lost by their roundings."""
    p1, p2, p3, p4 = elementary.HALF_PI
    k = np.rint(x * 0.6366197723675814)
    a, b = _two_sum(x - k * p1, k * -p2)
    c, d = _two_sum(b, k * -p3)
    high, e = _two_sum(a, c)
    rest = e + (d - k * p4)
    r = high + rest
    low = (high - r) + rest
    z = r * r
    cube = z * r
    sines, cosines = elementary.SIN_TERMS, elementary.COS_TERMS
    tail = sines[-1]
    for i in range(len(sines) - 2, 0, -1):
        tail = tail * z + sines[i]
    bend = (z * (0.5 * low - cube * tail) - low) - cube * sines[0]
    sine = r - bend
    sine_low = (r - sine) - bend
    tail = cosines[-1]
    for i in range(len(cosines) - 2, -1, -1):
        tail = tail * z + cosines[i]
    one = 1.0 - 0.5 * z
    more = ((1.0 - one) - 0.5 * z) + (z * z * tail - r * low)
    cosine = one + more
    cosine_low = (one - cosine) + more
    if int(k) & 1:
        value = -cosine / sine
        return value + (-cosine_low - value * sine_low) / sine
    value = sine / cosine
    return value + (sine_low - value * cosine_low) / cosine


def make_phase(real: Any) -> Any:
    """The six phase functions, 1/sr."""
    c = {n: real(v) for n, v in {"half": 0.5, "one": 1.0, "hazy": 4.5, "murky": 16.5, "ray": 0.75, "cs": 1.5}.items()}
    half, one, hazy, murky, rayleigh, shanks = (c[n] for n in ("half", "one", "hazy", "murky", "ray", "cs"))
    two, per_sphere = real(2), real(1.0 / (4.0 * math.pi))

    @inlined
    def phase(kind, g, mu):
        if kind == 0:
            return per_sphere
        if kind == 2:
            return rayleigh * (one + mu * mu) * per_sphere
        if kind == 3 or kind == 4:
            x = (one + mu) * half
            for _ in range(3 if kind == 3 else 5):
                x = x * x
            return (half + (hazy if kind == 3 else murky) * x) * per_sphere
        d = (g - mu) * (g - mu) + (one - mu) * (one + mu)
        if kind == 1:
            return (one - g) * (one + g) / (d * math.sqrt(d)) * per_sphere
        return shanks * ((one - g) * (one + g)) / (two + g * g) * (one + mu * mu) / (d * math.sqrt(d)) * per_sphere

    return phase


def make_store(real: Any) -> SimpleNamespace:
    """What a buffer holds: `encode` replaces, `add` blends ONE, ONE, `value` reads.  `rule` is lowered."""
    zero, one = real(0), real(1)

    @inlined
    def round_code(rule, x):
        if rule.even:
            return np.rint(x)
        whole = np.floor(x)
        return whole + one if (x - whole) + rule.bias >= one else whole

    @called
    def round_float(rule, x):
        """A real as a float of rule.digits significant bits holds it; only for formats narrower than the arithmetic."""
        if x != x or math.isinf(x):
            return max(x, rule.least) if math.isinf(x) else x
        size = abs(np.float64(x))
        _, exponent = math.frexp(size)
        step = math.ldexp(1.0, max(exponent, rule.least_exponent + 1) - rule.digits)
        units = size / step  # exact, as is all of this: powers of two in float64
        size = (np.rint(units) if rule.even else np.floor(units + rule.bias)) * step
        if size > rule.greatest:
            size = np.float64(rule.overflow)
        return real(size) if x > zero else max(real(-size), rule.least) + zero

    @inlined
    def clamped(rule, x):
        if not x > zero:
            return zero
        return min(x * rule.top, rule.top)

    @inlined
    def working(rule, code):
        return code / rule.narrow + np.floor(code * rule.carry) if rule.through else code

    @inlined
    def cut(rule, code):
        return np.floor(code * rule.narrow) if rule.through else code

    digits = 24 if real is np.float32 else 53

    @inlined
    def encode(rule, x):
        if rule.unorm:
            return cut(rule, round_code(rule, clamped(rule, x)))
        return x + zero if rule.digits >= digits else round_float(rule, x)

    @inlined
    def add(rule, stored, source):
        if rule.unorm:
            return cut(rule, min(working(rule, stored) + round_code(rule, clamped(rule, source)), rule.top))
        total = source + stored
        return total + zero if rule.digits >= digits else round_float(rule, total)

    single = real is np.float32

    @inlined
    def value(rule, stored):
        if not rule.unorm:
            return stored
        if single:
            return stored * rule.inverse + stored * rule.inverse_rest
        return stored / rule.stored_top

    return SimpleNamespace(encode=encode, add=add, value=value)


def make_texture(real: Any) -> SimpleNamespace:
    """Texture reads, indices clamped here instead of texels padded there; filters exact, fused (float32) and bytes."""
    zero, half, one, top = real(0), real(0.5), real(1), real(255)
    single = real is np.float32

    @inlined
    def texel(tex, channel, i, j):
        i = min(max(i, 0), tex.width - 1)
        j = min(max(j, 0), tex.height - 1)
        return tex.data[channel * tex.plane + (j + 1) * tex.row + i + 1]

    @called
    def fma(a, b, c):
        """a b + c rounded once to float32: the sum in float64 rounded to odd, then to float32."""
        s, rest = _two_sum(np.float64(a) * np.float64(b), np.float64(c))
        if rest != 0.0 and np.float64(s).view(np.int64) & 1 == 0:
            bits = np.float64(s).view(np.int64)
            bits += 1 if (rest > 0.0) == (s > 0.0) else -1
            s = np.int64(bits).view(np.float64)
        return np.float32(s)

    @inlined
    def lerp(tex, weight, a, b):
        if single and tex.mode == 1:
            return real(fma(weight, b - a, a))
        return a + weight * (b - a)

    @inlined
    def corners(tex, u, v):
        x, y = u * real(tex.width) - half, v * real(tex.height) - half
        fx, fy = np.floor(x), np.floor(y)
        return int(fx), int(fy), x - fx, y - fy

    @inlined
    def byte(tex, channel, i, j):
        i = min(max(i, 0), tex.width - 1)
        j = min(max(j, 0), tex.height - 1)
        return (np.int64(tex.packed[(j + 1) * tex.row + i + 1]) >> (8 * channel)) & 255

    @called
    def byte_filter(tex, channel, u, v):
        x = int(np.rint(u * real(tex.width * 256))) - 128
        y = int(np.rint(v * real(tex.height * 256))) - 128
        i, j, wx, wy = x >> 8, y >> 8, x & 255, y & 255
        a, b = byte(tex, channel, i, j), byte(tex, channel, i + 1, j)
        c, d = byte(tex, channel, i, j + 1), byte(tex, channel, i + 1, j + 1)
        low = a + ((wx * (b - a) + 128) >> 8)
        high = c + ((wx * (d - c) + 128) >> 8)
        code = real(low + ((wy * (high - low) + 128) >> 8))
        return code * tex.inverse + code * tex.inverse_rest if single else code / top

    @inlined
    def bilinear(tex, channel, u, v):
        if tex.mode == 2:
            return byte_filter(tex, channel, u, v)
        i, j, wx, wy = corners(tex, u, v)
        low = lerp(tex, wx, texel(tex, channel, i, j), texel(tex, channel, i + 1, j))
        return lerp(tex, wy, low, lerp(tex, wx, texel(tex, channel, i, j + 1), texel(tex, channel, i + 1, j + 1)))

    @inlined
    def passes(depth, reference):
        return one if reference <= depth else zero

    @inlined
    def shadow(tex, u, v, reference):
        if tex.clamp_reference:
            reference = min(max(reference, zero), one)
        if not tex.pcf:
            return passes(texel(tex, 0, int(u * real(tex.width)), int(v * real(tex.height))), reference)
        i, j, wx, wy = corners(tex, u, v)
        a, b = passes(texel(tex, 0, i, j), reference), passes(texel(tex, 0, i + 1, j), reference)
        c, d = passes(texel(tex, 0, i, j + 1), reference), passes(texel(tex, 0, i + 1, j + 1), reference)
        if a == b and b == c and c == d:
            return a
        return lerp(tex, wy, lerp(tex, wx, a, b), lerp(tex, wx, c, d))

    return SimpleNamespace(bilinear=bilinear, shadow=shadow, fma=fma)


@functools.cache
def arithmetic(real: Any) -> SimpleNamespace:
    """Return everything above in float32 or float64."""
    if real is np.float64:
        atan2, tan = atan2_double, tan_double
    else:

        @inlined
        def atan2(y, x):
            return real(atan2_double(np.float64(y), np.float64(x)))

        @inlined
        def tan(x):
            return real(tan_double(np.float64(x)))

    return SimpleNamespace(
        real=real, exp=make_exp(real), atan2=atan2, tan=tan, phase=make_phase(real),
        store=make_store(real), texture=make_texture(real),
    )  # fmt: skip
