"""How different two pictures look: SSIM (scikit-image) and FLIP (flip-evaluator)."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from atmoref.compare.frame import Frame
from atmoref.images import srgb_encode

Perceptual = Literal["auto", "all", "none"]
SSIM_WINDOW = 11
MOST_EXPOSURES = 8.0
_LUMINANCE = (0.2126, 0.7152, 0.0722)
_ACES = (0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14)


def perceptual(
    test: Frame, reference: Frame, mask: NDArray[np.bool_], peak: float, which: Perceptual
) -> tuple[dict[str, float], dict[str, float], list[str]]:
    """Return the measures, SSIM per channel, and notes on what was fed to them.

    ``ssim``: Gaussian window of 11 pixels (sigma 1.5), data range `peak`, mean over judged pixels and channels.
    ``flip``: LDR-FLIP of what a display shows: codes as they are, linear values sRGB-encoded, clipped where they stay
    in [0, 1] and tone-mapped (ACES, the brightest pixel near white) where they leave it.
    ``hdr_flip``: of linear values, ACES, the worst of many exposures, each of which takes as long as all the rest;
    with "all" alone.
    """
    measures: dict[str, float] = {}
    channels: dict[str, float] = {}
    notes: list[str] = []
    if which == "none":
        return measures, channels, notes
    if min(mask.shape) >= SSIM_WINDOW:
        per_channel = ssim(test.values, reference.values, mask, peak)
        channels = dict(zip(test.names, per_channel, strict=True))
        measures["ssim"] = sum(per_channel) / len(per_channel)
    else:
        notes.append(f"no SSIM: the image is smaller than its window of {SSIM_WINDOW} pixels")
    left, right = _colours(test), _colours(reference)
    if left is None or right is None:
        notes.append("no FLIP: the channels are no colours")
        return measures, channels, notes
    shown = test.shown or reference.shown
    if shown:
        measures["flip"] = ldr_flip(left, right, mask)
        notes.append("FLIP of the codes as shown")
        return measures, channels, notes
    leaves = bool(max(left[mask].max(), right[mask].max()) > 1.0)
    exposures = flip_exposures(right) if leaves or which == "all" else None
    if leaves and exposures is not None:
        toned = [tone_mapped(colours, exposures[0]) for colours in (left, right)]
        notes.append(f"FLIP of the values at exposure {exposures[0]:+.3f} (powers of 2), ACES, sRGB-encoded")
    else:
        toned = [_unit(left), _unit(right)]
        notes.append("FLIP of the values clipped to [0, 1] and sRGB-encoded")
    measures["flip"] = ldr_flip(srgb_encode(toned[0]), srgb_encode(toned[1]), mask)
    if which == "all" and exposures is None:
        notes.append("no HDR-FLIP: the reference is black")
    elif which == "all" and exposures is not None:
        measures["hdr_flip"] = hdr_flip(left, right, exposures, mask)
        notes.append(f"HDR-FLIP from exposure {exposures[0]:+.3f} to {exposures[1]:+.3f} (powers of 2), ACES")
    return measures, channels, notes


def ssim(
    test: NDArray[np.float64], reference: NDArray[np.float64], mask: NDArray[np.bool_], peak: float
) -> list[float]:
    """Return the structural similarity of each channel of (H, W, C), averaged over judged pixels.

    Source: Wang et al. 2004: Gaussian weights of sigma 1.5, population covariance, K1 = .01, K2 = .03.
    """
    from skimage.metrics import structural_similarity

    def mean(channel: int) -> float:
        _, local = structural_similarity(
            np.ascontiguousarray(reference[..., channel]),
            np.ascontiguousarray(test[..., channel]),
            data_range=peak,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
            full=True,
        )
        return float(local[mask].mean())

    with ThreadPoolExecutor() as pool:  # filters let go of the interpreter
        return list(pool.map(mean, range(reference.shape[2])))


def ldr_flip(test: NDArray[np.float64], reference: NDArray[np.float64], mask: NDArray[np.bool_]) -> float:
    """Return LDR-FLIP (67 pixels per degree) of sRGB-encoded colours (H, W, 3), averaged over judged pixels."""
    import flip_evaluator

    left, right = (np.ascontiguousarray(_unit(image), np.float32) for image in (test, reference))
    local = flip_evaluator.evaluate(right, left, "LDR", applyMagma=False, computeMeanError=False)[0]
    return float(local[..., 0][mask].mean(dtype=np.float64))


def hdr_flip(
    test: NDArray[np.float64],
    reference: NDArray[np.float64],
    exposures: tuple[float, float],
    mask: NDArray[np.bool_],
) -> float:
    """Return HDR-FLIP (ACES, 67 pixels per degree) of linear colours (H, W, 3), averaged over judged pixels."""
    import flip_evaluator

    left, right = (np.ascontiguousarray(np.maximum(image, 0.0), np.float32) for image in (test, reference))
    stated = {"startExposure": exposures[0], "stopExposure": exposures[1]}
    local = flip_evaluator.evaluate(right, left, "HDR", applyMagma=False, computeMeanError=False, parameters=stated)[0]
    return float(local[..., 0][mask].mean(dtype=np.float64))


def tone_mapped(colours: NDArray[np.float64], exposure: float) -> NDArray[np.float64]:
    """Return linear colours after the ACES curve that HDR-FLIP uses, at an exposure in powers of 2."""
    a, b, c, d, e, f = _ACES
    x = np.clip(colours * 2.0**exposure, 0.0, 1e6)  # white long before
    return _unit((x * (a * x + b) + c) / (x * (d * x + e) + f))


def flip_exposures(reference: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return the first and last exposure of HDR-FLIP in powers of 2, or None where the reference is black.

    They bring the brightest pixel, and the median one, to .85 of the tone mapper's white. The library takes the median
    over all pixels, which a black background drives to dozens of exposures (and a black image ends the process); here
    it is taken over pixels that are not black, and no more than 8 powers above the first.
    """
    luminance = np.maximum(reference, 0.0) @ np.array(_LUMINANCE)
    bright = np.sort(luminance[luminance > 0.0])
    if bright.size == 0:
        return None
    a, b, c = (_ACES[at] - 0.85 * _ACES[at + 3] for at in range(3))
    white = (-b + math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    start = math.log2(white / float(bright[-1]))
    stop = math.log2(white / float(bright[bright.size // 2]))
    return start, min(max(stop, start), start + MOST_EXPOSURES)


def _colours(frame: Frame) -> NDArray[np.float64] | None:
    """Return (H, W, 3): the colours, or three times the one channel; None where there are neither."""
    if len(frame.names) >= 3 and frame.names[:3] == ("R", "G", "B"):
        return frame.values[..., :3]
    return np.repeat(frame.values, 3, axis=-1) if len(frame.names) == 1 else None


def _unit(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.clip(values, 0.0, 1.0)
