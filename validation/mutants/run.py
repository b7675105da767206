"""Draw the correct builds and every mutant in four formats, judge the dumps with `check`, and print the table.

    python validation/mutants/run.py               all, in all four formats
    python validation/mutants/run.py --home        each in its own format alone
    python validation/mutants/run.py --only "shadow" --reports out/mutants

The correct builds are OpenGL's and, where there is a Vulkan device, Vulkan's.
Exit codes: 0 all caught, 1 one was not, or a correct build was, 3 no OpenGL here.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[2]))

from atmoref.judge.check import CheckVerdict, check
from atmoref.report.html import report_of_check
from atmoref.report.plain import check_table
from atmoref.scene import load_scene
from validation.gl.case import DEVICE, FORMATS, load
from validation.gl.dump import write_dump

SCENE = "quick"
SMALL = (
    "image.width=60", "image.height=90", "technique.interval_m=3.0",
    "objects.0.center_m=[1.3, 8.0, -0.9]", "lights.0.direction=[0.12, -1.0, 0.07]",  # nothing is symmetric
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Outcome:
    """One mutant: formats in which it was caught, and what was said in its own."""

    name: str
    held_out: bool
    caught: tuple[str, ...]
    first: str
    kind: str
    told: str
    stage_right: bool
    kind_right: bool


@contextlib.contextmanager
def patched(patches: Sequence[tuple[str, str]]) -> Iterator[list[int]]:
    """Patch the text of shaders while they are built; yields how often each patch found its place."""
    programs = importlib.import_module("validation.gl.programs")
    original, found = programs.source, [0] * len(patches)

    def source(name: str, defines: Any) -> str:
        text = str(original(name, defines))
        for at, (old, new) in enumerate(patches):
            found[at] += text.count(old)
            text = text.replace(old, new)
        return text

    with mock.patch.object(programs, "source", source):
        yield found


def judged(
    ctx: Any, fmt: str, mutant: Any = None, *, diagnosed: bool = True, reports: Path | None = None
) -> CheckVerdict:
    """Draw a mutant (None: the correct build) in one format with OpenGL, judge its dump, and write reports of it."""
    build = importlib.import_module("validation.gl.build")
    overrides = (*SMALL, f"buffers.format={fmt}")
    (case,) = load(SCENE, overrides)
    ctx.blend_func = 1, 1
    with patched(mutant.patches if mutant else ()) as found, tempfile.TemporaryDirectory() as folder:
        made = build.Build(ctx, case)
        if mutant is not None and mutant.apply is not None:
            mutant.apply(made)
        write_dump(made, Path(folder), mutant.name if mutant else "correct")
        if not all(found):
            raise ValueError(f"{mutant.name}: a patch finds nothing to change")
        verdict = _checked(folder, overrides, diagnosed)
    if reports is not None and mutant is not None:
        reports.mkdir(parents=True, exist_ok=True)
        path = reports / re.sub("[^a-z0-9]+", "_", mutant.name.lower())
        path.with_suffix(".html").write_text(report_of_check(verdict), encoding="utf-8")
        path.with_suffix(".txt").write_text(check_table(verdict) + "\n", encoding="utf-8")
    return verdict


def judged_on_vulkan(device: Any, fmt: str) -> CheckVerdict:
    """Draw the correct Vulkan build in one format and judge its dump."""
    build = importlib.import_module("validation.vulkan.build")
    overrides = (*SMALL, "technique.coordinates=pixel", f"buffers.format={fmt}")
    (case,) = load(SCENE, overrides)
    with tempfile.TemporaryDirectory() as folder:
        write_dump(build.Build(device, case), Path(folder), "Vulkan, correct")
        return _checked(folder, overrides, diagnosed=True)


def _checked(folder: str, overrides: Sequence[str], diagnosed: bool) -> CheckVerdict:
    return check(folder, load_scene(SCENE, (*overrides, f"buffers.device={DEVICE}")), diagnosed=diagnosed)


def outcome(ctx: Any, at: int, mutant: Any, formats: Sequence[str], reports: Path | None = None) -> Outcome:
    """Return how a mutant fared; its reports are those of its own format."""
    caught = []
    first = kind = told = ""
    for fmt in formats:
        home = fmt == mutant.home
        verdict = judged(ctx, fmt, mutant, diagnosed=home, reports=reports if home else None)
        if verdict.passed:
            continue
        caught.append(fmt)
        if home and verdict.first is not None:
            first = verdict.first.name
            kind, told = (verdict.cause.kind, str(verdict.cause)) if verdict.cause else ("", "")
    return Outcome(
        mutant.name, at % 2 == 1, tuple(caught), first, kind, told, first.endswith(mutant.stage), kind in mutant.kinds
    )


def main(given: Sequence[str] | None = None) -> int:
    """Run; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--home", action="store_true", help="each in its own format alone")
    parser.add_argument("--only", default="", help="mutants whose name holds this text")
    parser.add_argument("--half", choices=("even", "odd"), help="those looked at (even), or not (odd)")
    parser.add_argument("--reports", type=Path, metavar="DIR", help="write each one's page and text there")
    asked = parser.parse_args(given)
    try:
        ctx = importlib.import_module("validation.gl.build").context()
        mutants = importlib.import_module("validation.mutants.variants").MUTANTS
    except Exception as failure:  # moderngl raises its own, without a common base
        print(f"error: no OpenGL context ({failure}); install Mesa: make system-deps", file=sys.stderr)
        return 3
    clean = all([_correct(f"OpenGL, {fmt}", judged(ctx, fmt)) for fmt in FORMATS])
    try:
        vulkan = importlib.import_module("validation.vulkan.build").context()
        clean &= all([_correct(f"Vulkan, {fmt}", judged_on_vulkan(vulkan, fmt)) for fmt in FORMATS])
    except (ImportError, RuntimeError) as missing:
        print(f"correct build, Vulkan: left out ({missing})")
    print("| mutant | half | caught in | first draw that leaves | diagnosis | stage | class |\n" + "|---" * 7 + "|")
    found = []
    for at, mutant in enumerate(mutants):
        if asked.only not in mutant.name or (asked.half and (at % 2 == 1) != (asked.half == "odd")):
            continue
        one = outcome(ctx, at, mutant, [mutant.home] if asked.home else FORMATS, asked.reports)
        found.append(one)
        half, stage, kind = ("held out" if one.held_out else "seen"), _mark(one.stage_right), _mark(one.kind_right)
        row = (one.name, half, ", ".join(one.caught) or "**none**", one.first, one.told, stage, kind)
        print("| " + " | ".join(row) + " |", flush=True)
    _summary(found)
    return 0 if clean and all(one.caught for one in found) else 1


def _correct(name: str, verdict: CheckVerdict) -> bool:
    """Print how a correct build fared; return whether no pixel differs."""
    off = sum(draw.off for draw in verdict.draws)
    print(f"correct build, {name:<16} {'passed' if verdict.passed else 'FAILED'}, {off} pixels differ", flush=True)
    return verdict.passed and off == 0


def _mark(right: bool) -> str:
    return "yes" if right else "no"


def _summary(found: Sequence[Outcome]) -> None:
    held = [one for one in found if one.held_out]
    print(f"caught {sum(bool(one.caught) for one in found)} of {len(found)}")
    print(f"right stage {sum(one.stage_right for one in found)} of {len(found)}")
    print(f"right class {sum(one.kind_right for one in found)} of {len(found)}")
    if held:
        print(f"right class, held out {sum(one.kind_right for one in held)} of {len(held)}")


if __name__ == "__main__":
    sys.exit(main())
