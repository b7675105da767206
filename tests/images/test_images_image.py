"""The image itself and the tone curve."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from atmoref.images import Image, ImageError, display_codes, from_rgb, srgb_decode, srgb_encode


def test_what_is_no_image() -> None:
    plane = np.zeros((2, 3))
    for channels, told in (
        ({}, "at least one"),
        ({"R": plane, "G": np.zeros((3, 2))}, "differ in shape"),
        ({"R": np.zeros(3)}, "planes"),
        ({"R": np.zeros((0, 3))}, "at least one pixel"),
        ({"": plane}, "no name"),
        ({"R": plane.astype(np.int64)}, "int64"),
        ({"R": plane.astype(complex)}, "complex"),
    ):
        with pytest.raises(ImageError, match=told):
            Image(channels)


def test_from_rgb_names_channels_by_their_number() -> None:
    names = [["Y"], ["Y", "A"], ["R", "G", "B"], ["R", "G", "B", "A"]]
    for count, expected in enumerate(names, 1):
        array = np.arange(6 * count, dtype=np.float32).reshape(2, 3, count)
        image = from_rgb(array)
        assert list(image.channels) == expected
        np.testing.assert_array_equal(np.stack(list(image.channels.values()), -1), array)
    for wrong in (np.zeros(3), np.zeros((2, 2, 5)), np.zeros((2, 2), complex), np.array([[-1]]), np.array([["a"]])):
        with pytest.raises(ImageError):
            from_rgb(wrong)


def test_integers_become_unsigned_where_they_fit() -> None:
    assert from_rgb(np.array([[0, 2**32 - 1]])).channels["Y"].dtype == np.uint32
    assert from_rgb(np.array([[True]])).channels["Y"].dtype == np.uint8


def test_layers() -> None:
    planes = {name: np.full((1, 1), at, np.float32) for at, name in enumerate(["R", "G", "B", "T.R", "a.b.R", "a.b.G"])}
    image = Image(planes)
    assert image.layers() == ["", "T", "a.b"]
    assert list(image.layer("a.b").channels) == ["R", "G"]
    assert list(image.layer("").channels) == ["R", "G", "B"]
    with pytest.raises(ImageError, match="no layer 'x'"):
        image.layer("x")


@pytest.mark.parametrize(
    ("name", "kind", "top"),
    [("unorm2", "uint8", 3), ("unorm8", "uint8", 255), ("unorm12", "uint16", 4095), ("depth24", "uint32", 2**24 - 1)],
)
def test_codes_are_divided_by_the_top_of_their_format(name: str, kind: str, top: int) -> None:
    image = Image({"Y": np.array([[0, 1, top]], kind)}, {"format": name})
    assert image.top("Y") == top
    np.testing.assert_array_equal(image.values("Y"), [[0.0, 1.0 / top, 1.0]])


def test_a_format_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ImageError, match="does not fit"):
        Image({"Y": np.zeros((1, 1), np.uint8)}, {"format": "unorm12"}).top("Y")
    assert Image({"Y": np.zeros((1, 1), np.float32)}, {"format": "unorm8"}).top("Y") is None


def test_srgb_against_exact_arithmetic() -> None:
    for x in [*np.linspace(0.0, 1.0, 101), 0.0031308, 0.00313081, 0.5, 4.0, 1e-9]:
        exact = 12.92 * mpmath.mpf(x) if x <= 0.0031308 else 1.055 * mpmath.mpf(x) ** (1 / mpmath.mpf("2.4")) - 0.055
        assert math.isclose(srgb_encode(x), float(exact), rel_tol=1e-15, abs_tol=1e-17)
        exact = mpmath.mpf(x) / 12.92 if x <= 0.04045 else ((mpmath.mpf(x) + 0.055) / 1.055) ** mpmath.mpf("2.4")
        # exponent 2.4 and the sum each round once: measured 4e-16, set 1e-15
        assert math.isclose(srgb_decode(x), float(exact), rel_tol=1e-15, abs_tol=1e-17)


def test_srgb_code_of_middle_grey_and_all_8_bit_codes_come_back() -> None:
    assert display_codes(0.18).item() == 118  # 18 % grey, as every sRGB table has it
    codes = np.arange(256)
    np.testing.assert_array_equal(display_codes(srgb_decode(codes / 255.0)), codes)
    codes = np.arange(65536)
    np.testing.assert_array_equal(display_codes(srgb_decode(codes / 65535.0), bits=16), codes)
    np.testing.assert_array_equal(srgb_encode([-0.5, -0.001]), -srgb_encode([0.5, 0.001]))


@pytest.mark.parametrize(("exposure", "bits"), [(0.0, 8), (-1.0, 8), (math.nan, 8), (math.inf, 8), (1.0, 10)])
def test_display_refuses_senseless_settings(exposure: float, bits: int) -> None:
    with pytest.raises(ValueError, match=r"exposure|bits"):
        display_codes(np.ones(3), exposure, bits)
