"""Files that are written whole or not at all, and the store of tables that are built on first use.

A table is known by what it was built from: a kind, a version of its builder and parameters.  It comes with the package
(`luts/`) or lies in the user's cache, as an NPZ with a SHA-256 of its content inside.  Two processes that want the same
table build it once; a damaged file is noticed, reported and built again; a builder that is interrupted or killed leaves
nothing that is read later.
"""

import contextlib
import dataclasses
import errno
import hashlib
import io
import json
import logging
import math
import os
import re
import secrets
import socket
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import filelock
import numpy as np
from numpy.typing import NDArray

from atmoref._cache import cache_root, writable_root

__all__ = [
    "Parameters",
    "StoreError",
    "TableEntry",
    "atomic_path",
    "cache_root",
    "clear_tables",
    "list_tables",
    "load_or_build",
    "read_npz",
    "shipped_directory",
    "shipped_entry",
    "table_key",
    "verify_tables",
    "write_npz",
    "write_table",
]

Arrays = dict[str, NDArray[Any]]
Parameters = Mapping[str, float | int | str | list[Any]]

MAX_BYTES: Final = 1 << 32
"""Declared size above which an NPZ is refused before anything is read (4 GiB)."""

_DESCRIPTION: Final = "__table__"
_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_log = logging.getLogger(__name__)


class StoreError(ValueError):
    """A file is not what it should be: damaged, of another kind, or of absurd size."""


# ---- whole files
@contextlib.contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`, with its suffix, and move what was written there into place at the end.

    On any exception, KeyboardInterrupt included, the temporary file is removed and `path` stays as it was.  What a
    killed process left is removed when the same path is written again.

    Raises
    ------
    OSError
        If the directory is missing or full, or `path` is a directory or device.  A full disk (quota, size limit) is
        named as such.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "is not a regular file", str(path))
    if not target.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such directory", str(target.parent))
    _remove_abandoned(target)
    own = f".{target.stem}.{_host()}-{os.getpid()}-{secrets.token_hex(4)}.tmp{target.suffix}"
    temporary = target.with_name(own)
    try:
        yield temporary
        with open(temporary, "rb") as written:
            os.fsync(written.fileno())
        os.replace(temporary, target)
    except OSError as error:
        if error.errno in _NO_ROOM:
            raise OSError(error.errno, f"no room to write ({os.strerror(error.errno)})", str(path)) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def _host() -> str:
    """Return a short name of this machine, for file names."""
    return hashlib.sha256(socket.gethostname().encode()).hexdigest()[:8]


def _remove_abandoned(target: Path) -> None:
    """Remove temporary files of this target whose process, on this machine, lives no more."""
    pattern = re.compile(re.escape(f".{target.stem}.{_host()}-") + r"(\d+)-[0-9a-f]{8}\.tmp" + re.escape(target.suffix))
    for other in target.parent.iterdir():
        match = pattern.fullmatch(other.name)
        if match and not process_lives(int(match[1])):
            other.unlink(missing_ok=True)


def process_lives(process: int) -> bool:
    """Return whether a process of this number runs on this machine."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


# ---- NPZ
def write_npz(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays as an uncompressed NPZ, atomically; the same arrays give the same bytes.

    Raises
    ------
    OSError
        As `atomic_path`.
    ValueError
        If an array holds objects.
    """
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, array in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asarray(array), allow_pickle=False)


def read_npz(path: str | os.PathLike[str], *, max_bytes: int = MAX_BYTES) -> Arrays:
    """Return the arrays of an NPZ, never unpickling, and refuse one that declares more than `max_bytes`.

    Raises
    ------
    StoreError
        If the file is damaged, too large, no NPZ, or holds objects.
    OSError
        If it cannot be read at all.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            declared = sum(m.file_size for m in members)
            if declared > max_bytes:
                raise StoreError(f"{path} declares {declared} bytes; at most {max_bytes} are read")
            return {m.filename.removesuffix(".npy"): _read_member(archive, m) for m in members}
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        if isinstance(error, StoreError):
            raise
        raise StoreError(f"{path} is damaged or no NPZ: {error}") from error


def _read_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """Return one array; its bytes have passed the archive's CRC before the header is believed."""
    raw = archive.read(member)
    stream = io.BytesIO(raw)
    version = np.lib.format.read_magic(stream)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = read_header(stream)
    if dtype.hasobject:
        raise StoreError(f"{member.filename} holds objects")
    present = len(raw) - stream.tell()
    if math.prod(shape) * dtype.itemsize != present or min(shape, default=0) < 0:
        raise StoreError(f"{member.filename} declares shape {shape} of {dtype}, but holds {present} bytes")
    flat = np.frombuffer(raw, dtype, offset=stream.tell())
    return flat.reshape(shape, order="F" if fortran else "C").copy(order="K")


# ---- tables
@dataclasses.dataclass(frozen=True, slots=True)
class TableEntry:
    """A table in the cache: what it is, where it lies, and what is wrong with it, if anything."""

    path: Path
    bytes: int
    kind: str = ""
    version: int = 0
    parameters: str = ""  # canonical JSON, floats as hexadecimal
    sha256: str = ""
    problem: str | None = None


def _canonical(value: Any) -> Any:
    """Return a parameter in a form whose JSON is unique; floats keep every bit."""
    if isinstance(value, bool | int | str) and not isinstance(value, np.generic):
        return value
    if isinstance(value, float):
        return {"float": float(value).hex()}
    if isinstance(value, list | tuple):
        return [_canonical(v) for v in value]
    raise TypeError(
        f"a table's parameter is a float, int, str or list of them, found {type(value).__name__}: {value!r}"
    )


def _describe(kind: str, version: int, parameters: Parameters) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_]*", kind):
        raise ValueError(f"a table's kind is a lower-case name, found {kind!r}")
    plain = {name: _canonical(value) for name, value in parameters.items()}
    return json.dumps({"kind": kind, "version": version, "parameters": plain}, sort_keys=True, separators=(",", ":"))


def table_key(kind: str, version: int, parameters: Parameters) -> str:
    """Return the SHA-256 that names a table: of its kind, builder's version and parameters."""
    return hashlib.sha256(_describe(kind, version, parameters).encode()).hexdigest()


def _content_hash(arrays: Arrays) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f"{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _directory() -> Path:
    directory = writable_root() / "tables"
    directory.mkdir(parents=True, exist_ok=True)
    return directory


def _read_table(path: Path, expected: str | None = None) -> tuple[dict[str, Any], Arrays]:
    """Return description and arrays of a table whose content agrees with its hash, or raise StoreError."""
    arrays = read_npz(path)
    try:
        description = json.loads(arrays.pop(_DESCRIPTION).tobytes())
        kept, text = description["sha256"], description["table"]
    except (KeyError, TypeError, ValueError) as error:
        raise StoreError(f"{path} is no table of this program") from error
    if expected is not None and text != expected:
        raise StoreError(f"{path} describes another table")
    if kept != _content_hash(arrays):
        raise StoreError(f"{path} has content that differs from its SHA-256")
    return description, arrays


def load_or_build(
    kind: str,
    version: int,
    parameters: Parameters,
    build: Callable[[], Mapping[str, NDArray[Any]]],
    *,
    must_keep: bool = False,
) -> Arrays:
    """Return a table from the cache, or build it and keep it there.

    Parameters
    ----------
    kind
        What the table is, a lower-case name.
    version
        Of the builder: raised whenever the same parameters would give other numbers.
    parameters
        Everything else that the numbers depend on.
    build
        Returns the arrays; called at most once, in one process at a time for equal tables.
    must_keep
        Whether a table that cannot be written (disk full) is an error; otherwise it is returned with a warning.

    Returns
    -------
    dict
        The arrays, C-contiguous and writable, the same bits whether loaded or built.

    Raises
    ------
    OSError
        With `must_keep`, if there is no room.
    TypeError, ValueError
        If kind, parameters or the built arrays are not of the kinds that can be stored.
    """
    text = _describe(kind, version, parameters)
    path = _directory() / _file_name(kind, text)
    for place in (shipped_directory(), path.parent):
        found = None if place is None else _try_read(place / path.name, text)
        if found is not None:
            return found
    with _locked(path):
        found = _try_read(path, text)
        if found is not None:
            return found
        arrays = {name: np.array(array, order="C") for name, array in build().items()}
        _keep(path, text, arrays, must_keep)
        return arrays


def _file_name(kind: str, text: str) -> str:
    return f"{kind}-{hashlib.sha256(text.encode()).hexdigest()[:32]}.npz"


def shipped_directory() -> Path | None:
    """Return where the tables that come with the package lie: inside an installed copy, beside one in a repository."""
    package = Path(__file__).parent
    return next((place for place in (package / "luts", package.parent / "luts") if place.is_dir()), None)


def write_table(
    directory: Path, kind: str, version: int, parameters: Parameters, arrays: Mapping[str, NDArray[Any]]
) -> TableEntry:
    """Write a table under its name into any directory and return what was written; the same arrays, the same bytes."""
    text = _describe(kind, version, parameters)
    path = directory / _file_name(kind, text)
    _keep(path, text, {name: np.array(array, order="C") for name, array in arrays.items()}, must_keep=True)
    return _entry(path)


def shipped_entry(kind: str, version: int, parameters: Parameters) -> TableEntry | None:
    """Return the shipped table of these parameters, or None if none is shipped."""
    place, name = shipped_directory(), _file_name(kind, _describe(kind, version, parameters))
    return None if place is None or not (place / name).is_file() else _entry(place / name)


def _try_read(path: Path, text: str) -> Arrays | None:
    """Return a table's arrays, or None if it is absent or damaged."""
    try:
        return _read_table(path, text)[1]
    except FileNotFoundError:
        return None
    except (StoreError, OSError) as error:
        _log.warning("a stored table is unusable and is built again: %s", error)
        return None


def _keep(path: Path, text: str, arrays: Arrays, must_keep: bool) -> None:
    """Write a table; failing that, raise or warn."""
    if _DESCRIPTION in arrays:
        raise ValueError(f"{_DESCRIPTION} is no name for an array of a table")
    description = json.dumps({"table": text, "sha256": _content_hash(arrays)}).encode()
    try:
        write_npz(path, arrays | {_DESCRIPTION: np.frombuffer(description, np.uint8)})
    except OSError as error:
        if must_keep:
            raise
        _log.warning("a table cannot be kept and will be built again next time: %s", error)


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock of a table; the system frees it when its holder dies."""
    lock = filelock.FileLock(path.with_suffix(".lock"))
    try:
        lock.acquire(timeout=1.0)
    except filelock.Timeout:
        _log.info("waiting for another process that builds %s", path.name)
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


def list_tables(directory: Path | None = None) -> list[TableEntry]:
    """Return the tables in a directory (the cache), by name; damaged ones with their problem."""
    place = _directory() if directory is None else directory
    return [_entry(path) for path in sorted(place.glob("*.npz")) if not path.name.startswith(".")]


def verify_tables() -> list[TableEntry]:
    """Return the tables in the cache that are damaged or no tables of this program (the content hash is checked)."""
    return [entry for entry in list_tables() if entry.problem]


def _entry(path: Path) -> TableEntry:
    size = path.stat().st_size
    try:
        description, _ = _read_table(path)
        about = json.loads(description["table"])
        parameters = json.dumps(about["parameters"], sort_keys=True)
        return TableEntry(path, size, about["kind"], about["version"], parameters, description["sha256"])
    except (KeyError, TypeError, ValueError, OSError) as error:
        return TableEntry(path, size, problem=str(error))


def clear_tables() -> int:
    """Remove all tables from the cache, except those being built, and return how many were removed."""
    removed = 0
    for path in _directory().iterdir():
        if path.suffix == ".npz" and not path.name.startswith("."):
            lock = filelock.FileLock(path.with_suffix(".lock"))
            with contextlib.suppress(filelock.Timeout), lock.acquire(timeout=0):
                path.unlink(missing_ok=True)
                removed += 1
    return removed
