"""``atmoref tables``: the look-up tables in the user's cache."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

from atmoref.cli.failures import NEGATIVE
from atmoref.cli.rendering import Changes

if TYPE_CHECKING:
    from atmoref.store import TableEntry

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of lines.")]


def build(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENE]...", help="Scene files or bundled names; default: all bundled."),
    ] = None,
    changes: Changes = None,
) -> None:
    """Build the tables that scenes need and that are not there yet."""
    from atmoref.cli.answering import TRUTH, chosen_technique
    from atmoref.cli.progress import working
    from atmoref.scene import bundled_names, load_scene
    from atmoref.store import list_tables
    from atmoref.techniques.render import prepare

    questions = [load_scene(name, changes or ()) for name in scenes or bundled_names()]
    chosen = [(question, chosen_technique(question, None)) for question in questions]
    before = {entry.path for entry in list_tables() if entry.problem is None}
    with working("tables") as waiting:
        for done, (question, technique) in enumerate(chosen):
            waiting(f"tables of {question.name}", done / len(chosen))
            if technique != TRUTH:
                prepare(question, technique, None, None)
    after = [entry for entry in list_tables() if entry.problem is None]
    typer.echo(f"{sum(entry.path not in before for entry in after)} tables built, {len(after)} there")


def list_(as_json: AsJson = False) -> None:
    """List the tables in the cache."""
    from atmoref.store import cache_root, list_tables

    entries = list_tables()
    if as_json:
        typer.echo(json.dumps([_plain(entry) for entry in entries], indent=2))
        return
    for entry in entries:
        told = f"damaged: {entry.problem}" if entry.problem else f"{entry.kind} {entry.version}"
        typer.echo(f"{entry.path.name}  {entry.bytes / 1e3:9.1f} kB  {told}")
    typer.echo(f"{len(entries)} tables, {sum(e.bytes for e in entries) / 1e6:.1f} MB, in {cache_root()}", err=True)


def verify(as_json: AsJson = False) -> None:
    """Check every table against its SHA-256; exit code 1 if one is damaged (it is built anew when used)."""
    from atmoref.store import list_tables

    entries = list_tables()
    damaged = [entry for entry in entries if entry.problem]
    if as_json:
        typer.echo(json.dumps([_plain(entry) for entry in entries], indent=2))
    else:
        for entry in damaged:
            typer.echo(f"{entry.path.name}  damaged: {entry.problem}")
        typer.echo(f"{len(entries)} tables, {len(damaged)} damaged")
    if damaged:
        raise typer.Exit(NEGATIVE)


def clear() -> None:
    """Remove all tables from the cache; they are built anew when used."""
    from atmoref.store import clear_tables

    typer.echo(f"{clear_tables()} tables removed")


def _plain(entry: TableEntry) -> dict[str, Any]:
    return {
        "file": str(entry.path), "bytes": entry.bytes, "kind": entry.kind, "version": entry.version,
        "parameters": json.loads(entry.parameters) if entry.parameters else None, "sha256": entry.sha256,
        "problem": entry.problem,
    }  # fmt: skip
