"""``atmoref check``: a build's dump, draw by draw; ``atmoref accept``: a new baseline and the size of its change."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from atmoref.cli.failures import NEGATIVE, RequestError
from atmoref.cli.rendering import Changes, TechniqueWord

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from atmoref.judge.check import CheckVerdict

REPORTS = (".html", ".json", ".xml", ".txt")


def check(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The dump: manifest.json and the files it lists.")],
    scene: Annotated[str, typer.Option(metavar="SCENE", help="The scene file, or bundled scene, that was drawn.")],
    technique: TechniqueWord = None,
    changes: Changes = None,
    mask: Annotated[Path | None, typer.Option(metavar="F", help="Judge only pixels that are not zero here.")] = None,
    ignore: Annotated[
        list[str] | None, typer.Option(metavar="X,Y,W,H", help="Leave out a rectangle; may be repeated.")
    ] = None,
    diagnose: Annotated[bool, typer.Option(help="Look for the cause of the first draws that fail.")] = True,
    report: Annotated[
        list[Path] | None, typer.Option(metavar="F", help="Write .html, .json, .xml (JUnit) or .txt; may be repeated.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Judge the buffers that a GPU build dumped, draw by draw, each on the build's own previous ones.

    Exit code 1 when a draw leaves its bounds: the first one is named, with the likely cause.
    """
    from atmoref.cli.pictures import check_output
    from atmoref.cli.progress import working
    from atmoref.cli.quick_start import load_numba_without_blas
    from atmoref.judge.dumps import open_dump
    from atmoref.scene import load_scene

    for path in report or ():
        check_output("--report", path, REPORTS)
    question = load_scene(scene, changes or ())
    open_dump(directory)  # what is wrong with it is said before anything is compiled
    size = (question.image.height, question.image.width)
    judged = judged_pixels(mask, ignore or (), size)
    load_numba_without_blas()
    from atmoref.judge.check import check as judge
    from atmoref.report import check_json, check_table

    with working(f"check {question.name}") as waiting:
        verdict = judge(directory, question, technique=technique, mask=judged, diagnosed=diagnose, progress=waiting)
    for path in report or ():
        _write(path, verdict)
    typer.echo(json.dumps(check_json(verdict), indent=1) if as_json else check_table(verdict))
    if not verdict.passed:
        raise typer.Exit(NEGATIVE)


def judged_pixels(mask: Path | None, ignore: Any, size: tuple[int, int]) -> NDArray[np.bool_] | None:
    """Return the judged pixels (H, W), or None for all: a mask image, less rectangles that are left out.

    Raises
    ------
    RequestError, ImageError, CompareError
    """
    if mask is None and not ignore:
        return None
    from atmoref.cli.words import parse_crop
    from atmoref.compare import CompareError
    from atmoref.compare.frame import plane_mask
    from atmoref.images import read

    judged = plane_mask(None if mask is None else read(mask), size)
    for text in ignore:
        rectangle = parse_crop(text)
        assert rectangle is not None
        x, y, w, h = rectangle
        if w < 1 or h < 1 or x < 0 or y < 0 or x + w > size[1] or y + h > size[0]:
            raise RequestError(f"--ignore: found {text}; allowed: inside {size[1]} x {size[0]} pixels, at least 1 x 1")
        judged[y : y + h, x : x + w] = False
    if not judged.any():
        raise CompareError("mask and ignored rectangles leave no pixel to judge")
    return judged


def _write(path: Path, verdict: CheckVerdict) -> None:
    from atmoref.report import check_json, check_table, junit_of_check, report_of_check
    from atmoref.store import atomic_path

    texts = {
        ".html": lambda: report_of_check(verdict), ".xml": lambda: junit_of_check(verdict),
        ".json": lambda: json.dumps(check_json(verdict), indent=1) + "\n", ".txt": lambda: check_table(verdict) + "\n",
    }  # fmt: skip
    with atomic_path(path) as temporary:
        temporary.write_text(texts[path.suffix.lower()](), encoding="utf-8")


def accept(
    test: Annotated[Path, typer.Argument(metavar="TEST", help="The image that becomes the baseline.")],
    baseline: Annotated[Path, typer.Argument(metavar="BASELINE", help="The image that it replaces; may be new.")],
    reason: Annotated[str, typer.Option(metavar="TEXT", help="Why; kept in the record.")],
) -> None:
    """Make TEST the new BASELINE; BASELINE.record.json keeps the size of every change, and why.

    Both must be of the same kind. The record is a list, the newest change last.
    """
    from atmoref.cli.pictures import check_output
    from atmoref.compare import compare
    from atmoref.images import READABLE, read
    from atmoref.store import atomic_path

    if not reason.strip():
        raise RequestError("--reason: found an empty text; allowed: why the baseline changes")
    if test.suffix.lower() != baseline.suffix.lower():
        raise RequestError(f"{test} and {baseline} are of different kinds; allowed: the same suffix")
    check_output("BASELINE", baseline, READABLE)
    image = read(test)
    record = baseline.with_name(baseline.name + ".record.json")
    entries = _records(record)
    told: dict[str, Any] = {"sha256": _digest(test), "reason": reason}
    if baseline.exists():
        verdict = compare(image, read(baseline), perceptual_metrics="none", allow_blank=True)
        found = verdict.to_dict()
        told |= {"replaces_sha256": _digest(baseline), "change": {
            key: found[key] for key in ("metrics", "codes_off", "worst", "peak", "pixels")}}  # fmt: skip
    with atomic_path(baseline) as temporary:
        shutil.copyfile(test, temporary)
    with atomic_path(record) as temporary:
        temporary.write_text(json.dumps([*entries, told], indent=1) + "\n", encoding="utf-8")
    size = told.get("change", {}).get("metrics", {}).get("max_abs")
    typer.echo(f"{baseline}: " + ("new" if size is None else f"replaced, largest change {size:.6g}"))


def _records(path: Path) -> list[Any]:
    if not path.exists():
        return []
    try:
        entries = json.loads(path.read_text("utf-8"))
    except ValueError as error:
        raise RequestError(f"{path}: no JSON ({error}); allowed: the record that this command wrote") from None
    if not isinstance(entries, list):
        raise RequestError(f"{path}: no list; allowed: the record that this command wrote")
    return entries


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
