# mypy: allow-untyped-calls
# (Numba is untyped)
"""The only place that names Numba's flags and says where compiled kernels are kept.

`kernel` marks what Python calls, `device` what kernels call.  Floats follow IEEE 754: no fastmath, no fused
multiply-add, 1/0 is infinite.  Kernels release the GIL and are cached on disk.

The cache directory carries a key over everything that can change a binary: the text of every module of the rooms that
hold kernels (Numba itself watches only the file in which a kernel stands, not the helpers that are inlined into it),
the lane width, the versions of Numba and Python.  An edit there starts an empty directory; directories not used for 30
days are removed.  Numba keys each entry further by signature and by the processor's name and features.
"""

import contextlib
import hashlib
import itertools
import logging
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import filelock
import numba
from numba.core import bytecode, caching, config

from atmoref._cache import writable_root

KEEP_SECONDS: Final = 30 * 86400
WITHOUT_KERNELS: Final = frozenset(
    ("cases", "cli", "compare", "export", "images", "judge", "memory.py", "report", "scene", "sequence", "techniques")
)
"""Rooms whose modules no kernel is made from (a test looks): editing them keeps every binary."""
_UNCALLED: Final = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Helpers of lanes are called by kernels alone: entries for Python would hold two more copies of what they inline."""
settings: Any = config  # Numba sets its names at run time
_njit: Any = numba.njit  # its stubs do not know `_nrt`
# Numba numbers functions from 1 in every process and names their symbols so.  Kernels that two processes compiled and a
# third loads would then call each other's helpers, where those are no longer inlined: numbers start at random instead.
bytecode.FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(5), "big"))
_log = logging.getLogger(__name__)
_decorating = threading.RLock()


def _width() -> int:
    """Return the lane width of this process: `ATMOREF_LANES`, 16 by default."""
    text = os.environ.get("ATMOREF_LANES", "16")
    if text not in ("1", "2", "4", "8", "16", "32"):
        raise ValueError(f"ATMOREF_LANES is {text!r}; allowed are 1, 2, 4, 8, 16, 32")
    return int(text)


LANES: Final = _width()


def _key() -> str:
    """Return the hash of everything that can change a compiled kernel, apart from signature and processor."""
    package = Path(__file__).parent
    digest = hashlib.sha256(f"{LANES} {numba.__version__} {sys.version}".encode())
    for path in sorted(package.rglob("*.py")):
        if path.relative_to(package).parts[0] in WITHOUT_KERNELS:
            continue
        digest.update(f"\0{path.relative_to(package)}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:24]


def _prune(kernels: Path, keep: Path) -> None:
    """Mark one directory as used now and remove those unused for `KEEP_SECONDS`."""
    os.utime(keep)
    for other in kernels.iterdir():
        if other != keep and time.time() - other.stat().st_mtime > KEEP_SECONDS:
            shutil.rmtree(other, ignore_errors=True)


def _directory() -> Path:
    """Return the directory of this process's compiled kernels, made and pruned."""
    kernels = writable_root() / "kernels"
    directory = kernels / _key()
    directory.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(OSError):  # another process may be pruning, too
        _prune(kernels, directory)
    return directory


CACHE_DIRECTORY: Final = _directory()


class _KernelCache(caching.FunctionCache):
    """Numba's cache, safe for several processes, and never a reason to fail.

    Numba updates index and data file one after the other without a lock: two processes that compile two signatures of
    one kernel can leave an entry that names the other's binary.  Here both steps are under one file lock, for readers
    as well.  A damaged entry counts as absent; a full disk leaves the kernel uncached.
    """

    def _lock(self) -> filelock.BaseFileLock:
        return filelock.FileLock(Path(self._cache_path) / f"{self._impl.filename_base}.lock", timeout=60.0)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            with self._lock():
                return super().load_overload(sig, target_context)
        except Exception as error:  # a damaged pickle may raise anything
            _log.warning("compiled kernel %s is unreadable and is built again: %r", self._name, error)
            with contextlib.suppress(OSError), self._lock():
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            with self._lock():
                super().save_overload(sig, data)
        except OSError as error:
            _log.warning("compiled kernel %s cannot be kept in %s: %s", self._name, self._cache_path, error)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile an entry point that Python calls: GIL released, IEEE arithmetic, cached on disk.

    Without Numba's reference counting: kernels allocate nothing, and counting every array of a tuple of textures
    around each helper cost ten times the arithmetic (1.17 s against 0.1 s for Figure 4 (c)).
    """
    dispatcher = _njit(error_model="numpy", nogil=True, fastmath=False, _nrt=False)(function)
    with _decorating:  # other packages' kernels keep their own directory
        before = settings.CACHE_DIR
        settings.CACHE_DIR = str(CACHE_DIRECTORY)
        try:
            dispatcher._cache = _KernelCache(function)
        finally:
            settings.CACHE_DIR = before
    return dispatcher


def device(function: Callable[..., Any]) -> Any:
    """Compile a helper that is inlined wherever a kernel calls it: lanes then stay in registers."""
    return _njit(error_model="numpy", fastmath=False, forceinline=True, _nrt=False, **_UNCALLED)(function)


def subroutine(function: Callable[..., Any]) -> Any:
    """Compile a helper that stays a call where LLVM sees no gain: long code on a path that is rarely taken."""
    return _njit(error_model="numpy", fastmath=False, _nrt=False)(function)
