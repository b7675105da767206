"""The chart of Figure 5 of Dobashi, Yamamoto, Nishita 2002: f_l and m_k against the distance from the eye."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from atmoref.scene import Scene, SceneError
from atmoref.scene.mesh_files import MissingExtra
from atmoref.store import atomic_path
from atmoref.techniques.render import prepare

SUFFIXES = (".png", ".svg", ".pdf")


@dataclass(frozen=True, slots=True)
class LightChart:
    """What the chart shows of one light: a slab's distance (m), f_l on the centre ray, and its sub-planes m_k."""

    interval_m: float
    distance_m: tuple[float, ...]
    f_l: tuple[float, ...]
    sub_planes: tuple[int, ...]


def light_charts(scene: Scene) -> list[LightChart]:
    """Return the chart of every light of a scene, by the rules of technique `beams` (sec. 4.2, D-E11).

    Raises
    ------
    SceneError
        As of the technique.
    """
    report: dict[str, Any] = prepare(scene, "beams", None, None)[-1]
    charts = []
    for light in report["lights"]:
        counts = tuple(int(m) for m in light["sub_planes_per_slab"])
        near, dt = float(light["depth_m"][0]), float(light["interval_m"])
        at = tuple(near + k * dt for k in range(len(counts)))
        charts.append(LightChart(dt, at, tuple(float(f) for f in light["f_l_centre"]), counts))
    return charts


def draw(charts: list[LightChart], title: str) -> Any:
    """Return a Matplotlib figure: bars m_k, and above them the curve f_l, one panel per light.

    Raises
    ------
    MissingExtra
        Without Matplotlib.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtra(
            "charts are drawn by Matplotlib, which is not installed: pip install atmoref[report]"
        ) from error

    figure = Figure(figsize=(6.4, 3.2 * len(charts)), layout="constrained")
    for axes, (index, chart) in zip(
        figure.subplots(len(charts), 1, squeeze=False)[:, 0], enumerate(charts), strict=True
    ):
        bars = axes.bar(chart.distance_m, chart.sub_planes, width=0.8 * chart.interval_m, color="0.75", label="m_k")
        axes.bar_label(bars, fontsize=6)
        axes.set_ylabel("sub-planes m_k")
        axes.set_xlabel("distance from the eye, m")
        counts = f"{len(chart.sub_planes)} main planes, {sum(chart.sub_planes)} sub-planes"
        axes.set_title(f"{title}, light {index}: {counts}", fontsize=9)
        curve = axes.twinx()
        curve.plot(chart.distance_m, chart.f_l, color="C0", marker=".", label="f_l")
        curve.set_ylabel("f_l on the centre ray", color="C0")
        curve.set_ylim(bottom=0.0)
    return figure


def write_chart(scene: Scene, path: Path) -> list[LightChart]:
    """Write the chart of a scene into a PNG, SVG or PDF file, and return what it shows.

    Raises
    ------
    SceneError
        If no light of the scene has planes.
    MissingExtra
        Without Matplotlib.
    """
    charts = [chart for chart in light_charts(scene) if chart.sub_planes]
    if not charts:
        raise SceneError(f"{scene.origin}: lights: no planes in front of the camera; allowed: light before the camera")
    figure = draw(charts, scene.name or "scene")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower(), dpi=120)
    return charts


__all__ = ["SUFFIXES", "LightChart", "draw", "light_charts", "write_chart"]
