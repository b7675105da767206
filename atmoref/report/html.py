"""One self-contained page for a verdict: pictures to flip through and zoom, a histogram, the table."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.compare import Verdict
from atmoref.compare.frame import Frame, pair, plane_mask
from atmoref.compare.limits import Limits, outside
from atmoref.compare.metrics import HISTOGRAM_BINS
from atmoref.compare.picture import diverging_colours, round_scale
from atmoref.images import Image, srgb_encode
from atmoref.report.plain import check_table

if TYPE_CHECKING:
    from atmoref.judge.check import CheckVerdict  # its room compiles kernels

MOST_PIXELS = 1 << 19
"""A picture of more pixels is shown with every n-th row and column, and the page says so: pages stay below 5 MB."""
RED, GREY = (214, 40, 40), 0.35


@dataclass(frozen=True, slots=True)
class Panel:
    """One picture of a view: sRGB codes (H, W, 3), row 0 at the top."""

    title: str
    colours: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class View:
    """Pictures of one size that are flipped through, with what is said below them."""

    title: str
    panels: tuple[Panel, ...]
    text: str = ""
    histogram: tuple[tuple[str, int], ...] = ()


def page(title: str, word: str, text: str, views: Sequence[View]) -> str:
    """Return an HTML page that needs no other file and no network.

    Parameters
    ----------
    title, word, text : str
        Heading, verdict in a word, and the table as plain text.
    views : sequence of View
    """
    place = resources.files("atmoref.report")
    style, script = (place.joinpath(name).read_text("utf-8") for name in ("page.css", "page.js"))
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>"
        f"<title>{html.escape(title)}: {html.escape(word)}</title><link rel='icon' href='data:,'>"
        f"<style>{style}</style></head>\n<body><h1>{html.escape(title)} "
        f"<span class='{html.escape(word)}'>{html.escape(word)}</span></h1>\n<pre>{html.escape(text)}</pre>\n"
        + "".join(_view(view) for view in views)
        + f"<script>{script}</script></body></html>\n"
    )


def _view(view: View) -> str:
    step = 1
    if view.panels:
        height, width = view.panels[0].colours.shape[:2]
        while (height // step) * (width // step) > MOST_PIXELS:
            step += 1
    note = f"<p>Shown: every {step}th row and column.</p>" if step > 1 else ""
    pictures = "".join(
        f"<img alt='{html.escape(p.title)}' title='{html.escape(p.title)}' src='{_data(p.colours[::step, ::step])}'>"
        for p in view.panels
    )
    last = max(len(view.panels) - 1, 0)
    titles = "".join(
        f"<button type='button' data-at='{i}'>{html.escape(p.title)}</button>" for i, p in enumerate(view.panels)
    )
    tools = (
        f"<div class='tools'>{titles}<label>flip <input class='flip' type='range' min='0' max='{last}' step='0.01' "
        "value='0'></label><label>zoom <input class='zoom' type='range' min='1' max='16' step='1' value='1'></label>"
        "<output></output></div>"
    )
    shown = f"{tools}<div class='frame'><div class='stack'>{pictures}</div></div>" if pictures else ""
    return (
        f"<section><h2>{html.escape(view.title)}</h2>{note}{shown}{_histogram(view.histogram)}"
        f"<pre>{html.escape(view.text)}</pre></section>\n"
    )


def _data(colours: NDArray[np.uint8]) -> str:
    from PIL import Image as Picture

    stream = io.BytesIO()
    Picture.fromarray(np.ascontiguousarray(colours)).save(stream, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def _histogram(bars: Sequence[tuple[str, int]]) -> str:
    """Return a bar for each bin; heights are logarithmic, so that a few wrong pixels are seen."""
    if not bars:
        return ""
    most = max(np.log1p(count) for _, count in bars) or 1.0
    width = 640 / len(bars)
    drawn = "".join(
        f"<g><title>{html.escape(label)}: {count}</title><rect x='{i * width:.1f}' width='{width * 0.9:.1f}' "
        f"y='{100 - 96 * np.log1p(count) / most:.1f}' height='{96 * np.log1p(count) / most:.1f}'/>"
        f"<text x='{(i + 0.45) * width:.1f}' y='113'>{html.escape(label)}</text></g>"
        for i, (label, count) in enumerate(bars)
    )
    caption = "<figcaption>elements by difference (log)</figcaption>"
    return f"<figure><svg viewBox='0 0 640 118'>{drawn}</svg>{caption}</figure>"


def report_of_compare(
    test: Image | ArrayLike, reference: Image | ArrayLike, verdict: Verdict, limits: Limits | None = None,
    mask: Image | ArrayLike | None = None, title: str = "compare",
) -> str:  # fmt: skip
    """Return the page of one comparison: reference, test, difference, and where limits are broken."""
    left, right, _ = pair(test, reference)
    judged = plane_mask(mask, (left.values.shape[0], left.values.shape[1]))
    beyond = outside(limits, left, right, judged) if limits is not None else None
    scale = 1.0 / max(verdict.peak, 1e-30) if not right.shown else 1.0
    view = View(
        "Pictures", _panels(_shown(right, scale), _shown(left, scale), left.values - right.values, beyond),
        histogram=_bins(left, right, verdict, judged),
    )  # fmt: skip
    return page(title, verdict.word, verdict.table(), [view])


def _panels(
    reference: NDArray[np.uint8], test: NDArray[np.uint8], difference: NDArray[np.float64],
    beyond: NDArray[np.bool_] | None,
) -> tuple[Panel, ...]:  # fmt: skip
    most = np.argmax(np.abs(difference), axis=-1)
    signed = np.take_along_axis(difference, most[..., None], -1)[..., 0]
    scale = round_scale(float(np.abs(signed).max()))
    panels = [
        Panel("reference", reference), Panel("test", test),
        Panel(f"test - reference, ±{scale:g}", diverging_colours(signed / scale)),
    ]  # fmt: skip
    if beyond is not None:
        grey = np.repeat((reference.mean(-1, keepdims=True) * GREY).astype(np.uint8), 3, -1)
        panels.append(Panel("outside the interval (red)", np.where(beyond[..., None], np.array(RED, np.uint8), grey)))
    return tuple(panels)


def _shown(frame: Frame, scale: float) -> NDArray[np.uint8]:
    """Return sRGB codes of a frame: codes as they are, linear values over the peak and sRGB-encoded."""
    colours = frame.values[..., :3] if frame.values.shape[-1] >= 3 else np.repeat(frame.values[..., :1], 3, -1)
    unit = np.clip(colours * scale, 0.0, 1.0)
    return np.rint((unit if frame.shown else srgb_encode(unit)) * 255.0).astype(np.uint8)


def _bins(left: Frame, right: Frame, verdict: Verdict, judged: NDArray[np.bool_]) -> tuple[tuple[str, int], ...]:
    if verdict.codes_off is not None:
        return tuple(verdict.codes_off.items())
    size = np.abs(left.values - right.values)[judged].ravel()
    worst = float(size.max())
    if worst == 0.0:
        return (("0", size.size),)
    counts, edges = np.histogram(size, bins=HISTOGRAM_BINS, range=(0.0, worst))
    return tuple((f"{edge:.1e}", int(count)) for edge, count in zip(edges[:-1], counts, strict=True))


def report_of_check(verdict: CheckVerdict) -> str:
    """Return the page of a check: the table, and the pictures of the first draws that failed."""
    views = []
    for draw in verdict.draws:
        if draw.name in verdict.pictures:
            build, mirror, low, high = (a.astype(np.float64) for a in verdict.pictures[draw.name])
            peak = max(float(mirror.max()), float(build.max()), 1e-30)
            beyond = np.asarray(((build < low) | (build > high)).any(-1))
            reference, test = (_grey(np.clip(a / peak, 0.0, 1.0)) for a in (mirror, build))
            told = "\n".join([str(draw.worst), *map(str, draw.explanations)])
            title = f"{draw.name}, {draw.format}, shown over its peak {peak:.6g}"
            views.append(View(title, _panels(reference, test, build - mirror, beyond), told))
    word = "passed" if verdict.passed else "failed"
    return page(f"check of {verdict.scene}", word, check_table(verdict), views)


def _grey(unit: NDArray[np.float64]) -> NDArray[np.uint8]:
    three = unit if unit.shape[-1] == 3 else np.repeat(unit[..., :1], 3, -1)
    return np.rint(srgb_encode(three) * 255.0).astype(np.uint8)
