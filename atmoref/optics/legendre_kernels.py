# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Kernels of Legendre series: Gauss nodes, coefficients and sums, for thousands of terms.

All use differences d_k = P_k - P_{k-1} and v = 1 - mu instead of mu, which keeps every digit near the forward peak:

    d_{k+1} = (k d_k - (2k+1) v P_k) / (k+1),   P_{k+1} = P_k + d_{k+1}.

Only mu >= 0 is evaluated: P_k(-mu) = (-1)^k P_k(mu).
"""

from atmoref._jit import device, kernel
from atmoref.lanes import N, load, store

NEWTON_STEPS = 6  # from a guess that is off by 2 % for the first node and less for others; four suffice


@device
def _last_and_step(v, n, one):
    """Return P_n and P_{n-1} - P_n at 1 - v."""
    p, d = one, v * 0.0
    for k in range(n):
        d = (d * (k * 1.0) - v * p * (2.0 * k + 1.0)) * (1.0 / (k + 1.0))
        p = p + d
    return p, d * -1.0


@kernel
def nodes_kernel(v, weights, n):
    """Improve guesses of 1 - mu at the roots mu >= 0 of P_n, and write the weights of the rule on [-1, 1]."""
    for j in range(0, v.size, N):
        x = load(v, j)
        one = x * 0.0 + 1.0
        for _ in range(NEWTON_STEPS):
            p, back = _last_and_step(x, n, one)
            slope = (back + x * p) * (n * 1.0) / (x * (2.0 - x))  # dP/dmu = -dP/dv
            x = x + p / slope
        p, back = _last_and_step(x, n, one)
        before = p + back
        store(v, j, x)
        store(weights, j, 2.0 * x * (2.0 - x) / (before * before * (n * 1.0) * (n * 1.0)))


@kernel
def coefficients_kernel(out, v, even, odd, p, d):
    """Write sums over nodes of P_l(1 - v) times `even` for even l, times `odd` for odd l; p, d are scratch.

    Eight sums run side by side, whatever the lanes' width; sizes are multiples of 8.
    """
    for j in range(v.size):
        p[j], d[j] = 1.0, 0.0
    for degree in range(out.size):
        values = odd if degree % 2 else even
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
        for j in range(0, v.size, 8):
            s0 += values[j] * p[j]
            s1 += values[j + 1] * p[j + 1]
            s2 += values[j + 2] * p[j + 2]
            s3 += values[j + 3] * p[j + 3]
            s4 += values[j + 4] * p[j + 4]
            s5 += values[j + 5] * p[j + 5]
            s6 += values[j + 6] * p[j + 6]
            s7 += values[j + 7] * p[j + 7]
        out[degree] = ((s0 + s1) + (s2 + s3)) + ((s4 + s5) + (s6 + s7))
        low, high, share = degree * 1.0, 2.0 * degree + 1.0, degree + 1.0
        for j in range(v.size):
            d[j] = (low * d[j] - high * v[j] * p[j]) / share
            p[j] = p[j] + d[j]


@kernel
def sums_kernel(ahead, behind, v, terms):
    """Write the sum over l of terms[l] P_l(mu) at mu = 1 - v to `ahead`, at -mu to `behind`."""
    for j in range(0, v.size, N):
        x = load(v, j)
        p, d = x * 0.0 + 1.0, x * 0.0
        even, odd = d, d
        for k in range(0, terms.size, 2):
            even = even + p * terms[k]
            d = (d * (k * 1.0) - x * p * (2.0 * k + 1.0)) * (1.0 / (k + 1.0))
            p = p + d
            odd = odd + p * terms[k + 1]
            d = (d * (k + 1.0) - x * p * (2.0 * k + 3.0)) * (1.0 / (k + 2.0))
            p = p + d
        store(ahead, j, even + odd)
        store(behind, j, even - odd)
