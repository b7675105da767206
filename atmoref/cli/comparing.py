"""``atmoref compare``: two images and limits make a verdict."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from atmoref.cli.failures import NEGATIVE, RequestError

if TYPE_CHECKING:
    from atmoref.compare import Verdict
    from atmoref.images import Image

_REPORTS = (".json", ".txt")


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
    picture: Annotated[
        Path | None, typer.Option(metavar="F.png", help="Draw the difference: red too bright, blue too dark.")
    ] = None,
    report: Annotated[Path | None, typer.Option(metavar="F", help="Write the verdict to .json or .txt.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Judge TEST against REFERENCE; exit code 1 when a limit is not met.

    Without a limit the verdict is "measured" and the exit code 0.
    """
    from atmoref.cli.pictures import check_output
    from atmoref.compare import compare as judge
    from atmoref.compare import difference_image
    from atmoref.images import write

    check_output("--picture", picture)
    check_output("--report", report, _REPORTS)
    whole = codes is not None or bounds is not None
    images = [_read(path, layer, whole) for path in (test, reference)]
    limits = None if bounds is None else (_read_bound(bounds[0], "low", layer), _read_bound(bounds[1], "high", layer))
    judged = None if mask is None else _read(mask, None, False)
    verdict = judge(images[0], images[1], bounds=limits, codes=codes, abs=absolute, rel=relative, mask=judged)
    if picture is not None:
        write(picture, difference_image(images[0], images[1]))
    if report is not None:
        _write_report(report, verdict)
    typer.echo(_json(verdict) if as_json else verdict.table())
    if verdict.passed is False:
        raise typer.Exit(NEGATIVE)


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


def _write_report(path: Path, verdict: Verdict) -> None:
    from atmoref.store import atomic_path

    with atomic_path(path) as temporary:
        text = _json(verdict) if path.suffix.lower() == ".json" else verdict.table()
        temporary.write_text(text + "\n", encoding="utf-8")
