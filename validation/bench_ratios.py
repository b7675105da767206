"""Kernels beside other code in the same run: the scalar reference of the tests, and OpenGL on Mesa's llvmpipe."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from reference.timing import measure

from atmoref.judge.bench.text import table
from atmoref.scene import load_scene

ROOT = Path(__file__).parents[1]
# scene, stage, what it is, overrides
SCALAR = (
    ("fig4c", "beam_planes", "23 planes, 174 sub-planes, corrected", ("technique.preset=corrected",)),
    ("fig4c", "beam_planes", "the same, paper", ("technique.preset=paper",)),
    ("fig4c", "beam_planes", "the same, 8-bit filter (geforce_fx)", ("buffers.device=geforce_fx",)),
    ("fig4a", "vertex_planes", "40 planes, previous method", ()),
    ("fig4b", "vertex_planes", "160 planes, previous method", ()),
)
OPENGL = (
    ("fig4c", "23 planes, 174 sub-planes", "on"),
    ("fig4c", "23 planes, 174 sub-planes", "off"),
    ("fig4b", "160 planes, previous method", "on"),
)
_TIMES = re.compile(r"OpenGL ([0-9.]+) ms, mirror ([0-9.]+) ms of CPU; ratio ([0-9.]+)")


def scalar_table(rounds: int = 7) -> str:
    """Return lanes against compiled scalar code that computes the same bits, skips on and off."""
    rows = []
    for scene, stage, what, overrides in SCALAR:
        t = measure(load_scene(scene, overrides), stage, rounds)
        rows.append(
            [scene, what, *(f"{1e3 * s:.1f}" for s in (t.scalar_s, t.skips_s, t.no_skips_s)),
             f"{t.ratio:.2f}", f"{t.ratio_without_skips:.2f}", f"{t.gain:.2f}"]
        )  # fmt: skip
    return table(
        ("scene", "what", "scalar ms", "lanes ms", "no skips ms", "scalar / lanes", "without skips", "gain"), rows
    )


def opengl_table() -> str | None:
    """Return OpenGL against the mirror by `validation/gl/run.py --time`; None where there is no such device."""
    rows = []
    for scene, what, skips in OPENGL:
        keys = ("buffers.device=gl_llvmpipe", f"technique.skip={'true' if skips == 'on' else 'false'}")
        chosen = [word for key in keys for word in ("--set", key)]
        command = [sys.executable, str(ROOT / "validation/gl/run.py"), scene, "--time", "--runs", "5", *chosen]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
        if done.returncode == 3:
            return None
        found = _TIMES.search(done.stdout)
        if found is None:
            raise RuntimeError(f"{' '.join(command[1:])}: {(done.stderr or done.stdout).strip()[-300:]}")
        rows.append([scene, what, skips, *found.groups()])
    return table(("scene", "what", "skips", "OpenGL ms", "mirror ms", "OpenGL / mirror"), rows)
