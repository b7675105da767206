"""Why a draw left its bounds: each hypothesis is a mistake made on purpose, asked whether it gives the build's bits.

The mirror draws the same group of draws again from the build's own previous buffers, with another rule of the device,
another texture, other uniforms or another reading of the paper.  A hypothesis explains a draw when it takes away most
of the difference; the verdict names the best ones with what they leave over.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.device import Device, Rounding
from atmoref.buffers.formats import FORMATS, Format, decode, encode
from atmoref.judge.plan import Group, Plan, Stored
from atmoref.scene import Scene

STORAGE = "storage format"
ROUNDING = "rounding"
FILTER = "filter precision"
HALF_TEXEL = "off by half a texel"
ORDER = "blend order"
BLEND = "wrong blend function"
SHADOW = "shadow bias/compare"
PLANES = "missing sub-planes"
FORMULA = "wrong formula"
FLIP = "y-flip"
GAMMA = "gamma"
KINDS = (STORAGE, ROUNDING, FILTER, HALF_TEXEL, ORDER, BLEND, SHADOW, PLANES, FORMULA, FLIP, GAMMA)

EXPLAINS = 0.35
"""A hypothesis counts where the rms difference falls below this fraction of what it was."""
SMALL_SHARE = 0.02
"""An unexplained difference of less than this share of what was drawn is laid to a read, not to a formula."""
FINE_STEPS = 2.0
"""An unexplained difference of at most so many codes (steps of a float format) is said to be rounding."""


@dataclass(frozen=True, slots=True)
class Found:
    """One buffer that left its bounds, and all that is needed to draw it again."""

    draw: str
    buffer: str
    format: Format
    expected: Format
    group: Group
    before: Stored
    build: NDArray[Any]
    mirror: NDArray[Any]
    judged: NDArray[np.bool_]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def values(self, texels: NDArray[Any]) -> NDArray[np.float64]:
        """Return values of what the mirror stored."""
        return decode(texels, self.expected)

    @property
    def build_values(self) -> NDArray[np.float64]:
        """Values of what the build stored, by its own format."""
        return decode(self.build, self.format)

    def previous(self) -> NDArray[np.float64] | None:
        """Return the values that the buffer had before, or None for a texture."""
        return self.values(self.before[self.buffer]) if self.buffer in self.before else None


@dataclass(frozen=True, slots=True)
class Explanation:
    """A cause: its class, what the mirror did to get there, and the share of the rms difference that it leaves."""

    kind: str
    sentence: str
    left: float

    def __str__(self) -> str:
        return f"{self.kind}: {self.sentence} (leaves {self.left:.1%} of the difference)"


@dataclass(frozen=True, slots=True)
class Guess:
    """What the buffer would hold, as values (H, W, C), if a mistake had been made."""

    kind: str
    sentence: str
    values: NDArray[np.float64]


def diagnose(scene: Scene, plan: Plan, found: Found) -> tuple[Explanation, ...]:
    """Return explanations of a draw that left its bounds, best first; at least one.

    The plan's buffers, passes and textures are the same afterwards.
    """
    from atmoref.judge.hypotheses import guesses

    if found.format.name != found.expected.name:
        told = f"the manifest says {found.format.name} where the scene asks for {found.expected.name}"
        return (Explanation(STORAGE, told, 0.0),)
    plain = _rms(found.build_values - found.values(found.mirror), found.judged)
    told_by: list[Explanation] = []
    for guess in _all(scene, plan, found, guesses):
        if guess.values.shape != found.build.shape:
            continue
        left = _rms(guess.values - found.build_values, found.judged) / plain if plain > 0.0 else 1.0
        if left < EXPLAINS:
            told_by.append(Explanation(guess.kind, guess.sentence, left))
    told_by += _coarser(found, plain)
    told_by.sort(key=lambda told: round(told.left, 3))  # of equal ones the first
    best: dict[str, Explanation] = {}
    for one in told_by:
        best.setdefault(one.kind, one)
    return tuple(best.values()) or (_unexplained(found),)


def combined(told: Sequence[tuple[Explanation, ...]]) -> Explanation | None:
    """Return the cause that explains most of several draws: they are taken to have one cause; of equals the first.

    Where several causes explain the first draw (a small one, often), the others decide between them.
    """
    scores: dict[str, float] = {}
    for explanations in told:
        for one in explanations:
            if one.left < EXPLAINS:
                scores[one.kind] = scores.get(one.kind, 0.0) + 1.0 - one.left
    if not scores:
        return told[0][0] if told else None
    most = max(scores.values())
    kind = next(kind for kind, score in scores.items() if score > most - 0.02)
    every = [one for explanations in told for one in explanations if one.kind == kind and one.left < EXPLAINS]
    return min(every, key=lambda one: round(one.left, 3))


def _all(scene: Scene, plan: Plan, found: Found, guesses: Any) -> Iterator[Guess]:
    """Yield all guesses and put the plan back as it was."""
    after = {name: plan.stored(name) for name in plan.bank}
    bank, passes = dict(plan.bank), list(plan.passes)
    try:
        yield from whole_buffer(found)
        yield from guesses(scene, plan, found)
        yield from _factor(found)
    finally:
        plan.bank.clear()
        plan.bank.update(bank)
        plan.passes[:] = passes
        plan.put(after)
        if found.group and found.buffer.rpartition("/")[2] != "shadow_map":
            plan.upload()


def _unexplained(found: Found) -> Explanation:
    """Return what is left to say, by size: a step or two is rounding, a small part of what was drawn is a read's."""
    mirror = found.values(found.mirror)
    difference = np.abs(found.build_values - mirror) * found.judged[..., None]
    worst, peak = float(difference.max()), float(np.abs(mirror).max())
    if found.expected.kind == "unorm":
        steps = worst * found.expected.top
    else:
        steps = (
            float((difference / np.maximum(np.abs(mirror), 0.01 * peak + 1e-300)).max())
            * 2.0 ** found.expected.mantissa()
        )
    if steps <= FINE_STEPS + 1e-6:
        return Explanation(ROUNDING, f"no single rule of a device explains it; at most {steps:.3g} steps apart", 1.0)
    before = found.previous()
    drawn = mirror if before is None or not found.buffer.endswith("frame") else mirror - before
    share = _rms(difference, found.judged) / max(_rms(drawn, found.judged), 1e-300)
    if share < SMALL_SHARE:
        told = f"no hypothesis explains it, but it is {share:.2%} of what was drawn: a read, or its coordinates"
        return Explanation(FILTER, told, 1.0)
    told = f"no hypothesis explains it; it is {share:.2%} of what was drawn, so it would be there in float, too"
    return Explanation(FORMULA, told, 1.0)


def _coarser(found: Found, plain: float) -> list[Explanation]:
    """Return the explanation by a coarser format, if rounding what the mirror stored to it goes towards the build."""
    name = coarser_format(found)
    if not name:
        return []
    fmt, left = FORMATS[name], 1.0
    roundings: tuple[Rounding, ...] = ("nearest_even", "truncate")
    for rounding in roundings:
        device = Device("supposed", rounding=rounding, float_rounding=rounding)
        rounded = decode(encode(found.values(found.mirror), fmt, device), fmt)
        left = min(left, _rms(rounded - found.build_values, found.judged) / plain)
    told = f"every value is one of {name}, not of {found.expected.name} alone"
    return [Explanation(STORAGE, told, min(left, 0.5 * EXPLAINS))] if left < 1.0 else []


def coarser_format(found: Found) -> str:
    """Return a coarser format that holds every value of the build and not the mirror's, or an empty text."""
    names = {
        "unorm16": ("unorm8", "unorm10", "unorm12"), "float16": ("unorm8",), "unorm10": ("unorm8",),
        "unorm12": ("unorm8",),
        "float32": ("unorm8", "unorm10", "unorm12", "unorm16", "float16", "r11g11b10f"), "depth24": ("unorm16",),
    }.get(found.expected.name, ())  # fmt: skip
    build, mirror = found.build_values[found.judged], found.values(found.mirror)[found.judged]
    for name in names:
        fmt = FORMATS[name]
        if _share_in(build, fmt, found.expected) > 0.999 and _share_in(mirror, fmt, found.expected) < 0.9:
            return name
    return ""


def _share_in(values: NDArray[np.float64], fmt: Format, held_in: Format) -> float:
    """Return the fraction of values between 0 and 1 that a format has, as far as `held_in` can tell."""
    some = values[(values > 0.0) & (values < 1.0)]
    if some.size < 16:
        return 0.0
    if fmt.kind == "unorm":
        own = 0.5 / held_in.top if held_in.kind == "unorm" else some * 2.0 ** -held_in.mantissa()
        return float((np.abs(np.rint(some * fmt.top) / fmt.top - some) <= own * 1.01).mean())
    mantissa, exponent = np.frexp(some)
    scaled = mantissa * 2.0 ** (fmt.mantissa() + 1)
    return float(((scaled == np.rint(scaled)) | (exponent < fmt.least_exponent)).mean())


def whole_buffer(found: Found) -> Iterator[Guess]:
    """Yield guesses that need no drawing: turned pictures and transfer functions."""
    from atmoref.images import srgb_decode, srgb_encode

    mirror, before = found.values(found.mirror), found.previous()
    yield Guess(FLIP, "the buffer is upside down", mirror[::-1])
    yield Guess(FLIP, "the buffer is mirrored left to right", mirror[:, ::-1])
    if before is None:
        return
    unit = np.clip(mirror, 0.0, 1.0)
    if found.buffer.rpartition("/")[2] not in ("depth", "shadow_map"):
        yield Guess(GAMMA, "the store is sRGB-encoded", srgb_encode(unit))
        yield Guess(GAMMA, "the store is encoded with gamma 2.2", np.power(unit, 1.0 / 2.2))
        drawn = mirror - before
        linear = srgb_decode(np.clip(before, 0.0, 1.0))
        yield Guess(GAMMA, "the target is sRGB: decoded, blended, encoded", srgb_encode(np.clip(linear + drawn, 0, 1)))
        yield Guess(GAMMA, "the source is sRGB-encoded before the blend", before + srgb_encode(np.clip(drawn, 0, 1)))
        yield Guess(GAMMA, "the source is sRGB-decoded before the blend", before + srgb_decode(np.clip(drawn, 0, 1)))


def _factor(found: Found) -> Iterator[Guess]:
    """Yield the guess of one factor on what was drawn, by least squares over what the format did not clip.

    The last of all: other mistakes that come to a factor say more.
    """
    before = found.previous()
    if before is None or found.buffer.rpartition("/")[2] in ("depth", "shadow_map"):
        return
    drawn = found.values(found.mirror) - before
    got = found.build_values - before
    free = found.judged[..., None] & (found.build_values < 1.0 if found.expected.kind == "unorm" else True)
    free = np.broadcast_to(free, got.shape)
    square = float(np.sum(drawn[free] ** 2))
    if square <= 0.0:
        return
    factor = float(np.sum(got[free] * drawn[free])) / square
    if math.isfinite(factor) and abs(factor - 1.0) > 1e-3 and abs(factor) > 1e-3:
        scaled = before + factor * drawn
        if found.expected.kind == "unorm":
            scaled = np.clip(scaled, 0.0, 1.0)
        draws = sum(last - first for _, first, last in found.group)
        known = f", the number of draws: 1/{draws} is missing" if draws > 1 and abs(factor / draws - 1.0) < 0.1 else ""
        yield Guess(FORMULA, f"what is drawn is {factor:.5g} times too strong{known}", scaled)


def _rms(difference: NDArray[np.float64], judged: NDArray[np.bool_]) -> float:
    return math.sqrt(float(np.mean(np.square(difference if judged.all() else difference[judged]))))
