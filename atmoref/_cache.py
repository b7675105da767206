"""Where atmoref keeps what it can rebuild: compiled kernels and tables.  Imports no Numba."""

import atexit
import contextlib
import functools
import logging
import os
import shutil
import tempfile
from pathlib import Path

import platformdirs

_log = logging.getLogger(__name__)


def cache_root() -> Path:
    """Return the user's cache directory of atmoref (it need not exist yet).

    `ATMOREF_CACHE_DIR` overrides the platform's choice (on Linux `~/.cache/atmoref`).
    """
    override = os.environ.get("ATMOREF_CACHE_DIR")
    return Path(override).absolute() if override else Path(platformdirs.user_cache_dir("atmoref"))


def writable_root() -> Path:
    """Return `cache_root()`, or a private directory under the system's temporary one where that cannot be written.

    The substitute is shared by the processes of one user and refused when anybody else could have written it, since
    compiled kernels are executed as found; then, as a last resort, it is a directory of this process alone.
    """
    return _writable(cache_root())


@functools.lru_cache(maxsize=8)
def _writable(root: Path) -> Path:
    if _usable(root):
        return root
    substitute = Path(tempfile.gettempdir()) / f"atmoref-{os.getuid()}"
    with contextlib.suppress(OSError):
        substitute.mkdir(mode=0o700, exist_ok=True)
        state = substitute.lstat()
        if state.st_uid == os.getuid() and not state.st_mode & 0o077 and _usable(substitute):
            _log.info("%s cannot be written; %s is used instead", root, substitute)
            return substitute
    own = Path(tempfile.mkdtemp(prefix="atmoref-"))
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    _log.info("%s cannot be written; %s is used instead, for this process only", root, own)
    return own


def _usable(directory: Path) -> bool:
    """Tell whether a file can be made in the directory, which is created if need be."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False
