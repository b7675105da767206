"""``atmoref budget``, ``atmoref chart`` and ``atmoref demo``: where errors come from, and the pictures that show it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from atmoref.cli.failures import RequestError
from atmoref.cli.rendering import Changes, SceneWord, Threads


def budget(
    scene: SceneWord,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Write the images of every rung here.")
    ] = None,
    changes: Changes = None,
    threads: Threads = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Print what each step from the analysis to the paper's 8 bits costs, one switch at a time."""
    from atmoref.cli.progress import working
    from atmoref.scene import load_scene

    question = load_scene(scene, changes or ())
    if output is not None:
        make_directory(output)
    from atmoref.judge.ladder import ladder

    with working(f"budget of {question.name}") as waiting:
        rungs = ladder(question, threads=threads, progress=waiting)
    if output is not None:
        rungs.write(output)
        typer.echo(f"wrote {output}", err=True)
    typer.echo(json.dumps(rungs.to_dict(), indent=2) if as_json else rungs.table())


def chart(
    scene: SceneWord,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="A .png, .svg or .pdf file.")],
    changes: Changes = None,
) -> None:
    """Draw how bright the slabs of each light are and how many sub-planes they get, against the distance (Figure 5)."""
    from atmoref.cli.pictures import check_output
    from atmoref.judge.chart import SUFFIXES, write_chart
    from atmoref.scene import load_scene

    check_output("-o", output, SUFFIXES)
    for index, each in enumerate(write_chart(load_scene(scene, changes or ()), output)):
        typer.echo(f"light {index}: {len(each.sub_planes)} main planes, {sum(each.sub_planes)} sub-planes")
        typer.echo("  m_k " + " ".join(map(str, each.sub_planes)))
    typer.echo(f"wrote {output}", err=True)


def demo(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where pictures and EXR files go.")
    ] = Path("out/demo"),
) -> None:
    """Render the bundled scenes and Figure 4 of Dobashi 2002 with its contact sheet, and print the measured errors."""
    from atmoref.cli.answering import Request, chosen_technique
    from atmoref.cli.pictures import write_result
    from atmoref.cli.progress import working
    from atmoref.cli.rendering import produce
    from atmoref.scene import bundled_names, load_scene

    make_directory(output)
    for name in bundled_names():
        if not name.startswith("fig4"):
            question = load_scene(name)
            result = produce(Request(question, chosen_technique(question, None)))
            for suffix in (".exr", ".png"):
                write_result(output / f"{name}{suffix}", result)
            typer.echo(f"wrote {output / name}.exr and .png", err=True)
    from atmoref.judge.figure4 import figure4

    with working("Figure 4") as waiting:
        measured = figure4(output, waiting)
    typer.echo(measured)
    typer.echo(f"wrote {output / 'figure4.png'}, its panels and their differences from the truth", err=True)


def make_directory(path: Path) -> None:
    """Make a directory for many files; raises RequestError where something else stands there, OSError without room."""
    from atmoref.cli.pictures import check_directory

    if path.exists() and not path.is_dir():
        raise RequestError(f"-o: {path} is no directory; allowed: a directory, new or not")
    path.mkdir(parents=True, exist_ok=True)
    check_directory("-o", path)
