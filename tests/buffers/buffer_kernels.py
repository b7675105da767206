"""Kernels that apply one lane function to arrays, chosen at run time, and NumPy-level callers of them."""

import numpy as np

from atmoref._jit import kernel
from atmoref.buffers import blend, sampler
from atmoref.lanes import Double, N, Single, lift, load, store

FUNCTIONS = ("add", "over", "over_premultiplied", "add_alpha", "modulate", "modulate_inverse", "under")
ENCODE, VALUE = 7, 8
ARITHMETICS = {"float32": Single(), "float64": Double()}


@kernel
def blend_kernel(arith, form, rule, data, out, source, alpha, which):
    for i in range(0, data.size, N):
        d = blend.read(arith, data, i)
        s, a = lift(arith, load(source, i)), lift(arith, load(alpha, i))
        if which == 0:
            d = blend.add(form, rule, d, s)
        elif which == 1:
            d = blend.over(form, rule, d, s, a)
        elif which == 2:
            d = blend.over_premultiplied(form, rule, d, s, a)
        elif which == 3:
            d = blend.add_alpha(form, rule, d, s, a)
        elif which == 4:
            d = blend.modulate(form, rule, d, s)
        elif which == 5:
            d = blend.modulate_inverse(form, rule, d, a)
        elif which == 6:
            d = blend.under(form, rule, d, s, a)  # here alpha is the destination's, as stored
        elif which == ENCODE:
            d = blend.encode(form, rule, s)
        else:
            store(out, i, blend.value(form, rule, d))
        blend.write(data, i, d)


def _fill(x, dtype):
    flat = np.ravel(np.asarray(x)).astype(dtype)
    return np.concatenate([flat, np.zeros(-flat.size % N, dtype)])


def run(which, arithmetic, form, rule, stored, source, alpha=0.0):
    """Return what the buffer holds after one draw, or values; a flat array of the buffer's type."""
    real = np.dtype(arithmetic)
    data = _fill(stored, np.uint16 if isinstance(form, blend.Unorm) else real)
    size = np.size(stored)
    s, a = (_fill(np.broadcast_to(x, np.shape(stored)), real) for x in (source, alpha))
    out = np.zeros(data.size, real)
    code = FUNCTIONS.index(which) if isinstance(which, str) else which
    blend_kernel(ARITHMETICS[arithmetic], form, rule, data, out, s, a, code)
    return out[:size] if code == VALUE else data[:size]


@kernel
def sample_kernel(arith, tex, u, v, w, out, channel, which):
    n = u.size
    for i in range(0, n, N):
        x, y, z = lift(arith, load(u, i)), lift(arith, load(v, i)), lift(arith, load(w, i))
        if which == 0:
            store(out, i, sampler.nearest(arith, tex, channel, x, y))
        elif which == 1:
            store(out, i, sampler.bilinear(arith, tex, channel, x, y))
        elif which == 2:
            r, g, b = sampler.bilinear3(arith, tex, x, y)
            store(out, i, r)
            store(out, i + n, g)
            store(out, i + 2 * n, b)
        elif which == 3:
            store(out, i, sampler.trilinear(arith, tex, channel, x, y, z))
        elif which == 4:
            store(out, i, sampler.shadow_compare(arith, tex, x, y, z))
        else:
            x, y = sampler.project(x, y, z)
            store(out, i, x)
            store(out, i + n, y)


SAMPLERS = ("nearest", "bilinear", "bilinear3", "trilinear", "shadow_compare", "project")


def sample(which, arithmetic, tex, u, v, w=None, channel=0):
    """Return one sampler's results; (3, n) of bilinear3, (2, n) of project."""
    real = np.dtype(arithmetic)
    u, v, w = (_fill(x, real) for x in (u, v, u if w is None else w))
    out = np.zeros(3 * u.size, real)
    sample_kernel(ARITHMETICS[arithmetic], tex, u, v, w, out, channel, SAMPLERS.index(which))
    rows = {"bilinear3": 3, "project": 2}.get(which, 1)
    return out.reshape(3, -1)[:rows] if rows > 1 else out[: u.size]
