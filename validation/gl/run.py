"""Render a scene with OpenGL or Vulkan and with the mirror, compare them stage by stage, and time both.

    python validation/gl/run.py fig4c --format unorm8 --format float32 --stages
    python validation/gl/run.py fig4b --time
    python validation/gl/run.py fig4c --api vulkan --set technique.coordinates=pixel

Exit codes: 0 all well, 1 fewer pixels agree than --least asks for, 2 the request is wrong, 3 no such device here.
"""

from __future__ import annotations

import argparse
import importlib
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

from atmoref.scene import SceneError
from validation.gl.case import FORMATS, Case, Unsupported, load


def arguments(given: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene", help="a scene file or the name of a bundled one")
    parser.add_argument("--format", action="append", choices=FORMATS, help="of the frame; may be repeated")
    parser.add_argument("--technique", help="instead of the scene's own")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the scene")
    parser.add_argument("--api", choices=("opengl", "vulkan"), default="opengl", help="which build (default opengl)")
    parser.add_argument("--stages", action="store_true", help="one line a stage, each on the mirror's own input")
    parser.add_argument("--time", action="store_true", help="time the planes: CPU, one thread each, in turns")
    parser.add_argument("--runs", type=int, default=11, help="of the timing (default 11)")
    parser.add_argument("--native-exp", action="store_true", help="exp of the device instead of the mirror's")
    parser.add_argument("--no-discard", action="store_true", help="OpenGL blends fragments without light as well")
    parser.add_argument("--scissor", action="store_true", help="OpenGL draws planes only where the light can reach")
    parser.add_argument("--mesh-in-shader", action="store_true", help="the fragment interpolates, within the triangle")
    parser.add_argument("--least", type=float, default=0.0, help="least fraction of equal pixels for exit code 0")
    asked = parser.parse_args(given)
    own = ("time", "native_exp", "no_discard", "scissor", "mesh_in_shader")
    wrong = [f"--{name.replace('_', '-')}" for name in own if getattr(asked, name)]
    if asked.api == "vulkan" and wrong:
        parser.error(f"{', '.join(wrong)}: of the OpenGL build alone")
    return asked


def device(asked: argparse.Namespace) -> tuple[str, Any]:
    """Return the device's name and a function that makes a build of a case."""
    if asked.api == "vulkan":
        vulkan = importlib.import_module("validation.vulkan.build")
        gpu = vulkan.context()
        return vulkan.name_of(gpu), lambda case: vulkan.Build(gpu, case)
    build = importlib.import_module("validation.gl.build")
    ctx = build.context()

    def make(case: Case) -> Any:
        return build.Build(
            ctx, case, native_exp=asked.native_exp, discard=not asked.no_discard, scissor=asked.scissor,
            mesh_in_shader=asked.mesh_in_shader,
        )  # fmt: skip

    return f"{ctx.info['GL_RENDERER']}, OpenGL {ctx.info['GL_VERSION']}", make


def line(found: Any) -> str:
    """Return one comparison as text."""
    x, y = found.where
    tail = "" if found.equal == found.pixels else f"  worst {found.worst} ({found.apart:.3g}) at x {x}, y {y}"
    return f"  {found.stage:<34} {found.fraction:.6f} equal{tail}"


def compare(case: Case, build: Any, stages: bool) -> float:
    """Print how far both are apart; return the fraction of equal pixels of the picture."""
    from validation.gl.agreement import stages as each
    from validation.gl.agreement import whole

    found = list(each(case, build))
    if stages:
        print(*map(line, found), sep="\n")
    equal = sum(f.equal == f.pixels for f in found)
    print(f"  {equal} of {len(found)} stages equal in every bit; worst fraction {min(f.fraction for f in found):.6f}")
    picture = whole(case, build)
    print(line(picture))
    return picture.fraction


def report_times(case: Case, build: Any, runs: int) -> None:
    """Print CPU times of the planes."""
    from validation.gl.clock import planes

    times = planes(case, build, runs)
    low, high = times.spread
    print(
        f"  planes: OpenGL {1e3 * statistics.median(times.device):.1f} ms, "
        f"mirror {1e3 * statistics.median(times.mirror):.1f} ms of CPU; ratio {times.ratio:.2f} "
        f"(median of {runs}; neighbours {low:.2f} to {high:.2f})"
    )


def main(given: Sequence[str] | None = None) -> int:
    """Run; return the exit code."""
    asked = arguments(given)
    try:
        name, make = device(asked)
    except ImportError as missing:
        print(f"error: {missing}; install the extra: pip install 'atmoref[gpu]'", file=sys.stderr)
        return 3
    except Exception as failure:  # moderngl raises its own, without a common base
        print(f"error: no {asked.api} device ({failure}); install Mesa: make system-deps", file=sys.stderr)
        return 3
    print(name)
    least = 1.0
    try:
        for fmt in asked.format or [None]:
            chosen = [] if fmt is None else [f"buffers.format={fmt}"]
            for case in load(asked.scene, [*asked.set, *chosen], asked.technique):
                print(f"{case.scene.name}, {case.technique}, {case.format} {case.image.rstrip('/')}")
                build = make(case)
                least = min(least, compare(case, build, asked.stages))
                if asked.time:
                    report_times(case, build, asked.runs)
    except (SceneError, Unsupported) as wrong:
        print(f"error: {wrong}", file=sys.stderr)
        return 2
    return 0 if least >= asked.least else 1


if __name__ == "__main__":
    sys.exit(main())
