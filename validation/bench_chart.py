"""The chart of the benchmarks: error against CPU time, and growth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from atmoref.judge.bench.front import Front
    from atmoref.judge.bench.growth import Growth

# technique -> marker, colour, name; colours that remain apart for most eyes
LOOKS = {
    "beams": ("o", "#0072b2", "beams: planes, ε, table size"),
    "beams_vertex": ("s", "#d55e00", "previous method: 10 … 320 planes"),
    "beams_interleaved": ("^", "#009e73", "interleaved: 4 × 10 … 320 planes"),
}


def draw_fronts(fronts: Sequence[Front], path: Path, dpi: int) -> None:
    """Write one panel a front: Σ|d| / Σtruth in percent over CPU milliseconds, both logarithmic."""
    plt = _pyplot()
    figure, panels = plt.subplots(
        1, len(fronts), figsize=(5.2 * len(fronts), 4.4), sharey=True, squeeze=False, layout="constrained"
    )
    for panel, found in zip(panels[0], fronts, strict=True):
        _panel(panel, found)
        width, height = found.size
        panel.set_title(f"{found.scene}, {width} × {height}, frame {found.format}", fontsize=10)
        panel.set_xlabel("CPU time of all passes, one thread (ms)")
    panels[0][0].set_ylabel("Σ|mirror − truth| / Σtruth (%)")
    panels[0][0].legend(fontsize=7.5, loc="lower left")
    figure.savefig(path, dpi=dpi)
    plt.close(figure)


def _panel(panel: Any, found: Front) -> None:
    for technique, (marker, colour, label) in LOOKS.items():
        points = [p for p in found.points if p.technique == technique]
        if points:
            x, y = _coordinates(points)
            line = "-" if technique != "beams" else ""
            panel.plot(x, y, marker + line, color=colour, label=label, ms=4.5, lw=0.8, alpha=0.75)
    x, y = _coordinates([p for p in found.points if p.on_front])
    panel.step(x, y, where="post", color="black", lw=1.2, label="Pareto front", zorder=0)
    panel.axvline(1e3 * found.truth_s, color="black", ls=":", lw=1.2, label="time of the truth")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.grid(visible=True, which="both", lw=0.3, alpha=0.6)


def _coordinates(points: Sequence[Any]) -> tuple[list[float], list[float]]:
    return [1e3 * p.seconds.passes for p in points], [100.0 * p.error["sum_ratio"] for p in points]


def draw_growth(growths: Sequence[Growth], path: Path, dpi: int) -> None:
    """Write CPU time over size, both relative to the smallest and logarithmic, one line an axis."""
    plt = _pyplot()
    figure, panel = plt.subplots(figsize=(5.2, 4.2), layout="constrained")
    for g, marker in zip(growths, "osv^D", strict=False):
        x = [s / g.sizes[0] for s in g.sizes]
        y = [s / g.seconds[0] for s in g.seconds]
        panel.plot(x, y, marker=marker, ms=4.5, lw=1.0, label=f"{g.axis} ({g.technique}): {g.exponent:.2f}")
    longest = max(g.sizes[-1] / g.sizes[0] for g in growths)
    panel.plot([1, longest], [1, longest], "k:", lw=1.0, label="exponent 1")
    panel.set(xscale="log", yscale="log", xlabel="size over the smallest (1)", ylabel="CPU time over the smallest (1)")
    panel.grid(visible=True, which="both", lw=0.3, alpha=0.6)
    panel.legend(fontsize=7.5)
    figure.savefig(path, dpi=dpi)
    plt.close(figure)


def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt
