"""The error of a picture as a sum of causes: from truth over the method's own analysis to what the scene asks for.

Each rung changes one thing (a shadow map instead of exact visibility, a table instead of an integral, 8 bits instead
of float32 ...) and keeps all before it.  The signed difference images of the rungs add up to the whole error, pixel by
pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.images import from_rgb, write
from atmoref.scene import Result, Scene, scene_from_mapping
from atmoref.techniques.beams_parameters import BeamsParameters, BeamsVertexParameters
from atmoref.techniques.render import parameters, render, technique_module, technique_name
from atmoref.truth import solve

Told = Callable[[str], None]

# what a rung changes: name, kind of error, keys of [technique]
GROUPS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("interval along the ray", "discretisation", ("dt_mode",)),
    ("position of sub-planes", "discretisation", ("sub_plane_positions", "sub_plane_depth_test", "plane_positions")),
    (
        "readings of the print",
        "model",
        ("albedo_in_source", "scattering_angle", "surface_fog", "ambient", "f_h"),
    ),
    (
        "shadow map",
        "tables",
        ("visibility", "shadow_map_size", "shadow_filter", "shadow_bias_m", "shadow_near_m"),
    ),
    ("light map", "tables", ("light_distribution", "light_map_size")),
    ("q table", "tables", ("q", "q_table_size", "q_least_v_m")),
    ("range of the q table", "tables", ("q_storage", "i_max")),
    ("mesh", "tables", ("coordinates", "mesh")),
    ("weights of sub-planes", "tables", ("sub_plane_weights",)),
)
EXACT: dict[str, Any] = {
    "dt_mode": "cosine", "sub_plane_positions": "mid", "sub_plane_depth_test": True, "plane_positions": "mid",
    "albedo_in_source": True, "scattering_angle": "forward", "surface_fog": "transmittance", "ambient": "constant",
    "f_h": "mean", "visibility": "exact", "light_distribution": "exact", "q": "exact", "q_storage": "unclamped",
    "coordinates": "pixel", "sub_plane_weights": "equal",
}  # fmt: skip
"""Where the ladder starts: the technique's own discretisation and nothing else."""


@dataclass(frozen=True, slots=True)
class Rung:
    """One step: the image after it, and the signed change it made (both (H, W, 3), row 0 at the top)."""

    name: str
    kind: str
    changes: dict[str, Any]
    image: NDArray[np.float64]
    change: NDArray[np.float64]
    stats: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Ladder:
    """Truth and rungs of one scene; the last rung is the scene's own picture, bit for bit."""

    scene: Scene
    truth: NDArray[np.float64]
    rungs: tuple[Rung, ...]

    def errors(self, image: NDArray[np.float64]) -> dict[str, float]:
        """Return the three readings of "average error" (D-E38), images clipped to [0, 1]; see `errors`."""
        return errors(image, self.truth)

    def table(self) -> str:
        """Return the rungs as text: error against truth after each, and the size of its change."""
        width = max(len(r.name) for r in self.rungs)
        lines = [
            f"{'step':{width}}  {'kind':14}  mean|d| %  sum|d|/sum %  mean rel %  change: mean|d| %",
        ]
        for r in self.rungs:
            e = self.errors(r.image)
            change = 100.0 * float(np.abs(r.change).mean())
            lines.append(
                f"{r.name:{width}}  {r.kind:14}  {100.0 * e['mean']:9.3f}  {100.0 * e['sum_ratio']:12.3f}  "
                f"{100.0 * e['mean_relative']:10.3f}  {change:17.3f}"
            )
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return the table as plain values."""
        return {
            "scene": self.scene.name,
            "rungs": [
                {"name": r.name, "kind": r.kind, "changes": r.changes, **self.errors(r.image),
                 "change_mean": float(np.abs(r.change).mean())}
                for r in self.rungs
            ],
        }  # fmt: skip

    def write(self, directory: str | Path) -> None:
        """Write each rung's image and change as EXR, and their pictures, into a directory."""
        from atmoref.compare import difference_image

        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        clipped = np.clip(self.truth, 0.0, 1.0)
        for i, r in enumerate(self.rungs):
            stem = f"{i:02d}_{r.name.replace(' ', '_')}"
            write(folder / f"{stem}.exr", from_rgb(r.image, {"content": r.name, "kind": r.kind}))
            write(folder / f"{stem}.png", from_rgb(r.image, {"content": r.name}))
            write(folder / f"{stem}_change.exr", from_rgb(r.change, {"content": f"change made by: {r.name}"}))
            write(folder / f"{stem}_error.png", difference_image(np.clip(r.image, 0.0, 1.0), clipped, scale=0.1))


def errors(image: NDArray[np.float64], reference: NDArray[np.float64]) -> dict[str, float]:
    """Return mean |d|, sum |d| / sum reference, and mean |d| / reference where that is above 0.02.

    Parameters
    ----------
    image, reference : (H, W, 3) arrays
        Both are clipped to [0, 1], surfaces included (D-E38: the paper does not say which average it means).
    """
    test, ref = np.clip(image, 0.0, 1.0), np.clip(reference, 0.0, 1.0)
    d = np.abs(test - ref)
    bright = ref > 0.02
    return {
        "mean": float(d.mean()),
        "sum_ratio": float(d.sum() / max(float(ref.sum()), 1e-300)),
        "mean_relative": float((d[bright] / ref[bright]).mean()) if bright.any() else 0.0,
        "worst": float(d.max()),
    }


def _variant(scene: Scene, name: str, params: dict[str, Any], buffers: dict[str, Any]) -> Scene:
    """Return the scene with resolved parameters and formats."""
    mapping = scene.to_mapping()
    given = {k: list(v) if isinstance(v, tuple) else v for k, v in params.items() if v is not None}
    mapping["technique"] = {"name": name, "preset": scene.technique.preset, **given}
    own = {k: mapping["buffers"][k] for k in ("device", "rounding") if mapping["buffers"].get(k) is not None}
    mapping["buffers"] = {**own, **buffers}
    return scene_from_mapping(mapping, origin=scene.origin, name=scene.name, path=scene.path)


def _uniform_formats(scene: Scene, name: str, fmt: str) -> dict[str, Any]:
    """Return [buffers] with every buffer, and the arithmetic, in one float format."""
    keys = technique_module(name).BUFFERS[scene.technique.preset]
    return {"format": fmt, "arithmetic": fmt, **{k: {"format": fmt} for k in keys if k != "frame"}}


def _own_formats(scene: Scene) -> dict[str, Any]:
    """Return [buffers] as the scene has it, without device and rounding."""
    buffers = dict(scene.to_mapping()["buffers"])
    return {k: v for k, v in buffers.items() if k not in ("device", "rounding")}


def ladder(scene: Scene, *, threads: int | None = None, progress: Told | None = None) -> Ladder:
    """Return the ladder of a scene: its truth, and one rung for each thing that separates its picture from it.

    Parameters
    ----------
    scene : Scene
        For `beams` or `beams_vertex`.
    threads : int or None
    progress : callable (name of the rung) or None
        Called before each.

    Returns
    -------
    Ladder
        `rungs[0].change` is the method's own discretisation (analysis minus truth, clipped); the changes of all rungs
        add up to picture minus truth.

    Raises
    ------
    SceneError
    """
    tell: Told = progress or (lambda name: None)
    name = technique_name(scene)
    own = parameters(scene, name)
    assert isinstance(own, BeamsParameters | BeamsVertexParameters)
    target = own.model_dump()
    tell("truth")
    reference: Result = solve(scene, threads=threads)
    current = {**target, **{k: v for k, v in EXACT.items() if k in target}}
    if current.get("dt_mode") != target["dt_mode"] and target["dt_mode"] == "exact":
        current["dt_mode"] = "exact"
    buffers = _uniform_formats(scene, name, "float64")
    rungs: list[Rung] = []
    before = np.clip(reference.image, 0.0, 1.0)

    def climb(label: str, kind: str, changes: dict[str, Any]) -> None:
        nonlocal before
        tell(label)
        result = render(_variant(scene, name, current, buffers), technique=name, threads=threads)
        image = np.clip(result.image, 0.0, 1.0)
        rungs.append(Rung(label, kind, changes, image, image - before, result.stats))
        before = image

    climb("analysis", "discretisation", {})
    for label, kind, keys in GROUPS:
        changes = {k: target[k] for k in keys if k in target and current[k] != target[k]}
        if changes:
            current.update(changes)
            climb(label, kind, changes)
    settings = scene.buffers.arithmetic or ("float64" if scene.technique.preset == "analysis" else "float32")
    if settings == "float32":
        buffers = _uniform_formats(scene, name, "float32")
        climb("float32", "arithmetic", {"arithmetic": "float32"})
    own_formats = render_formats(scene, name)
    if set(own_formats.values()) != {settings}:
        buffers = _own_formats(scene)
        climb("storage in " + ", ".join(sorted(set(own_formats.values()))), "storage", dict(own_formats))
    return Ladder(scene, np.clip(reference.image, 0.0, 1.0), tuple(rungs))


def render_formats(scene: Scene, name: str) -> dict[str, str]:
    """Return the format of each of a scene's own buffers."""
    defaults: dict[str, str] = dict(technique_module(name).BUFFERS[scene.technique.preset])
    if scene.buffers.format is not None:
        defaults["frame"] = scene.buffers.format
    defaults.update({k: v.format for k, v in scene.buffers.per_buffer.items()})
    return {key: defaults["frame"] if f == "frame" else f for key, f in defaults.items()}
