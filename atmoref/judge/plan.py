"""A mirror that is prepared and not yet drawn, and changed copies of it: what a diagnosis supposes about a build."""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.layout import Buffer
from atmoref.memory import Account, allowed_bytes
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene
from atmoref.techniques.render import parameters, technique_module, technique_name
from atmoref.techniques.setting import Setting, make_setting

Group = tuple[tuple[int, int, int], ...]  # (pass, first draw, last draw), in order
Stored = dict[str, NDArray[Any]]


@dataclass(slots=True)
class Plan:
    """Everything of a render that is decided before the first draw."""

    technique: str
    setting: Setting
    passes: list[Pass]
    bank: Bank

    def draw(self, group: Group) -> None:
        """Draw a group of draws, whole rows, on this thread; neighbours in one call, which leaves the same bits."""
        joined: list[tuple[int, int, int]] = []
        for at, first, last in group:
            if joined and joined[-1][0] == at and joined[-1][2] == first:
                joined[-1] = (at, joined[-1][1], last)
            else:
                joined.append((at, first, last))
        for at, first, last in joined:
            item = self.passes[at]
            row0, row1 = item.window or (0, item.rows)
            item.execute(first, last, row0, row1)

    def stored(self, name: str) -> NDArray[Any]:
        """Return a buffer's codes or numbers (H, W, C), row 0 at the top."""
        return self.bank[name].codes()

    def put(self, stored: Mapping[str, NDArray[Any]]) -> None:
        """Replace buffers by what a build stored; names that this plan lacks are left out."""
        for name, texels in stored.items():
            if name in self.bank:
                self.bank[name].put(texels, self.setting.device)

    def upload(self) -> None:
        """Hand shadow maps and light maps to the texture units."""
        for item in self.passes:
            if item.name.endswith("/upload"):
                item.execute(0, 1, 0, 1)


def make_plan(scene: Scene, technique: str | None = None, change: Callable[[Setting], Setting] | None = None) -> Plan:
    """Return the mirror of a scene, ready to draw; `change` alters its setting (a device's rules, a format).

    Raises
    ------
    SceneError
        The request is wrong.
    """
    name = technique_name(scene, technique)
    module = technique_module(name)
    preset = scene.technique.preset
    arithmetic: Any = "float64" if preset == "analysis" else "float32"
    setting = make_setting(scene, module.BUFFERS[preset], arithmetic, None, Account(scene.origin, allowed_bytes(None)))
    if change is not None:
        setting = change(setting)
    passes, bank, _ = module.build(setting, parameters(scene, name))
    return Plan(name, setting, passes, bank)


def with_device(**fields: Any) -> Callable[[Setting], Setting]:
    """Return a change of a setting: the same device but for these rules; they override a scene's `rounding`."""

    def change(setting: Setting) -> Setting:
        return replace(setting, device=replace(setting.device, **fields), rounding=None)

    return change


def given(item: Pass) -> dict[str, Any]:
    """Return what a pass hands its kernel: the variables that its function holds."""
    return dict(inspect.getclosurevars(item.execute).nonlocals)


def with_inputs(item: Pass, changes: Mapping[str, Any]) -> Pass:
    """Return a pass whose kernel gets other inputs.

    The function of a pass is rebuilt over other variables: techniques need no second way in for a diagnosis.
    """
    function: Any = item.execute
    names: Sequence[str] = function.__code__.co_freevars
    cells = tuple(
        types.CellType(changes[name]) if name in changes else cell
        for name, cell in zip(names, function.__closure__, strict=True)
    )
    rebuilt = types.FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, cells
    )
    rebuilt.__kwdefaults__ = function.__kwdefaults__
    return replace(item, execute=rebuilt)


def magnified(buffer: Buffer, factor: int) -> Buffer:
    """Return a texture of `factor` times as many texels a side, each repeated: read linearly it looks read nearest."""
    texels = np.repeat(np.repeat(buffer.codes(), factor, 0), factor, 1)
    return retextured(buffer, texels)


def retextured(buffer: Buffer, texels: NDArray[Any]) -> Buffer:
    """Return a buffer of the same name, format and element type with other texels (H, W, C), row 0 at the top."""
    height, width, channels = texels.shape
    data = np.zeros(width * height * channels, buffer.data.dtype)
    made = Buffer(buffer.name, buffer.format, width, height, channels, width, data)
    made.put(texels)
    return made
