"""Tables of the benchmarks, as Markdown: readable on a terminal, and what the documentation shows."""

from __future__ import annotations

from collections.abc import Sequence

from atmoref.judge.bench.costs import Cost
from atmoref.judge.bench.front import Front, Point
from atmoref.judge.bench.growth import Growth


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table with padded columns: text to the left, figures to the right."""
    widths = [max(len(row[i]) for row in (head, *rows)) for i in range(len(head))]
    left = [not rows or not all(_is_figure(row[i]) for row in rows) for i in range(len(head))]
    lines = [_line(head, widths, left)]
    rules = ("-" * (w + 2) if to_left else "-" * (w + 1) + ":" for w, to_left in zip(widths, left, strict=True))
    lines.append("|" + "|".join(rules) + "|")
    return "\n".join(lines + [_line(row, widths, left) for row in rows])


def _is_figure(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == "–"
    return True


def _line(cells: Sequence[str], widths: Sequence[int], left: Sequence[bool]) -> str:
    padded = (c.ljust(w) if to_left else c.rjust(w) for c, w, to_left in zip(cells, widths, left, strict=True))
    return "| " + " | ".join(padded) + " |"


def costs_table(costs: Sequence[Cost]) -> str:
    """Return the costs of scenes under techniques."""
    head = (
        "scene", "technique", "pixels", "main / sub", "draws", "skipped %", "planes ms", "without skips", "gain",
        "all passes ms", "ns per draw and pixel", "buffers MB", "peak MB",
    )  # fmt: skip
    return table(head, [_cost_row(c) for c in costs])


def _cost_row(c: Cost) -> list[str]:
    size = f"{c.size[0]} x {c.size[1]}" + ("" if c.size == c.asked else f" (of {c.asked[0]} x {c.asked[1]})")
    name = c.technique + (" *" if c.own else "")
    if c.refused:
        return [c.scene, name, size, "refused", *["–"] * 9]
    peak = f"{c.peak_mb:.0f} ({c.peak_mb - c.idle_mb:+.0f})" if c.peak_mb else "–"
    return [
        c.scene, name, size, f"{c.main_planes} / {c.sub_planes}", str(c.draws), f"{100 * c.skipped:.1f}",
        f"{1e3 * c.skips.planes:.1f}", f"{1e3 * c.no_skips.planes:.1f}", f"{c.gain:.2f}",
        f"{1e3 * c.skips.passes:.1f}", f"{c.ns_per_draw_pixel:.2f}", f"{c.buffers_mb:.1f}", peak,
    ]  # fmt: skip


def growth_table(growths: Sequence[Growth]) -> str:
    """Return sizes, CPU times relative to the first, and exponents."""
    rows = []
    for g in growths:
        relative = ", ".join(f"{s / g.seconds[0]:.2f}" for s in g.seconds)
        rows.append([g.axis, g.technique, ", ".join(map(str, g.sizes)), relative, f"{g.exponent:.3f}"])
    return table(("grows", "technique", "sizes", "CPU time over the first", "exponent"), rows)


def front_table(found: Front, *, only_front: bool = True) -> str:
    """Return the settings that none beats (or all), cheapest first, those of other techniques, and the truth."""
    shown = [p for p in found.points if p.on_front or not only_front or p.technique != "beams"]
    rows = [_point_row(p, found) for p in shown]
    rows.append(["truth", "–", "–", f"{1e3 * found.truth_s:.0f}", "1.00", f"{100 * found.truth_error:.1e}", "–"])
    head = ("technique", "settings", "main / sub", "all passes ms", "truth over it", "error %", "front")
    return table(head, rows)


def _point_row(p: Point, found: Front) -> list[str]:
    words = ", ".join(f"{k} {v:.4g}" for k, v in p.settings.items())
    return [
        p.technique, words, f"{p.main_planes} / {p.sub_planes}", f"{1e3 * p.seconds.passes:.1f}",
        f"{found.truth_s / p.seconds.passes:.2f}", f"{100 * p.error['sum_ratio']:.3f}", "yes" if p.on_front else "–",
    ]  # fmt: skip


__all__ = ["costs_table", "front_table", "growth_table", "table"]
