"""Memory of buffers: orientation, padding, refusals."""

import numpy as np
import pytest

from atmoref.buffers.blend import Exact, Mixed, Unorm
from atmoref.buffers.device import DEVICES
from atmoref.buffers.formats import FORMATS
from atmoref.buffers.layout import allocate, code_class, needed_bytes, pack_words, row_pitch, unpack_words
from atmoref.lanes import N


def forms(fmt, arithmetic):
    yield Mixed()
    if fmt.kind == "unorm" and fmt.bits <= 16:
        yield Unorm()
    if fmt.name == arithmetic:
        yield Exact()


@pytest.mark.parametrize("arithmetic", ["float32", "float64"])
@pytest.mark.parametrize("fmt", FORMATS.values(), ids=lambda f: f.name)
def test_a_picture_comes_back_as_it_was_put(fmt, arithmetic):
    rng = np.random.default_rng(0)
    for form in forms(fmt, arithmetic):
        buffer = allocate("frame", fmt, 5, 3, 3, form, arithmetic)
        assert buffer.data.flags.c_contiguous
        if fmt.kind == "unorm":
            codes = rng.integers(0, fmt.top + 1, (3, 5, 3))
            buffer.put(codes)
            np.testing.assert_array_equal(buffer.codes(), codes)
            np.testing.assert_array_equal(buffer.values(), codes / fmt.top)
        else:
            buffer.put(rng.integers(0, 32, (3, 5, 3)) / 32.0)
            codes = buffer.codes()
        assert buffer.codes().dtype == fmt.storage
        assert buffer.values().dtype == np.float64
        again = buffer.values()
        buffer.clear()
        assert not buffer.codes().any()
        buffer.put(again)
        np.testing.assert_array_equal(buffer.codes(), codes)


def test_row_0_of_memory_is_the_bottom_row_of_the_picture():
    buffer = allocate("frame", FORMATS["unorm8"], 3, 2, 2, Unorm(), "float32")
    buffer.put(np.arange(12).reshape(2, 3, 2))
    planar = buffer.data.reshape(2, 2, buffer.pitch)
    np.testing.assert_array_equal(planar[0, 0, :3], [6, 8, 10])  # first channel, bottom row
    np.testing.assert_array_equal(planar[1, 1, :3], [1, 3, 5])  # second channel, top row
    assert buffer.plane == 2 * buffer.pitch


def test_what_is_handed_out_is_a_copy():
    buffer = allocate("frame", FORMATS["float32"], 3, 2, 1, Exact(), "float32")
    buffer.codes()[...] = 1
    buffer.values()[...] = 1
    assert not buffer.data.any()


@pytest.mark.parametrize("width", [1, 2, N, N + 1, 300])
def test_rows_are_filled_up_to_whole_waves(width):
    assert row_pitch(width) % N == 0
    assert width <= row_pitch(width) < width + N
    assert needed_bytes(width, 7, 3, Unorm(), "float32") == row_pitch(width) * 7 * 3 * 2


def test_reals_are_encoded_by_the_device():
    buffer = allocate("frame", FORMATS["unorm8"], 1, 1, 1, Unorm(), "float32")
    buffer.put([[0.7 / 255]])
    assert buffer.codes() == 1
    buffer.put([[0.7 / 255]], DEVICES["geforce3"])
    assert buffer.codes() == 0
    buffer.put([[0.5 / 255]], rounding="half_up")
    assert buffer.codes() == 1
    packed = allocate("sky", FORMATS["r11g11b10f"], 1, 1, 3, Mixed(), "float32")
    packed.put(np.full((1, 1, 3), 1 + 1 / 64))
    np.testing.assert_array_equal(packed.values(), [[[1 + 1 / 64, 1 + 1 / 64, 1.0]]])


@pytest.mark.parametrize(
    ("names", "arithmetic", "expected"),
    [
        (["unorm8"], "float32", Unorm),
        (["unorm8", "unorm12", "unorm16"], "float64", Unorm),
        (["float32"], "float32", Exact),
        (["float64", "float64"], "float64", Exact),
        (["float32"], "float64", Mixed),
        (["float64"], "float32", Mixed),
        (["unorm8", "float32"], "float32", Mixed),
        (["depth24"], "float32", Mixed),
        (["float16"], "float32", Mixed),
        (["r11g11b10f"], "float32", Mixed),
    ],
)
def test_code_class(names, arithmetic, expected):
    assert isinstance(code_class([FORMATS[n] for n in names], arithmetic), expected)


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((0, 1, 1), "width of a buffer is 0, allowed: 1"),
        ((1, -5, 1), "height of a buffer is -5"),
        ((1 << 40, 1, 1), "width"),
        ((1, 1, 5), "1 ... 4 channels"),
        ((1 << 20, 1 << 20, 4), "32-bit index"),
    ],
)
def test_sizes_are_refused_before_anything_is_allocated(size, message):
    with pytest.raises(ValueError, match=message):
        allocate("frame", FORMATS["unorm8"], *size, Unorm(), "float32")


def test_memory_and_classes_are_checked():
    with pytest.raises(MemoryError, match="needs"):
        allocate("frame", FORMATS["unorm8"], 1 << 14, 1 << 14, 4, Unorm(), "float32", max_bytes=1 << 20)
    with pytest.raises(ValueError, match=r"class Unorm hold .*, not float32"):
        allocate("frame", FORMATS["float32"], 1, 1, 1, Unorm(), "float32")
    with pytest.raises(ValueError, match="not depth24"):
        allocate("frame", FORMATS["depth24"], 1, 1, 1, Unorm(), "float32")
    with pytest.raises(ValueError, match="Exact hold float64, not float32"):
        allocate("frame", FORMATS["float32"], 1, 1, 1, Exact(), "float64")


def test_what_is_put_is_checked():
    unorm = allocate("frame", FORMATS["unorm8"], 2, 3, 1, Unorm(), "float32")
    with pytest.raises(ValueError, match=r"frame has shape \(3, 2, 1\)"):
        unorm.put(np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"codes 0 \.\.\. 255, found 0 \.\.\. 256"):
        unorm.put([[0, 1], [2, 3], [4, 256]])
    with pytest.raises(ValueError, match="float16 of sky does not have"):
        allocate("sky", FORMATS["float16"], 1, 1, 1, Mixed(), "float32").put([[1]])


@pytest.mark.parametrize("name", ["unorm10", "unorm12", "unorm16"])
def test_words_hold_every_code_in_their_high_bits(name):
    fmt = FORMATS[name]
    codes = np.arange(fmt.top + 1)
    words = pack_words(codes, fmt)
    np.testing.assert_array_equal(unpack_words(words, fmt), codes)
    np.testing.assert_array_equal(words.astype(int), codes * 2 ** (16 - fmt.bits))
    with pytest.raises(ValueError, match="16-bit words"):
        pack_words([0], FORMATS["depth24"])
