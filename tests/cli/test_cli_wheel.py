"""The wheel: installed in a place of its own that cannot be written, it renders every bundled scene from anywhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from atmoref.images import read
from atmoref.scene import bundled_names

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel of this checkout, built from a copy (so that the checkout stays as it is)."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("atmoref", "luts"):
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md"):
        shutil.copy(ROOT / name, source / name)
    line = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder / "dist"), str(source)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = (folder / "dist").glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory with the wheel's content, read-only; libraries come from this environment."""
    place = tmp_path_factory.mktemp("site-packages")
    line = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-compile"]
    subprocess.run([*line, "--target", str(place), str(wheel)], check=True, timeout=300)
    for path in [*place.rglob("*"), place]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    return place


def atmoref(place: Path, cwd: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the installed copy; kernels and tables go into a cache of its own."""
    environment = {**os.environ, "PYTHONPATH": str(place), "ATMOREF_CACHE_DIR": str(place.parent / "cache")}
    line = [sys.executable, "-P", "-m", "atmoref", *arguments]
    return subprocess.run(line, cwd=cwd, env=environment, capture_output=True, text=True, check=False, timeout=600)


def test_the_wheel_is_small_and_whole(wheel: Path) -> None:
    assert wheel.stat().st_size < 25e6
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {f"atmoref/scene/bundled/{name}.toml" for name in bundled_names()} <= names
    pictures = {path.name for path in (ROOT / "atmoref" / "scene" / "bundled").glob("*.png")}
    assert pictures
    assert {f"atmoref/scene/bundled/{name}" for name in pictures} <= names
    assert {f"atmoref/luts/{path.relative_to(ROOT / 'luts')}" for path in (ROOT / "luts").rglob("*.*")} <= names
    assert "atmoref/py.typed" in names
    assert not [name for name in names if name.startswith(("tests/", "validation/"))]


def test_it_renders_every_bundled_scene_from_elsewhere(installed: Path, tmp_path: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in installed.rglob("*")}
    told = atmoref(installed, tmp_path, "doctor")
    assert f"shipped_tables  {installed / 'atmoref' / 'luts'}" in told.stdout, told.stdout + told.stderr
    for name in bundled_names():
        small = ["--set", "image.width=48", "--set", "image.height=64"] if name != "quick" else []
        done = atmoref(installed, tmp_path, "render", name, *small, "-o", f"{name}.exr", "--png", f"{name}.png")
        assert done.returncode == 0, done.stderr
        assert read(tmp_path / f"{name}.exr").rgb().max() > 0.1
        assert read(tmp_path / f"{name}.png").shape == ((64, 48) if small else (180, 120))
    assert {path: path.stat().st_mtime_ns for path in installed.rglob("*")} == before
