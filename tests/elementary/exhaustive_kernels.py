"""Kernels that walk through all float32 values: error against the float64 form, and steps in the wrong direction."""

import numpy as np

from atmoref._jit import device, kernel
from atmoref.lanes import (
    Double,
    N,
    absolute,
    exp,
    exponent,
    lift,
    load,
    log,
    maximum,
    power_of_two,
    select,
    store,
)

CHUNK = 1 << 20


@device
def _ulps(single, double):
    """Return the distance of a float32 from a float64 in float32's units in the last place, 0 outside its range."""
    size = absolute(double)
    e = maximum(exponent(maximum(size, 1e-300)), -126)
    error = absolute(lift(Double(), single) - double) * power_of_two(double, 23 - e)
    return select(size <= 3.4028234663852886e38, error, 0.0)


@kernel
def worst_exp(values, work, lanes):
    """Write the worst errors of exp over ascending values; return how many neighbours descend."""
    worst = lift(Double(), 0.0)
    for i in range(0, values.size, N):
        x = load(values, i)
        y = exp(x)
        store(work, i, y)
        worst = maximum(_ulps(y, exp(lift(Double(), x))), worst)
    store(lanes, 0, worst)
    return _descents(work)


@kernel
def worst_log(values, work, lanes):
    """Write the worst errors of log over positive ascending values; return how many neighbours descend."""
    worst = lift(Double(), 0.0)
    for i in range(0, values.size, N):
        x = load(values, i)
        y = log(x)
        store(work, i, y)
        worst = maximum(_ulps(y, log(lift(Double(), x))), worst)
    store(lanes, 0, worst)
    return _descents(work)


@device
def _descents(values):
    count = 0
    for i in range(1, values.size):
        count += values[i] < values[i - 1]
    return count


def walk(function, first: float, last: float) -> tuple[float, int]:
    """Run over all float32 from first to last (of one sign, |first| < |last|)."""
    bits = [int(np.float32(v).view(np.uint32)) for v in (first, last)]
    worst, descents = 0.0, 0
    work, lanes = np.empty(CHUNK, np.float32), np.empty(N, np.float64)
    for start in range(bits[0], bits[1], CHUNK - N):
        values = np.minimum(np.arange(start, start + CHUNK, dtype=np.int64), bits[1]).astype(np.uint32).view(np.float32)
        if last < 0:
            values = values[::-1].copy()
        descents += function(values, work, lanes)
        worst = max(worst, float(lanes.max()))
    return worst, descents
