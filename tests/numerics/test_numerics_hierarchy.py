"""The tree of boxes: everything is in it once, boxes hold what is below them, and a walk needs no stack."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from atmoref.numerics.hierarchy import LEAF, Hierarchy, hierarchy


def check(tree: Hierarchy, low: Any, high: Any) -> None:
    """Walk the tree as a ray does that meets every box."""
    count = len(low)
    assert sorted(tree.order.tolist()) == list(range(count))
    assert len(tree.boxes) == 2 * -(-count // LEAF) - 1
    seen: list[int] = []

    def walk(node: int) -> int:
        """Return the node after this one's part of the tree."""
        box = tree.boxes[node]
        if tree.number[node]:
            items = tree.order[tree.first[node] : tree.first[node] + tree.number[node]]
            seen.extend(items.tolist())
            np.testing.assert_array_equal(box, [*low[items].min(0), *high[items].max(0)])
            assert tree.skips[node] == node + 1
            return node + 1
        right = walk(node + 1)
        after = walk(right)
        children = tree.boxes[[node + 1, right]]
        np.testing.assert_array_equal(box, [*children[:, :3].min(0), *children[:, 3:].max(0)])
        assert tree.skips[node] == after
        return after

    assert walk(0) == len(tree.boxes)
    assert sorted(seen) == list(range(count))


@given(count=st.integers(1, 70), seed=st.integers(0, 99), flat=st.integers(0, 3))
def test_every_item_is_in_one_leaf_and_boxes_hold_their_children(count: int, seed: int, flat: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.normal(0.0, 10.0, (count, 3))
    low[:, :flat] = 3.0
    high = low + rng.exponential(1.0, (count, 3))
    check(hierarchy(low, high), low, high)


@pytest.mark.parametrize("count", [1, 4, 5, 4096, 5000])
def test_equal_items(count: int) -> None:
    low, high = np.zeros((count, 3)), np.ones((count, 3))
    check(hierarchy(low, high), low, high)


def test_neighbours_share_boxes() -> None:
    """Boxes of leaves on a grid are small: their areas add up to a few times the grid's own."""
    x, z = (a.ravel().astype(float) for a in np.meshgrid(np.arange(64), np.arange(64)))
    low = np.stack([x, 0.0 * x, z], -1)
    tree = hierarchy(low, low + [1.0, 0.0, 1.0])
    leaves = tree.boxes[tree.number > 0]
    assert ((leaves[:, 3] - leaves[:, 0]) * (leaves[:, 5] - leaves[:, 2])).sum() < 1.5 * 64 * 64
