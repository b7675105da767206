"""Every stated device lies in its `device` interval, everything permitted in `envelope`: per draw and end to end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from reference.scenes import bundled, scenes

from atmoref.buffers.bounds import Bounds
from atmoref.buffers.device import DEVICES
from atmoref.judge.bounds import DrawBounds, draw_bounds, frame_bounds
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene, SceneError
from atmoref.techniques.render import parameters, render

SMALL = ("technique.shadow_map_size=64", "technique.light_map_size=64", "technique.mesh=[6, 8]")
BUFFERS = st.fixed_dictionaries({
    "format": st.sampled_from(["unorm8", "unorm10", "unorm12", "unorm16", "float16", "r11g11b10f", "float32"]),
    "arithmetic": st.just("float32"), "device": st.sampled_from(sorted(DEVICES)),
})  # fmt: skip
FORMATS = ("unorm8", "unorm2", "unorm10", "unorm12", "unorm16", "float16", "r11g11b10f", "float32")


def stored(scene: Scene, technique: str | None = None) -> dict[str, np.ndarray]:
    """Return what every draw of a mirror stores, by the names of `draw_bounds`."""
    found: dict[str, np.ndarray] = {}

    def watch(draw: str, step: Pass, bank: Bank) -> None:
        name = step.stores[step.draws.index(draw)]
        if name in bank:
            found[draw] = bank[name].codes()
        if draw.rpartition("/")[2] == "opaque" and "light_" not in draw:
            found[f"{draw}/depth"] = bank[name.removesuffix("frame") + "depth"].codes()

    render(scene, technique=technique, threads=1, watch=watch)
    return found


def outside(bounds: list[DrawBounds], draws: dict[str, np.ndarray]) -> dict[str, int]:
    """Return the draws that leave their bounds, and by how many values."""
    left = {b.draw: int(b.outside(draws[b.draw]).sum()) for b in bounds if b.draw in draws}
    assert left
    return {name: count for name, count in left.items() if count}


def _scene(name: str, *changes: str, width: int = 21, height: int = 30) -> Scene:
    return bundled(name, *SMALL, *changes, width=width, height=height)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("fmt", FORMATS)
def test_a_device_lies_in_its_interval_draw_by_draw_and_end_to_end(fmt: str, device: str) -> None:
    scene = _scene("two_lights", f"buffers.format={fmt}", f"buffers.device={device}")
    draws = stored(scene)
    assert not outside(draw_bounds(scene, draws, threads=1, interval="device"), draws)
    assert not outside(draw_bounds(scene, {}, threads=1, interval="device"), draws)


@pytest.mark.parametrize("preset", ["paper", "corrected"])
@pytest.mark.parametrize("technique", ["beams", "beams_vertex", "beams_interleaved"])
def test_presets_and_techniques(technique: str, preset: str) -> None:
    scene = _scene("fig4c", f"technique.preset={preset}", width=20, height=30)
    draws = stored(scene, technique)
    for interval in ("device", "envelope"):
        bounds = draw_bounds(scene, draws, technique=technique, threads=1, interval=interval)  # type: ignore[arg-type]
        assert not outside(bounds, draws), interval


@given(
    other=st.sampled_from(sorted(DEVICES)), rounding=st.sampled_from([None, "nearest_even", "half_up", "truncate"]),
    fmt=st.sampled_from(["unorm8", "unorm10", "unorm16", "float16"]), name=st.sampled_from(["fig4c", "two_lights"]),
    preset=st.sampled_from(["paper", "corrected"]),
)  # fmt: skip
@settings(max_examples=12, deadline=None)
def test_every_device_and_rounding_lies_in_the_envelope_of_ideal(
    other: str, rounding: str | None, fmt: str, name: str, preset: str
) -> None:
    """The devices differ in rounding, products of codes, filter weights and reads; the envelope knows none of them.

    End to end from the same textures, which the host stores by its own device's rounding: they are exact here.
    """
    common = (f"buffers.format={fmt}", f"technique.preset={preset}", "buffers.vertex_colour.format=float32")
    if fmt in ("unorm16", "float16"):
        common += ("buffers.q.format=float32", "buffers.light_map.format=float32")
    built = list(common)
    if rounding is not None and DEVICES[other].rounding_is_open:
        built.append(f"buffers.rounding={rounding}")
    draws = stored(_scene(name, *built, f"buffers.device={other}"))
    reference = _scene(name, *common)
    if DEVICES[other].rounding_is_open and rounding in (None, "nearest_even") and other != "geforce3":
        assert not outside(draw_bounds(reference, draws, threads=1, interval="envelope"), draws)
    else:  # textures are what this build uploaded
        own = _scene(name, *built, f"buffers.device={other}")
        assert not outside(draw_bounds(own, draws, threads=1, interval="envelope"), draws)


@given(scene=scenes(BUFFERS), interval=st.sampled_from(["device", "envelope"]))
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
def test_random_scenes_lie_in_their_intervals(scene: Any, interval: Any) -> None:
    assume(scene.technique.name != "beams" or parameters(scene, "beams").model_dump()["q"] == "table")
    draws = stored(scene)
    assert not outside(draw_bounds(scene, draws, threads=1, interval=interval), draws)


def test_q_without_a_table_is_refused() -> None:
    with pytest.raises(SceneError, match=r"technique\.q.*allowed.*table"):
        frame_bounds(_scene("fig4c", "technique.preset=analysis"))


@pytest.mark.parametrize("name", ["fig4c", "two_lights"])
def test_on_injected_input_a_draw_is_at_most_one_code_wide(name: str) -> None:
    """Two at a kink; more only where a texel of the shadow map is as deep as the point, within rounding.

    There the compare may go either way, which is worth the texel's weight of the sub-plane's share.  That such places
    are what they seem is seen by moving the bias by half a millimetre: the mirror itself then changes its mind.
    """
    common = ("buffers.format=unorm8", "technique.shadow_filter=pcf")
    scene = _scene(name, *common, width=40, height=60)
    draws = stored(scene)
    bias_m = parameters(scene, "beams").model_dump()["shadow_bias_m"]
    moved = [
        stored(_scene(name, *common, f"technique.shadow_bias_m={bias_m + step_m}", width=40, height=60))
        for step_m in (-5e-4, 5e-4)
    ]
    slabs = [b for b in draw_bounds(scene, draws, threads=1) if "/sub_" in b.draw or "/main" in b.draw]
    widths = np.concatenate([b.width().ravel() for b in slabs])
    assert (widths <= 1.0).mean() > 0.9999
    assert (widths == 0.0).mean() > 0.999
    assert (widths > 2.0).mean() < 1e-5
    for b in slabs:
        wide = b.width() > 2.0
        here = draws[b.draw][wide].astype(int)
        changes = [np.abs(other[b.draw][wide].astype(int) - here) for other in moved]
        assert (np.maximum(*changes) >= b.width()[wide] - 2.0).all(), b.draw


def test_where_one_compare_decides_all_a_draw_is_rarely_wider() -> None:
    """Without filter an undecided texel is worth a sub-plane's whole share."""
    scene = _scene("fig4c", "buffers.format=unorm8", "technique.shadow_filter=nearest", width=40, height=60)
    slabs = [b for b in draw_bounds(scene, stored(scene), threads=1) if "/sub_" in b.draw or "/main" in b.draw]
    widths = np.concatenate([b.width().ravel() for b in slabs])
    assert (widths <= 1.0).mean() > 0.9999
    assert (widths == 0.0).mean() > 0.999


def test_what_is_not_permitted_falls_outside() -> None:
    """A build that draws on one code more, or with a shadow map half a texel aside, is noticed in some draw."""
    scene = _scene("fig4c", "buffers.format=unorm16", "buffers.f_h.format=unorm16", width=40, height=60)
    draws = stored(scene)
    moved = {name: np.minimum(codes.astype(np.int64) + 9, 65535).astype(codes.dtype) for name, codes in draws.items()}
    shifted = stored(_scene("fig4c", "buffers.format=unorm16", "technique.shadow_bias_m=0.4", width=40, height=60))
    bounds = draw_bounds(scene, draws, threads=1, interval="envelope")
    assert len(outside(bounds, moved)) > len(bounds) // 2
    assert outside(draw_bounds(scene, shifted, threads=1, interval="envelope"), shifted)


def test_one_call_equals_one_call_per_draw() -> None:
    for interval in ("device", "envelope"):
        scene = _scene("two_lights")
        whole = frame_bounds(scene, interval=interval, threads=1)  # type: ignore[arg-type]
        parts = frame_bounds(scene, interval=interval, threads=2, watch=lambda *_: None)  # type: ignore[arg-type]
        for name, buffer in whole.buffers.items():
            if isinstance(buffer, Bounds):
                for mine, other in zip(buffer.data, parts.buffers[name].data, strict=True):
                    np.testing.assert_array_equal(mine, other, name)


def test_the_envelope_contains_the_device_interval() -> None:
    scene = _scene("two_lights", "buffers.device=gl_llvmpipe")
    inner, outer = (frame_bounds(scene, interval=i, threads=1).bounds for i in ("device", "envelope"))
    assert inner is not None
    assert outer is not None
    assert (outer[0] <= inner[0]).all()
    assert (inner[1] <= outer[1]).all()
    assert (outer[1] > inner[1]).any()
