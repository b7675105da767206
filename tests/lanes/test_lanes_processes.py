"""What only other processes can show: widths, processors, and the cache of compiled kernels."""

import itertools
import json
import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import atmoref

SAMPLE = Path(__file__).with_name("sample_kernel.py")
FLOOR = ["_jit.py", "_cache.py", "elementary.py", "lanes"]


def run(what: str, house: Path, cache: Path, preexec: Callable[[], None] | None = None, **environment: str) -> Any:
    """Run the sample over a copy of the package; return what it printed, with its standard error as "log"."""
    settings = os.environ | {"PYTHONPATH": str(house), "ATMOREF_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
    for name in ("ATMOREF_LANES", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"):
        settings.pop(name, None)
    done = subprocess.run(
        [sys.executable, str(SAMPLE), what],
        env=settings | environment,
        preexec_fn=preexec,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout) | {"log": done.stderr}


def copy_floor(to: Path) -> Path:
    """Copy the rooms that compile kernels, so that edits elsewhere in the checkout do not matter; return the path."""
    source, target = Path(atmoref.__file__).parent, to / "atmoref"
    target.mkdir(parents=True)
    (target / "__init__.py").write_text('"""The lowest floor."""\n')
    for name in FLOOR:
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source / name, target)
    return to


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_floor(tmp_path_factory.mktemp("house"))


@pytest.fixture(scope="module")
def cold(house: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """Return the first run of the small kernel, and its cache."""
    cache = tmp_path_factory.mktemp("cache")
    return run("small", house, cache), cache


def copied(cache: Path, to: Path) -> Path:
    return Path(shutil.copytree(cache, to))


SATURATED = [23.74193572998047, 32 * 16.0]  # of 32 values 0 ... 2: sum of min(x, 1); centres 1/2 ... 31 1/2


def test_results_do_not_depend_on_width_or_processor(house: Path, tmp_path: Path) -> None:
    """Three runs; `test_every_width_on_every_processor` makes all nine."""
    compare_results(house, tmp_path, [("16", "native"), ("8", "AVX2 and FMA"), ("1", "SSE2")])


@pytest.mark.slow
def test_every_width_on_every_processor(house: Path, tmp_path: Path) -> None:
    compare_results(house, tmp_path, list(itertools.product(["1", "8", "16"], PROCESSORS)))


PROCESSORS: dict[str, dict[str, str]] = {
    "native": {},
    "AVX2 and FMA": {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""},
    "SSE2": {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""},
}


def compare_results(house: Path, cache: Path, variants: list[tuple[str, str]]) -> None:
    """Run the large sample per lane width and processor; all hashes must be equal."""

    def value(variant: tuple[str, str]) -> str:
        width, processor = variant
        return run("everything", house, cache, ATMOREF_LANES=width, **PROCESSORS[processor])["value"]

    with ThreadPoolExecutor(2) as pool:
        values = dict(zip(variants, pool.map(value, variants), strict=True))
    assert len(set(values.values())) == 1, values


def test_second_process_uses_the_cache(house: Path, cold: tuple[Any, Path]) -> None:
    first, cache = cold
    assert (first["misses"], first["hits"], first["log"]) == (1, 0, "")
    assert Path(first["directory"]).parent == cache / "kernels"
    second = run("small", house, cache)
    assert (second["misses"], second["hits"], second["log"]) == (0, 1, "")
    assert second["value"] == first["value"] == SATURATED


def test_an_edit_in_a_helper_never_meets_a_stale_binary(cold: tuple[Any, Path], tmp_path: Path) -> None:
    other = copy_floor(tmp_path / "other")
    helper = other / "atmoref" / "lanes" / "arith.py"
    before = helper.read_text()
    after = before.replace("minimum(maximum(x, 0.0), 1.0)", "minimum(maximum(x, 0.0), 0.5)")
    assert after != before
    cache = tmp_path / "cache"
    original = run("small", other, cache)
    state = helper.stat()
    helper.write_text(after)
    os.utime(helper, ns=(state.st_atime_ns, state.st_mtime_ns))  # the same time and size: content decides
    edited = run("small", other, cache)
    helper.write_text(before)
    restored = run("small", other, cache)
    assert original["value"] == restored["value"] == SATURATED
    assert edited["value"][0] == pytest.approx(sum(min(2 * i / 31, 0.5) for i in range(32)))
    assert (edited["hits"], restored["hits"]) == (0, 1)


def test_width_is_part_of_the_key(house: Path, cold: tuple[Any, Path]) -> None:
    first, cache = cold
    narrow = run("small", house, cache, ATMOREF_LANES="4")
    assert (narrow["lanes"], narrow["hits"], narrow["value"]) == (4, 0, SATURATED)
    assert narrow["directory"] != first["directory"]


@pytest.mark.parametrize("damage", ["cut index", "cut data", "noise in data", "another pickle"])
def test_damaged_entries_are_built_again(house: Path, cold: tuple[Any, Path], tmp_path: Path, damage: str) -> None:
    cache = copied(cold[1], tmp_path / "cache")
    pattern = "*.nbi" if "index" in damage else "*.nbc"
    files = list(cache.rglob(pattern))
    assert files
    for file in files:
        content = file.read_bytes()
        spoilt = {"noise in data": b"\x93" * len(content), "another pickle": b"N."}
        file.write_bytes(spoilt.get(damage, content[: len(content) // 2]))
    again = run("small", house, cache)
    assert again["value"] == SATURATED
    assert run("small", house, cache)["hits"] == 1


def test_unwritable_cache_falls_back_to_a_private_directory(house: Path, tmp_path: Path) -> None:
    blocked = tmp_path / "a file"
    blocked.touch()
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    first = run("small", house, blocked / "cache", TMPDIR=str(temporary))
    second = run("small", house, blocked / "cache", TMPDIR=str(temporary))
    assert first["value"] == second["value"] == SATURATED
    assert (second["hits"], second["log"]) == (1, "")
    own = temporary / f"atmoref-{os.getuid()}"
    assert Path(first["directory"]).is_relative_to(own)
    assert own.stat().st_mode & 0o077 == 0
    own.chmod(0o777)  # others could have put kernels there: not used any more
    third = run("small", house, blocked / "cache", TMPDIR=str(temporary))
    assert (third["hits"], third["value"]) == (0, SATURATED)
    assert not Path(third["directory"]).is_relative_to(own)
    assert not Path(third["directory"]).exists()  # removed on exit


def test_full_disk_leaves_the_kernel_uncached(house: Path, tmp_path: Path) -> None:
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
    done = run("small", house, tmp_path, preexec=limit)
    assert done["value"] == SATURATED
    assert "cannot be kept" in done["log"]
    assert not list(tmp_path.rglob("*.tmp*"))


def test_processes_that_compile_at_once_do_not_disturb_each_other(house: Path, tmp_path: Path) -> None:
    with ThreadPoolExecutor(3) as pool:
        runs = list(pool.map(lambda _: run("small", house, tmp_path), range(3)))
    assert [r["value"] for r in runs] == [SATURATED] * 3
    assert run("small", house, tmp_path)["hits"] == 1


def test_directories_unused_for_a_month_are_removed(house: Path, cold: tuple[Any, Path], tmp_path: Path) -> None:
    cache = copied(cold[1], tmp_path / "cache")
    old, recent = (cache / "kernels" / name for name in ("old", "recent"))
    for directory, days in ((old, 31), (recent, 29)):
        directory.mkdir()
        (directory / "kernel.nbc").touch()
        os.utime(directory, (time.time() - days * 86400,) * 2)
    assert run("small", house, cache)["hits"] == 1
    assert not old.exists()
    assert recent.exists()


def test_wrong_width_is_refused(house: Path, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="ATMOREF_LANES is '7'; allowed are 1, 2, 4, 8, 16, 32"):
        run("small", house, tmp_path, ATMOREF_LANES="7")
