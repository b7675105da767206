"""Philox4x32-10 against its published answers, and the uniforms made from it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from atmoref._jit import kernel
from atmoref.transport.random_numbers import philox4x32, uniform, uniform_pair

# Rows "philox4x32 10" of tests/kat_vectors of Random123 1.14.0: counter, key, answer.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


@kernel
def _words(counter, key):
    return philox4x32(counter, key)


@kernel
def _uniform(high, low):
    return uniform(high, low)


@kernel
def _fill(out, key, pixel, dimension):
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1] = uniform_pair(key, pixel, i, dimension)


def _parse(text: str) -> tuple[np.uint64, ...]:
    return tuple(np.uint64(int(word, 16)) for word in text.split())


def _pairs(n: int, key: tuple[int, int] = (7, 0), pixel: int = 0, dimension: int = 0) -> np.ndarray:
    out = np.empty((n, 2))
    _fill(out, (np.uint64(key[0]), np.uint64(key[1])), pixel, dimension)
    return out


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_known_answers(counter, key, answer):
    assert _words(_parse(counter), _parse(key)) == _parse(answer)


def test_uniforms_span_the_unit_interval_without_one():
    top = np.uint64(0xFFFFFFFF)
    assert _uniform(np.uint64(0), np.uint64(0)) == 0.0
    assert _uniform(top, top) == 1.0 - 2.0**-53
    assert _uniform(np.uint64(0x80000000), np.uint64(0)) == 0.5
    assert _uniform(np.uint64(0), np.uint64(64)) == 2.0**-53


def test_uniforms_are_uniform_and_independent():
    x = _pairs(20000)
    assert stats.kstest(x[:, 0], "uniform").pvalue > 1e-3
    assert stats.kstest(x[:, 1], "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(x.T)[0, 1]) < 4.0 / np.sqrt(len(x))
    assert abs(np.corrcoef(x[:-1, 0], x[1:, 0])[0, 1]) < 4.0 / np.sqrt(len(x))


def test_every_part_of_the_address_counts():
    first = _pairs(8)
    for other in (_pairs(8, key=(8, 0)), _pairs(8, key=(7, 1)), _pairs(8, pixel=1), _pairs(8, dimension=1)):
        assert not np.isin(other, first).any()
    np.testing.assert_array_equal(_pairs(8), first)
