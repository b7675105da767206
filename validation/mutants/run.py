"""Draw every mutant in four formats, judge its dump with `check`, and print the table.

    python validation/mutants/run.py               all, in all four formats
    python validation/mutants/run.py --home        each in its own format alone
    python validation/mutants/run.py --only "shadow"

Exit codes: 0 all caught, 1 one was not, or a correct build was, 3 no OpenGL here.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[2]))

from atmoref.judge.check import CheckVerdict, check
from atmoref.scene import load_scene
from validation.gl.case import DEVICE, FORMATS, load

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


def judged(ctx: Any, fmt: str, mutant: Any = None, *, diagnosed: bool = True) -> CheckVerdict:
    """Draw a mutant (None: the correct build) in one format and judge its dump."""
    build = importlib.import_module("validation.gl.build")
    from validation.gl.dump import write_dump

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
        scene = load_scene(SCENE, (*overrides, f"buffers.device={DEVICE}"))
        return check(folder, scene, diagnosed=diagnosed)


def outcome(ctx: Any, at: int, mutant: Any, formats: Sequence[str]) -> Outcome:
    """Return how a mutant fared."""
    caught = []
    first = kind = told = ""
    for fmt in formats:
        home = fmt == mutant.home
        verdict = judged(ctx, fmt, mutant, diagnosed=home)
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
    asked = parser.parse_args(given)
    try:
        ctx = importlib.import_module("validation.gl.build").context()
        mutants = importlib.import_module("validation.mutants.variants").MUTANTS
    except Exception as failure:  # moderngl raises its own, without a common base
        print(f"error: no OpenGL context ({failure}); install Mesa: make system-deps", file=sys.stderr)
        return 3
    clean = True
    for fmt in FORMATS:
        verdict = judged(ctx, fmt)
        off = sum(draw.off for draw in verdict.draws)
        clean &= verdict.passed and off == 0
        print(f"correct build, {fmt:<8} {'passed' if verdict.passed else 'FAILED'}, {off} pixels differ")
    print("| mutant | half | caught in | first draw that leaves | diagnosis | stage | class |\n" + "|---" * 7 + "|")
    found = []
    for at, mutant in enumerate(mutants):
        if asked.only not in mutant.name or (asked.half and (at % 2 == 1) != (asked.half == "odd")):
            continue
        one = outcome(ctx, at, mutant, [mutant.home] if asked.home else FORMATS)
        found.append(one)
        half, stage, kind = ("held out" if one.held_out else "seen"), _mark(one.stage_right), _mark(one.kind_right)
        row = (one.name, half, ", ".join(one.caught) or "**none**", one.first, one.told, stage, kind)
        print("| " + " | ".join(row) + " |", flush=True)
    _summary(found)
    return 0 if clean and all(one.caught for one in found) else 1


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
