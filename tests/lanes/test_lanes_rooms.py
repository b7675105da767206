"""Rooms that the key of the kernel cache leaves out make no kernels: else a stale binary could be run."""

import ast
from pathlib import Path

import pytest

import atmoref
from atmoref._jit import WITHOUT_KERNELS

PACKAGE = Path(atmoref.__file__).parent
MAKERS = {"kernel", "device", "subroutine", "overload", "intrinsic", "njit", "jit", "vectorize", "compiled_only"}


def made_kernels(source: str) -> list[str]:
    """Names of functions that are compiled, and imports of what compiles."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            names = [d.func if isinstance(d, ast.Call) else d for d in node.decorator_list]
            found += [node.name for d in names if getattr(d, "id", getattr(d, "attr", "")) in MAKERS]
        if isinstance(node, ast.ImportFrom) and node.module == "atmoref._jit":
            found += [a.name for a in node.names if a.name in MAKERS]
    return found


@pytest.mark.parametrize("room", sorted(WITHOUT_KERNELS))
def test_a_room_outside_the_key_makes_no_kernels(room: str) -> None:
    for path in (PACKAGE / room).rglob("*.py"):
        assert made_kernels(path.read_text(encoding="utf-8")) == [], path


def test_the_check_sees_a_kernel() -> None:
    assert made_kernels("from atmoref._jit import kernel\n@kernel\ndef f(x):\n    return x\n") == ["kernel", "f"]
    assert made_kernels((PACKAGE / "stages" / "beam_planes.py").read_text(encoding="utf-8"))
