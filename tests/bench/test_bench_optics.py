"""The cloud table against a loop over miepython with its JIT: same radii, same angles, ratios within one run."""

from __future__ import annotations

import math
import os
import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from atmoref.optics import drops
from atmoref.optics.crystals import Crystals
from atmoref.optics.particles import DROPS, PARTICLES
from atmoref.optics.refraction import water

WAVELENGTHS_NM = (680.0, 550.0, 440.0)
RADII, ANGLES, COEFFICIENTS = 1000, 1801, 1500
LEAST_RATIO = 10.0


def _ours(mu: np.ndarray) -> list[np.ndarray]:
    drops._coefficients.cache_clear()
    cloud = DROPS["cloud"]
    tables = []
    for nm in WAVELENGTHS_NM:
        assert cloud.legendre(nm, RADII, COEFFICIENTS).size == COEFFICIENTS
        tables.append(cloud.phase_function(mu, nm, RADII))
    return tables


def _loop(miepython: object, mu: np.ndarray) -> list[np.ndarray]:
    tables = []
    for nm in WAVELENGTHS_NM:
        _, x, shares, _ = DROPS["cloud"]._spheres(nm, RADII)
        index = float(water(nm))
        total, scattering = np.zeros_like(mu), 0.0
        for size, share in zip(x, shares, strict=True):
            efficiency = miepython.efficiencies_mx(index, size)[1]  # type: ignore[attr-defined]
            weight = share * size * size * efficiency
            total += weight * miepython.i_unpolarized(index, size, mu, norm="one")  # type: ignore[attr-defined]
            scattering += weight
        tables.append(total / scattering)
    return tables


@pytest.mark.benchmark(group="cloud table, 3 wavelengths, 1000 radii, 1801 angles, 1500 coefficients")
def test_bench_cloud_table_against_miepython(benchmark: BenchmarkFixture) -> None:
    os.environ.setdefault("MIEPYTHON_USE_JIT", "1")
    miepython = pytest.importorskip("miepython", reason="optional: miepython is not installed")
    mu = drops.cosines(np.arange(ANGLES) / 10.0)
    _ours(mu[:32])
    miepython.i_unpolarized(1.33, 10.0, mu[:32], norm="one")
    miepython.efficiencies_mx(1.33, 10.0)
    found = benchmark.pedantic(_ours, (mu,), rounds=3)
    started = time.perf_counter()
    expected = _loop(miepython, mu)
    theirs = time.perf_counter() - started
    ours = benchmark.stats.stats.median
    ratio = theirs / ours
    benchmark.extra_info.update(ratio=ratio, miepython_s=theirs)
    print(f"\ncloud table: {ours:.3f} s, loop over miepython {theirs:.1f} s, ratio {ratio:.0f}")
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)
    assert math.isfinite(ratio)
    assert ratio >= LEAST_RATIO


@pytest.mark.benchmark(group="hexagonal ice, 6 million rays, 3 wavelengths")
def test_bench_ice(benchmark: BenchmarkFixture) -> None:
    ice = PARTICLES["ice"]
    assert isinstance(ice, Crystals)
    ice.trace(550.0, 1000)
    benchmark.pedantic(lambda: [ice.trace(nm, 6_000_000) for nm in WAVELENGTHS_NM], rounds=1)
    assert benchmark.stats.stats.median < 30.0
