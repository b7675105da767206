# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Counter-based random numbers: Philox4x32-10.

A number is a pure function of (key, counter), so it depends on which pixel, sample and light asks for it, and not on
threads or order. Nothing has state.

Source: Salmon, Moraes, Dror and Shaw 2011; constants as in their library Random123, whose known answers are a test.
"""

from __future__ import annotations

import numpy as np

from atmoref._jit import subroutine

__all__ = ["philox4x32", "uniform", "uniform_pair"]

_MULTIPLIER_0 = np.uint64(0xD2511F53)
_MULTIPLIER_1 = np.uint64(0xCD9E8D57)
_WEYL_0 = np.uint64(0x9E3779B9)
_WEYL_1 = np.uint64(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(32)
_ROUNDS = 10
_FIVE = np.uint64(5)
_SIX = np.uint64(6)
_TWO_26 = 67108864.0
_TWO_MINUS_53 = 1.0 / 9007199254740992.0


@subroutine
def philox4x32(counter, key):
    """Return four random 32-bit words for a counter of four words and a key of two.

    Words travel in uint64 so that products are exact; only their low 32 bits are read and set.
    """
    c0 = np.uint64(counter[0]) & _LOW
    c1 = np.uint64(counter[1]) & _LOW
    c2 = np.uint64(counter[2]) & _LOW
    c3 = np.uint64(counter[3]) & _LOW
    k0 = np.uint64(key[0]) & _LOW
    k1 = np.uint64(key[1]) & _LOW
    for _ in range(_ROUNDS):
        product_0 = _MULTIPLIER_0 * c0
        product_1 = _MULTIPLIER_1 * c2
        c0 = (product_1 >> _SHIFT) ^ c1 ^ k0
        c1 = product_1 & _LOW
        c2 = (product_0 >> _SHIFT) ^ c3 ^ k1
        c3 = product_0 & _LOW
        k0 = (k0 + _WEYL_0) & _LOW
        k1 = (k1 + _WEYL_1) & _LOW
    return c0, c1, c2, c3


@subroutine
def uniform(high, low):
    """Return a float64 in [0, 1), a multiple of 2^-53, from two 32-bit words (the upper 27 and 26 bits of them)."""
    return (np.float64(high >> _FIVE) * _TWO_26 + np.float64(low >> _SIX)) * _TWO_MINUS_53


@subroutine
def uniform_pair(key, pixel, sample, dimension):
    """Return two independent uniforms in [0, 1) for this pixel, sample and dimension (e.g. light) under the key."""
    w0, w1, w2, w3 = philox4x32((pixel, sample, dimension, 0), key)
    return uniform(w0, w1), uniform(w2, w3)
