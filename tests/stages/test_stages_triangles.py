"""The rasteriser against a test of every ray, against closed forms, and without cracks."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from triangle_pictures import (
    cast,
    drawn,
    looking_along_z,
    parallel,
    perspective,
    pixel_rays,
    soup,
    tilted,
    triangle_set,
)

from atmoref.lanes import Double, N, Single
from atmoref.stages.beam_planes import Window
from atmoref.stages.ray_cast import FAR
from atmoref.stages.triangles import LEAST_Z_M, rasterise
from atmoref.techniques.triangle_passes import records

SCRIPT = Path(__file__).with_name("triangle_pictures.py")
BOTH = pytest.mark.parametrize("dtype", [np.float32, np.float64])
BOX_FACES = [
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
    (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
]  # fmt: skip
FACE_OF = np.array([[5, 4], [3, 2], [1, 0]])  # [axis, ray runs up the axis] -> pair of triangles in BOX_FACES
# error of depth relative to depth: a dozen roundings, times 1 / sine of the angle between ray and triangle
DEPTH_ERROR = {np.float32: 2e-6, np.float64: 4e-15}
# barycentric coordinate below which rounding may decide: slack of 8 roundings on both sides, for small triangles
MARGIN = {np.float32: 2e-4, np.float64: 1e-12}


def box_corners(low: Any, high: Any) -> list[tuple[float, float, float]]:
    return [(x, y, z) for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]


@BOTH
@pytest.mark.parametrize("through", [False, True], ids=["in front", "through the eye plane"])
@pytest.mark.parametrize("projection", ["perspective", "parallel"])
def test_every_pixel_sees_what_its_ray_meets(projection: str, through: bool, dtype: Any) -> None:
    width, height = 61, 43
    view = tilted()
    for seed in range(4):
        triangles = soup(seed, 60, through=through)
        grid = perspective(width, height) if projection == "perspective" else parallel(width, height, 5.0)
        depth, index = drawn(triangles, grid, view, width, height, dtype)
        expected, hit, margin = cast(triangles, *pixel_rays(grid, view, width, height))
        sure = margin > MARGIN[dtype]
        assert sure.mean() > 0.9
        assert (index[sure] == hit[sure]).all()
        assert (hit[sure] >= 0).mean() > 0.1
        seen = sure & (hit >= 0) & (expected > LEAST_Z_M)
        normals = np.asarray(triangles.normals, np.float64).reshape(-1, 3)[index]
        _, rays = pixel_rays(grid, view, width, height)
        sine = np.abs((normals * rays).sum(-1)) / np.sqrt((rays * rays).sum(-1))
        error = np.abs(depth / np.where(seen, expected, 1.0) - 1.0) * np.minimum(sine, 1.0)
        scale = 1.0 if projection == "perspective" else 10.0 / np.where(seen, expected, 1.0)  # metres across the view
        assert (error / np.maximum(scale, 1.0))[seen].max() < DEPTH_ERROR[dtype] * 4.0
        assert (depth[hit < 0][margin[hit < 0] > MARGIN[dtype]] == np.float64(dtype(FAR))).all()


@BOTH
@pytest.mark.parametrize("projection", ["perspective", "parallel"])
@pytest.mark.parametrize("place", ["corners at pixel centres", "edges at pixel centres", "anywhere"])
def test_a_surface_has_no_cracks(place: str, projection: str, dtype: Any) -> None:
    """A plane z = 7 of small triangles, whose corners are moved about unless they are to lie at pixel centres."""
    size, cells = 64, 64
    grid = perspective(size, size) if projection == "perspective" else parallel(size, size, 2.8)
    scale = 7.0 * 0.4
    line = (np.arange(-2, cells + 4) + (0.0 if place == "edges at pixel centres" else 0.5)) * 2.0 / cells - 1.0
    x, y = np.meshgrid(line * scale, line * scale)
    if place == "anywhere":
        rng = np.random.default_rng(3)
        x, y = (a + rng.uniform(-0.3, 0.3, a.shape) * 2.0 / cells * scale for a in (x, y))
    n = len(line)
    at = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([at, at + n, at + n + 1], -1), np.stack([at, at + n + 1, at + 1], -1)])
    rng = np.random.default_rng(4)
    faces = rng.permuted(rng.permutation(faces), axis=1)
    triangles = triangle_set(np.stack([x, y, np.full_like(x, 7.0)], -1), faces)
    depth, index = drawn(triangles, grid, looking_along_z(), size, size, dtype)
    assert (index >= 0).all()
    np.testing.assert_allclose(depth, 7.0, rtol=DEPTH_ERROR[dtype])


@BOTH
def test_thin_fans_have_no_cracks(dtype: Any) -> None:
    """Many slivers around corners that lie at pixel centres."""
    size, spokes = 33, 301
    angle = np.arange(spokes) * (2.0 * np.pi / spokes)
    rim = np.stack([30.0 * np.cos(angle), 30.0 * np.sin(angle), np.full(spokes, 9.0)], -1)
    vertices = np.concatenate([[[0.0, 0.0, 9.0]], rim])
    faces = [(0, 1 + i, 1 + (i + 1) % spokes) for i in range(spokes)]
    depth, index = drawn(triangle_set(vertices, faces), perspective(size, size), looking_along_z(), size, size, dtype)
    assert (index >= 0).all()
    np.testing.assert_allclose(depth, 9.0, rtol=DEPTH_ERROR[dtype])


@BOTH
@pytest.mark.parametrize("projection", ["perspective", "parallel"])
def test_a_box_of_triangles_is_the_analytic_box(projection: str, dtype: Any) -> None:
    width, height, view = 80, 60, tilted((1.0, 2.0, -9.0))
    grid = perspective(width, height) if projection == "perspective" else parallel(width, height, 4.0)
    low, high = np.array([0.5, -2.0, -1.0]), np.array([3.5, 0.5, 1.5])
    depth, index = drawn(triangle_set(box_corners(low, high), BOX_FACES), grid, view, width, height, dtype)
    starts, rays = pixel_rays(grid, view, width, height)
    a, b = (low - starts) / rays, (high - starts) / rays
    enter, leave = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
    inside = leave - enter
    sure = np.abs(inside) > 1e-4
    assert ((index >= 0) == (inside > 0.0))[sure].all()
    assert 0.05 < (index >= 0).mean() < 0.9
    seen = sure & (inside > 0.0)
    np.testing.assert_allclose(depth[seen], enter[seen], rtol=20.0 * DEPTH_ERROR[dtype])
    axis = np.minimum(a, b).argmax(-1)  # the face that is entered, from the side that the ray comes from
    second = np.sort(np.minimum(a, b), -1)[..., 1]
    clear = seen & (enter - second > 1e-4)
    side = np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0.0
    assert (index[clear] // 2 == FACE_OF[axis, side * 1][clear]).all()


@BOTH
def test_ground_from_behind_the_eye_to_the_horizon(dtype: Any) -> None:
    """Two triangles that pass under the eye are the plane y = -1.7."""
    width, height, far = 64, 48, 400.0
    corners = [(-far, -1.7, -far), (far, -1.7, -far), (far, -1.7, far), (-far, -1.7, far)]
    grid = perspective(width, height)
    depth, index = drawn(triangle_set(corners, [(0, 1, 2), (0, 2, 3)]), grid, looking_along_z(), width, height, dtype)
    _, rays = pixel_rays(grid, looking_along_z(), width, height)
    with np.errstate(divide="ignore"):
        z = -1.7 / rays[..., 1]
    under = (z > 0.0) & (z < far) & (np.abs(rays[..., 0] * z) < far)
    np.testing.assert_array_equal(index >= 0, under)
    np.testing.assert_allclose(depth[under], z[under], rtol=40.0 * DEPTH_ERROR[dtype])


def test_of_equal_depths_the_first_triangle_wins() -> None:
    corners = [(-9.0, -9.0, 5.0), (9.0, -9.0, 5.0), (0.0, 9.0, 5.0)]
    for faces in ([(0, 1, 2), (0, 1, 2)], [(0, 2, 1), (0, 1, 2), (1, 2, 0)]):
        _, index = drawn(triangle_set(corners, faces), perspective(20, 20), looking_along_z(), 20, 20, np.float32)
        assert set(np.unique(index)) <= {-1, 0}
        assert (index == 0).any()


@pytest.mark.parametrize("projection", ["perspective", "parallel"])
def test_what_cannot_be_seen_leaves_nothing(projection: str) -> None:
    grid = perspective(20, 20) if projection == "perspective" else parallel(20, 20)
    faces = {
        "behind": [(-9.0, -9.0, -5.0), (9.0, -9.0, -5.0), (0.0, 9.0, -5.0)],
        "beside": [(50.0, 0.0, 5.0), (60.0, 0.0, 5.0), (55.0, 5.0, 5.0)],
        "edge-on": [(0.0, -1.0, 5.0), (0.0, 1.0, 5.0), (0.0, 0.0, 9.0)],
        "a line": [(-1.0, 0.0, 5.0), (1.0, 0.0, 5.0), (3.0, 0.0, 5.0)],
        "a point": [(0.1, 0.1, 5.0)] * 3,
    }
    for name, corners in faces.items():
        depth, index = drawn(triangle_set(corners, [(0, 1, 2)]), grid, looking_along_z(), 20, 20, np.float32)
        assert (index == -1).all(), name
        assert (depth == np.float64(np.float32(FAR))).all(), name


def test_nearly_edge_on_stays_within_its_depths() -> None:
    rng = np.random.default_rng(8)
    for _ in range(200):
        a, b = rng.uniform(-2.0, 2.0, 3) + [0.0, 0.0, 6.0], rng.uniform(-2.0, 2.0, 3) + [0.0, 0.0, 6.0]
        c = a * rng.uniform(0.5, 2.0) + rng.normal(0.0, 1e-8, 3)
        triangles = triangle_set([a, b, c], [(0, 1, 2)])
        depth, index = drawn(triangles, perspective(64, 64), looking_along_z(), 64, 64, np.float32)
        z = depth[index >= 0]
        assert np.isfinite(depth).all()
        least, most = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        assert ((z >= least * (1.0 - 1e-6)) & (z <= most * (1.0 + 1e-6))).all()


@BOTH
def test_rows_columns_and_pieces_agree(dtype: Any) -> None:
    width, height = 75, 40
    triangles, grid = soup(2, 150, through=True), perspective(75, 40)
    whole = drawn(triangles, grid, tilted(), width, height, dtype)
    for bands in (2, 7, 40):
        for a, b in zip(whole, drawn(triangles, grid, tilted(), width, height, dtype, bands), strict=True):
            np.testing.assert_array_equal(a, b)
    pitch, made = -(-width // N) * N, records(triangles, grid, tilted(), width, height, dtype)
    out = np.full(2 * height * pitch, np.nan, dtype)
    tag = Single() if dtype is np.float32 else Double()
    rasterise(out, tag, grid, made, Window(3 * N if 3 * N < 50 else N, 60, 11, 30, height, pitch, 0, 1, 0))
    left = 3 * N if 3 * N < 50 else N
    part = out.reshape(2, height, pitch)[:, 11:30, left:60].astype(np.float64)
    np.testing.assert_array_equal(part[0], whole[0][11:30, left:60])
    np.testing.assert_array_equal(part[1], whole[1][11:30, left:60])


def test_widths_and_processors_agree() -> None:
    """The same bits at 1, 8 and 16 lanes, and without AVX-512 and FMA."""

    def run(**environment: str) -> Any:
        settings = {k: v for k, v in os.environ.items() if k not in ("ATMOREF_LANES", "NUMBA_CPU_NAME")}
        done = subprocess.run(
            [sys.executable, str(SCRIPT)], env=settings | environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    plain = run(ATMOREF_LANES="16")
    assert len(set(plain.values())) == len(plain) == 8
    assert run(ATMOREF_LANES="1") == plain
    assert run(ATMOREF_LANES="8") == plain
    assert run(ATMOREF_LANES="8", NUMBA_CPU_NAME="x86-64", NUMBA_CPU_FEATURES="") == plain
