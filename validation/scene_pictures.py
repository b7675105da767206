"""Make the pictures that bundled scenes name: stained glass, mountains, a slide.

Run as ``python validation/scene_pictures.py atmoref/scene/bundled``. Only + - * / and square roots, and raw bits of a
counter-like generator, so that pixels are the same on every machine.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Codes = NDArray[np.uint8]
GLASS: Codes = np.array(
    [[214, 40, 40], [24, 70, 200], [250, 190, 40], [20, 140, 80], [130, 40, 160], [240, 110, 30], [60, 170, 220]],
    np.uint8,
)  # sRGB
LANCETS, LANCET_WIDTH, LANCET_HEIGHT = 5, 128, 448  # in pixels, with the stone between them
PANE, LEAD, STONE = 32, 5, 14  # spacing of the leads, their width, half the stone between two lancets


def random_unit(seed: int, rows: int, columns: int) -> NDArray[np.float64]:
    """Return numbers in [0, 1) from a generator's raw bits, which no later version of NumPy may change."""
    raw = np.random.PCG64(seed).random_raw(rows * columns)
    return (np.asarray(raw, np.uint64) >> np.uint64(11)).astype(np.float64).reshape(rows, columns) / 2.0**53


def stained_glass() -> Codes:
    """Return lancet windows side by side (H, W, 3): coloured panes in diagonal leads, a border, stone between them."""
    return np.concatenate([_lancet(index) for index in range(LANCETS)], axis=1)


def _lancet(index: int) -> Codes:
    rows, columns = np.mgrid[0:LANCET_HEIGHT, 0:LANCET_WIDTH]
    x = np.abs(columns + 0.5 - LANCET_WIDTH / 2)
    y = LANCET_HEIGHT - STONE - (rows + 0.5)  # above the sill
    half = LANCET_WIDTH / 2 - STONE
    spring = LANCET_HEIGHT - 2 * STONE - half * np.sqrt(3.0)  # an equilateral pointed arch stands on it
    arch = 2.0 * half - np.sqrt((x + half) ** 2 + np.maximum(y - spring, 0.0) ** 2)
    inside = np.minimum(np.minimum(half - x, arch), y)  # pixels from the stone
    along, across = (columns + rows) // PANE, (columns - rows + 64 * PANE) // PANE
    kinds = (random_unit(7 + index, 64, 128) * len(GLASS)).astype(np.int64)
    codes = GLASS[kinds[along % 64, across % 128]]
    lead = ((columns + rows) % PANE < LEAD) | ((columns - rows) % PANE < LEAD)
    border = inside < 14.0
    codes = np.where(border[..., None], GLASS[(index * 2 + 1) % len(GLASS)], codes)
    lead = np.where(border, (rows % (2 * PANE)) < LEAD, lead) | (np.abs(inside - 14.0) < LEAD / 2)
    medallion = np.sqrt((columns + 0.5 - LANCET_WIDTH / 2) ** 2 + (y - 0.62 * spring) ** 2)
    codes = np.where((medallion < 34.0)[..., None], GLASS[(index * 3) % len(GLASS)], codes)
    lead = np.where(medallion < 34.0, np.abs(medallion - 18.0) < LEAD / 2, lead) | (np.abs(medallion - 34.0) < LEAD / 2)
    codes[lead | (inside < 0.0)] = 0
    return codes.astype(np.uint8)


def mountains(size: int = 257) -> NDArray[np.uint16]:
    """Return heights (H, W), 65535 the highest: a valley in front (last row), a ridge with passes behind it."""
    at = np.arange(size) / (size - 1.0)
    x, z = at[None, :], 1.0 - at[:, None]  # row 0 is the far edge
    heights = np.zeros((size, size))
    weight = 1.0
    for octave in range(6):
        noise = _value_noise(31 + octave, 6 * 2**octave, x + 0.0 * z, z + 0.0 * x)
        heights = heights + weight * (1.0 - np.abs(2.0 * noise - 1.0)) ** 2
        weight *= 0.46
    ridge = 1.0 / (1.0 + ((z - 0.45) / 0.14) ** 2)
    peaks = [(0.49, 0.045, 0.75), (0.33, 0.05, 0.5), (0.66, 0.045, 0.58), (0.16, 0.06, 0.55), (0.85, 0.06, 0.6)]
    crest = sum(h / (1.0 + ((x - c) / w) ** 2) for c, w, h in peaks)
    shape = ridge * (0.16 + crest) * (0.55 + 0.4 * heights) + 0.06 * heights * np.minimum(z / 0.25, 1.0)
    low, high = float(shape.min()), float(shape.max())
    return np.rint((shape - low) / (high - low) * 65535.0).astype(np.uint16)[::-1]


def _value_noise(seed: int, cells: int, x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    lattice = random_unit(seed, cells + 2, cells + 2)
    col, row = np.floor(x * cells).astype(np.int64), np.floor(z * cells).astype(np.int64)
    s, t = x * cells - col, z * cells - row
    s, t = s * s * (3.0 - 2.0 * s), t * t * (3.0 - 2.0 * t)
    near = lattice[row, col] * (1.0 - s) + lattice[row, col + 1] * s
    far = lattice[row + 1, col] * (1.0 - s) + lattice[row + 1, col + 1] * s
    return np.asarray(near * (1.0 - t) + far * t)


def slide() -> Codes:
    """Return a slide (128, 192, 3) that no reflection or turn leaves the same: an F, a disc, a ramp, four grounds."""
    rows, columns = np.mgrid[0:128, 0:192]
    codes = np.empty((128, 192, 3), np.uint8)
    top, left = rows < 64, columns < 96
    for chosen, colour in (
        (top & left, (200, 60, 40)), (top & ~left, (240, 200, 60)), (~top & left, (30, 90, 190)),
        (~top & ~left, (40, 150, 90)),
    ):  # fmt: skip
        codes[chosen] = colour
    letter = (columns >= 30) & (columns < 44) & (rows >= 20) & (rows < 108)
    letter |= (columns >= 30) & (columns < 84) & (rows >= 20) & (rows < 34)
    letter |= (columns >= 30) & (columns < 70) & (rows >= 56) & (rows < 70)
    codes[letter] = (255, 255, 255)
    codes[np.sqrt((columns - 145.0) ** 2 + (rows - 34.0) ** 2) < 20.0] = (20, 20, 20)
    ramp = (rows >= 96) & (rows < 112) & (columns >= 104) & (columns < 184)
    codes[ramp] = ((columns[ramp] - 104) // 10 * 36)[:, None].astype(np.uint8)
    codes[(rows < 4) | (rows >= 124) | (columns < 4) | (columns >= 188)] = 0
    return codes


PICTURES = {"fig9b_window.png": stained_glass, "fig10a_mountains.png": mountains, "slide_picture.png": slide}


def main(arguments: list[str]) -> int:
    """Write the pictures into a folder; return the exit code."""
    if len(arguments) != 1:
        print("usage: scene_pictures.py TARGET_DIRECTORY", file=sys.stderr)
        return 2
    for name, make in PICTURES.items():
        Image.fromarray(make()).save(Path(arguments[0]) / name, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
