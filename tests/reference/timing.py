"""CPU time of a stage's kernel beside that of the scalar reference, interleaved in one thread of one run."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from reference.replay import STAGES, captured, real_of
from reference.scalar_slabs import specialised_slab_loop
from reference.scalar_vertex import specialised_vertex_loop


@dataclass(frozen=True, slots=True)
class Timing:
    """Least CPU seconds of the lane kernel with and without skips, and of the scalar reference; the draws."""

    skips_s: float
    no_skips_s: float
    scalar_s: float
    draws: int

    @property
    def ratio(self) -> float:
        """Scalar over lanes with skips."""
        return self.scalar_s / self.skips_s

    @property
    def ratio_without_skips(self) -> float:
        """Scalar over lanes that skip nothing."""
        return self.scalar_s / self.no_skips_s

    @property
    def gain(self) -> float:
        """What skips save."""
        return self.no_skips_s / self.skips_s


def measure(scene: Any, stage: str, rounds: int = 11) -> Timing:
    """Time one stage of a scene with one light: the kernel alone, on the buffers that it gets in a render.

    The reference is compiled for the choices of this scene and leaves early what a pixel does not need; both results
    must be equal.  Rounds are interleaved, the least of each counts, so that another process disturbs all alike.
    """
    ((kernel, call),) = captured(scene, stage)
    u, window = call["uniforms"], call["window"]
    specialised = specialised_slab_loop if stage == "beam_planes" else specialised_vertex_loop
    loop = specialised(real_of(call["arith"]), u.switches, u.slab_switches)
    outputs = STAGES[stage][2]

    def lanes(skip: int) -> tuple[float, Any]:
        mine = call | {key: call[key].copy() for key in outputs}
        mine["uniforms"] = u._replace(switches=u.switches._replace(skip=skip))
        start = time.thread_time()
        kernel(*mine.values())
        return time.thread_time() - start, mine["frame"]

    def scalar() -> tuple[float, Any]:
        mine = call | {key: call[key].copy() for key in outputs}
        start = time.thread_time()
        STAGES[stage][1](mine, loop)  # type: ignore[call-arg]
        return time.thread_time() - start, mine["frame"]

    frames = [lanes(1)[1], lanes(0)[1], scalar()[1]]  # compiles what is not yet compiled
    shape = (3, window.height, window.pitch)
    a, b, c = (f.reshape(shape)[:, :, : window.column1] for f in frames)
    np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(a, c)
    times = [(lanes(1)[0], lanes(0)[0], scalar()[0]) for _ in range(rounds)]
    skips, none, plain = (min(t) for t in zip(*times, strict=True))
    return Timing(skips, none, plain, window.d1 - window.d0)
