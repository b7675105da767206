"""What went wrong, as an exit code and one message."""

from __future__ import annotations

import os
import signal
import sys

from atmoref.cli.signals import Signalled

NEGATIVE, WRONG_REQUEST, NOT_POSSIBLE = 1, 2, 3
SIGNALLED = 128
_SIGNALS: dict[int, str] = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGPIPE: ""}
"""What is said; nothing where nobody reads any more."""


class RequestError(ValueError):
    """What was asked for on the command line is wrong; the message says what is allowed."""


def verdict_of(error: BaseException) -> tuple[int, str]:
    """Return the exit code for an exception, and its message (empty: nothing is to be said)."""
    if isinstance(error, KeyboardInterrupt):
        return SIGNALLED + signal.SIGINT, _SIGNALS[signal.SIGINT]
    if isinstance(error, Signalled):
        return SIGNALLED + error.number, _SIGNALS.get(error.number, f"ended by signal {error.number}")
    if isinstance(error, _wrong_requests()):
        return WRONG_REQUEST, str(error)
    if isinstance(error, MemoryError):
        own = type(error).__name__ == "OutOfMemory"
        return NOT_POSSIBLE, str(error) if own else f"out of memory: {error}".removesuffix(": ")
    if isinstance(error, OSError):
        return NOT_POSSIBLE, _told(error)
    if isinstance(error, _broken_machine()):
        return NOT_POSSIBLE, str(error)
    return NOT_POSSIBLE, (
        f"{type(error).__name__}: {error} "
        "(a defect of atmoref, not of the request; with ATMOREF_TRACEBACK=1 it says where)"
    )


def _wrong_requests() -> tuple[type[BaseException], ...]:
    from atmoref.compare import CompareError
    from atmoref.images import ImageError
    from atmoref.scene import SceneError

    loaded = sys.modules.get("atmoref.judge.dumps")  # nothing raises its error where it was never imported
    dump_errors = () if loaded is None else (loaded.DumpError,)
    return RequestError, SceneError, ImageError, CompareError, *dump_errors


def _broken_machine() -> tuple[type[BaseException], ...]:
    from atmoref.scene.mesh_files import MissingExtra
    from atmoref.store import StoreError

    return StoreError, MissingExtra


def _told(error: OSError) -> str:
    reason = error.strerror or str(error) or type(error).__name__
    return f"{os.fsdecode(error.filename)}: {reason}" if isinstance(error.filename, str | bytes) else reason
