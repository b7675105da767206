"""Lane phase functions: the bits of the array form, in both precisions, with g lifted or plain."""

from __future__ import annotations

import numpy as np
import pytest

from atmoref._jit import kernel
from atmoref.lanes import Double, N, Single, lift, load, store
from atmoref.optics.lane_phase import lane_phase
from atmoref.optics.phase_functions import PHASE_FUNCTIONS, evaluate, phase_source


@kernel
def _lifted(arith, kind, g, mu, out):
    asymmetry = lift(arith, g)
    for i in range(0, mu.size, N):
        store(out, i, lane_phase(kind, asymmetry, load(mu, i)))


@kernel
def _plain(kind, g, mu, out):
    for i in range(0, mu.size, N):
        store(out, i, lane_phase(kind, g, load(mu, i)))


MU = np.linspace(-1.0, 1.0, 1024 - 1024 % N)


@pytest.mark.parametrize("g", [-0.95, 0.0, 0.3, 0.76, 0.95])
@pytest.mark.parametrize("name", list(PHASE_FUNCTIONS))
def test_float64_lanes_have_the_bits_of_the_array_form(name, g):
    out = np.empty_like(MU)
    _lifted(Double(), PHASE_FUNCTIONS[name], g, MU, out)
    np.testing.assert_array_equal(out, evaluate(PHASE_FUNCTIONS[name], g, MU))
    _plain(PHASE_FUNCTIONS[name], g, MU, out)
    np.testing.assert_array_equal(out, evaluate(PHASE_FUNCTIONS[name], g, MU))


@pytest.mark.parametrize("g", [-0.6, 0.3, 0.76])
@pytest.mark.parametrize("name", list(PHASE_FUNCTIONS))
def test_float32_lanes_have_the_bits_of_the_source_in_float32_and_are_near(name, g):
    mu = MU.astype(np.float32)
    out = np.empty_like(mu)
    _lifted(Single(), PHASE_FUNCTIONS[name], g, mu, out)
    same = phase_source(np.sqrt)(PHASE_FUNCTIONS[name], np.float32(g), mu)
    assert same.dtype == np.float32
    np.testing.assert_array_equal(out, same)
    exact = evaluate(PHASE_FUNCTIONS[name], float(np.float32(g)), mu.astype(np.float64))
    np.testing.assert_allclose(out, exact, rtol=2e-6)  # x^32 carries 32 half-ulps of 6e-8; measured 1.6e-6
