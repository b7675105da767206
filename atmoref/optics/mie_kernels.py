# mypy: allow-untyped-defs, allow-untyped-calls
# (kernel code is typed by Numba)
"""Kernels of Mie scattering: coefficients a_n, b_n of spheres, and their angular sums.

Coefficients.  With psi_n, chi_n the Riccati-Bessel functions of x, r_n(z) = psi_n(z) / psi_{n-1}(z), and

    N_a = psi_{n+1} + g_a psi_n,  M_a = chi_{n+1} + g_a chi_n,  g_a = (n+1)/x (1/m^2 - 1) - r_{n+1}(mx) / m,
    N_b = psi_{n+1} + g_b psi_n,  M_b = chi_{n+1} + g_b chi_n,  g_b = -m r_{n+1}(mx),

a_n = N_a / (N_a - i M_a), and b_n likewise.  This is [Bohren1983] eq. (4.88) with the logarithmic derivative
D_n(z) = (n+1)/z - r_{n+1}(z) put in; what cancels there for small x or nearly transparent spheres is gone by algebra.
By the Wronskian Re a_n = (|N|^2 - Im g) / |N - i M|^2 and Re a_n - |a_n|^2 = -Im g / |N - i M|^2: sums of positive
terms, so extinction and absorption keep their digits for x -> 0, where a_n is of order x^3 and no series is needed.

r_n(mx) comes from its downward recurrence r_n = 1 / ((2n+1)/z - r_{n+1}), psi_n from the upward one while n <= x, and
from r_n(x) beyond, where the upward one loses digits; chi_n from the upward one.

Angular sums.  pi_n and tau_n by Wiscombe's form of the recurrence.  A pair of angles mu, -mu shares them, since
pi_n(-mu) = (-1)^(n+1) pi_n(mu) and tau_n(-mu) = (-1)^n tau_n(mu).  Lanes run over angles; each angle's sums are in one
fixed order, whatever the width, the number of threads or the batches.
"""

from typing import Any, NamedTuple

from atmoref._jit import device, kernel, subroutine
from atmoref.lanes import N, load, store

A_RE, A_IM, B_RE, B_IM = 0, 1, 2, 3  # rows of a sphere's coefficients
SCATTERED, ABSORBED, FORWARD, BACKWARD = 0, 1, 2, 3  # columns of a sphere's efficiencies


class Sums(NamedTuple):
    """Even and odd parts in mu of the amplitudes: S1(+-mu) = u +- v, S2(+-mu) = p +- q."""

    u_re: Any
    u_im: Any
    v_re: Any
    v_im: Any
    p_re: Any
    p_im: Any
    q_re: Any
    q_im: Any


@subroutine
def _ratios(re, im, z_re, z_im, start, last):
    """Write r_n(z) for n = 1...last, from r = 0 at `start`."""
    square = z_re * z_re + z_im * z_im
    step_re, step_im = z_re / square, -z_im / square
    r_re, r_im = 0.0, 0.0
    for n in range(start, 0, -1):
        d_re = (2.0 * n + 1.0) * step_re - r_re
        d_im = (2.0 * n + 1.0) * step_im - r_im
        size = d_re * d_re + d_im * d_im
        if size == 0.0:  # psi_{n-1}(z) is 0 to the last bit: any large ratio does
            d_re, size = 1e-150, 1e-300
        r_re, r_im = d_re / size, -d_im / size
        if n <= last:
            re[n], im[n] = r_re, r_im


@subroutine
def _coefficient(psi, psi_up, chi, chi_up, g_re, g_im):
    """Return real part, imaginary part and absorbed part Re a - |a|^2 of one coefficient."""
    n_re, n_im = psi_up + g_re * psi, g_im * psi
    m_re, m_im = chi_up + g_re * chi, g_im * chi
    d_re, d_im = n_re + m_im, n_im - m_re
    size = d_re * d_re + d_im * d_im
    return (n_re * n_re + n_im * n_im - g_im) / size, (n_re * m_re + n_im * m_im) / size, -g_im / size


@subroutine
def _one_sphere(out, sums, m_re, m_im, x, sine, cosine, last, start_z, start_x, work):
    """Write one sphere's coefficients (4, n) and its sums over n."""
    _ratios(work[0], work[1], m_re * x, m_im * x, start_z, last + 1)
    _ratios(work[2], work[3], x, 0.0, start_x, last + 1)
    square = m_re * m_re + m_im * m_im
    inverse_re, inverse_im = m_re / square, -m_im / square  # 1/m
    # 1/m^2 - 1 = (1 - m)(1 + m) / m^2
    top_re, top_im = (1.0 - m_re) * (1.0 + m_re) + m_im * m_im, -2.0 * m_re * m_im
    bottom_re, bottom_im = inverse_re * inverse_re - inverse_im * inverse_im, 2.0 * inverse_re * inverse_im
    c_re, c_im = top_re * bottom_re - top_im * bottom_im, top_re * bottom_im + top_im * bottom_re
    psi_low, psi = cosine, sine
    chi_low, chi = -sine, cosine
    scattered, absorbed, forward, back_re, back_im, sign = 0.0, 0.0, 0.0, 0.0, 0.0, -1.0
    a_re, a_im, b_re, b_im = 0.0, 0.0, 0.0, 0.0
    for n in range(last + 2):
        if n >= 1:  # psi, chi are of order n; psi_low, chi_low of order n - 1
            k = n - 1
            before_a_re, before_a_im, before_b_re, before_b_im = a_re, a_im, b_re, b_im
            if k >= 1:
                r_re, r_im = work[0, n], work[1, n]
                g_re = (k + 1.0) / x * c_re - (r_re * inverse_re - r_im * inverse_im)
                g_im = (k + 1.0) / x * c_im - (r_re * inverse_im + r_im * inverse_re)
                a_re, a_im, lost_a = _coefficient(psi_low, psi, chi_low, chi, g_re, g_im)
                g_re, g_im = m_im * r_im - m_re * r_re, -(m_re * r_im + m_im * r_re)
                b_re, b_im, lost_b = _coefficient(psi_low, psi, chi_low, chi, g_re, g_im)
                out[A_RE, k], out[A_IM, k], out[B_RE, k], out[B_IM, k] = a_re, a_im, b_re, b_im
                share = 2.0 * k + 1.0
                scattered += share * (a_re * a_re + a_im * a_im + b_re * b_re + b_im * b_im)
                absorbed += share * (lost_a + lost_b)
                forward += share / (k * (k + 1.0)) * (a_re * b_re + a_im * b_im)
                both = a_re * before_a_re + a_im * before_a_im + b_re * before_b_re + b_im * before_b_im
                forward += (k - 1.0) * (k + 1.0) / k * both
                back_re += sign * share * (a_re - b_re)
                back_im += sign * share * (a_im - b_im)
                sign = -sign
        psi_up = (2.0 * n + 1.0) / x * psi - psi_low if n + 1.0 <= x else psi * work[2, min(n + 1, last + 1)]
        psi_low, psi = psi, psi_up
        chi_low, chi = chi, (2.0 * n + 1.0) / x * chi - chi_low
    scale = 2.0 / (x * x)
    sums[SCATTERED], sums[ABSORBED], sums[FORWARD] = scale * scattered, scale * absorbed, 2.0 * scale * forward
    sums[BACKWARD] = 0.5 * scale * (back_re * back_re + back_im * back_im)


@kernel
def coefficients_kernel(out, sums, m_re, m_im, x, sine, cosine, last, start_z, start_x, work):
    """Write coefficients (spheres, 4, n) and sums (spheres, 4): scattered, absorbed, scattered times g, backward."""
    for i in range(x.size):
        _one_sphere(out[i], sums[i], m_re, m_im, x[i], sine[i], cosine[i], last[i], start_z[i], start_x[i], work)


@device
def _angular_sums(mu, c, last):
    """Return the amplitudes' parts at lanes of mu >= 0; c holds a_n, b_n times (2n+1)/(n(n+1)), zero beyond `last`."""
    low, now = mu * 0.0, mu * 0.0 + 1.0  # pi_{n-1}, pi_n
    u_re = u_im = v_re = v_im = p_re = p_im = q_re = q_im = low
    for n in range(1, last + 1, 2):
        s = mu * now
        t = s - low
        tau = t * (n * 1.0) - low
        u_re, u_im = u_re + now * c[A_RE, n], u_im + now * c[A_IM, n]
        v_re, v_im = v_re + tau * c[B_RE, n], v_im + tau * c[B_IM, n]
        p_re, p_im = p_re + now * c[B_RE, n], p_im + now * c[B_IM, n]
        q_re, q_im = q_re + tau * c[A_RE, n], q_im + tau * c[A_IM, n]
        low, now = now, s + t * ((n + 1.0) / n)
        k = n + 1
        s = mu * now
        t = s - low
        tau = t * (k * 1.0) - low
        v_re, v_im = v_re + now * c[A_RE, k], v_im + now * c[A_IM, k]
        u_re, u_im = u_re + tau * c[B_RE, k], u_im + tau * c[B_IM, k]
        q_re, q_im = q_re + now * c[B_RE, k], q_im + now * c[B_IM, k]
        p_re, p_im = p_re + tau * c[A_RE, k], p_im + tau * c[A_IM, k]
        low, now = now, s + t * ((k + 1.0) / k)
    return Sums(u_re, u_im, v_re, v_im, p_re, p_im, q_re, q_im)


@device
def _squares(a, b, c, d):
    return a * a + b * b + (c * c + d * d)


@kernel
def intensities_kernel(ahead, behind, mu, c, last, weights, first, end):
    """Add weighted |S1|^2 + |S2|^2 of all spheres at mu[first:end] to `ahead`, at -mu to `behind`."""
    for j in range(first, end, N):
        x = load(mu, j)
        plus, minus = load(ahead, j), load(behind, j)
        for i in range(last.size):
            s = _angular_sums(x, c[i], last[i])
            plus = plus + weights[i] * _squares(s.u_re + s.v_re, s.u_im + s.v_im, s.p_re + s.q_re, s.p_im + s.q_im)
            minus = minus + weights[i] * _squares(s.u_re - s.v_re, s.u_im - s.v_im, s.p_re - s.q_re, s.p_im - s.q_im)
        store(ahead, j, plus)
        store(behind, j, minus)


@kernel
def amplitudes_kernel(out, mu, c, last, first, end):
    """Write Re S1, Im S1, Re S2, Im S2 of one sphere at mu[first:end] and, in rows 4 to 7, at -mu."""
    for j in range(first, end, N):
        s = _angular_sums(load(mu, j), c, last)
        store(out[0], j, s.u_re + s.v_re)
        store(out[1], j, s.u_im + s.v_im)
        store(out[2], j, s.p_re + s.q_re)
        store(out[3], j, s.p_im + s.q_im)
        store(out[4], j, s.u_re - s.v_re)
        store(out[5], j, s.u_im - s.v_im)
        store(out[6], j, s.p_re - s.q_re)
        store(out[7], j, s.p_im - s.q_im)
