"""Benchmarks measure the render that users get, and their sums are right."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from atmoref.judge.bench.clock import NOTHING, Replay, Seconds, interleaved, resized
from atmoref.judge.bench.costs import Cost, cost, costs
from atmoref.judge.bench.front import Front, front, pareto
from atmoref.judge.bench.growth import AXES, Growth, exponent, measure_growth, series
from atmoref.judge.bench.text import costs_table, front_table, growth_table, table
from atmoref.judge.bench.variants import stored_as, variant
from atmoref.scene import load_scene
from atmoref.techniques import TECHNIQUES
from atmoref.techniques.render import render

SMALL = ["image.width=32", "image.height=48"]


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_replay_draws_the_same_bits_each_time(technique: str) -> None:
    scene = variant(load_scene("two_lights", ["image.width=48", "image.height=32"]), technique)
    replay, expected = Replay(scene, technique), render(scene, technique=technique)
    for _ in range(2):
        spent = replay.run()
        np.testing.assert_array_equal(replay.image(), expected.image)
        assert 0.0 < spent.planes < spent.passes


def test_the_least_of_each_job_counts_and_the_first_round_does_not() -> None:
    given = {"a": [0.1, 5.0, 3.0, 4.0], "b": [0.1, 2.0, 9.0, 7.0]}
    order: list[str] = []

    def job(name: str) -> Seconds:
        order.append(name)
        s = given[name].pop(0)
        return Seconds(2.0 * s, s)

    least = interleaved([lambda: job("a"), lambda: job("b")], 3)
    assert least == [Seconds(6.0, 3.0), Seconds(4.0, 2.0)]
    assert order == ["a", "b"] * 4


def test_the_exponent_of_a_power_is_its_power() -> None:
    sizes = (10, 20, 50, 400)
    for power in (0.5, 1.0, 2.0):
        assert exponent(sizes, [3e-4 * s**power for s in sizes]) == pytest.approx(power, abs=1e-12)


def test_pareto() -> None:
    points = [(1.0, 9.0), (2.0, 5.0), (2.0, 6.0), (3.0, 5.0), (4.0, 1.0), (4.0, 1.0)]
    assert pareto(points) == [True, True, False, False, True, True]


def test_a_scene_is_made_smaller_and_never_larger() -> None:
    scene = load_scene("fig4c")
    assert resized(scene, 300 * 450) is scene
    small = resized(scene, 1500).image
    assert (small.width % 2, small.height % 2) == (0, 0)
    assert small.width * small.height == pytest.approx(1500, rel=0.1)
    assert small.width / small.height == pytest.approx(2 / 3, rel=0.05)


@pytest.mark.parametrize("axis", AXES)
def test_a_series_doubles_along_its_axis_alone(axis: str) -> None:
    technique, scenes = series(load_scene("fig4c"), axis, 3, 96 if axis == "pixels" else 16)  # whole waves
    replays = [Replay(s) for s in scenes]
    assert {r.technique for r in replays} == {technique}
    lights = [r.report["lights"] for r in replays]
    counts = {
        "pixels": [s.image.width * s.image.height for s in scenes],
        "planes": [sum(x["main_planes"] for x in r) for r in lights],
        "sub-planes": [sum(x["sub_planes"] for x in r) / sum(x["main_planes"] for x in r) for r in lights],
        "lights": [len(s.lights) for s in scenes],
    }
    grown = axis.split(",")[0]
    for name, values in counts.items():
        ratios = [b / a for a, b in itertools.pairwise(values) if a]
        wanted = 2.0 if name == grown or (name == "planes" and grown == "lights") else 1.0
        assert ratios == pytest.approx([wanted] * len(ratios), rel=0.06), name


def test_growth_refuses_what_it_does_not_know() -> None:
    with pytest.raises(ValueError, match="allowed: pixels, planes"):
        measure_growth(load_scene("quick"), "moons")


def test_costs_count_what_a_render_counts() -> None:
    scene = load_scene("quick", SMALL)
    found, stats = cost(scene, "beams", rounds=1), render(scene, threads=1).stats
    waves = stats["sub_plane_waves"] + stats["main_plane_waves"]
    left_out = stats["sub_plane_waves_skipped"] + stats["main_plane_waves_skipped"]
    assert found.draws == stats["draws"]
    assert found.skipped == pytest.approx(left_out / waves)
    assert (found.main_planes, found.sub_planes) == (23, 174)
    assert found.own
    assert found.peak_mb >= found.idle_mb > 20.0
    assert found.buffers_mb == pytest.approx(sum(b.data.nbytes for b in Replay(scene).bank.values()) / 2**20, rel=1e-12)


def test_an_impossible_scene_is_refused_in_its_row() -> None:
    scene = load_scene("quick", [*SMALL, "image.width=33"])
    odd = variant(scene, "beams_interleaved", composition="interleave")
    (found,) = costs(odd, ("beams_interleaved",), rounds=1, memory=False)
    assert "multiples of 2" in found.refused
    assert "refused" in costs_table([found])


def test_a_front_holds_every_technique_and_the_truth() -> None:
    scene = stored_as(load_scene("quick", SMALL), "float32")
    found = front(scene, TECHNIQUES, rounds=1, quick=True)
    assert {p.technique for p in found.points} == set(TECHNIQUES)
    assert found.format == "float32"
    assert any(p.on_front for p in found.points)
    assert found.truth_s > 0.0
    assert 0.0 < found.truth_error < 1e-8
    times = [p.seconds.passes for p in found.points]
    assert times == sorted(times)
    best = found.best("beams", 1.0)
    assert best is not None
    assert best.seconds.passes == min(p.seconds.passes for p in found.points if p.technique == "beams")
    assert found.best("beams", 0.0) is None
    assert front_table(found).splitlines()[-1].startswith("| truth")


def test_tables_are_markdown() -> None:
    text = table(("name", "value"), [["a", "1.5"], ["bc", "20"]])
    assert text.splitlines() == ["| name | value |", "|------|------:|", "| a    |   1.5 |", "| bc   |    20 |"]
    growth = Growth("planes", "beams", (1, 2, 4), (1.0, 2.0, 4.0))
    assert "1.000" in growth_table([growth])
    gain = Cost("s", "t", True, "paper", (8, 8), (8, 8), skips=Seconds(2.0, 1.0), no_skips=Seconds(4.0, 3.0))
    assert gain.gain == 3.0
    assert dataclasses.replace(gain, no_skips=NOTHING).gain == 0.0
    assert isinstance(Front("s", (1, 1), "unorm8", [], 1.0, 0.0).points, list)
