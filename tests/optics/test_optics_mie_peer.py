"""Mie scattering against miepython, another program, over its whole domain."""

from __future__ import annotations

import os

import numpy as np
import pytest

from atmoref.optics import mie

os.environ.setdefault("MIEPYTHON_USE_JIT", "1")  # read when it is imported
miepython = pytest.importorskip("miepython", reason="optional: miepython is not installed")

_RNG = np.random.default_rng(3)
CASES = [
    (
        complex(1.0 + 10.0 ** _RNG.uniform(-3.0, 0.3), k % 2 * 10.0 ** _RNG.uniform(-9.0, 1.0)),
        float(10.0 ** _RNG.uniform(-4.0, np.log10(15000.0))),
    )
    for k in range(40)
]


@pytest.mark.parametrize(("m", "x"), CASES)
def test_efficiencies_and_phase_function_agree_with_miepython(m, x):
    """Measured 2.3e-7 at worst, in dark directions: its amplitudes end at 2e-7 of their size, after Wiscombe."""
    ours = mie.efficiencies(m, x)
    theirs = miepython.efficiencies_mx(m.conjugate(), x)
    np.testing.assert_allclose((ours.extinction, ours.scattering, ours.backscatter, ours.asymmetry), theirs, rtol=1e-6)
    mu = np.cos(np.radians(np.linspace(0.0, 180.0, 37)))
    expected = miepython.i_unpolarized(m.conjugate(), x, mu, norm="one")
    np.testing.assert_allclose(mie.phase_function(m, x, mu), expected, rtol=1e-6)
