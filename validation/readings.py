"""Print the measured tables of the documentation: errors of Figure 4 against the truth, one switch at a time.

Run as ``python validation/readings.py [errata] [apex] [previous] [interleaved] [formats]``,
without a word for all of them; under two
minutes. Three readings of "average error" (D-E38), pictures clipped to [0, 1]: mean |d|, sum |d| / sum of the truth,
mean of |d| / truth where that is above 0.02, all in per cent; then main planes / sub-planes.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from atmoref.judge.ladder import errors
from atmoref.scene import load_scene
from atmoref.techniques.render import render
from atmoref.truth import solve

ANALYSIS = ("technique.preset=analysis", "buffers.format=float64", "buffers.arithmetic=float64")
CORRECTED = ("technique.preset=corrected",)
ERRATA = (
    ("", ()),
    ("D-E1", ("surface_fog=printed",)),
    ("D-E2", ("albedo_in_source=false",)),
    ("D-E5", ("f_h=printed",)),
    ("D-E6", ("dt_mode=paper",)),
    ("D-E6", ("dt_mode=exact",)),
    ("D-E7", ("interval_rule=first_above",)),
    ("D-E9", ("bounds=euclid",)),
    ("D-E10", ("sub_plane_positions=printed",)),
    ("D-E10", ("sub_plane_positions=left",)),
    ("D-E10", ("sub_plane_positions=trap",)),
    ("D-E6, D-E10", ("dt_mode=paper", "sub_plane_positions=printed")),
    ("D-E11", ("sub_plane_rule=ceil",)),
    ("D-E11", ("sub_plane_rule=one",)),
    ("D-E15", ("coordinates=vertex",)),
    ("D-E15", ("coordinates=vertex", "mesh=[60,90]")),
    ("D-E33", ("sub_plane_depth_test=false",)),
)


class Truths:
    """Truths of Figure 4 by what was changed in the question; each is computed once."""

    def __init__(self) -> None:
        self._known: dict[tuple[tuple[str, ...], str], NDArray[np.float64]] = {}

    def image(self, changes: tuple[str, ...] = (), ambient: str = "constant") -> NDArray[np.float64]:
        """Return the true picture of Figure 4 with these changes of its question."""
        key = (changes, ambient)
        if key not in self._known:
            self._known[key] = solve(load_scene("fig4d", changes), ambient=ambient).image  # type: ignore[arg-type]
        return self._known[key]


def row(label: str, name: str, overrides: Sequence[str], truth: NDArray[np.float64]) -> None:
    """Print one line of a table."""
    result = render(load_scene(name, overrides))
    e, plan = errors(result.image, truth), result.stats["lights"][0]
    print(
        f"{label:52}  {100 * e['mean']:6.3f}  {100 * e['sum_ratio']:6.3f}  {100 * e['mean_relative']:6.3f}"
        f"  {plan['main_planes']:3}/{plan['sub_planes']}",
        flush=True,
    )


def head(text: str) -> None:
    """Print the title of a table."""
    print(f"\n{text}\n{'':52}  mean %   sum %   rel %  planes")


def errata(truths: Truths) -> None:
    """Print each reading alone, on top of preset analysis: float64, exact q, exact visibility, pixel coordinates."""
    head("fig4c, preset analysis in float64, one reading at a time")
    for erratum, keys in ERRATA:
        label = f"{erratum:12} {', '.join(keys) or 'all as in the preset'}"
        row(label, "fig4c", [*ANALYSIS, *(f"technique.{key}" for key in keys)], truths.image())
    haze = ("medium.phase_function={type='henyey_greenstein',g=0.6}",)
    for reading in ("forward", "backward"):
        overrides = [*ANALYSIS, *haze, f"technique.scattering_angle={reading}"]
        row(f"D-E3         scattering_angle={reading}, g = 0.6", "fig4c", overrides, truths.image(haze))
    ambient = ("medium.ambient_radiance=0.05",)
    for reading in ("constant", "saturating"):
        overrides = [*ANALYSIS, *ambient, f"technique.ambient={reading}"]
        row(f"D-E34        ambient={reading}, I_a = 0.05", "fig4c", overrides, truths.image(ambient, reading))
    print("(D-E34: each against the truth of the same reading)")


def apex(truths: Truths) -> None:
    """Print what each way to store q costs (D-E8)."""
    for device in ("ideal", "gl_llvmpipe"):
        head(f"fig4c, preset corrected, device {device}: q_storage")
        for storage in ("clamped", "scaled", "overflow", "split"):
            overrides = [*CORRECTED, f"technique.q_storage={storage}", f"buffers.device={device}"]
            row(storage, "fig4c", overrides, truths.image())
    for fmt in ("float16", "float32"):
        overrides = [*CORRECTED, "technique.q_storage=unclamped", f"buffers.q.format={fmt}"]
        row(f"unclamped in a {fmt} texture (ideal)", "fig4c", overrides, truths.image())
    head("fig4c, preset paper: q_storage")
    for storage in ("clamped", "overflow"):
        row(storage, "fig4c", [f"technique.q_storage={storage}"], truths.image())


def previous(truths: Truths) -> None:
    """Print the previous method: presets, where planes stand, formats."""
    for name in ("fig4a", "fig4b"):
        head(f"{name} (beams_vertex)")
        for preset in ("paper", "corrected"):
            row(f"preset {preset}, unorm8", name, [f"technique.preset={preset}"], truths.image())
        for positions in ("left", "mid"):
            overrides = [*ANALYSIS, f"technique.plane_positions={positions}"]
            row(f"preset analysis, float64, {positions}", name, overrides, truths.image())
    alone = ["buffers.format=unorm12", "buffers.vertex_colour.format=unorm8"]
    row("preset paper, frame alone unorm12", "fig4b", alone, truths.image())
    for fmt in ("unorm12", "float16", "float32"):
        row(f"preset paper, frame and vertex colours {fmt}", "fig4b", [f"buffers.format={fmt}"], truths.image())


def interleaved(truths: Truths) -> None:
    """Print interleaved sampling at the paper's settings: both compositions, three storages."""
    head("keller (beams_interleaved)")
    for composition in ("average", "interleave"):
        chosen = f"technique.composition={composition}"
        row(f"{composition}, paper, unorm8", "keller", [chosen], truths.image())
        float32 = [f"buffers.{name}.format=float32" for name in ("light_map", "depth", "shadow_map")]
        row(f"{composition}, paper, float32", "keller", [chosen, "buffers.format=float32", *float32], truths.image())
        row(f"{composition}, analysis, float64", "keller", [chosen, *ANALYSIS], truths.image())


def formats(truths: Truths) -> None:
    """Print what other formats and roundings of frame and f_h cost the proposed method."""
    for preset in ("paper", "corrected"):
        head(f"fig4c, preset {preset}: format of frame and f_h, rounding")
        chosen = f"technique.preset={preset}"
        for fmt in ("unorm8", "unorm10", "unorm12", "unorm16", "r11g11b10f", "float16", "float32"):
            row(fmt, "fig4c", [chosen, f"buffers.format={fmt}"], truths.image())
        for rounding in ("half_up", "truncate"):
            row(f"unorm8, {rounding}", "fig4c", [chosen, f"buffers.rounding={rounding}"], truths.image())
    for weights in ("equal", "telescoped"):
        for epsilon in (0.01, 0.002):
            overrides = [*CORRECTED, f"technique.sub_plane_weights={weights}", f"technique.epsilon={epsilon}"]
            row(f"corrected, {weights} weights, epsilon {epsilon} (D-E12)", "fig4c", overrides, truths.image())


TABLES = {"errata": errata, "apex": apex, "previous": previous, "interleaved": interleaved, "formats": formats}


def main(arguments: Sequence[str]) -> int:
    """Print the tables that are asked for; return the exit code."""
    unknown = [word for word in arguments if word not in TABLES]
    if unknown:
        print(f"error: found {unknown[0]!r}; allowed: {', '.join(TABLES)}", file=sys.stderr)
        return 2
    truths = Truths()
    for word in arguments or TABLES:
        TABLES[word](truths)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
