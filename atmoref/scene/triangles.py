"""Triangles of meshes and height fields, as both the techniques and the truth take them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Triangles(NamedTuple):
    """Corners (V, 3) float64, in metres in the world, and three of their indices for each face, (F, 3) int32."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
