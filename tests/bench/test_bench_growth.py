"""CPU time of the planes is linear in pixels, planes and sub-planes where nothing is skipped."""

from __future__ import annotations

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from atmoref.judge.bench.growth import LINEAR, measure_growth
from atmoref.scene import load_scene


@pytest.mark.benchmark(group="growth, skips off")
@pytest.mark.parametrize("axis", LINEAR)
def test_bench_growth_is_linear(benchmark: BenchmarkFixture, axis: str) -> None:
    scene = load_scene("fig4c", ["technique.preset=corrected"])
    growth = measure_growth(scene, axis, steps=5, width=96, rounds=7)
    benchmark.extra_info.update(exponent=growth.exponent, sizes=growth.sizes)
    benchmark.pedantic(lambda: None)  # the figure is the exponent
    assert 0.9 <= growth.exponent <= 1.1, growth
