"""The command ``atmoref``.

Exit codes: 0 all well, 1 a verdict is negative, 2 the request is wrong, 3 the machine could not do it; 128 + n where
signal n ended it.  What is asked for goes to stdout; progress, notes and the one message of a failure go to stderr.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from atmoref.cli.signals import Signalled, ended_by_signals

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; never raises.

    Parameters
    ----------
    arguments
        Without the program's name; by default those of the process.
    """
    with ended_by_signals():
        try:
            from atmoref.cli.program import run

            return run(sys.argv[1:] if arguments is None else list(arguments))
        except Signalled as early:
            return 128 + early.number  # before there was anything to say or to clean up
