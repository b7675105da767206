"""Sharing an image's rows among threads: kernels release the GIL, rows never meet, bits do not depend on the number."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import NamedTuple

__all__ = ["Crop", "Progress", "make_crop", "run_rows"]

Progress = Callable[[int, int], None]
_BLOCK = 8  # rows in one job: some milliseconds of work


class Crop(NamedTuple):
    """A rectangle of pixels; column ``x`` and row ``y`` are its top left corner, row 0 is the image's top."""

    x: int
    y: int
    width: int
    height: int


def make_crop(crop: tuple[int, int, int, int] | None, width: int, height: int) -> Crop:
    """Return a crop (x, y, width, height) of an image, all of it for None.

    Raises
    ------
    ValueError
        If it is empty or reaches beyond the image.
    """
    if crop is None:
        return Crop(0, 0, width, height)
    x, y, w, h = (int(value) for value in crop)
    if x < 0 or y < 0 or w < 1 or h < 1 or x + w > width or y + h > height:
        raise ValueError(f"crop (x, y, width, height) = {(x, y, w, h)} is not inside the image of {width} x {height}")
    return Crop(x, y, w, h)


def run_rows(
    compute: Callable[[int, int], None], rows: int, threads: int | None, progress: Progress | None = None
) -> None:
    """Call ``compute(first, last)`` for blocks of rows from a pool of threads, and report how many rows are done.

    Parameters
    ----------
    compute
        Fills the rows [first, last); called from several threads at once.
    rows
        How many there are.
    threads
        At least 1; None takes every processor this process may use.
    progress
        Called in this thread as ``progress(done, rows)``, ``done`` rising to ``rows``.

    Raises
    ------
    ValueError
        For less than one thread.
    """
    count = len(os.sched_getaffinity(0)) if threads is None else threads
    if count < 1:
        raise ValueError(f"threads = {count}: at least 1 is needed")
    done = 0
    if progress:
        progress(done, rows)
    with ThreadPoolExecutor(count) as pool:
        jobs = {pool.submit(compute, a, min(a + _BLOCK, rows)): min(_BLOCK, rows - a) for a in range(0, rows, _BLOCK)}
        try:
            for job in as_completed(jobs):
                job.result()
                done += jobs[job]
                if progress:
                    progress(done, rows)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
