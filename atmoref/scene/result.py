"""What a technique or a truth hands out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """One answered question.

    Parameters
    ----------
    image
        Linear radiance, (H, W, 3) float64, row 0 at the top. Mirrors: what the frame buffer holds, decoded. Truths:
        not clipped.
    error
        Estimated absolute error, or standard error, of every value of the image, (H, W, 3); None where the method has
        none.
    buffers
        Every named buffer.
    stats
        Times, draws, samples, memory.
    bounds
        Least and greatest image that a correct build may draw, where intervals were computed; `image` is their middle.
    provenance
        Scene, versions, formats, device: what is needed to make it again.
    """

    image: NDArray[np.float64]
    error: NDArray[np.float64] | None = None
    buffers: dict[str, Any] = field(default_factory=dict)
    stats: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
