"""Filters against NumPy implementations with clipped indices, on the sizes that were measured on llvmpipe."""

from fractions import Fraction

import numpy as np
import pytest
from buffer_kernels import sample
from hypothesis import given, settings
from hypothesis import strategies as st

from atmoref.buffers.device import DEVICES
from atmoref.buffers.formats import FORMATS, decode_as
from atmoref.buffers.sampler import texture

IDEAL, MESA = DEVICES["ideal"], DEVICES["gl_llvmpipe"]
SIZES = [(2, 2), (16, 16), (64, 48), (100, 37)]
VOLUME = (20, 31, 17)  # width, height, depth
MANY = 1 << 16


def coordinates(n, size, real, seed=0):
    """Random coordinates, the borders, and texel edges and centres with their neighbours."""
    rng = np.random.default_rng(seed)
    u = rng.random(n).astype(real)
    marks = (np.arange(2 * size + 1) / (2 * size)).astype(real)
    near = np.concatenate([np.nextafter(marks, -1), marks, np.nextafter(marks, 2)]).clip(0, 1)
    u[: near.size] = rng.permutation(near)[:n]
    return u


def fused(w, a, b):
    """fma(w, b - a, a), rounded once: an exact product and sum, rounded to odd, then to float32."""
    if np.asarray(a).dtype == np.float64:
        exact = [
            Fraction(float(x)) * Fraction(float(y - z)) + Fraction(float(z)) for x, y, z in zip(w, b, a, strict=True)
        ]
        return np.array([float(x) for x in exact])
    p, c = w.astype(np.float64) * (b - a).astype(np.float64), a.astype(np.float64)
    s = p + c
    t = s - p
    rest = (p - (s - t)) + (c - t)
    even = s.view(np.int64) & 1 == 0
    s = np.where((rest != 0) & even, np.nextafter(s, np.where(rest > 0, np.inf, -np.inf)), s)
    return s.astype(np.float32)


def plain(w, a, b):
    return a + w * (b - a)


def eight_bits(w, a, b):
    return a + ((w * (b - a) + 128) >> 8)


def axis(u, n):
    x = u * u.dtype.type(n) - u.dtype.type(0.5)
    return np.floor(x).astype(int), x - np.floor(x)


def byte_axis(u, n):
    x = np.rint(u * u.dtype.type(n * 256)).astype(int) - 128
    return x >> 8, x & 255


def linear(texels, coords, lerp, split):
    """Filter along x, then y, then z; texels have axes (z,) y, x; coords are u, v (, w)."""
    lower, weights = zip(*(split(u, n) for u, n in zip(coords, texels.shape[::-1], strict=True)), strict=True)

    def along(axis_number, corner):
        if axis_number < 0:
            index = [np.clip(i + c, 0, n - 1) for i, c, n in zip(lower, corner, texels.shape[::-1], strict=True)]
            return texels[tuple(index[::-1])]
        a, b = (along(axis_number - 1, _set(corner, axis_number, k)) for k in (0, 1))
        return lerp(weights[axis_number], a, b)

    return along(len(coords) - 1, (0,) * len(coords))


def _set(corner, place, k):
    return tuple(k if i == place else c for i, c in enumerate(corner))


@pytest.mark.parametrize("real", ["float32", "float64"])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_bilinear_of_float_textures(size, real):
    width, height = size
    texels = np.random.default_rng(width).standard_normal((height, width, 3)).astype(real)
    u, v = coordinates(MANY, width, real, 1), coordinates(MANY, height, real, 2)
    for device, lerp in ((IDEAL, plain), (MESA, fused)):
        n = MANY if lerp is plain or real == "float32" else 2048
        tex = texture(texels, FORMATS[real], device, real)
        three = sample("bilinear3", real, tex, u[:n], v[:n])
        for channel in range(3):
            expected = linear(texels[..., channel], (u[:n], v[:n]), lerp, axis)
            np.testing.assert_array_equal(three[channel], expected)
            np.testing.assert_array_equal(sample("bilinear", real, tex, u[:n], v[:n], channel=channel), expected)


@pytest.mark.parametrize("name", ["unorm8", "unorm10", "unorm16", "float16", "depth24"])
def test_bilinear_of_other_formats_filters_the_values_that_are_read(name):
    fmt = FORMATS[name]
    rng = np.random.default_rng(0)
    codes = rng.integers(0, fmt.top + 1, (37, 100)) if fmt.kind == "unorm" else rng.random((37, 100)).astype(np.float16)
    u, v = coordinates(MANY, 100, "float32", 1), coordinates(MANY, 37, "float32", 2)
    for device, mode, lerp in ((IDEAL, None, plain), (MESA, "fused", fused)):
        tex = texture(codes, fmt, device, np.float32, mode)
        expected = linear(decode_as(codes, fmt, device, np.float32), (u, v), lerp, axis)
        np.testing.assert_array_equal(sample("bilinear", "float32", tex, u, v), expected)


@pytest.mark.parametrize("real", ["float32", "float64"])
@pytest.mark.parametrize("channels", [1, 4])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_bilinear_of_8_bit_textures_on_llvmpipe(size, channels, real):
    width, height = size
    fmt = FORMATS["unorm8"]
    codes = np.random.default_rng(width).integers(0, 256, (height, width, channels))
    u, v = coordinates(MANY, width, real, 1), coordinates(MANY, height, real, 2)
    for device in (MESA, DEVICES["geforce3"]):
        tex = texture(codes, fmt, device, real)
        results = []
        for channel in range(channels):
            filtered = linear(codes[..., channel], (u, v), eight_bits, byte_axis)
            results.append(decode_as(filtered, fmt, device, real))
            np.testing.assert_array_equal(sample("bilinear", real, tex, u, v, channel=channel), results[-1])
        if channels > 2:
            np.testing.assert_array_equal(sample("bilinear3", real, tex, u, v), results[:3])


def test_the_8_bit_filter_is_within_one_code_per_axis_of_the_exact_one():
    rng = np.random.default_rng(0)
    u, v, w = rng.random((3, 1 << 18)).astype(np.float32)
    codes = rng.integers(0, 2, (17, 31, 20)) * 255
    for kind, texels, limit in (("bilinear", codes[0], 2), ("trilinear", codes, 3)):
        coarse, exact = (
            texture(texels, FORMATS["unorm8"], IDEAL, np.float32, mode, volume=texels.ndim == 3)
            for mode in ("bytes", "exact")
        )
        distance = (
            np.abs(sample(kind, "float32", coarse, u, v, w) - sample(kind, "float32", exact, u, v, w)).max() * 255
        )
        assert 1.0 < distance < limit  # an axis adds at most 255 / 512 by its weight and 1/2 by its result


@pytest.mark.parametrize("real", ["float32", "float64"])
def test_trilinear(real):
    width, height, depth = VOLUME
    rng = np.random.default_rng(4)
    u, v, w = (coordinates(MANY, n, real, i) for i, n in enumerate(VOLUME))
    texels = rng.standard_normal((depth, height, width, 2)).astype(real)
    for device, lerp in ((IDEAL, plain), (MESA, fused)):
        n = MANY if lerp is plain or real == "float32" else 1024
        tex = texture(texels, FORMATS[real], device, real, volume=True)
        for channel in range(2):
            expected = linear(texels[..., channel], (u[:n], v[:n], w[:n]), lerp, axis)
            got = sample("trilinear", real, tex, u[:n], v[:n], w[:n], channel)
            np.testing.assert_array_equal(got, expected)
    codes = rng.integers(0, 256, (depth, height, width, 4))
    tex = texture(codes, FORMATS["unorm8"], MESA, real, volume=True)
    for channel in range(4):
        filtered = linear(codes[..., channel], (u, v, w), eight_bits, byte_axis)
        got = sample("trilinear", real, tex, u, v, w, channel)
        np.testing.assert_array_equal(got, decode_as(filtered, FORMATS["unorm8"], MESA, real))


@pytest.mark.parametrize("real", ["float32", "float64"])
@pytest.mark.parametrize("size", [*SIZES, (1, 1), (1, 7)], ids=str)
def test_nearest(size, real):
    width, height = size
    texels = np.arange(2.0 * width * height, dtype=real).reshape(height, width, 2)
    u, v = coordinates(MANY, width, real, 1), coordinates(MANY, height, real, 2)
    i = np.minimum(np.floor(u * u.dtype.type(width)).astype(int), width - 1)
    j = np.minimum(np.floor(v * v.dtype.type(height)).astype(int), height - 1)
    for filtering in ("exact", "fused"):
        tex = texture(texels, FORMATS[real], IDEAL, real, filtering)
        np.testing.assert_array_equal(sample("nearest", real, tex, u, v, channel=1), texels[j, i, 1])


def test_one_texel_is_constant_and_centres_are_exact():
    one = texture(np.array([[0.71]]), FORMATS["unorm8"], MESA)
    u = coordinates(100, 1, "float32")
    assert set(sample("bilinear", "float32", one, u, u[::-1])[:100]) == {np.float32(181) * np.float32(1 / 255)}
    codes = np.random.default_rng(0).integers(0, 256, (32, 64))
    y, x = np.mgrid[0:32, 0:64]
    u, v = ((x.ravel() + 0.5) / 64).astype(np.float32), ((y.ravel() + 0.5) / 32).astype(np.float32)
    for device in DEVICES.values():
        tex = texture(codes, FORMATS["unorm8"], device)
        expected = decode_as(codes, FORMATS["unorm8"], device, np.float32).ravel()
        np.testing.assert_array_equal(sample("bilinear", "float32", tex, u, v), expected)


def test_row_0_is_v_0_and_reals_are_encoded_by_the_device():
    ramp = np.linspace(0, 1, 12).reshape(4, 3)
    u, v = np.array([0.5]), np.array([0.01])
    tex = texture(ramp, FORMATS["unorm8"], IDEAL)
    assert sample("nearest", "float32", tex, u, v)[0] == np.float32(np.rint(ramp[0, 1] * 255) / 255)
    cut = texture(ramp, FORMATS["unorm8"], DEVICES["geforce3"])
    assert sample("nearest", "float32", cut, u, v)[0] == np.float32(np.floor(ramp[0, 1] * 255) / 255)


@pytest.mark.parametrize("real", ["float32", "float64"])
@pytest.mark.parametrize("name", ["depth24", "unorm16", "own"])
def test_shadow_compare(name, real):
    fmt = FORMATS[real if name == "own" else name]
    rng = np.random.default_rng(2)
    depth = rng.random((37, 100))
    depth[rng.random(depth.shape) < 0.3] = 1.0
    stored = np.rint(depth * fmt.top).astype(np.int64) if fmt.kind == "unorm" else depth.astype(real)
    n = 2048 if real == "float64" else MANY
    u, v = coordinates(n, 100, real, 1), coordinates(n, 37, real, 2)
    for device, lerp in ((IDEAL, plain), (MESA, fused)):
        texels = decode_as(stored, fmt, device, real)
        i, j = np.minimum((u * 100).astype(int), 99), np.minimum((v * 37).astype(int), 36)
        reference = (rng.random(n) * 1.4 - 0.2).astype(real)
        reference[::5] = texels[j, i][::5]  # equal is lit
        clamped = np.clip(reference, 0, 1) if fmt.kind == "unorm" else reference
        for compare in ("nearest", "pcf"):
            tex = texture(stored, fmt, device, real, "fused" if device is MESA else "exact", compare=compare)
            if compare == "nearest":
                expected = (clamped <= texels[j, i]).astype(real)
            else:
                (x, wx), (y, wy) = axis(u, 100), axis(v, 37)
                lit = [
                    (clamped <= texels[np.clip(y + b, 0, 36), np.clip(x + a, 0, 99)]).astype(real)
                    for b in (0, 1)
                    for a in (0, 1)
                ]
                expected = lerp(wy, lerp(wx, lit[0], lit[1]), lerp(wx, lit[2], lit[3]))
            np.testing.assert_array_equal(sample("shadow_compare", real, tex, u, v, reference), expected)


@pytest.mark.parametrize("compare", ["nearest", "pcf"])
def test_beyond_the_far_plane_a_unorm_map_stays_lit(compare):
    u, beyond = np.full(4, 0.4), np.array([1.0, 1.0001, 5.0, np.inf])
    unorm = texture(np.ones((8, 8)), FORMATS["depth24"], IDEAL, np.float32, compare=compare)
    np.testing.assert_array_equal(sample("shadow_compare", "float32", unorm, u, u, beyond)[:4], 1)
    real = texture(np.ones((8, 8)), FORMATS["float32"], IDEAL, np.float32, compare=compare)
    np.testing.assert_array_equal(sample("shadow_compare", "float32", real, u, u, beyond)[:4], [1, 0, 0, 0])


def test_projection_multiplies_by_the_reciprocal():
    x, y, w = (np.random.default_rng(i).random(1 << 16).astype(np.float32) + np.float32(0.1) for i in range(3))
    tex = texture(np.ones((1, 1)), FORMATS["float32"], IDEAL)
    got = sample("project", "float32", tex, x, y, w)
    inverse = np.float32(1) / w
    np.testing.assert_array_equal(got, [x * inverse, y * inverse])
    assert np.mean(got[0] == x / w) < 0.9


@settings(max_examples=60)
@given(
    codes=st.lists(st.integers(0, 255), min_size=4, max_size=4),
    u=st.floats(0, 1, width=32),
    v=st.floats(0, 1, width=32),
    device=st.sampled_from(list(DEVICES.values())),
)
def test_a_filter_stays_between_its_texels(codes, u, v, device):
    texels = np.array(codes).reshape(2, 2)
    tex = texture(texels, FORMATS["unorm8"], device)
    result = sample("bilinear", "float32", tex, [u], [v])[0] * 255
    assert min(codes) - 1e-4 <= result <= max(codes) + 1e-4


@pytest.mark.parametrize(
    ("shape", "options", "message"),
    [
        ((4,), {}, "2-D texture has 2 or 3 axes"),
        ((4, 4, 5), {}, "1 ... 4 channels"),
        ((0, 4), {}, "at least one texel"),
        ((4, 4), {"volume": True}, "3-D texture has 3 or 4 axes"),
        ((4, 4), {"filter": "cubic"}, "filter is 'cubic', allowed: exact, fused, bytes"),
        ((4, 4), {"compare": "soft"}, "compare is 'soft'"),
        ((4, 4), {"arith_dtype": np.float16}, "float32 or float64"),
        ((1, 20000), {"filter": "bytes"}, "16383 texels"),
    ],
)
def test_textures_that_cannot_be_are_refused(shape, options, message):
    with pytest.raises(ValueError, match=message):
        texture(np.zeros(shape), FORMATS["unorm8"], IDEAL, **options)


def test_codes_are_checked():
    with pytest.raises(ValueError, match=r"codes 0 \.\.\. 255, found 0 \.\.\. 256"):
        texture(np.array([[0, 256]]), FORMATS["unorm8"], IDEAL)
    with pytest.raises(ValueError, match="float16 does not have"):
        texture(np.array([[0, 1]]), FORMATS["float16"], IDEAL)
    with pytest.raises(ValueError, match="'bytes' reads 8-bit codes"):
        texture(np.zeros((2, 2)), FORMATS["unorm16"], IDEAL, filter="bytes")
    with pytest.raises(ValueError, match="32-bit index"):
        texture(np.broadcast_to(np.float32(0), (40000, 40000, 2)), FORMATS["float32"], IDEAL)
