"""What the truths of light beams ask of a scene: the same numbers as plain arrays, and nothing computed from them.

Shared by the quadrature and the Monte Carlo, because it is the question and not a method.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref.optics.phase_functions import PHASE_FUNCTIONS

__all__ = ["FALLOFFS", "LINEAR_ANGLE", "NO_FALLOFF", "SMOOTHSTEP_COSINE", "Question", "ask"]

SMOOTHSTEP_COSINE = 0
LINEAR_ANGLE = 1
NO_FALLOFF = 2
FALLOFFS = {"smoothstep_cosine": SMOOTHSTEP_COSINE, "linear_angle": LINEAR_ANGLE, "none": NO_FALLOFF}

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Question(NamedTuple):
    """A beams scene in arrays: L lights, S spheres, B boxes, G grounds; metres, radians, three colour channels last.

    A light with ``outer_rad = pi`` shines everywhere (no cone); scene files cannot ask for it, closed forms can.
    """

    eye: Floats  # (3,)
    right: Floats  # (3,) camera axes, unit
    up: Floats
    forward: Floats
    half_width: float  # of the image plane at distance 1
    half_height: float
    light_position: Floats  # (L, 3)
    light_axis: Floats  # (L, 3) unit, of travel
    light_inner_rad: Floats  # (L,)
    light_outer_rad: Floats
    light_falloff: Ints
    light_peak: Floats
    light_intensity: Floats  # (L, 3) W/sr
    sphere_center: Floats  # (S, 3)
    sphere_radius: Floats  # (S,)
    sphere_albedo: Floats  # (S, 3)
    box_min: Floats  # (B, 3)
    box_max: Floats
    box_albedo: Floats
    ground_height: Floats  # (G,)
    ground_albedo: Floats  # (G, 3)
    extinction: Floats  # (3,) 1/m
    scattering: Floats  # (3,) 1/m
    extinction_group: Ints  # (3,) index into group_extinction: equal channels share one integral
    group_extinction: Floats  # (1..3,) distinct extinctions, 1/m
    phase_kind: int
    phase_g: float
    ambient: Floats  # (3,)
    ambient_saturates: bool


def _rows(rows: Sequence[Sequence[float]], width: int = 3) -> Floats:
    return np.array(rows, np.float64).reshape(len(rows), width)


def _unit(v: Sequence[float]) -> Floats:
    x, y, z = (float(c) for c in v)
    length = math.hypot(x, y, z)
    return np.array([x / length, y / length, z / length])


def _camera_axes(camera: Any) -> tuple[Floats, Floats, Floats]:
    """Return right, up, forward of a right-handed camera: right = forward × up (own code: see decision 0003)."""
    forward = _unit([float(b) - float(a) for a, b in zip(camera.position_m, camera.look_at_m, strict=True)])
    right = _unit(np.cross(forward, np.array(camera.up, np.float64)).tolist())
    return right, _unit(np.cross(right, forward).tolist()), forward


def _groups(extinction: Floats) -> tuple[Ints, Floats]:
    distinct: list[float] = []
    for sigma in extinction.tolist():
        if sigma not in distinct:
            distinct.append(sigma)
    return np.array([distinct.index(s) for s in extinction.tolist()], np.int64), np.array(distinct)


def ask(scene: Any, ambient_mode: str = "constant") -> Question:
    """Return the arrays of a scene's question.

    Parameters
    ----------
    scene
        A validated scene with a perspective camera and spot lights.
    ambient_mode
        ``"constant"``: the ambient term is added whatever the distance; ``"saturating"``: times 1 - exp(-sigma_t T)
        (erratum D-E34).

    Raises
    ------
    ValueError
        For an unknown ambient mode, or a kind of camera, light or object that this truth has no equation for.
    """
    if ambient_mode not in ("constant", "saturating"):
        raise ValueError(f"ambient mode {ambient_mode!r}: allowed are 'constant' and 'saturating'")
    width, height = int(scene.image.width), int(scene.image.height)
    half_height = math.tan(math.radians(float(scene.camera.vertical_fov_deg)) / 2.0)
    right, up, forward = _camera_axes(scene.camera)
    kinds: dict[str, list[Any]] = {"sphere": [], "box": [], "ground": []}
    for thing in scene.objects:
        if thing.type not in kinds:
            raise ValueError(f"the truth of beams has no object of type {thing.type!r}")
        kinds[thing.type].append(thing)
    for light in scene.lights:
        if light.type != "spot":
            raise ValueError(f"the truth of beams has no light of type {light.type!r}")
    medium = scene.medium
    extinction = np.array(medium.extinction_per_m, np.float64)
    group, distinct = _groups(extinction)
    return Question(
        eye=np.array(scene.camera.position_m, np.float64),
        right=right,
        up=up,
        forward=forward,
        half_width=half_height * width / height,
        half_height=half_height,
        light_position=_rows([light.position_m for light in scene.lights]),
        light_axis=_rows([_unit(light.direction).tolist() for light in scene.lights]),
        light_inner_rad=np.array([math.radians(light.inner_half_angle_deg) for light in scene.lights]),
        light_outer_rad=np.array([math.radians(light.outer_half_angle_deg) for light in scene.lights]),
        light_falloff=np.array([FALLOFFS[light.falloff] for light in scene.lights], np.int64),
        light_peak=np.array([float(light.peak) for light in scene.lights]),
        light_intensity=_rows([light.radiant_intensity_w_per_sr for light in scene.lights]),
        sphere_center=_rows([s.center_m for s in kinds["sphere"]]),
        sphere_radius=np.array([float(s.radius_m) for s in kinds["sphere"]]),
        sphere_albedo=_rows([s.albedo for s in kinds["sphere"]]),
        box_min=_rows([b.min_m for b in kinds["box"]]),
        box_max=_rows([b.max_m for b in kinds["box"]]),
        box_albedo=_rows([b.albedo for b in kinds["box"]]),
        ground_height=np.array([float(g.height_m) for g in kinds["ground"]]),
        ground_albedo=_rows([g.albedo for g in kinds["ground"]]),
        extinction=extinction,
        scattering=extinction * np.array(medium.single_scattering_albedo, np.float64),
        extinction_group=group,
        group_extinction=distinct,
        phase_kind=PHASE_FUNCTIONS[medium.phase_function.type],
        phase_g=float(getattr(medium.phase_function, "g", 0.0) or 0.0),
        ambient=np.array(medium.ambient_radiance, np.float64),
        ambient_saturates=ambient_mode == "saturating",
    )
