"""What a correct build may store: bounds of a picture, and of every draw on given previous buffers."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.bounds import Bounds
from atmoref.buffers.formats import Format
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Result, Scene
from atmoref.techniques.render import render

Which = Literal["device", "envelope"]


def with_intervals(scene: Scene, interval: Which | None = None) -> Scene:
    """Return a scene that is answered in intervals; `interval` None keeps the scene's own choice."""
    change: dict[str, Any] = {"arithmetic": "interval"}
    if interval is not None:
        change["interval"] = interval
    return dataclasses.replace(scene, buffers=scene.buffers.model_copy(update=change))


@dataclass(frozen=True, slots=True, eq=False)
class DrawBounds:
    """Between what a draw may leave its buffer.

    Parameters
    ----------
    draw, step, buffer : str
        Its name, its pass, and the buffer it stores into.
    format : Format
        Of that buffer.
    low, high : (H, W, C) arrays
        Codes of a unorm format, else numbers; row 0 at the top.
    """

    draw: str
    step: str
    buffer: str
    format: Format
    low: NDArray[Any]
    high: NDArray[Any]

    def outside(self, stored: NDArray[Any]) -> NDArray[np.bool_]:
        """Return where a stored buffer is not within the bounds; NaN is outside."""
        wide = stored.astype(np.float64)
        return np.asarray(~((wide >= self.low.astype(np.float64)) & (wide <= self.high.astype(np.float64))))

    def width(self) -> NDArray[np.float64]:
        """Return the distance of the bounds, in codes of a unorm format."""
        return np.asarray(self.high.astype(np.float64) - self.low.astype(np.float64))


def draw_bounds(
    scene: Scene,
    stored: Mapping[str, NDArray[Any]],
    *,
    technique: str | None = None,
    interval: Which | None = None,
    threads: int | None = None,
) -> list[DrawBounds]:
    """Return the bounds of every draw, each on the previous buffers that `stored` gives.

    Parameters
    ----------
    scene : Scene
    stored : mapping of draw name to (H, W, C) array
        What a build's buffer held after that draw: codes of a unorm format, else numbers; row 0 at the top.  A draw
        that is missing hands its bounds on.
    technique : str or None
        Instead of the scene's own.
    interval : "device" or "envelope" or None
        None: what the scene says.
    threads : int or None

    Raises
    ------
    ValueError
        An array that the draw's buffer cannot hold.
    SceneError
    """
    found: list[DrawBounds] = []

    def watch(draw: str, step: Pass, bank: Bank) -> None:
        for name in _written(draw, step, bank):
            buffer = bank[name]
            if not isinstance(buffer, Bounds):
                continue
            key = draw if name == step.stores[step.draws.index(draw)] else f"{draw}/{name.rpartition('/')[2]}"
            found.append(DrawBounds(key, step.name, name, buffer.format, buffer.low.codes(), buffer.high.codes()))
            if key in stored:
                buffer.put(stored[key])

    render(with_intervals(scene, interval), technique=technique, threads=threads, watch=watch)
    return found


def _written(draw: str, step: Pass, bank: Bank) -> Iterator[str]:
    """Yield the buffers that a draw writes: the opaque pass writes depth as well."""
    target = step.stores[step.draws.index(draw)]
    if target in bank:
        yield target
    depth = target.removesuffix("frame") + "depth"
    if draw.rpartition("/")[2] == "opaque" and "light_" not in draw and depth in bank:
        yield depth


def frame_bounds(
    scene: Scene, *, technique: str | None = None, interval: Which | None = None, **options: Any
) -> Result:
    """Return the result of a render in intervals; its `bounds` are the least and the greatest image, end to end."""
    return render(with_intervals(scene, interval), technique=technique, **options)


def width_summary(low: NDArray[np.float64], high: NDArray[np.float64], fmt: Format) -> dict[str, float]:
    """Return median, 99 % and greatest width of bounds, and the fraction that leaves no choice.

    In codes of a unorm format, else relative to the middle (absolute where that is 0).
    """
    width = high - low
    if fmt.kind == "unorm":
        width = np.rint(width * fmt.top)
    else:
        middle = np.abs(high + low) * 0.5
        width = np.where(middle > 0.0, width / np.where(middle > 0.0, middle, 1.0), width)
    return {
        "median": float(np.median(width)), "percent_99": float(np.percentile(width, 99)),
        "greatest": float(width.max()), "decided": float((width == 0.0).mean()),
    }  # fmt: skip
