"""The pair of rules that the quadrature integrates and judges itself with: Gauss-Legendre 10 inside Kronrod 21.

Nodes and weights are those of QUADPACK (Piessens et al. 1983, routine QK21), printed there to 33 digits; the tests
show that they integrate polynomials up to degree 19 and 31 exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["GAUSS_KRONROD_21", "Rule", "gauss_legendre"]


class Rule(NamedTuple):
    """Nodes on [-1, 1] and two sets of weights: ``fine`` gives the value, ``fine - coarse`` the error estimate."""

    nodes: NDArray[np.float64]
    fine: NDArray[np.float64]
    coarse: NDArray[np.float64]


_NODES = (
    0.995657163025808080735527280689003,
    0.973906528517171720077964012084452,
    0.930157491355708226001207180059508,
    0.865063366688984510732096688423493,
    0.780817726586416897063717578345042,
    0.679409568299024406234327365114874,
    0.562757134668604683339000099272694,
    0.433395394129247190799265943165784,
    0.294392862701460198131126603103866,
    0.148874338981631210884826001129720,
    0.0,
)
_FINE = (
    0.011694638867371874278064396062192,
    0.032558162307964727478818972459390,
    0.054755896574351996031381300244580,
    0.075039674810919952767043140916190,
    0.093125454583697605535065465083366,
    0.109387158802297641899210590325805,
    0.123491976262065851077958109831074,
    0.134709217311473325928054001771707,
    0.142775938577060080797094273138717,
    0.147739104901338491374841515972068,
    0.149445554002916905664936468389821,
)
_COARSE = (
    0.0,
    0.066671344308688137593568809893332,
    0.0,
    0.149451349150580593145776339657697,
    0.0,
    0.219086362515982043995534934228163,
    0.0,
    0.269266719309996355091226921569469,
    0.0,
    0.295524224714752870173892994651338,
    0.0,
)


def _mirrored(half: tuple[float, ...], sign: float) -> NDArray[np.float64]:
    return np.array([*half, *(sign * x for x in reversed(half[:-1]))])


GAUSS_KRONROD_21 = Rule(_mirrored(_NODES, -1.0), _mirrored(_FINE, 1.0), _mirrored(_COARSE, 1.0))


def gauss_legendre(n: int) -> Rule:
    """Return the n-node Gauss-Legendre rule for cross-checks; ``coarse`` equals ``fine``, so it estimates no error."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return Rule(nodes, weights, weights.copy())
