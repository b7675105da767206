"""From scene to uniforms, once: what a driver program hands the shaders of the light beams.

All in float64 with + - * / and square roots, and transcendentals of ours, so that uniforms have the same bits
everywhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from atmoref.elementary import tan
from atmoref.numerics.vectors import Vec3, minus
from atmoref.optics.phase_functions import PHASE_FUNCTIONS
from atmoref.scene import Box, Ground, Scene, Sphere, Sun
from atmoref.stages.camera import Camera
from atmoref.stages.opaque import CONSTANT, PRINTED_G, SATURATING, TRANSMITTANCE, Surface, SurfaceSwitches
from atmoref.stages.ray_cast import OCCLUDER, Solids
from atmoref.stages.spot_light import Switches
from atmoref.techniques.light_frames import RADIANS, LightFrame, window_depth

if TYPE_CHECKING:
    from atmoref.scene import Light
    from atmoref.techniques.beams_parameters import SpotlightParameters


def camera_uniforms(scene: Scene, shift: tuple[float, float] = (0.0, 0.0)) -> Camera:
    """Return the camera's uniforms; `shift` moves all pixel centres, in pixels to the right and up."""
    width, height = scene.image.width, scene.image.height
    tan_y = float(tan(np.float64(0.5 * scene.camera.vertical_fov_deg * RADIANS)))
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


def strength(light: Light) -> Vec3:
    """Return I_0 per channel, W/sr, or the sun's irradiance E_0, W/m2."""
    return light.irradiance_w_per_m2 if isinstance(light, Sun) else light.radiant_intensity_w_per_sr


def source(scene: Scene, light: Light, params: SpotlightParameters) -> Vec3:
    """Return rho F without the phase function per channel (D-E2): I_0 sigma_s, W/(sr m), or E_0 sigma_s of the sun."""
    medium = scene.medium
    omega = medium.single_scattering_albedo if params.albedo_in_source else (1.0, 1.0, 1.0)
    i, s = strength(light), medium.extinction_per_m
    return (i[0] * s[0] * omega[0], i[1] * s[1] * omega[1], i[2] * s[2] * omega[2])


def all_equal(*triples: Vec3) -> bool:
    """Return whether the channels of every triple are equal."""
    return all(t[0] == t[1] == t[2] for t in triples)


def switches(frame: LightFrame, params: SpotlightParameters, same_rules: bool, grey_fog: bool) -> Switches:
    """Return the uniform choices of the lit stages; pictures are always read as the textures that they are."""
    picture = frame.picture
    grey = picture is None or bool((picture == picture[..., :1]).all())
    return Switches(
        int(params.visibility == "exact"), int(params.light_distribution == "exact" and picture is None),
        frame.falloff, int(same_rules and grey), int(grey_fog), int(params.skip), int(frame.parallel),
        int(frame.unbounded),
    )  # fmt: skip


def surface_uniforms(scene: Scene, light: Light, params: SpotlightParameters) -> tuple[Surface, SurfaceSwitches]:
    """Return uniforms of the opaque pass for one light."""
    medium = scene.medium
    surface = Surface(
        *medium.extinction_per_m, *medium.ambient_radiance, *strength(light),
        *source(scene, light, params), medium.phase_function.g,
    )  # fmt: skip
    return surface, SurfaceSwitches(
        SATURATING if params.ambient == "saturating" else CONSTANT,
        PRINTED_G if params.surface_fog == "printed" else TRANSMITTANCE,
        PHASE_FUNCTIONS[medium.phase_function.type],
    )
