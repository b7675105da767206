"""Kernel-only CPU time of the light beams, one thread, against the scalar reference: ratios within one run."""

from __future__ import annotations

import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from reference.timing import Timing, measure

from atmoref.scene import load_scene

# scene, stage, least ratio with skips, without, and least gain by skips
FIGURES = {
    "fig4c": ("beam_planes", 5.0, 3.0, 1.8),
    "fig4b": ("vertex_planes", 3.0, 0.0, 1.0),
}


@pytest.fixture(name="timing", scope="module", params=sorted(FIGURES))
def _timing(request: pytest.FixtureRequest) -> tuple[str, Timing]:
    name = request.param
    return name, measure(load_scene(name), FIGURES[name][0])


@pytest.mark.benchmark(group="light beams, 300 x 450, unorm8")
def test_bench_ratio_to_scalar_code(benchmark: BenchmarkFixture, timing: tuple[str, Timing]) -> None:
    name, t = timing
    _, with_skips, _, gain = FIGURES[name]
    benchmark.extra_info.update(ratio=t.ratio, ratio_without_skips=t.ratio_without_skips, gain=t.gain)
    benchmark.pedantic(lambda: None)  # the figures are in the ratios
    assert t.ratio >= with_skips, t
    assert t.gain >= gain, t


def test_bench_ratio_without_skips(benchmark: BenchmarkFixture, timing: tuple[str, Timing]) -> None:
    name, t = timing
    if name != "fig4c":
        pytest.skip("the target without skips is that of fig4c")
    benchmark.pedantic(lambda: None)
    assert t.ratio_without_skips >= FIGURES[name][2], t
