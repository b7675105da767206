"""``atmoref tables``: the look-up tables that are shipped, and those in the user's cache."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from atmoref.cli.failures import NEGATIVE, RequestError
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
    every: Annotated[
        bool, typer.Option("--all", help="Build the tables that are shipped, again, and compare their SHA-256.")
    ] = False,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="With --all: this one alone; may be repeated.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="With --all: keep them in this directory.")
    ] = None,
) -> None:
    """Build the tables that scenes need and that are not there yet; with --all, those that are shipped.

    With --all the exit code is 1 where a table differs from the shipped one.
    """
    if every:
        if scenes or changes:
            raise RequestError("tables build: --all builds what is shipped; allowed: no scene and no --set beside it")
        _build_shipped(only or [], output)
        return
    if only or output is not None:
        raise RequestError("tables build: --only and -o go with --all")
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


def _build_shipped(only: list[str], output: Path | None) -> None:
    """Build shipped tables, say of each whether it is the same, and fail if one is not."""
    from atmoref.cli.progress import working
    from atmoref.tables.shipped import SHIPPED, rebuild

    unknown = [name for name in only if name not in SHIPPED]
    if unknown:
        raise RequestError(f"--only: found {unknown[0]!r}; allowed: {', '.join(SHIPPED)}")
    if output is not None and not output.is_dir():
        raise RequestError(f"-o: {output}: no such directory")
    different = 0
    with tempfile.TemporaryDirectory() as temporary, working("tables") as waiting:
        for made in rebuild(output or Path(temporary), tuple(only), waiting):
            same = "as shipped" if made.reproduced else "differs from the shipped one" if made.shipped_sha256 else "new"
            typer.echo(f"{made.name:8}  {made.entry.bytes / 1e6:5.2f} MB  {made.entry.sha256}  {same}")
            different += not made.reproduced
    if different:
        raise typer.Exit(NEGATIVE)


def export(
    name: Annotated[str, typer.Argument(metavar="PARTICLE", help="cloud, rain, ice, ...: see atmoref optics table.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="F", help="Its suffix decides: .exr, .ktx2, .raw, .npz.")
    ],
    columns: Annotated[int | None, typer.Option(metavar="N", help="Angles from 0 to 180 degrees; odd.")] = None,
    orders: Annotated[int | None, typer.Option(metavar="N", help="Rows: 1 to N scatterings.")] = None,
    poisson: Annotated[bool, typer.Option(help="Rows averaged over Poisson numbers of scatterings.")] = False,
    storage: Annotated[
        Literal["float32", "float16", "unorm16", "unorm8"],
        typer.Option(help="Of .ktx2; unorm rows are divided by their greatest value."),
    ] = "float32",
) -> None:
    """Write the table of a particle's multiply scattered light as a texture: columns are angles, rows numbers."""
    from atmoref.cli.pictures import check_output
    from atmoref.cli.progress import working
    from atmoref.export.orders import write_orders
    from atmoref.optics.particles import PARTICLES
    from atmoref.tables.scattered import Axes, scattered
    from atmoref.tables.shipped import SHIPPED

    check_output("-o", output, (".exr", ".ktx2", ".raw", ".npz"))
    if name not in PARTICLES:
        raise RequestError(f"tables export: found {name!r}; allowed: {', '.join(PARTICLES)}")
    chosen = SHIPPED.get(name, Axes())
    try:
        axes = Axes(chosen.wavelengths_nm, columns or chosen.columns, orders or chosen.orders, poisson)
    except ValueError as error:
        raise RequestError(f"tables export: {error}") from error
    with working(f"table of {name}") as waiting:
        table = scattered(name, axes, waiting)
    write_orders(output, table, name, storage)
    typer.echo(f"wrote {output}", err=True)


def list_(as_json: AsJson = False) -> None:
    """List the tables that are shipped, and those in the cache."""
    from atmoref.store import cache_root, list_tables, shipped_directory

    shipped = shipped_directory()
    entries = [*([] if shipped is None else list_tables(shipped)), *list_tables()]
    if as_json:
        typer.echo(json.dumps([_plain(entry) for entry in entries], indent=2))
        return
    for entry in entries:
        told = f"damaged: {entry.problem}" if entry.problem else f"{entry.kind} {entry.version}"
        typer.echo(f"{entry.path.name}  {entry.bytes / 1e3:9.1f} kB  {told}")
    places = f"{shipped or 'no luts'} and {cache_root()}"
    typer.echo(f"{len(entries)} tables, {sum(e.bytes for e in entries) / 1e6:.1f} MB, in {places}", err=True)


def verify(as_json: AsJson = False) -> None:
    """Check every table against its SHA-256; exit code 1 if one is damaged (it is built anew when used)."""
    from atmoref.store import list_tables, shipped_directory

    shipped = shipped_directory()
    entries = [*([] if shipped is None else list_tables(shipped)), *list_tables()]
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
