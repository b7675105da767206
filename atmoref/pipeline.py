"""Passes over named buffers, draw by draw: the order in which a GPU build works, and the means to look inside.

A pass is one or more draws of one stage.  `run` executes whole passes, row blocks on a pool of threads; with a `watch`
it goes draw by draw instead, so that every stored value can be dumped, or replaced by a GPU's (`inject`).  Both orders
give the same bits, because all state between draws lives in the buffers.
"""

import itertools
import os
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.layout import Buffer

Bank = dict[str, Buffer]
Execute = Callable[[int, int, int, int], None]  # draws [d0, d1) of rows [row0, row1)
Watch = Callable[[str, "Pass", Bank], None]
Progress = Callable[[str, float], None]  # pass name, fraction done

BLOCKS_PER_THREAD = 8  # row blocks a thread works through: progress, balance, and prompt interruption


@dataclass(frozen=True, slots=True)
class Pass:
    """One stage over one set of buffers.

    Parameters
    ----------
    name : str
    draws : tuple of str
        Names in GPU order; a draw stores into the buffer that `stores` names for it.
    rows : int
        Rows of the image it writes.
    execute : callable (d0, d1, row0, row1)
        Draws a range of draws over a range of rows (row 0 at the bottom); releases the GIL.
    stores : tuple of str
        Per draw, the buffer that holds its result.
    window : (row0, row1) or None
        Rows to draw, if not all.
    """

    name: str
    draws: tuple[str, ...]
    rows: int
    execute: Execute
    stores: tuple[str, ...]
    window: tuple[int, int] | None = None


@dataclass(slots=True)
class Timing:
    """Seconds spent per pass: wall clock, and CPU of all threads of this process."""

    wall_s: dict[str, float] = field(default_factory=dict)
    cpu_s: dict[str, float] = field(default_factory=dict)


def default_threads() -> int:
    """Return the number of processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _blocks(row0: int, row1: int, count: int) -> list[tuple[int, int]]:
    edges = [row0 + (row1 - row0) * i // count for i in range(count + 1)]
    return [(a, b) for a, b in itertools.pairwise(edges) if a < b]


def _run_pass(p: Pass, d0: int, d1: int, pool: ThreadPoolExecutor | None, threads: int, progress: Progress) -> None:
    row0, row1 = p.window or (0, p.rows)
    blocks = _blocks(row0, row1, max(1, threads * BLOCKS_PER_THREAD))
    if pool is None:
        for i, (a, b) in enumerate(blocks):
            p.execute(d0, d1, a, b)
            progress(p.name, (i + 1) / len(blocks))
        return
    futures = [pool.submit(p.execute, d0, d1, a, b) for a, b in blocks]
    try:
        for i, future in enumerate(futures):
            future.result()
            progress(p.name, (i + 1) / len(futures))
    except BaseException:
        for future in futures:
            future.cancel()
        raise


def _no_progress(name: str, fraction: float) -> None:
    """Tell nobody."""


def run(
    passes: Iterable[Pass],
    bank: Bank,
    *,
    threads: int | None = None,
    watch: Watch | None = None,
    inject: Mapping[str, NDArray[Any]] | None = None,
    progress: Progress | None = None,
) -> Timing:
    """Execute passes in order; return their times.

    Parameters
    ----------
    passes : iterable of Pass
    bank : dict of Buffer
        Read and written in place.
    threads : int or None
        Row blocks run on that many threads (None: all processors); bits do not depend on it.
    watch : callable (draw name, pass, bank) or None
        Called after every draw; execution is then draw by draw.
    inject : mapping of draw name to (H, W, C) array, or None
        After that draw its buffer is replaced by these codes or values (row 0 at the top).
    progress : callable (pass name, fraction) or None

    Returns
    -------
    Timing

    Raises
    ------
    KeyError
        If `inject` names a draw that does not exist; nothing is executed then.
    """
    todo = list(passes)
    supplied = dict(inject or {})
    known = {name for p in todo for name in p.draws}
    if unknown := sorted(set(supplied) - known):
        raise KeyError(f"no draw named {unknown[0]!r}; there are, for example, {', '.join(sorted(known)[:4])}")
    count = threads or default_threads()
    timing, report = Timing(), progress or _no_progress
    pool = ThreadPoolExecutor(count, thread_name_prefix="atmoref") if count > 1 else None
    try:
        for p in todo:
            wall, cpu = time.perf_counter(), time.process_time()
            if watch is None and not supplied.keys() & set(p.draws):
                _run_pass(p, 0, len(p.draws), pool, count, report)
            else:
                for d, name in enumerate(p.draws):
                    _run_pass(p, d, d + 1, pool, count, _no_progress)
                    if name in supplied:
                        bank[p.stores[d]].put(np.asarray(supplied[name]))
                    if watch is not None:
                        watch(name, p, bank)
                    report(p.name, (d + 1) / len(p.draws))
            timing.wall_s[p.name] = time.perf_counter() - wall
            timing.cpu_s[p.name] = time.process_time() - cpu
    finally:
        if pool is not None:
            pool.shutdown(wait=True, cancel_futures=True)
    return timing
