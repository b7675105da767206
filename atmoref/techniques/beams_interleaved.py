"""Light beams by interleaved sampling: several images with shifted planes [Dobashi 2002, sec. 4.3, after Keller].

`average`: the paper's comparison.  Each image draws all planes of the previous method, shifted by a fraction of their
spacing; the images are averaged in the arithmetic of the shading and stored.
`interleave`: what the paper proposes where filling pixels is the bound.  Every pixel belongs to one of n x n images of
1/n the resolution, each with its own shift; they are put side by side, so the whole costs what one image costs.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.bounds import Bounds
from atmoref.buffers.layout import Buffer
from atmoref.lanes import N
from atmoref.pipeline import Bank, Pass
from atmoref.scene import Scene, SceneError
from atmoref.stages.beam_planes import COUNTERS, PROBE
from atmoref.techniques import beams_vertex
from atmoref.techniques.beam_plan import base_distance, extent
from atmoref.techniques.beams_parameters import BeamsInterleavedParameters
from atmoref.techniques.light_frames import light_frame, shadow_far
from atmoref.techniques.opaque_passes import Stage, opaque_passes, shadow_passes, spotlight
from atmoref.techniques.setting import Setting

NAME = "beams_interleaved"
Parameters = BeamsInterleavedParameters
BUFFERS = beams_vertex.BUFFERS


def sub_scene(scene: Scene, columns: int) -> Scene:
    """Return the scene as one of columns x columns interleaved images sees it.

    Raises
    ------
    SceneError
        If the image cannot be divided evenly.
    """
    width, height = scene.image.width, scene.image.height
    if width % columns or height % columns:
        raise SceneError(
            f"{scene.origin}: image: found {width} x {height} pixels; allowed with technique.composition = "
            f'"interleave" and {columns * columns} images: multiples of {columns}'
        )
    image = scene.image.model_copy(update={"width": width // columns, "height": height // columns})
    return dataclasses.replace(scene, image=image)


def image_stage(stage: Stage, index: int, columns: int, key: str) -> Stage:
    """Return the stage of one image: its own frame and depth buffer, the lights of the whole."""
    setting = dataclasses.replace(stage.setting, scene=sub_scene(stage.scene, columns))
    if columns > 1:
        setting = dataclasses.replace(setting, crop=None)
    i, j = index % columns, index // columns % columns  # place in the n x n pattern; a full image has none
    centre = 0.5 * (columns - 1)
    shift = ((i - centre) / columns, (j - centre) / columns)
    width, height = setting.scene.image.width, setting.scene.image.height
    own = Bank(
        frame=setting.target(stage.bank, "frame", f"{key}/frame", width, height),
        depth=setting.depth_target(stage.bank, "depth", f"{key}/depth", width, height),
    )
    return Stage(setting, stage.params, own, shift, stage.spots, stage.triangles())


def renamed(p: Pass, key: str) -> Pass:
    """Return a pass of one image under names of its own."""
    return dataclasses.replace(
        p,
        name=f"{key}/{p.name}",
        draws=tuple(f"{key}/{name}" for name in p.draws),
        stores=tuple(f"{key}/{name}" for name in p.stores),
    )


def composed(setting: Setting, images: list[Buffer], columns: int) -> NDArray[Any]:
    """Return the mean of full images, or n x n small ones put side by side (row 0 of `data` is the bottom row)."""
    values = [image.values() for image in images]
    if columns == 1:
        mean = values[0].astype(setting.dtype)
        for other in values[1:]:
            mean = mean + other.astype(setting.dtype)
        return np.asarray(mean * setting.dtype(1.0 / len(values)))
    height, width = values[0].shape[:2]
    whole = np.zeros((height * columns, width * columns, 3))
    for index, small in enumerate(values):
        i, j = index % columns, index // columns
        whole[columns - 1 - j :: columns, i::columns] = small  # j counts from the bottom, rows of values from the top
    return whole


def compose(setting: Setting, frame: Buffer, images: list[Buffer], columns: int) -> None:
    """Store `composed` images; of intervals both ends, each a sum of its own kind."""
    rounding = setting.rounding_of(frame.format)
    if not isinstance(frame, Bounds):
        frame.put(composed(setting, images, columns), setting.device, rounding)
        return
    pairs = [image for image in images if isinstance(image, Bounds)]
    ends = (composed(setting, [p.low for p in pairs], columns), composed(setting, [p.high for p in pairs], columns))
    frame.put(np.stack(ends), setting.device, rounding)
    if setting.envelope and frame.format.kind == "unorm":  # either code next to the mean
        top = frame.format.top
        codes = (np.floor(np.clip(ends[0], 0.0, 1.0) * top), np.ceil(np.clip(ends[1], 0.0, 1.0) * top))
        least = np.minimum(frame.low.codes(), codes[0].astype(np.int64))
        frame.put(np.stack((least, np.maximum(frame.high.codes(), codes[1].astype(np.int64)))))


def build(
    setting: Setting, params: BeamsInterleavedParameters, *, trace: bool = False
) -> tuple[list[Pass], Bank, dict[str, Any]]:
    """Return the passes of a scene, their buffers, and what was decided; see `beams.build`."""
    scene, bank = setting.scene, Bank()
    stage = Stage(setting, params, bank)
    frame = setting.target(bank, "frame", "frame", scene.image.width, scene.image.height)
    columns = math.isqrt(params.images) if params.composition == "interleave" else 1
    passes: list[Pass] = []
    bases = []
    for index in range(len(scene.lights)):
        light = light_frame(scene, index)
        bases.append(base_distance(scene, light, params, index))
        far = shadow_far(scene, light, bases[-1])
        stage.spots.append(spotlight(stage, index, far))
        passes += shadow_passes(stage, stage.spots[-1], far)
    report: dict[str, Any] = {"lights": [], "counters": [], "probe": []}
    stages = [image_stage(stage, i, columns, f"image_{i}") for i in range(params.images)]
    for i, own in enumerate(stages):
        passes += [renamed(p, f"image_{i}") for p in opaque_passes(own)]
        for name, buffer in own.bank.items():
            bank.setdefault(f"image_{i}/{name}", dataclasses.replace(buffer, name=f"image_{i}/{name}"))
        for spot, base_m in zip(own.spots, bases, strict=True):
            near, far = extent(scene, spot.frame, base_m, params.bounds)
            z, dt = shifted_depths(near, far, params, i)
            counters = np.zeros((own.scene.image.height, COUNTERS), np.int64)
            probe = np.zeros(max(len(z), 1) * len(PROBE) * N) if trace else None
            passes.append(renamed(beams_vertex.planes_pass(own, spot, z, dt, counters, probe), f"image_{i}"))
            report["counters"].append(counters)
            report["probe"].append(probe)
            report["lights"].append(
                {"image": i, "interval_m": dt, "main_planes": len(z), "sub_planes": 0, "depth_m": [near, far],
                 "base_distance_m": base_m}
            )  # fmt: skip
    images = [own.bank["frame"] for own in stages]

    def execute(d0: int, d1: int, row0: int, row1: int) -> None:
        compose(setting, frame, images, columns)

    passes.append(Pass(params.composition, (params.composition,), 1, execute, ("frame",)))
    return passes, bank, report


def shifted_depths(near_m: float, far_m: float, params: BeamsInterleavedParameters, image: int) -> tuple[Any, float]:
    """Return the depths of one image's planes and their spacing, metres: image i starts i / images of it later."""
    if far_m <= near_m:
        return np.zeros(0), 1.0
    dt = (far_m - near_m) / params.planes
    return near_m + dt * (np.arange(params.planes, dtype=np.float64) + image / params.images), dt
