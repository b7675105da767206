"""One scene as the mirror prepares it: passes, buffers, and the very uniforms its kernels get.

Nothing is computed twice: planes, texture matrices, tables and vertex attributes come out of the mirror's own host
side, so that what is compared is the device's work alone.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.layout import Buffer
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene, load_scene
from atmoref.techniques.render import prepare
from atmoref.techniques.setting import Setting

DEVICE = "gl_llvmpipe"
FORMATS = ("unorm8", "unorm16", "float16", "float32")
DEPTH_TOP = (1 << 24) - 1


class Unsupported(ValueError):
    """The scene asks for what the OpenGL build does not have."""


def inputs(item: Pass) -> dict[str, Any]:
    """Return what a pass hands its kernel: the variables that its function holds."""
    held = dict(inspect.getclosurevars(item.execute).nonlocals)
    for name, parameter in inspect.signature(item.execute).parameters.items():
        if parameter.default is not inspect.Parameter.empty:
            held[name] = parameter.default
    return held


@dataclass(frozen=True, slots=True)
class Light:
    """The passes of one light and their inputs; `shadow` and `opaque` are None where there is no such pass."""

    prefix: str
    shadow: Pass
    upload: Pass
    opaque: Pass | None
    planes: Pass  # slabs of `beams`, planes of `beams_vertex`

    @property
    def given(self) -> dict[str, Any]:
        """Inputs of the planes."""
        return inputs(self.planes)


@dataclass(frozen=True, slots=True)
class Case:
    """A prepared scene."""

    technique: str
    setting: Setting
    bank: Bank
    base: Pass
    lights: tuple[Light, ...]
    image: str = ""  # of interleaved sampling: the start of the names of its frame and depth

    @property
    def scene(self) -> Scene:
        """The question."""
        return self.setting.scene

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        frame = self.buffer("frame")
        return frame.width, frame.height

    def buffer(self, name: str) -> Buffer:
        """Return a buffer of the mirror: frame and depth are the image's own."""
        return self.bank[self.image + name if name in ("frame", "depth") else name]

    @property
    def format(self) -> str:
        """Of the frame."""
        return self.setting.formats["frame"].name

    def draw(self, item: Pass, d0: int = 0, d1: int | None = None) -> None:
        """Let the mirror draw a range of a pass, on this thread."""
        item.execute(d0, len(item.draws) if d1 is None else d1, 0, item.rows)

    def codes(self, name: str) -> NDArray[Any]:
        """Return a buffer's codes or values (H, W, C), row 0 at the *bottom* as OpenGL has it."""
        return np.ascontiguousarray(self.buffer(name).codes()[::-1])

    def put(self, name: str, bottom_first: NDArray[Any]) -> None:
        """Store codes or values into a buffer of the mirror."""
        self.buffer(name).put(bottom_first[::-1], self.setting.device)


class Passes:
    """The order in which every build draws; a build has `lights`, `draw_base` and `read`."""

    lights: Sequence[Any]
    draw_base: Any
    read: Any

    def draw_all(self) -> NDArray[Any]:
        """Draw the whole picture; return the frame's codes or values."""
        for light in self.lights:
            light.draw_shadow_map()
        self.draw_base()
        for light in self.lights:
            light.draw_opaque()
        for light in self.lights:
            light.draw_planes()
        return self.read("frame")


def load(scene: str, overrides: Sequence[str] = (), technique: str | None = None) -> list[Case]:
    """Return a scene for comparison, on llvmpipe and in float32: one case, or one for each interleaved image.

    Raises
    ------
    SceneError
        The scene is wrong.
    Unsupported
        It asks for something that the OpenGL build has no pass for.
    """
    question = load_scene(scene, (*overrides, f"buffers.device={DEVICE}", "buffers.arithmetic=float32"))
    name, setting, passes, bank, _ = prepare(question, technique, None, None)
    by_name = {p.name: p for p in passes}
    images = sorted({p.name.split("/")[0] + "/" for p in passes if p.name.startswith("image_")}) or [""]
    return [_case(name, setting, bank, by_name, image) for image in images]


def _case(technique: str, setting: Setting, bank: Bank, by_name: dict[str, Pass], image: str) -> Case:
    """Return the passes of one image as a case."""
    scene = setting.scene
    if any(scene.triangles(i) is not None for i in range(len(scene.objects))):
        raise Unsupported(f"{scene.origin}: the OpenGL build draws spheres, boxes and grounds, not triangles")
    lights = []
    for i in range(len(scene.lights)):
        prefix = f"light_{i}"
        planes = by_name.get(f"{image}{prefix}/slabs") or by_name.get(f"{image}{prefix}/planes")
        shadow = by_name.get(f"{prefix}/shadow_map")
        if planes is None or shadow is None:
            raise Unsupported(f"{scene.origin}: the OpenGL build needs visibility = shadow_map, and planes to draw")
        opaque = by_name.get(f"{image}{prefix}/opaque")
        lights.append(Light(prefix, shadow, by_name[f"{prefix}/upload"], opaque, planes))
    case = Case(technique, setting, bank, by_name[f"{image}opaque"], tuple(lights), image)
    _check(case)
    return case


def _check(case: Case) -> None:
    formats = {n: f.name for n, f in case.setting.formats.items()}
    for name, allowed in (("frame", FORMATS), ("f_h", FORMATS), ("depth", ("depth24",)), ("shadow_map", ("depth24",))):
        if formats.get(name, allowed[0]) not in allowed:
            raise Unsupported(f"the OpenGL build stores {name} as {', '.join(allowed)}, not {formats[name]}")
    for light in case.lights:
        given = light.given["uniforms"]
        if given.switches.exact_distribution or given.slab_switches.exact_q:
            raise Unsupported("the OpenGL build reads light map and q from textures; exact ones are the mirror's alone")
