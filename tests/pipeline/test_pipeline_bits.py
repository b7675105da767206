"""Bits do not wander: fused or draw by draw, threads, skips, crops, widths, processors."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits_manifest import CLASSES, SCENES, hashes, manifest, small
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.scenes import bundled, mirrored_names

from atmoref.pipeline import Pass, run
from atmoref.techniques.render import prepare, render

CHEAP = ["unorm8/float32", "float32/float32", "float64/float64"]
SCRIPT = Path(__file__).with_name("bits_manifest.py")
PROCESSORS: dict[str, dict[str, str]] = {
    "native": {},
    "AVX2 and FMA": {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""},
    "SSE2": {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""},
}


def test_the_manifest_has_every_bundled_scene() -> None:
    assert sorted(SCENES) == mirrored_names()


def _agree(scene: Any, **options: Any) -> None:
    plain = render(scene, threads=1)
    other = render(scene, **options)
    assert hashes(plain.buffers) == hashes(other.buffers)
    assert plain.buffers["frame"].values().any()


@pytest.mark.parametrize(
    "code_class", [*CHEAP, *(pytest.param(c, marks=pytest.mark.slow) for c in CLASSES if c not in CHEAP)]
)
@pytest.mark.parametrize("name", sorted(SCENES))
def test_dumped_is_fused(name: str, code_class: str) -> None:
    seen: list[str] = []
    _agree(small(name, code_class), threads=1, watch=lambda draw, p, bank: seen.append(draw))
    assert len(seen) == len(set(seen)) > 30


@pytest.mark.parametrize("code_class", CHEAP)
@pytest.mark.parametrize("name", ["fig4a", "two_lights"])
@pytest.mark.parametrize("threads", [2, 5])
def test_threads(name: str, code_class: str, threads: int) -> None:
    _agree(small(name, code_class), threads=threads)


@pytest.mark.parametrize("code_class", CHEAP)
@pytest.mark.parametrize("name", sorted(SCENES))
def test_skipping_changes_no_bit(name: str, code_class: str) -> None:
    on, off = render(small(name, code_class)), render(small(name, code_class, "technique.skip=false"))
    assert hashes(on.buffers) == hashes(off.buffers)
    skipped = ("sub_plane_waves_skipped", "main_plane_waves_skipped")
    assert sum(on.stats[k] for k in skipped) > 0.2 * (on.stats["sub_plane_waves"] + on.stats["main_plane_waves"])
    assert on.stats["lit_samples"] == off.stats["lit_samples"]


def _split(passes: list[Pass], data: st.DataObject) -> None:
    """Execute passes in random pieces: draws in order, rows in any order."""
    for p in passes:
        cuts = data.draw(st.lists(st.integers(0, len(p.draws)), max_size=4), label=f"{p.name}: draws")
        row0, row1 = p.window or (0, p.rows)
        lines = data.draw(st.lists(st.integers(row0, row1), max_size=2), label=f"{p.name}: rows")
        rows = sorted({row0, row1, *lines})
        edges = sorted({0, len(p.draws), *cuts})
        for d0, d1 in itertools.pairwise(edges):
            for a, b in reversed(list(itertools.pairwise(rows))):
                p.execute(d0, d1, a, b)


@pytest.mark.parametrize("code_class", CHEAP)
@pytest.mark.parametrize("name", ["fig4b", "fig4c", "two_lights"])
@given(data=st.data())
@settings(max_examples=12)
def test_any_split_of_draws_and_rows_is_fused(name: str, code_class: str, data: st.DataObject) -> None:
    scene = small(name, code_class)
    _, _, passes, bank, _ = prepare(scene, None, None, None)
    _split(passes, data)
    key = f"{name} {code_class}"
    if key not in _fused:
        _fused[key] = hashes(render(scene, threads=1).buffers)
    assert hashes(bank) == _fused[key]


_fused: dict[str, dict[str, str]] = {}


@pytest.mark.parametrize("name", ["fig4a", "two_lights"])
@given(data=st.data())
@settings(max_examples=25)
def test_a_crop_is_the_same_pixels(name: str, data: st.DataObject) -> None:
    width, height = SCENES[name]
    x, y = data.draw(st.integers(0, width - 1)), data.draw(st.integers(0, height - 1))
    w, h = data.draw(st.integers(1, width - x)), data.draw(st.integers(1, height - y))
    scene = small(name, "unorm8/float32")
    if name not in _whole:
        _whole[name] = render(scene).image
    part = render(scene, crop=(x, y, w, h), threads=1).image
    np.testing.assert_array_equal(part, _whole[name][y : y + h, x : x + w])


_whole: dict[str, np.ndarray] = {}


def test_a_replaced_draw_is_what_later_draws_see() -> None:
    scene = bundled("quick", width=20, height=30)
    states: dict[str, np.ndarray] = {}

    def watch(draw: str, p: Pass, bank: Any) -> None:
        states[draw] = bank[p.stores[p.draws.index(draw)]].codes()

    plain = render(scene, threads=1, watch=watch)
    names = [d for d in states if d.startswith("light_0/slab_")]
    middle = names[len(names) // 2]
    # its own value again: nothing changes; black instead: the sum is less, by nothing elsewhere
    same = render(scene, inject={middle: states[middle]})
    assert hashes(same.buffers) == hashes(plain.buffers)
    main = next(d for d in names if d.endswith("/main") and (states[d] > states["light_0/opaque"]).any())
    dark = render(scene, inject={main: np.zeros_like(states[main])})
    np.testing.assert_array_equal(dark.buffers["frame"].codes(), plain.buffers["frame"].codes() - states[main])
    with pytest.raises(KeyError, match="no draw named 'nothing'"):
        render(scene, inject={"nothing": states[main]})


def test_progress_reaches_the_end_of_every_pass_and_an_error_stops_it() -> None:
    scene = bundled("quick", width=20, height=30)
    said: dict[str, list[float]] = {}
    render(scene, threads=2, progress=lambda name, part: said.setdefault(name, []).append(part))
    assert all(parts == sorted(parts) and parts[-1] == 1.0 for parts in said.values())
    assert list(said)[-1] == "light_0/slabs"

    def stop(name: str, part: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(scene, threads=2, progress=stop)
    _, _, passes, bank, _ = prepare(scene, None, None, None)
    timing = run(passes, bank, threads=2)
    assert list(timing.wall_s) == [p.name for p in passes]


def in_process(classes: list[str], width: str, processor: str) -> dict[str, str]:
    environment = {
        k: v for k, v in os.environ.items() if k not in ("ATMOREF_LANES", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")
    }
    paths = [p for p in sys.path if p]
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *classes],
        env=environment | {"ATMOREF_LANES": width, "PYTHONPATH": os.pathsep.join(paths)} | PROCESSORS[processor],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout)
    return found


def _same_bits(classes: list[str], width: str, processor: str) -> None:
    expected, found = manifest(classes), in_process(classes, width, processor)
    assert {k for k in expected if expected[k] != found.get(k)} == set()
    assert len(expected) > 12 * len(classes)
    assert expected.keys() == found.keys()


def test_one_lane_without_avx_in_8_bits() -> None:
    _same_bits(["unorm8/float32"], "1", "SSE2")


def test_eight_lanes_with_avx2_and_fma_in_float64() -> None:
    _same_bits(["float64/float64"], "8", "AVX2 and FMA")


@pytest.mark.slow
@pytest.mark.parametrize("processor", sorted(PROCESSORS))
@pytest.mark.parametrize("width", ["1", "8", "16"])
def test_every_width_on_every_processor_in_every_class(width: str, processor: str) -> None:
    _same_bits(list(CLASSES), width, processor)
