"""``atmoref bounds``: the least and the greatest image that a correct build may draw."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from atmoref.cli.failures import RequestError
from atmoref.cli.rendering import Changes, MaxMemory, SceneWord, TechniqueWord, Threads
from atmoref.cli.words import parse_crop, parse_size


def bounds(
    scene: SceneWord,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="F", help="Layers low and high: .npz or .exr.")
    ] = None,
    interval: Annotated[
        Literal["device", "envelope"] | None,
        typer.Option(help="Builds on the scene's device, or on any that the specifications permit."),
    ] = None,
    technique: TechniqueWord = None,
    changes: Changes = None,
    crop: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Pixels to draw, row 0 at the top.")] = None,
    threads: Threads = None,
    max_memory: MaxMemory = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Compute between what images a correct build of SCENE may lie, and print how wide that is.

    The file serves as both bounds: atmoref compare TEST REFERENCE --bounds F F.
    """
    from atmoref.cli import pictures
    from atmoref.cli.answering import TRUTH, Request, answer, chosen_technique
    from atmoref.cli.progress import working
    from atmoref.images import write
    from atmoref.scene import load_scene

    rectangle, limit = parse_crop(crop), parse_size(max_memory)
    pictures.check_output("-o", output, (".npz", ".exr"))
    question = load_scene(scene, changes or (), max_memory=limit)
    name = chosen_technique(question, technique)
    if name == TRUTH:
        raise RequestError("bounds: the truth has an error, no bounds; allowed: a technique")
    from atmoref.judge.bounds import width_summary, with_intervals

    request = Request(with_intervals(question, interval), name, rectangle, threads, limit)
    with working(f"bounds of {question.name}") as waiting:
        result = answer(request, waiting)
    if output is not None:
        write(output, pictures.bounds_image(result))
        typer.echo(f"wrote {output}", err=True)
    assert result.bounds is not None
    fmt = result.buffers["frame"].format
    told = width_summary(*result.bounds, fmt)
    if as_json:
        typer.echo(json.dumps({**told, "interval": result.provenance["interval"], "format": fmt.name}, indent=2))
        return
    unit = "codes" if fmt.kind == "unorm" else "of the value"
    device, kind = result.provenance["device"], result.provenance["interval"]
    typer.echo(
        f"{question.name}, {name}, {fmt.name}, {device}, interval {kind}\n"
        f"width ({unit}): median {told['median']:.6g}, 99 % {told['percent_99']:.6g}, greatest {told['greatest']:.6g}; "
        f"{100.0 * told['decided']:.4g} % of all values are decided"
    )
