"""Scenes for the tests of the truths, and a plain-Python picture of them that shares no code with either truth."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import integrate

from atmoref.truth.beams_question import Question, ask


def spot(position=(0.0, 20.0, 0.0), direction=(0.0, -1.0, 0.0), inner=20.0, outer=34.0, **more: Any) -> SimpleNamespace:
    """Return a spotlight as a scene has it."""
    light = {
        "type": "spot",
        "position_m": position,
        "direction": direction,
        "inner_half_angle_deg": inner,
        "outer_half_angle_deg": outer,
        "falloff": "smoothstep_cosine",
        "peak": 1.0,
        "radiant_intensity_w_per_sr": (1000.0, 1000.0, 1000.0),
    }
    return SimpleNamespace(**(light | more))


def sphere(center, radius, albedo=(0.5, 0.5, 0.5)) -> SimpleNamespace:
    """Return a sphere as a scene has it."""
    return SimpleNamespace(type="sphere", center_m=center, radius_m=radius, albedo=albedo)


def box(low, high, albedo=(0.5, 0.5, 0.5)) -> SimpleNamespace:
    """Return a box as a scene has it."""
    return SimpleNamespace(type="box", min_m=low, max_m=high, albedo=albedo)


def ground(height=0.0, albedo=(0.2, 0.2, 0.2)) -> SimpleNamespace:
    """Return a ground as a scene has it."""
    return SimpleNamespace(type="ground", height_m=height, albedo=albedo)


def scene(
    lights, objects=(), *, extinction=(0.02,) * 3, albedo=(0.9,) * 3, phase="isotropic", g=0.0, **more: Any
) -> Any:
    """Return a scene: by default 30 x 45 pixels, the eye at (0, 14, -45) looking along +z."""
    camera = {
        "type": "perspective",
        "position_m": (0.0, 14.0, -45.0),
        "look_at_m": (0.0, 14.0, 0.0),
        "up": (0.0, 1.0, 0.0),
        "vertical_fov_deg": 36.0,
    }
    return SimpleNamespace(
        name="test",
        image=SimpleNamespace(width=more.pop("width", 30), height=more.pop("height", 45)),
        camera=SimpleNamespace(**(camera | more.pop("camera", {}))),
        lights=list(lights),
        objects=list(objects),
        medium=SimpleNamespace(
            extinction_per_m=extinction,
            single_scattering_albedo=albedo,
            phase_function=SimpleNamespace(type=phase, g=g),
            ambient_radiance=more.pop("ambient", (0.0, 0.0, 0.0)),
        ),
        **more,
    )


def everywhere(question: Question) -> Question:
    """Return the question with lights that shine in all directions, which closed forms want."""
    lights = question.lights.copy()
    lights[:, 7] = math.pi
    return question._replace(lights=lights)


def asymmetric() -> Any:
    """Return two coloured lights, a sphere off axis, a box, the ground, three extinctions, and a rolled camera."""
    return scene(
        [
            spot((-9.0, 15.0, 4.0), (0.6, -1.0, -0.3), 8.0, 26.0, radiant_intensity_w_per_sr=(900.0, 500.0, 200.0)),
            spot((11.0, 17.0, -2.0), (-0.7, -1.0, 0.2), 12.0, 30.0, falloff="linear_angle", peak=0.8,
                 radiant_intensity_w_per_sr=(150.0, 400.0, 1100.0)),
        ],
        [
            sphere((-3.0, 8.0, 1.5), 2.0, (0.6, 0.3, 0.2)),
            box((2.0, 0.0, -3.0), (5.0, 6.0, 1.0), (0.3, 0.6, 0.4)),
            ground(0.0, (0.3, 0.2, 0.25)),
        ],
        extinction=(0.02, 0.03, 0.05),
        albedo=(0.9, 0.8, 0.95),
        phase="henyey_greenstein",
        g=0.6,
        width=48,
        height=32,
        camera={"position_m": (3.0, 9.0, -38.0), "look_at_m": (0.5, 8.0, 0.0), "up": (0.15, 1.0, 0.0)},
    )  # fmt: skip


# --- plain Python: visibility by exact interval arithmetic on the segment, one object at a time -------------------


def _inside_interval(thing: Any, a: np.ndarray, d: np.ndarray) -> tuple[float, float]:
    """Return the interval of k in which a + k d lies inside a solid."""
    if thing.type == "sphere":
        w = a - np.array(thing.center_m)
        p = [float(d @ d), 2.0 * float(w @ d), float(w @ w) - thing.radius_m**2]
        root = p[1] ** 2 - 4.0 * p[0] * p[2]
        if root <= 0.0:
            return 1.0, 0.0
        return (-p[1] - math.sqrt(root)) / (2.0 * p[0]), (-p[1] + math.sqrt(root)) / (2.0 * p[0])
    low, high = -math.inf, math.inf
    for i in range(3):
        if d[i] == 0.0:
            if not thing.min_m[i] < a[i] < thing.max_m[i]:
                return 1.0, 0.0
            continue
        k = sorted(((thing.min_m[i] - a[i]) / d[i], (thing.max_m[i] - a[i]) / d[i]))
        low, high = max(low, k[0]), min(high, k[1])
    return low, high


def visible(objects: Any, light: Any, p: np.ndarray) -> bool:
    """Tell whether nothing lies between a light and a point that is not on a surface."""
    a = np.array(light.position_m)
    d = p - a
    for thing in objects:
        if thing.type == "ground":
            if (a[1] > thing.height_m) != (p[1] > thing.height_m):
                return False
        else:
            low, high = _inside_interval(thing, a, d)
            if max(low, 0.0) < min(high, 1.0 - 1e-9):
                return False
    return True


def first_hit(objects: Any, a: np.ndarray, d: np.ndarray) -> tuple[float, Any]:
    """Return distance and object of the first surface along a ray from outside."""
    best, hit = math.inf, None
    for thing in objects:
        if thing.type == "ground":
            t = (thing.height_m - a[1]) / d[1] if d[1] else math.inf
        else:
            low, high = _inside_interval(thing, a, d)
            t = low if low < high else math.inf
        if 0.0 < t < best:
            best, hit = t, thing
    return best, hit


def emitted(light: Any, p: np.ndarray) -> float:
    """Return I_l towards a point."""
    w = p - np.array(light.position_m)
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    cosine = float(w @ axis) / math.sqrt(float(w @ w))
    inner, outer = math.radians(light.inner_half_angle_deg), math.radians(light.outer_half_angle_deg)
    if cosine <= math.cos(outer):
        return 0.0
    if light.falloff == "none" or inner == outer:
        return light.peak
    if light.falloff == "linear_angle":
        angle = math.acos(min(cosine, 1.0))
        return light.peak * min(1.0, (outer - angle) / (outer - inner))
    x = min(1.0, (cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer)))
    return light.peak * x * x * (3.0 - 2.0 * x)


def pixel_ray(s: Any, column: int, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the eye and the unit direction through a pixel centre."""
    eye = np.array(s.camera.position_m)
    forward = np.array(s.camera.look_at_m) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, s.camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    half = math.tan(math.radians(s.camera.vertical_fov_deg) / 2.0)
    x = (2.0 * (column + 0.5) / s.image.width - 1.0) * half * s.image.width / s.image.height
    y = (1.0 - 2.0 * (row + 0.5) / s.image.height) * half
    d = forward + x * right + y * up
    return eye, d / np.linalg.norm(d)


def _changes(state: Any, low: float, high: float, steps: int = 1500) -> list[float]:
    """Return where a piecewise constant function of a number changes, by sampling and bisection."""
    at = np.linspace(low, high, steps + 1)
    values = [state(x) for x in at]
    found = []
    for (x, y), (a, b) in zip(itertools.pairwise(at), itertools.pairwise(values), strict=True):
        if a != b:
            lo, hi = x, y
            while hi - lo > 4e-16 * (abs(lo) + abs(hi)):
                middle = 0.5 * (lo + hi)
                if not lo < middle < hi:
                    break
                lo, hi = (middle, hi) if state(middle) == a else (lo, middle)
            found.append(0.5 * (lo + hi))
    return found


def beam_by_brute_force(s: Any, a: np.ndarray, d: np.ndarray, length: float, channels: Any, p: Any) -> list[float]:
    """Return the beam term of some channels by SciPy in t, with breakpoints found by sampling and bisection.

    ``p`` is the phase function of the scattering cosine. Good to about 1e-9 where the light is far from the ray.
    """
    totals = [0.0 for _ in channels]
    for light in s.lights:
        place = np.array(light.position_m)
        inner = math.cos(math.radians(light.inner_half_angle_deg))
        axis = np.array(light.direction) / np.linalg.norm(light.direction)

        def state(t, light=light, place=place, axis=axis, inner=inner):
            w = a + t * d - place
            plateau = float(w @ axis) >= inner * math.sqrt(float(w @ w))
            return (emitted(light, a + t * d) > 0.0) + 2 * plateau + 4 * visible(s.objects, light, a + t * d)

        def f(t, sigma, light=light, place=place):
            w = a + t * d - place
            r = math.sqrt(float(w @ w))
            mu = -float(w @ d) / r
            return emitted(light, a + t * d) * p(mu) * math.exp(-sigma * (r + t)) / (r * r)

        foot = float((place - a) @ d)
        cuts = sorted([0.0, length, *(t for t in (foot,) if 0.0 < t < length), *_changes(state, 0.0, length)])
        for low, high in itertools.pairwise(cuts):
            middle = 0.5 * (low + high)
            if high > low and visible(s.objects, light, a + middle * d) and emitted(light, a + middle * d) > 0.0:
                for i, channel in enumerate(channels):
                    sigma = s.medium.extinction_per_m[channel]
                    value = integrate.quad(f, low, high, (sigma,), epsabs=0.0, epsrel=1e-12, limit=200)[0]
                    power = light.radiant_intensity_w_per_sr[channel] * s.medium.single_scattering_albedo[channel]
                    totals[i] += power * sigma * value
    return totals


def surface_by_hand(s: Any, a: np.ndarray, d: np.ndarray, channel: int) -> float:
    """Return the light of the first surface along a ray."""
    t, hit = first_hit(s.objects, a, d)
    if hit is None:
        return 0.0
    p = a + t * d
    if hit.type == "sphere":
        n = (p - np.array(hit.center_m)) / hit.radius_m
    elif hit.type == "ground":
        n = np.array([0.0, 1.0 if a[1] > hit.height_m else -1.0, 0.0])
    else:
        gaps = np.array([*(abs(p - np.array(hit.min_m))), *(abs(p - np.array(hit.max_m)))])
        k = int(gaps.argmin())
        n = np.zeros(3)
        n[k % 3] = -1.0 if k < 3 else 1.0
    others = [thing for thing in s.objects if thing is not hit]
    sigma = s.medium.extinction_per_m[channel]
    total = 0.0
    for light in s.lights:
        w = np.array(light.position_m) - p
        r = math.sqrt(float(w @ w))
        cosine = float(w @ n) / r
        if cosine > 0.0 and visible(others, light, p):
            power = light.radiant_intensity_w_per_sr[channel] * emitted(light, p)
            total += hit.albedo[channel] / math.pi * power * cosine * math.exp(-sigma * (r + t)) / (r * r)
    return total


def question(*args: Any, **more: Any) -> Question:
    """Return the question of :func:`scene`."""
    return ask(scene(*args, **more))
