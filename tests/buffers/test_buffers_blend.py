"""Blends against integer formulas written independently: all 256 x 256 x 256 cases of 8 bits, random ones elsewhere."""

import dataclasses

import numpy as np
import pytest
from buffer_kernels import ARITHMETICS, ENCODE, FUNCTIONS, VALUE, blend_kernel, run
from test_buffers_formats import hostile_floats, near_ties, small_float

from atmoref.buffers.blend import Exact, Mixed, Unorm
from atmoref.buffers.device import DEVICES, rule
from atmoref.buffers.formats import FORMATS, decode_as, encode

IDEAL, MESA = DEVICES["ideal"], DEVICES["gl_llvmpipe"]
ROUND_ONCE = dataclasses.replace(IDEAL, name="round_once", quantise_first=False)
UNORM_NAMES = ("unorm2", "unorm8", "unorm10", "unorm12", "unorm16")


def two_step(bits):
    def product(a, b):
        t = a * b
        return (t + (t >> bits) + (1 << (bits - 1))) >> bits

    return product


def nearest(top):
    return lambda a, b: (2 * a * b + top) // (2 * top)


def cut(top):
    return lambda a, b: a * b // top


def integer_blend(which, s, a, d, top, product):
    """Blend of codes (int64); for `under`, a is the destination's alpha."""
    results = {
        "add": s + d,
        "over": product(s, a) + product(d, top - a),
        "over_premultiplied": s + product(d, top - a),
        "add_alpha": d + product(s, a),
        "modulate": product(d, s),
        "modulate_inverse": product(d, top - a),
        "under": d + product(s, top - a),
    }
    return np.minimum(results[which], top)


@pytest.mark.parametrize("which", FUNCTIONS)
@pytest.mark.parametrize(
    ("device", "rounding", "product"),
    [(MESA, None, two_step(8)), (IDEAL, None, nearest(255)), (IDEAL, "truncate", cut(255))],
    ids=["gl_llvmpipe", "ideal", "truncate"],
)
def test_all_16777216_blends_of_8_bits(which, device, rounding, product):
    fmt = FORMATS["unorm8"]
    r = rule(fmt, device, rounding)
    codes = np.arange(256)
    values = decode_as(codes, fmt, device, np.float32)
    table = product(codes[:, None], codes).astype(np.uint16)  # of all pairs, by the formula
    a, d = (x.ravel().astype(np.uint16) for x in np.meshgrid(codes, codes, indexing="ij"))
    alpha = a.astype(np.float32) if which == "under" else values[a]
    faded, out, wrong = table[d, 255 - a], np.zeros(d.size, np.float32), 0
    for s in codes:
        got = d.copy()
        source = np.full(d.size, values[s])
        blend_kernel(ARITHMETICS["float32"], Unorm(), r, got, out, source, alpha, FUNCTIONS.index(which))
        expected = {
            "add": lambda s=s: d + np.uint16(s),
            "over": lambda s=s: table[s, a] + faded,
            "over_premultiplied": lambda s=s: np.uint16(s) + faded,
            "add_alpha": lambda s=s: d + table[s, a],
            "modulate": lambda s=s: table[s, d],
            "modulate_inverse": lambda: faded,
            "under": lambda s=s: d + table[s, 255 - a],
        }[which]()
        wrong += np.count_nonzero(got != np.minimum(expected, 255))
    assert wrong == 0


def test_the_two_step_product_is_wrong_in_24_of_65536_pairs():
    a, b = np.meshgrid(np.arange(256), np.arange(256))
    assert np.count_nonzero(two_step(8)(a, b) != nearest(255)(a, b)) == 24


@pytest.mark.parametrize("which", FUNCTIONS)
@pytest.mark.parametrize("device", [MESA, IDEAL], ids=lambda d: d.name)
def test_blends_of_16_bits(which, device):
    fmt, n = FORMATS["unorm16"], 1 << (22 if which == "over" else 20)
    rng = np.random.default_rng(FUNCTIONS.index(which))
    d, a = rng.integers(0, 65536, (2, n))
    x = rng.random(n).astype(np.float32) * np.float32(1.1)
    s = np.rint(np.clip(x, 0, 1) * np.float32(65535)).astype(np.int64)
    alpha = a.astype(np.float32) if which == "under" else decode_as(a, fmt, device, np.float32)
    expected = integer_blend(which, s, a, d, 65535, two_step(16) if device is MESA else nearest(65535))
    np.testing.assert_array_equal(run(which, "float32", Unorm(), rule(fmt, device), d, x, alpha), expected)


def test_products_of_16_bits_at_every_tie():
    """The products nearest to (k + 1/2) top, and every k top: where a rounding can go wrong."""
    top, k = 65535, np.arange(1, 65535)
    d = np.full(k.size, top)
    got = run(
        "modulate",
        "float32",
        Unorm(),
        rule(FORMATS["unorm16"], IDEAL),
        d,
        decode_as(k, FORMATS["unorm16"], IDEAL, np.float32),
    )
    np.testing.assert_array_equal(got, k)
    rng = np.random.default_rng(0)
    a = rng.integers(1, 65536, 1 << 22)
    b = np.clip(((rng.random(a.size) * a).astype(np.int64) * top + top // 2) // a, 0, top)
    for shift in (0, 1):
        b = np.minimum(b + shift, top)
        x = decode_as(b, FORMATS["unorm16"], IDEAL, np.float32)
        got = run("modulate", "float32", Unorm(), rule(FORMATS["unorm16"], IDEAL), a, x)
        np.testing.assert_array_equal(got, nearest(top)(a, b))


@pytest.mark.parametrize("which", FUNCTIONS)
def test_blends_of_10_bits_go_through_16_on_llvmpipe(which):
    fmt, n = FORMATS["unorm10"], 1 << 20
    rng = np.random.default_rng(FUNCTIONS.index(which))
    d, dst_alpha = rng.integers(0, 1024, (2, n))
    x, alpha = rng.random((2, n)).astype(np.float32)
    s, a = (np.rint(v * np.float32(65535)).astype(np.int64) for v in (x, alpha))
    if which == "under":
        a, alpha = dst_alpha << 6 | dst_alpha >> 4, dst_alpha.astype(np.float32)
    expected = integer_blend(which, s, a, d << 6 | d >> 4, 65535, two_step(16)) >> 6
    np.testing.assert_array_equal(run(which, "float32", Unorm(), rule(fmt, MESA), d, x, alpha), expected)


@pytest.mark.parametrize("which", FUNCTIONS)
@pytest.mark.parametrize("bits", [2, 10, 12])
def test_blends_of_other_widths_are_the_nearest_product(which, bits):
    fmt, n = FORMATS[f"unorm{bits}"], 1 << 19
    rng = np.random.default_rng(bits)
    s, d, a = rng.integers(0, fmt.top + 1, (3, n))
    x = decode_as(s, fmt, IDEAL, np.float32)
    alpha = a.astype(np.float32) if which == "under" else decode_as(a, fmt, IDEAL, np.float32)
    expected = integer_blend(which, s, a, d, fmt.top, nearest(fmt.top))
    np.testing.assert_array_equal(run(which, "float32", Unorm(), rule(fmt, IDEAL), d, x, alpha), expected)


@pytest.mark.parametrize("which", FUNCTIONS)
@pytest.mark.parametrize("device", [MESA, IDEAL, DEVICES["geforce3"]], ids=lambda d: d.name)
def test_sources_are_quantised_first(which, device):
    """Arbitrary and hostile reals as source and alpha equal their own codes."""
    fmt, n = FORMATS["unorm8"], 1 << 18
    rng = np.random.default_rng(5)
    x, alpha = (rng.random((2, n)) * 1.2 - 0.1).astype(np.float32)
    x[:6] = alpha[3:9] = [np.nan, np.inf, -np.inf, -0.0, 1.0, 2.0]
    d, dst_alpha = rng.integers(0, 256, (2, n))
    s = encode(x, fmt, device).astype(np.int64)
    a = encode(alpha, fmt, device).astype(np.int64)
    if which == "under":
        a, alpha = dst_alpha, dst_alpha.astype(np.float32)
    product = {"gl_llvmpipe": two_step(8), "ideal": nearest(255), "geforce3": cut(255)}[device.name]
    expected = integer_blend(which, s, a, d, 255, product)
    np.testing.assert_array_equal(run(which, "float32", Unorm(), rule(fmt, device), d, x, alpha), expected)


@pytest.mark.parametrize("real", ["float32", "float64"])
def test_a_device_may_round_once_instead(real):
    fmt, n = FORMATS["unorm8"], 1 << 18
    x, a = np.random.default_rng(6).random((2, n)).astype(real)
    d = np.random.default_rng(7).integers(0, 256, n)
    one, stored, source = np.dtype(real).type(1), d.astype(real), x * np.dtype(real).type(255)
    dst = a * 255
    results = {
        "add": stored + source,
        "over": source * a + stored * (one - a),
        "over_premultiplied": source + stored * (one - a),
        "add_alpha": source * a + stored,
        "modulate": stored * x,
        "modulate_inverse": stored * (one - a),
        "under": source * (one - dst * np.dtype(real).type(1 / 255)) + stored,
    }
    for which, y in results.items():
        got = run(which, real, Unorm(), rule(fmt, ROUND_ONCE), d, x, dst if which == "under" else a)
        np.testing.assert_array_equal(got, np.rint(np.minimum(y, 255)), err_msg=which)
    first = run("over", real, Unorm(), rule(fmt, IDEAL), d, x, a)
    assert np.count_nonzero(first != run("over", real, Unorm(), rule(fmt, ROUND_ONCE), d, x, a)) > n // 10


def float_blend(which, s, a, d):
    """In s's own precision, product by product."""
    one = s.dtype.type(1)
    return {
        "add": s + d,
        "over": s * a + d * (one - a),
        "over_premultiplied": s + d * (one - a),
        "add_alpha": s * a + d,
        "modulate": d * s,
        "modulate_inverse": d * (one - a),
        "under": s * (one - a) + d,
    }[which]


@pytest.mark.parametrize("which", FUNCTIONS)
@pytest.mark.parametrize("device", [MESA, IDEAL], ids=lambda d: d.name)
def test_float_blends_multiply_and_add_apart_and_round_at_the_store(which, device):
    rng = np.random.default_rng(8)
    s, d = (rng.standard_normal((2, 1 << 18)) * 10.0 ** rng.uniform(-6, 4.5, (2, 1 << 18))).astype(np.float32)
    a = rng.random(s.size).astype(np.float32)
    rounding = "truncate" if device is MESA else "nearest_even"
    d = np.clip(d, -60000, 60000).astype(np.float16).astype(np.float32)
    y = float_blend(which, s, a, d)
    form = Mixed()
    got = run(which, "float32", form, rule(FORMATS["float16"], device), d, s, a)
    np.testing.assert_array_equal(got, small_float(y, 10, rounding))
    for channel, mantissa in ((0, 6), (2, 5)):
        stored = encode(np.abs(d), FORMATS["r11g11b10f"], device, channel=channel)
        y = float_blend(which, np.abs(s), a, stored)
        expected = np.minimum(small_float(y, mantissa, rounding), 65536 * (1 - 2.0 ** -(mantissa + 1)))
        r = rule(FORMATS["r11g11b10f"], device, channel=channel)
        np.testing.assert_array_equal(run(which, "float32", form, r, stored, np.abs(s), a), expected)
    for form in (Exact(), Mixed()):
        got = run(which, "float32", form, rule(FORMATS["float32"], device), d, s, a)
        np.testing.assert_array_equal(got, float_blend(which, s, a, d))


@pytest.mark.parametrize("real", ["float32", "float64"])
def test_encode_has_the_bits_of_the_array_function(real):
    x = np.concatenate([hostile_floats(1 << 16), near_ties(255), near_ties(1023, 4), near_ties(65535, 1)])
    with np.errstate(invalid="ignore"):
        x = x.astype(real)
    for name, fmt in FORMATS.items():
        for device in DEVICES.values():
            for channel in (0, 2) if name == "r11g11b10f" else (0,):
                with np.errstate(over="ignore", under="ignore", invalid="ignore"):
                    expected = encode(x, fmt, device, channel=channel)
                    if name == "float64":
                        expected = expected.astype(real)
                    r = rule(fmt, device, channel=channel)
                    forms = [Mixed()]
                    if name in UNORM_NAMES:
                        forms.append(Unorm())
                    if name == real:
                        forms.append(Exact())
                    for form in forms:
                        got = run(ENCODE, real, form, r, np.zeros(x.size), x)
                        np.testing.assert_array_equal(got, expected, err_msg=f"{name} {device.name}")
                        if got.dtype.kind == "f":
                            assert not np.signbit(got[got == 0]).any(), name


@pytest.mark.parametrize("name", UNORM_NAMES)
def test_kernels_encode_every_tie_as_the_formula_does(name):
    fmt = FORMATS[name]
    x = near_ties(fmt.top)
    product = np.clip(x, 0, 1) * np.float32(fmt.top)
    expected = {"ideal": np.rint(product), "geforce3": np.floor(product)}
    expected["geforce_fx"] = np.floor(product + np.float32(0.5))
    through = np.rint(np.clip(x, 0, 1) * np.float32(65535)).astype(np.int64) >> 6
    expected["gl_llvmpipe"] = through if name == "unorm10" else expected["ideal"]
    zeros = np.zeros(x.size, np.uint16)
    for device, codes in expected.items():
        got = run(ENCODE, "float32", Unorm(), rule(fmt, DEVICES[device]), zeros, x)
        np.testing.assert_array_equal(got, codes, err_msg=device)


@pytest.mark.parametrize("device", DEVICES.values(), ids=lambda d: d.name)
def test_value_of_every_code_in_every_class(device):
    for name in UNORM_NAMES:
        fmt = FORMATS[name]
        codes = np.arange(fmt.top + 1)
        for real in ("float32", "float64"):
            expected = decode_as(codes, fmt, device, real)
            for form in (Unorm(), Mixed()):
                got = run(VALUE, real, form, rule(fmt, device), codes, 0.0)
                np.testing.assert_array_equal(got, expected)
                assert got.dtype == real


def test_numbers_of_float_formats_are_their_own_values():
    x = np.array([0.0, 1.5, -2.0, np.inf, -np.inf, np.nan, 65504.0])
    for real in ("float32", "float64"):
        for form, name in ((Mixed(), "float16"), (Mixed(), real), (Exact(), real)):
            np.testing.assert_array_equal(run(VALUE, real, form, rule(FORMATS[name], IDEAL), x, 0.0), x)


@pytest.mark.parametrize("real", ["float32", "float64"])
@pytest.mark.parametrize("which", FUNCTIONS)
def test_mixed_has_the_bits_of_the_special_classes(which, real):
    n = 1 << 14
    rng = np.random.default_rng(9)
    x, alpha = (rng.random((2, n)) * 1.2 - 0.1).astype(real)
    x[0], alpha[1] = np.nan, np.nan
    for name in UNORM_NAMES:
        fmt = FORMATS[name]
        d, dst_alpha = rng.integers(0, fmt.top + 1, (2, n))
        a = dst_alpha.astype(real) if which == "under" else alpha
        for device in (*DEVICES.values(), ROUND_ONCE):
            r = rule(fmt, device)
            np.testing.assert_array_equal(
                run(which, real, Mixed(), r, d, x, a), run(which, real, Unorm(), r, d, x, a), err_msg=device.name
            )
    d = rng.standard_normal(n).astype(real)
    r = rule(FORMATS[real], IDEAL)
    np.testing.assert_array_equal(run(which, real, Mixed(), r, d, x, alpha), run(which, real, Exact(), r, d, x, alpha))


@pytest.mark.parametrize("which", FUNCTIONS)
def test_float64_arithmetic_blends_the_same_codes(which):
    """With quantised sources a blend of codes is integer arithmetic, whatever the arithmetic of the kernel."""
    n = 1 << 18
    rng = np.random.default_rng(10)
    for name in UNORM_NAMES:
        fmt = FORMATS[name]
        s, d, a = rng.integers(0, fmt.top + 1, (3, n))
        for device in DEVICES.values():
            got = {}
            for real in ("float32", "float64"):
                alpha = a.astype(real) if which == "under" else decode_as(a, fmt, device, real)
                x = decode_as(s, fmt, device, real)
                got[real] = run(which, real, Unorm(), rule(fmt, device), d, x, alpha)
            np.testing.assert_array_equal(got["float32"], got["float64"], err_msg=f"{name} {device.name}")


@pytest.mark.parametrize("n_draws", [23, 40, 160, 256])
def test_equal_planes_added_up_err_by_half_a_step_each(n_draws):
    """n additive planes: everything below half a step is black, the worst error n / 2 / 255."""
    fmt = FORMATS["unorm8"]
    total = np.linspace(0, 1, 4096)
    x = (total / n_draws).astype(np.float32)
    stored = np.zeros(x.size)
    for _ in range(n_draws):
        stored = run("add", "float32", Unorm(), rule(fmt, IDEAL), stored, x)
    error = np.abs(stored / 255 - np.minimum(total, 1))
    assert error.max() <= n_draws / 2 / 255 * (1 + 1e-6)
    assert error.max() >= min(n_draws, 255) / 2 / 255 - 2 / 255
    assert not stored[total < n_draws / 2 / 255 * 0.999].any()


@pytest.mark.parametrize(("alpha", "stuck"), [(1, 127), (2, 63), (4, 31), (8, 15), (16, 7), (32, 3), (64, 1)])
def test_a_fade_sticks_where_llvmpipe_does(alpha, stuck):
    fmt = FORMATS["unorm8"]
    stored = np.full(1, 255)
    for _ in range(4000):
        stored = run("over", "float32", Unorm(), rule(fmt, MESA), stored, 0.0, np.float32(alpha / 255))
    assert stored[0] == stuck
