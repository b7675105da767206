"""A tree of boxes around boxes, laid out so that it is walked without a stack.

Nodes stand in the order of a walk: a node's first child follows it, and `skips` says where to go on when it is missed.
Items are sorted along a Z-curve through their centres and halved; a leaf holds up to LEAF of them.  Integers and
comparisons decide alone, so that the tree is the same on every machine.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAF = 4
BITS = 10  # of each coordinate in a place on the curve


class Hierarchy(NamedTuple):
    """Boxes of nodes, in the order of a walk."""

    order: NDArray[np.int64]  # (items,): which item stands at each place of the leaves
    boxes: NDArray[np.float64]  # (nodes, 6): lower corner, upper corner
    skips: NDArray[np.int32]  # (nodes,): the next node when this one is missed
    first: NDArray[np.int32]  # (nodes,): place of its first item
    number: NDArray[np.int32]  # (nodes,): how many items; 0: it has children


def _spread(x: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return integers of BITS bits with two zeros before each bit."""
    x = (x | (x << 16)) & 0x030000FF
    x = (x | (x << 8)) & 0x0300F00F
    x = (x | (x << 4)) & 0x030C30C3
    return (x | (x << 2)) & 0x09249249


def hierarchy(low: NDArray[np.float64], high: NDArray[np.float64]) -> Hierarchy:
    """Return the tree of items with lower and upper corners (items, 3); at least one item."""
    centre = 0.5 * low + 0.5 * high
    least = centre.min(0)
    span = float(np.max(centre.max(0) - least))
    cells = np.minimum((centre - least) * ((1 << BITS) / span if span > 0.0 else 0.0), (1 << BITS) - 1).astype(np.int64)
    order = np.argsort(_spread(cells[:, 0]) << 2 | _spread(cells[:, 1]) << 1 | _spread(cells[:, 2]), kind="stable")
    starts = np.arange(0, len(order), LEAF)
    leaves = np.hstack([np.minimum.reduceat(low[order], starts), -np.maximum.reduceat(high[order], starts)])
    total = 2 * len(starts) - 1
    boxes, skips = np.empty((total, 6)), np.empty(total, np.int32)
    first, count = np.zeros(total, np.int32), np.zeros(total, np.int32)
    padded = np.vstack([leaves, np.full((1, 6), np.inf)])
    place, begin, held = np.zeros(1, np.int64), np.zeros(1, np.int64), np.array([len(starts)])
    while len(place):
        ranges = np.stack([begin, begin + held], -1).ravel()
        boxes[place] = np.minimum.reduceat(padded, ranges)[::2]
        skips[place] = place + 2 * held - 1
        single = held == 1
        first[place[single]] = starts[begin[single]]
        count[place[single]] = np.minimum(len(order) - starts[begin[single]], LEAF)
        place, begin, held = place[~single], begin[~single], held[~single]
        left = (held + 1) // 2
        place = np.stack([place + 1, place + 2 * left], -1).ravel()
        begin = np.stack([begin, begin + left], -1).ravel()
        held = np.stack([left, held - left], -1).ravel()
    boxes[:, 3:] *= -1.0
    return Hierarchy(order, boxes, skips, first, count)
