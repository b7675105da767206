"""SSIM and FLIP against the libraries called directly, and difference pictures."""

from __future__ import annotations

import subprocess
import sys
import time

import flip_evaluator
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from skimage.metrics import structural_similarity

from atmoref.compare import CompareError, amplified_image, compare, difference_image
from atmoref.compare.perceptual import flip_exposures
from atmoref.compare.picture import round_scale
from atmoref.images import read, srgb_encode, write

RNG = np.random.default_rng(5)
REFERENCE = np.clip(RNG.random((40, 48, 3)) * np.linspace(0.05, 1.0, 48)[:, None], 0, 1)
TEST = np.clip(REFERENCE + 0.05 * RNG.standard_normal(REFERENCE.shape), 0, 1)


def test_ssim_is_the_librarys() -> None:
    expected = structural_similarity(
        REFERENCE,
        TEST,
        data_range=1.0,
        channel_axis=2,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )[1]
    found = compare(TEST, REFERENCE)
    assert found.metrics["ssim"] == pytest.approx(expected.mean(), abs=1e-12)
    assert found.per_channel["G"]["ssim"] == pytest.approx(expected[..., 1].mean(), abs=1e-12)


def test_ssim_of_equal_and_of_negated_patterns() -> None:
    reference = RNG.choice([0.25, 0.75], (40, 40))
    assert compare(reference, reference).metrics["ssim"] == pytest.approx(1.0)
    assert compare(1.0 - reference, reference).metrics["ssim"] < -0.9


def test_flip_is_the_librarys_on_shown_codes_and_on_encoded_values() -> None:
    test, reference = ((255 * image).astype(np.uint8) for image in (TEST, REFERENCE))
    as_shown = [(image / 255.0).astype(np.float32) for image in (reference, test)]
    _, expected, _ = flip_evaluator.evaluate(*as_shown, "LDR", applyMagma=False)
    assert compare(test, reference).metrics["flip"] == pytest.approx(expected, abs=1e-6)
    encoded = [srgb_encode(image).astype(np.float32) for image in (REFERENCE, TEST)]
    _, expected, _ = flip_evaluator.evaluate(*encoded, "LDR", applyMagma=False)
    assert compare(TEST, REFERENCE).metrics["flip"] == pytest.approx(expected, abs=1e-6)


def test_hdr_flip_is_the_librarys_with_the_librarys_exposures() -> None:
    pair = [(3.0 * image + 0.01).astype(np.float32) for image in (REFERENCE, TEST)]
    _, expected, used = flip_evaluator.evaluate(*pair, "HDR", applyMagma=False)
    exposures = flip_exposures(pair[0].astype(np.float64))
    assert exposures == pytest.approx((used["startExposure"], used["stopExposure"]), abs=1e-3)
    verdict = compare(pair[1], pair[0], perceptual_metrics="all")
    assert verdict.metrics["hdr_flip"] == pytest.approx(expected, abs=1e-4)
    assert verdict.metrics["flip"] < verdict.metrics["hdr_flip"]


def test_flip_beyond_one_is_that_of_one_exposure_of_hdr_flip() -> None:
    pair = [(3.0 * image + 0.01).astype(np.float32) for image in (REFERENCE, TEST)]
    start = flip_exposures(pair[0].astype(np.float64))[0]
    alone = {"startExposure": start, "stopExposure": start}
    _, expected, _ = flip_evaluator.evaluate(*pair, "HDR", applyMagma=False, parameters=alone)
    verdict = compare(pair[1], pair[0])
    assert verdict.metrics["flip"] == pytest.approx(expected, abs=1e-4)
    assert "hdr_flip" not in verdict.metrics
    assert any("ACES" in note for note in verdict.notes)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["codes", "values", "values beyond 1"])
def test_a_comparison_takes_little_more_than_its_flip(kind: str) -> None:
    """720 x 480: FLIP alone takes 0.35 s on two free processors, all 0.7 to 0.9 s; a ratio holds on busy ones, too."""
    reference = np.clip(gaussian_filter(RNG.random((480, 720, 3)), (4, 4, 0)) * 4.0 - 1.5, 0.0, 1.0)
    test = np.clip(reference + 0.01 * RNG.standard_normal(reference.shape), 0.0, 1.0)
    pair = [test, reference]
    if kind == "codes":
        pair = [np.rint(255.0 * image).astype(np.uint8) for image in pair]
    if kind == "values beyond 1":
        pair = [20.0 * image for image in pair]
    shown = [image.astype(np.float32) for image in (reference, test)]
    whole, alone = [], []
    for _ in range(6):
        start = time.perf_counter()
        assert compare(*pair, abs=1.0).metrics["rms"] > 0.0
        between = time.perf_counter()
        flip_evaluator.evaluate(*shown, "LDR", applyMagma=False, computeMeanError=False)
        whole.append(between - start)
        alone.append(time.perf_counter() - between)
    assert min(whole) < 4.0 * min(alone), (whole, alone)


def test_flip_of_black_against_white_is_near_its_maximum() -> None:
    reference = np.zeros((32, 32, 3))
    assert compare(np.ones((32, 32, 3)), reference).metrics["flip"] > 0.9


@pytest.mark.parametrize("black_rows", [12, 16])
def test_black_references_do_not_end_the_process(black_rows: int) -> None:
    code = (
        "import numpy as np; from atmoref.compare import compare;"
        "test = np.full((16, 16), 2.0); reference = test * 1.5;"
        f"reference[:{black_rows}] = 0;"
        "print('alive', compare(test, reference, allow_blank=True, perceptual_metrics='all').notes)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert run.stdout.startswith("alive"), run.stdout + run.stderr


def test_exposures_are_few_even_on_a_dim_background() -> None:
    reference = np.full((8, 8, 3), 1e-9)
    reference[0, 0] = 100.0
    start, stop = flip_exposures(reference)
    assert stop - start == 8.0
    assert flip_exposures(np.zeros((2, 2, 3))) is None


def test_masks_restrict_the_perceptual_measures() -> None:
    test = REFERENCE.copy()
    test[:8] = 0.5
    mask = np.zeros((40, 48))
    mask[30:] = 1  # beyond the reach of both filters
    verdict = compare(test, REFERENCE, mask=mask)
    assert verdict.metrics["ssim"] == pytest.approx(1.0)
    assert verdict.metrics["flip"] < compare(test, REFERENCE).metrics["flip"] / 10


def test_small_images_and_images_without_colours_say_what_is_missing() -> None:
    verdict = compare(np.eye(4), np.eye(4) * 0.5)
    assert "ssim" not in verdict.metrics
    assert "no SSIM" in verdict.notes[0]
    verdict = compare(RNG.random((20, 20, 2)), RNG.random((20, 20, 2)))
    assert "flip" not in verdict.metrics
    assert any("no FLIP" in note for note in verdict.notes)
    assert "ssim" not in compare(TEST, REFERENCE, perceptual_metrics="none").metrics


def test_difference_picture_is_white_red_and_blue(tmp_path) -> None:
    reference = np.full((1, 5, 3), 0.5)
    test = reference.copy()
    test[0, 1, 0] += 0.03
    test[0, 2, 2] -= 0.03
    test[0, 3, 1] += 0.04
    test[0, 4, 1] -= 0.05
    image = difference_image(test, reference)
    assert image.attributes["scale"] == pytest.approx(0.05)
    assert image.attributes["worst"] == pytest.approx(0.05)
    colours = image.rgb()[0].astype(int)
    assert colours[0].tolist() == [255, 255, 255]
    assert colours[1][0] > colours[1][2]
    assert colours[2][2] > colours[2][0]
    assert colours[3].sum() < colours[1].sum()  # stronger is darker
    assert colours[4].tolist() == [5, 48, 97]
    write(tmp_path / "d.png", image)
    np.testing.assert_array_equal(read(tmp_path / "d.png").rgb(), image.rgb())


def test_difference_picture_saturates_at_a_stated_scale() -> None:
    reference = np.zeros((1, 3))
    image = difference_image(np.array([[1.0, 0.1, -9.0]]), reference, scale=0.1)
    assert image.rgb()[0].tolist() == [[103, 0, 31], [103, 0, 31], [5, 48, 97]]
    with pytest.raises(CompareError, match="scale"):
        difference_image(reference, reference, scale=0.0)


@pytest.mark.parametrize(
    ("worst", "scale"),
    [(0.0, 1.0), (1.0, 1.0), (1.1, 2.0), (2.0, 2.0), (3.0, 5.0), (7.0, 10.0), (0.3, 0.5), (6e-9, 1e-8)],
)
def test_scales_are_round(worst: float, scale: float) -> None:
    assert round_scale(worst) == pytest.approx(scale, rel=1e-12)
    assert round_scale(worst) >= worst


def test_amplified_picture() -> None:
    reference = np.full((1, 3), 0.5)
    image = amplified_image(reference + np.array([[0.0, 0.01, -0.9]]), reference, factor=10.0)
    assert image.channels["Y"].tolist() == [[128, 153, 0]]
    with pytest.raises(CompareError, match="factor"):
        amplified_image(reference, reference, factor=float("nan"))
