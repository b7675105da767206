"""``--stages DIR``: what every draw stored, as images, and a manifest that names them."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import secrets
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from atmoref.cli.failures import RequestError
from atmoref.cli.pictures import Attributes, attributes, check_directory
from atmoref.images import Image, from_rgb, write
from atmoref.store import process_lives

if TYPE_CHECKING:
    from atmoref.buffers.layout import Buffer
    from atmoref.cli.answering import Request
    from atmoref.pipeline import Bank, Pass
    from atmoref.scene import Result

MANIFEST = "manifest.json"
KIND = "atmoref stages"
_TEXTURES = ("q", "q_rest", "light_map")  # made by the host, before the first draw


class Dump:
    """Writes buffers while they are drawn; `entries` is what the manifest lists.

    Parameters
    ----------
    directory
        Where the files go.
    request
        What is rendered.
    """

    def __init__(self, directory: Path, request: Request) -> None:
        self.directory = directory
        self.request = request
        self.entries: list[dict[str, Any]] = []
        self._begun = False

    def watch(self, draw: str, step: Pass, bank: Bank) -> None:
        """Dump what a draw stored: f_h of a slab once, after its last sub-plane; everything else after every draw."""
        if not self._begun:
            self._begun = True
            for name, buffer in bank.items():
                if name.rpartition("/")[2] in _TEXTURES:
                    self._keep(name, "", "texture", buffer)
        place = step.draws.index(draw)
        stored = step.stores[place]
        gathered_further = stored == "f_h" and place + 1 < len(step.draws) and step.stores[place + 1] == "f_h"
        if gathered_further or draw.endswith("/upload") or stored not in bank:
            return
        self._keep(draw, draw, step.name, bank[stored])
        depth = stored.removesuffix("frame") + "depth"
        if draw.endswith("opaque") and "light_" not in draw and depth in bank:
            self._keep(f"{draw}/depth", draw, step.name, bank[depth])

    def _keep(self, name: str, draw: str, step: str, buffer: Buffer) -> None:
        codes, values = buffer.codes(), buffer.values()
        size = self.request.scene.image
        if self.request.crop is not None and is_layer(buffer) and buffer.width == size.width:
            x, y, w, h = self.request.crop
            codes, values = (np.ascontiguousarray(a[y : y + h, x : x + w]) for a in (codes, values))
        file = name.replace("/", ".") + (".npz" if buffer.format.name == "float64" else ".exr")
        told: Attributes = {"draw": draw, "buffer": buffer.name, "pass": step, "format": buffer.format.name}
        write(self.directory / file, _image(values, told | {"scene_sha256": self.request.scene.digest()}))
        self.entries.append(
            {
                **told,
                "file": file,
                "height": codes.shape[0],
                "width": codes.shape[1],
                "channels": codes.shape[2],
                "codes": codes.dtype.newbyteorder("<").str,
                "sha256": code_hash(codes),
            }
        )

    def finish(self, result: Result) -> None:
        """Write the manifest; without one a directory is no dump."""
        content = {
            "kind": KIND, "manifest": 1, **attributes(result.provenance), "crop": self.request.crop,
            "rows": "row 0 is the top row; of textures, row 0 is the one at v = 1",
            "sha256_of": "codes (of a float format: numbers) of type `codes`, little-endian, [row, column, channel]",
            "draws": self.entries,
        }  # fmt: skip
        (self.directory / MANIFEST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def is_layer(buffer: Buffer) -> bool:
    """Tell a buffer with a texel per pixel from a texture."""
    return buffer.name.rpartition("/")[2] in ("frame", "f_h", "depth")


def code_hash(codes: np.ndarray[Any, Any]) -> str:
    """Return the SHA-256 of codes (H, W, C) as little-endian bytes."""
    return hashlib.sha256(np.ascontiguousarray(codes, codes.dtype.newbyteorder("<")).tobytes()).hexdigest()


def _image(values: np.ndarray[Any, Any], told: Attributes) -> Image:
    """Return values with the fewest channels; float32 holds those of every format but float64."""
    return from_rgb(values if told["format"] == "float64" else values.astype(np.float32), told)


@contextlib.contextmanager
def dumped(target: Path, request: Request) -> Iterator[Dump]:
    """Yield a `Dump` into a directory beside `target` that takes its place at the end; else nothing is left of it.

    Raises
    ------
    RequestError
        `target` exists and is no earlier dump, or its parent is missing.
    OSError
        There is no room, or no permission.
    """
    target = Path(os.path.abspath(target))
    check_directory("--stages", target.parent)
    _refuse_other_content(target)
    _remove_abandoned(target)
    temporary = target.parent / f"{_prefix(target)}{os.getpid()}-{secrets.token_hex(4)}.tmp"
    try:
        temporary.mkdir()
        yield Dump(temporary, request)
        _replace(temporary, target)
    except OSError as error:
        if str(error.filename).startswith(str(temporary)):
            told = str(error.filename).replace(str(temporary), str(target))
            raise OSError(error.errno, error.strerror, told) from error
        raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _refuse_other_content(target: Path) -> None:
    """Refuse to replace anything but an empty directory or an earlier dump."""
    if not os.path.lexists(target):
        return
    if target.is_symlink() or not target.is_dir():
        raise RequestError(f"--stages: {target} is no directory; allowed: a new directory, or an earlier dump")
    if not any(target.iterdir()):
        return
    try:
        kind = json.loads((target / MANIFEST).read_text("utf-8"))["kind"]
    except (OSError, ValueError, KeyError, TypeError):
        kind = None
    if kind != KIND:
        raise RequestError(
            f"--stages: {target} holds other files; allowed: a new or empty directory, "
            f"or an earlier dump (with {MANIFEST})"
        )


def _replace(temporary: Path, target: Path) -> None:
    """Move the finished dump into place; an earlier one goes away after that."""
    earlier = temporary.with_name(f"{temporary.stem}.old.tmp")
    if target.exists():
        os.rename(target, earlier)
    try:
        os.rename(temporary, target)
    except BaseException:
        if earlier.exists():
            os.rename(earlier, target)
        raise
    shutil.rmtree(earlier, ignore_errors=True)


def _prefix(target: Path) -> str:
    host = hashlib.sha256(socket.gethostname().encode()).hexdigest()[:8]
    return f".{target.name}.{host}-"


def _remove_abandoned(target: Path) -> None:
    """Remove what dumps of this directory left when they were killed on this machine."""
    pattern = re.compile(re.escape(_prefix(target)) + r"(\d+)-[0-9a-f]{8}(?:\.old)?\.tmp")
    for other in target.parent.iterdir():
        match = pattern.fullmatch(other.name)
        if match and not process_lives(int(match[1])):
            shutil.rmtree(other, ignore_errors=True)
