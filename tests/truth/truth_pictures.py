"""Lights with pictures and objects of triangles for the tests of the truths, and what they do in plain Python."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import integrate
from truth_scenes import _changes, scene, visible


def unit(v: Any) -> np.ndarray:
    """Return a vector of length 1."""
    array = np.array(v, float)
    return array / np.linalg.norm(array)


def projector(position=(0.0, 20.0, 0.0), direction=(0.0, -1.0, 0.0), half=30.0, **more: Any) -> SimpleNamespace:
    """Return a projector as a scene has it."""
    light = {
        "type": "projector",
        "position_m": position,
        "up": (0.0, 0.0, 1.0),
        "horizontal_half_angle_deg": half,
        "peak": 1.0,
        "radiant_intensity_w_per_sr": (1000.0, 1000.0, 1000.0),
    }
    return SimpleNamespace(**(light | more), axis=lambda: tuple(unit(direction)))


def sun(direction=(0.2, -1.0, 0.1), irradiance=(10.0, 10.0, 10.0), window: Any = None) -> SimpleNamespace:
    """Return a sun as a scene has it."""
    return SimpleNamespace(
        type="sun", irradiance_w_per_m2=irradiance, window=window, axis=lambda: tuple(unit(direction))
    )


def window(center=(0.0, 20.0, 0.0), across=(10.0, 0.0, 0.0), up=(0.0, 0.0, 10.0), peak=1.0) -> SimpleNamespace:
    """Return a sun's window as a scene has it."""
    return SimpleNamespace(center_m=center, across_m=across, up_m=up, peak=peak)


def with_files(s: Any, pictures: Any = None, triangles: Any = None) -> Any:
    """Return the scene with pictures of its lights and triangles of its objects, by index."""
    s.light_map = (pictures or {}).get
    s.triangles = (triangles or {}).get
    return s


def mesh(albedo=(0.5, 0.5, 0.5)) -> SimpleNamespace:
    """Return a mesh as a scene has it, without its triangles."""
    return SimpleNamespace(type="mesh", albedo=albedo)


# --- triangles -------------------------------------------------------------------------------------------------------

BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int32,
)  # fmt: skip


def box_triangles(low: Any, high: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the twelve triangles of a box."""
    return np.array(list(itertools.product(*zip(low, high, strict=True))), float), BOX_FACES


def field_triangles(heights: np.ndarray, cell=1.0, center=(0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of a height field: two for each cell, cut from (row, col) to (row + 1, col + 1)."""
    rows, columns = heights.shape
    x = center[0] + (np.arange(columns) - (columns - 1) / 2) * cell
    z = center[2] + (np.arange(rows) - (rows - 1) / 2) * cell
    vertices = np.stack([np.tile(x, rows), center[1] + heights.ravel(), np.repeat(z, columns)], axis=1)
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate([np.stack([a, a + columns, a + columns + 1], 1), np.stack([a, a + columns + 1, a + 1], 1)])
    return vertices, faces.astype(np.int32)


def ball_triangles(center: Any, radius: float, divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a sphere's triangles: faces of an octahedron in ``divisions``², pushed out to the sphere."""
    corners = [np.array(p, float) for p in ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))]
    vertices, faces = [], []
    n = divisions
    for pole in (np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])):
        for k in range(4):
            a, b = corners[k], corners[(k + 1) % 4]
            at = {}
            for i in range(n + 1):
                for j in range(n + 1 - i):
                    at[i, j] = len(vertices)
                    vertices.append(np.array(center) + radius * unit(pole * (n - i - j) + a * i + b * j))
            for i in range(n):
                for j in range(n - i):
                    faces.append((at[i, j], at[i + 1, j], at[i, j + 1]))
                    if i + j < n - 1:
                        faces.append((at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]))
    return np.array(vertices), np.array(faces, np.int32)


# --- plain Python ----------------------------------------------------------------------------------------------------


def _bilinear(picture: np.ndarray, u: float, v: float, channel: int) -> float:
    """Return a picture's value, v = 1 at the top; clamped in the outer half texels, 0 outside."""
    rows, columns = picture.shape[:2]
    if not (0.0 <= u <= 1.0 and 0.0 <= v <= 1.0):
        return 0.0
    x = min(max(u * columns - 0.5, 0.0), columns - 1.0)
    y = min(max((1.0 - v) * rows - 0.5, 0.0), rows - 1.0)
    i, j = min(int(x), max(columns - 2, 0)), min(int(y), max(rows - 2, 0))
    cell = np.array([[picture[min(j + b, rows - 1), min(i + a, columns - 1), channel] for a in (0, 1)] for b in (0, 1)])
    return float(np.array([1.0 - (y - j), y - j]) @ cell @ np.array([1.0 - (x - i), x - i]))


def picture_place(light: Any, picture: np.ndarray, p: np.ndarray) -> tuple[float, float, float]:
    """Return u and v of a place in a light's picture, and the distance behind projector or window."""
    axis = np.array(light.axis())
    if light.type == "projector":
        right = unit(np.cross(axis, light.up))
        up = np.cross(right, axis)
        to = p - np.array(light.position_m)
        half = math.tan(math.radians(light.horizontal_half_angle_deg))
        w = float(to @ axis)
        rows, columns = picture.shape[:2]
        return 0.5 + float(to @ right) / (2 * w * half), 0.5 + float(to @ up) / (2 * w * half * rows / columns), w
    a, b = np.array(light.window.across_m), np.array(light.window.up_m)
    u, v, w = np.linalg.solve(np.stack([a, b, axis], 1), p - np.array(light.window.center_m))
    return 0.5 + u, 0.5 + v, w


def shining(light: Any, picture: np.ndarray, p: np.ndarray, channel: int) -> float:
    """Return I_l at a place."""
    if light.type == "sun" and light.window is None:
        return 1.0
    u, v, w = picture_place(light, picture, p)
    peak = light.peak if light.type == "projector" else light.window.peak
    return peak * _bilinear(picture, u, v, channel) if w > 0.0 else 0.0


def reaches(s: Any, light: Any, p: np.ndarray) -> bool:
    """Tell whether no sphere, box or ground is between light and place."""
    if light.type == "projector":
        return visible(s.objects, light, p)
    axis = np.array(light.axis())
    way = 1e6
    if light.window is not None:
        way = picture_place(light, np.ones((1, 1, 3)), p)[2]
        if way < 0.0:
            return False
    return visible(s.objects, SimpleNamespace(position_m=p - way * axis), p)


def beam_by_brute_force(s: Any, which: int, a: np.ndarray, d: np.ndarray, length: float, p: Any) -> list[float]:
    """Return the beam term of one light by SciPy in t, with breakpoints found by sampling and bisection.

    ``p`` is the phase function of the scattering cosine.
    """
    light = s.lights[which]
    picture = s.light_map(which)
    picture = np.ones((1, 1, 3)) if picture is None else picture
    rows, columns = picture.shape[:2]

    def state(t):
        q = a + t * d
        if light.type == "sun" and light.window is None:
            return reaches(s, light, q)
        u, v, w = picture_place(light, picture, q)
        if not (w > 0.0 and 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0):
            return None
        return math.floor(u * columns - 0.5), math.floor(v * rows - 0.5), reaches(s, light, q)

    def f(t, channel):
        q = a + t * d
        sigma = s.medium.extinction_per_m[channel]
        if light.type == "sun":
            power = light.irradiance_w_per_m2[channel] * p(-float(np.array(light.axis()) @ d))
            return power * shining(light, picture, q, channel) * math.exp(-sigma * t)
        w = q - np.array(light.position_m)
        r = math.sqrt(float(w @ w))
        power = light.radiant_intensity_w_per_sr[channel] * p(-float(w @ d) / r) / (r * r)
        return power * shining(light, picture, q, channel) * math.exp(-sigma * (r + t))

    totals = [0.0, 0.0, 0.0]
    cuts = [0.0, *_changes(state, 0.0, length), length]
    for low, high in itertools.pairwise(cuts):
        middle = a + 0.5 * (low + high) * d
        if high > low and reaches(s, light, middle) and shining(light, picture, middle, 0) >= 0.0:
            for c in range(3):
                scattering = s.medium.extinction_per_m[c] * s.medium.single_scattering_albedo[c]
                totals[c] += scattering * integrate.quad(f, low, high, (c,), epsabs=0.0, epsrel=1e-12, limit=200)[0]
    return totals


def blocked(vertices: np.ndarray, faces: np.ndarray, a: np.ndarray, b: np.ndarray) -> bool:
    """Tell whether a triangle crosses the open segment from a to b, by solving for all triangles at once."""
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    system = np.stack([q - p, r - p, np.broadcast_to(a - b, p.shape)], axis=2)
    flat = abs(np.linalg.det(system)) < 1e-14
    system[flat] = np.eye(3)
    x = np.linalg.solve(system, (a - p)[..., None])[..., 0]
    hit = (x[:, 0] >= 0.0) & (x[:, 1] >= 0.0) & (x[:, 0] + x[:, 1] <= 1.0) & (x[:, 2] > 0.0) & (x[:, 2] < 1.0)
    return bool((hit & ~flat).any())


def pictured() -> Any:
    """Return a projector, a bare sun, one through a leaning window, coloured pictures, solids, three colours."""
    random = np.random.default_rng(3)
    glass = random.random((7, 5, 3))
    glass[2:5, 1:4] = 0.0  # a black part
    slide = random.random((12, 17, 3))
    slide[5:9, 6:12] = (0.5, 0.7, 0.2)  # a constant part
    s = scene(
        [
            projector((-9.0, 15.0, 4.0), (0.6, -1.0, -0.3), up=(0.1, 0.2, 1.0), peak=0.9,
                      radiant_intensity_w_per_sr=(900.0, 500.0, 200.0)),
            sun((0.4, -1.0, 0.3), (1.0, 2.0, 3.0)),
            sun((0.1, -0.6, 0.5), (9.0, 5.0, 4.0), window((1.0, 9.0, -14.0), (13.0, 0.5, 1.0), (0.5, 12.0, 2.0), 0.8)),
        ],
        _solids(),
        extinction=(0.02, 0.03, 0.05),
        albedo=(0.9, 0.8, 0.95),
        phase="henyey_greenstein",
        g=0.6,
        width=48,
        height=32,
        camera={"position_m": (3.0, 9.0, -38.0), "look_at_m": (0.5, 8.0, 0.0), "up": (0.15, 1.0, 0.0)},
    )  # fmt: skip
    return with_files(s, {0: slide, 2: glass})


def _solids() -> list[Any]:
    from truth_scenes import box, ground, sphere

    return [
        sphere((-3.0, 8.0, 1.5), 2.0, (0.6, 0.3, 0.2)),
        box((2.0, 0.0, -3.0), (5.0, 6.0, 1.0), (0.3, 0.6, 0.4)),
        ground(0.0, (0.3, 0.2, 0.25)),
    ]


def only(s: Any, which: int) -> Any:
    """Return a scene with one of its lights."""
    one = SimpleNamespace(**vars(s))
    one.lights = [s.lights[which]]
    one.light_map = lambda i: s.light_map(which)
    return one
