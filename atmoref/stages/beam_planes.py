# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""The main loop of the light beams: sub-planes gathered into f_h, then one main plane f_h c_k q, slab after slab.

Draw d of slab k is its sub-plane j (d = first[k] + k + j), or, after the last of them, its main plane.  A call draws
any range [d0, d1).  f_h lives in its buffer between calls and in registers, in the buffer's own format, within one: so
one call and one call per draw agree to the last bit.
"""

from typing import Any, NamedTuple

from numba import float64, int32

from atmoref._jit import device, kernel
from atmoref.buffers.blend import value
from atmoref.lanes import (
    N,
    any_lane,
    apart,
    convert,
    count_lanes,
    lift,
    load,
    select,
    spread_int,
    store,
)
from atmoref.stages.camera import Camera, camera_ray
from atmoref.stages.main_plane import Slab, SlabSwitches, place, slow_factor
from atmoref.stages.spot_light import Spot, Switches, as_constants, is_usual, light_ray, light_span
from atmoref.stages.sub_plane import add_sub_plane, light_one, light_pair
from atmoref.stages.target import Colour, add_colour, channel_rule, read_colour, write_colour

# columns of the counters, one row of them per image row
SUB_WAVES, SUB_LIT_WAVES, SUB_SAMPLES, MAIN_WAVES, MAIN_LIT_WAVES = 0, 1, 2, 3, 4
COUNTERS = 5
# a draw's block of the probe: depth, coordinates, mask, colour that was drawn, colour that is stored then
PROBE = ("z", "u", "v", "w", "drawn", "r", "g", "b", "stored_r", "stored_g", "stored_b")


class Window(NamedTuple):
    """Pixels to draw (columns start at multiples of the lane width), size and pitch of the buffers, draw range."""

    column0: int
    column1: int
    row0: int
    row1: int
    height: int
    pitch: int
    d0: int
    d1: int
    trace: int  # write the probe


class BeamUniforms(NamedTuple):
    """All scalars of the kernel."""

    camera: Camera
    spot: Spot
    slab: Slab
    switches: Switches
    slab_switches: SlabSwitches


class Pixel(NamedTuple):
    """Lanes of one wave that no draw changes."""

    ray: Any
    light: Any
    place: Any
    span: Any
    surface: Any  # window depth of the opaque scene


class Count(NamedTuple):
    """What was done and what was skipped, in waves of N pixels; samples are pixels that received light."""

    sub: int
    sub_lit: int
    samples: Any  # lanes
    main: int
    main_lit: int


@device
def probe_values(probe, draw, z, u, v, w, mask, drawn, stored):
    """Write one draw's inputs and stored values, as float64 lanes."""
    start = draw * len(PROBE) * N
    one = select(mask, w * 0.0 + 1.0, 0.0)
    values = (w * 0.0 + z, u, v, w, one, drawn.r, drawn.g, drawn.b, stored.r, stored.g, stored.b)
    for i in range(len(values)):
        store(probe, start + i * N, convert(float64, values[i]))


@device
def reached(arith, draws, first, last, pixel):
    """Return the mask of lanes that sub-planes `first` to `last` of one slab can light: in the pyramid, not hidden."""
    in_span = (lift(arith, draws.z[last]) >= pixel.span.near) & (lift(arith, draws.z[first]) <= pixel.span.far)
    return in_span & (lift(arith, draws.depth[first]) < pixel.surface)


@device
def probe_sub_plane(arith, probe, draws, s, k, lit, h):
    """Write one sub-plane's block of the probe."""
    probe_values(probe, s + k, lift(arith, draws.z[s]), lit.u, lit.v, lit.w, lit.mask, Colour(lit.r, lit.g, lit.b), h)


@device
def tally(samples, waves, mask):
    """Return samples and waves, one more each where the mask is set."""
    set_lanes = count_lanes(mask)
    return samples + set_lanes, waves + int(set_lanes > 0)


@device
def gather_slab(arith, form, rules, switches, spot, maps, solids, draws, pixel, k, s0, s1, h, probe, trace, count):
    """Blend sub-planes [s0, s1) of slab k into h."""
    sub_lit, samples = count.sub_lit, count.samples
    air = spread_int(int32(-1))
    done = Count(count.sub + max(s1 - s0, 0), sub_lit, samples, count.main, count.main_lit)
    skip = switches.skip != 0 and trace == 0
    if skip and (s0 >= s1 or not any_lane(reached(arith, draws, s0, s1 - 1, pixel))):
        return h, done
    for s in range(s0, s1 - 1, 2):
        if skip and not any_lane(reached(arith, draws, s, s + 1, pixel)):
            continue
        first, second = light_pair(arith, switches, spot, maps, solids, draws, s, s + 1, pixel, air)
        h = add_sub_plane(arith, form, rules, switches, draws, s, first, h)
        samples, sub_lit = tally(samples, sub_lit, first.mask)
        if trace != 0:
            probe_sub_plane(arith, probe, draws, s, k, first, h)
        h = add_sub_plane(arith, form, rules, switches, draws, s + 1, second, h)
        samples, sub_lit = tally(samples, sub_lit, second.mask)
        if trace != 0:
            probe_sub_plane(arith, probe, draws, s + 1, k, second, h)
    if (s1 - s0) % 2 == 1 and not (skip and not any_lane(reached(arith, draws, s1 - 1, s1 - 1, pixel))):
        lit = light_one(arith, switches, spot, maps, solids, draws, s1 - 1, pixel, air)
        h = add_sub_plane(arith, form, rules, switches, draws, s1 - 1, lit, h)
        samples, sub_lit = tally(samples, sub_lit, lit.mask)
        if trace != 0:
            probe_sub_plane(arith, probe, draws, s1 - 1, k, lit, h)
    return h, Count(done.sub, sub_lit, samples, done.main, done.main_lit)


@device
def gather_any_slab(arith, form, rules, switches, spot, maps, solids, draws, pixel, k, s0, s1, h, probe, trace, count):
    """Call `gather_slab`, in the usual case with constants in place of choices: 8 % of all time (fig4c, no skips)."""
    if trace == 0 and is_usual(arith, switches, maps):
        constants, textures = as_constants(arith, switches, maps)
        return gather_slab(
            arith, form, rules, constants, spot, textures, solids, draws, pixel, k, s0, s1, h, probe, 0, count
        )
    return gather_slab(
        arith, form, rules, switches, spot, maps, solids, draws, pixel, k, s0, s1, h, probe, trace, count
    )


@device
def draw_main_plane(
    arith,
    form,
    rules,
    switches,
    slab,
    slab_switches,
    q,
    mesh,
    quadrature,
    draws,
    pixel,
    k,
    h,
    stored,
    probe,
    trace,
    count,
):
    """Blend ONE, ONE main plane k, f_h c_k q, into the frame's registers."""
    apart(arith)
    frame_rules, fast_rules = rules
    mask = h.r > 0.0
    if switches.grey_light == 0:
        mask = mask | (h.g > 0.0) | (h.b > 0.0)
    mask = mask & (lift(arith, draws.main_depth[k]) < pixel.surface)
    if switches.skip != 0 and trace == 0 and not any_lane(mask):
        return stored, Count(count.sub, count.sub_lit, count.samples, count.main + 1, count.main_lit)
    z = lift(arith, draws.main_z[k])
    r, g, b = slow_factor(
        arith, slab, slab_switches, q, mesh, quadrature, pixel.ray, pixel.place, z, k, draws.main_z.size
    )
    fast = value(form, fast_rules[0], h.r)
    r = select(mask, r * fast, 0.0)
    if switches.grey_light != 0 and slab_switches.grey != 0:  # the same in all channels, up to the frame itself
        g, b = r, r
        stored = add_colour(form, frame_rules, stored, r, r, r)
    else:
        fast_g, fast_b = fast, fast
        if switches.grey_light == 0:
            fast_g = value(form, channel_rule(form, fast_rules, 1), h.g)
            fast_b = value(form, channel_rule(form, fast_rules, 2), h.b)
        g, b = select(mask, g * fast_g, 0.0), select(mask, b * fast_b, 0.0)
        stored = add_colour(form, frame_rules, stored, r, g, b)
    if trace != 0:
        ray, place = pixel.ray, pixel.place
        u = place.along + ray.length * z
        probe_values(probe, draws.first[k + 1] + k, z, u, place.v, ray.length, mask, Colour(r, g, b), stored)
    return stored, Count(count.sub, count.sub_lit, count.samples, count.main + 1, count.main_lit + 1)


@kernel
def beam_planes(
    frame, fast, depth, counters, probe, arith, form, rules, uniforms, maps, q, mesh, quadrature, solids, draws, window
):
    """Draw [window.d0, window.d1) of one light into `frame` and `fast`, both planar (3, height, pitch).

    frame, fast : arrays of the code class `form`; depth : (height, pitch) array of the depth buffer's codes or values;
    counters : (height, COUNTERS) int64; probe : float64; rules : (frame rules, f_h rules), three channels each.
    """
    switches, slab_switches = uniforms.switches, uniforms.slab_switches
    camera, spot, slab = lift(arith, uniforms.camera), lift(arith, uniforms.spot), lift(arith, uniforms.slab)
    size = window.height * window.pitch
    zero = lift(arith, 0.0)
    for row in range(window.row0, window.row1):
        count = Count(0, 0, 0, 0, 0)
        for column in range(window.column0, window.column1, N):
            p = row * window.pitch + column
            ray = camera_ray(arith, camera, column, row)
            light = light_ray(spot, ray)
            pixel = Pixel(
                ray,
                light,
                place(arith, slab, slab_switches, mesh, ray, column, row),
                light_span(switches, spot, light),
                lift(arith, load(depth, p)),
            )
            stored = read_colour(arith, frame, p, size)
            for k in range(draws.main_z.size):
                begin, main = draws.first[k] + k, draws.first[k + 1] + k
                if main < window.d0 or begin >= window.d1:
                    continue
                h = Colour(zero, zero, zero)
                if begin < window.d0:
                    h = read_colour(arith, fast, p, size)
                s0, s1 = max(draws.first[k], window.d0 - k), min(draws.first[k + 1], window.d1 - k)
                h, count = gather_any_slab(
                    arith, form, rules[1], switches, spot, maps, solids, draws, pixel, k, s0, s1, h,
                    probe, window.trace, count,
                )  # fmt: skip
                if main + 1 >= window.d1:
                    write_colour(fast, p, size, h)
                if main < window.d1:
                    stored, count = draw_main_plane(
                        arith, form, rules, switches, slab, slab_switches, q, mesh, quadrature, draws, pixel, k, h,
                        stored, probe, window.trace, count,
                    )  # fmt: skip
            write_colour(frame, p, size, stored)
        totals = (count.sub, count.sub_lit, count.samples, count.main, count.main_lit)
        for i in range(len(totals)):
            counters[row, i] += totals[i]
