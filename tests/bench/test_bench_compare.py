"""How long a comparison takes, beside the library calls that it cannot do without."""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from skimage.metrics import structural_similarity

from atmoref.compare import compare

RNG = np.random.default_rng(1)
REFERENCE = RNG.random((480, 720, 3))
TEST = np.clip(REFERENCE + 0.01 * RNG.standard_normal(REFERENCE.shape), 0.0, 1.0)


@pytest.mark.benchmark(group="compare 720 x 480")
@pytest.mark.parametrize("which", ["none", "auto"])
def test_bench_compare(benchmark: BenchmarkFixture, which: str) -> None:
    verdict = benchmark(compare, TEST, REFERENCE, abs=0.01, perceptual_metrics=which)
    assert verdict.passed is False


@pytest.mark.benchmark(group="compare 720 x 480")
def test_bench_ssim_of_the_library(benchmark: BenchmarkFixture) -> None:
    benchmark(structural_similarity, REFERENCE, TEST, data_range=1.0, channel_axis=2, gaussian_weights=True, sigma=1.5)
