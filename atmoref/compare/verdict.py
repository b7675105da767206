"""Two images and limits make a verdict."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from atmoref.compare.frame import CompareError, pair, plane_mask, refuse_blank
from atmoref.compare.hints import find_hints
from atmoref.compare.limits import Bounds, Limit, Limits, judge
from atmoref.compare.metrics import Place, channels_first, codes_off, default_peak, norms, place_of_worst
from atmoref.compare.perceptual import Perceptual, perceptual
from atmoref.images import Image


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a comparison found.

    `passed` is True or False against the limits, and None ("measured") where there was none. `metrics` are those of
    `metrics.norms` and `perceptual.perceptual` over all judged elements, `per_channel` the same for each channel;
    `worst` is the place of the largest absolute difference.
    """

    passed: bool | None
    limits: tuple[Limit, ...]
    metrics: dict[str, float]
    per_channel: dict[str, dict[str, float]]
    worst: Place
    codes_off: dict[str, int] | None
    peak: float
    judged_pixels: int
    pixels: int
    notes: tuple[str, ...]
    hints: tuple[str, ...]

    def __bool__(self) -> bool:
        raise TypeError("a verdict is not a truth value: ask .passed, which is None where there was no limit")

    @property
    def word(self) -> str:
        """The verdict in one word: passed, failed or measured."""
        return {True: "passed", False: "failed", None: "measured"}[self.passed]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values for JSON; numbers that JSON lacks (an infinite PSNR) are texts."""
        plain: dict[str, Any] = _plain({"verdict": self.word, **asdict(self)})
        for limit, outcome in zip(plain["limits"], self.limits, strict=True):
            limit["passed"] = outcome.passed
        return plain

    def table(self) -> str:
        """Return the verdict as text of some twenty lines."""
        lines = [f"verdict      {self.word}"]
        for limit in self.limits:
            lines.append(f"limit        {limit.name}: {'met' if limit.passed else 'not met'}")
            if limit.worst is not None:
                share = f"{limit.outside} outside ({limit.fraction:.4%})"
                lines.append(f"             {share}, by up to {limit.excess:.6g}")
                lines.append(f"             furthest at {limit.worst}")
        lines.append(f"worst        {self.metrics['max_abs']:.6g} at {self.worst}")
        if self.codes_off is not None:
            lines.append("codes off    " + ", ".join(f"{step}: {count}" for step, count in self.codes_off.items()))
        if self.judged_pixels < self.pixels:
            lines.append(f"mask         {self.judged_pixels} of {self.pixels} pixels judged")
        lines.append(f"peak         {self.peak:.6g}")
        columns = {"all": self.metrics, **(self.per_channel if len(self.per_channel) > 1 else {})}
        names = list(self.metrics)
        width = max(len(name) for name in names) + 2
        lines.append(" " * width + "".join(f"{title:>14}" for title in columns))
        for name in names:
            cells = "".join(f"{column[name]:>14.6g}" if name in column else " " * 14 for column in columns.values())
            lines.append((f"{name:<{width}}" + cells).rstrip())
        lines += [f"note         {note}" for note in self.notes]
        lines += [f"hint         {hint}" for hint in self.hints]
        return "\n".join(lines)


def compare(
    test: Image | ArrayLike,
    reference: Image | ArrayLike,
    *,
    bounds: Bounds | None = None,
    codes: int | None = None,
    abs: float | None = None,
    rel: float | None = None,
    mask: Image | ArrayLike | None = None,
    peak: float | None = None,
    perceptual_metrics: Perceptual = "auto",
    allow_blank: bool = False,
) -> Verdict:
    """Return the verdict on `test` against `reference`.

    Parameters
    ----------
    test, reference : Image or array
        Images of equal size and channels; arrays are (H, W) or (H, W, 1 to 4), row 0 at the top. Unsigned integers are
        codes.
    bounds, codes, abs, rel
        Limits, see `Limits`; with none the verdict is "measured". All that are given must be met, at every judged
        element.
    mask : Image or array, optional
        (H, W), not zero where pixels are judged.
    peak : float, optional
        Peak of PSNR and data range of SSIM; by default 1 where both images lie in [0, 1], else the reference's maximum.
    perceptual_metrics : {"auto", "all", "none"}
        SSIM and FLIP; see `perceptual.perceptual`.
    allow_blank : bool
        Take a test of a single colour where the reference is a picture.

    Raises
    ------
    CompareError
        With a sentence: sizes or channels differ, NaN or infinity, a blank test, limits that do not apply.
    """
    left, right, notes = pair(test, reference)
    judged = plane_mask(mask, (left.values.shape[0], left.values.shape[1]))
    limits = Limits(bounds, codes, abs, rel)
    if not allow_blank:
        refuse_blank(left, right, judged)
    outcomes = judge(limits, left, right, judged)
    passed = all(outcome.passed for outcome in outcomes) if outcomes else None
    tested, expected = channels_first(left.values, judged), channels_first(right.values, judged)
    top = default_peak(tested, expected) if peak is None else _checked_peak(peak)
    seen, similarity, told = perceptual(left, right, judged, top, perceptual_metrics)
    per_channel = {name: norms(tested[at], expected[at], top) for at, name in enumerate(left.names)}
    for name, value in similarity.items():
        per_channel[name]["ssim"] = value
    return Verdict(
        passed=passed,
        limits=outcomes,
        metrics=norms(tested, expected, top) | seen,
        per_channel=per_channel,
        worst=place_of_worst(np.abs(left.values - right.values), left, right, judged),
        codes_off=codes_off(left, right, judged),
        peak=top,
        judged_pixels=int(judged.sum()),
        pixels=judged.size,
        notes=(*notes, *told),
        hints=() if passed else find_hints(left, right, judged),
    )


def _checked_peak(peak: float) -> float:
    if not (math.isfinite(peak) and peak > 0.0):
        raise CompareError(f"the peak must be positive and finite, not {peak}")
    return float(peak)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
