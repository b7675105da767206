"""The truths of light beams behind one call: scene to question, method, and what goes into the result."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.scene.result import Result
from atmoref.truth.beams_monte_carlo import BATCH, monte_carlo
from atmoref.truth.beams_quadrature import quadrature
from atmoref.truth.beams_question import ask
from atmoref.truth.rows import Crop, Progress, make_crop

__all__ = ["solve_beams"]

METHODS = ("quadrature", "monte_carlo")


def solve_beams(
    scene: Any,
    method: str,
    threads: int | None,
    rtol: float,
    samples: int,
    seed: int,
    crop: tuple[int, int, int, int] | None,
    progress: Progress | None,
    ambient: str,
) -> Result:
    """Return the true radiance of a beams scene; see :func:`atmoref.truth.solve`."""
    if method not in METHODS:
        raise ValueError(f"method {method!r}: allowed are {', '.join(METHODS)}")
    if not 1e-13 <= rtol < 1.0:
        raise ValueError(f"rtol = {rtol!r}: allowed are 1e-13 <= rtol < 1")
    width, height = int(scene.image.width), int(scene.image.height)
    part = make_crop(crop, width, height)
    q = ask(scene, ambient)
    wall, cpu = time.perf_counter(), time.process_time()
    if method == "quadrature":
        out = quadrature(q, (height, width), part, rtol=rtol, threads=threads, progress=progress)
        stats = _quadrature_stats(out, rtol)
    else:
        size = (height, width)
        out = monte_carlo(q, size, part, samples=samples, seed=seed, rtol=rtol, threads=threads, progress=progress)
        stats = _monte_carlo_stats(out, len(scene.lights))
    stats["seconds"] = time.perf_counter() - wall
    stats["cpu_seconds"] = time.process_time() - cpu
    return Result(
        image=out["image"],
        error=out["error"],
        buffers={"beam": out["beam"], "surface": out["surface"]},
        stats=stats,
        provenance=_provenance(scene, method, rtol, samples, seed, part, ambient),
    )


def _quadrature_stats(out: dict[str, NDArray[Any]], rtol: float) -> dict[str, Any]:
    image, error = out["image"], out["error"]
    finite = np.isfinite(image) & (image > 0.0)
    relative = np.divide(error, image, out=np.zeros_like(image), where=finite)
    panels, pieces, rays = (int(n) for n in out["counters"].sum(axis=(0, 1)))
    return {
        "panels": panels,
        "lit_pieces": pieces,
        "lit_rays": rays,
        "worst_relative_error": float(relative.max(initial=0.0)),
        "values_over_rtol": int((relative > rtol + 1e-13).sum()),
        "infinite_values": int(np.isinf(image).sum()),
    }


def _monte_carlo_stats(out: dict[str, NDArray[Any]], lights: int) -> dict[str, Any]:
    image, error = out["image"], out["error"]
    relative = np.divide(error, image, out=np.zeros_like(image), where=image > 0.0)
    return {
        "samples": int(out["counters"].sum()) * BATCH * lights,
        "worst_relative_error": float(relative.max(initial=0.0)),
        "mean_standard_error": float(error.mean()),
    }


def _provenance(
    scene: Any, method: str, rtol: float, samples: int, seed: int, crop: Crop, ambient: str
) -> dict[str, Any]:
    from atmoref import __version__

    chosen: dict[str, Any] = {"rtol": rtol}
    if method == "monte_carlo":
        chosen |= {"samples": samples, "seed": seed}
    return {
        "version": __version__,
        "scene": getattr(scene, "name", ""),
        "truth": method,
        "arithmetic": "float64",
        "ambient": ambient,
        "crop": tuple(crop),
        **chosen,
    }
