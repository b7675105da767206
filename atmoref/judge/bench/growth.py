"""How CPU time grows with pixels, planes, sub-planes and lights, skips off: fitted exponents."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from atmoref.judge.bench.clock import Replay, interleaved
from atmoref.judge.bench.variants import variant
from atmoref.scene import Scene, scene_from_mapping

AXES = ("pixels", "planes", "planes, one sub-plane each", "sub-planes", "lights")
LINEAR = AXES[:4]
"""Where the work of every draw is the same by construction, so that the exponent must be 1."""


@dataclass(frozen=True, slots=True)
class Growth:
    """Least CPU seconds of the plane passes for each size along one axis, and the exponent fitted to them."""

    axis: str
    technique: str
    sizes: tuple[int, ...]
    seconds: tuple[float, ...]

    @property
    def exponent(self) -> float:
        """Slope of log seconds over log size, by least squares."""
        return exponent(self.sizes, self.seconds)


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """Return the power of `sizes` with which `seconds` grow: least squares over logarithms."""
    x, y = np.log(np.asarray(sizes, np.float64)), np.log(np.asarray(seconds, np.float64))
    x = x - x.mean()
    return float((x * (y - y.mean())).sum() / (x * x).sum())


def _sized(scene: Scene, width: int, height: int) -> Scene:
    image = scene.image.model_copy(update={"width": width, "height": height})
    return dataclasses.replace(scene, image=image)


def _with_lights(scene: Scene, count: int) -> Scene:
    """Return the scene with its first light repeated."""
    mapping: dict[str, Any] = scene.to_mapping()
    mapping["lights"] = [mapping["lights"][0]] * count
    return scene_from_mapping(mapping, origin=scene.origin, name=scene.name, path=scene.path)


def series(scene: Scene, axis: str, steps: int, width: int) -> tuple[str, list[Scene]]:
    """Return the technique and scenes of growing size along one axis, each about twice the one before.

    Parameters
    ----------
    scene : Scene
        With one light.
    axis : str
        One of `AXES`.
    steps : int
        Number of scenes.
    width : int
        Pixels; a multiple of the lane width leaves no lane idle. The image is one and a half times as high. Along
        "pixels" both sides grow, from twice the width on, for the field of view is the height's: a picture that only
        got taller would see another part of the scene.
    """
    small = _sized(scene, width, width * 3 // 2)
    if axis == "pixels":
        full = variant(scene, "beams", skip=False)
        widths = [round(2 * width * math.sqrt(2.0) ** i / 16.0) * 16 for i in range(steps)]
        return "beams", [_sized(full, w, w * 3 // 2) for w in widths]
    if axis == "planes":
        return "beams_vertex", [variant(small, "beams_vertex", skip=False, planes=40 * 2**i) for i in range(steps)]
    if axis == "sub-planes":
        return "beams", [
            variant(small, "beams", skip=False, interval_m=2.4, epsilon=0.008 / 2**i) for i in range(steps)
        ]
    if axis == "lights":
        lit = variant(small, "beams", skip=False)
        return "beams", [_with_lights(lit, 2**i) for i in range(min(steps, 4))]
    return "beams", [
        variant(small, "beams", skip=False, sub_plane_rule="one", interval_m=0.8 / 2**i) for i in range(steps)
    ]


def measure_growth(scene: Scene, axis: str, *, steps: int = 5, width: int = 96, rounds: int = 7) -> Growth:
    """Return how the CPU time of the plane passes grows along one axis, skips off.

    Raises
    ------
    ValueError
        For an unknown axis.
    """
    if axis not in AXES:
        raise ValueError(f"axis: found {axis!r}; allowed: {', '.join(AXES)}")
    technique, scenes = series(scene, axis, steps, width)
    replays = [Replay(s) for s in scenes]
    least = interleaved([r.run for r in replays], rounds)
    sizes = tuple(_size(axis, s, r) for s, r in zip(scenes, replays, strict=True))
    return Growth(axis, technique, sizes, tuple(t.planes for t in least))


def _size(axis: str, scene: Scene, replay: Replay) -> int:
    if axis == "pixels":
        return scene.image.width * scene.image.height
    if axis == "lights":
        return len(scene.lights)
    lights = replay.report["lights"]
    return int(sum(light["sub_planes" if axis == "sub-planes" else "main_planes"] for light in lights))


__all__ = ["AXES", "LINEAR", "Growth", "exponent", "measure_growth", "series"]
