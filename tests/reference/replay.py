"""Every kernel call of a render is answered by the stage and, on copies of its buffers, by the scalar reference."""

import contextlib
import inspect
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

import numpy as np

from atmoref import pipeline
from atmoref.lanes import Double
from atmoref.techniques import beams, beams_vertex, opaque_passes, triangle_passes
from atmoref.techniques.render import prepare
from reference.scalar_math import lower
from reference.scalar_opaque import opaque_loops
from reference.scalar_slabs import compiled_slab_loop
from reference.scalar_triangles import triangle_loop
from reference.scalar_vertex import compiled_vertex_loop

Difference = dict[str, tuple[int, int, float]]  # stage -> texels compared, texels that differ, greatest difference


def real_of(arith: Any) -> Any:
    """Return the NumPy type of an arithmetic tag."""
    return np.float64 if isinstance(arith, Double) else np.float32


def lowered_draws(real: Any, draws: Any) -> Any:
    """Return plane depths and shares in the arithmetic."""
    return type(draws)(*(x.astype(real) if x.dtype == np.float64 else x for x in draws))


def scalar_slabs(c: dict[str, Any], loop: Any = None) -> None:
    """Draw a call of `beam_planes` by the reference, in place; a range that starts later is not its business."""
    real = real_of(c["arith"])
    assert c["window"].d0 == 0
    nodes, weights = (x.astype(real) for x in c["quadrature"])
    mesh = c["mesh"]._replace(**{key: getattr(c["mesh"], key).astype(real) for key in "uvc"})
    (loop or compiled_slab_loop(real))(
        c["frame"], c["fast"], c["depth"], lower(real, c["rules"]), lower(real, c["uniforms"]), lower(real, c["maps"]),
        lower(real, c["q"]), mesh, nodes, weights, c["solids"], lowered_draws(real, c["draws"]), c["window"],
    )  # fmt: skip


def scalar_planes(c: dict[str, Any], loop: Any = None) -> None:
    """Draw a call of `vertex_planes`."""
    real = real_of(c["arith"])
    (loop or compiled_vertex_loop(real))(
        c["frame"], c["depth"], lower(real, c["rules"]), lower(real, c["uniforms"]), lower(real, c["maps"]),
        c["colours"].astype(real), c["grid"], c["solids"], lowered_draws(real, c["draws"]), c["window"],
    )  # fmt: skip


def _base(c: dict[str, Any]) -> None:
    real = real_of(c["arith"])
    frame_rules, depth_rule = lower(real, c["rules"])
    opaque_loops(real).base(
        c["frame"], c["depth"], frame_rules, depth_rule, lower(real, c["uniforms"]), c["solids"], c["surfaces"],
        c["window"],
    )  # fmt: skip


def _light(c: dict[str, Any]) -> None:
    real = real_of(c["arith"])
    opaque_loops(real).light(
        c["frame"], lower(real, c["rules"]), lower(real, c["uniforms"]), lower(real, c["maps"]), c["solids"],
        c["surfaces"], c["lit_solids"], c["window"],
    )  # fmt: skip


def _shadow(c: dict[str, Any]) -> None:
    real = real_of(c["arith"])
    opaque_loops(real).shadow_map(
        c["depth"],
        lower(real, c["rule"]),
        lower(real, c["uniforms"]),
        c["parallel"],
        c["solids"],
        c["surfaces"],
        c["pitch"],
        c["size"],
        c["row0"],
        c["row1"],
    )


def _rasterise(c: dict[str, Any]) -> None:
    real = real_of(c["arith"])
    triangle_loop(real)(c["drawn"], lower(real, c["grid"]), c["records"], c["window"])


STAGES: dict[str, tuple[Any, Callable[[dict[str, Any]], None], tuple[str, ...]]] = {
    "beam_planes": (beams, scalar_slabs, ("frame", "fast")),
    "vertex_planes": (beams_vertex, scalar_planes, ("frame",)),
    "opaque_base": (opaque_passes, _base, ("frame", "depth")),
    "opaque_light": (opaque_passes, _light, ("frame",)),
    "shadow_map": (opaque_passes, _shadow, ("depth",)),
    "rasterise": (triangle_passes, _rasterise, ("drawn",)),
}


def _drawn(data: Any, call: dict[str, Any], name: str) -> Any:
    """Return the texels that a call had to draw."""
    if name == "shadow_map":
        rows = data.reshape(-1, call["pitch"])
        return rows[call["row0"] : call["row1"], : call["size"]]
    w = call["window"]
    return data.reshape(-1, w.height, w.pitch)[:, w.row0 : w.row1, w.column0 : w.column1]


@contextlib.contextmanager
def recording(act: Callable[[str, Any, dict[str, Any]], None]) -> Iterator[None]:
    """Hand every kernel call (name, kernel, arguments by name) to `act` instead of making it."""
    with contextlib.ExitStack() as stack:
        for name, (module, _, _) in STAGES.items():
            kernel = getattr(module, name)
            signature = inspect.signature(kernel.py_func)

            def call(*args: Any, name: str = name, kernel: Any = kernel, signature: Any = signature) -> None:
                act(name, kernel, dict(signature.bind(*args).arguments))

            stack.enter_context(mock.patch.object(module, name, call))
        yield


def differences(scene: Any, technique: str | None = None, crop: Any = None) -> Difference:
    """Render a scene and return how the stages differ from the references, stage by stage.

    Each reference starts from the buffers that its stage got, so that an error stays in the stage that made it.
    """
    found: Difference = {}

    def act(name: str, kernel: Any, call: dict[str, Any]) -> None:
        _, reference, outputs = STAGES[name]
        mine = call | {key: call[key].copy() for key in outputs}
        reference(mine)
        kernel(*call.values())
        total, wrong, worst = found.get(name, (0, 0, 0.0))
        for key in outputs:
            a, b = (_drawn(x[key], call, name).astype(np.float64) for x in (mine, call))
            unequal = ~((a == b) | (np.isnan(a) & np.isnan(b)))
            total, wrong = total + a.size, wrong + int(unequal.sum())
            worst = max(worst, float(np.abs(a - b)[unequal].max(initial=0.0)))
        found[name] = (total, wrong, worst)

    with recording(act):
        _, _, passes, bank, _ = prepare(scene, technique, crop, None)
        pipeline.run(passes, bank, threads=1)
    return found


def captured(scene: Any, stage: str, technique: str | None = None) -> list[tuple[Any, dict[str, Any]]]:
    """Render a scene; return the calls of one stage, with copies of its buffers as they were before the call."""
    calls: list[tuple[Any, dict[str, Any]]] = []
    outputs = STAGES[stage][2]

    def act(name: str, kernel: Any, call: dict[str, Any]) -> None:
        if name == stage:
            calls.append((kernel, call | {key: call[key].copy() for key in outputs}))
        kernel(*call.values())

    with recording(act), mock.patch.object(pipeline, "BLOCKS_PER_THREAD", 1):
        _, _, passes, bank, _ = prepare(scene, technique, None, None)
        pipeline.run(passes, bank, threads=1)
    return calls
