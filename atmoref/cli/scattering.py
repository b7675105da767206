"""``atmoref optics``: phase functions and light scattered many times, as pictures and as numbers."""

from __future__ import annotations

import csv
import io
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from atmoref.cli.failures import RequestError

if TYPE_CHECKING:
    from atmoref.tables.scattered import Scattered

Particles = Annotated[
    list[str],
    typer.Argument(metavar="PARTICLE...", help="cloud, cumulus, rain, ice, snow, air, ..., or a .csv, .npz file."),
]
Waves = Annotated[
    str | None, typer.Option(metavar="NM,NM,...", help="Wavelengths in vacuum, 380 to 780; default 680,550,440.")
]
Orders = Annotated[int | None, typer.Option(metavar="N", help="Greatest number of scatterings; default 26.")]
Columns = Annotated[int | None, typer.Option(metavar="N", help="Angles from 0 to 180 degrees; default 3601, odd.")]
Poisson = Annotated[bool, typer.Option(help="Rows averaged over Poisson numbers of scatterings.")]


def plot(
    particles: Particles,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="F", help="A .png, .svg or .pdf file.")],
    kind: Annotated[
        Literal["phase", "polar", "closeups", "orders", "forward"],
        typer.Option(help="Single scattering, linear or polar; halo, bows and glory; scattered n times; F_n."),
    ] = "phase",
    wavelengths: Waves = None,
    orders: Orders = None,
    columns: Columns = None,
    poisson: Poisson = False,
) -> None:
    """Draw phase functions of particles: all wavelengths of one, or the middle one of several."""
    from atmoref.cli.pictures import check_output
    from atmoref.report.optics_plots import plot_optics

    check_output("-o", output, (".png", ".svg", ".pdf"))
    tables = _tables(particles, wavelengths, orders, columns, poisson)
    plot_optics(output, kind, tables)
    typer.echo(f"wrote {output}", err=True)


def table(
    particle: Annotated[str, typer.Argument(metavar="PARTICLE", help="A name, or a .csv or .npz file.")],
    kind: Annotated[
        Literal["phase", "orders", "forward", "features", "sections"],
        typer.Option(help="Single scattering; scattered --order times; F_n; bows, rings and halos; cross-sections."),
    ] = "phase",
    order: Annotated[int, typer.Option(metavar="N", help="Number of scatterings of --kind orders.")] = 2,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="F", help="A .csv or .json file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of CSV.")] = False,
    wavelengths: Waves = None,
    orders: Orders = None,
    columns: Columns = None,
    poisson: Poisson = False,
) -> None:
    """Print numbers of a particle as CSV: one column a wavelength. A phase function can be read again as a particle."""
    from atmoref.cli.pictures import check_output
    from atmoref.store import atomic_path

    if output is not None:
        check_output("-o", output, (".csv", ".json"))
    if kind == "orders" and not 1 <= order <= (orders or 26):
        raise RequestError(f"--order: found {order}; allowed: 1 to {orders or 26} (--orders)")
    (found,) = _tables([particle], wavelengths, orders, columns, poisson).values()
    told = _numbers(particle, found, kind, order)
    suffix = ".csv" if output is None else output.suffix.lower()
    text = _json_text(told) if as_json or suffix == ".json" else _csv_text(told)
    if output is None:
        typer.echo(text, nl=False)
        return
    with atomic_path(output) as temporary:
        temporary.write_text(text, encoding="utf-8")
    typer.echo(f"wrote {output}", err=True)


def _tables(
    names: list[str], wavelengths: str | None, orders: int | None, columns: int | None, poisson: bool
) -> dict[str, Scattered]:
    """Return the tables of particles, or refuse what was asked."""
    from atmoref.cli.progress import working
    from atmoref.optics.particles import PARTICLES, Particle
    from atmoref.optics.tabulated import ParticleFileError, read_particle
    from atmoref.tables.scattered import Axes, scattered
    from atmoref.tables.shipped import SHIPPED

    waves = None if wavelengths is None else _numbers_of("--wavelengths", wavelengths)
    particles: dict[str, Particle] = {}
    for name in names:
        if name in PARTICLES:
            particles[name] = PARTICLES[name]
        elif Path(name).suffix.lower() in (".csv", ".npz"):
            if not Path(name).is_file():
                raise RequestError(f"{name}: no such file")
            try:
                particles[name] = read_particle(name)
            except ParticleFileError as error:
                raise RequestError(str(error)) from error
        else:
            raise RequestError(f"particle: found {name!r}; allowed: {', '.join(PARTICLES)}, a .csv or .npz file")
    found = {}
    with working("optics") as waiting:
        for name, particle in particles.items():
            usual = SHIPPED.get(name, Axes())
            own = getattr(particle, "wavelengths_nm", None)
            chosen = waves or (usual.wavelengths_nm if own is None else tuple(float(w) for w in own[::-1]))
            try:
                axes = Axes(chosen, columns or usual.columns, orders or usual.orders, poisson)
                found[name] = scattered(particle, axes, waiting)
            except ValueError as error:
                raise RequestError(f"{name}: {error}") from error
    return found


def _numbers_of(option: str, text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in text.split(","))
    except ValueError:
        found = ()
    if not found or not all(380.0 <= w <= 780.0 for w in found) or len(set(found)) < len(found):
        raise RequestError(
            f"{option}: found {text[:80]!r}; allowed: different wavelengths of 380 to 780 nm, with commas"
        )
    return found


def _numbers(name: str, found: Scattered, kind: str, order: int) -> dict[str, Any]:
    """Return a head, remarks and rows."""
    waves = found.axes.wavelengths_nm
    names = [f"{w:g}" for w in waves]
    if kind in ("phase", "orders"):
        n = 1 if kind == "phase" else order
        left = 1.0 - found.delta[:, n - 1]
        values = found.values[:, n - 1].T / (left if kind == "phase" else 1.0)
        rows: list[list[Any]] = [["delta", *found.delta[:, n - 1].tolist()]]
        rows += [[a, *row] for a, row in zip(found.axes.angles_deg.tolist(), values.tolist(), strict=True)]
        what = "without its delta, divided by 1 - delta" if kind == "phase" else f"scattered {n} times, beside delta^n"
        return {"about": f"{name}: 1/sr, {what}", "head": ["angle_deg", *names], "rows": rows}
    if kind == "forward":
        rows = [[n + 1, *column] for n, column in enumerate(found.forward.T.tolist())]
        return {"about": f"{name}: share in the forward hemisphere after n", "head": ["n", *names], "rows": rows}
    if kind == "sections":
        return _sections(name, found)
    from atmoref.optics.features import features

    rows = []
    for i, wavelength in enumerate(waves):
        for one in features(name, found.axes.angles_deg, found.values[i, 0], wavelength):
            theory = None if math.isnan(one.theory_deg) else round(one.theory_deg, 3)
            rows.append([one.name, wavelength, round(one.measured_deg, 3), theory])
    head = ["feature", "wavelength_nm", "measured_deg", "theory_deg"]
    return {"about": f"{name}: scattering angles, degrees", "head": head, "rows": rows}


def _sections(name: str, found: Scattered) -> dict[str, Any]:
    from atmoref.optics.particles import PARTICLES

    rendered = getattr(PARTICLES.get(name), "extinction_m2", None)
    rows = [[w, rendered, g, d] for w, g, d in zip(
        found.axes.wavelengths_nm, found.asymmetry.tolist(), found.delta[:, 0].tolist(), strict=True
    )]  # fmt: skip
    head = ["wavelength_nm", "extinction_m2", "asymmetry", "delta"]
    return {"about": f"{name}: cross-section that it is rendered with, mean cosine, peak", "head": head, "rows": rows}


def _csv_text(told: dict[str, Any]) -> str:
    stream = io.StringIO()
    stream.write(f"# {told['about']}\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(told["head"])
    writer.writerows([["" if cell is None else cell for cell in row] for row in told["rows"]])
    return stream.getvalue()


def _json_text(told: dict[str, Any]) -> str:
    return json.dumps(told, indent=1, allow_nan=False) + "\n"
