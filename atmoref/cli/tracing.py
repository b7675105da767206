"""``atmoref trace``: what every draw read and stored at one pixel."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from atmoref.cli.failures import RequestError
from atmoref.cli.rendering import Changes, MaxMemory, SceneWord, TechniqueWord
from atmoref.cli.words import parse_size

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from atmoref.pipeline import Bank, Pass
    from atmoref.scene import Scene

LIGHT_INPUTS = ("light_u", "light_v", "light_depth_m")
SLAB_INPUTS = ("along_ray_m", "distance_of_ray_m", "ray_length_per_depth")
"""Names of the probe's fields u, v, w: in the light's maps, and in the q table."""


@dataclass(frozen=True, slots=True)
class TracedDraw:
    """One draw at one pixel.

    Parameters
    ----------
    draw, step, buffer, format : str
        Its name, its pass, the buffer it stores into, and that buffer's format.
    inputs : dict
        Depth of the plane and the coordinates it was evaluated at; empty for the opaque passes.
    lit : bool or None
        Whether the pixel took part; None where the draw has no mask.
    drawn : list of float or None
        Colour that was blended; of a sub-plane, light map times visibility before its share.
    stored : list
        What the buffer holds after the draw: codes of a unorm format, else numbers.
    value : list of float
        The same, decoded.
    """

    draw: str
    step: str
    buffer: str
    format: str
    inputs: dict[str, float]
    lit: bool | None
    drawn: list[float] | None
    stored: list[float]
    value: list[float]


def trace(
    scene: SceneWord,
    pixel: Annotated[tuple[int, int], typer.Option(metavar="X Y", help="Column and row; row 0 is at the top.")],
    technique: TechniqueWord = None,
    changes: Changes = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
    max_memory: MaxMemory = None,
) -> None:
    """Print what every draw of SCENE read and stored at one pixel."""
    from atmoref.cli.answering import TRUTH, chosen_technique
    from atmoref.cli.progress import working
    from atmoref.scene import load_scene
    from atmoref.techniques import TECHNIQUES

    limit = parse_size(max_memory)
    question = load_scene(scene, changes or (), max_memory=limit)
    name = chosen_technique(question, technique)
    if name == TRUTH:
        raise RequestError(f"{question.origin}: the truth has no draws; allowed: --technique {' or '.join(TECHNIQUES)}")
    x, y = pixel
    width, height = question.image.width, question.image.height
    if not (0 <= x < width and 0 <= y < height):
        raise RequestError(
            f"{question.origin}: --pixel: found {x} {y}; allowed: 0 to {width - 1} and 0 to {height - 1}, "
            "row 0 at the top"
        )
    with working(f"trace {question.name}") as waiting:
        told, draws = trace_pixel(question, name, x, y, limit, waiting)
    if as_json:
        plain = {**told, "pixel": [x, y], "draws": [asdict(draw) for draw in draws]}
        typer.echo(json.dumps(plain, indent=1))
    else:
        _print_table(f"{question.name}, {name}, pixel {x} {y}", draws)


def trace_pixel(
    scene: Scene, technique: str, x: int, y: int, max_memory: int | None, progress: Any = None
) -> tuple[dict[str, Any], list[TracedDraw]]:
    """Return a render's provenance and its draws at pixel (x, y), row 0 at the top, in GPU order."""
    from atmoref.cli.dumping import is_layer
    from atmoref.cli.pictures import attributes
    from atmoref.lanes import N
    from atmoref.pipeline import run
    from atmoref.techniques.render import prepare, provenance

    if scene.buffers.arithmetic == "interval":
        raise RequestError(
            f'{scene.origin}: buffers.arithmetic: found "interval"; allowed with trace: "float32" or "float64"'
        )
    first = x // N * N
    window = (first, y, min(N, scene.image.width - first), 1)
    name, setting, passes, bank, report = prepare(scene, technique, window, max_memory, trace=True)
    if any(is_layer(buffer) and buffer.width != scene.image.width for buffer in bank.values()):
        raise RequestError(
            f"{scene.origin}: trace: the images of {name} are smaller than the frame; allowed: full ones"
        )
    seen: dict[str, tuple[str, list[float], list[float]]] = {}

    def watch(draw: str, step: Pass, bank: Bank) -> None:
        buffer = bank.get(step.stores[step.draws.index(draw)])
        if buffer is not None and is_layer(buffer):
            seen[draw] = (buffer.format.name, *_stored_at(buffer, x, y))

    run(passes, bank, threads=1, watch=watch, progress=progress)
    draws: list[TracedDraw] = []
    probes = iter(report["probe"])
    for step in passes:
        slabs = step.name.rpartition("/")[2] in ("slabs", "planes")
        probe = _probe(next(probes), x % N) if slabs else None
        for index, draw in enumerate(step.draws):
            if draw in seen:
                row = None if probe is None else probe[index]
                draws.append(_traced(draw, step, step.stores[index], seen[draw], row))
    told = attributes(provenance(scene, name, setting))
    if "depth" in bank:
        told["depth_code_or_value"] = _stored_at(bank["depth"], x, y)[0][0]
    return told, draws


def _probe(flat: NDArray[np.float64], lane: int) -> NDArray[np.float64]:
    """Return the probe of one lane, (draws, fields)."""
    from atmoref.lanes import N
    from atmoref.stages.beam_planes import PROBE

    return flat.reshape(-1, len(PROBE), N)[:, :, lane]


def _stored_at(buffer: Any, x: int, y: int) -> tuple[list[float], list[float]]:
    """Return what a buffer holds at a pixel, row 0 at the top: stored numbers, and their values."""
    from atmoref.buffers.formats import decode

    at = (buffer.height - 1 - y) * buffer.pitch + x
    stored = buffer.data[at :: buffer.plane][: buffer.channels].astype(buffer.format.storage)
    return stored.tolist(), decode(stored.reshape(1, 1, -1), buffer.format).ravel().tolist()


def _traced(draw: str, step: Pass, buffer: str, seen: tuple[str, list[float], list[float]], row: Any) -> TracedDraw:
    from atmoref.stages.beam_planes import PROBE

    fmt, stored, value = seen
    if row is None:
        return TracedDraw(draw, step.name, buffer, fmt, {}, None, None, stored, value)
    fields = dict(zip(PROBE, (float(number) for number in row), strict=True))
    names = SLAB_INPUTS if draw.endswith("/main") else LIGHT_INPUTS
    inputs = {"depth_m": fields["z"], **{n: fields[key] for n, key in zip(names, "uvw", strict=True)}}
    drawn = [fields[channel] + 0.0 for channel in "rgb"]  # -0 is how a masked lane says nothing
    return TracedDraw(draw, step.name, buffer, fmt, inputs, fields["drawn"] > 0.0, drawn, stored, value)


def _print_table(title: str, draws: list[TracedDraw]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for heading in ("draw", "depth m", "u", "v", "w", "lit", "drawn", "buffer", "stored", "value"):
        table.add_column(heading, no_wrap=True, justify="right" if heading in ("depth m", "u", "v", "w") else "left")
    for d in draws:
        numbers = [f"{number:.6g}" for number in d.inputs.values()] or ["", "", "", ""]
        lit = "" if d.lit is None else "yes" if d.lit else "no"
        drawn = "" if d.drawn is None else _colour(d.drawn)
        table.add_row(d.draw, *numbers, lit, drawn, d.buffer, _colour(d.stored), _colour(d.value))
    console = Console()
    if not console.is_terminal:
        console = Console(width=250)
    console.print(table, markup=False)
    console.print(
        "sub-planes and vertex planes: u, v in the light's maps, w depth from the light (m); main planes: u along the "
        "ray from the light's foot (m), v distance of ray and light (m), w ray length per depth",
        markup=False, highlight=False,
    )  # fmt: skip


def _colour(numbers: list[float]) -> str:
    """Return three numbers, or one where all are equal."""
    return f"{numbers[0]:.6g}" if len(set(numbers)) == 1 else " ".join(f"{number:.6g}" for number in numbers)
