"""The tables that come with the package: which they are, how they are built again, and whether that gives the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from atmoref.optics.particles import PARTICLES
from atmoref.optics.single import Progress
from atmoref.store import TableEntry, shipped_entry, write_table
from atmoref.tables.scattered import KIND, VERSION, Axes, build, parameters_of

__all__ = ["BOUTHORS", "SHIPPED", "Rebuilt", "rebuild"]

BOUTHORS = (650.0, 550.0, 450.0)
"""Wavelengths (nm) of R, G, B in Bouthors et al. 2008."""
SHIPPED: dict[str, Axes] = {
    "cloud": Axes(),
    "cumulus": Axes(BOUTHORS),
    "rain": Axes(),
    "ice": Axes(),
    "snow": Axes(),
}
"""Particle -> axes of its table; the others take no time worth a file."""


class Rebuilt(NamedTuple):
    """A table that was built again; `shipped_sha256` is empty where none is shipped."""

    name: str
    entry: TableEntry
    shipped_sha256: str

    @property
    def reproduced(self) -> bool:
        """Whether its content is that of the shipped one."""
        return self.entry.sha256 == self.shipped_sha256


def rebuild(directory: Path, names: tuple[str, ...] = (), progress: Progress | None = None) -> Iterator[Rebuilt]:
    """Build shipped tables (all, or some by name) into a directory, and yield each as it is done."""
    for name in names or tuple(SHIPPED):
        particle, axes = PARTICLES[name], SHIPPED[name]
        parameters = parameters_of(particle, axes)
        there = shipped_entry(KIND, VERSION, parameters)  # before writing: the directory may be the shipped one
        made = write_table(directory, KIND, VERSION, parameters, build(particle, axes, progress))
        yield Rebuilt(name, made, "" if there is None else there.sha256)
