"""Pictures of phase functions and of light scattered many times: the paper's Figures 2 and 3, and close-ups.

Matplotlib is imported when a picture is drawn (the extra `report`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from atmoref.scene.mesh_files import MissingExtra
from atmoref.store import atomic_path
from atmoref.tables.scattered import Scattered

__all__ = ["KINDS", "plot_optics"]

_SIZE = (9.0, 5.5)
_RED_TO_BLUE = ("#c0392b", "#2e8b57", "#2c5fa8")
_HALOS, _BOWS, _GLORY = ("halos", 15.0, 50.0), ("bows", 120.0, 150.0), ("glory", 174.0, 180.0)
_CLOSE_UPS = {
    "ice": (_HALOS,),
    "snow": (_HALOS,),
    "rain": (_BOWS,),
    "cloud": (_BOWS, _GLORY),
    "cumulus": (_BOWS, _GLORY),
}

Tables = Mapping[str, Scattered]


def _colour(table: Scattered, channel: int) -> Any:
    """Return a wavelength's colour: red, green and blue for three, else along the spectrum."""
    from matplotlib import colormaps

    waves = table.axes.wavelengths_nm
    if len(waves) == 3:
        return _RED_TO_BLUE[int(np.argsort(np.argsort([-w for w in waves]))[channel])]
    return colormaps["turbo"]((waves[channel] - 380.0) / 400.0)


def _lines(axes: Any, tables: Tables, low: float = 0.0, high: float = 180.0) -> None:
    """Draw single scattering: all wavelengths of one particle, or the middle one of several."""
    for name, table in tables.items():
        angles = table.axes.angles_deg
        inside = (angles >= low) & (angles <= high)
        waves = table.axes.wavelengths_nm
        for i in range(len(waves)) if len(tables) == 1 else [len(waves) // 2]:
            single = (1.0 - table.delta[i, 0]) ** -1 * table.values[i, 0] if len(tables) == 1 else table.values[i, 0]
            label = f"{waves[i]:g} nm" if len(tables) == 1 else f"{name}, {waves[i]:g} nm"
            kept = {"color": _colour(table, i)} if len(tables) == 1 else {}
            axes.semilogy(angles[inside], single[inside], label=label, linewidth=1.0, **kept)
    axes.set_xlabel("scattering angle, degrees")
    axes.set_ylabel("phase function beside the forward peak, 1/sr")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


def _phase(figure: Any, tables: Tables) -> None:
    axes = figure.subplots()
    _lines(axes, tables)
    axes.set_xlim(0.0, 180.0)
    axes.set_title(", ".join(tables))


def _polar(figure: Any, tables: Tables) -> None:
    axes = figure.add_subplot(projection="polar")
    for name, table in tables.items():
        angles, middle = np.radians(table.axes.angles_deg), len(table.axes.wavelengths_nm) // 2
        radius = np.log10(np.maximum(table.values[middle, 0], 1e-5)) + 5.0
        both = np.concatenate([angles, 2.0 * np.pi - angles[::-1]])
        axes.plot(both, np.concatenate([radius, radius[::-1]]), label=name, linewidth=1.0)
    axes.set_rticks([1.0, 2.0, 3.0, 4.0, 5.0], ["1e-4", "1e-3", "0.01", "0.1", "1"], fontsize=7)
    axes.set_title("light comes from the left; radius: log of 1/sr")
    axes.legend(fontsize=8, loc="lower right")


def _close_ups(figure: Any, tables: Tables) -> None:
    wanted = {window for name in tables for window in _CLOSE_UPS.get(name, (_HALOS, _BOWS, _GLORY))}
    windows = [window for window in (_HALOS, _BOWS, _GLORY) if window in wanted]
    for axes, (title, low, high) in zip(figure.subplots(1, len(windows), squeeze=False)[0], windows, strict=True):
        _lines(axes, tables, low, high)
        axes.set_title(title)
        axes.set_yscale("linear" if title == "glory" else "log")


def _orders(figure: Any, tables: Tables) -> None:
    from matplotlib import colormaps

    grid = figure.subplots(1, len(tables), squeeze=False, sharey=True)[0]
    for axes, (name, table) in zip(grid, tables.items(), strict=True):
        rows = table.values[len(table.axes.wavelengths_nm) // 2]
        for n in sorted({1, 2, 3, 5, 8, 13, 26} & set(range(1, len(rows) + 1))):
            colour = colormaps["viridis"](np.log(n) / np.log(40.0))
            axes.semilogy(table.axes.angles_deg, rows[n - 1], label=f"n = {n}", color=colour, linewidth=1.0)
        axes.set_title(f"{name}: light scattered n times")
        axes.set_xlabel("angle to the light's way, degrees")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    grid[0].set_ylabel("Ams_n beside its delta, 1/sr")


def _forward(figure: Any, tables: Tables) -> None:
    axes = figure.subplots()
    for name, table in tables.items():
        forward = table.forward[len(table.axes.wavelengths_nm) // 2]
        axes.plot(np.arange(1, forward.size + 1), forward, "o-", label=name, markersize=3.0, linewidth=1.0)
    axes.set_xlabel("scatterings n")
    axes.set_ylabel("F_n, share in the forward hemisphere")
    axes.set_ylim(0.5, 1.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


KINDS: dict[str, Callable[[Any, Tables], None]] = {
    "phase": _phase, "polar": _polar, "closeups": _close_ups, "orders": _orders, "forward": _forward,
}  # fmt: skip
"""What can be drawn."""


def plot_optics(path: Path, kind: str, tables: Tables) -> None:
    """Draw one of `KINDS` of some particles' tables into a PNG, SVG or PDF file.

    Raises
    ------
    MissingExtra
        Without Matplotlib.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtra(
            "plots are drawn by Matplotlib, which is not installed: pip install atmoref[report]"
        ) from error

    wide = kind == "closeups" or (kind == "orders" and len(tables) > 1)
    figure = Figure(figsize=(2.0 * _SIZE[0] if wide else _SIZE[0], _SIZE[1]), layout="constrained")
    KINDS[kind](figure, tables)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=120)
