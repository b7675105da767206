"""What a wrong picture may be: mirrored, swapped, scaled, or encoded twice.

Each guess undoes one mistake and asks whether the test then fits much better. A hint is a guess with both residuals in
its sentence, never part of the verdict; a reference that is symmetric under a guess gives none, for then it explains
nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from atmoref.compare.frame import Frame
from atmoref.images import srgb_decode, srgb_encode

BETTER = 0.2
"""A guess counts where the rms difference falls below this fraction of what it was."""
MOST_SAMPLES = 1 << 16
_KNOWN_FACTORS = {
    "pi": math.pi,
    "4 pi": 4.0 * math.pi,
    "2 pi": 2.0 * math.pi,
    "2": 2.0,
    "255": 255.0,
    "256/255": 256.0 / 255.0,
    "65535": 65535.0,
}


def find_hints(test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return the sentence of the best guess, or nothing if no guess explains at least four fifths of the difference."""
    plain = _rms(test.values - reference.values, mask)
    if plain == 0.0:
        return ()
    guesses = [*_turned(test, reference, mask), *_scaled(test, reference, mask), *_encoded(test, reference, mask)]
    told = [(residual, sentence) for residual, sentence in guesses if residual < BETTER * plain]
    if not told:
        return ()
    residual, sentence = min(told, key=lambda guess: guess[0])  # of equal ones the first: a flip before a turn
    return (f"{sentence}: undone, the rms difference is {residual:.3g} instead of {plain:.3g}",)


def _turned(test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> Iterator[tuple[float, str]]:
    """Yield guesses that move pixels or channels; the mask stays where the reference is."""
    values = test.values
    yield _rms(values[:, ::-1] - reference.values, mask), "the test seems mirrored left to right"
    yield _rms(values[::-1] - reference.values, mask), "the test seems upside down (y flipped)"
    yield _rms(values[::-1, ::-1] - reference.values, mask), "the test seems turned by 180 degrees"
    if test.names[:3] == ("R", "G", "B"):
        order = [2, 1, 0, *range(3, len(test.names))]
        yield _rms(values[..., order] - reference.values, mask), "red and blue seem swapped"


def _scaled(test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> Iterator[tuple[float, str]]:
    """Yield the guess of one factor: least squares over elements that a unorm store did not clip."""
    whole = np.broadcast_to(mask[..., np.newaxis], test.values.shape)
    free = whole & (test.values < 1.0) & (reference.values < 1.0) if _clips(test) or _clips(reference) else whole
    tested, expected = test.values[free], reference.values[free]
    square = float(np.sum(tested * tested))
    if square == 0.0 or expected.size < 2:
        return
    undo = float(np.sum(tested * expected)) / square
    if undo > 0.0 and abs(undo - 1.0) > 1e-4:
        residual = math.sqrt(float(np.mean(np.square(undo * tested - expected))))
        yield residual, f"the test seems to be {_factor_name(1.0 / undo)} times the reference"


def _encoded(test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> Iterator[tuple[float, str]]:
    """Yield guesses of a transfer function applied once too often or too seldom, for values within [0, 1]."""
    tested = test.values[mask]
    if tested.min() < 0.0 or tested.max() > 1.0:
        return
    step = max(1, tested.size // MOST_SAMPLES)  # the curve shows in a part of the pixels as well
    unit = tested.reshape(-1)[::step]
    expected = np.clip(reference.values[mask].reshape(-1)[::step], 0.0, 1.0)
    guesses = (
        (srgb_decode(unit), "the test seems sRGB-encoded while the reference is not"),
        (srgb_encode(unit), "the reference seems sRGB-encoded while the test is not"),
        (np.power(unit, 2.2), "the test seems encoded with gamma 2.2 while the reference is not"),
        (np.power(unit, 1.0 / 2.2), "the reference seems encoded with gamma 2.2 while the test is not"),
    )
    for undone, sentence in guesses:
        yield math.sqrt(float(np.mean(np.square(undone - expected)))), sentence


def _factor_name(factor: float) -> str:
    """Return the factor as text, with a well-known number's name where it lies within 0.1 %."""
    for name, known in _KNOWN_FACTORS.items():
        if abs(factor / known - 1.0) < 1e-3:
            return f"{factor:.5g} ({name})"
        if abs(factor * known - 1.0) < 1e-3:
            return f"{factor:.5g} (1/({name}))"
    return f"{factor:.5g}"


def _clips(frame: Frame) -> bool:
    return frame.codes is not None


def _rms(difference: NDArray[np.float64], mask: NDArray[np.bool_]) -> float:
    judged = difference if mask.all() else difference[mask]
    return math.sqrt(float(np.mean(np.square(judged))))
