"""Mie scattering in multiprecision, as [Bohren1983] prints it: eqs. (4.53), (4.57), (4.61), (4.62); literal, slow.

Upward recurrences alone: more digits are carried than they lose.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mpmath
from mpmath import mpc, mpf

DIGITS = 60  # that are right at the end


class Sphere(NamedTuple):
    """Coefficients from n = 1, and x."""

    a: list[Any]
    b: list[Any]
    x: Any


def _riccati(z: Any, count: int) -> list[Any]:
    """Return psi_0(z)...psi_count(z), psi_n(z) = z j_n(z)."""
    low, now = mpmath.cos(z), mpmath.sin(z)
    values = [now]
    for n in range(count):
        low, now = now, (2 * n + 1) / z * now - low
        values.append(now)
    return values


def _riccati_second(z: Any, count: int) -> list[Any]:
    """Return chi_0(z)...chi_count(z), chi_n(z) = -z y_n(z)."""
    low, now = -mpmath.sin(z), mpmath.cos(z)
    values = [now]
    for n in range(count):
        low, now = now, (2 * n + 1) / z * now - low
        values.append(now)
    return values


def solve(m: complex, x: float, count: int) -> Sphere:
    """Return the coefficients of orders 1...count; m = n + i k."""
    lost = abs(complex(m).imag) * x + max(0.0, count - abs(m) * x) + max(0.0, count - x)
    with mpmath.workdps(DIGITS + 100 + int(lost)):
        big_m, big_x = mpc(m), mpf(x)
        inner, outer = _riccati(big_m * big_x, count), _riccati(big_x, count)
        second = _riccati_second(big_x, count)
        a, b = [], []
        for n in range(1, count + 1):
            slope_inner = inner[n - 1] - n / (big_m * big_x) * inner[n]
            slope = outer[n - 1] - n / big_x * outer[n]
            xi, slope_xi = outer[n] - 1j * second[n], slope - 1j * (second[n - 1] - n / big_x * second[n])
            a.append(
                (big_m * inner[n] * slope - outer[n] * slope_inner) / (big_m * inner[n] * slope_xi - xi * slope_inner)
            )
            b.append(
                (inner[n] * slope - big_m * outer[n] * slope_inner) / (inner[n] * slope_xi - big_m * xi * slope_inner)
            )
        return Sphere(a, b, big_x)


def efficiencies(s: Sphere) -> tuple[float, float, float, float, float]:
    """Return extinction, scattering, absorption, backscatter, asymmetry."""
    with mpmath.workdps(DIGITS):
        pairs = list(enumerate(zip(s.a, s.b, strict=True), 1))
        scale = 2 / s.x**2
        extinction = scale * mpmath.fsum((2 * n + 1) * mpmath.re(a + b) for n, (a, b) in pairs)
        scattering = scale * mpmath.fsum((2 * n + 1) * (abs(a) ** 2 + abs(b) ** 2) for n, (a, b) in pairs)
        back = abs(mpmath.fsum((2 * n + 1) * (-1) ** n * (a - b) for n, (a, b) in pairs)) ** 2 / s.x**2
        forward = mpmath.fsum(
            mpf(2 * n + 1) / (n * (n + 1)) * mpmath.re(a * mpmath.conj(b)) for n, (a, b) in pairs
        ) + mpmath.fsum(
            mpf(n * (n + 2)) / (n + 1) * mpmath.re(a * mpmath.conj(s.a[n]) + b * mpmath.conj(s.b[n]))
            for n, (a, b) in pairs[:-1]
        )
        asymmetry = 2 * scale * forward / scattering
        return tuple(float(v) for v in (extinction, scattering, extinction - scattering, back, asymmetry))  # type: ignore[return-value]


def amplitudes(s: Sphere, mu: float) -> tuple[complex, complex]:
    """Return S1 and S2 at a scattering cosine."""
    with mpmath.workdps(60):
        cosine = mpf(mu)
        low, now = mpf(0), mpf(1)
        s1, s2 = mpc(0), mpc(0)
        for n, (a, b) in enumerate(zip(s.a, s.b, strict=True), 1):
            tau = n * cosine * now - (n + 1) * low
            share = mpf(2 * n + 1) / (n * (n + 1))
            s1, s2 = s1 + share * (a * now + b * tau), s2 + share * (a * tau + b * now)
            low, now = now, ((2 * n + 1) * cosine * now - (n + 1) * low) / n
        return complex(s1), complex(s2)
