"""From a scene to an answer: which technique, or the truth, and with what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import model_validator

from atmoref.cli.failures import RequestError
from atmoref.cli.quick_start import load_numba_without_blas
from atmoref.memory import PROGRAM_BYTES, Account, allowed_bytes
from atmoref.scene import Scene, SceneError, parse_model
from atmoref.scene.errors import contradiction, nearest
from atmoref.scene.fields import Table, quantity
from atmoref.techniques import TECHNIQUES

if TYPE_CHECKING:
    from atmoref.cli.progress import Waiting
    from atmoref.pipeline import Watch
    from atmoref.scene import Result

TRUTH = "truth"
TRUTH_BYTES_PER_TRIANGLE = 450  # tree, its boxes while it is made, edges (measured: 370)
TRUTH_BYTES_PER_PIXEL = 120  # image, error, beam and surface of three float64 each, three counters


class TruthParameters(Table):
    """Keys of [technique] name = "truth"."""

    method: Literal["quadrature", "monte_carlo"] = quantity(
        "",
        "Lit pieces of each ray integrated to an error, or an independent estimate with standard errors.",
        "quadrature",
    )
    rtol: float = quantity("", "Relative error to reach.", 1e-9, ge=1e-13, lt=1.0)
    samples: int = quantity("", "Monte Carlo: samples per pixel and light, a multiple of 16.", 256, ge=64, le=1 << 24)
    seed: int = quantity("", "Monte Carlo: another number, another independent estimate.", 0, ge=0, lt=1 << 63)
    ambient: Literal["constant", "saturating"] = quantity(
        "", "The ambient radiance as it is, or times 1 - exp(-sigma_t T) (D-E34).", "constant"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.samples % 16:
            raise contradiction(("samples",), f"{self.samples}", "a multiple of 16")
        return self


@dataclass(frozen=True, slots=True)
class Request:
    """One image that is asked for."""

    scene: Scene
    technique: str
    crop: tuple[int, int, int, int] | None = None
    threads: int | None = None
    max_memory: int | None = None


def chosen_technique(scene: Scene, technique: str | None) -> str:
    """Return who answers: what the command line says, else the scene, else the first technique.

    Raises
    ------
    SceneError
        If it does not exist.
    """
    name = technique if technique is not None else scene.technique.name or TECHNIQUES[0]
    known = (*TECHNIQUES, TRUTH)
    if name not in known:
        key = "--technique" if technique is not None else "technique.name"
        raise SceneError(f"{scene.origin}: {key}: found {name!r}{nearest(name, known)}; allowed: {', '.join(known)}")
    return name


def truth_parameters(scene: Scene) -> TruthParameters:
    """Return the truth's parameters; keys of the technique that the scene names instead are let pass.

    Raises
    ------
    SceneError
    """
    given = dict(scene.technique.parameters)
    if scene.technique.name not in (None, TRUTH):
        given = {key: value for key, value in given.items() if key in TruthParameters.model_fields}
    return parse_model(TruthParameters, given, scene.origin, "technique", known=("name", "preset"))


def check(scene: Scene, technique: str) -> None:
    """Check what only a technique knows of a scene: its parameters, buffers and plan, without drawing.

    Raises
    ------
    SceneError
    """
    if technique == TRUTH:
        truth_parameters(scene)
        return
    from atmoref.techniques.render import parameters, technique_module
    from atmoref.techniques.setting import make_setting

    parameters(scene, technique)
    make_setting(
        scene, technique_module(technique).BUFFERS[scene.technique.preset], "float32", None, Account(scene.origin, None)
    )


def answer(request: Request, waiting: Waiting, watch: Watch | None = None) -> Result:
    """Return the image that is asked for.

    Raises
    ------
    SceneError, RequestError
        The request is wrong.
    OutOfMemory
        It needs more memory than allowed.
    """
    if request.technique == TRUTH:
        if watch is not None:
            raise RequestError(
                "--stages: the truth has no stages; allowed with the techniques " + ", ".join(TECHNIQUES)
            )
        return _truth(request, waiting)
    if watch is not None and request.scene.buffers.arithmetic == "interval":
        raise RequestError(
            '--stages: buffers of intervals have two ends; allowed: buffers.arithmetic = "float32" or "float64" '
            "(bounds of draws: atmoref.judge.bounds.draw_bounds)"
        )
    load_numba_without_blas()
    from atmoref.techniques.render import render

    return render(
        request.scene, technique=request.technique, threads=request.threads, crop=request.crop, watch=watch,
        max_memory=request.max_memory, progress=waiting,
    )  # fmt: skip


def _truth(request: Request, waiting: Waiting) -> Result:
    from atmoref.techniques.setting import check_crop
    from atmoref.truth import solve

    scene = request.scene
    chosen = truth_parameters(scene)
    check_crop(scene, request.crop)
    width, height = request.crop[2:] if request.crop else (scene.image.width, scene.image.height)
    account = Account(scene.origin, allowed_bytes(request.max_memory), PROGRAM_BYTES + scene.files.kept_bytes)
    count = sum(len(part.faces) for part in scene.files.triangles.values())
    beside = f" with {count} triangles" if count else ""
    needed = width * height * TRUTH_BYTES_PER_PIXEL + count * TRUTH_BYTES_PER_TRIANGLE
    account.require(needed, f"the truth of {width} x {height} pixels{beside}")
    result = solve(scene, threads=request.threads, crop=request.crop, progress=waiting.rows, **chosen.model_dump())
    result.provenance.update(_question(scene))
    return result


def _question(scene: Scene) -> dict[str, Any]:
    """Return what a truth's provenance lacks beside a technique's."""
    return {
        "scene_sha256": scene.digest(), "technique": TRUTH, "units": "W m-2 sr-1", "origin": "row 0 is the top row",
    }  # fmt: skip
