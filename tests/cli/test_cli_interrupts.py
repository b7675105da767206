"""Ctrl-C, kill and a full disk leave nothing behind; what a killed process left is removed by the next one."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import pytest
from cli_runs import SMALL, command, failures, process, refused, well

LONG = ("--set", "image.width=3000", "--set", "image.height=4500")  # some seconds in warm kernels


@pytest.fixture(scope="module", autouse=True)
def _warm() -> None:
    """Compile what the processes below run."""
    assert process("render", "quick", *SMALL, "--stats", "json").code == 0


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def listens() -> None:
    """Hear Ctrl-C again: what a shell starts in the background ignores it, and so would its children."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def stopped(line: list[str], cwd: Path, number: int, wait_for: str | None, delay_s: float = 0.0) -> tuple[int, str]:
    """Return exit code and stderr of a process that got a signal once a path exists, or after a delay."""
    with subprocess.Popen(
        line, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=listens
    ) as child:
        until = time.monotonic() + 60.0
        while wait_for is not None and not list(cwd.glob(wait_for)) and time.monotonic() < until:
            assert child.poll() is None, "it ended too early"
            time.sleep(0.005)
        time.sleep(delay_s)
        child.send_signal(number)
        _, err = child.communicate(timeout=120)
        return child.returncode, err


@pytest.mark.parametrize(("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
def test_a_signal_during_the_dump_leaves_nothing(tmp_path: Path, number: int, word: str) -> None:
    line = command("render", "quick", "--stages", "st", "-o", "x.exr", "--png", "x.png")
    code, err = stopped(line, tmp_path, number, ".st.*/*slab_002*")
    assert (code, failures(err)) == (128 + number, f"error: {word}\n")
    assert names(tmp_path) == []


@pytest.mark.parametrize("delay_s", [0.6, 1.5, 2.5])
def test_a_signal_at_any_time_leaves_nothing(tmp_path: Path, delay_s: float) -> None:
    code, err = stopped(command("render", "quick", *LONG, "-o", "x.exr"), tmp_path, signal.SIGINT, None, delay_s)
    assert code == 130
    assert "Traceback" not in err
    assert names(tmp_path) == []


def test_the_next_dump_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    line = command("render", "quick", "--stages", "st", "-o", "x.exr")
    code, _ = stopped(line, tmp_path, signal.SIGKILL, ".st.*/*slab_002*")
    assert code == -signal.SIGKILL
    assert all(name.startswith(".st.") for name in names(tmp_path))
    well("render", "quick", *SMALL, "--stages", tmp_path / "st")
    assert names(tmp_path) == ["st"]


def test_an_earlier_dump_survives_an_interrupted_one(tmp_path: Path) -> None:
    well("render", "quick", *SMALL, "--stages", tmp_path / "st")
    before = {path.name: path.read_bytes() for path in (tmp_path / "st").iterdir()}
    code, _ = stopped(command("render", "quick", "--stages", "st"), tmp_path, signal.SIGINT, ".st.*/*slab_002*")
    assert code == 130
    assert names(tmp_path) == ["st"]
    assert {path.name: path.read_bytes() for path in (tmp_path / "st").iterdir()} == before


def full_disk() -> None:
    """Let no file grow beyond 4 KB, as a full disk would (the system then says EFBIG instead of ENOSPC)."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))


@pytest.mark.parametrize("output", [("-o", "x.exr"), ("-o", "x.npz"), ("--png", "x.png"), ("--stages", "x")])
def test_a_full_disk_is_named(tmp_path: Path, output: tuple[str, str]) -> None:
    done = process("render", "quick", *output, cwd=tmp_path, before=full_disk)
    refused(done, 3, output[1], "no room to write")
    assert names(tmp_path) == []


def test_a_full_disk_keeps_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "x.exr").write_bytes(b"old")
    refused(process("render", "quick", "-o", "x.exr", cwd=tmp_path, before=full_disk), 3, "x.exr")
    assert (tmp_path / "x.exr").read_bytes() == b"old"


@pytest.mark.skipif(
    os.geteuid() == 0 and not Path("/usr/bin/setpriv").exists(), reason="optional: setpriv, to lose rights"
)
def test_a_directory_without_permission_is_named(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o555)
    prefix = ["/usr/bin/setpriv", "--bounding-set=-all", "--inh-caps=-all"] if os.geteuid() == 0 else []
    done = process("render", "quick", "-o", "closed/x.exr", cwd=tmp_path, prefix=prefix)
    refused(done, 3, "closed", "Permission denied")


def test_a_reader_that_goes_away_is_no_error(tmp_path: Path) -> None:
    line = f"{' '.join(command('techniques', 'beams'))} | head -c 10"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stderr == ""
    assert done.returncode in (0, 141)
