"""``atmoref doctor``: what this machine and this installation can do."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import platform
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

_NEEDED = (
    "numpy", "numba", "llvmlite", "scipy", "scikit-image", "OpenEXR", "flip-evaluator", "pydantic", "typer", "rich",
    "filelock", "platformdirs", "pillow",
)  # fmt: skip
_EXTRAS = {
    "report": ("matplotlib", "jinja2"),
    "mesh": ("trimesh",),
    "cluster": ("dask", "distributed"),
    "vdb": ("tinyvdb",),
    "gpu": ("moderngl", "wgpu"),
    "peers": ("mitsuba", "miepython", "PythonicDISORT", "mpmath"),
}
_FEATURES = ("sse2", "sse4.1", "avx", "avx2", "fma", "avx512f", "avx512vl")


def doctor(as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of lines.")] = False) -> None:
    """Tell versions, processor, cache, memory, and which optional parts are there."""
    told = examine()
    if as_json:
        typer.echo(json.dumps(told, indent=2))
        return
    for heading, section in told.items():
        typer.echo(f"{heading}:")
        for name, value in section.items():
            typer.echo(f"  {name:<16}{', '.join(value) if isinstance(value, list) else value}")


def examine() -> dict[str, dict[str, Any]]:
    """Return what `doctor` prints, section by section."""
    from atmoref import __version__

    versions = {"atmoref": __version__, "python": sys.version.split()[0]}
    versions |= {name: _version(name) for name in _NEEDED}
    return {
        "versions": versions,
        "platform": _platform(),
        "processor": _processor(),
        "cache": _cache(),
        "memory": _memory(),
        "extras": {name: _extra(modules) for name, modules in _EXTRAS.items()},
    }


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


def _platform() -> dict[str, Any]:
    tested = sys.platform == "linux" and platform.machine() in ("x86_64", "AMD64")
    support = "tested here: Linux on x86-64" if tested else "not tested: only Linux on x86-64 is; bits may differ here"
    return {"system": platform.platform(), "machine": platform.machine(), "support": support}


def _processor() -> dict[str, Any]:
    import llvmlite.binding as llvm

    from atmoref.lanes import N
    from atmoref.pipeline import default_threads

    features = llvm.get_host_cpu_features()
    return {
        "name": llvm.get_host_cpu_name(),
        "features": [name for name in _FEATURES if features.get(name)],
        "processors": default_threads(),
        "lane_width": N,
    }


def _cache() -> dict[str, Any]:
    from atmoref._cache import cache_root, writable_root
    from atmoref._jit import CACHE_DIRECTORY
    from atmoref.store import shipped_directory

    wanted, used = cache_root(), writable_root()
    return {
        "wanted": str(wanted),
        "writable": "yes" if used == wanted else f"no; {used} is used instead, which may not last",
        "kernel_key": CACHE_DIRECTORY.name,
        "kernels": f"{sum(1 for _ in CACHE_DIRECTORY.rglob('*.nbc'))} compiled, {_megabytes(CACHE_DIRECTORY):.1f} MB",
        "tables": f"{sum(1 for _ in (used / 'tables').glob('*.npz'))}, {_megabytes(used / 'tables'):.1f} MB",
        "shipped_tables": str(shipped_directory() or "missing"),
    }


def _megabytes(directory: Path) -> float:
    return sum(path.stat().st_size for path in directory.rglob("*") if path.is_file()) / 1e6


def _memory() -> dict[str, Any]:
    from atmoref.memory import available_bytes

    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    free = available_bytes()
    return {
        "physical": f"{whole / 1e9:.1f} GB",
        "available": f"{free / 1e9:.1f} GB",
        "default_limit": f"{free / 2e9:.1f} GB for one image (--max-memory)",
    }


def _extra(modules: tuple[str, ...]) -> str:
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    return "missing: " + ", ".join(missing) if missing else "there"
