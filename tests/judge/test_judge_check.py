"""`check`: correct dumps pass, whole or in part; one mistake each is found where it is made, and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_builds import correct, scene, write

from atmoref.images import srgb_encode
from atmoref.judge import diagnosis
from atmoref.judge.allowance import Allowed, DrawAsked
from atmoref.judge.check import check
from atmoref.judge.hypotheses import _moved_light
from atmoref.judge.plan import Plan, given, magnified, make_plan, retextured, with_device, with_inputs

LIGHT = "light_0/light_map"
FORMATS = ("unorm8", "unorm16", "float16", "float32")


@pytest.mark.parametrize("fmt", FORMATS)
def test_a_correct_dump_passes_with_no_pixel_off(tmp_path: Path, fmt: str) -> None:
    verdict = check(correct(tmp_path, f"buffers.format={fmt}"), scene(f"buffers.format={fmt}"))
    assert verdict.passed
    assert verdict.first is None
    assert verdict.cause is None
    assert sum(draw.off for draw in verdict.draws) == 0
    assert verdict.end_to_end is not None
    assert verdict.end_to_end.off == 0


@pytest.mark.parametrize(
    "dumped",
    [
        lambda d, b: b == "frame",
        lambda d, b: b == "f_h",
        lambda d, b: d.endswith("slab_002/main"),
        lambda d, b: b.endswith("shadow_map"),
    ],
)
def test_a_dump_is_judged_on_what_is_there(tmp_path: Path, dumped: Any) -> None:
    verdict = check(write(tmp_path, make_plan(scene()), dumped=dumped), scene())
    assert verdict.passed
    assert 1 <= len(verdict.draws) < 12
    assert sum(draw.off for draw in verdict.draws) == 0


def test_bounds_come_from_the_function_that_is_given(tmp_path: Path) -> None:
    asked: list[DrawAsked] = []

    def impossible(draw: DrawAsked) -> Allowed:
        asked.append(draw)
        stored = draw.stored.astype(np.float64)
        return Allowed(stored + 1.0, stored + 2.0)

    verdict = check(correct(tmp_path), scene(), bounds_of_draw=impossible, diagnosed=False)
    assert not any(draw.passed for draw in verdict.draws)
    assert all(draw.outside == draw.pixels for draw in verdict.draws)
    assert {draw.buffer for draw in asked} == {"frame", "f_h", "depth", "light_0/shadow_map"}


def test_a_mask_leaves_out_what_is_wrong(tmp_path: Path) -> None:
    def spoilt(draw: str, buffer: str, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        if draw.endswith("slab_001/main"):
            after[:20] = 200
        return after

    directory = write(tmp_path, make_plan(scene()), store=spoilt)
    mask = np.ones((54, 36), np.bool_)
    mask[:20] = False
    assert check(directory, scene(), mask=mask).passed
    verdict = check(directory, scene(), diagnosed=False)
    assert verdict.first is not None
    assert verdict.first.name == "light_0/slab_001/main -> frame"
    assert [draw.name for draw in verdict.draws if not draw.passed] == [verdict.first.name]  # and nothing after it
    assert verdict.first.worst is not None
    assert verdict.first.worst.y < 20


# ---- a class each
def rebuilt(plan: Plan, change: Any, buffer: str = "slabs") -> Plan:
    for at, item in enumerate(plan.passes):
        if item.name.endswith(buffer):
            plan.passes[at] = with_inputs(item, {"uniforms": change(given(item)["uniforms"])})
    return plan


def with_texture(plan: Plan, name: str, change: Any) -> Plan:
    """Change a texture right when it is handed to the texture units."""
    original = plan.bank[name]
    for at, item in enumerate(plan.passes):
        if item.name.endswith("/upload"):

            def upload(d0: int, d1: int, r0: int, r1: int, item: Any = item) -> None:
                plan.bank[name] = change(original)
                item.execute(d0, d1, r0, r1)
                plan.bank[name] = original

            plan.passes[at] = replace(item, execute=upload)
    return plan


def storage(draw: str, buffer: str, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return (np.rint(after / 257.0) * 257).astype(np.uint16) if buffer == "f_h" else after


def flipped(draw: str, buffer: str, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return after[::-1].copy() if draw.endswith("slab_002/main") else after


def encoded(draw: str, buffer: str, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return np.rint(srgb_encode(after / 255.0) * 255.0).astype(np.uint8) if buffer == "f_h" else after


def replaced(draw: str, buffer: str, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return after - before if draw.endswith("/main") else after


def doubled(draw: str, buffer: str, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    twice = 2 * after.astype(int) - before
    return np.minimum(twice, 255).astype(np.uint8) if draw.endswith("slab_002/main") else after


def swapped_planes(plan: Plan) -> Plan:
    for at, item in enumerate(plan.passes):
        if item.name.endswith("/slabs"):
            draws = given(item)["draws"]
            plan.passes[at] = with_inputs(item, {"draws": draws._replace(main_z=np.roll(draws.main_z, -1))})
    return plan


def on_device(**fields: Any) -> Plan:
    return make_plan(scene(), None, with_device(**fields))


CASES: dict[str, tuple[str, str, tuple[str, ...], Any]] = {
    "storage": (diagnosis.STORAGE, "-> f_h", ("buffers.format=unorm16",), lambda p: {"store": storage}),
    "rounding": (diagnosis.ROUNDING, "", (), lambda p: {"plan": on_device(rounding="truncate")}),
    "filter rule": (diagnosis.FILTER, "", (), lambda p: {"plan": on_device(bytes_filter="bytes")}),
    "nearest": (diagnosis.FILTER, "", (), lambda p: {"plan": with_texture(p, LIGHT, lambda b: magnified(b, 8))}),
    "half texel": (diagnosis.HALF_TEXEL, "-> f_h", (), lambda p: {"plan": rebuilt(p, _moved_light(1 / 128, 1 / 128))}),
    "blend": (diagnosis.BLEND, "/main -> frame", (), lambda p: {"store": replaced}),
    "order": (diagnosis.ORDER, "slab_002/main -> frame", (), lambda p: {"store": doubled}),
    "planes elsewhere": (diagnosis.PLANES, "slab_000/main -> frame", ("buffers.format=float32",),
                         lambda p: {"plan": swapped_planes(p)}),
    "planes": (diagnosis.PLANES, "-> f_h", (), lambda p: {"skipped": lambda d: d.endswith("sub_001")}),
    "shadow": (diagnosis.SHADOW, "", (), lambda p: {"plan": make_plan(scene("technique.shadow_bias_m=0.0"))}),
    "formula": (diagnosis.FORMULA, "/main -> frame", ("buffers.format=float32",), lambda p: {
        "plan": make_plan(scene("buffers.format=float32", "technique.dt_mode=paper"))}),
    "flip": (diagnosis.FLIP, "slab_002/main -> frame", (), lambda p: {"store": flipped}),
    "gamma": (diagnosis.GAMMA, "-> f_h", (), lambda p: {"store": encoded}),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_each_class_is_named(tmp_path: Path, name: str) -> None:
    kind, stage, overrides, make = CASES[name]
    plan = make_plan(scene(*overrides))
    options = make(plan)
    verdict = check(write(tmp_path, options.pop("plan", plan), **options), scene(*overrides))
    assert not verdict.passed
    assert verdict.first is not None
    assert verdict.first.name.endswith(stage)
    assert verdict.cause is not None
    assert verdict.cause.kind == kind, [str(e) for d in verdict.draws for e in d.explanations]


def test_every_class_has_a_case() -> None:
    assert {case[0] for case in CASES.values()} == set(diagnosis.KINDS)


def test_another_format_than_asked_is_storage(tmp_path: Path) -> None:
    verdict = check(correct(tmp_path, "buffers.format=unorm16"), scene("buffers.format=float16"))
    assert not verdict.passed
    assert verdict.cause is not None
    assert verdict.cause.kind == diagnosis.STORAGE
    assert "unorm16" in verdict.cause.sentence


def test_a_diagnosis_leaves_the_walk_as_it_was(tmp_path: Path) -> None:
    """With and without looking for causes, every draw gets the same verdict."""
    plan = make_plan(scene("technique.shadow_bias_m=0.0"))
    directory = write(tmp_path, plan)
    with_it, without = check(directory, scene()), check(directory, scene(), diagnosed=False)
    assert [replace(d, explanations=()) for d in with_it.draws] == list(without.draws)


def test_a_magnified_texture_has_the_same_texels() -> None:
    buffer = make_plan(scene()).bank["light_0/light_map"]
    np.testing.assert_array_equal(magnified(buffer, 3).codes()[1::3, 1::3], buffer.codes())
    np.testing.assert_array_equal(retextured(buffer, buffer.codes()).codes(), buffer.codes())
