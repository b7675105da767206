# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""q(u, v): what one slab of fog scatters to the eye from a point light, without visibility and light distribution.

Computation [Dobashi 2002, eq. 9].  With the light as origin, u along the view ray (away from the eye) and v the
distance of the ray from the light,

    q(u, v) = integral from u to u + dt of rho F(alpha) exp(-sigma_t (s + u' - u)) / s^2 du',   s^2 = u'^2 + v^2.

The variable delta = pi - alpha = atan2(v, u') removes the peak 1/s^2, since du' / s^2 = -d delta / v:

    q(u, v) = 1/v integral of rho F(pi - delta) exp(-sigma_t (v / tan(delta / 2) - u)) d delta.

The integrand has a boundary layer at delta -> 0 (the ray runs away from the light, D-E3: back scattering) and a forward
peak at delta -> pi, so the range is split geometrically towards both ends, with one Gauss-Legendre rule a piece.

Precomputation.  Samples stand on the borders of the domain (first and last texel centre), because a bilinear read
clamps half a texel outside them: for a table that starts at v = 3.85 m that border row held the largest error, 1.3 %.

Look-up.  `table_coordinate` maps u or v to a texture coordinate.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import device, kernel, subroutine
from atmoref.lanes import (
    INTERVAL,
    Double,
    N,
    any_lane,
    atan2,
    compiled_only,
    exp,
    lift,
    load,
    maximum,
    minimum,
    overload,
    pair,
    select,
    store,
    tan,
)
from atmoref.numerics.quadrature import gauss_legendre
from atmoref.optics.lane_phase import lane_phase
from atmoref.optics.phase_functions import PHASE_FUNCTIONS
from atmoref.store import load_or_build

VERSION = 2
NODES = 32
PI = 3.141592653589793
QUARTER_TURN = 1.5707963267948966
FORWARD = 0.05  # within this angle of alpha = 0 one piece is enough for |g| <= 0.98
LEAST_V_M = 1e-9  # below it the ray counts as passing the light at this distance


class Fog(NamedTuple):
    """What q depends on besides place: extinction (1/m), phase function (kind code, asymmetry).

    `cosine` is +1; -1 is the misreading cos alpha = +u'/s that D-E3 rules out, kept so that its effect can be shown.
    """

    sigma_t: float
    kind: int
    g: float
    cosine: float = 1.0


@device
def _piece_end(low):
    """Return where the piece that starts at delta = low ends, before clamping to the range."""
    early = minimum(low * 4.0, QUARTER_TURN)
    late = select(low < PI - FORWARD, PI - (PI - low) * 0.25, low + FORWARD)
    return select(low < QUARTER_TURN, early, late)


@subroutine
def _q_integral(u, v, dt, sigma_t, kind, g, cosine, nodes, weights):
    """Return `q_integral` of lanes."""
    v = maximum(v, LEAST_V_M)
    end = u + dt
    low = atan2(v, end)
    left = atan2(v * dt, u * end + v * v)  # never as a difference of angles: near the light's back it would cancel
    high = low + left
    total = v * 0.0
    while any_lane(left > 0.0):
        stop = minimum(maximum(_piece_end(low), low), high)
        step = select(stop < high, stop - low, left)
        piece = v * 0.0
        for n in range(nodes.size):
            half = tan((low + step * nodes[n]) * 0.5)
            square = half * half
            mu = (square - 1.0) / (square + 1.0) * cosine
            path = v / half - u
            piece = piece + lane_phase(kind, g, mu) * exp(path * sigma_t * -1.0) * weights[n]
        total = total + piece * step
        low = stop
        left = left - step
    return total / v


@compiled_only
def q_integral(u: Any, v: Any, dt: Any, sigma_t: Any, kind: Any, g: Any, cosine: Any, nodes: Any, weights: Any) -> Any:
    """Return q / (rho F scale) in 1/m^2 times m times 1/sr: eq. (9) for one extinction; u, v, dt are lanes.

    Of intervals nothing is told: techniques refuse q without a table there.
    """


@overload(q_integral)
def _q_integral_of(
    u: Any, v: Any, dt: Any, sigma_t: Any, kind: Any, g: Any, cosine: Any, nodes: Any, weights: Any
) -> Any:
    if INTERVAL in (u, v, dt):
        return lambda u, v, dt, sigma_t, kind, g, cosine, nodes, weights: everything(u)
    return lambda u, v, dt, sigma_t, kind, g, cosine, nodes, weights: _q_integral(
        u, v, dt, sigma_t, kind, g, cosine, nodes, weights
    )


@device
def everything(x):
    """Return the interval of all reals."""
    return pair(x.lo * 0.0 - float("inf"), x.hi * 0.0 + float("inf"))


@kernel
def _q_kernel(out, u, v, dt, fog, nodes, weights):
    arith = Double()
    sigma_t = lift(arith, fog.sigma_t)
    g, cosine = lift(arith, fog.g), lift(arith, fog.cosine)
    step = lift(arith, dt)
    for i in range(0, out.size, N):
        store(out, i, q_integral(load(u, i), load(v, i), step, sigma_t, fog.kind, g, cosine, nodes, weights))


def q_values(u_m: NDArray[Any], v_m: NDArray[Any], dt_m: float, fog: Fog) -> NDArray[np.float64]:
    """Return q per unit of rho F scale (1/(m sr)) at points (u, v), in float64.

    Parameters
    ----------
    u_m, v_m : arrays of one shape, m
        Any u; v >= 0 (below 1e-9 m it counts as 1e-9 m, since q grows like 1/v).
    dt_m : float, m
        Length of the segment, > 0.
    fog : Fog

    Returns
    -------
    array of that shape; relative error <= 1e-9 for |g| <= 0.95 and v >= 1e-6 m, about 1e-14 for isotropic fog.

    Source: [Dobashi2002] eq. (9), D-E3, D-E4.
    """
    u, v = np.broadcast_arrays(np.asarray(u_m, np.float64), np.asarray(v_m, np.float64))
    padded = -(-u.size // N) * N
    us, vs, out = np.zeros(padded), np.ones(padded), np.empty(padded)
    us[: u.size], vs[: u.size] = u.ravel(), v.ravel()
    nodes, weights = gauss_legendre(NODES)
    _q_kernel(out, us, vs, float(dt_m), fog, nodes, weights)
    return out[: u.size].reshape(u.shape)


@dataclass(frozen=True, slots=True)
class QDomain:
    """Extent and size of a table: u from u0_m to u1_m in columns, v from v0_m to v1_m in rows, samples on the ends."""

    u0_m: float
    u1_m: float
    v0_m: float
    v1_m: float
    size: int

    def scale_offset(self) -> tuple[float, float, float, float]:
        """Return (su, ou, sv, ov): texture coordinate = s x + o for u and v."""
        inner = (self.size - 1.0) / self.size
        su, sv = inner / (self.u1_m - self.u0_m), inner / (self.v1_m - self.v0_m)
        half = 0.5 / self.size
        return su, half - su * self.u0_m, sv, half - sv * self.v0_m


def q_table(domain: QDomain, dt_m: float, fog: Fog) -> NDArray[np.float64]:
    """Return q per unit of rho F scale on the grid of `domain`, rows v, columns u, row 0 at v0; cached on disk.

    Parameters
    ----------
    domain : QDomain
    dt_m : float, m
    fog : Fog

    Returns
    -------
    (size, size) float64 array, 1/(m sr).  Unclamped: clamping and encoding belong to the buffer it goes into.

    Source: [Dobashi2002] sec. 4.2.1; D-E8.
    """

    def build() -> dict[str, NDArray[Any]]:
        steps = np.arange(domain.size) / (domain.size - 1.0)
        u = domain.u0_m + (domain.u1_m - domain.u0_m) * steps
        v = domain.v0_m + (domain.v1_m - domain.v0_m) * steps
        return {"q": q_values(u[None, :], v[:, None], dt_m, fog)}

    kind = next(name for name, code in PHASE_FUNCTIONS.items() if code == fog.kind)
    parameters: dict[str, Any] = {
        "u0_m": domain.u0_m, "u1_m": domain.u1_m, "v0_m": domain.v0_m, "v1_m": domain.v1_m, "size": domain.size,
        "dt_m": dt_m, "sigma_t_per_m": fog.sigma_t, "phase_function": kind, "g": fog.g, "cosine": fog.cosine,
        "nodes": NODES,
    }  # fmt: skip
    return load_or_build("q", VERSION, parameters, build)["q"]
