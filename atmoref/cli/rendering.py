"""``atmoref render``: one image."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from atmoref.cli.failures import RequestError
from atmoref.cli.words import parse_crop, parse_size

if TYPE_CHECKING:
    from atmoref.cli.answering import Request
    from atmoref.scene import Result

SceneWord = Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a bundled scene.")]
Changes = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key of the scene; may be repeated.")
]
TechniqueWord = Annotated[str | None, typer.Option(metavar="T", help="Instead of the scene's own; or truth.")]
Threads = Annotated[
    int | None, typer.Option(metavar="N", min=1, max=1024, help="Default: all processors. Bits do not depend on it.")
]
MaxMemory = Annotated[
    str | None, typer.Option(metavar="SIZE", help="Refuse to grow beyond, e.g. 500MB. Default: half of what is free.")
]


def render(
    scene: SceneWord,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="F", help="Values: .exr, or .npz for float64; or .png.")
    ] = None,
    png: Annotated[
        Path | None, typer.Option(metavar="F", help="A picture: codes of a unorm frame as they are, else sRGB.")
    ] = None,
    technique: TechniqueWord = None,
    changes: Changes = None,
    crop: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Pixels to draw, row 0 at the top.")] = None,
    stages: Annotated[Path | None, typer.Option(metavar="DIR", help="Dump every stage into this directory.")] = None,
    stats: Annotated[
        Literal["json", "text"] | None, typer.Option(help="Print times, draws, samples, memory to stdout.")
    ] = None,
    threads: Threads = None,
    max_memory: MaxMemory = None,
    exposure: Annotated[float, typer.Option(metavar="X", help="Factor for the PNG of a frame without codes.")] = 1.0,
) -> None:
    """Render one image of SCENE.

    Without -o, --png, --stages and --stats the values go to NAME.exr and a picture to NAME.png.
    """
    from atmoref.cli import pictures
    from atmoref.cli.answering import Request, chosen_technique
    from atmoref.scene import load_scene

    rectangle, limit = parse_crop(crop), parse_size(max_memory)
    if not 0.0 < exposure < float("inf"):
        raise RequestError(f"--exposure: found {exposure}; allowed: a finite number above 0")
    question = load_scene(scene, changes or (), max_memory=limit)
    files = [path for path in (output, png) if path is not None]
    if not files and stages is None and stats is None:
        files = [Path(f"{question.name}.exr"), Path(f"{question.name}.png")]
    if output is not None and png is not None and output.absolute() == png.absolute():
        raise RequestError(f"-o and --png name the same file, {png}")
    pictures.check_output("-o", output)
    pictures.check_output("--png", png, (".png",))
    for path in files:
        pictures.check_output("-o", path)
    request = Request(question, chosen_technique(question, technique), rectangle, threads, limit)
    result = produce(request, stages)
    for path in files:
        pictures.write_result(path, result, exposure)
        typer.echo(f"wrote {path}", err=True)
    if stats is not None:
        print_stats(result, stats)


def produce(request: Request, stages: Path | None = None) -> Result:
    """Return the answer to a request, dumping its stages on the way where a directory is given."""
    from atmoref.cli.answering import answer
    from atmoref.cli.progress import working

    if stages is None:
        with working(request.scene.name) as waiting:
            return answer(request, waiting)
    from atmoref.cli.dumping import dumped

    with dumped(stages, request) as dump:
        with working(request.scene.name) as waiting:
            result = answer(request, waiting, dump.watch)
        dump.finish(result)
    typer.echo(f"wrote {len(dump.entries)} stages to {stages}", err=True)
    return result


def print_stats(result: Result, form: str) -> None:
    """Print what was done, as JSON or as lines."""
    stats: dict[str, Any] = {**result.stats, "provenance": result.provenance}
    from atmoref.techniques.render import peak_memory_mb

    stats["peak_memory_mb"] = peak_memory_mb()
    if form == "json":
        typer.echo(json.dumps(stats, indent=2, default=list))
        return
    for key, value in stats.items():
        typer.echo(f"{key:<26}{json.dumps(value, default=list) if isinstance(value, list | dict) else value}")
