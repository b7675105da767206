"""Dumps of a GPU build: a directory of buffers and a manifest, read with suspicion, and a helper that writes one.

The layout is that of ``atmoref render --stages``: ``manifest.json`` lists entries, each with the draw after which a
buffer was read, the buffer's name, its format, and a file beside the manifest.  Row 0 is the top row.  A file is an
EXR, NPY or NPZ of codes (unsigned integers) or values.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.buffers.formats import FORMATS, Format
from atmoref.images import ImageError, read

MANIFEST = "manifest.json"
KIND = "atmoref stages"
SUFFIXES = (".exr", ".npy", ".npz")
MANIFEST_BYTES = 16 << 20
MOST_ENTRIES = 100_000
CODE_SLACK = 1e-2  # of a code: how far a value of a unorm buffer may lie from the code it stands for
_KEYS = ("draw", "buffer", "format", "file")


class DumpError(ValueError):
    """A dump that cannot be judged; the message names file, entry and what is allowed."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One buffer as the build stored it: after draw `draw` ("" for a texture that exists before the first draw)."""

    draw: str
    buffer: str
    format: Format
    path: Path

    @property
    def name(self) -> str:
        """What messages call it."""
        return f"{self.draw or 'texture'} -> {self.buffer}"


@dataclass(frozen=True, slots=True)
class DumpDirectory:
    """A directory of draw dumps and what its manifest says."""

    path: Path
    entries: tuple[Entry, ...]
    told: dict[str, Any]

    def find(self, draw: str, buffer: str) -> Entry | None:
        """Return the entry of a draw and buffer, or None where the build dumped none."""
        return next((e for e in self.entries if e.draw == draw and e.buffer == buffer), None)


def open_dump(directory: Path) -> DumpDirectory:
    """Return a directory's entries; files are opened later, one by one.

    Raises
    ------
    DumpError
        No manifest, one of another kind, wrong entries, or files outside the directory.
    """
    path = Path(directory)
    if not path.is_dir():
        raise DumpError(f"{path}: no such directory; allowed: a directory with {MANIFEST} and the files it lists")
    content = _manifest(path)
    listed = content.get("draws")
    if not isinstance(listed, list) or not 1 <= len(listed) <= MOST_ENTRIES:
        raise DumpError(f"{path / MANIFEST}: draws: allowed: a list of 1 to {MOST_ENTRIES} entries")
    root = path.resolve()
    entries = tuple(_entry(path, root, at, item) for at, item in enumerate(listed))
    seen: set[tuple[str, str]] = set()
    for at, entry in enumerate(entries):
        if (entry.draw, entry.buffer) in seen:
            raise DumpError(f"{path / MANIFEST}: draws.{at}: {entry.name} is listed twice")
        seen.add((entry.draw, entry.buffer))
    return DumpDirectory(path, entries, content)


def _manifest(path: Path) -> dict[str, Any]:
    where = path / MANIFEST
    try:
        if where.is_symlink() or not where.is_file():
            raise DumpError(f"{where}: no such file; a dump without a manifest is not finished")
        if where.stat().st_size > MANIFEST_BYTES:
            raise DumpError(f"{where}: {where.stat().st_size} bytes, more than the limit of {MANIFEST_BYTES}")
        content = json.loads(where.read_text("utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise DumpError(f"{where}: no JSON ({error})") from error
    except OSError as error:
        raise DumpError(f"{where}: cannot be read ({error.strerror or error})") from error
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise DumpError(f'{where}: allowed: a table with kind = "{KIND}"')
    if content.get("manifest") != 1:
        raise DumpError(f"{where}: manifest: found {_short(content.get('manifest'))}; allowed: 1")
    if content.get("crop") is not None:
        raise DumpError(f"{where}: crop: found {_short(content['crop'])}; allowed: null, whole buffers are judged")
    return content


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _entry(path: Path, root: Path, at: int, item: Any) -> Entry:
    place = f"{path / MANIFEST}: draws.{at}"
    if not isinstance(item, dict):
        raise DumpError(f"{place}: found {_short(item)}; allowed: a table with {', '.join(_KEYS)}")
    for key in _KEYS:
        if not isinstance(item.get(key), str):
            raise DumpError(f"{place}.{key}: found {_short(item.get(key))}; allowed: a text")
    if item["format"] not in FORMATS:
        raise DumpError(f"{place}.format: found {_short(item['format'])}; allowed: {', '.join(FORMATS)}")
    name = item["file"]
    plain = name not in ("", ".", "..") and not set(name) & set("/\\\0:")
    if not plain or Path(name).suffix.lower() not in SUFFIXES:
        raise DumpError(
            f"{place}.file: found {_short(name)}; allowed: the name of a file beside the manifest "
            f"that ends in {', '.join(SUFFIXES)}"
        )
    file = path / name
    try:
        inside = file.resolve().parent == root
        regular = file.is_file()
    except (OSError, ValueError, RuntimeError) as error:
        raise DumpError(f"{place}.file: {_short(name)} cannot be looked up ({error})") from error
    if not inside:
        raise DumpError(f"{place}.file: {_short(name)} is a link out of the directory; allowed: files in it")
    if not regular:
        raise DumpError(f"{place}.file: {file} does not exist or is no file")
    return Entry(item["draw"], item["buffer"], FORMATS[item["format"]], file)


def read_entry(entry: Entry, shape: tuple[int, int, int]) -> NDArray[Any]:
    """Return what a buffer held, (H, W, C), row 0 at the top: codes of a unorm format, else numbers.

    Parameters
    ----------
    entry : Entry
    shape : (height, width, channels)
        Of the mirror's buffer. One channel stands for three equal ones, and alpha is left out.

    Raises
    ------
    DumpError
        The file cannot be read, has another size, or holds what its format cannot.
    """
    height, width, channels = shape
    try:
        image = read(entry.path, max_bytes=height * width * 4 * 8 + (1 << 16))
    except ImageError as error:
        raise DumpError(f"{error} (buffer of {width} x {height} x {channels} expected)") from error
    if image.shape != (height, width):
        raise DumpError(
            f"{entry.path}: {image.shape[1]} x {image.shape[0]} texels; allowed: {width} x {height}, "
            f"the size of {entry.buffer} in the mirror"
        )
    names = [name for name in ("R", "G", "B") if name in image.channels] or list(image.channels)[:1]
    if len(names) not in (1, 3):
        raise DumpError(f"{entry.path}: channels {', '.join(image.channels)}; allowed: R, G, B, or Y alone")
    planes = [image.channels[name] for name in names]
    if channels == 1 and len(planes) == 3 and not all(np.array_equal(planes[0], plane) for plane in planes[1:]):
        raise DumpError(f"{entry.path}: three different channels; allowed: one, as {entry.buffer} in the mirror")
    found = np.stack((planes * channels)[:channels], axis=-1)
    return _stored(entry, found)


def _stored(entry: Entry, found: NDArray[Any]) -> NDArray[Any]:
    """Return codes, or numbers of the format's own type."""
    fmt = entry.format
    if found.dtype.kind == "f" and not np.isfinite(found).all():
        y, x, _ = (int(i) for i in np.argwhere(~np.isfinite(found))[0])
        raise DumpError(f"{entry.path}: {entry.name} has NaN or infinity at x = {x}, y = {y}")
    if fmt.kind != "unorm":
        if found.dtype.kind == "u":
            raise DumpError(
                f"{entry.path}: integers; allowed: numbers, as format {fmt.name} of {entry.buffer} has them"
            )
        return found.astype(fmt.storage)
    if found.dtype.kind == "u":
        if int(found.max()) > fmt.top:
            raise DumpError(f"{entry.path}: code {found.max()}; allowed: 0 ... {fmt.top} ({fmt.name})")
        return found.astype(fmt.storage)
    scaled = found.astype(np.float64) * fmt.top
    codes = np.rint(scaled)
    slack = max(CODE_SLACK, fmt.top * 2.0**-22)  # float32 holds a value of depth24 to about a code
    if codes.min() < 0.0 or codes.max() > fmt.top or np.abs(scaled - codes).max() > slack:
        y, x, _ = (int(i) for i in np.unravel_index(int(np.abs(scaled - codes).argmax()), codes.shape))
        raise DumpError(
            f"{entry.path}: {entry.name} holds values that no code of {fmt.name} has, for example "
            f"{found[y, x].tolist()} at x = {x}, y = {y}; allowed: code / {fmt.top}, or the codes themselves"
        )
    return codes.astype(fmt.storage)


class DumpWriter:
    """Writes a dump that `check` reads: one NPY file a buffer, and the manifest last.

    >>> import tempfile, numpy as np
    >>> folder = tempfile.TemporaryDirectory()
    >>> writer = DumpWriter(folder.name, about="my engine 1.2")
    >>> writer.add("opaque", "frame", "unorm8", np.zeros((4, 6, 3), np.uint8))
    >>> writer.close()
    >>> len(open_dump(Path(folder.name)).entries)
    1
    >>> folder.cleanup()

    Parameters
    ----------
    directory : path
        Made if it does not exist.
    about : str
        Free text about the build, repeated in verdicts.
    bottom_first : bool
        Are arrays given with row 0 at the bottom, as glReadPixels returns them? They are turned then.
    """

    def __init__(self, directory: str | os.PathLike[str], about: str = "", *, bottom_first: bool = False) -> None:
        self.directory = Path(directory)
        self.directory.mkdir(parents=True, exist_ok=True)
        self.about, self.bottom_first = about, bottom_first
        self._entries: list[dict[str, Any]] = []

    def add(self, draw: str, buffer: str, fmt: str, texels: ArrayLike) -> None:
        """Write what `buffer` holds after `draw`: codes of a unorm format, else numbers; (H, W) or (H, W, 1 to 4).

        Raises
        ------
        DumpError
            The format is not known.
        """
        if fmt not in FORMATS:
            raise DumpError(f"{draw}: format: found {fmt!r}; allowed: {', '.join(FORMATS)}")
        array = np.asarray(texels)
        array = np.ascontiguousarray(array[::-1] if self.bottom_first else array)
        file = f"{len(self._entries):04d}.{(draw or buffer).replace('/', '.')}.npy"
        np.save(self.directory / file, array, allow_pickle=False)
        digest = hashlib.sha256(np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes()).hexdigest()
        self._entries.append({"draw": draw, "buffer": buffer, "format": fmt, "file": file, "sha256": digest})

    def close(self) -> None:
        """Write the manifest; without one a directory is no dump."""
        content = {"kind": KIND, "manifest": 1, "about": self.about, "crop": None, "draws": self._entries}
        (self.directory / MANIFEST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
