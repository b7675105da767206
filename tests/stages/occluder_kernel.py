"""A kernel that asks, for segments from one origin, whether triangles cut them."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from atmoref._jit import kernel
from atmoref.lanes import Double, N, Single, lift, load, select, spread_int, store
from atmoref.stages.ray_cast import OCCLUDER, Solids, Start, occluded, origin, parallel_occluded


@kernel
def shade(out, arith, solids, dx, dy, dz, own):  # type: ignore[no-untyped-def]
    """Write 1 where a segment is cut, else 0."""
    for i in range(0, out.shape[0], N):
        d = load(dx, i), load(dy, i), load(dz, i)
        cut = occluded(arith, solids, origin(arith), d[0], d[1], d[2], spread_int(numba.int32(own)))
        store(out, i, select(cut, d[0] * 0.0 + 1.0, lift(arith, spread_int(numba.int32(0)))))


@kernel
def shade_parallel(out, arith, solids, x, y, w, least_w, own):  # type: ignore[no-untyped-def]
    """Write 1 where something lies between the depths least_w and w of parallel light, else 0."""
    for i in range(0, out.shape[0], N):
        at = load(x, i), load(y, i), load(w, i)
        start, tag = Start(at[0], at[1], at[2]), spread_int(numba.int32(own))
        to = at[2] * 0.0 + (least_w - at[2])
        cut = parallel_occluded(
            arith, solids, start, to * 0.0, to * 0.0, to, at[0], at[1], at[2], at[2] * 0.0 + least_w, tag
        )
        store(out, i, select(cut, at[0] * 0.0 + 1.0, lift(arith, spread_int(numba.int32(0)))))


def no_solids() -> Solids:
    """Return a scene of nothing."""
    ids, none = np.zeros(0, np.int32), np.zeros
    return Solids(
        none((0, 4)), ids, none((0, 6)), ids, none(0), ids, none(3), none((0, 6)), np.zeros((0, 3), np.int32),
        none((0, OCCLUDER)), ids,
    )  # fmt: skip


def shaded(solids: Solids, segments: Any, dtype: Any, own: int = -1) -> Any:
    """Return which segments (n, 3) from the origin are cut."""
    count = len(segments)
    padded = np.zeros((-(-count // N) * N, 3), dtype)
    padded[:count] = segments
    out = np.zeros(len(padded), dtype)
    tag = Single() if dtype is np.float32 else Double()
    shade(out, tag, solids, *(np.ascontiguousarray(padded[:, i]) for i in range(3)), own)
    return out[:count] > 0.0


def shaded_in_parallel(solids: Solids, points: Any, dtype: Any, least_w: float = 0.0, own: int = -1) -> Any:
    """Return which points (n, 3), in the light's axes, have something before them."""
    count = len(points)
    padded = np.zeros((-(-count // N) * N, 3), dtype)
    padded[:count] = points
    out = np.zeros(len(padded), dtype)
    tag = Single() if dtype is np.float32 else Double()
    shade_parallel(out, tag, solids, *(np.ascontiguousarray(padded[:, i]) for i in range(3)), dtype(least_w), own)
    return out[:count] > 0.0
