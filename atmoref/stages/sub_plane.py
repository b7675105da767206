# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""One sub-plane of a slab: light map times shadow times its share, added to f_h [Dobashi 2002, eq. 10]."""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from atmoref._jit import device
from atmoref.buffers.blend import add
from atmoref.lanes import any_lane, apart, lift
from atmoref.stages.spot_light import Lit, distribution_pair, project_point, received, shine, visibility_pair
from atmoref.stages.target import Colour, channel_rule


class Draws(NamedTuple):
    """The planes of one light.  Slab k owns sub-planes first[k] to first[k + 1] - 1 (int32, n + 1).

    Depths are eye-space metres; window depths are in the units of the depth buffer (codes of an unorm one).  Arrays are
    of the arithmetic's type.
    """

    first: NDArray[Any]
    z: NDArray[Any]  # sub-planes, ascending within a slab
    depth: NDArray[Any]
    share: NDArray[Any]  # weight of a sub-plane in f_h
    main_z: NDArray[Any]  # main planes
    main_depth: NDArray[Any]


@device
def add_sub_plane(arith, form, rules, switches, draws, s, lit, h):
    """Blend ONE, ONE what one sub-plane received, times its share, into h."""
    share = lift(arith, draws.share[s])
    r = add(form, rules[0], h.r, lit.r * share)
    g, b = r, r
    if switches.grey_light == 0:
        g = add(form, channel_rule(form, rules, 1), h.g, lit.g * share)
        b = add(form, channel_rule(form, rules, 2), h.b, lit.b * share)
    return Colour(r, g, b)


@device
def light_one(arith, switches, spot, maps, solids, draws, s, pixel, own):
    """Return what sub-plane s receives (D-E33: none behind a surface)."""
    apart(arith)
    z = lift(arith, draws.z[s])
    point = project_point(arith, switches, spot, pixel.light, z)
    mask = point.mask & (lift(arith, draws.depth[s]) < pixel.surface)
    return shine(arith, switches, spot, maps, solids, pixel.ray, z, own, point, mask)


@device
def light_pair(arith, switches, spot, maps, solids, draws, s, t, pixel, own):
    """Return what sub-planes s and t receive (D-E33: none behind a surface).

    Two at once, stage by stage: each is a chain of dependent steps, so that a processor is half idle with one.
    """
    apart(arith)
    z_s, z_t = lift(arith, draws.z[s]), lift(arith, draws.z[t])
    a = project_point(arith, switches, spot, pixel.light, z_s)
    b = project_point(arith, switches, spot, pixel.light, z_t)
    mask_a = a.mask & (lift(arith, draws.depth[s]) < pixel.surface)
    mask_b = b.mask & (lift(arith, draws.depth[t]) < pixel.surface)
    zero = a.w * 0.0
    if switches.skip != 0 and not any_lane(mask_a | mask_b):
        return Lit(mask_a, zero, zero, zero, a.u, a.v, a.w), Lit(mask_b, zero, zero, zero, b.u, b.v, b.w)
    visible_a, visible_b = visibility_pair(arith, switches, spot, maps, solids, pixel.ray, z_s, z_t, own, a, b)
    mask_a = mask_a & (visible_a > 0.0)
    mask_b = mask_b & (visible_b > 0.0)
    if switches.skip != 0 and not any_lane(mask_a | mask_b):
        return Lit(mask_a, zero, zero, zero, a.u, a.v, a.w), Lit(mask_b, zero, zero, zero, b.u, b.v, b.w)
    colour_a, colour_b = distribution_pair(arith, switches, spot, maps, pixel.ray, z_s, z_t, a, b)
    return received(switches, mask_a, a, colour_a, visible_a), received(switches, mask_b, b, colour_b, visible_b)
