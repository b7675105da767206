"""Buffers of intervals: least and greatest of what a correct device may hold.

Both ends are buffers like any other, of codes or numbers as float32 (every code of at most 24 bits is one).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.buffers.blend import Mixed
from atmoref.buffers.device import DEVICES, Device, Rounding
from atmoref.buffers.formats import Format
from atmoref.buffers.layout import Buffer, allocate


@dataclass(frozen=True, slots=True)
class Bounds(Buffer):
    """A named render target of intervals: `data` is the pair of arrays that kernels of intervals take."""

    data: Any

    @property
    def low(self) -> Buffer:
        """The least that the buffer may hold."""
        return Buffer(self.name, self.format, self.width, self.height, self.channels, self.pitch, self.data[0])

    @property
    def high(self) -> Buffer:
        """The greatest that the buffer may hold."""
        return Buffer(self.name, self.format, self.width, self.height, self.channels, self.pitch, self.data[1])

    @property
    def nbytes(self) -> int:
        """Memory of both ends."""
        return int(self.data[0].nbytes + self.data[1].nbytes)

    def codes(self) -> NDArray[Any]:
        """Refuse: there are two; `low.codes()` and `high.codes()`.

        Raises
        ------
        ValueError
        """
        raise ValueError(f"buffer {self.name} holds intervals; ask its `low` and `high` for codes")

    def values(self) -> NDArray[np.float64]:
        """Return the middle values (H, W, C), row 0 at the top."""
        low, high = self.low.values(), self.high.values()
        return low + 0.5 * (high - low)

    def put(self, image: ArrayLike, device: Device = DEVICES["ideal"], rounding: Rounding | None = None) -> None:
        """Store a picture as both ends, or two of them, (2, H, W, C): least and greatest; see `Buffer.put`."""
        texels = np.asarray(image)
        pair = texels if texels.ndim == 4 and len(texels) == 2 else (texels, texels)
        self.low.put(pair[0], device, rounding)
        self.high.put(pair[1], device, rounding)

    def clear(self, code: float = 0) -> None:
        """Set every texel, filling included, to one code (of a float format, to one number)."""
        self.low.clear(code)
        self.high.clear(code)


def allocate_bounds(name: str, fmt: Format, width: int, height: int, channels: int) -> Bounds:
    """Return a cleared buffer of intervals, which kernels draw into with the code class `Mixed`; see `allocate`."""
    low = allocate(name, fmt, width, height, channels, Mixed(), "float32")
    high = replace(low, data=np.zeros_like(low.data))
    return Bounds(name, fmt, width, height, channels, low.pitch, (low.data, high.data))
