"""GLSL programs: includes, switches that are fixed when a shader is built, uniforms from the mirror's named tuples."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from atmoref.elementary import EXP_SINGLE
from atmoref.stages.ray_cast import Solids

SHADERS = Path(__file__).parent / "shaders"
_INCLUDE = re.compile(r'^#include "([a-z_.]+)"$', re.MULTILINE)


def source(name: str, defines: Mapping[str, int | float]) -> str:
    """Return a shader's text with its includes, and with `defines` after the line that names the version."""

    def included(match: re.Match[str]) -> str:
        return (SHADERS / match[1]).read_text(encoding="utf-8")

    text = _INCLUDE.sub(included, (SHADERS / name).read_text(encoding="utf-8"))
    version, rest = text.split("\n", 1)
    lines = [f"#define {key} {value!r}" for key, value in defines.items()]
    return "\n".join((version, *lines, "#line 2", rest))


def exp_constants() -> dict[str, float]:
    """Return the constants of the mirror's float32 exp, so that they stand in one place only."""
    c = EXP_SINGLE
    named = {"EXP_LEAST": c.least, "EXP_MOST": c.most, "EXP_LN2_HIGH": c.ln2_high, "EXP_LN2_LOW": c.ln2_low}
    return named | {f"EXP_{i}": term for i, term in enumerate(c.terms)}


def build(context: Any, vertex: str, fragment: str, defines: Mapping[str, int | float]) -> Any:
    """Return the program of two shaders."""
    every = {**defines, **exp_constants()}
    return context.program(vertex_shader=source(vertex, every), fragment_shader=source(fragment, every))


def put(program: Any, name: str, value: Any) -> None:
    """Set a uniform, or every member of a struct from the named tuple of the same fields.

    The mirror keeps uniforms as float64 and rounds them once to float32 when a kernel starts; so does this call.
    Compilers drop what no path uses, so a name that the program does not have is let pass.
    """
    if hasattr(value, "_asdict"):
        for field, member in value._asdict().items():
            put(program, f"{name}.{field}", member)
    elif name in program:
        program[name].value = value


def put_array(program: Any, name: str, values: Any, dtype: str = "f4") -> None:
    """Set an array uniform."""
    if name in program:
        program[name].write(np.ascontiguousarray(values, dtype).tobytes())


def solid_counts(solids: Solids) -> dict[str, int]:
    """Return how many objects there are of each kind, as switches."""
    return {
        "SPHERES": len(solids.spheres), "BOXES": len(solids.boxes), "GROUNDS": len(solids.grounds),
        "OBJECTS": solids.albedo.size // 3,
    }  # fmt: skip


def put_solids(program: Any, solids: Solids) -> None:
    """Set the objects of `ray_cast.glsl`."""
    put_array(program, "spheres", solids.spheres)
    put_array(program, "sphere_scales", 1.0 / solids.spheres[:, 3])
    put_array(program, "sphere_ids", solids.sphere_ids, "i4")
    put_array(program, "box_lows", solids.boxes[:, :3])
    put_array(program, "box_highs", solids.boxes[:, 3:])
    put_array(program, "box_ids", solids.box_ids, "i4")
    put_array(program, "grounds", solids.grounds)
    put_array(program, "ground_ids", solids.ground_ids, "i4")
    put_array(program, "albedo", solids.albedo)


def put_all(program: Any, uniforms: Mapping[str, Any], order: Sequence[str]) -> None:
    """Set several structs."""
    for name in order:
        put(program, name, uniforms[name])
