"""Cut the pictures of the documentation out of what ``make demo`` wrote.

Run as ``python validation/docs_pictures.py out/demo docs/images``. Pixels are taken as they are: the sheet's upper rows
(grey pictures, stored with one channel), its differences, enlarged apexes, and the pictures of Figures 9 and 10.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

LABEL, HEIGHT, CLOSE_UP = 26, 450, 240  # rows of the contact sheet: title, picture, close-up
APEX = (slice(124, 214), slice(105, 195))  # rows, columns of a picture: the beam near the light


def grey(codes: np.ndarray) -> Image.Image:
    """Return a picture with equal channels as one channel."""
    if not (codes == codes[..., :1]).all():
        raise ValueError("the picture is not grey")
    return Image.fromarray(codes[..., 0])


def figure4(demo: Path, target: Path) -> None:
    """Write panels with close-ups, and, apart and at half size, their differences from the truth."""
    sheet = np.asarray(Image.open(demo / "figure4.png").convert("RGB"))
    panels = LABEL + HEIGHT + CLOSE_UP
    grey(sheet[:panels]).save(target / "figure4.png", optimize=True)
    differences = np.concatenate([sheet[:LABEL], sheet[panels:]])[:, : 4 * 306 - 6]
    half = Image.fromarray(differences).resize(
        (differences.shape[1] // 2, differences.shape[0] // 2), Image.Resampling.BOX
    )
    half.quantize(128).save(target / "figure4_differences.png", optimize=True)


def apexes(demo: Path, target: Path) -> None:
    """Write the apex of (c), (c') and (d) side by side, three times as large."""
    shown = []
    for stem in ("fig4c", "fig4c_corrected", "fig4d"):
        codes = np.asarray(Image.open(demo / f"{stem}.png").convert("RGB"))[APEX]
        shown += [np.repeat(np.repeat(codes, 3, 0), 3, 1), np.full((270, 6, 3), 64, np.uint8)]
    grey(np.concatenate(shown[:-1], axis=1)).save(target / "apex.png", optimize=True)


def gallery(demo: Path, target: Path) -> None:
    """Write the pictures of Figures 9 (a), 9 (b), 10 (a) and of the slide, each in a tile of 360 x 240."""
    sheet = Image.new("RGB", (726, 486), (64, 64, 64))
    for place, stem in enumerate(("fig9a", "fig9b", "fig10a_shafts", "slide")):
        picture = Image.open(demo / f"{stem}.png").convert("RGB").resize((360, 240), Image.Resampling.BOX)
        sheet.paste(picture, (366 * (place % 2), 246 * (place // 2)))
    sheet.quantize(200).save(target / "figures_9_10.png", optimize=True)


def main(arguments: list[str]) -> int:
    """Cut the pictures; return the exit code."""
    if len(arguments) != 2:
        print("usage: docs_pictures.py DEMO_DIRECTORY TARGET_DIRECTORY", file=sys.stderr)
        return 2
    demo, target = Path(arguments[0]), Path(arguments[1])
    target.mkdir(parents=True, exist_ok=True)
    figure4(demo, target)
    apexes(demo, target)
    gallery(demo, target)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
