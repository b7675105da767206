"""Run the command: in this process, or as a process of its own."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from atmoref.cli import main

SMALL = ("--set", "image.width=24", "--set", "image.height=36")


@dataclass(frozen=True)
class Run:
    """What came of it."""

    code: int
    out: str
    err: str


def run(*arguments: object) -> Run:
    """Run in this process; nothing is raised."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main([str(argument) for argument in arguments])
    return Run(code, out.getvalue(), err.getvalue())


def well(*arguments: object) -> Run:
    """Run in this process and expect success."""
    done = run(*arguments)
    assert done.code == 0, done.err
    return done


def command(*arguments: object) -> list[str]:
    """Return the command line of a process."""
    return [sys.executable, "-m", "atmoref", *(str(argument) for argument in arguments)]


def process(
    *arguments: object,
    cwd: Path | None = None,
    before: Callable[[], None] | None = None,
    environment: dict[str, str] | None = None,
    prefix: Sequence[str] = (),
) -> Run:
    """Run as a process."""
    line = [*prefix, *command(*arguments)]
    done = subprocess.run(
        line, cwd=cwd, preexec_fn=before, env={**os.environ, **(environment or {})}, capture_output=True, text=True,
        timeout=300, check=False,
    )  # fmt: skip
    return Run(done.returncode, done.stdout, done.stderr)


def failures(err: str) -> str:
    """Return stderr without the notice that kernels are compiled, which the first run on a machine gives."""
    return "".join(line for line in err.splitlines(keepends=True) if not line.startswith("compiling kernels"))


def refused(done: Run, code: int, *fragments: str) -> None:
    """Assert exit code, exactly one message that holds the fragments, and nothing on stdout."""
    assert done.code == code, done.err
    assert failures(done.err).startswith("error: ")
    assert done.err.count("error: ") == 1
    assert "Traceback" not in done.err
    assert "defect of atmoref" not in done.err
    assert done.out == ""
    for fragment in fragments:
        assert fragment in done.err
