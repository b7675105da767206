"""Derived bounds of a draw: the mirror draws it in intervals, from the build's own previous buffers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.bounds import Bounds
from atmoref.judge.allowance import Allowed, DrawAsked, tolerance
from atmoref.judge.bounds import Which, with_intervals
from atmoref.judge.plan import make_plan
from atmoref.pipeline import Pass
from atmoref.scene import Scene

TABLES = ("q", "q_rest")  # a plan's own, which nothing replaces
NAMES: dict[Which, str] = {"device": "device interval", "envelope": "envelope"}


class DerivedBounds:
    """What correct builds may store, draw by draw: a `BoundsOfDraw`.

    Parameters
    ----------
    scene : Scene
        With the formats and the device of the build.
    technique : str or None
        Instead of the scene's own.
    interval : "device" or "envelope"
        Builds on the scene's device, or on any that the specifications permit.

    Raises
    ------
    SceneError
        Intervals do not answer this scene: q without a table, formats of float64.

    Notes
    -----
    Textures that the host makes have no interval; they get `allowance.tolerance`.
    """

    def __init__(self, scene: Scene, technique: str | None = None, interval: Which = "device") -> None:
        self.name = NAMES[interval]
        self.plan = make_plan(with_intervals(scene, interval), technique)
        self.places = {item.name: at for at, item in enumerate(self.plan.passes)}
        self.held: dict[str, NDArray[Any]] = {}  # what buffers hold now, both ends alike

    def __call__(self, asked: DrawAsked) -> Allowed:
        """Return the bounds of one dumped buffer."""
        buffer = self.plan.bank.get(asked.buffer)
        if not asked.draws or not isinstance(buffer, Bounds):
            return tolerance(asked)
        self._put(asked.before)
        self._forget(item for item, _, _ in asked.draws)
        self.plan.draw(tuple((self.places[item.name], first, last) for item, first, last in asked.draws))
        low, high = buffer.low.codes(), buffer.high.codes()
        return Allowed(low.astype(np.float64), high.astype(np.float64), name=self.name)

    def around(self, mirror: NDArray[Any]) -> Allowed:
        """Return what is known to be allowed without drawing: what the mirror stored."""
        same = mirror.astype(np.float64)
        return Allowed(same, same, name=self.name)

    def _put(self, before: dict[str, NDArray[Any]]) -> None:
        """Let buffers hold what the build stored; those that do already are left alone."""
        maps = False
        for name, texels in before.items():
            if name not in self.plan.bank or name.rpartition("/")[2] in TABLES:
                continue
            if name in self.held and np.array_equal(self.held[name], texels):
                continue
            self.plan.put({name: texels})
            self.held[name] = texels
            maps = maps or name.endswith("_map")
        if maps:
            self.plan.upload()

    def _forget(self, drawn: Iterable[Pass]) -> None:
        """Take what these passes may draw into as unknown."""
        for item in drawn:
            for name in {*item.stores, "depth"}:
                self.held.pop(name, None)
                self.held.pop(name.rpartition("/")[0] + "/depth", None)
