"""Pictures of a difference."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.compare.frame import CompareError, pair
from atmoref.images import Image, from_rgb

# sRGB colours from -1 to 1: dark blue, blue, light blue, white, light red, red, dark red; safe for the colour-blind
_STOPS = np.array(
    [[5, 48, 97], [67, 147, 195], [209, 229, 240], [255, 255, 255], [253, 219, 199], [214, 96, 77], [103, 0, 31]],
    np.float64,
)


def difference_image(test: Image | ArrayLike, reference: Image | ArrayLike, *, scale: float | None = None) -> Image:
    """Return ``test - reference`` in colours: white where equal, red where the test is too bright, blue where too dark.

    Of each pixel the channel that differs most is shown. Colours saturate at ±`scale`; by default the smallest 1, 2 or
    5 times a power of ten that is not below the largest difference. Attribute ``scale`` states it, ``worst`` the
    largest difference.

    Raises
    ------
    CompareError
        If the images cannot be compared, or the scale is not positive.
    """
    left, right, _ = pair(test, reference)
    difference = left.values - right.values
    most = np.argmax(np.abs(difference), axis=-1)
    signed = np.take_along_axis(difference, most[..., np.newaxis], axis=-1)[..., 0]
    worst = float(np.abs(signed).max())
    used = round_scale(worst) if scale is None else scale
    if not (math.isfinite(used) and used > 0.0):
        raise CompareError(f"the scale of a difference picture must be positive and finite, not {used}")
    attributes: dict[str, str | float | int] = {
        "content": "test - reference, channel of largest difference; red positive, blue negative",
        "scale": float(used),
        "worst": worst,
        "transfer": "srgb",
    }
    return from_rgb(diverging_colours(signed / used), attributes)


def amplified_image(test: Image | ArrayLike, reference: Image | ArrayLike, *, factor: float) -> Image:
    """Return ``1/2 + factor (test - reference)`` of each channel as 8-bit codes, clipped; grey is equal."""
    left, right, _ = pair(test, reference)
    if not math.isfinite(factor):
        raise CompareError(f"the factor of an amplified difference must be finite, not {factor}")
    codes = np.floor(np.clip(0.5 + factor * (left.values - right.values), 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
    attributes: dict[str, str | float | int] = {
        "content": "1/2 + factor (test - reference)",
        "factor": float(factor),
        "transfer": "codes",
    }
    return Image({name: np.ascontiguousarray(codes[..., at]) for at, name in enumerate(left.names)}, attributes)


def round_scale(worst: float) -> float:
    """Return the smallest 1, 2 or 5 times a power of ten that is not below `worst`; 1 for no difference."""
    if worst <= 0.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(worst))
    return next((step * decade for step in (1.0, 2.0, 5.0) if step * decade >= worst), 10.0 * decade)


def diverging_colours(signed: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return sRGB codes (H, W, 3) of values in [-1, 1]: blue, white at 0, red; clipped beyond, linear in between."""
    position = (np.clip(signed, -1.0, 1.0) + 1.0) * 0.5 * (len(_STOPS) - 1)
    colours = np.stack([np.interp(position, np.arange(len(_STOPS)), _STOPS[:, at]) for at in range(3)], axis=-1)
    return np.floor(colours + 0.5).astype(np.uint8)
