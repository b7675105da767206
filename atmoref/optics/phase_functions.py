"""Phase functions: the share of scattered light that leaves per steradian at a given angle.

Every function here integrates to 1 over the sphere; the scattering cosine ``mu`` is 1 forward (light goes straight
on) and -1 backward. One source, :func:`phase_source`, is bound three times: to NumPy here (:func:`evaluate`), to plain
float64 Numba code in ``scalar_phase.py`` (:func:`phase`) and to lanes in ``lane_phase.py``. It needs + - * / and sqrt
only, so all three agree to the last bit in the same precision.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "CORNETTE_SHANKS",
    "HENYEY_GREENSTEIN",
    "ISOTROPIC",
    "NISHITA_HAZY",
    "NISHITA_MURKY",
    "PHASE_FUNCTIONS",
    "RAYLEIGH",
    "evaluate",
    "phase_source",
]

ISOTROPIC = 0
HENYEY_GREENSTEIN = 1
RAYLEIGH = 2
NISHITA_HAZY = 3
NISHITA_MURKY = 4
CORNETTE_SHANKS = 5

PHASE_FUNCTIONS: dict[str, int] = {
    "isotropic": ISOTROPIC,
    "henyey_greenstein": HENYEY_GREENSTEIN,
    "rayleigh": RAYLEIGH,
    "nishita_hazy": NISHITA_HAZY,
    "nishita_murky": NISHITA_MURKY,
    "cornette_shanks": CORNETTE_SHANKS,
}
"""Name in scene files -> kind code in kernels."""

_PER_SPHERE = 1.0 / (4.0 * math.pi)


def phase_source(sqrt: Callable[[Any], Any]) -> Callable[[Any, Any, Any], Any]:
    """Return the function ``(kind, g, mu) -> phase`` (1/sr) over the given square root.

    ``kind`` is uniform (one value for all lanes), ``g`` and ``mu`` are of the arithmetic that ``sqrt`` takes. An
    unknown kind is isotropic: kernels raise nothing, the scene has refused it long before.

    The denominator 1 + g² - 2 g mu is written (g - mu)² + (1 - mu)(1 + mu): both terms are non-negative, so nothing
    cancels when g and mu are near 1 or near -1.

    Source: Henyey and Greenstein 1941; Cornette and Shanks 1992; the hazy and the murky atmosphere of Nishita, Miyawaki
    and Nakamae 1987, divided by their integrals over the sphere.
    """

    def phase(kind, g, mu):  # type: ignore[no-untyped-def]  # one source for scalars, arrays and lanes
        if kind == HENYEY_GREENSTEIN:
            d = (g - mu) * (g - mu) + (1.0 - mu) * (1.0 + mu)
            value = (1.0 - g) * (1.0 + g) / (d * sqrt(d))
        elif kind == RAYLEIGH:
            value = 0.75 * (1.0 + mu * mu)
        elif kind == NISHITA_HAZY:
            x = (1.0 + mu) * 0.5
            x2 = x * x
            x4 = x2 * x2
            value = 0.5 + 4.5 * (x4 * x4)
        elif kind == NISHITA_MURKY:
            x = (1.0 + mu) * 0.5
            x2 = x * x
            x4 = x2 * x2
            x8 = x4 * x4
            x16 = x8 * x8
            value = 0.5 + 16.5 * (x16 * x16)
        elif kind == CORNETTE_SHANKS:
            d = (g - mu) * (g - mu) + (1.0 - mu) * (1.0 + mu)
            value = 1.5 * ((1.0 - g) * (1.0 + g)) / (2.0 + g * g) * (1.0 + mu * mu) / (d * sqrt(d))
        else:
            value = 1.0 + mu * 0.0
        return value * _PER_SPHERE

    return phase


_evaluate = phase_source(np.sqrt)


def evaluate(kind: int, g: float, mu: ArrayLike) -> NDArray[np.float64]:
    """Return the phase function (1/sr) at scattering cosines.

    Parameters
    ----------
    kind
        A code of :data:`PHASE_FUNCTIONS`.
    g
        Asymmetry in (-1, 1); read by Henyey-Greenstein and Cornette-Shanks only. It is the mean cosine of the former,
        and of the latter only in the limits 0 and ±1: its mean cosine is 3g(4 + g²)/(5(2 + g²)).
    mu
        Scattering cosines in [-1, 1], any shape; 1 is forward.

    Returns
    -------
    numpy.ndarray
        float64, the shape of ``mu``; within 8 units in the last place of the exact value for the given ``mu``.

    Raises
    ------
    ValueError
        For an unknown kind, or g outside (-1, 1).
    """
    if kind not in PHASE_FUNCTIONS.values():
        raise ValueError(f"unknown phase function code {kind!r}: codes are {PHASE_FUNCTIONS}")
    if not -1.0 < g < 1.0:
        raise ValueError(f"asymmetry g = {g!r} is outside (-1, 1)")
    value: NDArray[np.float64] = np.asarray(_evaluate(kind, float(g), np.asarray(mu, np.float64)), np.float64)
    return value


def __getattr__(name: str) -> Any:
    """Bind ``phase``, the scalar form for Numba, on first use: scene files are read without importing Numba."""
    if name == "phase":
        from atmoref.optics.scalar_phase import phase

        return phase
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
