"""Kernels that read textures and blend in intervals, chosen at run time."""

import numpy as np

from atmoref._jit import kernel
from atmoref.buffers import blend, interval_blend, interval_sampler, sampler  # noqa: F401  (intervals register there)
from atmoref.lanes import Interval, N, load, store

EXACT = Interval(0.0, 0.0, 0.0)


@kernel
def blend_kernel(arith, rule, data, out, source, alpha, which):
    form = blend.Mixed()
    for i in range(0, source[0].size, N):
        d = blend.read(arith, data, i)
        s, a = load(source, i), load(alpha, i)
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
            d = blend.under(form, rule, d, s, a)
        elif which == 7:
            d = blend.encode(form, rule, s)
        else:
            d = blend.value(form, rule, d)
            store(out, i, d)
        blend.write(data, i, d)


@kernel
def sample_kernel(arith, tex, u, v, w, out, channel, which):
    for i in range(0, u[0].size, N):
        a, b, c = load(u, i), load(v, i), load(w, i)
        if which == 0:
            r = sampler.nearest(arith, tex, channel, a, b)
        elif which == 1:
            r = sampler.bilinear(arith, tex, channel, a, b)
        elif which == 2:
            r = sampler.bilinear3(arith, tex, a, b)[1]
        elif which == 3:
            r = sampler.trilinear(arith, tex, channel, a, b, c)
        else:
            r = sampler.shadow_compare(arith, tex, a, b, c)
        store(out, i, r)


def pairs(low, high):
    """Return both ends as float32, filled up to whole waves."""
    size = np.size(low)
    fill = lambda x: np.concatenate([np.ravel(x).astype(np.float32), np.full(-size % N, 0.5, np.float32)])
    return fill(low), fill(high)
