"""``atmoref compare``: two images and limits make a verdict."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from atmoref.cli.failures import NEGATIVE, RequestError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from atmoref.compare import Limits, Verdict
    from atmoref.images import Image

_REPORTS = (".html", ".json", ".xml", ".txt")


def compare(
    test: Annotated[Path, typer.Argument(metavar="TEST", help="The image that is judged.")],
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="The image that is right.")],
    bounds: Annotated[
        tuple[Path, Path] | None,
        typer.Option(
            metavar="LO HI", help="Images of the least and greatest allowed test, or twice the file of atmoref bounds."
        ),
    ] = None,
    codes: Annotated[int | None, typer.Option(metavar="N", help="Codes that the test may be off.")] = None,
    absolute: Annotated[float | None, typer.Option("--abs", metavar="X", help="Greatest allowed |d|.")] = None,
    relative: Annotated[
        float | None, typer.Option("--rel", metavar="X", help="Greatest allowed |d| / |reference|; with --abs, either.")
    ] = None,
    mask: Annotated[Path | None, typer.Option(metavar="F", help="Judge only pixels that are not zero here.")] = None,
    layer: Annotated[
        str | None, typer.Option(metavar="NAME", help='Compare this layer of EXR files; "" is the base layer.')
    ] = None,
    channels: Annotated[
        str | None, typer.Option(metavar="A,B,C", help="Compare these channels of both files, in this order.")
    ] = None,
    transfer: Annotated[
        Literal["linear", "srgb", "codes"] | None,
        typer.Option(help="State how TEST's values are encoded, where its file does not."),
    ] = None,
    ignore: Annotated[
        list[str] | None, typer.Option(metavar="X,Y,W,H", help="Leave out a rectangle; may be repeated.")
    ] = None,
    peak: Annotated[float | None, typer.Option(metavar="X", help="Peak of PSNR; default: 1, or the maximum.")] = None,
    perceptual: Annotated[
        Literal["auto", "all", "none"], typer.Option(help="SSIM and FLIP; all: HDR-FLIP as well, which takes longer.")
    ] = "auto",
    picture: Annotated[
        Path | None, typer.Option(metavar="F.png", help="Draw the difference: red too bright, blue too dark.")
    ] = None,
    report: Annotated[
        list[Path] | None, typer.Option(metavar="F", help="Write .html, .json, .xml (JUnit) or .txt; may be repeated.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Judge TEST against REFERENCE; exit code 1 when a limit is not met.

    Without a limit the verdict is "measured" and the exit code 0.
    """
    from atmoref.cli.checking import judged_pixels
    from atmoref.cli.pictures import check_output
    from atmoref.compare import Limits, difference_image
    from atmoref.compare import compare as judge
    from atmoref.images import Image, write

    check_output("--picture", picture)
    for path in report or ():
        check_output("--report", path, _REPORTS)
    whole = codes is not None or bounds is not None
    images = [_chosen(_read(path, layer, whole), path, channels) for path in (test, reference)]
    if transfer is not None:
        images[0] = Image(images[0].channels, {**images[0].attributes, "transfer": transfer})
    limits = None
    if bounds is not None:
        ends = [_read_bound(path, end, layer) for path, end in zip(bounds, ("low", "high"), strict=True)]
        low, high = (_chosen(image, path, channels) for image, path in zip(ends, bounds, strict=True))
        limits = low, high
    judged = judged_pixels(mask, ignore or (), images[1].shape)
    asked = Limits(limits, codes, absolute, relative)
    verdict = judge(
        images[0], images[1], bounds=limits, codes=codes, abs=absolute, rel=relative, mask=judged, peak=peak,
        perceptual_metrics=perceptual,
    )  # fmt: skip
    if picture is not None:
        write(picture, difference_image(images[0], images[1]))
    for path in report or ():
        _write_report(path, images, verdict, asked, judged, f"{test.name} against {reference.name}")
    typer.echo(_json(verdict) if as_json else verdict.table())
    if verdict.passed is False:
        raise typer.Exit(NEGATIVE)


def _chosen(image: Image, path: Path, channels: str | None) -> Image:
    """Return the channels that were asked for, under the names of colours, so that both files have the same.

    Raises
    ------
    RequestError
        The file lacks one, or there are more than four.
    """
    from atmoref.images import Image

    if channels is None:
        return image
    names = [name.strip() for name in channels.split(",")]
    if not 1 <= len(names) <= 4 or len(set(names)) != len(names):
        raise RequestError(f"--channels: found {channels[:80]!r}; allowed: one to four different names")
    for name in names:
        if name not in image.channels:
            raise RequestError(f"--channels: {path} has no {name!r}; allowed: {', '.join(list(image.channels)[:24])}")
    colours = {1: ("Y",), 2: ("Y", "A"), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}[len(names)]
    return Image({new: image.channels[old] for new, old in zip(colours, names, strict=True)}, image.attributes)


def _read(path: Path, layer: str | None, codes: bool) -> Image:
    """Return an image, or one layer of it; the base layer where there are others and none is named."""
    from atmoref.images import ImageError, read

    image = read(path)
    if layer is None and len(image.layers()) > 1 and "" in image.layers():
        layer = ""
    if layer is not None:
        try:
            image = image.layer(layer)
        except ImageError as error:
            raise RequestError(f"{path}: {error}") from None
    return _with_codes(image) if codes else image


def _read_bound(path: Path, end: str, layer: str | None) -> Image:
    """Return one of two bounds: the layer low or high of a file that has it."""
    from atmoref.images import read

    return _read(path, end if end in read(path).layers() else layer, True)


def _with_codes(image: Image) -> Image:
    """Return an image of a unorm format with its codes; values of an EXR identify them, being codes over their top."""
    import numpy as np

    from atmoref.images import Image

    stated = re.fullmatch(r"unorm([0-9]{1,2})", str(image.attributes.get("format", "")))
    if stated is None or any(plane.dtype.kind == "u" for plane in image.channels.values()):
        return image
    top = (1 << int(stated[1])) - 1
    scaled = {name: plane.astype(np.float64) * top for name, plane in image.channels.items()}
    if any(not np.all(np.abs(plane - np.rint(plane)) < 1e-2) or plane.min() < -0.5 for plane in scaled.values()):
        return image
    return Image({name: np.rint(plane).astype(np.uint16) for name, plane in scaled.items()}, image.attributes)


def _json(verdict: Verdict) -> str:
    return json.dumps(verdict.to_dict(), indent=2)


def _write_report(
    path: Path, images: list[Image], verdict: Verdict, limits: Limits, judged: NDArray[np.bool_] | None, title: str
) -> None:
    from atmoref.store import atomic_path

    kind = path.suffix.lower()
    if kind == ".html":
        from atmoref.report.html import report_of_compare

        text = report_of_compare(images[0], images[1], verdict, limits, judged, title)
    elif kind == ".xml":
        from atmoref.report.junit import junit_of_compare

        text = junit_of_compare(verdict, title)
    else:
        text = (_json(verdict) if kind == ".json" else verdict.table()) + "\n"
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
