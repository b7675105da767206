"""Read scene files, and the scenes that come with the package."""

from __future__ import annotations

import difflib
import os
import stat
import tomllib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from atmoref.scene.document import Scene, scene_from_mapping
from atmoref.scene.errors import SceneError, shorten
from atmoref.scene.overrides import apply_overrides

MAX_BYTES = 1_000_000


def bundled_names() -> list[str]:
    """Return the names of the scenes that come with the package, sorted."""
    entries = resources.files("atmoref.scene").joinpath("bundled").iterdir()
    return sorted(entry.name.removesuffix(".toml") for entry in entries if entry.name.endswith(".toml"))


def bundled_text(name: str) -> str:
    """Return the file of a bundled scene as it is, comments included.

    Raises
    ------
    SceneError
        If there is none of that name; names the nearest.
    """
    if name not in bundled_names():
        raise SceneError(f"{shorten(name)}: no such bundled scene;{_near(name)}")
    return resources.files("atmoref.scene").joinpath("bundled", f"{name}.toml").read_text("utf-8")


def load_scene(
    path_or_name: str | os.PathLike[str], overrides: Sequence[str] = (), *, max_memory: int | None = None
) -> Scene:
    """Return a checked scene.

    Parameters
    ----------
    path_or_name
        A scene file, or the name of a bundled scene (``bundled_names``). A name wins over a file called just so; write
        ``./quick`` for the file.
    overrides
        ``key.path=value``, applied in order before the scene is checked; see ``apply_overrides``.
    max_memory
        Bytes of the whole process that the files of the scene may bring it to; None: half of what is available.

    Raises
    ------
    SceneError
        If the file cannot be read or is no correct scene: names file, key path, what was found, what is allowed.
    OutOfMemory
        The files that it names need more memory than allowed.
    """
    text = os.fspath(path_or_name)
    if isinstance(path_or_name, str) and text in bundled_names():
        path = Path(str(resources.files("atmoref.scene").joinpath("bundled", f"{text}.toml")))
        return parse_scene(
            bundled_text(text), overrides, origin=f"bundled scene {text}", name=text, path=path, max_memory=max_memory
        )
    path = Path(text)
    return parse_scene(_read(path), overrides, origin=str(path), name=path.stem, path=path, max_memory=max_memory)


def parse_scene(
    text: str,
    overrides: Sequence[str] = (),
    *,
    origin: str = "scene",
    name: str = "scene",
    path: Path | None = None,
    max_memory: int | None = None,
) -> Scene:
    """Return a checked scene from the text of a scene file; see ``load_scene``."""
    mapping = apply_overrides(_toml(text, origin), overrides, origin)
    return scene_from_mapping(mapping, origin=origin, name=name, path=path, max_memory=max_memory)


def _toml(text: str, origin: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{origin}: not valid TOML: {error}{_quoted_line(str(error), text)}") from None
    except RecursionError:
        raise SceneError(f"{origin}: not a scene: nested too deeply") from None
    except ValueError as error:
        raise SceneError(f"{origin}: not valid TOML: {error}") from None


def _quoted_line(message: str, text: str) -> str:
    """Return ': <the line>' for a message that names a line."""
    _, at_line, rest = message.partition("(at line ")
    lines = text.splitlines()
    number = int(rest.split(",")[0]) if at_line else 0
    return f": {shorten(lines[number - 1].strip())}" if 0 < number <= len(lines) else ""


def _read(path: Path) -> str:
    """Return a file's text; refuses what is no regular file or is larger than any scene."""
    origin = str(path) if len(str(path)) < 1024 else shorten(str(path))
    try:
        state = path.stat()
        if stat.S_ISDIR(state.st_mode):
            raise SceneError(f"{origin}: is a directory; allowed: a scene file (.toml) or a bundled name")
        if not stat.S_ISREG(state.st_mode):
            raise SceneError(f"{origin}: is not a regular file; allowed: a scene file (.toml) or a bundled name")
        if state.st_size > MAX_BYTES:
            raise SceneError(f"{origin}: found {state.st_size} bytes; allowed: at most {MAX_BYTES} for a scene file")
        with path.open("rb") as file:
            return file.read(MAX_BYTES).decode("utf-8-sig")
    except (FileNotFoundError, NotADirectoryError):
        raise SceneError(f"{origin}: no such file or bundled scene;{_near(path.stem)}") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{origin}: not a text file: byte {error.start} is not UTF-8; allowed: a TOML file") from None
    except OSError as error:
        raise SceneError(f"{origin}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{origin!r}: not a file name: {error}") from None


def _near(name: str) -> str:
    names = bundled_names()
    close = difflib.get_close_matches(name, names, n=6, cutoff=0.5)
    hint = f" did you mean {' or '.join(sorted(close))}?" if close else ""
    return f"{hint} bundled scenes: {', '.join(names)}"
