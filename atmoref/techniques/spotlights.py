"""From scene to uniforms, once: what a driver program hands the shaders of the light beams.

All in float64 with + - * / and square roots, and transcendentals of ours, so that uniforms have the same bits
everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import atan2, cos, tan
from atmoref.numerics.vectors import Vec3, cross, dot, minus, scaled, unit
from atmoref.optics.phase_functions import PHASE_FUNCTIONS
from atmoref.scene import Box, Ground, Scene, Sphere
from atmoref.stages.camera import Camera
from atmoref.stages.opaque import CONSTANT, PRINTED_G, SATURATING, TRANSMITTANCE, Surface, SurfaceSwitches
from atmoref.stages.ray_cast import OCCLUDER, Solids
from atmoref.stages.shadow_map import ShadowUniforms
from atmoref.stages.spot_light import LINEAR_ANGLE, NO_FALLOFF, SMOOTHSTEP_COSINE, Spot, Switches

if TYPE_CHECKING:
    from atmoref.scene import Spot as SceneSpot
    from atmoref.techniques.beams_parameters import SpotlightParameters

RADIANS = 3.141592653589793 / 180.0
FALLOFFS = {"smoothstep_cosine": SMOOTHSTEP_COSINE, "linear_angle": LINEAR_ANGLE, "none": NO_FALLOFF}
LEAST_W_M = 1e-6
STEP = 1e30  # slope of a falloff of zero width; finite in float32


def _cosine(angle: float) -> float:
    return float(cos(np.float64(angle)))


def _tangent(angle: float) -> float:
    return float(tan(np.float64(angle)))


@dataclass(frozen=True, slots=True)
class LightFrame:
    """A spotlight's own axes: where its pyramid, its maps and its planes come from.

    The texture square holds the outer cone: it reaches tan(outer) at unit depth along `right` and `up`.
    """

    position: Vec3
    right: Vec3
    up: Vec3
    axis: Vec3
    inner: float
    outer: float
    tan_outer: float
    falloff: int
    peak: float

    @staticmethod
    def of(light: SceneSpot) -> LightFrame:
        """Return the frame of a scene's spotlight; its up is the world's, or +z for a vertical light."""
        axis = light.axis()
        reference = (0.0, 1.0, 0.0) if abs(axis[1]) < 0.99 else (0.0, 0.0, 1.0)
        right = unit(cross(axis, reference))
        falloff = FALLOFFS[light.falloff]
        outer = light.outer_half_angle_deg * RADIANS
        inner = outer if falloff == NO_FALLOFF else light.inner_half_angle_deg * RADIANS
        return LightFrame(
            light.position_m, right, unit(cross(right, axis)), axis, inner, outer, _tangent(outer), falloff, light.peak
        )

    def corners(self, base_m: float) -> list[Vec3]:
        """Return apex and base corners of the bounding pyramid, metres."""
        found = [self.position]
        for x, y in ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)):
            ray = scaled(self.corner_ray(x, y), base_m)
            found.append((self.position[0] + ray[0], self.position[1] + ray[1], self.position[2] + ray[2]))
        return found

    def corner_ray(self, x: float, y: float) -> Vec3:
        """Return the direction, at unit depth, towards a corner of the texture square."""
        a, b = x * self.tan_outer, y * self.tan_outer
        return (
            self.axis[0] + a * self.right[0] + b * self.up[0],
            self.axis[1] + a * self.right[1] + b * self.up[1],
            self.axis[2] + a * self.right[2] + b * self.up[2],
        )

    def distribution(self, size: int) -> NDArray[np.float64]:
        """Return I_l at the texel centres of a (size, size) light map, row 0 at v = 0; 0 outside the outer cone."""
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
        """Return the spot's uniforms for this scene's camera."""
        axes = scene.camera.basis()
        offset = minus(scene.camera.position_m, self.position)
        half = 0.5 / self.tan_outer

        def row(vector: Vec3) -> tuple[float, float, float, float]:
            return dot(axes[0], vector), dot(axes[1], vector), dot(axes[2], vector), dot(offset, vector)

        w = row(self.axis)
        u = tuple(half * a + 0.5 * b for a, b in zip(row(self.right), w, strict=True))
        v = tuple(half * a + 0.5 * b for a, b in zip(row(self.up), w, strict=True))
        depth_a, depth_b = window_depth(params.shadow_near_m, far_m)
        span = self.outer - self.inner
        return Spot._make((
            *u, *v, *w, *offset, LEAST_W_M, depth_a, depth_b, depth_b * params.shadow_bias_m, self.peak, self.tan_outer,
            _cosine(self.outer), self._inverse_cosine_span(), self.outer, 1.0 / span if span > 0.0 else STEP,
        ))  # fmt: skip

    def shadow_uniforms(self, size: int, near_m: float, far_m: float) -> ShadowUniforms:
        """Return the uniforms of the light's own camera."""
        depth_a, depth_b = window_depth(near_m, far_m)
        right, up = scaled(self.right, self.tan_outer), scaled(self.up, self.tan_outer)
        return ShadowUniforms(2.0 / size, *right, *up, *self.axis, near_m, depth_a, depth_b)


def window_depth(near_m: float, far_m: float) -> tuple[float, float]:
    """Return (a, b) of the perspective depth a - b / z: 0 at the near plane, 1 at the far plane."""
    b = 1.0 / (1.0 / near_m - 1.0 / far_m)
    return b / near_m, b


def camera_uniforms(scene: Scene, shift: tuple[float, float] = (0.0, 0.0)) -> Camera:
    """Return the camera's uniforms; `shift` moves all pixel centres, in pixels to the right and up."""
    width, height = scene.image.width, scene.image.height
    tan_y = _tangent(0.5 * scene.camera.vertical_fov_deg * RADIANS)
    right, up, forward = scene.camera.basis()
    depth_a, depth_b = window_depth(scene.camera.near_m, scene.camera.far_m)
    start = (shift[0] * (2.0 / width) - 1.0, shift[1] * (2.0 / height) - 1.0)
    return Camera(
        tan_y * (width / height), tan_y, 2.0 / width, 2.0 / height, *right, *up, *forward, *start, depth_a, depth_b
    )


def solids(scene: Scene, origin: Vec3) -> Solids:
    """Return the scene's objects relative to an origin, without triangles; ids are positions in the scene file."""
    spheres: list[tuple[float, ...]] = []
    boxes: list[tuple[float, ...]] = []
    grounds: list[float] = []
    ids: tuple[list[int], list[int], list[int]] = ([], [], [])
    for i, item in enumerate(scene.objects):
        if isinstance(item, Sphere):
            spheres.append((*minus(item.center_m, origin), item.radius_m))
            ids[0].append(i)
        elif isinstance(item, Box):
            boxes.append((*minus(item.min_m, origin), *minus(item.max_m, origin)))
            ids[1].append(i)
        elif isinstance(item, Ground):
            grounds.append(item.height_m - origin[1])
            ids[2].append(i)
    albedo = np.zeros((max(len(scene.objects), 1), 3))
    for i, item in enumerate(scene.objects):
        albedo[i] = item.albedo
    return Solids(
        np.array(spheres, np.float64).reshape(-1, 4), np.array(ids[0], np.int32),
        np.array(boxes, np.float64).reshape(-1, 6), np.array(ids[1], np.int32),
        np.array(grounds, np.float64), np.array(ids[2], np.int32), albedo.ravel(),
        np.zeros((0, 6)), np.zeros((0, 3), np.int32), np.zeros((0, OCCLUDER)), np.zeros(0, np.int32),
    )  # fmt: skip


def source(scene: Scene, light: SceneSpot, params: SpotlightParameters) -> Vec3:
    """Return rho F without the phase function, I_0 sigma_s per channel, W/(sr m) (D-E2)."""
    medium = scene.medium
    omega = medium.single_scattering_albedo if params.albedo_in_source else (1.0, 1.0, 1.0)
    i, s = light.radiant_intensity_w_per_sr, medium.extinction_per_m
    return (i[0] * s[0] * omega[0], i[1] * s[1] * omega[1], i[2] * s[2] * omega[2])


def all_equal(*triples: Vec3) -> bool:
    """Return whether the channels of every triple are equal."""
    return all(t[0] == t[1] == t[2] for t in triples)


def switches(frame: LightFrame, params: SpotlightParameters, grey_light: bool, grey_fog: bool) -> Switches:
    """Return the uniform choices of the lit stages."""
    return Switches(
        int(params.visibility == "exact"), int(params.light_distribution == "exact"), frame.falloff,
        int(grey_light), int(grey_fog), int(params.skip),
    )  # fmt: skip


def surface_uniforms(scene: Scene, light: SceneSpot, params: SpotlightParameters) -> tuple[Surface, SurfaceSwitches]:
    """Return uniforms of the opaque pass for one light."""
    medium = scene.medium
    surface = Surface(
        *medium.extinction_per_m, *medium.ambient_radiance, *light.radiant_intensity_w_per_sr,
        *source(scene, light, params), medium.phase_function.g,
    )  # fmt: skip
    return surface, SurfaceSwitches(
        SATURATING if params.ambient == "saturating" else CONSTANT,
        PRINTED_G if params.surface_fog == "printed" else TRANSMITTANCE,
        PHASE_FUNCTIONS[medium.phase_function.type],
    )
