"""What the truths of light beams ask of a scene: its numbers in a few plain tables, and nothing computed from them.

Shared by the quadrature and the Monte Carlo, because it is the question and not a method. Tables rather than an array
per quantity: Numba passes every field of every array as an argument, and 26 arrays took 24 s to compile.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import subroutine
from atmoref.optics.phase_functions import PHASE_FUNCTIONS
from atmoref.truth.beams_hierarchy import Mesh, build_hierarchy
from atmoref.truth.beams_light_maps import pad_pictures, projector_row, sun_row

__all__ = [
    "FALLOFFS",
    "LINEAR_ANGLE",
    "NO_FALLOFF",
    "SMOOTHSTEP_COSINE",
    "Camera",
    "Light",
    "Medium",
    "Objects",
    "Question",
    "ask",
    "light_at",
]

SMOOTHSTEP_COSINE = 0
LINEAR_ANGLE = 1
NO_FALLOFF = 2
LIGHTS = ("spot", "projector", "sun")
FALLOFFS = {"smoothstep_cosine": SMOOTHSTEP_COSINE, "linear_angle": LINEAR_ANGLE, "none": NO_FALLOFF}

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]


class Camera(NamedTuple):
    """A perspective camera: place (m), unit axes, and half the size of the image plane at distance 1."""

    eye: Triple
    right: Triple
    up: Triple
    forward: Triple
    half_width: float
    half_height: float


class Objects(NamedTuple):
    """Opaque things, a row each; the last three columns are the albedo."""

    spheres: Floats  # (S, 7) centre, radius, albedo
    boxes: Floats  # (B, 9) least corner, greatest corner, albedo
    grounds: Floats  # (G, 4) height, albedo


class Medium(NamedTuple):
    """The uniform medium: 1/m, three channels."""

    extinction: Triple
    scattering: Triple
    group: tuple[int, int, int]  # index of a channel's extinction among the distinct ones, which share an integral
    distinct: Triple  # the distinct extinctions, as many as ``groups``
    groups: int
    phase_kind: int
    phase_g: float
    ambient: Triple
    ambient_saturates: bool


class Question(NamedTuple):
    """A beams scene."""

    camera: Camera
    lights: Floats  # (L, 13) spotlights: rows that light_at() reads
    objects: Objects
    medium: Medium
    projectors: Floats  # (M, 18) rows that projector_at() reads
    suns: Floats  # (N, 22) rows that sun_at() reads
    texels: Floats  # (K, 3) the pictures of projectors and suns
    mesh: Mesh | None  # the triangles of all meshes and height fields; None spares compiling what handles them


class Light(NamedTuple):
    """One spotlight; axis along the light's travel, intensity in W/sr.

    A light with ``outer = pi`` shines everywhere (no cone); scene files cannot ask for it, closed forms can.
    """

    position: Triple
    axis: Triple
    inner: float  # rad
    outer: float
    falloff: int
    peak: float
    intensity: Triple


@subroutine
def light_at(lights: Floats, i: int) -> Light:
    """Return light ``i`` of a question."""
    return Light(
        (lights[i, 0], lights[i, 1], lights[i, 2]),
        (lights[i, 3], lights[i, 4], lights[i, 5]),
        lights[i, 6],
        lights[i, 7],
        int(lights[i, 8]),
        lights[i, 9],
        (lights[i, 10], lights[i, 11], lights[i, 12]),
    )


def _light_row(light: Any) -> list[float]:
    return [
        *light.position_m,
        *_unit(light.direction),
        math.radians(light.inner_half_angle_deg),
        math.radians(light.outer_half_angle_deg),
        float(FALLOFFS[light.falloff]),
        float(light.peak),
        *light.radiant_intensity_w_per_sr,
    ]


def _table(rows: Sequence[Sequence[float]], width: int) -> Floats:
    return np.array(rows, np.float64).reshape(len(rows), width)


def _triple(v: Sequence[float]) -> Triple:
    return float(v[0]), float(v[1]), float(v[2])


def _unit(v: Sequence[float]) -> Triple:
    x, y, z = _triple(v)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


def _camera(camera: Any, width: int, height: int) -> Camera:
    """Return the camera; right-handed, right = forward × up (own code: docs/decisions/0003-truth-independence.md)."""
    if camera.type != "perspective":
        raise ValueError(f"the truth of beams has no camera of type {camera.type!r}")
    eye = _triple(camera.position_m)
    forward = _unit([b - a for a, b in zip(eye, _triple(camera.look_at_m), strict=True)])
    right = _unit(_cross(forward, _unit(camera.up)))
    half_height = math.tan(math.radians(float(camera.vertical_fov_deg)) / 2.0)
    return Camera(eye, right, _unit(_cross(right, forward)), forward, half_height * width / height, half_height)


def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _objects(scene: Any) -> tuple[Objects, Mesh | None]:
    spheres, boxes, grounds, meshes = [], [], [], []
    for i, thing in enumerate(scene.objects):
        if thing.type == "sphere":
            spheres.append([*thing.center_m, thing.radius_m, *thing.albedo])
        elif thing.type == "box":
            boxes.append([*thing.min_m, *thing.max_m, *thing.albedo])
        elif thing.type == "ground":
            grounds.append([thing.height_m, *thing.albedo])
        elif thing.type in ("mesh", "height_field"):
            vertices, faces = scene.triangles(i)
            meshes.append((vertices, faces, _triple(thing.albedo)))
        else:
            raise ValueError(f"the truth of beams has no object of type {thing.type!r}")
    mesh = build_hierarchy(meshes)
    solids = Objects(_table(spheres, 7), _table(boxes, 9), _table(grounds, 4))
    return solids, mesh if len(mesh.tree) else None


def _pictured(scene: Any) -> tuple[Floats, Floats, Floats]:
    """Return the rows of projectors and suns, and the texels of their pictures."""
    kinds = [light.type for light in scene.lights]
    chosen = [i for i, kind in enumerate(kinds) if kind in ("projector", "sun")]
    has_map = [kinds[i] == "projector" or scene.lights[i].window is not None for i in chosen]
    maps = [scene.light_map(i) if has else None for i, has in zip(chosen, has_map, strict=True)]
    texels, places = pad_pictures(maps)
    projectors, suns = [], []
    for i, place in zip(chosen, places, strict=True):
        if kinds[i] == "projector":
            projectors.append(projector_row(scene.lights[i], place))
        else:
            suns.append(sun_row(scene.lights[i], place))
    return _table(projectors, 18), _table(suns, 22), texels


def _medium(medium: Any, saturates: bool) -> Medium:
    extinction = _triple(medium.extinction_per_m)
    albedo = _triple(medium.single_scattering_albedo)
    distinct = list(dict.fromkeys(extinction))
    a, b, c = (distinct.index(sigma) for sigma in extinction)
    return Medium(
        extinction=extinction,
        scattering=_triple([s * w for s, w in zip(extinction, albedo, strict=True)]),
        group=(a, b, c),
        distinct=_triple([*distinct, 0.0, 0.0]),
        groups=len(distinct),
        phase_kind=PHASE_FUNCTIONS[medium.phase_function.type],
        phase_g=float(medium.phase_function.g),
        ambient=_triple(medium.ambient_radiance),
        ambient_saturates=saturates,
    )


def ask(scene: Any, ambient_mode: str = "constant") -> Question:
    """Return the question that a scene asks.

    Parameters
    ----------
    scene
        A validated scene with a perspective camera.
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
    for light in scene.lights:
        if light.type not in LIGHTS:
            raise ValueError(f"the truth of beams has no light of type {light.type!r}")
    projectors, suns, texels = _pictured(scene)
    objects, mesh = _objects(scene)
    return Question(
        camera=_camera(scene.camera, int(scene.image.width), int(scene.image.height)),
        lights=_table([_light_row(light) for light in scene.lights if light.type == "spot"], 13),
        objects=objects,
        medium=_medium(scene.medium, ambient_mode == "saturating"),
        projectors=projectors,
        suns=suns,
        texels=texels,
        mesh=mesh,
    )
