# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Kernel of geometrical optics in hexagonal prisms: rays enter, are reflected or refracted at random, and leave.

Each ray has its own random numbers, counted from its index, and integers count where it ends: results do not depend on
threads.  Only + - * / and square roots are used.
"""

import math

import numpy as np

from atmoref._jit import device, kernel, subroutine

SIDES = 8  # facets of a hexagonal prism
MOST_HITS = 300
STRAIGHT = 1.0 - 1e-12  # a ray above this cosine went straight on
DELTA, REFLECTED, HIT, LOST = 0, 1, 2, 3  # places of `tally`

_STEP = np.uint64(0x9E3779B97F4A7C15)  # SplitMix64
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_STREAM = np.uint64(0xD1342543DE82EF95)
_BY_30, _BY_27, _BY_31, _BY_11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


@device
def _mixed(z):
    z = (z ^ (z >> _BY_30)) * _MIX_1
    z = (z ^ (z >> _BY_27)) * _MIX_2
    return z ^ (z >> _BY_31)


@device
def _draw(state):
    """Return the next state and a number in [0, 1)."""
    state = state + _STEP
    return state, float(_mixed(state) >> _BY_11) * 1.1102230246251565e-16


@subroutine
def _in_disc(state):
    """Return the next state, a uniform point of the unit disc, and its squared radius."""
    s = 2.0
    x = y = 0.0
    while s >= 1.0:
        state, u = _draw(state)
        state, v = _draw(state)
        x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
        s = x * x + y * y
    return state, x, y, s


@device
def _across(dx, dy, dz):
    """Return two unit vectors that stand on d and on each other (Duff et al. 2017)."""
    sign = math.copysign(1.0, dz)
    a = -1.0 / (sign + dz)
    b = dx * dy * a
    return (1.0 + sign * dx * dx * a, sign * b, -sign * dx), (b, sign + dy * dy * a, -dy)


@subroutine
def _fresnel(eta, cos_in):
    """Return the unpolarised reflectance and the cosine behind the surface; eta = n_before / n_behind."""
    square = eta * eta * (1.0 - cos_in * cos_in)
    if square >= 1.0:
        return 1.0, 0.0
    cos_out = math.sqrt(1.0 - square)
    s = (eta * cos_in - cos_out) / (eta * cos_in + cos_out)
    p = (cos_in - eta * cos_out) / (cos_in + eta * cos_out)
    return 0.5 * (s * s + p * p), cos_out


@subroutine
def _first_hit(p, d, normals, offsets):
    """Return the facet by which a ray enters and the distance to it; facet -1 if it misses."""
    near, far, facet = -1e300, 1e300, -1
    for k in range(SIDES):
        slope = normals[k, 0] * d[0] + normals[k, 1] * d[1] + normals[k, 2] * d[2]
        gap = offsets[k] - (normals[k, 0] * p[0] + normals[k, 1] * p[1] + normals[k, 2] * p[2])
        if slope < 0.0:
            t = gap / slope
            if t > near:
                near, facet = t, k
        elif slope > 0.0:
            far = min(far, gap / slope)
        elif gap < 0.0:
            return -1, 0.0
    return (facet, near) if near < far else (-1, 0.0)


@subroutine
def _next_hit(p, d, here, normals, offsets):
    """Return the facet at which a ray inside arrives and the distance to it; never the one it comes from."""
    best, facet = 1e300, -1
    for k in range(SIDES):
        slope = normals[k, 0] * d[0] + normals[k, 1] * d[1] + normals[k, 2] * d[2]
        if k != here and slope > 0.0:
            gap = offsets[k] - (normals[k, 0] * p[0] + normals[k, 1] * p[1] + normals[k, 2] * p[2])
            if gap / slope < best:
                best, facet = gap / slope, k
    return facet, max(best, 0.0)


@subroutine
def _tilted(state, n, d, tilt):
    """Return the next state and a facet's normal, tilted by slopes uniform in a disc, on the same side of the ray."""
    if tilt == 0.0:
        return state, n
    state, x, y, _ = _in_disc(state)
    u, v = _across(n[0], n[1], n[2])
    x, y = x * tilt, y * tilt
    scale = 1.0 / math.sqrt(1.0 + x * x + y * y)
    t = (
        (n[0] + x * u[0] + y * v[0]) * scale,
        (n[1] + x * u[1] + y * v[1]) * scale,
        (n[2] + x * u[2] + y * v[2]) * scale,
    )
    ahead = t[0] * d[0] + t[1] * d[1] + t[2] * d[2]
    return state, (t if ahead > 1e-6 else n)


@subroutine
def _meet(state, d, n, eta, tilt):
    """Return the next state, the new direction, and whether the ray goes through a facet with normal n along it."""
    for attempt in range(2):
        state, t = _tilted(state, n, d, tilt if attempt == 0 else 0.0)
        cos_in = d[0] * t[0] + d[1] * t[1] + d[2] * t[2]
        reflectance, cos_out = _fresnel(eta, cos_in)
        state, u = _draw(state)
        through = u >= reflectance
        if through:
            c = cos_out - eta * cos_in
            e = (eta * d[0] + c * t[0], eta * d[1] + c * t[1], eta * d[2] + c * t[2])
        else:
            c = -2.0 * cos_in
            e = (d[0] + c * t[0], d[1] + c * t[1], d[2] + c * t[2])
        side = e[0] * n[0] + e[1] * n[1] + e[2] * n[2]
        if (side > 0.0) == through:  # a tilted facet may send a ray to the wrong side: then the facet is not tilted
            return state, e, through
    return state, e, through


@subroutine
def _one_ray(state, radius, index, tilt, normals, offsets):
    """Return the cosine of deflection, and the number of facets met; 0: missed, -1: still inside after MOST_HITS."""
    state, x, y, s = _in_disc(state)
    root = 2.0 * math.sqrt(1.0 - s)
    d0 = (x * root, y * root, 1.0 - 2.0 * s)
    u, v = _across(d0[0], d0[1], d0[2])
    state, x, y, s = _in_disc(state)
    x, y, back = x * radius, y * radius, -2.0 * radius
    p = (
        x * u[0] + y * v[0] + back * d0[0],
        x * u[1] + y * v[1] + back * d0[1],
        x * u[2] + y * v[2] + back * d0[2],
    )
    facet, t = _first_hit(p, d0, normals, offsets)
    if facet < 0:
        return 0.0, 0
    inward = (-normals[facet, 0], -normals[facet, 1], -normals[facet, 2])
    state, d, through = _meet(state, d0, inward, 1.0 / index, tilt)
    if not through:
        return d[0] * d0[0] + d[1] * d0[1] + d[2] * d0[2], 1
    p = (p[0] + t * d0[0], p[1] + t * d0[1], p[2] + t * d0[2])
    for hit in range(2, MOST_HITS):
        facet, t = _next_hit(p, d, facet, normals, offsets)
        p = (p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2])
        n = (normals[facet, 0], normals[facet, 1], normals[facet, 2])
        state, d, through = _meet(state, d, n, index, tilt)
        if through:
            return d[0] * d0[0] + d[1] * d0[1] + d[2] * d0[2], hit
    return 0.0, -1


@kernel
def rays_kernel(counts, tally, edges, first, end, seed, radius, index, tilt, normals, offsets):
    """Trace rays first...end-1; count those that leave between two of the falling cosines `edges`, delta apart.

    Returns the sum of the cosines of all that left.
    """
    total = 0.0
    for ray in range(first, end):
        state = _mixed(np.uint64(ray) * _STREAM + np.uint64(seed))
        mu, hits = _one_ray(state, radius, index, tilt, normals, offsets)
        if hits == 0:
            continue
        tally[HIT] += 1
        if hits < 0:
            tally[LOST] += 1
            continue
        total += mu
        if hits == 1:
            tally[REFLECTED] += 1
        elif mu > STRAIGHT:
            tally[DELTA] += 1
            continue
        low, high = 0, edges.size - 1
        while high - low > 1:
            middle = (low + high) // 2
            if edges[middle] >= mu:
                low = middle
            else:
                high = middle
        counts[low] += 1
    return total
