"""``atmoref bench``: what a scene costs under every technique, and its error against time."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from atmoref.cli.rendering import Changes, SceneWord


def bench(
    scene: SceneWord,
    changes: Changes = None,
    pixels: Annotated[
        int, typer.Option(metavar="N", min=256, max=1 << 24, help="A larger image is measured with so many pixels.")
    ] = 40_000,
    rounds: Annotated[int, typer.Option(metavar="N", min=1, max=99, help="The least of so many rounds counts.")] = 3,
    quick: Annotated[bool, typer.Option("--quick", help="A few settings of the sweep only; no memory.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Print time, memory, draws and skips of SCENE under every technique, and error against time over their settings.

    CPU time of the kernels in one thread, the least of several rounds in turns: read them as ratios within one run.
    """
    from atmoref.cli.progress import working
    from atmoref.scene import load_scene

    question = load_scene(scene, changes or ())
    from dataclasses import asdict

    from atmoref.judge.bench.clock import resized
    from atmoref.judge.bench.costs import costs
    from atmoref.judge.bench.front import front
    from atmoref.judge.bench.text import costs_table, front_table
    from atmoref.techniques import TECHNIQUES

    with working(f"bench of {question.name}"):
        spent = costs(question, pixels=pixels, rounds=rounds, memory=not quick)
        found = front(resized(question, pixels), TECHNIQUES, rounds=rounds, quick=quick)
    if as_json:
        typer.echo(json.dumps({"costs": [asdict(c) for c in spent], "front": asdict(found)}, indent=2))
        return
    typer.echo(costs_table(spent))
    for refusal in (c.refused for c in spent if c.refused):
        typer.echo(f"refused: {refusal}", err=True)
    typer.echo(f"\nerror against time, {found.size[0]} x {found.size[1]} pixels, frame {found.format}\n")
    typer.echo(front_table(found))
