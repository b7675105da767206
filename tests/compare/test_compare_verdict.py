"""Metrics with closed forms, limits, refusals, and the verdict."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from atmoref.compare import CompareError, compare
from atmoref.images import Image, from_rgb, srgb_decode, srgb_encode

RNG = np.random.default_rng(38)


def picture(height: int = 24, width: int = 32, channels: int = 3) -> np.ndarray:
    return RNG.random((height, width, channels))


def test_a_constant_offset_has_closed_forms() -> None:
    reference = 0.25 + 0.5 * picture()
    verdict = compare(reference + 0.0625, reference)
    assert verdict.passed is None
    assert verdict.word == "measured"
    found = verdict.metrics
    assert found["max_abs"] == pytest.approx(0.0625, rel=1e-12)
    assert found["mean"] == pytest.approx(0.0625, rel=1e-12)
    assert found["mean_abs"] == pytest.approx(0.0625, rel=1e-12)
    assert found["rms"] == pytest.approx(0.0625, rel=1e-12)
    assert found["psnr_db"] == pytest.approx(20.0 * math.log10(16.0), rel=1e-12)
    assert found["max_rel"] == pytest.approx(0.0625 / reference.min(), rel=1e-9)
    assert found["sum_ratio"] == pytest.approx(0.0625 / reference.mean(), rel=1e-9)


def test_psnr_is_of_the_mean_square_at_the_stated_peak() -> None:
    reference = np.zeros((10, 10))
    test = reference.copy()
    test[3, 7] = 1.0  # mean square 1/100
    assert compare(test, reference).metrics["psnr_db"] == pytest.approx(20.0)
    assert compare(test, reference, peak=10.0).metrics["psnr_db"] == pytest.approx(40.0)
    bright = compare(np.full((4, 4), 3.0), np.full((4, 4), 4.0))
    assert bright.peak == 4.0
    assert bright.metrics["psnr_db"] == pytest.approx(20.0 * math.log10(4.0))


def test_the_three_readings_of_average_error() -> None:
    reference = np.array([[0.01, 0.5, 2.0, 0.25]])
    test = np.array([[0.02, 0.4, 3.0, 0.25]])  # clipped differences .01 .1 0 0
    found = compare(test, reference).metrics
    assert found["clipped_mean"] == pytest.approx(0.11 / 4)
    assert found["clipped_sum_ratio"] == pytest.approx(0.11 / 1.76)
    assert found["mean_relative_above_0.02"] == pytest.approx((0.2 + 0.0 + 0.0) / 3)


def test_identical_images() -> None:
    reference = picture()
    verdict = compare(reference, reference, abs=0.0, rel=0.0, bounds=(reference, reference), perceptual_metrics="all")
    assert verdict.passed is True
    assert verdict.metrics["psnr_db"] == math.inf
    assert verdict.metrics["ssim"] == pytest.approx(1.0)
    assert verdict.metrics["flip"] == 0.0
    assert verdict.metrics["hdr_flip"] == 0.0
    assert verdict.hints == ()
    assert json.loads(json.dumps(verdict.to_dict(), allow_nan=False))["metrics"]["psnr_db"] == "inf"


def test_the_worst_place_is_named_from_the_top_left() -> None:
    reference = picture()
    test = reference.copy()
    test[5, 17, 1] += 3.0
    test[20, 3, 2] -= 2.0
    worst = compare(test, reference).worst
    assert (worst.x, worst.y, worst.channel) == (17, 5, "G")
    assert (worst.test, worst.reference) == (test[5, 17, 1], reference[5, 17, 1])
    mask = np.ones((24, 32), bool)
    mask[5, 17] = False
    assert (compare(test, reference, mask=mask).worst.y, compare(test, reference, mask=mask).judged_pixels) == (20, 767)


def test_codes_off_are_counted_exactly() -> None:
    reference = np.full((10, 10), 100, np.uint8)
    test = reference.copy()
    test[0, :3] += 1
    test[1, 0] -= 2
    test[2, 0] = 255
    verdict = compare(test, reference, codes=2)
    assert verdict.codes_off == {"-2": 1, "0": 95, "+1": 3, ">=+16": 1}
    assert verdict.passed is False
    assert verdict.limits[0].outside == 1
    assert verdict.limits[0].excess == 153.0
    assert (verdict.limits[0].worst.x, verdict.limits[0].worst.y) == (0, 2)
    assert compare(test, reference, codes=155).passed is True


def test_12_bit_codes_in_16_bit_words() -> None:
    attributes = {"format": "unorm12"}
    reference = from_rgb(np.array([[0, 4094]], np.uint16), attributes)
    verdict = compare(from_rgb(np.array([[0, 4095]], np.uint16), attributes), reference, codes=1)
    assert verdict.passed is True
    assert verdict.metrics["max_abs"] == pytest.approx(1.0 / 4095.0)
    with pytest.raises(CompareError, match="codes of one unorm format"):
        compare(from_rgb(np.array([[0, 4095]], np.uint16)), reference, codes=1)
    with pytest.raises(CompareError, match="beyond 4095"):
        compare(from_rgb(np.array([[0, 4096]], np.uint16), attributes), reference)


@pytest.mark.parametrize("excess", [0.0, 1e-9, -1e-9])
def test_limits_are_inclusive(excess: float) -> None:
    reference = np.array([[0.0, 1.0, 4.0]])
    test = np.array([[0.5 + excess, 1.0, 4.0]])
    assert compare(test, reference, abs=0.5).passed is (excess <= 0)
    test = np.array([[0.0, 1.0, 5.0 + excess]])
    assert compare(test, reference, rel=0.25).passed is (excess <= 0)
    assert compare(test, reference, bounds=(reference, reference + 1.0)).passed is (excess <= 0)


def test_abs_and_rel_together_ask_for_one_of_them() -> None:
    reference = np.array([[0.0, 100.0]])
    test = np.array([[0.001, 100.5]])
    assert compare(test, reference, abs=0.002).passed is False
    assert compare(test, reference, rel=0.01).passed is False
    assert compare(test, reference, abs=0.002, rel=0.01).passed is True


def test_all_limits_must_be_met() -> None:
    reference = np.array([[10, 20]], np.uint8)
    test = np.array([[11, 20]], np.uint8)
    verdict = compare(test, reference, codes=1, bounds=(reference, reference))
    assert [limit.passed for limit in verdict.limits] == [False, True]
    assert verdict.passed is False
    assert verdict.limits[0].excess == 1.0
    assert verdict.limits[0].fraction == 0.5


def test_what_lies_outside_the_mask_is_not_judged() -> None:
    reference = picture()
    test = reference.copy()
    test[:4] += 1.0
    mask = np.ones((24, 32), np.uint8)
    mask[:4] = 0
    assert compare(test, reference, abs=1e-6).passed is False
    verdict = compare(test, reference, abs=1e-6, mask=from_rgb(mask))
    assert verdict.passed is True
    assert verdict.metrics["max_abs"] == 0.0
    assert "640 of 768" in verdict.table()


@pytest.mark.parametrize(
    ("test", "reference", "told"),
    [
        (np.ones((2, 3)), np.ones((3, 2)), "the test is 3 x 2 pixels, the reference 2 x 3"),
        (np.ones((2, 2, 3)), np.ones((2, 2)), "channels differ"),
        (np.ones((2, 2, 7)), np.ones((2, 2)), "the test is no image"),
        (np.array([[1.0, math.nan]]), np.ones((1, 2)), "the test has NaN in channel Y at x = 1, y = 0"),
        (np.ones((1, 2)), np.array([[1.0, -math.inf]]), "the reference has -inf in channel Y"),
        (np.zeros((2, 2)), np.eye(2), "the test is blank"),
        (np.full((2, 2), 0.3), np.eye(2), "the test is blank"),
    ],
)
def test_refusals_say_why(test: np.ndarray, reference: np.ndarray, told: str) -> None:
    with pytest.raises(CompareError, match=told):
        compare(test, reference)


def test_a_blank_test_may_be_allowed_and_a_blank_reference_is_no_reason() -> None:
    assert compare(np.zeros((2, 2)), np.eye(2), allow_blank=True).metrics["max_abs"] == 1.0
    assert compare(np.zeros((2, 2)), np.zeros((2, 2)), abs=0.0).passed is True
    assert compare(np.eye(2), np.zeros((2, 2))).passed is None


@pytest.mark.parametrize(
    "limits",
    [
        {"abs": -1.0},
        {"abs": math.nan},
        {"rel": math.inf},
        {"codes": 1.5},
        {"codes": 1},
        {"peak": 0.0},
        {"mask": np.zeros((2, 2))},
        {"mask": np.ones((3, 2))},
        {"bounds": (np.eye(2) + 1.0, np.eye(2))},
        {"bounds": (np.ones((3, 3)), np.ones((3, 3)))},
    ],
)
def test_limits_that_make_no_sense(limits: dict) -> None:
    with pytest.raises(CompareError):
        compare(np.eye(2), np.eye(2), **limits)


def test_a_verdict_is_no_truth_value() -> None:
    with pytest.raises(TypeError, match=r"ask \.passed"):
        bool(compare(np.eye(2), np.eye(2)))


def test_channels_are_matched_by_name_and_reported_apart() -> None:
    planes = picture()
    reference = Image({name: planes[..., at] for at, name in enumerate("RGB")})
    test = Image({name: reference.channels[name] + (0.25 if name == "G" else 0.0) for name in "BGR"})
    verdict = compare(test, reference)
    assert {name: round(found["max_abs"], 12) for name, found in verdict.per_channel.items()} == {
        "R": 0,
        "G": 0.25,
        "B": 0,
    }
    assert verdict.worst.channel == "G"


def test_a_stated_srgb_file_is_decoded_before_it_is_compared() -> None:
    linear = picture()
    verdict = compare(
        from_rgb(srgb_encode(linear), {"transfer": "srgb"}), from_rgb(linear, {"transfer": "linear"}), abs=1e-12
    )
    assert verdict.passed is True
    assert "decoded to linear" in verdict.notes[0]
    codes = np.floor(srgb_encode(linear) * 255 + 0.5).astype(np.uint8)
    verdict = compare(from_rgb(codes, {"transfer": "srgb"}), from_rgb(linear), abs=0.0047)
    assert verdict.passed is True  # half a code at the steep end: (1 - srgb_decode(1 - .5/255)) = .0044


def test_the_table_tells_everything_once() -> None:
    reference = picture()
    text = compare(reference[::-1], reference, abs=1e-3, perceptual_metrics="all").table()
    for word in (
        "failed",
        "|d| <= 0.001",
        "outside",
        "furthest",
        "worst",
        "psnr_db",
        "ssim",
        "flip",
        "hdr_flip",
        "hint",
    ):
        assert word in text, word
    assert max(map(len, text.splitlines())) < 160


asymmetric = (
    np.linspace(0.0, 0.9, 24)[:, None, None] ** 2 * np.linspace(0.3, 1.0, 32)[:, None] * np.array([1.0, 0.6, 0.2])
)


@pytest.mark.parametrize(
    ("test", "told"),
    [
        (asymmetric[:, ::-1], "mirrored left to right"),
        (asymmetric[::-1], "upside down"),
        (asymmetric[::-1, ::-1], "180 degrees"),
        (asymmetric[..., ::-1], "red and blue"),
        (asymmetric * math.pi, r"3\.1416 \(pi\)"),
        (asymmetric / (4.0 * math.pi), r"\(1/\(4 pi\)\)"),
        (asymmetric * 0.7, r"0\.7 times"),
        (srgb_encode(asymmetric), "test seems sRGB-encoded"),
        (srgb_decode(asymmetric), "reference seems sRGB-encoded"),
    ],
)
@pytest.mark.parametrize("stored", [False, True])
def test_hints_name_the_mistake(test: np.ndarray, told: str, stored: bool) -> None:
    def store(values: np.ndarray) -> np.ndarray:
        return np.rint(np.clip(values, 0.0, 1.0) * 65535.0).astype(np.uint16) if stored else values

    verdict = compare(store(test), store(asymmetric), abs=1e-6)
    assert len(verdict.hints) == 1
    assert verdict.hints[0].startswith(("the test", "the reference", "red"))
    assert re.search(told, verdict.hints[0]), verdict.hints[0]


def test_no_hint_without_reason() -> None:
    grey = np.outer(np.hanning(24), np.hanning(32))[..., None] * np.ones(3)  # symmetric, grey
    noise = RNG.standard_normal(grey.shape) * 0.05
    assert compare(grey[::-1, ::-1] + noise, grey).hints == ()
    assert compare(picture(), picture()).hints == ()
    assert compare(asymmetric + 0.01 * RNG.standard_normal(asymmetric.shape), asymmetric).hints == ()
    assert compare(asymmetric, asymmetric).hints == ()
    assert compare(asymmetric * 1.01, asymmetric, rel=0.02).hints == ()  # passed: nothing to explain


@given(seed=st.integers(0, 2**32 - 1), offset=st.integers(-3, 3), allowed=st.integers(0, 4))
def test_codes_limit_agrees_with_the_plain_count(seed: int, offset: int, allowed: int) -> None:
    reference = np.random.default_rng(seed).integers(5, 250, (3, 4), dtype=np.uint8)
    verdict = compare(
        (reference.astype(int) + offset).astype(np.uint8), reference, codes=allowed, perceptual_metrics="none"
    )
    assert verdict.passed is (abs(offset) <= allowed)
    assert verdict.limits[0].outside == (0 if verdict.passed else 12)
