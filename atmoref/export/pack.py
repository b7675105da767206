"""Write a reference pack: textures, uniforms, what every draw stores with its bounds, and a manifest with hashes."""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.formats import FORMATS, Format, decode
from atmoref.export.ktx2 import write_ktx2
from atmoref.images import from_rgb, write
from atmoref.judge.allowance import BoundsOfDraw, DrawAsked, tolerance
from atmoref.judge.plan import Plan, given, make_plan
from atmoref.scene import Scene

KIND = "atmoref pack"
MANIFEST = "manifest.json"
_DRAWN = ("frame", "f_h", "depth", "shadow_map")


class PackError(ValueError):
    """A pack that cannot be written there; the message says what is allowed."""


def export_pack(
    scene: Scene, directory: Path, *, technique: str | None = None, bounds_of_draw: BoundsOfDraw = tolerance
) -> dict[str, Any]:
    """Write the reference pack of a scene into a new directory, or over an earlier pack; return its manifest.

    Everything is written beside it first: a directory holds a whole pack, or what it held before.

    Raises
    ------
    PackError
        Something else stands in the directory's place.
    SceneError
        The scene is wrong.
    OSError
        There is no room, or no permission.
    """
    target = Path(os.path.abspath(directory))
    _refuse_other_content(target)
    plan = make_plan(scene, technique)
    temporary = target.parent / f".{target.name}-{os.getpid()}-{secrets.token_hex(4)}.tmp"
    earlier = temporary.with_suffix(".old")
    try:
        temporary.mkdir()
        manifest = _Pack(scene, plan, temporary, bounds_of_draw).write()
        if target.exists():
            os.rename(target, earlier)
        os.rename(temporary, target)
        shutil.rmtree(earlier, ignore_errors=True)
        return manifest
    except BaseException:
        if earlier.exists() and not target.exists():
            os.rename(earlier, target)
        raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _refuse_other_content(target: Path) -> None:
    if not target.parent.is_dir():
        raise PackError(f"-o: the directory {target.parent} does not exist; make it first")
    if not os.path.lexists(target):
        return
    if target.is_symlink() or not target.is_dir():
        raise PackError(f"-o: {target} is no directory; allowed: a new directory, or an earlier pack")
    try:
        kind = json.loads((target / MANIFEST).read_text("utf-8"))["kind"]
    except (OSError, ValueError, KeyError, TypeError):
        kind = None
    if kind != KIND and any(target.iterdir()):
        raise PackError(f"-o: {target} holds other files; allowed: a new or empty directory, or an earlier pack")


class _Pack:
    """A pack that is being written."""

    def __init__(self, scene: Scene, plan: Plan, directory: Path, bounds_of_draw: BoundsOfDraw) -> None:
        self.scene, self.plan, self.directory, self.bounds = scene, plan, directory, bounds_of_draw
        self.textures: list[dict[str, Any]] = []
        self.stages: list[dict[str, Any]] = []

    def write(self) -> dict[str, Any]:
        """Write all files; return the manifest."""
        (self.directory / "inputs").mkdir()
        (self.directory / "stages").mkdir()
        for name, buffer in self.plan.bank.items():
            if name.rpartition("/")[2] not in _DRAWN:
                self._texture(name, buffer.codes(), buffer.format)
        self._draws()
        uniforms = {p.name: _plain(_uniforms(given(p))) for p in self.plan.passes}
        self._json("uniforms.json", uniforms)
        (self.directory / "scene.toml").write_text(self.scene.to_toml(), encoding="utf-8")
        header = resources.files("atmoref.export").joinpath("atmoref_dump.hpp").read_text("utf-8")
        (self.directory / "atmoref_dump.hpp").write_text(header, encoding="utf-8")
        manifest = {
            "kind": KIND, "manifest": 1, "scene": self.scene.name, "scene_sha256": self.scene.digest(),
            "technique": self.plan.technique, "device": self.plan.setting.device.name,
            "rows": "EXR, NPY: row 0 is the top row (of textures, the one at v = 1); KTX2, raw, C: row 0 is v = 0",
            "textures": self.textures, "stages": self.stages,
            "sha256": {str(p.relative_to(self.directory)): _digest(p) for p in sorted(self.directory.rglob("*"))
                       if p.is_file()},
        }  # fmt: skip
        self._json(MANIFEST, manifest)
        return manifest

    def _json(self, name: str, content: Any) -> None:
        (self.directory / name).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    def _texture(self, name: str, codes: NDArray[Any], fmt: Format) -> None:
        """Write one texture as EXR (values), KTX2, raw + JSON (codes) and a C header (codes)."""
        stem = re.sub(r"[^A-Za-z0-9_]", "_", name)
        base = self.directory / "inputs" / stem
        values = decode(codes, fmt)
        write(base.with_suffix(".exr"), from_rgb(values.astype(np.float32), {"format": fmt.name, "buffer": name}))
        first_v0 = np.ascontiguousarray(codes[::-1])
        plain = fmt.name in ("unorm8", "unorm16", "float16", "float32")
        held, held_as = (first_v0, fmt) if plain else (decode(first_v0, fmt).astype(np.float32), FORMATS["float32"])
        write_ktx2(base.with_suffix(".ktx2"), held, held_as)
        little = np.ascontiguousarray(held, held.dtype.newbyteorder("<"))
        base.with_suffix(".raw").write_bytes(little.tobytes())
        told = {
            "buffer": name, "file": f"{stem}.raw", "width": codes.shape[1], "height": codes.shape[0],
            "channels": codes.shape[2], "type": little.dtype.str, "format": held_as.name, "origin": "bottom",
        }  # fmt: skip
        self._json(f"inputs/{stem}.json", told)
        base.with_suffix(".h").write_text(_c_header(stem, held), encoding="utf-8")
        self.textures.append(told | {"files": [f"inputs/{stem}{s}" for s in (".exr", ".ktx2", ".raw", ".json", ".h")]})

    def _draws(self) -> None:
        """Draw everything, and write what each draw stored with its bounds; of the sub-planes of a slab, the last."""
        plan = self.plan
        before = {name: plan.stored(name) for name in plan.bank}
        group: list[tuple[int, int, int]] = []
        for at, item in enumerate(plan.passes):
            for d, draw in enumerate(item.draws):
                plan.draw(((at, d, d + 1),))
                group.append((at, d, d + 1))
                stored = item.stores[d]
                further = stored == "f_h" and d + 1 < len(item.draws) and item.stores[d + 1] == "f_h"
                if further or draw.endswith("/upload") or stored not in plan.bank:
                    continue
                names = [stored]
                depth = stored.removesuffix("frame") + "depth"
                if draw.endswith("opaque") and "light_" not in draw and depth in plan.bank:
                    names.append(depth)
                for name in names:
                    self._stage(draw, name, tuple(group), before)
                before |= {name: plan.stored(name) for name in names}
                group = []

    def _stage(self, draw: str, name: str, group: Any, before: dict[str, NDArray[Any]]) -> None:
        plan = self.plan
        buffer = plan.bank[name]
        codes = buffer.codes()
        draws = tuple((plan.passes[at], first, last) for at, first, last in group)
        allowed = self.bounds(DrawAsked(draw, name, draws, dict(before), plan.bank, codes, buffer.format))
        stem = f"stages/{len(self.stages):04d}.{draw.replace('/', '.')}.{name.replace('/', '.')}"
        top = float(buffer.format.top) if buffer.format.kind == "unorm" else 1.0
        files = {}
        for kind, texels in (("reference", codes.astype(np.float64)), ("lo", allowed.lo), ("hi", allowed.hi)):
            files[kind] = f"{stem}.{kind}.exr"
            told: dict[str, str | float | int] = {"format": buffer.format.name, "draw": draw, "buffer": name}
            write(self.directory / files[kind], from_rgb((texels / top).astype(np.float32), told))
        self.stages.append({"draw": draw, "buffer": name, "format": buffer.format.name, "bounds": allowed.name,
                            "few": allowed.few, "drawn": len(group), **files})  # fmt: skip


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _uniforms(held: dict[str, Any]) -> dict[str, Any]:
    """Return what a pass gives its shader, and nothing of what the program keeps around it."""
    return {name: value for name, value in held.items() if name in ("uniforms", "blocks", "draws", "size")}


def _plain(value: Any) -> Any:
    """Return named tuples, arrays and numbers as values for JSON; float64 to the last bit."""
    if hasattr(value, "_asdict"):
        return {key: _plain(one) for key, one in value._asdict().items()}
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    return value if isinstance(value, str | int | float | bool) or value is None else repr(value)


def _c_header(stem: str, texels: NDArray[Any]) -> str:
    """Return a C header with one array, row 0 at v = 0, channels together."""
    kind = {"u1": "unsigned char", "u2": "unsigned short", "f2": "unsigned short", "f4": "float"}[texels.dtype.str[1:]]
    numbers = texels.view(np.uint16) if texels.dtype == np.float16 else texels
    height, width, channels = texels.shape
    flat = numbers.ravel().tolist()
    form = (lambda x: f"{x!r}f") if kind == "float" else str
    lines = [", ".join(form(x) for x in flat[at : at + 16]) for at in range(0, len(flat), 16)]
    half = "/* bits of float16 */\n" if texels.dtype == np.float16 else ""
    guard = f"ATMOREF_{stem.upper()}_H"
    return (
        f"#ifndef {guard}\n#define {guard}\n/* row 0 at v = 0, channels together */\n{half}"
        f"enum {{ {stem}_width = {width}, {stem}_height = {height}, {stem}_channels = {channels} }};\n"
        f"static const {kind} {stem}_texels[{len(flat)}] = {{\n" + ",\n".join(lines) + "\n};\n#endif\n"
    )
