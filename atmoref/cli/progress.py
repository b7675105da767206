"""What is said while one waits: a bar on a terminal after a second, and a line when kernels are compiled."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator
from typing import Any

DELAY_S = 1.0


def note(text: str) -> None:
    """Print a line to stderr, beside the answer."""
    print(text, file=sys.stderr, flush=True)


class Waiting:
    """A progress bar on stderr that appears after `DELAY_S`, and only on a terminal.

    Call it with the name of what is being done and the fraction done; without a fraction it just moves.
    """

    def __init__(self, title: str) -> None:
        self.title = title
        self._bar: Any = None
        self._task: Any = None
        self._state: tuple[str, float | None] = (title, None)
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None

    def __enter__(self) -> Waiting:
        if sys.stderr.isatty():
            self._timer = threading.Timer(DELAY_S, self._appear)
            self._timer.daemon = True
            self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = None
            bar, self._bar = self._bar, None
        if bar is not None:
            bar.stop()

    def __call__(self, name: str, fraction: float | None = None) -> None:
        """Show what is being done, and how much of it is."""
        self._state = (name, fraction)
        with self._lock:
            if self._bar is not None:
                self._show()

    def rows(self, done: int, total: int) -> None:
        """Show that so many rows of all are done."""
        self(self.title, done / max(total, 1))

    def note(self, text: str) -> None:
        """Print a line above the bar."""
        with self._lock:
            if self._bar is not None:
                self._bar.console.print(text, markup=False, highlight=False)
                return
        note(text)

    def _appear(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

        with self._lock:
            if self._timer is None:  # done already
                return
            columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task(self.title, total=None)
            self._show()
            self._bar.start()

    def _show(self) -> None:
        name, fraction = self._state
        self._bar.update(
            self._task, description=name, total=None if fraction is None else 1.0, completed=fraction or 0.0
        )


_told = threading.Event()  # that kernels are being compiled: a process says so once


@contextlib.contextmanager
def working(title: str) -> Iterator[Waiting]:
    """Yield a `Waiting` for work that runs kernels; says so, once, if any must be compiled."""
    from numba.core import event

    from atmoref._jit import CACHE_DIRECTORY

    with Waiting(title) as waiting:

        class Announcement(event.Listener):
            """Numba tells the start of every compilation; what comes out of the cache is none."""

            def on_start(self, event: Any) -> None:
                if not _told.is_set():
                    _told.set()
                    waiting.note(
                        "compiling kernels for this machine: a minute or two, the first time only "
                        f"(they are kept in {CACHE_DIRECTORY})"
                    )

            def on_end(self, event: Any) -> None:
                pass

        listener = Announcement()
        event.register("numba:compile", listener)
        try:
            yield waiting
        finally:
            event.unregister("numba:compile", listener)
