"""Print how fast the kernels are, as ratios within this run: lanes against scalar code, skips on against off."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from reference.timing import measure

from atmoref.scene import load_scene

ROWS = [
    ("fig4c", "beam_planes", "23 planes, 174 sub-planes, corrected", ["technique.preset=corrected"]),
    ("fig4c", "beam_planes", "23 planes, 174 sub-planes, paper", ["technique.preset=paper"]),
    ("fig4c", "beam_planes", "the same, 8-bit filter (geforce_fx)", ["buffers.device=geforce_fx"]),
    ("fig4a", "vertex_planes", "40 planes, previous method", []),
    ("fig4b", "vertex_planes", "160 planes, previous method", []),
]


def main() -> None:
    """Measure and print the table."""
    print("kernel-only CPU time, one thread, unorm8, 300 x 450 (least of 11 rounds, interleaved)\n")
    print(
        f"{'scene':6} {'what':40} {'scalar ms':>9} {'lanes ms':>9} {'no skips':>9} {'x':>6} {'x no skips':>10} "
        f"{'gain':>5}"
    )
    for scene, stage, what, overrides in ROWS:
        t = measure(load_scene(scene, overrides), stage)
        print(
            f"{scene:6} {what:40} {1e3 * t.scalar_s:9.1f} {1e3 * t.skips_s:9.1f} {1e3 * t.no_skips_s:9.1f} "
            f"{t.ratio:6.2f} {t.ratio_without_skips:10.2f} {t.gain:5.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
