"""One image by one technique: check, plan, allocate, run, hand out."""

from __future__ import annotations

import importlib
import resource
import time
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

import atmoref
from atmoref.buffers.bounds import Bounds
from atmoref.memory import PROGRAM_BYTES, Account, OutOfMemory, allowed_bytes
from atmoref.pipeline import Bank, Pass, Progress, Timing, Watch, run
from atmoref.scene import Result, Scene, SceneError, parse_model
from atmoref.scene.errors import nearest
from atmoref.techniques import TECHNIQUES
from atmoref.techniques.beams_parameters import PRESETS
from atmoref.techniques.setting import Crop, Setting, check_crop, make_setting


def technique_name(scene: Scene, technique: str | None = None) -> str:
    """Return the name of the technique that is to answer a scene; the first of all when the scene names none.

    Raises
    ------
    SceneError
        If it does not exist.
    """
    name = technique or scene.technique.name or TECHNIQUES[0]
    if name not in TECHNIQUES:
        key = "--technique" if technique else "technique.name"
        hint = " (atmoref.truth answers that one)" if name == "truth" else nearest(name, TECHNIQUES)
        raise SceneError(f"{scene.origin}: {key}: found {name!r}{hint}; allowed: {', '.join(TECHNIQUES)}")
    return name


def technique_module(name: str) -> ModuleType:
    """Return the module of a technique."""
    return importlib.import_module(f"atmoref.techniques.{name}")


def parameters(scene: Scene, name: str) -> BaseModel:
    """Return a technique's parameters for a scene: defaults, then preset, then the scene's own keys.

    Keys of another technique's model are let pass when the technique was chosen against the scene's own word, so that
    one scene runs under every technique.

    Raises
    ------
    SceneError
    """
    model: type[BaseModel] = technique_module(name).Parameters
    given = dict(scene.technique.parameters)
    if scene.technique.name not in (None, name):
        given = {k: v for k, v in given.items() if k in model.model_fields}
    values = {**PRESETS[name][scene.technique.preset], **given}
    return parse_model(model, values, scene.origin, "technique", known=("name", "preset"))


def peak_memory_mb() -> float:
    """Return the greatest resident memory of this process so far, MB.

    Linux's own high-water mark: what `getrusage` says starts with that of the process which started this one.
    """
    try:
        with open("/proc/self/status", encoding="ascii") as lines:
            for line in lines:
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) / 1024.0
    except OSError:
        pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def prepare(
    scene: Scene, technique: str | None, crop: Crop | None, max_memory: int | None, *, trace: bool = False
) -> tuple[str, Setting, list[Pass], Bank, dict[str, Any]]:
    """Return everything of a render that is decided before the first draw.

    Raises
    ------
    SceneError
        The request is wrong.
    OutOfMemory
        More than `max_memory` bytes (default: half of what is available) would be needed.
    """
    name = technique_name(scene, technique)
    module, params = technique_module(name), parameters(scene, name)
    check_crop(scene, crop)
    preset = scene.technique.preset
    arithmetic: Any = "float64" if preset == "analysis" else "float32"
    account = Account(scene.origin, allowed_bytes(max_memory), PROGRAM_BYTES + scene.files.kept_bytes)
    setting = make_setting(scene, module.BUFFERS[preset], arithmetic, crop, account)
    _check_image(setting)
    passes, bank, report = module.build(setting, params, trace=trace)
    return name, setting, passes, bank, report


def _check_image(setting: Setting) -> None:
    """Refuse an image whose buffers and hand-outs would not fit, before anything is allocated."""
    image = setting.scene.image
    pixels, element = image.width * image.height, 4 if setting.arithmetic == "float32" else 8
    setting.account.require(pixels * (7 * element + 3 * 8), f"an image of {image.width} x {image.height} pixels")
    setting.account.require(pixels * 2 * 3 * 8, "the values of its pixels", keep=True)


def render(
    scene: Scene,
    *,
    technique: str | None = None,
    threads: int | None = None,
    crop: Crop | None = None,
    watch: Watch | None = None,
    inject: Mapping[str, NDArray[Any]] | None = None,
    max_memory: int | None = None,
    progress: Progress | None = None,
) -> Result:
    """Return one image of a scene by a technique's mirror.

    Parameters
    ----------
    scene : Scene
    technique : str or None
        Instead of the scene's own.
    threads : int or None
        None: all processors.  Bits do not depend on it.
    crop : (x, y, width, height) or None
        Pixels to draw, row 0 at the top; the image has that size then.
    watch : callable (draw name, pass, bank) or None
        Called after every draw; buffers are in `bank`.
    inject : mapping of draw name to (H, W, C) array, or None
        Replaces what a draw stored.
    max_memory : int or None
        Bytes of the whole process, as estimated before anything is taken; None: half of the available memory.  What
        Numba takes to compile kernels the first time, up to 1.4 GB, does not count.
    progress : callable (pass name, fraction) or None

    Returns
    -------
    Result
        `image` (H, W, 3) float64, row 0 at the top: the frame's values.  `buffers`: every Buffer by name.  With
        arithmetic = interval also `bounds`, and `image` is their middle.

    Raises
    ------
    SceneError
        The request is wrong.
    OutOfMemory
        It would need more memory than allowed.
    KeyError
        `inject` names a draw that does not exist.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    name, setting, passes, bank, report = prepare(scene, technique, crop, max_memory)
    planned = time.perf_counter() - wall
    timing = run(passes, bank, threads=threads, watch=watch, inject=inject, progress=progress)
    frame = bank["frame"]
    image = _cropped(frame.values(), crop)
    bounds = None
    if isinstance(frame, Bounds):
        bounds = _cropped(frame.low.values(), crop), _cropped(frame.high.values(), crop)
    stats = _statistics(timing, passes, report, planned)
    stats["wall_s"], stats["cpu_s"] = time.perf_counter() - wall, time.process_time() - cpu
    return Result(image, None, dict(bank), stats, provenance(scene, name, setting), bounds)


def _cropped(image: NDArray[np.float64], crop: Crop | None) -> NDArray[np.float64]:
    """Return the pixels that were drawn."""
    if crop is None:
        return image
    x, y, w, h = crop
    return np.ascontiguousarray(image[y : y + h, x : x + w])


def _statistics(timing: Timing, passes: list[Pass], report: dict[str, Any], planned: float) -> dict[str, Any]:
    """Return what was done and skipped, as plain values for JSON."""
    from atmoref.lanes import N

    totals = sum((c.sum(0) for c in report["counters"]), np.zeros(5, np.int64))
    sub, sub_lit, samples, main, main_lit = (int(t) for t in totals)
    return {
        "plan_s": planned, "pass_wall_s": timing.wall_s, "pass_cpu_s": timing.cpu_s,
        "draws": sum(len(p.draws) for p in passes), "lights": report["lights"], "lane_width": N,
        "sub_plane_waves": sub, "sub_plane_waves_skipped": sub - sub_lit, "lit_samples": samples,
        "main_plane_waves": main, "main_plane_waves_skipped": main - main_lit,
        "peak_memory_mb": peak_memory_mb(),
    }  # fmt: skip


def provenance(scene: Scene, technique: str, setting: Setting) -> dict[str, Any]:
    """Return what is needed to make an image again."""
    return {
        "scene": scene.name, "scene_sha256": scene.digest(), "atmoref_version": atmoref.__version__,
        "technique": technique, "preset": scene.technique.preset,
        "formats": {n: f.name for n, f in setting.formats.items()}, "arithmetic": setting.arithmetic,
        "device": setting.device.name, "rounding": setting.rounding or "",
        **({"interval": "envelope" if setting.envelope else "device"} if setting.intervals else {}),
        "units": "W m-2 sr-1", "origin": "row 0 is the top row",
    }  # fmt: skip


__all__ = ["OutOfMemory", "SceneError", "prepare", "provenance", "render"]
