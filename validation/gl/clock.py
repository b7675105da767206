"""CPU time of the passes that draw planes, OpenGL and mirror in turns on one thread each."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from validation.gl.case import Case

if TYPE_CHECKING:
    from validation.gl.build import Build


@dataclass(frozen=True, slots=True)
class Times:
    """Seconds of CPU, all runs in the order in which they were measured."""

    device: tuple[float, ...]
    mirror: tuple[float, ...]

    @property
    def ratio(self) -> float:
        """How many times faster the mirror is, by medians."""
        return statistics.median(self.device) / statistics.median(self.mirror)

    @property
    def spread(self) -> tuple[float, float]:
        """The least and the greatest ratio of neighbours in time."""
        pairs = [d / m for d, m in zip(self.device, self.mirror, strict=True)]
        return min(pairs), max(pairs)


def planes(case: Case, build: Build, runs: int) -> Times:
    """Time sub-planes and main planes (or all planes of the previous method) of every light.

    Both start from the mirror's shadow maps, depth and opaque frame; setting those up is not timed, nor is the first
    run, in which shaders and kernels are compiled.
    """
    for light, drawn in zip(case.lights, build.lights, strict=True):
        case.draw(light.shadow)
        case.draw(light.upload)
        drawn.write_shadow_map(case.codes(f"{light.prefix}/shadow_map"))
    case.draw(case.base)
    for light in case.lights:
        if light.opaque is not None:
            case.draw(light.opaque)
    build.write("depth", case.codes("depth"))
    opaque, held = case.codes("frame"), case.buffer("frame").data.copy()
    device: list[float] = []
    mirror: list[float] = []
    for run in range(runs + 1):
        build.write("frame", opaque)
        build.ctx.finish()
        start = time.process_time()
        for drawn in build.lights:
            drawn.draw_planes()
        build.ctx.finish()
        between = time.process_time()
        case.buffer("frame").data[:] = held
        begin = time.process_time()
        for light in case.lights:
            case.draw(light.planes)
        end = time.process_time()
        if run:
            device.append(between - start)
            mirror.append(end - begin)
    return Times(tuple(device), tuple(mirror))
