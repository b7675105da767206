# mypy: allow-untyped-defs, allow-untyped-calls
# (kernels: Numba infers their types)
"""A tree of boxes over the triangles of all meshes, for both truths.

Triangles are halved at the median of their centres along the longest axis until at most four are left. Nodes stand in
depth-first order and each knows where its subtree ends, so a walk needs no stack: on to the next node, or past the
subtree. The same triangles give the same tree on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import kernel, subroutine

__all__ = ["Mesh", "build_hierarchy"]

_LEAF = 4
_PAD = 1e-13  # of the greatest coordinate: boxes are this much larger, so that rounding cannot make a ray miss them
_STACK = 64


class Mesh(NamedTuple):
    """Triangles in the order of the tree's leaves, and the tree."""

    boxes: NDArray[np.float64]  # (N, 6) least and greatest corner
    tree: NDArray[np.int64]  # (N, 3) first triangle, last + 1 (equal for inner nodes), first node after the subtree
    triangles: NDArray[np.float64]  # (F, 12) three corners, albedo


@subroutine
def _select(key, axis, order, first, last, middle):
    """Reorder [first, last) so that nothing before ``middle`` is greater and nothing behind it is less (Hoare)."""
    low = first
    high = last - 1
    while low < high:
        pivot = key[order[(low + high) // 2], axis]
        i = low
        j = high
        while i <= j:
            while key[order[i], axis] < pivot:
                i += 1
            while pivot < key[order[j], axis]:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if j < middle:
            low = i
        if middle < i:
            high = j


@subroutine
def _longest_axis(key, order, first, last):
    axis = 0
    longest = -1.0
    for k in range(3):
        low = high = key[order[first], k]
        for i in range(first + 1, last):
            low = min(low, key[order[i], k])
            high = max(high, key[order[i], k])
        if high - low > longest:
            axis, longest = k, high - low
    return axis


@kernel
def _split_kernel(tree, order, centres, stack):
    """Fill ``tree`` but for its last column, and ``order``; return the number of nodes."""
    stack[0, 0], stack[0, 1] = 0, order.shape[0]
    height = 1
    n = 0
    while height > 0:
        height -= 1
        first, last = stack[height, 0], stack[height, 1]
        tree[n, 0], tree[n, 1] = first, first
        if last - first <= _LEAF:
            tree[n, 1] = last
        else:
            middle = (first + last) // 2
            _select(centres, _longest_axis(centres, order, first, last), order, first, last, middle)
            stack[height, 0], stack[height, 1] = middle, last
            stack[height + 1, 0], stack[height + 1, 1] = first, middle
            height += 2
        n += 1
    return n


@kernel
def _boxes_kernel(boxes, tree, triangles, pad):
    """Fill the boxes and the tree's last column from the last node to the first."""
    for node in range(tree.shape[0] - 1, -1, -1):
        first, last = tree[node, 0], tree[node, 1]
        if first < last:
            tree[node, 2] = node + 1
            for k in range(3):
                low = high = triangles[first, k]
                for i in range(first, last):
                    for corner in range(3):
                        low = min(low, triangles[i, 3 * corner + k])
                        high = max(high, triangles[i, 3 * corner + k])
                boxes[node, k] = low - pad
                boxes[node, 3 + k] = high + pad
        else:
            right = tree[node + 1, 2]
            tree[node, 2] = tree[right, 2]
            for k in range(3):
                boxes[node, k] = min(boxes[node + 1, k], boxes[right, k])
                boxes[node, 3 + k] = max(boxes[node + 1, 3 + k], boxes[right, 3 + k])


def build_hierarchy(
    meshes: Sequence[tuple[NDArray[np.float64], NDArray[np.int32], tuple[float, float, float]]],
) -> Mesh:
    """Return the triangles of some meshes in a tree.

    Parameters
    ----------
    meshes
        For each: corners (V, 3) in m, finite; faces (F, 3), indices of corners; albedo.

    Returns
    -------
    Mesh
        Empty arrays for no triangles. A million triangles take about a second.
    """
    parts = [np.zeros((0, 12))]
    for vertices, faces, albedo in meshes:
        corners = np.asarray(vertices, np.float64)[np.asarray(faces)].reshape(-1, 9)
        parts.append(np.hstack([corners, np.broadcast_to(np.array(albedo, np.float64), (len(corners), 3))]))
    table = np.concatenate(parts)
    if not len(table):
        return Mesh(np.zeros((0, 6)), np.zeros((0, 3), np.int64), table)
    centres = np.ascontiguousarray(table[:, 0:3] + table[:, 3:6] + table[:, 6:9])
    order = np.arange(len(table))
    tree = np.zeros((2 * len(table), 3), np.int64)
    tree = tree[: _split_kernel(tree, order, centres, np.zeros((_STACK, 2), np.int64))].copy()
    boxes = np.zeros((len(tree), 6))
    triangles = table[order]
    _boxes_kernel(boxes, tree, triangles, _PAD * float(np.abs(table[:, :9]).max()))
    return Mesh(boxes, tree, triangles)
