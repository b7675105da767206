"""Numbers of a difference: norms, place, codes off, PSNR."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atmoref.compare.frame import Frame

DARK = 0.02
"""Below this reference value a relative error is not counted in `mean_relative_above_0.02`."""
HISTOGRAM_BINS = 16


@dataclass(frozen=True, slots=True)
class Place:
    """One element of an image: pixel (x from the left, y from the top, both from 0), channel, and both values there."""

    x: int
    y: int
    channel: str
    test: float
    reference: float

    def __str__(self) -> str:
        return f"x = {self.x}, y = {self.y}, {self.channel}: {self.test:.9g} instead of {self.reference:.9g}"


def place_of_worst(size: NDArray[np.float64], test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> Place:
    """Return the judged element where `size` (H, W, C) is largest, the first in reading order among equals."""
    judged = np.where(mask[..., np.newaxis], size, -math.inf)
    row, column, channel = (int(at) for at in np.unravel_index(int(np.argmax(judged)), judged.shape))
    return Place(
        column,
        row,
        test.names[channel],
        float(test.values[row, column, channel]),
        float(reference.values[row, column, channel]),
    )


def channels_first(values: NDArray[np.float64], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the judged elements of (H, W, C) as (C, judged pixels), each channel in one piece."""
    flat = values.reshape(-1, values.shape[2]) if mask.all() else values[mask]
    return np.ascontiguousarray(flat.T)


def default_peak(test: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """Return 1 where both lie in [0, 1], else the largest reference value if it is positive, else 1."""
    top = float(reference.max())
    if min(test.min(), reference.min()) >= 0.0 and max(float(test.max()), top) <= 1.0:
        return 1.0
    return top if top > 0.0 else 1.0


def norms(test: NDArray[np.float64], reference: NDArray[np.float64], peak: float) -> dict[str, float]:
    """Return the measures of ``test - reference`` over arrays of equal shape.

    ``max_abs``, ``mean_abs``, ``mean`` (signed), ``rms``: in the unit of the values. ``max_rel`` and ``mean_rel``:
    over elements whose reference is not 0 (NaN if there is none). ``sum_ratio``: sum |d| / sum |reference|.
    ``psnr_db``: 10 log10(peak^2 / mean square), infinite for equal images.

    On values clipped to [0, 1], the three readings of "average error in intensities" (D-E38): ``clipped_mean`` = mean
    |d| (in units of the largest intensity, 1), ``clipped_sum_ratio`` and ``mean_relative_above_0.02`` (where the
    reference exceeds .02).
    """
    difference = test - reference
    size = np.abs(difference)
    mean_square = float(np.mean(np.square(difference)))
    height = np.abs(reference)
    relative = _ratios(size, height, height > 0.0)
    clipped = np.clip(reference, 0.0, 1.0)
    clipped_size = np.abs(np.clip(test, 0.0, 1.0) - clipped)
    bright = _ratios(clipped_size, clipped, clipped > DARK)
    return {
        "max_abs": float(size.max()),
        "mean_abs": float(size.mean()),
        "mean": float(difference.mean()),
        "rms": math.sqrt(mean_square),
        "max_rel": float(relative.max()) if relative.size else math.nan,
        "mean_rel": float(relative.mean()) if relative.size else math.nan,
        "sum_ratio": _ratio(float(size.sum()), float(height.sum())),
        "psnr_db": math.inf if mean_square == 0.0 else 10.0 * math.log10(peak * peak / mean_square),
        "clipped_mean": float(clipped_size.mean()),
        "clipped_sum_ratio": _ratio(float(clipped_size.sum()), float(clipped.sum())),
        f"mean_relative_above_{DARK}": float(bright.mean()) if bright.size else math.nan,
    }


def _ratios(part: NDArray[np.float64], whole: NDArray[np.float64], where: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return part / whole of the elements in `where`."""
    return part / whole if where.all() else part[where] / whole[where]


def codes_off(test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> dict[str, int] | None:
    """Return how many judged elements are how many codes off, or None unless both hold codes of one format.

    Keys are signed differences as text, ``-2``, ``0``, ``+1``, ascending; beyond ±16 they are collected in ``<=-16``,
    ``>=+16``.
    """
    if test.codes is None or reference.codes is None or test.top != reference.top:
        return None
    steps = np.clip((test.codes - reference.codes)[mask], -HISTOGRAM_BINS, HISTOGRAM_BINS)
    values, counts = np.unique(steps, return_counts=True)
    return {_step_name(int(value)): int(count) for value, count in zip(values, counts, strict=True)}


def _step_name(step: int) -> str:
    mark = {-HISTOGRAM_BINS: "<=", HISTOGRAM_BINS: ">="}.get(step, "")
    return f"{mark}{step:+d}" if step else "0"


def _ratio(part: float, whole: float) -> float:
    if whole == 0.0:
        return 0.0 if part == 0.0 else math.inf
    return part / whole
