"""The pytest plugin as a project that has nothing but image files uses it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from atmoref.images import from_rgb, write
from atmoref.pytest_plugin import assert_matches_oracle
from atmoref.scene import load_scene
from atmoref.techniques.render import render

SMALL = ("image.width=24", "image.height=36", "technique.interval_m=5.0")
PROJECT = """
from atmoref.pytest_plugin import assert_matches_oracle

SMALL = ("image.width=24", "image.height=36", "technique.interval_m=5.0")

def test_right(oracle):
    verdict = oracle.assert_matches("good.png", "quick", overrides=SMALL, codes=0)
    assert verdict.passed

def test_wrong(oracle):
    oracle.assert_matches("bad.png", "quick", overrides=SMALL)

def test_against_a_file():
    assert_matches_oracle("good.png", "reference.png")
"""


def frame() -> np.ndarray:
    return np.asarray(render(load_scene("quick", SMALL)).buffers["frame"].codes())


def test_the_assertion_tells_what_is_wrong(tmp_path: Path) -> None:
    good = frame()
    assert assert_matches_oracle(good, "quick", overrides=SMALL, codes=0).passed
    assert assert_matches_oracle(good / 255.0, load_scene("quick", SMALL)).passed  # values against values
    alpha = np.concatenate([good, np.full((36, 24, 1), 255, np.uint8)], -1)
    write(tmp_path / "rgba.png", from_rgb(alpha, {"format": "unorm8"}))
    assert assert_matches_oracle(tmp_path / "rgba.png", "quick", overrides=SMALL).passed
    bad = good.copy()
    bad[7, 5, 1] ^= 32
    with pytest.raises(AssertionError, match=r"x = 5, y = 7, G"):
        assert_matches_oracle(bad, "quick", overrides=SMALL, report=tmp_path / "r" / "page.html")
    assert "<html" in (tmp_path / "r" / "page.html").read_text()


def test_a_project_with_image_files_alone(tmp_path: Path) -> None:
    good = frame()
    bad = good.copy()
    bad[10:20] = 255 - bad[10:20]
    for name, codes in (("good", good), ("reference", good), ("bad", bad)):
        write(tmp_path / f"{name}.png", from_rgb(codes, {"format": "unorm8"}))
    (tmp_path / "test_project.py").write_text(PROJECT)
    line = [sys.executable, "-m", "pytest", "-q", "-p", "atmoref.pytest_plugin", "-p", "no:cacheprovider",
            "--atmoref-report", "reports", "test_project.py"]  # fmt: skip
    env = {"PYTHONPATH": str(Path(__file__).parents[2]), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    import os

    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, env={**os.environ, **env}, timeout=300,
                          check=False)  # fmt: skip
    assert done.returncode == 1, done.stdout + done.stderr
    assert "2 passed" in done.stdout
    assert "1 failed" in done.stdout
    assert "does not match the oracle" in done.stdout
    (report,) = (tmp_path / "reports").iterdir()
    assert report.suffix == ".html"


def test_the_plugin_loads_nothing_heavy() -> None:
    code = "import sys, atmoref.pytest_plugin; print(sorted({'numba', 'numpy', 'pydantic'} & set(sys.modules)))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60).stdout
    assert out.strip() == "[]"
