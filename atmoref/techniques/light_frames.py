"""A light's own axes: where its bounding volume, its maps and its uniforms come from.

Float64 with + - * / and square roots, and transcendentals of ours, so that uniforms have the same bits everywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import atan2, cos, tan
from atmoref.numerics.vectors import Vec3, cross, dot, length, minus, scaled, unit
from atmoref.scene import Projector, Scene, Sun
from atmoref.stages.shadow_map import ShadowUniforms
from atmoref.stages.spot_light import LINEAR_ANGLE, NO_FALLOFF, SMOOTHSTEP_COSINE, Spot

if TYPE_CHECKING:
    from atmoref.scene import Light
    from atmoref.scene import Spot as SceneSpot
    from atmoref.techniques.beams_parameters import SpotlightParameters

RADIANS = 3.141592653589793 / 180.0
FALLOFFS = {"smoothstep_cosine": SMOOTHSTEP_COSINE, "linear_angle": LINEAR_ANGLE, "none": NO_FALLOFF}
LEAST_W_M = 1e-6
STEP = 1e30  # slope of a falloff of zero width; finite in float32
SQUARE = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))
MARGIN = 1.01  # of the map of a sun without a window, around what casts shadows


def _cosine(angle: float) -> float:
    return float(cos(np.float64(angle)))


def _tangent(angle: float) -> float:
    return float(tan(np.float64(angle)))


def plus(*vectors: Vec3) -> Vec3:
    """Return the sum of vectors."""
    x, y, z = 0.0, 0.0, 0.0
    for v in vectors:
        x, y, z = x + v[0], y + v[1], z + v[2]
    return x, y, z


def window_depth(near_m: float, far_m: float) -> tuple[float, float]:
    """Return (a, b) of the perspective depth a - b / z: 0 at the near plane, 1 at the far plane."""
    b = 1.0 / (1.0 / near_m - 1.0 / far_m)
    return b / near_m, b


@dataclass(frozen=True, slots=True)
class PointFrame:
    """A spotlight or projector.

    The texture rectangle reaches tan_outer along `right` and tan_up along `up` at unit depth; a spot's square holds its
    outer cone.
    """

    position: Vec3
    right: Vec3
    up: Vec3
    axis: Vec3
    inner: float
    outer: float
    tan_outer: float
    tan_up: float
    falloff: int
    peak: float
    picture: NDArray[np.float64] | None = None  # (H, W, 3), row 0 at v = 0

    parallel = False
    unbounded = False

    @staticmethod
    def of_spot(light: SceneSpot) -> PointFrame:
        """Return the frame of a spotlight; its up is the world's, or +z for a vertical light."""
        axis = light.axis()
        reference = (0.0, 1.0, 0.0) if abs(axis[1]) < 0.99 else (0.0, 0.0, 1.0)
        right = unit(cross(axis, reference))
        falloff = FALLOFFS[light.falloff]
        outer = light.outer_half_angle_deg * RADIANS
        inner = outer if falloff == NO_FALLOFF else light.inner_half_angle_deg * RADIANS
        tangent = _tangent(outer)
        return PointFrame(
            light.position_m, right, unit(cross(right, axis)), axis, inner, outer, tangent, tangent, falloff, light.peak
        )

    @staticmethod
    def of_projector(light: Projector, picture: NDArray[np.float64]) -> PointFrame:
        """Return the frame of a projector, whose pixels are square."""
        axis = light.axis()
        right = unit(cross(axis, light.up))
        angle = light.horizontal_half_angle_deg * RADIANS
        tangent = _tangent(angle)
        rows, columns = picture.shape[:2]
        return PointFrame(
            light.position_m, right, unit(cross(right, axis)), axis, angle, angle, tangent, tangent * rows / columns,
            NO_FALLOFF, light.peak, picture[::-1] * light.peak,
        )  # fmt: skip

    def corner_ray(self, x: float, y: float) -> Vec3:
        """Return the direction, at unit depth, towards a corner of the texture rectangle."""
        return plus(self.axis, scaled(self.right, x * self.tan_outer), scaled(self.up, y * self.tan_up))

    def edges(self) -> list[tuple[Vec3, Vec3]]:
        """Return the edges along the light: where they start, and their directions at unit depth."""
        return [(self.position, self.corner_ray(x, y)) for x, y in SQUARE]

    def corners(self, base_m: float) -> list[Vec3]:
        """Return apex and base corners of the bounding pyramid, metres."""
        return [self.position, *(plus(start, scaled(ray, base_m)) for start, ray in self.edges())]

    def reach(self, base_m: float) -> float:
        """Return the distance from the light to the farthest corner of the pyramid, metres."""
        across, upward = base_m * self.tan_outer, base_m * self.tan_up
        return float(np.sqrt(base_m * base_m + (across * across + upward * upward)))

    def light_map(self, size: int) -> NDArray[np.float64]:
        """Return I_l at texel centres, row 0 at v = 0: (size, size) of a spot, (H, W, 3) of a picture."""
        if self.picture is not None:
            return self.picture
        x = (2.0 * (np.arange(size) + 0.5) / size - 1.0) * self.tan_outer
        square = x[None, :] * x[None, :] + x[:, None] * x[:, None]
        if self.falloff == LINEAR_ANGLE:
            angle = atan2(np.sqrt(square), np.ones_like(square))
            span = self.outer - self.inner
            part = (self.outer - angle) * (1.0 / span if span > 0.0 else STEP)
            return np.asarray(self.peak * np.clip(part, 0.0, 1.0))
        part = np.clip((1.0 / np.sqrt(1.0 + square) - _cosine(self.outer)) * self._inverse_cosine_span(), 0.0, 1.0)
        return np.asarray(self.peak * (part * part * (3.0 - 2.0 * part)))

    def _inverse_cosine_span(self) -> float:
        span = _cosine(self.inner) - _cosine(self.outer)
        return 1.0 / span if span > 0.0 else STEP

    def uniforms(self, scene: Scene, params: SpotlightParameters, far_m: float) -> Spot:
        """Return the light's uniforms for this scene's camera."""
        axes = scene.camera.basis()
        offset = minus(scene.camera.position_m, self.position)

        def row(vector: Vec3) -> tuple[float, float, float, float]:
            return dot(axes[0], vector), dot(axes[1], vector), dot(axes[2], vector), dot(offset, vector)

        w = row(self.axis)
        u = tuple(0.5 / self.tan_outer * a + 0.5 * b for a, b in zip(row(self.right), w, strict=True))
        v = tuple(0.5 / self.tan_up * a + 0.5 * b for a, b in zip(row(self.up), w, strict=True))
        depth_a, depth_b = window_depth(params.shadow_near_m, far_m)
        span = self.outer - self.inner
        return Spot._make((
            *u, *v, *w, *offset, *self.axis, LEAST_W_M, depth_a, depth_b, depth_b * params.shadow_bias_m, self.peak,
            self.tan_outer, _cosine(self.outer), self._inverse_cosine_span(), self.outer,
            1.0 / span if span > 0.0 else STEP,
        ))  # fmt: skip

    def shadow_uniforms(self, size: int, near_m: float, far_m: float) -> ShadowUniforms:
        """Return the uniforms of the light's own camera."""
        depth_a, depth_b = window_depth(near_m, far_m)
        right, up = scaled(self.right, self.tan_outer), scaled(self.up, self.tan_up)
        return ShadowUniforms(2.0 / size, *right, *up, *self.axis, near_m, depth_a, depth_b)


@dataclass(frozen=True, slots=True)
class ParallelFrame:
    """The sun: P = position + x right + y up + w axis, with x and y from -1 to 1 over the window or the shadow map.

    `right` and `up` are half the window, so they may be skew; w is the way that light has gone since the window.
    """

    position: Vec3
    right: Vec3
    up: Vec3
    axis: Vec3
    peak: float
    picture: NDArray[np.float64]  # (H, W, 3), row 0 at v = 0
    unbounded: bool  # no window: light also beyond the map, and on both sides of its plane

    parallel = True
    falloff = NO_FALLOFF

    @staticmethod
    def of(scene: Scene, light: Sun, picture: NDArray[np.float64] | None) -> ParallelFrame:
        """Return the frame of the sun."""
        axis = light.axis()
        window = light.window
        if window is None:
            position, right, up = _around(scene, axis)
            return ParallelFrame(position, right, up, axis, 1.0, np.ones((1, 1, 3)), unbounded=True)
        texels = np.ones((1, 1, 3)) if picture is None else picture[::-1]
        right, up = scaled(window.across_m, 0.5), scaled(window.up_m, 0.5)
        return ParallelFrame(
            window.center_m, right, up, axis, window.peak, texels * window.peak, unbounded=False
        )  # fmt: skip

    def edges(self) -> list[tuple[Vec3, Vec3]]:
        """Return the edges along the light: where they start, and their directions."""
        return [
            (plus(self.position, scaled(self.right, x), scaled(self.up, y)), self.axis) for x, y in SQUARE
        ]  # fmt: skip

    def corners(self, base_m: float) -> list[Vec3]:
        """Return the corners of the window and of the prism's other end, metres."""
        edges = self.edges()
        return [start for start, _ in edges] + [plus(start, scaled(ray, base_m)) for start, ray in edges]

    def light_map(self, size: int) -> NDArray[np.float64]:
        """Return I_l at texel centres, (H, W, 3), row 0 at v = 0."""
        return self.picture

    def rows(self) -> tuple[Vec3, Vec3, Vec3]:
        """Return the vectors whose products with P - position are x, y and w."""
        volume = dot(self.right, cross(self.up, self.axis))
        return (
            scaled(cross(self.up, self.axis), 1.0 / volume), scaled(cross(self.axis, self.right), 1.0 / volume),
            scaled(cross(self.right, self.up), 1.0 / volume),
        )  # fmt: skip

    def uniforms(self, scene: Scene, params: SpotlightParameters, far_m: float) -> Spot:
        """Return the light's uniforms for this scene's camera; u and v are not divided by w."""
        axes = scene.camera.basis()
        offset = minus(scene.camera.position_m, self.position)

        def row(vector: Vec3, scale: float, start: float) -> tuple[float, ...]:
            return (*(scale * dot(a, vector) for a in axes), scale * dot(offset, vector) + start)

        x, y, w = self.rows()
        depth_b = 1.0 / far_m
        return Spot._make((
            *row(x, 0.5, 0.5), *row(y, 0.5, 0.5), *row(w, 1.0, 0.0), *offset, *self.axis, 0.0,
            -params.shadow_bias_m * depth_b, depth_b, 0.0, self.peak, 1.0, 0.0, 0.0, 0.0, 0.0,
        ))  # fmt: skip

    def shadow_uniforms(self, size: int, near_m: float, far_m: float) -> ShadowUniforms:
        """Return the uniforms of the light's own camera: depth w / far."""
        return ShadowUniforms(2.0 / size, *self.right, *self.up, *self.axis, 0.0, 0.0, 1.0 / far_m)


LightFrame = PointFrame | ParallelFrame


def light_frame(scene: Scene, index: int) -> LightFrame:
    """Return the frame of one light."""
    light: Light = scene.lights[index]
    picture = scene.light_map(index)
    if isinstance(light, Sun):
        return ParallelFrame.of(scene, light, picture)
    if isinstance(light, Projector):
        assert picture is not None
        return PointFrame.of_projector(light, picture)
    return PointFrame.of_spot(light)


def span_of_objects(scene: Scene, origin: Vec3, axis: Vec3) -> tuple[float, float]:
    """Return the least and greatest coordinate along an axis, from an origin, of all that has an end.

    (inf, -inf) where nothing has.
    """
    least, most = math.inf, -math.inf
    for i, item in enumerate(scene.objects):
        if (part := scene.triangles(i)) is not None:
            x, y, z = (part.vertices[:, c] - origin[c] for c in range(3))
            at = x * axis[0] + y * axis[1] + z * axis[2]
            low, high = float(at.min()), float(at.max())
        elif item.type == "sphere":
            middle, r = dot(minus(item.center_m, origin), axis), item.radius_m * length(axis)
            low, high = middle - r, middle + r
        elif item.type == "box":
            ends = list(zip(minus(item.min_m, origin), minus(item.max_m, origin), axis, strict=True))
            low, high = sum(min(a * n, b * n) for a, b, n in ends), sum(max(a * n, b * n) for a, b, n in ends)
        else:
            continue
        least, most = min(least, low), max(most, high)
    return least, most


def _around(scene: Scene, axis: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """Return origin, right and up of a rectangle across the light, before and around all that casts a shadow."""
    reference = (0.0, 1.0, 0.0) if abs(axis[1]) < 0.99 else (0.0, 0.0, 1.0)
    right = unit(cross(axis, reference))
    up = unit(cross(right, axis))
    origin = scene.camera.position_m
    (x0, x1), (y0, y1), (w0, w1) = (span_of_objects(scene, origin, a) for a in (right, up, axis))
    if not x0 < x1:
        return origin, right, up
    start = w0 - (MARGIN - 1.0) * max(w1 - w0, 1.0)
    place = plus(origin, scaled(right, 0.5 * (x0 + x1)), scaled(up, 0.5 * (y0 + y1)), scaled(axis, start))
    return place, scaled(right, 0.5 * MARGIN * (x1 - x0)), scaled(up, 0.5 * MARGIN * max(y1 - y0, 1e-3))


def shadow_far(scene: Scene, frame: LightFrame, base_m: float) -> float:
    """Return the far plane of a light's shadow map: behind the volume's base and every bounded object's far side."""
    w = frame.rows()[2] if isinstance(frame, ParallelFrame) else frame.axis
    return max(base_m * 1.05, span_of_objects(scene, frame.position, w)[1])
