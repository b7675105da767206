"""What is compared: two images brought to the same channels, or refused with a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.images import Image, ImageError, from_rgb, srgb_decode
from atmoref.images.image import COLOUR_ORDER, first_not_finite


class CompareError(ValueError):
    """Two images, or a limit, that cannot be compared; the message says why."""


@dataclass(frozen=True, slots=True)
class Frame:
    """An image as numbers: values (H, W, C), and codes with their top where it holds codes of one unorm format."""

    names: tuple[str, ...]
    values: NDArray[np.float64]
    codes: NDArray[np.int64] | None
    top: int | None
    transfer: str

    @property
    def shown(self) -> bool:
        """Whether the values are what a display shows, instead of linear radiance."""
        return self.codes is not None or self.transfer in ("srgb", "codes")


def pair(test: Image | ArrayLike, reference: Image | ArrayLike) -> tuple[Frame, Frame, tuple[str, ...]]:
    """Return both as frames with the same channels in the same order, and notes on what was done to them.

    Raises
    ------
    CompareError
        If size or channels differ, or if one has NaN or infinity.
    """
    left, right = _image(test, "test"), _image(reference, "reference")
    if left.shape != right.shape:
        raise CompareError(
            f"sizes differ: the test is {left.shape[1]} x {left.shape[0]} pixels, "
            f"the reference {right.shape[1]} x {right.shape[0]}"
        )
    names = _order(left)
    if set(names) != set(right.channels):
        raise CompareError(
            f"channels differ: the test has {', '.join(names)}, the reference {', '.join(_order(right))}; "
            "choose the ones to compare"
        )
    first, second = _frame(left, names), _frame(right, names)
    notes: list[str] = []
    if {first.transfer, second.transfer} == {"srgb", "linear"}:
        what = "test" if first.transfer == "srgb" else "reference"
        notes.append(f"the {what} states that it is sRGB-encoded and was decoded to linear")
        first, second = _linear(first), _linear(second)
    return first, second, tuple(notes)


def plane_mask(mask: Image | ArrayLike | None, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the judged pixels as (H, W) of bool: True where `mask` is not zero, everywhere without a mask.

    Raises
    ------
    CompareError
        If the mask has another size, more than one channel, or judges nothing.
    """
    if mask is None:
        return np.ones(shape, np.bool_)
    planes = list(mask.channels.values()) if isinstance(mask, Image) else [np.asarray(mask)]
    if len(planes) != 1 or planes[0].shape != shape:
        raise CompareError(
            f"the mask must be one plane of {shape[1]} x {shape[0]} pixels, "
            f"found {len(planes)} of shape {planes[0].shape}"
        )
    judged: NDArray[np.bool_] = np.not_equal(planes[0], 0)
    if not judged.any():
        raise CompareError("the mask leaves no pixel to compare")
    return judged


def refuse_blank(test: Frame, reference: Frame, mask: NDArray[np.bool_]) -> None:
    """Refuse a test of one colour where the reference is a picture: nothing was drawn, or the wrong buffer was read."""
    first = np.unravel_index(int(mask.argmax()), mask.shape)

    def blank(values: NDArray[np.float64]) -> bool:
        return bool(np.all((values == values[first]).all(-1) | ~mask))

    if blank(test.values) and not blank(reference.values):
        colour = ", ".join(f"{value:.6g}" for value in test.values[first])
        raise CompareError(f"the test is blank ({colour} in every pixel) while the reference is not")


def _image(source: Image | ArrayLike, what: str) -> Image:
    try:
        image = source if isinstance(source, Image) else from_rgb(source)
    except ImageError as error:
        raise CompareError(f"the {what} is no image: {error}") from error
    problem = first_not_finite(image)
    if problem:
        raise CompareError(f"the {what} has {problem}")
    return image


def _order(image: Image) -> tuple[str, ...]:
    """Return the channel names, colours first in their usual order."""
    colours = [name for name in COLOUR_ORDER if name in image.channels]
    return (*colours, *(name for name in image.channels if name not in colours))


def _frame(image: Image, names: tuple[str, ...]) -> Frame:
    values = np.stack([image.values(name) for name in names], axis=-1)
    tops = {image.top(name) for name in names}
    top = tops.pop() if len(tops) == 1 else None
    codes: NDArray[Any] | None = None
    if top is not None:
        codes = np.stack([image.channels[name] for name in names], axis=-1).astype(np.int64)
        if codes.max() > top:
            stated = image.attributes.get("format")
            raise CompareError(f"code {codes.max()} is beyond {top}, the largest of format {stated}")
    fallback = "linear" if top is None else "unstated"
    return Frame(names, values, codes, top, str(image.attributes.get("transfer", fallback)))


def _linear(frame: Frame) -> Frame:
    if frame.transfer != "srgb":
        return frame
    colours = [at for at, name in enumerate(frame.names) if name.rpartition(".")[2] != "A"]
    values = frame.values.copy()
    values[..., colours] = srgb_decode(values[..., colours])
    return Frame(frame.names, values, None, None, "linear")
