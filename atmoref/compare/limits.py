"""Limits: what an error may be, and where it is more."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.compare.frame import CompareError, Frame, pair
from atmoref.compare.metrics import Place, place_of_worst
from atmoref.images import Image

Bounds = tuple[Image | ArrayLike, Image | ArrayLike]


@dataclass(frozen=True, slots=True)
class Limit:
    """One limit and how it went: elements outside, their fraction of the judged ones, and the one that is furthest out.

    `excess` is how far that one lies beyond the limit: in codes for ``codes`` and for bounds of codes, else in values.
    """

    name: str
    outside: int
    fraction: float
    worst: Place | None
    excess: float

    @property
    def passed(self) -> bool:
        """Whether no judged element is outside."""
        return self.outside == 0


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of one comparison as asked for; none given means that the images are only measured.

    Parameters
    ----------
    bounds : pair of images, optional
        Lowest and highest allowed test, both included.
    codes : int, optional
        Codes that a test may be off; both images must hold codes of one format.
    abs, rel : float, optional
        Largest allowed |d|, and |d| as a fraction of |reference|. With both, an element has to meet one of
        them.
    """

    bounds: Bounds | None = None
    codes: int | None = None
    abs: float | None = None
    rel: float | None = None

    def __post_init__(self) -> None:
        for name in ("codes", "abs", "rel"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise CompareError(f"the limit {name} must be zero or more and finite, not {value}")
        if self.codes is not None and int(self.codes) != self.codes:
            raise CompareError(f"the limit codes must be a whole number, not {self.codes}")


def judge(limits: Limits, test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> tuple[Limit, ...]:
    """Return the outcome of each limit that was asked for."""
    outcomes = []
    for name, excess in _excesses(limits, test, reference):
        beyond = (excess > 0.0) & mask[..., np.newaxis]
        count = int(beyond.sum())
        worst = place_of_worst(excess, test, reference, mask) if count else None
        furthest = float(excess[beyond].max()) if count else 0.0
        outcomes.append(Limit(name, count, count / (int(mask.sum()) * len(test.names)), worst, furthest))
    return tuple(outcomes)


def outside(limits: Limits, test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the judged pixels (H, W) that break one of the limits in one of their channels."""
    beyond = np.zeros(mask.shape, np.bool_)
    for _, excess in _excesses(limits, test, reference):
        beyond |= (excess > 0.0).any(-1) & mask
    return beyond


def _excesses(limits: Limits, test: Frame, reference: Frame) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield each limit's name and how far every element lies beyond it (positive is outside)."""
    size = np.abs(test.values - reference.values)
    if limits.bounds is not None:
        yield "within the bounds", _beyond_bounds(limits.bounds, test)
    if limits.codes is not None:
        if test.codes is None or reference.codes is None or test.top != reference.top:
            raise CompareError(
                "a limit in codes needs codes of one unorm format on both sides, "
                f"found {_told(test)} in the test and {_told(reference)} in the reference"
            )
        yield f"codes off <= {limits.codes}", np.abs(test.codes - reference.codes).astype(np.float64) - limits.codes
    if limits.abs is not None and limits.rel is not None:
        allowed = np.maximum(limits.abs, limits.rel * np.abs(reference.values))
        yield f"|d| <= {limits.abs:g} or |d| <= {limits.rel:g} |reference|", size - allowed
    elif limits.abs is not None:
        yield f"|d| <= {limits.abs:g}", size - limits.abs
    elif limits.rel is not None:
        yield f"|d| <= {limits.rel:g} |reference|", size - limits.rel * np.abs(reference.values)


def _beyond_bounds(bounds: Bounds, test: Frame) -> NDArray[np.float64]:
    low, high, _ = pair(*bounds)
    if low.values.shape != test.values.shape or set(low.names) != set(test.names):
        raise CompareError(
            f"the bounds have shape {low.values.shape} and channels {', '.join(low.names)}, "
            f"the test {test.values.shape} and {', '.join(test.names)}"
        )
    if np.any(low.values > high.values):
        row, column, _ = (int(at) for at in np.argwhere(low.values > high.values)[0])
        raise CompareError(f"the lower bound is above the upper one at x = {column}, y = {row}")
    order = [low.names.index(name) for name in test.names]
    here: NDArray[Any] = test.values
    lowest: NDArray[Any] = low.values
    highest: NDArray[Any] = high.values
    if test.codes is not None and low.codes is not None and high.codes is not None and test.top == low.top == high.top:
        here, lowest, highest = (
            test.codes,
            low.codes,
            high.codes,
        )  # whole numbers: equal codes are equal, whatever the top
    beyond: NDArray[np.float64] = np.maximum(lowest[..., order] - here, here - highest[..., order]).astype(np.float64)
    return beyond


def _told(frame: Frame) -> str:
    return "values" if frame.top is None else f"codes up to {frame.top}"
