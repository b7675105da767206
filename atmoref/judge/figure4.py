"""The reconstruction of Figure 4 of Dobashi, Yamamoto, Nishita 2002, measured: pictures, differences, a contact sheet.

(a) 40 planes: ghost shadows.  (b) 160 planes: pseudo-contours, and a quarter of the beam black.  (c) the paper's fix.
(c') the same 8-bit buffers with our corrections: the apex keeps its light.  (d) the truth.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.compare import difference_image
from atmoref.images import from_rgb, write
from atmoref.judge.ladder import errors
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene, load_scene
from atmoref.store import atomic_path
from atmoref.techniques.render import render
from atmoref.truth import solve

PANELS = (
    ("a", "fig4a", (), "(a) 40 planes"),
    ("b", "fig4b", (), "(b) 160 planes"),
    ("c", "fig4c", (), "(c) 23 + 174"),
    ("c_corrected", "fig4c", ('technique.preset="corrected"',), "(c') corrected"),
)
CLOSE_UP = (slice(290, 410), slice(90, 210))  # rows, columns: the shadow of the sphere
FAINT, BRIGHT = 0.004, 0.6  # beam radiance between which a pixel ought to be neither black nor saturated
SCALE = 0.1  # of the difference pictures


@dataclass(frozen=True, slots=True)
class Panel:
    """One picture of the figure and its figures of merit."""

    key: str
    title: str
    image: NDArray[np.float64]
    measured: dict[str, float]
    stats: dict[str, Any]
    provenance: dict[str, Any]


def black_fraction(beam: NDArray[np.float64], drawn: NDArray[np.float64]) -> float:
    """Return the share of pixels whose true beam lies between 0.004 and 0.6 and to which no draw added anything.

    Parameters
    ----------
    beam : (H, W, 3) array
        True radiance of the beam alone.
    drawn : (H, W, 3) array
        What the planes added to the frame.
    """
    ought = (beam > FAINT) & (beam < BRIGHT)
    return float((drawn[ought] == 0.0).mean()) if ought.any() else 0.0


def panel(key: str, scene: Scene, title: str, truth: NDArray[np.float64], beam: NDArray[np.float64]) -> Panel:
    """Return one mirror of the figure, measured against the truth; the frame before the first plane is kept aside."""
    before: dict[str, NDArray[np.float64]] = {}

    def watch(name: str, p: Pass, bank: Bank) -> None:
        if name.endswith("opaque"):
            before["frame"] = bank["frame"].values()

    result = render(scene, watch=watch)
    measured = errors(result.image, truth)
    near = errors(result.image[CLOSE_UP], truth[CLOSE_UP])
    measured["close_up_sum_ratio"] = near["sum_ratio"]
    measured["black_fraction"] = black_fraction(beam, result.image - before["frame"])
    return Panel(key, title, result.image, measured, result.stats, result.provenance)


def table(panels: list[Panel]) -> str:
    """Return the measured errors as text."""
    head = "mean|d| %  sum|d|/sum %  mean rel %  close-up sum %  black beam %"
    lines = [f"{'panel':16} {'planes':>10}  {head}"]
    for p in panels:
        m, light = p.measured, p.stats["lights"][0]
        planes = f"{light['main_planes']}/{light['sub_planes']}"
        lines.append(
            f"{p.title:16} {planes:>10}  {100 * m['mean']:9.3f}  {100 * m['sum_ratio']:12.3f}  "
            f"{100 * m['mean_relative']:10.3f}  {100 * m['close_up_sum_ratio']:14.3f}  "
            f"{100 * m['black_fraction']:12.2f}"
        )
    return "\n".join(lines)


def contact_sheet(panels: list[Panel], truth: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return (H, W, 3) codes: each picture as the frame holds it, its close-up, its difference from the truth."""
    clipped = np.clip(truth, 0.0, 1.0)
    shown = [(p.title, np.clip(p.image, 0.0, 1.0)) for p in panels] + [("(d) truth", clipped)]
    columns = []
    for title, image in shown:
        codes = np.rint(image * 255.0).astype(np.uint8)
        near = np.repeat(np.repeat(codes[CLOSE_UP], 2, 0), 2, 1)
        wide = np.zeros((near.shape[0], image.shape[1], 3), np.uint8)
        left = (image.shape[1] - near.shape[1]) // 2
        wide[:, left : left + near.shape[1]] = near
        rgb = difference_image(image, clipped, scale=SCALE).rgb()
        columns.append(np.concatenate([_label(title, image.shape[1]), codes, wide, rgb.astype(np.uint8)]))
    gap = np.full((columns[0].shape[0], 6, 3), 64, np.uint8)
    parts = [part for column in columns for part in (column, gap)][:-1]
    return np.concatenate(parts, axis=1)


def _label(text: str, width: int) -> NDArray[np.uint8]:
    """Return a strip with a line of text."""
    from PIL import Image as Pillow
    from PIL import ImageDraw, ImageFont

    strip = Pillow.new("RGB", (width, 26), (64, 64, 64))
    ImageDraw.Draw(strip).text((8, 4), text, fill=(255, 255, 255), font=ImageFont.load_default(15))
    return np.asarray(strip, np.uint8)


def figure4(directory: str | Path, progress: Callable[[str], None] | None = None) -> str:
    """Render the figure into a directory and return the table of measured errors.

    Writes `fig4a`, `fig4b`, `fig4c`, `fig4c_corrected`, `fig4d` as EXR and PNG, the differences of each from the truth
    as EXR (signed) and PNG (red too bright, blue too dark, saturated at 0.1), `figure4.png` and `figure4.json`.

    Parameters
    ----------
    directory : path
        Made if missing.
    progress : callable (what is rendered now) or None

    Raises
    ------
    OSError
        If the directory cannot be written.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    tell = progress or (lambda name: None)
    tell("(d) truth")
    question = load_scene("fig4d")
    answer = solve(question)
    beam: NDArray[np.float64] = answer.buffers["beam"]
    panels = []
    for key, name, overrides, title in PANELS:
        tell(title)
        panels.append(panel(key, load_scene(name, overrides), title, answer.image, beam))
    tell("writing pictures")
    clipped = np.clip(answer.image, 0.0, 1.0)
    for p in panels:
        _write_panel(folder, f"fig4{p.key}", p, clipped)
    write(folder / "fig4d.exr", from_rgb(answer.image, {"content": "truth"}))
    write(folder / "fig4d.png", from_rgb(np.rint(clipped * 255.0).astype(np.uint8), {"format": "unorm8"}))
    sheet = from_rgb(contact_sheet(panels, answer.image), {"transfer": "srgb"})
    write(folder / "figure4.png", sheet)
    text = table(panels)
    record = {p.key: {**p.measured, "planes": p.stats["lights"][0]["main_planes"]} for p in panels}
    with atomic_path(folder / "figure4.json") as path:
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return text


def _write_panel(folder: Path, stem: str, p: Panel, clipped: NDArray[np.float64]) -> None:
    attributes = {k: v for k, v in p.provenance.items() if isinstance(v, str | int | float)}
    difference = np.clip(p.image, 0.0, 1.0) - clipped
    codes = np.rint(np.clip(p.image, 0.0, 1.0) * 255.0).astype(np.uint8)
    write(folder / f"{stem}.exr", from_rgb(p.image, attributes))
    write(folder / f"{stem}.png", from_rgb(codes, {**attributes, "format": "unorm8"}))
    write(folder / f"{stem}_minus_truth.exr", from_rgb(difference, {**attributes, "content": "mirror - truth"}))
    write(folder / f"{stem}_minus_truth.png", difference_image(p.image, clipped, scale=SCALE))


__all__ = ["CLOSE_UP", "Panel", "black_fraction", "contact_sheet", "figure4", "panel", "table"]
