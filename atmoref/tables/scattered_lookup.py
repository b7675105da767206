# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Reads of a table of scattered light, in lanes, and what such reads lose in each storage.

A table lies in one flat array, channel after channel, row after row, with room behind it for the second of a pair.
Angles come as atan2(|p x l|, p . l), never as acos (`angles.between`), because float32 loses 0.03 degrees of it near 0
and 180 degrees.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import device, kernel
from atmoref.buffers.device import DEVICES
from atmoref.buffers.formats import decode, encode, named
from atmoref.lanes import (
    N,
    floor,
    gather_pair,
    load,
    maximum,
    minimum,
    store,
    to_int,
)
from atmoref.tables.scattered import Scattered

__all__ = [
    "LINEAR",
    "LINEAR_IN_N",
    "NEAREST",
    "Errors",
    "Grid",
    "flat_table",
    "look_up",
    "lookup_errors",
    "read_table",
    "stored",
]

Floats = NDArray[np.float64]
NEAREST, LINEAR, LINEAR_IN_N = 0, 1, 2
"""The paper's read without interpolation (R-E23); linear in the angle; and in the number of scatterings as well."""
PER_RADIAN = 0.3183098861837907


class Grid(NamedTuple):
    """Uniforms of a read: columns, rows (orders), elements from row to row, and one of the three modes."""

    columns: int
    orders: int
    pitch: int
    mode: int


@device
def _row(table, grid, along, row, start):
    """Return the value at a column coordinate of one row."""
    if grid.mode == NEAREST:
        column = minimum(floor(along + 0.5), grid.columns - 1.0)
        return gather_pair(table, to_int(column) + row + start)[0]
    column = minimum(floor(along), grid.columns - 2.0)
    low, high = gather_pair(table, to_int(column) + row + start)
    return low + (high - low) * (along - column)


@device
def look_up(table, grid, angle, n, start):
    """Return Ams_n at scattering angles, as lanes.

    Parameters
    ----------
    table : flat float32 array of `flat_table`
    grid : Grid
    angle : lane, radians, 0 to pi
    n : lane
        Number of scatterings; beyond the last row the last one counts, below 1 the first.  Not whole ones are rounded
        down, or interpolated between rows (`LINEAR_IN_N`).
    start : int
        Where the channel begins.
    """
    along = angle * (PER_RADIAN * (grid.columns - 1.0))
    order = minimum(maximum(n, 1.0), grid.orders * 1.0) - 1.0
    first = floor(order)
    row = to_int(first) * grid.pitch
    value = _row(table, grid, along, row, start)
    if grid.mode == LINEAR_IN_N:
        last = to_int(minimum(first + 1.0, grid.orders - 1.0)) * grid.pitch
        value = value + (_row(table, grid, along, last, start) - value) * (order - first)
    return value


@kernel
def _read_kernel(out, table, grid, angle, n, start):
    for i in range(0, out.size, N):
        store(out, i, look_up(table, grid, load(angle, i), load(n, i), start))


def flat_table(values: NDArray[np.float32]) -> tuple[NDArray[np.float32], int]:
    """Return (orders, columns) or (W, orders, columns) values in one row with room to read, and the pitch of rows."""
    pitch = values.shape[-1]
    flat = np.zeros(values.size + 2 * N, np.float32)
    flat[: values.size] = np.ascontiguousarray(values, np.float32).ravel()
    return flat, pitch


def read_table(values: NDArray[np.float32], angle: NDArray[np.float32], n: NDArray[np.float32], mode: int) -> Floats:
    """Return what `look_up` reads of one channel (orders, columns) at angles (radians) and numbers, of equal size."""
    flat, pitch = flat_table(values)
    padded = -(-angle.size // N) * N
    at, order, out = (np.ones(padded, np.float32) for _ in range(3))
    at[: angle.size], order[: angle.size] = angle.ravel(), n.ravel()
    _read_kernel(out, flat, Grid(values.shape[1], values.shape[0], pitch, mode), at, order, 0)
    return out[: angle.size].reshape(angle.shape).astype(np.float64)


def stored(values: NDArray[np.float32], storage: str) -> NDArray[np.float32]:
    """Return values as a format keeps them; unorm formats take each row divided by its greatest value."""
    fmt = named(storage)
    scale = values.max(-1, keepdims=True) if fmt.kind == "unorm" else np.float32(1.0)
    codes = encode(values / scale, fmt, DEVICES["ideal"])
    return (decode(codes, fmt) * scale).astype(np.float32)


class Errors(NamedTuple):
    """Relative errors of reads at random angles and numbers: root mean square, 99th percentile, greatest."""

    rms: float
    percent_99: float
    greatest: float


def lookup_errors(
    table: Scattered, channel: int, exact: Floats, angles_deg: Floats, storage: str, mode: int = LINEAR
) -> Errors:
    """Return how far reads of one channel are from exact rows (orders, angles) at the same angles.

    `storage` is a format's name, or "float64": the interpolation alone, without a format and in float64.
    """
    values = table.values[channel]
    if storage == "float64":
        grid = table.axes.angles_deg
        read = np.array([np.interp(angles_deg, grid, row.astype(np.float64)) for row in values])
    else:
        angle = np.broadcast_to(np.radians(angles_deg).astype(np.float32), exact.shape)
        n = np.broadcast_to(np.arange(1, exact.shape[0] + 1, dtype=np.float32)[:, None], exact.shape)
        read = read_table(stored(values, storage), np.ascontiguousarray(angle), np.ascontiguousarray(n), mode)
    relative = np.abs(read - exact) / exact
    return Errors(
        float(np.sqrt(np.mean(relative * relative))), float(np.percentile(relative, 99)), float(relative.max())
    )
