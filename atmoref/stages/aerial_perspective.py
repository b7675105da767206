# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Aerial perspective: sunlight that air scatters once into a view ray, in closed form [Riley 2004, eqs. (8) to (15)].

Air is flat and thins out exponentially, beta(h) = beta_sl exp(-gamma h).  With K the length of the ray, p_y and l_y the
vertical parts of its direction and of the sun's, beta_eye = beta_sl exp(-gamma s_y), B = beta_eye / gamma,
q = gamma p_y K and phi(x) = (e^x - 1) / x,

    tau = beta_eye K phi(-q),    x = tau (p_y - l_y) / l_y,
    L / (I_s P) = tau phi(-|x|) exp(-min(B / l_y, B e^(-q) / l_y + tau)),    T = exp(-tau).

Eq. (15) as printed lacks the factor exp(-B / p_y) (R-E1) and, like eq. (11), divides by p_y and by p_y - l_y (R-E2).
Here every factor is positive and every exponent at most 0: level rays, rays to the sun and rays downwards are regular.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from atmoref._jit import device, kernel
from atmoref.elementary import exp as exp_of
from atmoref.lanes import Double, N, Single, absolute, exp, fma, lift, load, select, store

__all__ = ["FAR_M", "LEAST_SUN", "AirUniforms", "aerial_perspective", "air_uniforms", "scattered_by_air"]

FAR_M = 1e9
"""A ray's length that stands for infinity: finite, so that no product is infinity times 0."""
LEAST_SUN = 1e-6
"""Least l_y of a sun above the horizon; on a flat earth a sun below gives no light."""
SERIES = 0.5  # |x| below which phi is a series
_TERMS = tuple(1.0 / k for k in range(16, 1, -1))


class AirUniforms(NamedTuple):
    """Of one channel, one eye and one sun; all that does not depend on the ray."""

    gamma: float  # 1 / scale height, 1/m
    gamma_low: float  # what float32 leaves of it; of float64 nothing
    beta_eye: float  # scattering at the eye, 1/m
    beta_low: float
    sun_y: float
    over_sun: float  # 1 / l_y
    sun_depth: float  # B / l_y: optical depth from the eye to the sun
    sun_low: float


def air_uniforms(
    beta_sl_per_m: float, gamma_per_m: float, eye_height_m: float, sun_y: float, dtype: DTypeLike = np.float64
) -> AirUniforms:
    """Return the uniforms of one channel, for kernels in float32 or float64.

    Parameters
    ----------
    beta_sl_per_m : float
        Scattering coefficient at sea level, from 0.
    gamma_per_m : float
        Inverse scale height, > 0.
    eye_height_m : float
    sun_y : float
        Vertical part of the unit vector to the sun: above 0 (at least `LEAST_SUN` is taken) to 1.

    Raises
    ------
    ValueError
    """
    if not (beta_sl_per_m >= 0.0 and gamma_per_m > 0.0 and math.isfinite(eye_height_m) and 0.0 < sun_y <= 1.0):
        raise ValueError(
            f"air needs beta >= 0, gamma > 0, a height and a sun above the horizon, found {beta_sl_per_m!r}, "
            f"{gamma_per_m!r}, {eye_height_m!r}, {sun_y!r}"
        )
    up = max(sun_y, LEAST_SUN)
    beta = beta_sl_per_m * float(exp_of(np.float64(-gamma_per_m * eye_height_m)))

    def parts(value: float) -> tuple[float, float]:
        rounded = float(np.asarray(value, dtype))
        return rounded, value - rounded

    return AirUniforms(*parts(gamma_per_m), *parts(beta), up, 1.0 / up, *parts(beta / gamma_per_m / up))


@device
def _mean_growth(x, x_low, growth):
    """Return phi(x) = (e^x - 1) / x of x + x_low, as a number and what it lacks; growth is e^(x + x_low)."""
    series = x * 0.0 + 1.0
    for term in _TERMS:
        series = series * x * term + 1.0
    near = absolute(x) < SERIES
    safe = select(near, x * 0.0 + 1.0, x)
    quotient = (growth - 1.0) / safe
    lacks = (fma(quotient * -1.0, safe, growth - 1.0) - quotient * x_low) / safe
    return select(near, series, quotient), select(near, x * 0.0, lacks)


@device
def _times(a, a_low, b, b_low):
    """Return (a + a_low) (b + b_low) as a number and what it lacks."""
    value = a * b
    return value, fma(a, b, value * -1.0) + (a * b_low + a_low * b)


@device
def _exp_of(x, x_low):
    """Return e^(x + x_low)."""
    value = exp(x)
    return value + value * x_low


@device
def scattered_by_air(p_y, length, air):
    """Return (L / (I_s P) without unit, T): what air scatters into a ray, and what it lets pass, as lanes.

    Exponents are kept to twice the precision: where one is 80, its rounding alone costs float32 5e-6 of the result.

    Parameters
    ----------
    p_y : lane
        Vertical part of the ray's unit vector.
    length : lane, m
        Up to `FAR_M`; where p_y < 0 at most down to the ground.
    air : AirUniforms of lanes
    """
    rise, rise_low = _times(p_y, p_y * 0.0, length, length * 0.0)
    q, q_low = _times(rise, rise_low, air.gamma, air.gamma_low)
    thinner = _exp_of(q * -1.0, q_low * -1.0)
    mean, mean_low = _mean_growth(q * -1.0, q_low * -1.0, thinner)
    level, level_low = _times(length, length * 0.0, air.beta_eye, air.beta_low)
    tau, tau_low = _times(level, level_low, mean, mean_low)
    x = absolute(tau * ((p_y - air.sun_y) * air.over_sun)) * -1.0
    end, end_low = _times(air.sun_depth, air.sun_low, thinner, thinner * 0.0)
    beyond = end + tau  # the way through the ray's end, from the sun to the eye
    part = beyond - end
    beyond_low = (end - (beyond - part)) + (tau - part) + (end_low + tau_low)
    nearer = air.sun_depth < beyond
    depth, depth_low = select(nearer, air.sun_depth, beyond), select(nearer, air.sun_low, beyond_low)
    share = tau * _mean_growth(x, x * 0.0, exp(x))[0] * _exp_of(depth * -1.0, depth_low * -1.0)
    return share, _exp_of(tau * -1.0, tau_low * -1.0)


@kernel
def _aerial_kernel(scattered, passed, p_y, length, air, arith):
    uniforms = lift(arith, air)
    for i in range(0, scattered.size, N):
        share, transmittance = scattered_by_air(load(p_y, i), load(length, i), uniforms)
        store(scattered, i, share)
        store(passed, i, transmittance)


def aerial_perspective(
    p_y: ArrayLike, length_m: ArrayLike, air: AirUniforms
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return (L / (I_s P), T) of rays: `scattered_by_air` over arrays of one shape, float32 or float64.

    Uniforms are those of the rays' type.  Relative error of either where it is a normal number: float64 1e-12, float32
    2e-5 (in deep tails; 2e-6 where L / (I_s P) is above 1e-4).
    """
    p, k = np.broadcast_arrays(np.asarray(p_y), np.asarray(length_m))
    kind = np.result_type(p.dtype, k.dtype)
    if kind not in (np.float32, np.float64):
        raise TypeError(f"rays are float32 or float64, found {kind}")
    padded = -(-p.size // N) * N
    up, along, scattered, passed = (np.ones(padded, kind) for _ in range(4))
    up[: p.size], along[: k.size] = p.ravel(), k.ravel()
    _aerial_kernel(scattered, passed, up, along, air, Single() if kind == np.float32 else Double())
    return scattered[: p.size].reshape(p.shape), passed[: p.size].reshape(p.shape)
