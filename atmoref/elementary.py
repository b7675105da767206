"""exp, log, sin, cos, tan and atan2 of our own, in float32 and float64: the same bits on every machine.

Whatever feeds a hashed buffer or a stored table calls these and never NumPy's, SciPy's or libm's, which change with
library, version and processor.  Each algorithm is written once, as a factory over a small namespace of exact or
correctly rounded operations (`Ops`).  This module binds the factories to NumPy arrays; `atmoref.lanes` binds the same
factories to lanes, so both give the same bits.  There is no fused multiply-add.

Accuracy, in units in the last place of the correctly rounded result's binade, asserted in `tests/elementary`:

========  ================  ================  ======================================================================
function  float32           float64           domain and special values
========  ================  ================  ======================================================================
exp       0.87              0.87              all x; gradual underflow, 0 below -103.97 (-745.13), infinite on overflow
log       0.84              0.80              all x; log(0) = -inf, NaN for x < 0
sin, cos  0.501             0.80              |x| <= 2**20 = 1048576; NaN outside
tan       0.501             1.4               as sin
atan2     0.501             1.75              all y, x; signed zeros, infinities and quadrants as IEEE 754 has them
========  ================  ================  ======================================================================

NaN in gives NaN out.  exp and log are monotone in float32 (all values were tried).  float32 trigonometry is computed in
float64 and rounded once.

Sources: argument reduction by parts after W. J. Cody and W. Waite, Software Manual for the Elementary Functions (1980);
polynomials interpolate at Chebyshev nodes (their errors are measured in `tests/elementary`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

NAN: Final = float("nan")
INFINITY: Final = float("inf")
TRIGONOMETRIC_LIMIT: Final = 1048576.0
"""Largest |x| for which sin, cos and tan are defined here (2**20)."""


# ---- what differs between the element types
@dataclass(frozen=True)
class ExpConstants:
    """exp: range in which nothing saturates (outward), ln 2 = high + low, and (e**r - 1 - r) / r**2."""

    least: float
    most: float
    ln2_high: float  # few enough bits that k * ln2_high is exact
    ln2_low: float
    terms: tuple[float, ...]


@dataclass(frozen=True)
class LogConstants:
    """log: ln 2 = high + low, and (ln((1 + s) / (1 - s)) / s - 2) / s**2 in s**2; what lifts subnormals."""

    ln2_high: float
    ln2_low: float
    terms: tuple[float, ...]
    least_normal: float
    lift: float
    lift_exponent: float


LN2_SINGLE: Final = (0.693145751953125, 1.428606765330187e-06)
LN2_DOUBLE: Final = (0.6931471806019545, -4.2009150726810846e-11)
EXP_SINGLE: Final = ExpConstants(
    -104.0,
    89.0,
    *LN2_SINGLE,
    terms=(
        0.5,
        0.1666666716337204,
        0.04166655242443085,
        0.00833332072943449,
        0.0013926250394433737,
        0.00019882773631252348,
    ),
)
EXP_DOUBLE: Final = ExpConstants(
    -746.0,
    710.0,
    *LN2_DOUBLE,
    terms=(
        0.5,
        0.16666666666666669,
        0.041666666666666664,
        0.008333333333330039,
        0.0013888888888886537,
        0.00019841269863171557,
        2.4801587317228724e-05,
        2.7557267278905696e-06,
        2.7557282838800484e-07,
        2.5100472505694996e-08,
        2.09112987659402e-09,
    ),
)
LOG_SINGLE: Final = LogConstants(
    *LN2_SINGLE,
    terms=(0.6666666865348816, 0.4000012278556824, 0.28550735116004944, 0.23332762718200684),
    least_normal=2.0**-126,
    lift=2.0**24,
    lift_exponent=24.0,
)
LOG_DOUBLE: Final = LogConstants(
    *LN2_DOUBLE,
    terms=(
        0.666666666666667,
        0.3999999999989827,
        0.2857142862653362,
        0.22222211043776857,
        0.18182895750119193,
        0.1533150161114533,
        0.1461916613488797,
    ),
    least_normal=2.0**-1022,
    lift=2.0**54,
    lift_exponent=54.0,
)
# (sin(r) / r - 1) / r**2, (cos(r) - 1 + r**2 / 2) / r**4 and (atan(r) / r - 1) / r**2, all in r**2
SIN_TERMS: Final = (
    -0.16666666666666666,
    0.008333333333333331,
    -0.00019841269841265017,
    2.755731921930192e-06,
    -2.5052106219521895e-08,
    1.6058529572267877e-10,
    -7.586576588171073e-13,
)
COS_TERMS: Final = (
    0.041666666666666664,
    -0.0013888888888887382,
    2.480158729874307e-05,
    -2.7557317260008837e-07,
    2.0876143827993133e-09,
    -1.1382456778061306e-11,
)
ATAN_TERMS: Final = (
    -0.3333333333333333,
    0.19999999999995438,
    -0.14285714284649173,
    0.11111111013860688,
    -0.0909090452147169,
    0.07692181876036845,
    -0.06664492945806264,
    0.05857988350245762,
    -0.05084610357631765,
    0.03920743321261196,
    -0.019147248964611764,
)
# pi/2 in parts of 33, 33, 33 and 53 bits: k times one of the first three is exact for |k| < 2**20
HALF_PI: Final = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487111665e-21, 8.4784276603689e-32)
# pi/4 in parts of 50 and 53 bits: 0...4 times the first is exact
QUARTER_PI: Final = (0.7853981633974483, 3.061616997868383e-17)


# ---- the algorithms
@dataclass(frozen=True)
class Ops:
    """What the algorithms need besides `+ - * / < <= > >= == != & | ^ >> -`; each is exact or rounds once.

    Reals are all of one element type, literals are weak, integers are int32.
    """

    function: Callable[[Callable[..., Any]], Any]  # makes a helper callable from others
    select: Callable[[Any, Any, Any], Any]  # (mask, x, y); one of x and y may be a literal
    minimum: Callable[[Any, Any], Any]  # second operand on NaN
    maximum: Callable[[Any, Any], Any]
    absolute: Callable[[Any], Any]
    rint: Callable[[Any], Any]
    copy_sign: Callable[[Any, Any], Any]  # size of the first, sign of the second
    to_int: Callable[[Any], Any]
    from_int: Callable[[Any, Any], Any]  # (like, k): k as a real of the type of `like`
    power_of_two: Callable[[Any, Any], Any]  # (like, k): 2**k
    exponent: Callable[[Any], Any]  # of positive normal numbers, as int
    significand: Callable[[Any], Any]  # of positive normal numbers, in [1, 2)
    widen: Callable[[Any], Any]  # to float64
    narrow: Callable[[Any], Any]  # to float32


def polynomial(ops: Ops, terms: tuple[float, ...]) -> Any:
    """Return the polynomial with the given coefficients (constant first) as a function, by Horner's rule."""
    text = repr(terms[-1])
    for term in reversed(terms[:-1]):
        text = f"({text}) * z + {term!r}"
    names: dict[str, Any] = {}
    exec(f"def value(z):\n    return {text}\n", names)
    return ops.function(names["value"])


def make_exp(ops: Ops, c: ExpConstants) -> Any:
    """Return exp: x = k ln 2 + r, then 2**k (1 + r + r**2 p(r)); the power in two steps, so underflow is gradual."""
    minimum, maximum, select, rint = ops.minimum, ops.maximum, ops.select, ops.rint
    to_int, power_of_two = ops.to_int, ops.power_of_two
    least, most, high, low = c.least, c.most, c.ln2_high, c.ln2_low
    tail = polynomial(ops, c.terms)

    def exp(x: Any) -> Any:
        clamped = minimum(maximum(x, least), most)
        k = rint(clamped * 1.4426950408889634)
        a = clamped - k * high
        b = k * low
        r = a - b
        lost = (a - r) - b
        value = 1.0 + (r + (r * r * tail(r) + lost))
        n = to_int(k)
        half = n >> 1
        value = value * power_of_two(x, half) * power_of_two(x, n - half)
        return select(x == x, value, NAN)

    return ops.function(exp)


def make_log(ops: Ops, c: LogConstants) -> Any:
    """Return log: x = 2**k (1 + f), then k ln 2 + log(1 + f) through s = f / (2 + f)."""
    select, exponent, significand, from_int = ops.select, ops.exponent, ops.significand, ops.from_int
    high, low, least_normal, lift, lift_exponent = c.ln2_high, c.ln2_low, c.least_normal, c.lift, c.lift_exponent
    tail = polynomial(ops, c.terms)

    def log(x: Any) -> Any:
        small = x < least_normal
        normal = select(small, x * lift, x)
        k = from_int(x, exponent(normal))
        m = significand(normal)
        upper = m > 1.4142135
        m = select(upper, m * 0.5, m)
        k = select(upper, k + 1.0, k)
        k = select(small, k - lift_exponent, k)
        f = m - 1.0
        s = f / (2.0 + f)
        z = s * s
        h = 0.5 * f * f
        value = k * high - ((h - (s * (h + z * tail(z)) + k * low)) - f)
        value = select(x == INFINITY, INFINITY, value)
        value = select(x == 0.0, -INFINITY, value)
        return select(x >= 0.0, value, NAN)

    return ops.function(log)


def _make_two_sum(ops: Ops) -> Any:
    def two_sum(a: Any, b: Any) -> Any:
        s = a + b
        t = s - a
        return s, (a - (s - t)) + (b - t)

    return ops.function(two_sum)


def make_reduction(ops: Ops) -> Any:
    """Return x -> (k, high, low): x = k pi/2 + high + low, |high| <= pi/4, to about 2**-130 absolutely."""
    rint, to_int = ops.rint, ops.to_int
    two_sum = _make_two_sum(ops)
    p1, p2, p3, p4 = HALF_PI

    def reduce(x: Any) -> Any:
        k = rint(x * 0.6366197723675814)
        a, b = two_sum(x - k * p1, k * -p2)
        c, d = two_sum(b, k * -p3)
        high, e = two_sum(a, c)
        low = e + (d - k * p4)
        total = high + low
        return to_int(k), total, (high - total) + low

    return ops.function(reduce)


def _make_sin_and_cos(ops: Ops) -> Any:
    """Return (high, low) -> (sin, cos, lost by the rounding of sin, of cos) of high + low, |high| <= pi/4."""
    sin_tail, cos_tail = polynomial(ops, SIN_TERMS[1:]), polynomial(ops, COS_TERMS)
    first = SIN_TERMS[0]

    def sin_and_cos(x: Any, low: Any) -> Any:
        z = x * x
        cube = z * x
        bend = (z * (0.5 * low - cube * sin_tail(z)) - low) - cube * first
        sine = x - bend
        half = 0.5 * z
        one = 1.0 - half
        rest = ((1.0 - one) - half) + (z * z * cos_tail(z) - x * low)
        cosine = one + rest
        return sine, cosine, (x - sine) - bend, (one - cosine) + rest

    return ops.function(sin_and_cos)


def make_sin(ops: Ops, quarter_turns: int = 0) -> Any:
    """Return the float64 sine of x + quarter_turns pi/2 (1: the cosine); NaN beyond `TRIGONOMETRIC_LIMIT`."""
    absolute, select = ops.absolute, ops.select
    reduce, sin_and_cos = make_reduction(ops), _make_sin_and_cos(ops)
    exact_zero = quarter_turns == 0

    def sin(x: Any) -> Any:
        valid = absolute(x) <= TRIGONOMETRIC_LIMIT
        k, high, low = reduce(select(valid, x, 0.0))
        sine, cosine, _, _ = sin_and_cos(high, low)
        k = k + quarter_turns
        value = select((k & 1) == 1, cosine, sine)
        value = select((k & 2) == 2, -value, value)
        if exact_zero:  # keeps the sign of zero
            value = select(x == 0.0, x, value)
        return select(valid, value, NAN)

    return ops.function(sin)


def make_tan(ops: Ops) -> Any:
    """Return the float64 tangent; NaN beyond `TRIGONOMETRIC_LIMIT`."""
    absolute, select = ops.absolute, ops.select
    reduce, sin_and_cos = make_reduction(ops), _make_sin_and_cos(ops)

    def tan(x: Any) -> Any:
        valid = absolute(x) <= TRIGONOMETRIC_LIMIT
        k, high, low = reduce(select(valid, x, 0.0))
        sine, cosine, sine_low, cosine_low = sin_and_cos(high, low)
        odd = (k & 1) == 1
        top, bottom = select(odd, -cosine, sine), select(odd, sine, cosine)
        top_low, bottom_low = select(odd, -cosine_low, sine_low), select(odd, sine_low, cosine_low)
        value = top / bottom
        value = value + (top_low - value * bottom_low) / bottom
        value = select(x == 0.0, x, value)
        return select(valid, value, NAN)

    return ops.function(tan)


def make_atan2(ops: Ops) -> Any:
    """Return the float64 angle of (x, y): a multiple of pi/4 plus the arc tangent of |z| <= tan(pi/8)."""
    absolute, select, minimum, maximum, copy_sign = ops.absolute, ops.select, ops.minimum, ops.maximum, ops.copy_sign
    tail = polynomial(ops, ATAN_TERMS)
    quarter_high, quarter_low = QUARTER_PI

    def atan2(y: Any, x: Any) -> Any:
        steep = absolute(y) > absolute(x)
        left = copy_sign(1.0, x) < 0.0
        big = maximum(absolute(x), absolute(y))
        small = minimum(absolute(x), absolute(y))
        huge = big > 2.0**1020  # keeps the sum below finite
        big = select(huge, big * 0.25, big)
        small = select(huge, small * 0.25, small)
        middle = small > big * 0.41421356
        top = select(middle, small - big, small)
        bottom = select(middle, small + big, big)
        z = top / select(big == 0.0, 1.0, bottom)
        equal = small == big  # both infinite, too
        middle = middle | (equal & (big > 0.0))
        z = select(equal, 0.0, z)
        # eighths of a turn, and the direction in which z counts
        flip = steep ^ left
        z = select(flip, -z, z)
        eighths = select(middle, z * 0.0 + 1.0, 0.0)
        eighths = select(flip, -eighths, eighths)
        eighths = select(steep, eighths + 2.0, select(left, eighths + 4.0, eighths))
        square = z * z
        angle = eighths * quarter_high + (z + (z * square * tail(square) + eighths * quarter_low))
        angle = copy_sign(angle, y)
        return select((x == x) & (y == y), angle, NAN)

    return ops.function(atan2)


def make_single(ops: Ops, function: Any, arguments: int = 1) -> Any:
    """Return a float64 function of one or two arguments as a float32 function: widen, compute, round once."""
    widen, narrow = ops.widen, ops.narrow

    def single(x: Any) -> Any:
        return narrow(function(widen(x)))

    def single_of_two(y: Any, x: Any) -> Any:
        return narrow(function(widen(y), widen(x)))

    return ops.function(single if arguments == 1 else single_of_two)


@dataclass(frozen=True)
class Binding:
    """The six functions of one element type over one kind of value."""

    exp: Any
    log: Any
    sin: Any
    cos: Any
    tan: Any
    atan2: Any


def bind(ops: Ops) -> tuple[Binding, Binding]:
    """Return all functions over `ops`, in float32 and in float64."""
    sin, cos, tan, atan2 = make_sin(ops), make_sin(ops, 1), make_tan(ops), make_atan2(ops)
    double = Binding(make_exp(ops, EXP_DOUBLE), make_log(ops, LOG_DOUBLE), sin, cos, tan, atan2)
    single = Binding(
        exp=make_exp(ops, EXP_SINGLE),
        log=make_log(ops, LOG_SINGLE),
        sin=make_single(ops, sin),
        cos=make_single(ops, cos),
        tan=make_single(ops, tan),
        atan2=make_single(ops, atan2, 2),
    )
    return single, double


# ---- NumPy
Array = NDArray[Any]


def _bits(x: Any) -> tuple[Array, type[np.signedinteger[Any]], int, int]:
    """Return the bits of a float array, their type, the exponent's bias and the number of mantissa bits."""
    x = np.asarray(x)
    whole, bias, mantissa = (np.int32, 127, 23) if x.dtype == np.float32 else (np.int64, 1023, 52)
    return x.view(whole), whole, bias, mantissa


def _power_of_two(like: Any, k: Any) -> Any:
    _, whole, bias, mantissa = _bits(like)
    return ((np.asarray(k).astype(whole) + bias) << mantissa).view(np.asarray(like).dtype)


def _exponent(x: Any) -> Any:
    bits, _, bias, mantissa = _bits(x)
    return ((bits >> mantissa) - bias).astype(np.int32)


def _significand(x: Any) -> Any:
    bits, _, bias, mantissa = _bits(x)
    return ((bits & ((1 << mantissa) - 1)) | (bias << mantissa)).view(np.asarray(x).dtype)


NUMPY_OPS: Final = Ops(
    function=lambda helper: helper,
    select=np.where,
    minimum=lambda x, y: np.where(x < y, x, y),
    maximum=lambda x, y: np.where(x > y, x, y),
    absolute=np.abs,
    rint=np.rint,
    copy_sign=np.copysign,
    to_int=lambda x: np.asarray(x).astype(np.int32),
    from_int=lambda like, k: k.astype(np.asarray(like).dtype),
    power_of_two=_power_of_two,
    exponent=_exponent,
    significand=_significand,
    widen=lambda x: np.asarray(x).astype(np.float64),
    narrow=lambda x: np.asarray(x).astype(np.float32),
)
_SINGLE, _DOUBLE = bind(NUMPY_OPS)


def _apply(name: str, *values: ArrayLike) -> Any:
    """Return a function of float32 or float64 values in their common type, an array or (for scalars) a NumPy scalar.

    Raises
    ------
    TypeError
        If a value is of another type.  Python numbers count as float64 unless they stand beside an array.
    """
    kind = np.result_type(*(v if isinstance(v, (int, float)) else np.asarray(v) for v in values))
    if kind.kind in "iu" and all(isinstance(v, int) for v in values):
        kind = np.dtype(np.float64)
    if kind not in (np.float32, np.float64):
        raise TypeError(f"{name} takes float32 or float64, found {kind}")
    function = getattr(_SINGLE if kind == np.float32 else _DOUBLE, name)
    with np.errstate(all="ignore"):
        result = function(*(np.asarray(v, kind) for v in values))
    return result[()] if result.ndim == 0 else result


def exp(x: ArrayLike) -> Any:
    """Return e**x; the result underflows gradually to 0 and overflows to infinity."""
    return _apply("exp", x)


def log(x: ArrayLike) -> Any:
    """Return the natural logarithm; log(0) is -inf, NaN for x < 0."""
    return _apply("log", x)


def sin(x: ArrayLike) -> Any:
    """Return the sine of x radians; NaN for |x| > `TRIGONOMETRIC_LIMIT`."""
    return _apply("sin", x)


def cos(x: ArrayLike) -> Any:
    """Return the cosine of x radians; NaN for |x| > `TRIGONOMETRIC_LIMIT`."""
    return _apply("cos", x)


def tan(x: ArrayLike) -> Any:
    """Return the tangent of x radians; NaN for |x| > `TRIGONOMETRIC_LIMIT`."""
    return _apply("tan", x)


def atan2(y: ArrayLike, x: ArrayLike) -> Any:
    """Return the angle of the vector (x, y) in radians, from -pi to pi."""
    return _apply("atan2", y, x)
