"""How much memory may be taken, and what takes how much: asked before it is taken, in bytes of the whole process."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

PROGRAM_BYTES = 190_000_000  # interpreter, libraries, compiled kernels: 160 to 182 MB measured (Linux, Python 3.11)

UNLIMITED = 1 << 62


class OutOfMemory(MemoryError):
    """More memory would be needed than is allowed; raised before anything is allocated."""


@dataclass(slots=True)
class Account:
    """What a process may hold, and what is known to be held.

    Parameters
    ----------
    origin : str
        What messages call the scene file.
    limit : int or None
        Bytes, or no limit.
    kept : int
        Bytes that stay taken: the program's own, and what was entered with ``keep``.
    """

    origin: str
    limit: int | None
    kept: int = PROGRAM_BYTES

    def require(self, needed: int, what: str, *, keep: bool = False) -> None:
        """Refuse what would not fit beside what is kept.

        Raises
        ------
        OutOfMemory
        """
        if self.limit is not None and self.kept + needed > self.limit:
            total = math.ceil((self.kept + needed) / 1e5) / 10.0
            raise OutOfMemory(
                f"{self.origin}: {what} would need {total:.1f} MB with the program and all else so far; "
                f"allowed: {self.limit / 1e6:g} MB (--max-memory)"
            )
        if keep:
            self.kept += needed

    @property
    def room(self) -> int:
        """How many bytes may still be taken."""
        return UNLIMITED if self.limit is None else max(self.limit - self.kept, 0)


def available_bytes() -> int:
    """Return the physical memory that is free for this process, bytes."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            for line in lines:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def allowed_bytes(max_memory: int | None) -> int:
    """Return the limit that was asked for, else half of what is available."""
    return max_memory if max_memory is not None else available_bytes() // 2
