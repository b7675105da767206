"""Error against time: planes, epsilon and table size of `beams`, planes of the other techniques, and the truth."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.judge.bench.clock import Replay, Seconds, interleaved
from atmoref.judge.bench.variants import variant
from atmoref.judge.ladder import errors
from atmoref.scene import Scene, SceneError
from atmoref.techniques.render import parameters
from atmoref.truth import solve

INTERVALS = (4.0, 2.0, 1.0, 0.5)  # times the interval that the scene's own rule finds
EPSILONS = (8.0, 1.0, 0.25)  # times the scene's own
TABLES = (16, 64, 256)  # texels
PLANES = (10, 20, 40, 80, 160, 320)


@dataclass(frozen=True, slots=True)
class Point:
    """One setting: its CPU seconds (all passes; of them the planes) and the error of its picture."""

    technique: str
    settings: dict[str, Any]
    main_planes: int
    sub_planes: int
    seconds: Seconds
    error: dict[str, float]
    on_front: bool = False


@dataclass(frozen=True, slots=True)
class Front:
    """All points of one scene and format, cheapest first, and the truth: its CPU seconds and greatest error estimate.

    `error` in points is Σ|d| / Σtruth over the picture, both clipped to [0, 1].
    """

    scene: str
    size: tuple[int, int]
    format: str
    points: list[Point]
    truth_s: float
    truth_error: float
    refused: list[str] = field(default_factory=list)

    def best(self, technique: str, error: float) -> Point | None:
        """Return the cheapest setting of a technique whose error is at most `error`, if there is one."""
        good = (p for p in self.points if p.technique == technique and p.error["sum_ratio"] <= error)
        return min(good, key=lambda p: p.seconds.passes, default=None)


def settings(scene: Scene, technique: str, *, quick: bool = False) -> Iterator[dict[str, Any]]:
    """Yield the keys of [technique] that a sweep sets, one mapping a point.

    Raises
    ------
    SceneError
        If the scene cannot be asked for this technique.
    """
    if technique != "beams":
        yield from ({"planes": n} for n in (PLANES[1:4] if quick else PLANES))
        return
    own = variant(scene, "beams")
    intervals = [light["interval_m"] for light in Replay(own).report["lights"]]
    epsilon = parameters(own, "beams").epsilon  # type: ignore[attr-defined]
    sweep = (INTERVALS[1:3], EPSILONS[:2], TABLES[1:2]) if quick else (INTERVALS, EPSILONS, TABLES)
    for dt, share, texels in itertools.product(*sweep):
        yield {"interval_m": min(intervals) * dt, "epsilon": epsilon * share, "q_table_size": texels}


def pareto(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Return which (cost, error) no other beats in one without losing in the other."""
    return [
        not any((c <= cost and e <= error) and (c < cost or e < error) for c, e in points) for cost, error in points
    ]


def front(
    scene: Scene,
    techniques: Sequence[str] = ("beams", "beams_vertex"),
    *,
    rounds: int = 3,
    quick: bool = False,
) -> Front:
    """Return errors and CPU times of a sweep over the settings of several techniques, all measured in turns.

    Parameters
    ----------
    scene : Scene
        Its formats are kept, whatever the technique.
    techniques : names
    rounds : int
    quick : bool
        A few settings only.
    """
    reference, truth_s = _truth(scene, rounds)
    clipped: NDArray[np.float64] = np.clip(reference.image, 0.0, 1.0)
    asked: list[tuple[str, dict[str, Any], Replay]] = []
    refused: list[str] = []
    for technique in techniques:
        try:
            for keys in settings(scene, technique, quick=quick):
                asked.append((technique, keys, Replay(variant(scene, technique, **keys), technique)))
        except SceneError as refusal:
            refused.append(f"{technique}: {refusal}")
    least = interleaved([replay.run for _, _, replay in asked], rounds)
    measured = [errors(replay.image(), clipped) for _, _, replay in asked]
    efficient = pareto([(s.passes, e["sum_ratio"]) for s, e in zip(least, measured, strict=True)])
    points = []
    for (technique, keys, replay), seconds, error, best in zip(asked, least, measured, efficient, strict=True):
        lights = replay.report["lights"]
        counts = (sum(light["main_planes"] for light in lights), sum(light["sub_planes"] for light in lights))
        points.append(Point(technique, keys, *counts, seconds, error, best))
    points.sort(key=lambda p: p.seconds.passes)
    formats = asked[0][2].bank["frame"].format.name if asked else ""
    size = (scene.image.width, scene.image.height)
    estimate = 0.0
    if reference.error is not None:
        estimate = float(np.nansum(reference.error) / max(float(np.nansum(reference.image)), 1e-300))
    return Front(scene.name, size, formats, points, truth_s, estimate, refused)


def _truth(scene: Scene, rounds: int) -> tuple[Any, float]:
    """Return the truth and its least CPU seconds: of the process, since its threads are not this one."""
    answer, taken = solve(scene, threads=1), []
    for _ in range(rounds):
        start = time.process_time()
        answer = solve(scene, threads=1)
        taken.append(time.process_time() - start)
    return answer, min(taken)


__all__ = ["Front", "Point", "front", "pareto", "settings"]
