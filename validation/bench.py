"""Measure all bundled scenes: costs, growth, error against time, ratios; print the tables and keep them.

    python validation/bench.py                            tables, charts and JSON into out/bench
    python validation/bench.py --write docs/benchmarks.md the same, and the tables into a page, between its markers
    python validation/bench.py --quick                    small sizes, less than 20 s once kernels are compiled

All times are CPU seconds of one thread, the least of several rounds in turns: ratios within one run.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from atmoref.judge.bench.clock import resized
from atmoref.judge.bench.costs import Cost, costs
from atmoref.judge.bench.front import Front, front
from atmoref.judge.bench.growth import AXES, Growth, measure_growth
from atmoref.judge.bench.text import costs_table, front_table, growth_table
from atmoref.judge.bench.variants import stored_as
from atmoref.scene import bundled_names, load_scene
from atmoref.store import atomic_path
from validation import bench_chart, bench_ratios

QUESTION = ("fig4c", ("technique.preset=corrected",))
FORMATS = ("unorm8", "float32")
SECTION = re.compile(r"(<!-- bench:(\w+) -->\n).*?(<!-- /bench:\2 -->)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Sizes:
    """How much is measured."""

    pixels: int
    rounds: int
    growth_steps: int
    growth_width: int
    front_pixels: int


FULL = Sizes(160_000, 3, 5, 96, 40_000)
QUICK = Sizes(1_500, 1, 3, 48, 1_500)


def machine() -> str:
    """Return processor family and instruction sets, Python and library versions; nothing that names a computer."""
    import numba
    import numpy

    from atmoref.lanes import N

    flags: set[str] = set()
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="ascii")
        model = next((line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name")), "")
        flags = set(next((line for line in text.splitlines() if line.startswith("flags")), "").split())
    except OSError:
        model = platform.processor()
    widest = next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "no AVX2")
    return (
        f"{model or platform.machine()}, {widest}; {N} lanes; Python {platform.python_version()}, "
        f"NumPy {numpy.__version__}, Numba {numba.__version__}"
    )


def all_costs(sizes: Sizes, *, quick: bool) -> list[Cost]:
    """Return the costs of every bundled scene under every technique."""
    found: list[Cost] = []
    for name in bundled_names():
        tell(f"costs of {name}")
        found += costs(load_scene(name), pixels=sizes.pixels, rounds=sizes.rounds, memory=not quick)
    return found


def all_growth(sizes: Sizes) -> list[Growth]:
    """Return growth along every axis."""
    found = []
    for axis in AXES:
        tell(f"growth with {axis}")
        scene = load_scene(*QUESTION)
        steps, width = sizes.growth_steps, sizes.growth_width
        found.append(measure_growth(scene, axis, steps=steps, width=width, rounds=5 if steps > 3 else 3))
    return found


def all_fronts(sizes: Sizes, *, quick: bool) -> list[Front]:
    """Return error against time of one scene, a front for each format."""
    found = []
    for fmt in FORMATS:
        tell(f"error against time, {fmt}")
        scene = stored_as(resized(load_scene(*QUESTION), sizes.front_pixels), fmt)
        found.append(front(scene, ("beams", "beams_vertex", "beams_interleaved"), rounds=sizes.rounds, quick=quick))
    return found


def tell(what: str) -> None:
    """Say on stderr what is being measured."""
    print(f"bench: {what}", file=sys.stderr, flush=True)


def refusals(found: Sequence[Cost]) -> str:
    """Return why scenes were refused, a line each; pairs of the same reason together."""
    reasons: dict[str, list[str]] = {}
    for c in found:
        if c.refused:
            reasons.setdefault(c.refused, []).append(f"`{c.scene}` under `{c.technique}`")
    return "\n".join(f"- {', '.join(who)}: {why}" for why, who in reasons.items())


def sections(found: dict[str, Any], run: str, *, quick: bool) -> dict[str, str]:
    """Return the text of each section of the page."""
    spent = found["costs"]
    refused = refusals(spent)
    fronts: list[Front] = found["fronts"]
    shown = [f"Frame {f.format}, {f.size[0]} x {f.size[1]} pixels:\n\n{front_table(f)}" for f in fronts]
    texts = {
        "run": run,
        "costs": costs_table(spent) + (f"\n\nRefused:\n\n{refused}" if refused else ""),
        "growth": growth_table(found["growth"]),
        "front": "\n\n".join(shown),
        "scalar": "Left out of a quick run: compiling the scalar code takes longer than all of it.",
        "opengl": "Left out of a quick run.",
    }
    if not quick:
        tell("ratios to scalar code")
        texts["scalar"] = bench_ratios.scalar_table()
        tell("ratios to OpenGL")
        absent = "No software OpenGL device in this run (`make system-deps` installs one)."
        texts["opengl"] = bench_ratios.opengl_table() or absent
    return texts


def write_page(page: Path, texts: dict[str, str]) -> None:
    """Replace what stands between the markers `<!-- bench:NAME -->` and `<!-- /bench:NAME -->` of a page.

    Raises
    ------
    ValueError
        If the page lacks the markers of a section.
    """
    text = page.read_text(encoding="utf-8")
    missing = set(texts) - {m.group(2) for m in SECTION.finditer(text)}
    if missing:
        raise ValueError(f"{page}: no markers <!-- bench:NAME --> ... <!-- /bench:NAME --> for {sorted(missing)}")
    filled = SECTION.sub(lambda m: f"{m.group(1)}\n{texts[m.group(2)]}\n\n{m.group(3)}", text)
    with atomic_path(page) as path:
        path.write_text(filled, encoding="utf-8")


def main(given: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/bench"), help="where charts and JSON go")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the tables into this page")
    parser.add_argument("--quick", action="store_true", help="small sizes: shows that it runs, not how fast")
    asked = parser.parse_args(given)
    sizes, start = (QUICK if asked.quick else FULL), time.perf_counter()
    asked.output.mkdir(parents=True, exist_ok=True)
    found: dict[str, Any] = {
        "growth": all_growth(sizes), "fronts": all_fronts(sizes, quick=asked.quick),
        "costs": all_costs(sizes, quick=asked.quick),
    }  # fmt: skip
    run = f"{'A quick run: sizes too small for figures. ' if asked.quick else ''}{machine()}."
    texts = sections(found, run, quick=asked.quick)
    bench_chart.draw_fronts(found["fronts"], asked.output / "error_against_time.png", 110)
    bench_chart.draw_growth(found["growth"], asked.output / "growth.png", 110)
    record = {"run": run, **{k: [asdict(x) for x in v] for k, v in found.items()}}
    for growth, values in zip(found["growth"], record["growth"], strict=True):
        values["exponent"] = growth.exponent
    with atomic_path(asked.output / "bench.json") as path:
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    whole = "\n\n".join(f"== {name} ==\n\n{text}" for name, text in texts.items())
    with atomic_path(asked.output / "bench.txt") as path:
        path.write_text(whole + "\n", encoding="utf-8")
    if asked.write is not None:
        write_page(asked.write, texts)
        images = asked.write.parent / "images"
        images.mkdir(exist_ok=True)
        bench_chart.draw_fronts(found["fronts"], images / "error_against_time.png", 72)
    print(whole)
    tell(f"done in {time.perf_counter() - start:.0f} s; wrote {asked.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
