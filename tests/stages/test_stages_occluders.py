"""Exact visibility of triangles against a test of every segment with every triangle."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from occluder_kernel import no_solids, shaded, shaded_in_parallel
from triangle_pictures import cast, soup, triangle_set

from atmoref.stages.ray_cast import SELF
from atmoref.techniques.triangle_passes import TriangleSet, axes, with_occluders, with_parallel_occluders

BOTH = pytest.mark.parametrize("dtype", [np.float32, np.float64])
MARGIN = {np.float32: 1e-4, np.float64: 1e-12}


def brute(triangles: TriangleSet, origin: Any, segments: Any) -> tuple[Any, Any]:
    """Return which segments are cut, and of which rounding cannot decide it."""
    starts = np.broadcast_to(np.array(origin), segments.shape)[None]
    cut = np.zeros(len(segments), bool)
    sure = np.ones(len(segments), bool)
    for i in range(triangles.count):
        one = dataclasses.replace(triangles, faces=triangles.faces[i : i + 1])
        t, hit, margin = (a[0] for a in cast(one, starts, segments[None]))
        cut |= (hit >= 0) & (t < 1.0)
        sure &= (margin > 1e-4) & ((hit < 0) | (np.abs(t - 1.0) > 1e-4))
    return cut, sure


@BOTH
@pytest.mark.parametrize("seed", range(4))
def test_segments_are_cut_where_every_triangle_is_tried(seed: int, dtype: Any) -> None:
    triangles, origin = soup(seed, 90, through=True), (0.3, -0.2, 0.1)
    rng = np.random.default_rng(seed + 50)
    segments = rng.normal(0.0, 3.0, (800, 3))
    segments[:60, rng.integers(0, 3, 60)] = 0.0
    segments[:20] = np.where(rng.random((20, 3)) < 0.6, 0.0, segments[:20])
    cut, sure = brute(triangles, origin, segments)
    found = shaded(with_occluders(no_solids(), triangles, origin, dtype), segments, dtype)
    assert sure.mean() > 0.9
    assert 0.1 < cut.mean() < 0.95
    assert (found == cut)[sure].all()


@BOTH
def test_no_light_leaks_through_a_wall(dtype: Any) -> None:
    """A wall of many small triangles, aimed at through corners, along edges and anywhere."""
    n = 33
    x, y = np.meshgrid(np.linspace(-3.0, 3.0, n), np.linspace(-3.0, 3.0, n))
    at = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([at, at + n, at + n + 1], -1), np.stack([at, at + n + 1, at + 1], -1)])
    faces = np.random.default_rng(1).permuted(faces, axis=1)
    wall = triangle_set(np.stack([x, y, 0.0 * x + 2.0], -1), faces)
    inner = np.stack([x, y, 0.0 * x + 2.0], -1)[1:-1, 1:-1].reshape(-1, 3)
    rng = np.random.default_rng(2)
    anywhere = rng.uniform(-2.8, 2.8, (2000, 3)) * [1.0, 1.0, 0.0] + [0.0, 0.0, 2.0]
    aims = np.concatenate([inner, 0.5 * (inner + np.roll(inner, 1, 0)), anywhere])
    aims = aims[np.abs(aims).max(1) < 2.9]
    solids = with_occluders(no_solids(), wall, (0.0, 0.0, 0.0), dtype)
    assert shaded(solids, aims * 1.01, dtype).all()
    assert not shaded(solids, aims * 0.99, dtype).any()
    assert not shaded(solids, -aims * 3.0, dtype).any()


@BOTH
def test_a_mesh_does_not_shade_its_own_points_at_once(dtype: Any) -> None:
    """Points of the mesh itself are lit over the last part of the way; farther ones are shaded by it."""
    floor = triangle_set([(-9.0, -1.0, -9.0), (9.0, -1.0, -9.0), (0.0, -1.0, 9.0)], [(0, 1, 2)])
    solids = with_occluders(no_solids(), floor, (0.0, 0.0, 0.0), dtype)
    points = np.random.default_rng(4).uniform(-2.0, 2.0, (500, 3)) * [1.0, 0.0, 1.0] - [0.0, 1.0, 0.0]
    for factor in (1.0, 1.0 + 0.9 * SELF, 1.0 - 0.9 * SELF):
        assert not shaded(solids, points * factor, dtype, own=0).any()
    assert shaded(solids, points * (1.0 + 2.0 * SELF), dtype, own=0).all()
    assert shaded(solids, points * (1.0 + 0.1 * SELF), dtype, own=1).all()


def test_edge_on_triangles_shade_nothing() -> None:
    thin = triangle_set([(0.0, -1.0, 2.0), (0.0, 1.0, 2.0), (0.0, 0.0, 4.0)], [(0, 1, 2)])
    solids = with_occluders(no_solids(), thin, (0.0, 0.0, 0.0), np.float32)
    segments = np.random.default_rng(3).normal(0.0, 5.0, (1000, 3)) * [0.0, 1.0, 1.0]
    assert not shaded(solids, segments, np.float32).any()


ORIGIN, RIGHT, UP, AXIS = (0.3, -0.2, 0.1), (2.0, 0.5, 0.0), (-0.3, 1.5, 0.4), (0.6, 0.0, 0.8)  # skew, of several sizes
LIGHT = axes(ORIGIN, RIGHT, UP, AXIS)


def in_world(points: Any) -> Any:
    """Return points of the light's axes in the world."""
    return np.array(ORIGIN) + points @ np.array([RIGHT, UP, AXIS])


@BOTH
@pytest.mark.parametrize("seed", range(4))
def test_parallel_light_is_cut_where_every_triangle_is_tried(seed: int, dtype: Any) -> None:
    """From the plane w = 0 (a window), and from beyond everything."""
    triangles = soup(seed, 24, through=True)
    points = np.random.default_rng(seed + 90).uniform(-1.0, 1.0, (800, 3)) * [1.5, 1.5, 6.0]
    for least_w in (0.0, -1e9):
        points[:, 2] = np.abs(points[:, 2]) if least_w == 0.0 else points[:, 2]
        far = -20.0 if least_w < 0.0 else 0.0  # nothing of the soup lies before it
        starts = in_world(points * [1.0, 1.0, 0.0] + [0.0, 0.0, far])
        cut, sure = np.zeros(len(points), bool), np.ones(len(points), bool)
        for i in range(triangles.count):
            one = dataclasses.replace(triangles, faces=triangles.faces[i : i + 1])
            t, hit, margin = (a[0] for a in cast(one, starts[None], (in_world(points) - starts)[None]))
            cut |= (hit >= 0) & (t < 1.0)
            sure &= (margin > 1e-4) & ((hit < 0) | (np.abs(t - 1.0) > 1e-4)) & ((hit < 0) | (t > 1e-4))
        found = shaded_in_parallel(
            with_parallel_occluders(no_solids(), triangles, LIGHT, dtype), points, dtype, least_w
        )
        assert sure.mean() > 0.85
        assert 0.1 < cut.mean() < 0.97
        assert (found == cut)[sure].all()


@BOTH
def test_no_sunlight_leaks_through_a_wall(dtype: Any) -> None:
    """A skew wall of many small triangles, aimed at through corners, along edges, anywhere; its own points are lit."""
    n = 33
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, n), np.linspace(-1.0, 1.0, n))
    at = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([at, at + n, at + n + 1], -1), np.stack([at, at + n + 1, at + 1], -1)])
    corners = np.stack([x, y, 5.0 + 0.4 * x - 0.7 * y], -1).reshape(-1, 3)
    wall = triangle_set(in_world(corners), np.random.default_rng(1).permuted(faces, axis=1))
    solids = with_parallel_occluders(no_solids(), wall, LIGHT, dtype)
    anywhere = np.random.default_rng(2).uniform(-0.9, 0.9, (2000, 2))
    inner = corners.reshape(n, n, 3)[1:-1, 1:-1].reshape(-1, 3)[:, :2]
    aims = np.concatenate([inner, 0.5 * (inner + np.roll(inner, 1, 0)), anywhere])
    aims = np.concatenate([aims, (5.0 + 0.4 * aims[:, :1] - 0.7 * aims[:, 1:])], 1)
    step = np.array([0.0, 0.0, 0.01])
    for least_w in (0.0, -1e9):
        assert shaded_in_parallel(solids, aims + step, dtype, least_w).all()
        assert not shaded_in_parallel(solids, aims - step, dtype, least_w).any()
        assert not shaded_in_parallel(solids, aims, dtype, least_w, own=0).any()
        assert shaded_in_parallel(solids, aims + step, dtype, least_w, own=0).all()
    assert not shaded_in_parallel(solids, aims + step, dtype, 7.0).any()
