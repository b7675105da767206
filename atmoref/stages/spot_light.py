# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""The fragment stage that every lit pass shares: light map and shadow map projected onto a point of a view ray.

A point of the ray is eye + z d.  The light's texture coordinates are (u, v, w) = rows z + offsets, divided by w, with w
the depth along the light's axis; u and v run from 0 to 1 over the square that holds the outer cone, or the projector's
picture.  Shadow maps store window depth as the hardware does, a - b / w.  The sun's coordinates are not divided, its
depth is linear, and without a window it shines beyond its maps too.  Exact visibility and exact distribution replace
the two maps in the method's own analysis.
"""

from typing import Any, NamedTuple

from atmoref._jit import device
from atmoref.buffers.sampler import (
    as_usual,
    bilinear,
    bilinear3,
    bilinear3_pair,
    bilinear_pair,
    shadow_compare,
    shadow_pair,
    usual_maps,
)
from atmoref.lanes import (
    absolute,
    any_lane,
    apart,
    atan2,
    lift,
    maximum,
    minimum,
    saturate,
    select,
    spread_int,
    sqrt,
    unchanged,
)
from atmoref.stages.ray_cast import Start, occluded, origin, parallel_occluded

BEYOND = 1e9  # metres: farther than anything that could cast a shadow
SLACK = 1e-5  # some 80 roundings in float32
SMOOTHSTEP_COSINE, LINEAR_ANGLE, NO_FALLOFF = 0, 1, 2


class Spot(NamedTuple):
    """Uniforms of one spotlight as one camera sees it (all float; metres, radians)."""

    u_x: float  # (u w) = (ex u_x + ey u_y + u_z) z + u_0, the texture matrix times the camera's
    u_y: float
    u_z: float
    u_0: float
    v_x: float
    v_y: float
    v_z: float
    v_0: float
    w_x: float
    w_y: float
    w_z: float
    w_0: float
    from_x: float  # eye - light, world axes
    from_y: float
    from_z: float
    axis_x: float  # unit vector of travel
    axis_y: float
    axis_z: float
    least_w: float  # w below it is behind the light
    depth_a: float  # window depth a - b / w; of the sun a + b w, bias included
    depth_b: float
    bias: float  # depth_b times the shadow bias in metres: d(window depth) = bias / w^2
    peak: float
    tan_outer: float
    cos_outer: float
    inverse_cos_span: float
    outer: float
    inverse_span: float


class Switches(NamedTuple):
    """What a scene asks for, uniform over a pass (int: 0 or 1, except `falloff`)."""

    exact_visibility: int
    exact_distribution: int
    falloff: int
    grey_light: int  # the light map's channels are equal
    grey_fog: int  # extinction and rho F of the channels are equal
    skip: int
    parallel: int  # the sun
    unbounded: int  # without a window: lit beyond the map, on both sides of its plane


class Maps(NamedTuple):
    """Textures of one spotlight."""

    shadow: Any  # Texture, of intervals TextureBounds
    light: Any


@device
def is_usual(arith, switches, maps):
    """Return whether the two maps of a spotlight or projector, read in the usual way, make up all of its light."""
    exact = switches.exact_visibility != 0 or switches.exact_distribution != 0
    sun = switches.parallel != 0 or switches.unbounded != 0
    return not exact and not sun and usual_maps(arith, maps.shadow, maps.light)


@device
def as_constants(arith, switches, maps):
    """Return switches and maps of `is_usual`, known to the compiler."""
    own = Switches(0, 0, switches.falloff, switches.grey_light, switches.grey_fog, switches.skip, 0, 0)
    return own, Maps(as_usual(arith, maps.shadow), as_usual(arith, maps.light))


class LightRay(NamedTuple):
    """Texture coordinates times w per unit of z, for one lane of rays."""

    u: Any
    v: Any
    w: Any


class Span(NamedTuple):
    """Depths between which a ray can be inside the light's pyramid, a little too wide; empty where near > far."""

    near: Any
    far: Any


class Lit(NamedTuple):
    """What a point receives: mask, colour I_l H per channel, and the coordinates it was read at."""

    mask: Any
    r: Any
    g: Any
    b: Any
    u: Any
    v: Any
    w: Any


@device
def light_ray(spot, ray):
    """Return rows of the light's projection that belong to these rays; spot is lifted."""
    return LightRay(
        ray.ex * spot.u_x + ray.ey * spot.u_y + spot.u_z,
        ray.ex * spot.v_x + ray.ey * spot.v_y + spot.v_z,
        ray.ex * spot.w_x + ray.ey * spot.w_y + spot.w_z,
    )


@device
def _cut(span, slope, start):
    """Return the part of a span where slope z + start >= 0."""
    root = start / select((slope < 1e-30) & (slope > -1e-30), 1e-30, slope) * -1.0
    near = select(slope > 0.0, maximum(span.near, root), span.near)
    far = select(slope < 0.0, minimum(span.far, root), span.far)
    return Span(near, select((slope == 0.0) & (start < 0.0), -1.0, far))


@device
def light_span(switches, spot, light):
    """Return depths z > 0 at which rays can be in the light's volume."""
    if switches.unbounded != 0:
        return Span(light.w * 0.0, light.w * 0.0 + 1e30)
    if switches.parallel != 0:
        return prism_span(spot, light)
    return pyramid_span(spot, light)


@device
def prism_span(spot, light):
    """Return `pyramid_span` of parallel light: w >= 0 and 0 <= u, v <= 1, which are linear in z by themselves."""
    bend, base = absolute(light.w) * SLACK, absolute(spot.w_0) * SLACK
    span = Span(light.w * 0.0, light.w * 0.0 + 1e30)
    span = _cut(span, light.w + bend, spot.w_0 + base)
    bend, base = absolute(light.u) * SLACK, (absolute(spot.u_0) + 1.0) * SLACK
    span = _cut(span, light.u + bend, spot.u_0 + base)
    span = _cut(span, bend - light.u, 1.0 - spot.u_0 + base)
    bend, base = absolute(light.v) * SLACK, (absolute(spot.v_0) + 1.0) * SLACK
    span = _cut(span, light.v + bend, spot.v_0 + base)
    return _cut(span, bend - light.v, 1.0 - spot.v_0 + base)


@device
def pyramid_span(spot, light):
    """Return depths z > 0 at which w >= 0 and 0 <= u, v <= 1 can hold: five linear conditions.

    Each is loosened by SLACK of the size of its terms, which covers all roundings of the test itself: what lies outside
    the span fails that test for certain, so skipping it is exact.
    """
    loose, bend = SLACK, absolute(light.w) * SLACK
    base = absolute(spot.w_0) * SLACK
    span = Span(light.w * 0.0, light.w * 0.0 + 1e30)
    span = _cut(span, light.w + bend, spot.w_0 + base)
    u_bend, u_base = absolute(light.u) * loose, absolute(spot.u_0) * loose
    span = _cut(span, light.u + u_bend, spot.u_0 + u_base)
    span = _cut(span, light.w - light.u + (bend + u_bend), spot.w_0 - spot.u_0 + (base + u_base))
    v_bend, v_base = absolute(light.v) * loose, absolute(spot.v_0) * loose
    span = _cut(span, light.v + v_bend, spot.v_0 + v_base)
    return _cut(span, light.w - light.v + (bend + v_bend), spot.w_0 - spot.v_0 + (base + v_base))


@device
def _falloff(switches, spot, u, v, w, distance):
    """Return I_l(direction) in closed form (D-E14: at most 1)."""
    if switches.falloff == LINEAR_ANGLE:
        x, y = (u * 2.0 - 1.0) * spot.tan_outer, (v * 2.0 - 1.0) * spot.tan_outer
        angle = atan2(sqrt(x * x + y * y), x * 0.0 + 1.0)
        part = minimum(maximum((spot.outer - angle) * spot.inverse_span, 0.0), 1.0)
        return spot.peak * part
    part = minimum(maximum((w / distance - spot.cos_outer) * spot.inverse_cos_span, 0.0), 1.0)
    return spot.peak * (part * part * (3.0 - part * 2.0))


class Point(NamedTuple):
    """Lanes of points of view rays in the light's projection: mask, clamped coordinates, coordinates, w and 1 / w."""

    mask: Any  # in front of the light and on its texture square
    us: Any
    vs: Any
    u: Any
    v: Any
    w: Any
    inverse: Any


@device
def project_point(arith, switches, spot, light, z):
    """Return the points eye + z d in the light's projection."""
    apart(arith)
    w = light.w * z + spot.w_0
    u, v = light.u * z + spot.u_0, light.v * z + spot.v_0
    inverse = lift(arith, 1.0)
    if switches.parallel == 0:
        inverse = inverse / maximum(w, spot.least_w)
        u, v = u * inverse, v * inverse
    us, vs = saturate(u), saturate(v)
    mask = (w >= spot.least_w) & unchanged(u, us) & unchanged(v, vs)
    if switches.unbounded != 0:
        mask = unchanged(w, w)
    return Point(mask, us, vs, u, v, w, inverse)


@device
def depth_reference(switches, spot, point):
    """Return the window depth that the shadow map is compared with."""
    if switches.parallel != 0:
        return point.w * spot.depth_b + spot.depth_a
    return spot.depth_a - (spot.depth_b + spot.bias * point.inverse) * point.inverse


@device
def visibility(arith, switches, spot, maps, solids, ray, z, own, point):
    """Return H: 0 or 1, or a fraction from percentage-closer filtering."""
    apart(arith)
    if switches.exact_visibility != 0:
        dx, dy, dz = ray.dx * z + spot.from_x, ray.dy * z + spot.from_y, ray.dz * z + spot.from_z
        if switches.parallel != 0:
            start = Start(dx, dy, dz)
            back = point.w
            if switches.unbounded != 0:
                back = point.w * 0.0 + BEYOND
            to_x, to_y, to_z = back * (spot.axis_x * -1.0), back * (spot.axis_y * -1.0), back * (spot.axis_z * -1.0)
            x, y = point.u * 2.0 - 1.0, point.v * 2.0 - 1.0
            return _unless(
                parallel_occluded(arith, solids, start, to_x, to_y, to_z, x, y, point.w, point.w - back, own), back
            )
        return _unless(occluded(arith, solids, origin(arith), dx, dy, dz, own), dx)
    visible = shadow_compare(arith, maps.shadow, point.us, point.vs, depth_reference(switches, spot, point))
    return beyond_map(arith, switches, spot, solids, ray, z, own, point, visible)


@device
def _unless(blocked, like):
    """Return 0 where blocked, else 1."""
    return select(blocked, like * 0.0, 1.0)


@device
def beyond_map(arith, switches, spot, solids, ray, z, own, point, visible):
    """Return the visibility where the map of a sun without a window ends: grounds alone cast a shadow there.

    They have no end, so they may also lie before the map: what is on a ground's other side is dark everywhere.
    """
    if switches.unbounded != 0:
        visible = select(unchanged(point.u, point.us) & unchanged(point.v, point.vs), visible, 1.0)
        for i in range(solids.grounds.shape[0]):
            above = (ray.dy * z + spot.from_y) - lift(arith, solids.grounds[i])
            behind = (above * spot.axis_y > 0.0) & (own != spread_int(solids.ground_ids[i]))
            visible = select(behind, visible * 0.0, visible)
    return visible


@device
def distribution(arith, switches, spot, maps, ray, z, point):
    """Return I_l per channel, from the light map or in closed form."""
    apart(arith)
    if switches.exact_distribution != 0:
        dx, dy, dz = ray.dx * z + spot.from_x, ray.dy * z + spot.from_y, ray.dz * z + spot.from_z
        distance = sqrt(dx * dx + dy * dy + dz * dz)
        r = _falloff(switches, spot, point.us, point.vs, point.w, distance)
        return r, r, r
    if switches.grey_light != 0:
        r = bilinear(arith, maps.light, 0, point.us, point.vs)
        return r, r, r
    return bilinear3(arith, maps.light, point.us, point.vs)


@device
def visibility_pair(arith, switches, spot, maps, solids, ray, z_a, z_b, own, a, b):
    """Return `visibility` of two points."""
    if switches.exact_visibility != 0:
        first = visibility(arith, switches, spot, maps, solids, ray, z_a, own, a)
        return first, visibility(arith, switches, spot, maps, solids, ray, z_b, own, b)
    reference_a, reference_b = depth_reference(switches, spot, a), depth_reference(switches, spot, b)
    first, second = shadow_pair(arith, maps.shadow, (a.us, a.vs), (b.us, b.vs), reference_a, reference_b)
    if switches.unbounded != 0:
        first = beyond_map(arith, switches, spot, solids, ray, z_a, own, a, first)
        second = beyond_map(arith, switches, spot, solids, ray, z_b, own, b, second)
    return first, second


@device
def distribution_pair(arith, switches, spot, maps, ray, z_a, z_b, a, b):
    """Return `distribution` at two points."""
    if switches.exact_distribution != 0:
        first = distribution(arith, switches, spot, maps, ray, z_a, a)
        return first, distribution(arith, switches, spot, maps, ray, z_b, b)
    if switches.grey_light != 0:
        first, second = bilinear_pair(arith, maps.light, 0, (a.us, a.vs), (b.us, b.vs))
        return (first, first, first), (second, second, second)
    return bilinear3_pair(arith, maps.light, (a.us, a.vs), (b.us, b.vs))


@device
def received(switches, mask, point, colour, visible):
    """Return what points receive, I_l H within the mask."""
    zero = point.w * 0.0
    r = select(mask, colour[0] * visible, zero)
    g, b = r, r
    if switches.grey_light == 0:
        g, b = select(mask, colour[1] * visible, zero), select(mask, colour[2] * visible, zero)
    return Lit(mask, r, g, b, point.u, point.v, point.w)


@device
def shine(arith, switches, spot, maps, solids, ray, z, own, point, mask):
    """Return I_l H at eye + z d, of which `point` is the projection, within the mask."""
    apart(arith)
    zero = point.w * 0.0
    if switches.skip != 0 and not any_lane(mask):
        return Lit(mask, zero, zero, zero, point.u, point.v, point.w)
    visible = visibility(arith, switches, spot, maps, solids, ray, z, own, point)
    mask = mask & (visible > 0.0)
    if switches.skip != 0 and not any_lane(mask):
        return Lit(mask, zero, zero, zero, point.u, point.v, point.w)
    return received(switches, mask, point, distribution(arith, switches, spot, maps, ray, z, point), visible)


@device
def illuminate(arith, switches, spot, maps, solids, ray, light, z, own):
    """Return I_l H at eye + z d.

    `own` is the object that a surface point belongs to (it cannot shadow itself), -1 in the air.
    """
    point = project_point(arith, switches, spot, light, z)
    return shine(arith, switches, spot, maps, solids, ray, z, own, point, point.mask)
