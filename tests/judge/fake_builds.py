"""Dumps of builds that have one mistake, made by the mirror itself: no device is needed to test the diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from atmoref.judge.dumps import DumpWriter
from atmoref.judge.plan import Plan, make_plan
from atmoref.scene import Scene, load_scene

SMALL = (
    "image.width=36", "image.height=54", "technique.interval_m=4.0", "technique.shadow_map_size=128",
    "technique.light_map_size=64", "technique.q_table_size=64",
    "objects.0.center_m=[1.3, 8.0, -0.9]", "lights.0.direction=[0.12, -1.0, 0.07]",  # nothing is symmetric
)  # fmt: skip
Store = Callable[[str, str, np.ndarray, np.ndarray], np.ndarray]  # draw, buffer, before, after -> what is kept


def scene(*overrides: str) -> Scene:
    return load_scene("quick", (*SMALL, *overrides))


def kept(draw: str, buffer: str, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return after


def write(
    directory: Path, plan: Plan, *, store: Store = kept, dumped: Callable[[str, str], bool] = lambda d, b: True,
    skipped: Callable[[str], bool] = lambda d: False, named: dict[str, str] | None = None,
) -> Path:  # fmt: skip
    """Draw a plan and dump every buffer; `store` changes what a draw leaves in its buffer."""
    writer = DumpWriter(directory, "fake")
    for at, item in enumerate(plan.passes):
        for d, draw in enumerate(item.draws):
            name = item.stores[d]
            held: dict[str, Any] = {name: plan.stored(name)} if name in plan.bank else {}
            if not skipped(draw):
                plan.draw(((at, d, d + 1),))
            if draw.endswith("/upload"):
                continue
            last = name != "f_h" or d + 1 == len(item.draws) or item.stores[d + 1] != "f_h"
            for buffer in ("frame", "depth") if draw == "opaque" else (name,):
                before = held.get(buffer, plan.stored(buffer))
                if last:
                    plan.put({buffer: store(draw, buffer, before, plan.stored(buffer))})
                    if dumped(draw, buffer):
                        fmt = (named or {}).get(buffer, plan.bank[buffer].format.name)
                        writer.add(draw, buffer, fmt, plan.stored(buffer))
    writer.close()
    return directory


def correct(directory: Path, *overrides: str) -> Path:
    return write(directory, make_plan(scene(*overrides)))
