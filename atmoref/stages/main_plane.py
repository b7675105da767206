# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Fragment stage of a main plane: c_k q(u, v), the slowly varying factor f_l of one slab [Dobashi 2002, eq. 9].

u, v and c_k come from the vertices of the plane's mesh, as published (D-E15), or from the pixel's own ray.
"""

from typing import Any, NamedTuple

from numba import int32
from numpy.typing import NDArray

from atmoref._jit import device
from atmoref.buffers.sampler import bilinear
from atmoref.lanes import (
    any_lane,
    apart,
    barycentric,
    exp,
    first_lane,
    floor,
    fma,
    gather,
    lift,
    maximum,
    minimum,
    nominal,
    pixels,
    select,
    spread_int,
    sqrt,
    to_int,
)
from atmoref.optics.lane_phase import lane_phase
from atmoref.tables.q import q_integral

TIE = 1e-5  # of a cell: centres this near a diagonal lie on it
DT_PAPER, DT_COSINE, DT_EXACT = 0, 1, 2  # D-E6


class Slab(NamedTuple):
    """Uniforms of the fog between two main planes (float; metres)."""

    dt: float
    sigma_r: float  # extinction, 1/m
    sigma_g: float
    sigma_b: float
    source_r: float  # rho F scale I_0 sigma_s, W/(sr m) (D-E2)
    source_g: float
    source_b: float
    g: float
    cosine: float  # +1, or -1 for the wrong scattering angle of D-E3
    scale_u: float  # q table: texture coordinate = scale x + offset
    offset_u: float
    scale_v: float
    offset_v: float
    range: float  # what 1 in the table means
    rest: float  # what 1 in the table of the rest means; 0 without one
    from_x: float  # eye - light, world axes
    from_y: float
    from_z: float
    cross_ax: float  # (eye - light) x direction = ex a + ey b + c: distance of ray and light without cancellation
    cross_ay: float
    cross_az: float
    cross_bx: float
    cross_by: float
    cross_bz: float
    cross_cx: float
    cross_cy: float
    cross_cz: float
    cells_x: float  # mesh cells per image pixel
    cells_y: float
    axis_x: float  # unit vector of the light's travel
    axis_y: float
    axis_z: float
    cell_x: float  # mesh coordinate of the left and lower edge: 0, or an interleaved image's
    cell_y: float


class SlabSwitches(NamedTuple):
    """Uniform choices of the slab stages (int)."""

    phase: int
    dt_mode: int
    exact_q: int
    rest: int  # a second table holds what does not fit
    vertex: int  # coordinates from the mesh
    mesh_x: int
    mesh_y: int
    grey: int
    parallel: int  # the sun: f_l in closed form
    screen: int  # vertex attributes are planes over the screen (Device.interpolation)


class QMaps(NamedTuple):
    """The q table, and the table of what exceeds its range (one texel where there is none)."""

    main: Any  # Texture, of intervals TextureBounds
    rest: Any


class Grid(NamedTuple):
    """Where the vertices of a mesh stand on the screen, pixels (float32 values): its columns and its rows."""

    x: NDArray[Any]
    y: NDArray[Any]


class Mesh(NamedTuple):
    """Vertex attributes, flat: u [plane, vertex], v [vertex], c_k [channel, plane, vertex]; dummies without a mesh."""

    u: NDArray[Any]
    v: NDArray[Any]
    c: NDArray[Any]
    grid: Grid


class Setup(NamedTuple):
    """Lanes: the triangle a pixel lies in, as `Device.interpolation = "screen"` sets it up.

    Slopes come from the edges e = a - b and f = c - a, both over their cross product; the value at the centre of pixel
    (0, 0) from that of a at (x, y); then two fused steps, columns and rows.
    """

    ex: Any
    ey: Any
    fx: Any
    fy: Any
    x: Any
    y: Any
    column: Any
    row: Any


class Corner(NamedTuple):
    """Lanes: the triangle a pixel lies in, as vertex indices and barycentric weights.

    Where a wave lies in one or two cells of a mesh row (`narrow`), six vertices from `start` on serve all its lanes.
    """

    a: Any
    b: Any
    c: Any
    wb: Any
    wc: Any
    lower: Any  # mask: in the lower left triangle of its cell
    second: Any  # mask: in the second of two cells
    narrow: bool
    start: int
    row: int  # vertices in a row
    setup: Setup


class Place(NamedTuple):
    """Lanes that do not change from plane to plane: distance of the ray from the light, u at z = 0, mesh corner.

    Of the sun: f_l / c_k per channel.
    """

    v: Any
    along: Any
    corner: Corner
    sun_r: Any
    sun_g: Any
    sun_b: Any


@device
def mesh_corner(arith, slab, switches, grid, column, row):
    """Return the triangle of each pixel; a cell is cut along its diagonal from lower right to upper left.

    A centre on the diagonal belongs to the lower triangle, or by the fill rule of a device to the upper one.
    """
    mesh_x, mesh_y = switches.mesh_x, switches.mesh_y
    x = pixels(arith, int32(column)) * slab.cells_x + slab.cell_x
    y = (lift(arith, spread_int(int32(row))) + 0.5) * slab.cells_y + slab.cell_y
    i = minimum(floor(nominal(x)), mesh_x - 1.0)
    j = minimum(floor(nominal(y)), mesh_y - 1.0)
    x, y = x - i, y - j
    bottom, cell = to_int(j), to_int(i)
    row_start = bottom * int32(mesh_x + 1)
    first = row_start + cell
    left = min(first_lane(cell), int32(mesh_x - 2))
    second = cell > spread_int(left)
    narrow = mesh_x > 1 and not any_lane(cell > spread_int(int32(left + 1)))
    right, above = first + int32(1), first + int32(mesh_x + 1)
    lower = nominal(x + y) <= 1.0
    zero = x * 0.0
    setup = Setup(zero, zero, zero, zero, zero, zero, zero, zero)
    a, b = select(lower, first, above + int32(1)), select(lower, right, above)
    if switches.screen != 0:
        lower = nominal(x + y) < 1.0 - TIE
        setup = triangle_setup(arith, grid, cell, bottom, lower, column, row)
        a, b = select(lower, right, above), select(lower, first, above + int32(1))
        narrow = False
    return Corner(
        a, b, select(lower, above, right), select(lower, x, 1.0 - x), select(lower, y, 1.0 - y), lower, second, narrow,
        first_lane(row_start) + left, mesh_x + 1, setup,
    )  # fmt: skip


@device
def triangle_setup(arith, grid, cell, bottom, lower, column, row):
    """Return the set-up of a cell's triangle: corners (right, first, above), or the upper (above, opposite, right)."""
    cell, bottom = maximum(cell, spread_int(int32(0))), maximum(bottom, spread_int(int32(0)))
    x0, x1 = lift(arith, gather(grid.x, cell)), lift(arith, gather(grid.x, cell + int32(1)))
    y0, y1 = lift(arith, gather(grid.y, bottom)), lift(arith, gather(grid.y, bottom + int32(1)))
    ax, ay = select(lower, x1, x0), select(lower, y0, y1)
    ex, ey = ax - select(lower, x0, x1), ay - select(lower, y0, y1)
    fx, fy = select(lower, x0, x1) - ax, select(lower, y1, y0) - ay
    r = (x0 * 0.0 + 1.0) / (ex * fy - fx * ey)
    return Setup(
        ex * r, ey * r, fx * r, fy * r, ax - 0.5, ay - 0.5, pixels(arith, int32(column)) - 0.5,
        lift(arith, spread_int(int32(row))),
    )  # fmt: skip


@device
def interpolate(arith, switches, attribute, base, corner):
    """Return a vertex attribute within the triangle, linear on the screen (planes are parallel to it)."""
    apart(arith)
    a, b, c = corner_values(arith, attribute, base, corner)
    if switches.screen == 0:
        return barycentric(arith, a, b, c, corner.wb, corner.wc)
    e, f, setup = a - b, c - a, corner.setup
    dx, dy = e * setup.fy - f * setup.ey, f * setup.ex - e * setup.fx
    start = a - (dx * setup.x + dy * setup.y)
    return fma(dy, setup.row, fma(dx, setup.column, start))


@device
def corner_values(arith, attribute, base, corner):
    """Return an attribute at the corners of each lane's triangle; one gather takes as long as all of the selects."""
    if not corner.narrow:
        a = lift(arith, gather(attribute, corner.a + int32(base)))
        b = lift(arith, gather(attribute, corner.b + int32(base)))
        return a, b, lift(arith, gather(attribute, corner.c + int32(base)))
    at = base + corner.start
    below, above = (
        vertex_row(arith, attribute, at, corner.second),
        vertex_row(arith, attribute, at + corner.row, corner.second),
    )
    a = select(corner.lower, below[0], above[1])
    return a, select(corner.lower, below[1], above[0]), select(corner.lower, above[0], below[1])


@device
def vertex_row(arith, attribute, at, second):
    """Return the left and right vertex of each lane's cell, of the first or the second of two cells from `at` on."""
    middle = lift(arith, attribute[at + 1])
    return select(second, middle, lift(arith, attribute[at])), select(second, lift(arith, attribute[at + 2]), middle)


@device
def place(arith, slab, switches, mesh, ray, column, row):
    """Return what a pixel's ray has in common for all planes; v comes from the mesh where the coordinates do."""
    apart(arith)
    cx = ray.ex * slab.cross_ax + ray.ey * slab.cross_bx + slab.cross_cx
    cy = ray.ex * slab.cross_ay + ray.ey * slab.cross_by + slab.cross_cy
    cz = ray.ex * slab.cross_az + ray.ey * slab.cross_bz + slab.cross_cz
    v = sqrt(cx * cx + cy * cy + cz * cz) / ray.length
    along = (ray.dx * slab.from_x + ray.dy * slab.from_y + ray.dz * slab.from_z) / ray.length
    corner = mesh_corner(arith, slab, switches, mesh.grid, column, row)
    r = v * 0.0
    g, b = r, r
    if switches.parallel != 0:
        r, g, b = sunlight(slab, switches, ray)
    elif switches.vertex != 0:
        v = interpolate(arith, switches, mesh.v, 0, corner)
    return Place(v, along, corner, r, g, b)


@device
def mean_transmittance(x):
    """Return (1 - exp(-x)) / x for x >= 0, without cancellation; relative error below 1e-15 and rounding."""
    series = 1.0 - x * (1.0 / 7.0) * (1.0 - x * (1.0 / 8.0))
    series = 1.0 - x * (1.0 / 5.0) * (1.0 - x * (1.0 / 6.0) * series)
    series = 1.0 - x * (1.0 / 2.0) * (1.0 - x * (1.0 / 3.0) * (1.0 - x * (1.0 / 4.0) * series))
    return select(x < 0.0625, series, (1.0 - exp(x * -1.0)) / maximum(x, 0.0625))


@device
def sunlight(slab, switches, ray):
    """Return gamma (1 - exp(-sigma_t dt)) / sigma_t, three channels: f_l of the sun without c_k (D-E13)."""
    mu = (ray.dx * slab.axis_x + ray.dy * slab.axis_y + ray.dz * slab.axis_z) / ray.length * -1.0
    dt = slab.dt + ray.length * 0.0
    if switches.dt_mode != DT_PAPER:
        dt = dt * ray.length
    peak = lane_phase(switches.phase, slab.g, mu * slab.cosine) * dt
    r = peak * slab.source_r * mean_transmittance(dt * slab.sigma_r)
    g, b = r, r
    if switches.grey == 0:
        g = peak * slab.source_g * mean_transmittance(dt * slab.sigma_g)
        b = peak * slab.source_b * mean_transmittance(dt * slab.sigma_b)
    return r, g, b


@device
def _table(arith, q, channel, slab, switches, u, v):
    """Return one channel of q: the table times its range, plus the rest that did not fit."""
    apart(arith)
    su = minimum(maximum(u * slab.scale_u + slab.offset_u, 0.0), 1.0)
    sv = minimum(maximum(v * slab.scale_v + slab.offset_v, 0.0), 1.0)
    value = bilinear(arith, q.main, channel, su, sv) * slab.range
    if switches.rest != 0:
        value = value + bilinear(arith, q.rest, channel, su, sv) * slab.rest
    return value


@device
def _exact(slab, switches, nodes, weights, sigma, source, u, v, dt):
    """Return one channel of q without a table."""
    return source * q_integral(u, v, dt, sigma, switches.phase, slab.g, slab.cosine, nodes, weights)


@device
def slow_factor(arith, slab, switches, q, mesh, quadrature, ray, where, z, plane, count):
    """Return f_l = c_k q(u, v) of main plane `plane` at depth z, three channels; of the sun in closed form."""
    apart(arith)
    nodes, weights = quadrature
    dt = slab.dt + ray.length * 0.0
    if switches.dt_mode == DT_EXACT:
        dt = dt * ray.length
    vertices = (switches.mesh_x + 1) * (switches.mesh_y + 1)
    u, v = where.along, where.v
    if switches.vertex != 0:
        if switches.parallel == 0:
            u = interpolate(arith, switches, mesh.u, plane * vertices, where.corner)
        c_r = interpolate(arith, switches, mesh.c, plane * vertices, where.corner)
        c_g, c_b = c_r, c_r
        if switches.grey == 0:
            c_g = interpolate(arith, switches, mesh.c, (count + plane) * vertices, where.corner)
            c_b = interpolate(arith, switches, mesh.c, (2 * count + plane) * vertices, where.corner)
    else:
        u = where.along + ray.length * z
        t = ray.length * z
        c_r = exp(t * slab.sigma_r * -1.0)
        c_g, c_b = c_r, c_r
        if switches.grey == 0:
            c_g, c_b = exp(t * slab.sigma_g * -1.0), exp(t * slab.sigma_b * -1.0)
        if switches.parallel != 0:
            c_r, c_g, c_b = c_r * where.sun_r, c_g * where.sun_g, c_b * where.sun_b
        elif switches.dt_mode == DT_COSINE:
            c_r, c_g, c_b = c_r * ray.length, c_g * ray.length, c_b * ray.length
    if switches.parallel != 0:
        return c_r, c_g, c_b
    if switches.exact_q != 0:
        q_r = _exact(slab, switches, nodes, weights, slab.sigma_r, slab.source_r, u, v, dt)
    else:
        q_r = _table(arith, q, 0, slab, switches, u, v)
    q_g, q_b = q_r, q_r
    if switches.grey == 0:
        if switches.exact_q != 0:
            q_g = _exact(slab, switches, nodes, weights, slab.sigma_g, slab.source_g, u, v, dt)
            q_b = _exact(slab, switches, nodes, weights, slab.sigma_b, slab.source_b, u, v, dt)
        else:
            q_g = _table(arith, q, 1, slab, switches, u, v)
            q_b = _table(arith, q, 2, slab, switches, u, v)
    return c_r * q_r, c_g * q_g, c_b * q_b
