# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""The opaque scene with fog [Dobashi 2002, eq. 1]: depth and ambient light first, then one additive pass a light."""

from typing import NamedTuple

from numba import int32

from atmoref._jit import device, kernel
from atmoref.buffers.blend import encode, write
from atmoref.lanes import N, exp, gather, lift, maximum, minimum, select, spread_int, sqrt
from atmoref.optics.lane_phase import lane_phase
from atmoref.stages.camera import Camera, camera_ray
from atmoref.stages.ray_cast import FAR
from atmoref.stages.spot_light import Spot, Switches, illuminate, light_ray
from atmoref.stages.target import add_colour, encode_colour, read_colour, write_colour
from atmoref.stages.triangles import nearest_surface

TRANSMITTANCE, PRINTED_G = 0, 1  # D-E1
CONSTANT, SATURATING = 0, 1  # D-E34


class Surface(NamedTuple):
    """Uniforms of the surfaces as the camera sees them through fog."""

    sigma_r: float
    sigma_g: float
    sigma_b: float
    ambient_r: float
    ambient_g: float
    ambient_b: float
    intensity_r: float  # I_0 of the light, W/sr
    intensity_g: float
    intensity_b: float
    source_r: float  # rho F scale, only for the printed fog of D-E1
    source_g: float
    source_b: float
    g: float


class SurfaceSwitches(NamedTuple):
    """Uniform choices (int)."""

    ambient: int
    fog: int
    phase: int


class OpaqueUniforms(NamedTuple):
    """All scalars of both kernels."""

    camera: Camera
    spot: Spot
    surface: Surface
    switches: Switches
    surface_switches: SurfaceSwitches


@kernel
def opaque_base(frame, depth, arith, forms, rules, uniforms, solids, surfaces, window):
    """Replace: nearest depth a - b / z into `depth` (far is 1), the ambient term I_a into `frame`.

    `surfaces` are the triangles as `rasterise` drew them into the same pixels.
    """
    camera, surface = lift(arith, uniforms.camera), lift(arith, uniforms.surface)
    (form, depth_form), (frame_rules, depth_rule) = forms, rules
    size = window.height * window.pitch
    for row in range(window.row0, window.row1):
        for column in range(window.column0, window.column1, N):
            p = row * window.pitch + column
            ray = camera_ray(arith, camera, column, row)
            hit = nearest_surface(arith, solids, surfaces, p, size, ray.dx, ray.dy, ray.dz)
            none = hit.id < spread_int(int32(0))
            z = minimum(maximum(camera.depth_a - camera.depth_b / maximum(hit.t, 1e-6), 0.0), 1.0)
            write(depth, p, encode(depth_form, depth_rule, select(none, 1.0, z)))
            a_r, a_g, a_b = surface.ambient_r + ray.ex * 0.0, surface.ambient_g, surface.ambient_b
            if uniforms.surface_switches.ambient == SATURATING:
                t = minimum(hit.t * ray.length, FAR)
                a_r = a_r * (1.0 - exp(t * surface.sigma_r * -1.0))
                a_g = a_g * (1.0 - exp(t * surface.sigma_g * -1.0))
                a_b = a_b * (1.0 - exp(t * surface.sigma_b * -1.0))
            write_colour(frame, p, size, encode_colour(form, frame_rules, a_r, a_g, a_b))


@device
def _fog(surface, switches, mu, distance, path, t):
    """Return what the air leaves of a surface's radiance: exp(-sigma_t T), or g(T) as eq. (1) prints it (D-E1)."""
    r = exp(t * surface.sigma_r * -1.0)
    g = exp(t * surface.sigma_g * -1.0)
    b = exp(t * surface.sigma_b * -1.0)
    if switches.fog == PRINTED_G:
        peak = lane_phase(switches.phase, surface.g, mu) / (distance * distance)
        r = r * surface.source_r * peak * exp(path * surface.sigma_r * -1.0)
        g = g * surface.source_g * peak * exp(path * surface.sigma_g * -1.0)
        b = b * surface.source_b * peak * exp(path * surface.sigma_b * -1.0)
    return r, g, b


@device
def _albedo(arith, solids, hit, channel):
    """Albedo of the object that was hit; nothing has index 0, which its mask discards."""
    index = maximum(hit.id, spread_int(int32(0))) * int32(3) + int32(channel)
    return lift(arith, gather(solids.albedo, index))


@kernel
def opaque_light(frame, arith, form, rules, uniforms, maps, solids, surfaces, lit_solids, window):
    """Blend ONE, ONE: Lambertian reflection of one light, with shadow, through fog.

    I_b = (albedo / pi) I_0 I_l H cos e^(-sigma_t s) / s^2, of the sun (albedo / pi) E_0 I_l H cos, times
    e^(-sigma_t T).  `solids` are relative to the eye,
    `lit_solids` to the light.
    """
    camera, spot, surface = lift(arith, uniforms.camera), lift(arith, uniforms.spot), lift(arith, uniforms.surface)
    switches = uniforms.switches
    size = window.height * window.pitch
    for row in range(window.row0, window.row1):
        for column in range(window.column0, window.column1, N):
            p = row * window.pitch + column
            ray = camera_ray(arith, camera, column, row)
            hit = nearest_surface(arith, solids, surfaces, p, size, ray.dx, ray.dy, ray.dz)
            z = select(hit.id >= spread_int(int32(0)), hit.t, 1.0)
            lit = illuminate(arith, switches, spot, maps, lit_solids, ray, light_ray(spot, ray), z, hit.id)
            x, y, w = ray.dx * z + spot.from_x, ray.dy * z + spot.from_y, ray.dz * z + spot.from_z
            distance = maximum(sqrt(x * x + y * y + w * w), 1e-6)
            path = distance
            if switches.parallel != 0:  # E_0 arrives as it is (D-E13)
                x, y, w = path * 0.0 + spot.axis_x, path * 0.0 + spot.axis_y, path * 0.0 + spot.axis_z
                distance, path = path * 0.0 + 1.0, path * 0.0
            facing = (hit.nx * x + hit.ny * y + hit.nz * w) / distance * -1.0
            mu = (ray.dx * x + ray.dy * y + ray.dz * w) / (distance * ray.length) * -1.0
            mask = lit.mask & (facing > 0.0) & (hit.id >= spread_int(int32(0)))
            f_r, f_g, f_b = _fog(surface, uniforms.surface_switches, mu, distance, path, z * ray.length)
            e = select(mask, facing / (distance * distance) * 0.3183098861837907, 0.0)
            f_r = f_r * surface.intensity_r * exp(path * surface.sigma_r * -1.0) * _albedo(arith, solids, hit, 0)
            f_g = f_g * surface.intensity_g * exp(path * surface.sigma_g * -1.0) * _albedo(arith, solids, hit, 1)
            f_b = f_b * surface.intensity_b * exp(path * surface.sigma_b * -1.0) * _albedo(arith, solids, hit, 2)
            stored = read_colour(arith, frame, p, size)
            stored = add_colour(form, rules, stored, e * lit.r * f_r, e * lit.g * f_g, e * lit.b * f_b)
            write_colour(frame, p, size, stored)
