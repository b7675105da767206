"""GL builds as an engine's: dumped with their own read-backs and judged by `check`; mutants are caught and named."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

from atmoref.judge.check import check
from atmoref.scene import load_scene
from validation.gl.case import DEVICE, FORMATS, load
from validation.gl.programs import SHADERS

try:
    BUILD: Any = importlib.import_module("validation.gl.build")
    CONTEXT: Any = BUILD.context()
    MISSING = ""
except Exception as failure:  # no moderngl, no EGL, no driver: each has exceptions of its own
    BUILD = CONTEXT = None
    MISSING = f"optional: no OpenGL ({failure}); make system-deps, pip install moderngl"

LLVMPIPE = CONTEXT is not None and "llvmpipe" in CONTEXT.info["GL_RENDERER"]
pytestmark = [
    pytest.mark.skipif(CONTEXT is None, reason=MISSING),
    pytest.mark.skipif(CONTEXT is not None and not LLVMPIPE, reason="the rules are those of llvmpipe"),
]
SMALL = ("image.width=60", "image.height=90")
BUILDS = (
    ("quick", None, ("technique.interval_m=3.0",)),
    ("two_lights", None, ("technique.interval_m=4.0", "image.height=40")),
    ("quick", "beams_vertex", ("technique.interval_m=3.0", "technique.planes=12")),
)


def verdict(folder: Path, name: str, technique: str | None, fmt: str, overrides: tuple[str, ...]) -> Any:
    from validation.gl.dump import write_dump

    changes = (*SMALL, *overrides, f"buffers.format={fmt}")
    (case,) = load(name, changes, technique)
    CONTEXT.blend_func = 1, 1
    write_dump(BUILD.Build(CONTEXT, case), folder)
    return check(folder, load_scene(name, (*changes, f"buffers.device={DEVICE}")), technique=technique)


@pytest.mark.parametrize("fmt", FORMATS)
def test_a_correct_build_has_no_pixel_outside(tmp_path: Path, fmt: str) -> None:
    found = verdict(tmp_path, "quick", None, fmt, ("technique.interval_m=3.0",))
    assert found.passed
    assert sum(draw.off for draw in found.draws) == 0


@pytest.mark.slow
@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize(("name", "technique", "overrides"), BUILDS)
def test_correct_builds_have_no_pixel_outside(
    tmp_path: Path, name: str, technique: str | None, overrides: tuple[str, ...], fmt: str
) -> None:
    kept = tuple(o for o in overrides if technique is None or "interval" not in o)
    kept = tuple(o for o in kept if technique is not None or "planes" not in o)
    found = verdict(tmp_path, name, technique, fmt, kept)
    assert found.passed, [draw.name for draw in found.draws if not draw.passed]
    assert sum(draw.outside for draw in found.draws) == 0


@pytest.mark.parametrize(
    "name", ["no shadows", "blend factors ONE, ZERO for sub-planes", "q table read half a texel off"]
)
def test_a_mutant_is_caught_and_named(name: str) -> None:
    run = importlib.import_module("validation.mutants.run")
    mutants = importlib.import_module("validation.mutants.variants").MUTANTS
    at, mutant = next((at, one) for at, one in enumerate(mutants) if one.name == name)
    found = run.outcome(CONTEXT, at, mutant, [mutant.home])
    assert found.caught
    assert found.stage_right
    assert found.kind_right, found.told


def test_every_patch_of_a_mutant_finds_its_place() -> None:
    """Mutants are texts replaced in the shaders: who edits a shader sees here which mutants go with it."""
    mutants = importlib.import_module("validation.mutants.variants").MUTANTS
    shaders = "\n".join(path.read_text(encoding="utf-8") for path in SHADERS.iterdir())
    lost = [(one.name, old) for one in mutants for old, _ in one.patches if old not in shaders]
    assert lost == []


@pytest.mark.slow
def test_mutants_are_caught_and_named() -> None:
    run = importlib.import_module("validation.mutants.run")
    mutants = importlib.import_module("validation.mutants.variants").MUTANTS
    assert len(mutants) >= 25
    found = [run.outcome(CONTEXT, at, mutant, FORMATS) for at, mutant in enumerate(mutants)]
    held = [one for one in found if one.held_out]
    assert [one.name for one in found if not one.caught] == []
    assert sum(one.stage_right for one in found) >= 0.9 * len(found)
    assert sum(one.kind_right for one in held) >= 0.75 * len(held)
