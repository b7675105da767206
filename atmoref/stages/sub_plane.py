# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""One sub-plane of a slab: light map times shadow times its share, added to f_h [Dobashi 2002, eq. 10]."""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from atmoref._jit import device
from atmoref.buffers.blend import add
from atmoref.lanes import any_lane, lift, select
from atmoref.stages.spot_light import illuminate
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
def draw_sub_plane(arith, form, rules, switches, spot, maps, solids, draws, s, pixel, own, h):
    """Blend ONE, ONE sub-plane s into h; returns h and what the point received (D-E33: none behind a surface)."""
    lit = illuminate(arith, switches, spot, maps, solids, pixel.ray, pixel.light, lift(arith, draws.z[s]), own)
    mask = lit.mask & (lift(arith, draws.depth[s]) < pixel.surface)
    if switches.skip != 0 and not any_lane(mask):
        return h, mask, lit
    share = select(mask, lift(arith, draws.share[s]), 0.0)
    r = add(form, rules[0], h.r, lit.r * share)
    g, b = r, r
    if switches.grey_light == 0:
        g = add(form, channel_rule(form, rules, 1), h.g, lit.g * share)
        b = add(form, channel_rule(form, rules, 2), h.b, lit.b * share)
    return Colour(r, g, b), mask, lit
