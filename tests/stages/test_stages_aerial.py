"""Aerial perspective against quadrature in many digits, a sweep in wide numbers, and what holds of any such formula."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest

from atmoref.stages.aerial_perspective import FAR_M, AirUniforms, aerial_perspective, air_uniforms

GAMMA = 1.0 / 8000.0
Wide = np.longdouble
# sheet, section 4: beta_sl, s_y, p_y, l_y, K, L / (I_s P) by quadrature
SHEET = [
    (3.31e-5, 0.0, 0.5, 0.3, 1e4, 0.1106462863), (3.31e-5, 0.0, 0.1, 0.9, 1e5, 0.6819294808),
    (5.8e-6, 2000.0, 0.05, 0.1, 5e4, 0.1287963895), (3.31e-5, 1e4, -0.3, 0.5, 3e4, 0.305571472),
    (1.35e-5, 0.0, 0.3, 0.3 + 1e-6, 2e4, 0.1325223685), (3.31e-5, 0.0, 1e-3, 0.02, 5e4, 1.48120e-6),
    (3.31e-5, 0.0, 0.9, 0.05, 8e4, 0.0435082060),
]  # fmt: skip


def one(beta: float, height: float, p_y: float, l_y: float, k: float, kind: Any = np.float64) -> tuple[float, float]:
    found = aerial_perspective(np.array([p_y], kind), np.array([k], kind), air_uniforms(beta, GAMMA, height, l_y, kind))
    return float(found[0][0]), float(found[1][0])


@pytest.mark.parametrize("case", SHEET)
def test_the_sheets_values(case: tuple[float, ...]) -> None:
    digits = 5e-12 if case[5] < 1e-5 else 6e-11  # half of the last printed digit
    assert one(*case[:5])[0] == pytest.approx(case[5], abs=digits)
    assert one(*case[:5], np.float32)[0] == pytest.approx(case[5], rel=3e-6, abs=digits)


def by_quadrature(beta: float, height: float, p_y: float, l_y: float, k: float) -> tuple[float, float]:
    """Return eq. (14) / (I_s P) and eq. (5), integrated along the ray with 30 digits."""
    with mpmath.workdps(30):
        b, g, s, p, sun = (mpmath.mpf(v) for v in (beta, GAMMA, height, p_y, l_y))

        def density(at: Any) -> Any:
            return b * mpmath.exp(-g * (s + p * at))

        def depth(at: Any) -> Any:
            return density(0) * at if p == 0 else b * mpmath.exp(-g * s) * (1 - mpmath.exp(-g * p * at)) / (g * p)

        def integrand(at: Any) -> Any:
            return density(at) * mpmath.exp(-depth(at) - density(at) / (g * sun))

        pieces = [mpmath.mpf(k) * i / 12 for i in range(13)]
        return float(mpmath.quad(integrand, pieces)), float(mpmath.exp(-depth(mpmath.mpf(k))))


@pytest.mark.parametrize("l_y", [1.0, 0.3, 0.05])
def test_every_direction_is_that_of_quadrature(l_y: float) -> None:
    """M-7: level, nearly level, to the sun and beside it, straight up and down."""
    for p_y in (0.0, 1e-9, -1e-9, l_y, float(np.nextafter(l_y, 2.0)), float(np.nextafter(l_y, 0.0)), 1.0, -1.0, -0.4):
        p = min(p_y, 1.0)
        for beta, height, k in ((3.31e-5, 3000.0, 2500.0), (5.8e-6, 100.0, 90.0)):
            expected = by_quadrature(beta, height, p, l_y, k)
            np.testing.assert_allclose(one(beta, height, p, l_y, k), expected, rtol=1e-12)
            np.testing.assert_allclose(one(beta, height, p, l_y, k, np.float32), expected, rtol=5e-6)


def wide_growth(x: Any) -> Any:
    series = np.ones_like(x)
    for term in range(30, 1, -1):
        series = series * x / Wide(term) + 1
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        return np.where(np.abs(x) < 0.5, series, np.expm1(x) / x)


def wide(p_y: Any, length: Any, beta: float, height: float, l_y: float) -> tuple[Any, Any]:
    """Return the closed form in 64 bits of mantissa, out of the question and not out of the uniforms."""
    p, k, sun, g = p_y.astype(Wide), length.astype(Wide), Wide(l_y), Wide(GAMMA)
    at_eye = Wide(beta) * np.exp(-g * Wide(height))
    q = g * p * k
    tau = at_eye * k * wide_growth(-q)
    x = np.abs(tau * (p - sun) / sun)
    to_sun = at_eye / g / sun
    return tau * wide_growth(-x) * np.exp(-np.minimum(to_sun, to_sun * np.exp(-q) + tau)), np.exp(-tau)


def rays(rng: np.random.Generator, count: int, height: float, l_y: float, kind: Any) -> tuple[Any, Any]:
    """Return directions and lengths, half of them where formulas break; downward ones end above the ground."""
    p = rng.uniform(-1.0, 1.0, count)
    quarter = count // 4
    p[:quarter] = rng.choice([-1.0, 1.0], quarter) * 10.0 ** rng.uniform(-20.0, 0.0, quarter)
    p[quarter : 2 * quarter] = l_y * (
        1.0 + rng.choice([-1.0, 1.0], quarter) * 10.0 ** rng.uniform(-16.0, -1.0, quarter)
    )
    p[:6] = 0.0, 1.0, -1.0, l_y, np.nextafter(l_y, 2.0), -0.0
    p = np.clip(p, -1.0, 1.0).astype(kind)
    k = (10.0 ** rng.uniform(-2.0, 6.0, count)).astype(kind)
    k[::7] = FAR_M
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = np.where(p < 0.0, 0.999 * height / np.abs(p).astype(np.float64), FAR_M)
    return p, np.minimum(k, np.minimum(ground, FAR_M)).astype(kind)


@pytest.mark.parametrize(("kind", "most", "least"), [(np.float64, 1e-12, 1e-300), (np.float32, 2e-5, 1e-37)])
def test_a_million_rays_are_right_and_finite(kind: Any, most: float, least: float) -> None:
    """Relative error of every normal number, the deepest tails included; all numbers finite, none negative."""
    rng = np.random.default_rng(6)
    worst = bright = 0.0
    for case in range(256):
        l_y = float(rng.choice([rng.uniform(1e-3, 1.0), 10.0 ** rng.uniform(-6.0, 0.0), 1.0]))
        beta, height = 10.0 ** rng.uniform(-7.0, -3.0), float(rng.choice([0.0, rng.uniform(0.0, 2e4)]))
        p, k = rays(rng, 4096, height, l_y, kind)
        found = aerial_perspective(p, k, air_uniforms(beta, GAMMA, height, l_y, kind))
        for value, expected in zip(found, wide(p, k, beta, height, l_y), strict=True):
            assert np.isfinite(value).all(), case
            assert ((value >= 0.0) & (value <= 1.0 + 1e-6)).all(), case
            normal = expected > least
            off = (np.abs(value - expected)[normal] / expected[normal]).astype(float)
            worst = max(worst, float(off.max(initial=0.0)))
            bright = max(bright, float(off[expected[normal] > 1e-4].max(initial=0.0)))
    assert worst <= most
    assert bright <= most / 5.0


def test_rays_add_up() -> None:
    """M-6, the split at a middle plane: L(0, K) = L(0, m) + T(m) L from there; T composes; L grows with K."""
    beta, l_y = 3.31e-5, 0.4
    for height, p_y, k, m in (
        (0.0, 0.6, 3e4, 4e3),
        (9000.0, -0.5, 1.5e4, 6e3),
        (500.0, 0.0, 2e5, 3e4),
        (0.0, l_y, FAR_M, 1e3),
    ):
        (whole, all_of), (near, passed) = one(beta, height, p_y, l_y, k), one(beta, height, p_y, l_y, m)
        far, rest = one(beta, height + p_y * m, p_y, l_y, k - m)
        assert whole == pytest.approx(near + passed * far, rel=1e-13)
        assert all_of == pytest.approx(passed * rest, rel=1e-12)
        assert near < whole


def test_limits_of_thin_and_endless_air() -> None:
    """M-8: L -> beta K exp(-B / l_y) for thin air; a level ray without end sees exp(-B / l_y) of the sun's light."""
    thin, _ = one(1e-12, 0.0, 0.3, 0.5, 10.0)
    assert thin == pytest.approx(1e-12 * 10.0, rel=1e-3)
    beta, l_y = 1.35e-5, 0.5
    assert one(beta, 0.0, 0.0, l_y, FAR_M)[0] == pytest.approx(math.exp(-beta / GAMMA / l_y), rel=1e-12)


def test_the_printed_equation_lacks_a_factor() -> None:
    """M-9: eq. (15) over the truth is exp(B / p_y) (R-E1)."""
    beta, p_y, l_y, k = 3.31e-5, 0.5, 0.3, 1e4
    depth = beta / GAMMA
    tilt = depth * (1.0 / l_y - 1.0 / p_y)
    printed = l_y / (p_y - l_y) * (math.exp(-tilt * math.exp(-GAMMA * p_y * k)) - math.exp(-tilt))
    assert printed / one(beta, 0.0, p_y, l_y, k)[0] == pytest.approx(math.exp(depth / p_y), rel=1e-9)


def test_wrong_air_is_refused() -> None:
    for wrong in (
        (-1e-6, GAMMA, 0.0, 0.5),
        (1e-6, 0.0, 0.0, 0.5),
        (1e-6, GAMMA, math.nan, 0.5),
        (1e-6, GAMMA, 0.0, 0.0),
    ):
        with pytest.raises(ValueError, match="a sun above the horizon"):
            air_uniforms(*wrong)
    with pytest.raises(TypeError, match="float32 or float64"):
        aerial_perspective(
            np.ones(3, np.float16), np.ones(3, np.float16), AirUniforms(1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0)
        )
