"""The debugger: what a probe tells about one pixel is what a dump holds there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from bits_manifest import SCENES, small

from atmoref.lanes import N
from atmoref.pipeline import Pass, run
from atmoref.stages.beam_planes import PROBE
from atmoref.techniques.render import prepare, render


def _dumped(scene: Any, x: int, y: int) -> dict[str, np.ndarray]:
    """Return what every draw left at one pixel, as the registers have it: codes, or numbers."""
    found: dict[str, np.ndarray] = {}

    def watch(draw: str, p: Pass, bank: Any) -> None:
        if p.name.endswith(("/slabs", "/planes")):
            found[draw] = bank[p.stores[p.draws.index(draw)]].codes()[y, x].astype(np.float64)
        elif "frame" in p.stores:
            found["before"] = bank["frame"].codes()[y, x].astype(np.float64)

    render(scene, threads=1, watch=watch)
    return found


def _traced(scene: Any, x: int, y: int) -> dict[str, dict[str, float]]:
    _, _, passes, bank, report = prepare(scene, None, (x, y, 1, 1), None, trace=True)
    run(passes, bank, threads=1)
    found: dict[str, dict[str, float]] = {}
    planes = [p for p in passes if p.name.endswith(("/slabs", "/planes"))]
    for p, probe in zip(planes, report["probe"], strict=True):
        blocks = probe[: len(p.draws) * len(PROBE) * N].reshape(len(p.draws), len(PROBE), N)
        for name, block in zip(p.draws, blocks, strict=True):
            found[name] = dict(zip(PROBE, block[:, x % N].tolist(), strict=True))
    return found


@pytest.mark.parametrize("code_class", ["unorm8/float32", "float64/float64"])
@pytest.mark.parametrize("name", ["fig4a", "fig4c", "two_lights"])
def test_a_trace_tells_what_a_dump_holds(name: str, code_class: str) -> None:
    scene = small(name, code_class)
    width, height = SCENES[name]
    lit = 0
    for x, y in ((width // 2, height // 2), (width // 2 + 3, height // 3), (1, height - 1), (width - 1, 2)):
        dumped, traced = _dumped(scene, x, y), _traced(scene, x, y)
        assert traced
        assert ["before", *traced] == list(dumped)
        frame, f_h = dumped["before"].tolist(), [0.0, 0.0, 0.0]
        for draw, block in traced.items():
            stored = [block[f"stored_{c}"] for c in "rgb"]
            assert stored == dumped[draw].tolist(), (draw, x, y)
            assert block["drawn"] in (0.0, 1.0)
            lit += block["drawn"] == 1.0
            last = draw.rpartition("/")[2]
            if block["drawn"] == 0.0:  # nothing drawn, nothing changed
                assert stored == (f_h if last.startswith("sub_") else frame)
            if last.startswith("sub_"):
                f_h = stored
            else:
                frame, f_h = stored, [0.0, 0.0, 0.0]
    assert lit > 20


def test_a_trace_names_the_place_of_a_sample() -> None:
    """The middle pixel of F4, with an odd height, looks along the axis: there w is the depth below the light."""
    scene = small("fig4c", "float64/float64", "image.width=33", "image.height=41")
    traced = _traced(scene, 16, 20)
    for draw, block in traced.items():
        if "/sub_" in draw and block["drawn"] == 1.0:
            assert 31.5 < block["z"] < 59.2
            assert block["w"] == pytest.approx(6.0, abs=1e-12)
            across = (block["z"] - 45.0) / 6.0 / np.tan(np.radians(34.0))
            # the axis of a vertical light: its map lies in x and z
            assert (
                min(abs(block["u"] - 0.5 - s * across / 2) + abs(block["v"] - 0.5) for s in (-1, 1)) < 1e-9
                or min(abs(block["v"] - 0.5 - s * across / 2) + abs(block["u"] - 0.5) for s in (-1, 1)) < 1e-9
            )
        if draw.endswith("/main"):
            assert block["u"] == pytest.approx(block["z"] - 45.0, abs=1e-9)
            assert block["v"] == pytest.approx(6.0, abs=1e-12)
