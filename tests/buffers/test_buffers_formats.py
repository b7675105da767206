"""Formats against literal integer formulas, NumPy's own half floats, and enumeration of all codes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from atmoref.buffers.device import DEVICES, ROUNDINGS, decode_factors
from atmoref.buffers.formats import FORMATS, decode, decode_as, encode, named

IDEAL, MESA = DEVICES["ideal"], DEVICES["gl_llvmpipe"]
UNORM = [f for f in FORMATS.values() if f.kind == "unorm"]
SMALL = [f for f in UNORM if f.bits <= 16]
ids = lambda value: getattr(value, "name", str(value))


def near_ties(top, ulps=40):
    """float32 numbers within so many ulps of every (k + 1/2) / top."""
    ties = ((np.arange(top) + 0.5) / top).astype(np.float32).view(np.int32)
    return (ties[:, None] + np.arange(-ulps, ulps + 1, dtype=np.int32)).view(np.float32).ravel()


def small_float(x, mantissa, rounding):
    """Round float32 to 1-5-mantissa by integer shifts; as float64, overflow to the largest or to infinity."""
    bits = np.asarray(x, np.float32).view(np.uint32).astype(np.int64)
    sign, size = np.where(bits >> 31, -1.0, 1.0), bits & 0x7FFFFFFF
    exponent = np.maximum(size >> 23, 1) - 127
    whole = np.where(size >> 23, (size & 0x7FFFFF) | 0x800000, size & 0x7FFFFF)
    drop = np.minimum(23 - mantissa + np.maximum(-14 - exponent, 0), 40)
    kept = whole >> drop
    if rounding == "nearest_even":
        rest, half = whole & ((1 << drop) - 1), 1 << (drop - 1)
        kept = kept + ((rest > half) | ((rest == half) & (kept & 1 == 1)))
    y = kept * 2.0 ** (np.maximum(exponent, -14) - mantissa)
    largest = 65536.0 * (1 - 2.0 ** -(mantissa + 1))
    y = np.where(y > largest, np.inf if rounding == "nearest_even" else largest, y)
    return sign * np.where(size > 0x7F800000, np.nan, np.where(size == 0x7F800000, np.inf, y))


def hostile_floats(n=1 << 20, seed=1):
    """Every exponent, plus numbers around the range of half floats, plus specials."""
    rng = np.random.default_rng(seed)
    anything = rng.integers(0, 2**32, n, dtype=np.uint32).view(np.float32)
    middle = (rng.integers(0, 2**32, n, dtype=np.uint32) & 0x87FFFFFF | 0x30000000).view(np.float32)
    halves = np.arange(65536, dtype=np.uint16).view(np.float16).astype(np.float32)
    special = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 65504, 65519.996, 65520, -65520, 65024, 64512], np.float32)
    return np.concatenate([anything, middle, halves, special])


@pytest.mark.parametrize("device", DEVICES.values(), ids=ids)
@pytest.mark.parametrize("fmt", SMALL, ids=ids)
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_every_code_survives_a_round_trip(fmt, device, real):
    codes = np.arange(fmt.top + 1)
    stored = encode(decode_as(codes, fmt, device, real), fmt, device)
    assert stored.dtype == fmt.storage
    np.testing.assert_array_equal(stored, codes)


@pytest.mark.parametrize("rounding", ROUNDINGS)
def test_every_24_bit_code_survives_where_values_are_exact_quotients(rounding):
    fmt = FORMATS["depth24"]
    codes = np.arange(fmt.top + 1, dtype=np.uint32)[:: 1 if rounding == "half_up" else 7]
    np.testing.assert_array_equal(encode(decode(codes, fmt), fmt, IDEAL, rounding=rounding), codes)
    np.testing.assert_array_equal(
        encode(decode_as(codes, fmt, IDEAL, np.float32), fmt, IDEAL, rounding=rounding), codes
    )


@pytest.mark.parametrize("fmt", SMALL, ids=ids)
def test_ties_round_as_the_float32_product_does(fmt):
    x = near_ties(fmt.top)
    product = np.clip(x, 0, 1) * np.float32(fmt.top)
    assert product.dtype == np.float32
    np.testing.assert_array_equal(encode(x, fmt, IDEAL), np.rint(product))
    np.testing.assert_array_equal(encode(x, fmt, IDEAL, rounding="half_up"), np.floor(product + np.float32(0.5)))
    np.testing.assert_array_equal(encode(x, fmt, IDEAL, rounding="truncate"), np.floor(product))
    mesa = np.rint(product)
    if fmt.name == "unorm10":
        mesa = np.rint(np.clip(x, 0, 1) * np.float32(65535)).astype(np.int64) >> 6
    np.testing.assert_array_equal(encode(x, fmt, MESA), mesa)


def test_the_product_in_float32_matters_at_ties_of_8_bits():
    x = near_ties(255)
    assert x.size == 20655
    in_double = np.rint(x.astype(np.float64) * 255)
    off = np.count_nonzero(encode(x, FORMATS["unorm8"], MESA) != in_double)
    assert 0 < off < 200
    np.testing.assert_array_equal(encode(x.astype(np.float64), FORMATS["unorm8"], MESA), in_double)


def test_unorm10_of_mesa_differs_from_nearest_in_a_quarter_of_all_values():
    x = np.random.default_rng(0).random(1 << 20).astype(np.float32)
    fmt = FORMATS["unorm10"]
    wrong = np.mean(encode(x, fmt, MESA) != encode(x, fmt, IDEAL))
    # floor((65535 x + 1/2) / 64) against floor(1023 x + 1/2): the mean of 63/64 |x - 1/2|
    assert abs(wrong - 63 / 256) < 0.002


@pytest.mark.parametrize("device", DEVICES.values(), ids=ids)
@pytest.mark.parametrize("fmt", UNORM, ids=ids)
def test_hostile_values_store_the_nearest_legal_code(fmt, device):
    x = np.array([np.nan, -np.nan, np.inf, -np.inf, -0.0, -1e-30, 2.0, 1.0, 1e-45], np.float32)
    expected = [0, 0, fmt.top, 0, 0, 0, fmt.top, fmt.top, 0]
    np.testing.assert_array_equal(encode(x, fmt, device), expected)
    np.testing.assert_array_equal(encode(x.astype(np.float64), fmt, device), expected)


def test_every_half_survives_and_nearest_even_is_numpys():
    fmt = FORMATS["float16"]
    halves = np.arange(65536, dtype=np.uint16).view(np.float16)
    for device in DEVICES.values():
        np.testing.assert_array_equal(encode(halves.astype(np.float32), fmt, device), halves)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        x = hostile_floats()
        np.testing.assert_array_equal(encode(x, fmt, IDEAL), x.astype(np.float16))
        precise = x.astype(np.float64) * (1 + 2.0**-40)
        np.testing.assert_array_equal(encode(precise, fmt, IDEAL), precise.astype(np.float16))


@pytest.mark.parametrize("rounding", ["nearest_even", "truncate"])
def test_small_floats_equal_integer_shifts(rounding):
    device = IDEAL if rounding == "nearest_even" else MESA
    x = hostile_floats()
    np.testing.assert_array_equal(
        encode(x, FORMATS["float16"], device).astype(np.float64), small_float(x, 10, rounding)
    )
    for channel, mantissa in enumerate((6, 6, 5)):
        expected = small_float(x, mantissa, rounding)
        largest = 65536.0 * (1 - 2.0 ** -(mantissa + 1))
        finite_overflow = np.isfinite(x) & ~(np.abs(expected) <= largest)
        expected = np.where(finite_overflow, largest, expected)
        expected = np.where(x < 0, 0.0, expected)  # unsigned: negatives and -inf give 0, NaN stays
        np.testing.assert_array_equal(encode(x, FORMATS["r11g11b10f"], device, channel=channel), expected)


def test_llvmpipe_overflows_to_the_largest_finite_number():
    x = np.array([65519, 65520, 1e30, np.inf, -1e9, -np.inf], np.float32)
    np.testing.assert_array_equal(encode(x, FORMATS["float16"], MESA), [65504, 65504, 65504, np.inf, -65504, -np.inf])
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(encode(x, FORMATS["float16"], IDEAL), x.astype(np.float16))


def test_float32_from_double_rounds_once_and_float64_stays():
    x = np.random.default_rng(3).standard_normal(1 << 16) * 10.0 ** np.random.default_rng(4).uniform(-46, 39, 1 << 16)
    with np.errstate(over="ignore", under="ignore"):
        np.testing.assert_array_equal(encode(x, FORMATS["float32"], IDEAL), x.astype(np.float32))
    np.testing.assert_array_equal(encode(x, FORMATS["float64"], IDEAL), x)


@pytest.mark.parametrize("name", ["float16", "r11g11b10f", "float32", "float64"])
def test_minus_zero_is_stored_as_plus_zero(name):
    for rounding in ROUNDINGS:
        stored = encode(np.array([-0.0, -1e-40, 0.0]), FORMATS[name], IDEAL, rounding=rounding)
        assert not np.signbit(stored[stored == 0]).any()


@pytest.mark.parametrize("fmt", SMALL, ids=ids)
def test_values_of_codes(fmt):
    codes = np.arange(fmt.top + 1)
    np.testing.assert_array_equal(decode(codes, fmt), codes / fmt.top)
    quotient = codes.astype(np.float32) / np.float32(fmt.top)
    a, b = (np.float32(f) for f in decode_factors(fmt, IDEAL))
    c = codes.astype(np.float32)
    np.testing.assert_array_equal(c * a + c * b, quotient)
    np.testing.assert_array_equal(decode_as(codes, fmt, IDEAL, np.float32), quotient)
    np.testing.assert_array_equal((codes / fmt.top).astype(np.float32), quotient)
    product = c * np.float32(1 / fmt.top)
    expected = product if fmt.name in MESA.measured else quotient
    np.testing.assert_array_equal(decode_as(codes, fmt, MESA, np.float32), expected)


def test_llvmpipe_reads_126_of_256_codes_one_ulp_off():
    codes = np.arange(256)
    fmt = FORMATS["unorm8"]
    assert np.count_nonzero(decode_as(codes, fmt, MESA, np.float32) != decode_as(codes, fmt, IDEAL, np.float32)) == 126


unit = st.floats(0, 1, width=32)


@given(x=unit, fmt=st.sampled_from(SMALL), rounding=st.sampled_from(ROUNDINGS))
def test_one_encode_errs_by_at_most_half_a_step_or_one_if_cut(x, fmt, rounding):
    stored = decode(encode(np.float64(x), fmt, IDEAL, rounding=rounding), fmt)
    steps = 1.0 if rounding == "truncate" else 0.5
    assert abs(stored - x) * fmt.top <= steps * (1 + 1e-9)
    if rounding == "truncate":
        assert stored <= x * (1 + 1e-15)


@given(x=unit, y=unit, fmt=st.sampled_from(UNORM), device=st.sampled_from(list(DEVICES.values())))
def test_encoding_is_monotone_and_idempotent(x, y, fmt, device):
    low, high = sorted((np.float32(x), np.float32(y)))
    codes = encode(np.array([low, high]), fmt, device)
    assert codes[0] <= codes[1]
    np.testing.assert_array_equal(encode(decode(codes, fmt), fmt, device), codes)


@given(
    x=st.floats(allow_nan=False, width=32),
    y=st.floats(allow_nan=False, width=32),
    name=st.sampled_from(["float16", "r11g11b10f"]),
    rounding=st.sampled_from(ROUNDINGS),
    channel=st.integers(0, 2),
)
def test_small_floats_are_monotone_and_idempotent(x, y, name, rounding, channel):
    fmt = FORMATS[name]
    low, high = sorted((np.float32(x), np.float32(y)))
    stored = encode(np.array([low, high]), fmt, IDEAL, rounding=rounding, channel=channel)
    assert stored[0] <= stored[1]
    again = encode(stored.astype(np.float32), fmt, IDEAL, rounding=rounding, channel=channel)
    np.testing.assert_array_equal(again, stored)
    for value, kept in zip((low, high), stored.astype(np.float64), strict=True):
        if 0 < value <= fmt.greatest(channel):
            step = max(abs(float(value)), 2.0**-14) * 2.0 ** -fmt.mantissa(channel)
            assert abs(kept - value) <= (step if rounding == "truncate" else step / 2)


def test_names_and_codes_are_checked():
    assert named("unorm8") is FORMATS["unorm8"]
    with pytest.raises(ValueError, match=r"format is 'unorm9', allowed: unorm2, unorm8"):
        named("unorm9")
    with pytest.raises(ValueError, match="has no codes"):
        _ = FORMATS["float16"].top
    with pytest.raises(ValueError, match="integer codes"):
        decode(np.array([0.5]), FORMATS["unorm8"])
