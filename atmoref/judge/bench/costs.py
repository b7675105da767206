"""What one scene costs under one technique: time, memory, draws, skips, and what skips save."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from atmoref.judge.bench.clock import NOTHING, Replay, Seconds, interleaved, resized
from atmoref.judge.bench.variants import variant
from atmoref.memory import OutOfMemory
from atmoref.scene import Scene, SceneError
from atmoref.techniques import TECHNIQUES
from atmoref.techniques.render import technique_name

# what a process of its own prints: the peak of one that has rendered nothing else
_PEAK = """
import json, sys
from atmoref.scene import scene_from_mapping
from atmoref.techniques.render import peak_memory_mb, render
from pathlib import Path
job = json.load(sys.stdin)
path = Path(job["path"]) if job["path"] else None
for width, height in job["sizes"]:
    job["scene"]["image"].update(width=width, height=height)
    render(scene_from_mapping(job["scene"], name=job["name"], path=path), technique=job["technique"], threads=1)
    print(peak_memory_mb())
"""
_LEAST_IMAGE = 16  # pixels on a side: what interpreter, libraries and kernels take, almost without an image


@dataclass(frozen=True, slots=True)
class Cost:
    """Figures of one scene under one technique; `refused` says why there are none.

    `own` tells whether the scene asks for this technique.  Waves are draws of one row of lanes; `skipped` is the
    fraction of them that was left out.  `skips` and `no_skips` are CPU seconds with and without.  Peaks are resident MB
    of a process that renders the scene alone, `idle_mb` of one that renders 16 x 16 pixels of it.
    """

    scene: str
    technique: str
    own: bool
    preset: str
    size: tuple[int, int]
    asked: tuple[int, int]
    refused: str = ""
    draws: int = 0
    main_planes: int = 0
    sub_planes: int = 0
    skipped: float = 0.0
    skips: Seconds = NOTHING
    no_skips: Seconds = NOTHING
    peak_mb: float = 0.0
    idle_mb: float = 0.0
    buffers_mb: float = 0.0

    @property
    def gain(self) -> float:
        """How many times longer the planes take without skips."""
        return self.no_skips.planes / max(self.skips.planes, 1e-12)

    @property
    def ns_per_draw_pixel(self) -> float:
        """CPU nanoseconds of the planes, skips off, for each plane or sub-plane of each pixel."""
        work = self.size[0] * self.size[1] * max(1, self.main_planes + self.sub_planes)
        return 1e9 * self.no_skips.planes / work


def peaks_mb(scene: Scene, technique: str) -> tuple[float, float]:
    """Return the peak resident memory of two fresh renders in a process of its own: of 16 x 16 pixels, then of all.

    Raises
    ------
    RuntimeError
        If that process fails; with its last line.
    """
    whole = (scene.image.width, scene.image.height)
    job = {
        "scene": scene.to_mapping(), "name": scene.name, "technique": technique,
        "path": str(scene.path) if scene.path else "", "sizes": [(_LEAST_IMAGE, _LEAST_IMAGE), whole],
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", _PEAK], input=json.dumps(job), capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{scene.name}, {technique}: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    idle, peak = (float(line) for line in done.stdout.split())
    return idle, peak


def cost(scene: Scene, technique: str, *, pixels: int = 160_000, rounds: int = 5, memory: bool = True) -> Cost:
    """Return what a scene costs under a technique, or why it cannot be asked for.

    Parameters
    ----------
    scene : Scene
    technique : str
    pixels : int
        A larger image is measured smaller, and says so.
    rounds : int
        With and without skips take turns; the least of each counts.
    memory : bool
        Measure the peak, in a process of its own.
    """
    asked = (scene.image.width, scene.image.height)
    small = resized(scene, pixels)
    size = (small.image.width, small.image.height)
    own = scene.technique.name == technique or (scene.technique.name is None and technique_name(scene) == technique)
    known = (scene.name, technique, own, scene.technique.preset, size, asked)
    try:
        question = variant(small, technique)
        replays = [Replay(question, technique), Replay(variant(small, technique, skip=False), technique)]
    except (SceneError, OutOfMemory) as refusal:
        return Cost(*known, refused=str(refusal))
    with_skips, without = interleaved([r.run for r in replays], rounds)
    first = replays[0]
    lights: list[dict[str, Any]] = first.report["lights"]
    idle, peak = peaks_mb(question, technique) if memory else (0.0, 0.0)
    return Cost(
        *known, "", sum(len(p.draws) for p in first.passes), sum(light["main_planes"] for light in lights),
        sum(light["sub_planes"] for light in lights), skipped_fraction(first), with_skips, without, peak, idle,
        first.buffer_bytes() / 2**20,
    )  # fmt: skip


def skipped_fraction(replay: Replay) -> float:
    """Return the fraction of waves, of sub-planes and planes, that the last run left out."""
    drawn = lit = 0
    for counters in replay.report["counters"]:
        sub, sub_lit, _, main, main_lit = (int(c) for c in counters.sum(0))
        drawn, lit = drawn + sub + main, lit + sub_lit + main_lit
    return 1.0 - lit / drawn if drawn else 0.0


def costs(
    scene: Scene,
    techniques: Sequence[str] = TECHNIQUES,
    *,
    pixels: int = 160_000,
    rounds: int = 5,
    memory: bool = True,
) -> list[Cost]:
    """Return the costs of a scene under several techniques, in their order."""
    return [cost(scene, name, pixels=pixels, rounds=rounds, memory=memory) for name in techniques]


__all__ = ["Cost", "cost", "costs", "peaks_mb", "skipped_fraction"]
