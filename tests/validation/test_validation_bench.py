"""The script behind `make bench` runs, writes what it says, and fills its page."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from reference.timing import Timing

from atmoref.scene import bundled_names
from atmoref.techniques import TECHNIQUES
from validation import bench, bench_ratios

PAGE = Path(__file__).parents[2] / "docs" / "benchmarks.md"


def test_a_quick_run_fills_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "docs" / "benchmarks.md"
    page.parent.mkdir()
    page.write_text(PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    assert bench.main(["--quick", "-o", str(tmp_path / "out"), "--write", str(page)]) == 0
    record = json.loads((tmp_path / "out" / "bench.json").read_text(encoding="utf-8"))
    assert {(c["scene"], c["technique"]) for c in record["costs"]} == {
        (s, t) for s in bundled_names() for t in TECHNIQUES
    }
    filled = page.read_text(encoding="utf-8")
    assert all(f"| {name}" in filled for name in bundled_names())
    assert (tmp_path / "out" / "bench.txt").read_text(encoding="utf-8").strip() == capsys.readouterr().out.strip()
    for picture in (tmp_path / "out" / "growth.png", page.parent / "images" / "error_against_time.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_ratios_are_of_the_times_that_were_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_ratios, "measure", lambda scene, stage, rounds: Timing(0.001, 0.002, 0.01, 197))
    rows = bench_ratios.scalar_table().splitlines()[2:]
    assert len(rows) == len(bench_ratios.SCALAR)
    assert [c.strip() for c in rows[0].split("|")[3:-1]] == ["10.0", "1.0", "2.0", "10.00", "5.00", "2.00"]
    told = "  planes: OpenGL 1126.3 ms, mirror 86.6 ms of CPU; ratio 13.01 (median of 5; neighbours 12 to 14)"
    answers = [subprocess.CompletedProcess([], 0, told, "")] * len(bench_ratios.OPENGL)
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: answers.pop())
    table = bench_ratios.opengl_table()
    assert table is not None
    assert table.count("13.01") == len(bench_ratios.OPENGL)
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: subprocess.CompletedProcess([], 3, "", "no OpenGL context"))
    assert bench_ratios.opengl_table() is None


def test_a_page_without_markers_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- bench:costs -->\nold\n<!-- /bench:costs -->\n", encoding="utf-8")
    bench.write_page(page, {"costs": "new"})
    assert page.read_text(encoding="utf-8") == "<!-- bench:costs -->\n\nnew\n\n<!-- /bench:costs -->\n"
    with pytest.raises(ValueError, match="growth"):
        bench.write_page(page, {"growth": "x"})
