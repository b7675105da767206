"""What a draw may store: the interface that a verdict asks, and a tolerance for where nothing narrower is derived.

``bounds_of_draw(DrawAsked) -> Allowed`` is all that `check` knows of it.  Derived intervals answer with the numbers
that a correct device can store; the tolerance here answers with one code, and with few pixels that may use it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.formats import Format
from atmoref.pipeline import Bank, Pass

FEW = 0.01
"""Fraction of pixels that may be off at all under the tolerance: a rule that differs moves far more of them."""
FLOAT32_STEPS = 64.0
"""Steps of float32: transcendental functions are ulps apart between devices, and a slab multiplies several."""


@dataclass(frozen=True, slots=True)
class DrawAsked:
    """One dumped buffer whose bounds are asked for.

    Parameters
    ----------
    draw, buffer : str
    draws : tuple of (Pass, first, last)
        What was drawn since the buffers before it: draws [first, last) of each pass.
    before : mapping of buffer name to stored texels (H, W, C)
        The build's own previous buffers, row 0 at the top.
    bank : Bank
        The mirror's buffers after the draw.
    stored : (H, W, C) array
        What the mirror stored: codes, or numbers.
    format : Format
    """

    draw: str
    buffer: str
    draws: tuple[tuple[Pass, int, int], ...]
    before: dict[str, NDArray[Any]]
    bank: Bank
    stored: NDArray[Any]
    format: Format


@dataclass(frozen=True, slots=True)
class Allowed:
    """Least and greatest allowed store, as codes or numbers (H, W, C), and the fraction of pixels that may use them.

    `few` is 1 for derived intervals: every value inside is right. `name` says in a verdict what was applied.
    """

    lo: NDArray[np.float64]
    hi: NDArray[np.float64]
    few: float = 1.0
    name: str = "device interval"


BoundsOfDraw = Callable[[DrawAsked], Allowed]


def tolerance(asked: DrawAsked) -> Allowed:
    """Return the mirror's store plus or minus one code (float32: 64 steps), to be used by at most 1 % of the pixels.

    In float32 every pixel may use it: devices agree in few last bits there.
    """
    stored = asked.stored.astype(np.float64)
    if asked.format.kind == "unorm":
        return Allowed(np.maximum(stored - 1.0, 0.0), np.minimum(stored + 1.0, asked.format.top), FEW, "1 code, in 1 %")
    step = np.abs(stored) * 2.0 ** -(_mantissa(asked.format)) + 2.0**asked.format.least_exponent
    if asked.format.name in ("float32", "float64"):
        peak = float(np.abs(stored).max()) if stored.size else 0.0
        reach = FLOAT32_STEPS * step + peak * 2.0**-26
        return Allowed(stored - reach, stored + reach, 1.0, f"{FLOAT32_STEPS:g} steps of {asked.format.name}")
    return Allowed(stored - step, stored + step, FEW, "1 step, in 1 %")


def _mantissa(fmt: Format) -> int:
    """Return the significand bits without the leading one of the format's coarsest channel."""
    return min(fmt.mantissa(channel) for channel in range(3))
