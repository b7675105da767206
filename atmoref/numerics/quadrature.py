"""Gauss-Legendre rules by Newton's method in plain double arithmetic: the same bits on every machine.

NumPy's `leggauss` asks LAPACK for eigenvalues, whose last bits depend on the processor; stored tables may not.
"""

import functools

import numpy as np
from numpy.typing import NDArray

from atmoref.elementary import cos

_STEPS = 12  # Newton converges quadratically from the asymptotic guess; more steps only repeat the fixed point


def _legendre(n: int, x: float) -> tuple[float, float]:
    """Return P_n(x) and its derivative by the three-term recurrence."""
    before, now = 1.0, x
    for k in range(2, n + 1):
        before, now = now, ((2.0 * k - 1.0) * x * now - (k - 1.0) * before) / k
    return now, n * (x * now - before) / (x * x - 1.0)


@functools.cache
def gauss_legendre(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return nodes and weights of the n-point Gauss-Legendre rule on [0, 1].

    Parameters
    ----------
    n : int
        Number of nodes, 2 to 512.

    Returns
    -------
    nodes, weights : (n,) float64 arrays
        Ascending nodes; weights sum to 1.  Error below 2e-15 of each node, 1e-13 relative of each weight
        (n <= 64; 5e-13 at n = 128).

    Raises
    ------
    ValueError
        If n is outside 2 to 512.
    """
    if not 2 <= n <= 512:
        raise ValueError(f"a Gauss-Legendre rule has 2 to 512 nodes here, not {n}")
    nodes, weights = np.zeros(n), np.zeros(n)
    for i in range((n + 1) // 2):
        x = float(cos(np.float64(3.141592653589793 * (i + 0.75) / (n + 0.5))))
        slope = 1.0
        for _ in range(_STEPS):
            value, slope = _legendre(n, x)
            x -= value / slope
        if 2 * i + 1 == n:
            x = 0.0
        _, slope = _legendre(n, x)
        weight = 1.0 / ((1.0 - x * x) * slope * slope)
        nodes[i], nodes[n - 1 - i] = 0.5 * (1.0 - x), 0.5 * (1.0 + x)
        weights[i] = weights[n - 1 - i] = weight
    nodes.flags.writeable = weights.flags.writeable = False
    return nodes, weights
