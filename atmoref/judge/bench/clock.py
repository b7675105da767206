"""CPU time of a render's passes, repeated from the same buffers in one thread."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atmoref.pipeline import Pass
from atmoref.scene import Scene
from atmoref.techniques.render import prepare

PLANES = ("/slabs", "/planes")  # the passes that draw light in the air; the rest is shadow maps and the opaque scene


@dataclass(frozen=True, slots=True)
class Seconds:
    """CPU seconds of one render: of all its passes, and of those that draw planes."""

    passes: float
    planes: float


NOTHING = Seconds(0.0, 0.0)


def draws_planes(p: Pass) -> bool:
    """Return whether a pass draws planes or slabs."""
    return p.name.endswith(PLANES)


class Replay:
    """A prepared render that can be repeated: every run starts from the buffers as they were before the first draw.

    Parameters
    ----------
    scene : Scene
    technique : str or None

    Raises
    ------
    SceneError
    OutOfMemory
    """

    def __init__(self, scene: Scene, technique: str | None = None) -> None:
        start = time.thread_time()
        self.technique, _, self.passes, self.bank, self.report = prepare(scene, technique, None, None)
        self.plan_s = time.thread_time() - start
        self._before = {key: buffer.data.copy() for key, buffer in self.bank.items()}

    def run(self) -> Seconds:
        """Execute every pass in this thread."""
        for key, data in self._before.items():
            self.bank[key].data[...] = data
        for counters in self.report["counters"]:
            counters[...] = 0
        total = planes = 0.0
        for p in self.passes:
            row0, row1 = p.window or (0, p.rows)
            start = time.thread_time()
            p.execute(0, len(p.draws), row0, row1)
            spent = time.thread_time() - start
            total += spent
            planes += spent if draws_planes(p) else 0.0
        return Seconds(total, planes)

    def image(self) -> NDArray[np.float64]:
        """Return what the frame holds after a run, (H, W, 3), row 0 at the top."""
        return self.bank["frame"].values()

    def buffer_bytes(self) -> int:
        """Return the size of all buffers; those of interleaved images share their memory with no other."""
        return sum({id(buffer.data): buffer.data.nbytes for buffer in self.bank.values()}.values())


def interleaved(jobs: Sequence[Callable[[], Seconds]], rounds: int) -> list[Seconds]:
    """Return the least seconds of each job, after one run that is not counted and in which kernels are compiled.

    Jobs take turns, so that whatever else the machine does disturbs all of them alike.
    """
    for job in jobs:
        job()
    taken = [[job() for job in jobs] for _ in range(rounds)]
    return [
        Seconds(min(t.passes for t in column), min(t.planes for t in column)) for column in zip(*taken, strict=True)
    ]


def resized(scene: Scene, pixels: int, grain: int = 2) -> Scene:
    """Return a scene whose image has about `pixels` pixels, or fewer if it already has; same shape within rounding.

    Width and height become multiples of `grain`: interleaved images need that.
    """
    width, height = scene.image.width, scene.image.height
    if width * height <= pixels:
        return scene
    factor = (pixels / (width * height)) ** 0.5
    size = {k: max(grain, round(v * factor / grain) * grain) for k, v in (("width", width), ("height", height))}
    return dataclasses.replace(scene, image=scene.image.model_copy(update=size))
