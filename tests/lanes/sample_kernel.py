"""Run by the tests in processes of their own: print a hash of a kernel's results, and what the kernel cache did."""

import hashlib
import json
import sys

import numpy as np

from atmoref._jit import CACHE_DIRECTORY, kernel
from atmoref.lanes import (
    Double,
    N,
    Single,
    add_to_exact,
    any_lane,
    atan2,
    cos,
    exp,
    floor,
    fma,
    gather,
    gather_near,
    gather_pair,
    gather_pair_near,
    lift,
    load,
    log,
    maximum,
    minimum,
    pixels,
    rint,
    round_int,
    saturate,
    select,
    sin,
    sqrt,
    store,
    tan,
    to_int,
)

SIZE = 1 << 14


@kernel
def everything(arith, x, table, codes, out):
    """Use each kind of operation; masks skip, as kernels do."""
    n = x.size
    for i in range(0, n, N):
        a = load(x, i)
        b = saturate(a * 0.01 + 0.5) * (table.size - 2.0)
        low, high = gather_pair(table, to_int(b))
        low, high = low + gather_near(table, to_int(b)), high + gather_pair_near(table, to_int(b))[1]
        high = add_to_exact(rint(b), 0.25, high)
        c = low + (high - low) * (b - floor(b))
        c = fma(c, a, lift(arith, gather(codes, round_int(b)))) / (a - 0.3)
        if any_lane(a > 90.0):
            c = select(a > 90.0, rint(c), c)
        d = maximum(minimum(sqrt(c) + exp(a) * log(c), 1e30), -1e30)
        e = sin(a) - cos(c) * tan(pixels(arith, i)) + atan2(c, a)
        for k, row in enumerate((c, d, e)):
            store(out, k * n + i, select(row == row, row, 0.0))  # NaN's sign and payload are not defined


@kernel
def small(x, out):
    """Compile quickly: write saturated values, then pixel centres."""
    for i in range(0, x.size, N):
        store(out, i, saturate(load(x, i)))
        store(out, x.size + i, pixels(Single(), i))


def results() -> str:
    """Return the SHA-256 of all results in both arithmetics."""
    digest = hashlib.sha256()
    for arith, kind in ((Single(), np.float32), (Double(), np.float64)):
        rng = np.random.default_rng(42)
        x, table = rng.uniform(-110, 110, SIZE).astype(kind), rng.uniform(0, 4, 257).astype(kind)
        out = np.empty(3 * SIZE, kind)
        everything(arith, x, table, np.arange(257, dtype=np.uint16), out)
        digest.update(out.tobytes())
    return digest.hexdigest()


def main(what: str) -> None:
    """Print a JSON object with the lane width, results, and cache hits and misses."""
    if what == "everything":
        value: object = results()
        used = everything
    else:
        out = np.empty((2, 32), np.float32)
        small(np.linspace(0, 2, 32, dtype=np.float32), out.ravel())
        value = out.sum(1).tolist()
        used = small
    hits, misses = (sum(c.values()) for c in (used.stats.cache_hits, used.stats.cache_misses))
    print(json.dumps({"lanes": N, "value": value, "hits": hits, "misses": misses, "directory": str(CACHE_DIRECTORY)}))


if __name__ == "__main__":
    main(sys.argv[1])
