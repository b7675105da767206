"""The Monte Carlo truth: agrees with the quadrature as far as chance allows, and its bits stay where they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from truth_pictures import ball_triangles, box_triangles, field_triangles, mesh, only, pictured
from truth_scenes import asymmetric, box, ground, scene, sphere, spot

import atmoref.truth as truth
from atmoref.scene import load_scene

FAMILY = 0.01  # chance that any of the chi-square tests below fails although all is right


def _triangles(s):
    """Return a scene with a bent box, a ball and hills in place of its solids."""
    random = np.random.default_rng(1)
    corners, faces = box_triangles((2.0, 0.0, -3.0), (5.0, 6.0, 1.0))
    triangles = {
        0: ball_triangles((-3.0, 8.0, 1.5), 2.5, 5),
        1: (corners + random.normal(size=corners.shape) * 0.6, faces),
        2: field_triangles(3.0 * random.random((17, 25)), 4.0, (0.0, -1.5, 0.0)),
    }
    s.objects = [mesh(thing.albedo) for thing in s.objects]
    s.triangles = triangles.get
    return s


SCENES = {
    "fig4d": lambda: load_scene("fig4d", ["image.width=60", "image.height=90"]),
    "two_lights": lambda: load_scene("two_lights", ["image.width=96", "image.height=64"]),
    "asymmetric": asymmetric,
    "thick, forward": lambda: scene(
        [spot(falloff="linear_angle")], [box((-2.0, 5.0, -2.0), (1.0, 7.0, 2.0)), ground()],
        extinction=(0.2, 0.1, 0.05), phase="henyey_greenstein", g=0.8,
    ),
    "thin, no falloff": lambda: scene(
        [spot(falloff="none"), spot((9.0, 9.0, -9.0), (-1.0, -0.2, 0.6))], [sphere((1.0, 8.0, 0.0), 2.0)],
        extinction=(0.0, 1e-4, 1e-3), phase="nishita_hazy",
    ),
    "projector": lambda: only(pictured(), 0),
    "sun": lambda: only(pictured(), 1),
    "window": lambda: only(pictured(), 2),
    "pictures and triangles": lambda: _triangles(pictured()),
    "spots and triangles": lambda: _triangles(asymmetric()),
}  # fmt: skip
BLOCK = 6


def _blocks(array: np.ndarray) -> np.ndarray:
    h, w = (n // BLOCK * BLOCK for n in array.shape[:2])
    return array[:h, :w].reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK, 3).sum(axis=(1, 3))


def _scores(monte_carlo, quadrature, batches: int) -> np.ndarray:
    """Return one standard normal number per block, by Welch's t of the block's sum.

    Only the green channel counts (the channels share their samples), and only blocks that the quadrature says are
    not nearly black, where a mean of 16 or more batches is near to normal.
    """
    reference = _blocks(quadrature.buffers["beam"])[..., 1]
    estimate = _blocks(monte_carlo.buffers["beam"])[..., 1]
    variance = _blocks(monte_carlo.error**2)[..., 1]
    fourth = _blocks(monte_carlo.error**4)[..., 1]
    use = reference > 0.02 * np.median(reference[reference > 0.0])
    use &= variance > 1e-20 * reference**2  # under a bare sun some blocks are exact: their samples are all the same
    t = (estimate - reference)[use] / np.sqrt(variance[use])
    freedom = (batches - 1) * variance[use] ** 2 / fourth[use]
    upper = stats.t.sf(abs(t), freedom)
    return np.sign(t) * stats.norm.isf(np.maximum(upper, 1e-300))


@pytest.mark.parametrize("name", list(SCENES))
def test_blocks_agree_with_the_quadrature(name):
    s = SCENES[name]()
    samples = 512
    z = _scores(truth.solve(s, method="monte_carlo", samples=samples, seed=20), truth.solve(s), samples // 16)
    assert z.size >= 17
    tests = 2 * len(SCENES)
    assert stats.chi2.sf(float((z * z).sum()), z.size) > FAMILY / tests, f"chi² {(z * z).sum():.1f} of {z.size}"
    bias = float(z.sum()) / np.sqrt(z.size)
    assert 2.0 * stats.norm.sf(abs(bias)) > FAMILY / tests, f"bias {bias:.2f} sigma"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig4d", "two_lights"])
def test_blocks_of_the_full_images_agree_with_the_quadrature(name):
    s = load_scene(name)
    z = _scores(truth.solve(s, method="monte_carlo", samples=512, seed=7), truth.solve(s), 32)
    assert stats.chi2.sf(float((z * z).sum()), z.size) > FAMILY / 2.0, f"chi² {(z * z).sum():.1f} of {z.size}"


def test_a_wrong_quadrature_would_be_noticed():
    """The test has power: half a percent too bright is seen."""
    s = SCENES["two_lights"]()
    right = truth.solve(s)
    wrong = type(right)(right.image, right.error, {"beam": right.buffers["beam"] * 1.005})
    z = _scores(truth.solve(s, method="monte_carlo", samples=512, seed=20), wrong, 32)
    assert abs(z.sum()) / np.sqrt(z.size) > 4.0


def test_surfaces_are_the_same_by_both_geometries():
    for name in ("asymmetric", "two_lights", "thick, forward", "pictures and triangles", "spots and triangles"):
        s = SCENES[name]()
        a, b = truth.solve(s), truth.solve(s, method="monte_carlo", samples=64)
        assert (a.buffers["surface"] > 0.0).mean() > 0.05
        np.testing.assert_allclose(b.buffers["surface"], a.buffers["surface"], rtol=1e-10)


@pytest.mark.parametrize("make", [asymmetric, lambda: _triangles(pictured())], ids=["spots", "pictures, triangles"])
def test_bits_depend_on_seed_only(make):
    s = make()

    def solve(**more):
        return truth.solve(s, method="monte_carlo", samples=64, **more)

    whole = solve(threads=1)
    for threads in (2, 3):
        other = solve(threads=threads)
        np.testing.assert_array_equal(other.image, whole.image)
        np.testing.assert_array_equal(other.error, whole.error)
    np.testing.assert_array_equal(solve(crop=(5, 9, 20, 11)).image, whole.image[9:20, 5:25])
    assert (solve(seed=1).image != whole.image).any()
    assert (solve(seed=1 << 40).image != whole.image).any()


def test_more_samples_mean_less_error_and_the_first_stay():
    s = asymmetric()
    few, many = (truth.solve(s, method="monte_carlo", samples=n) for n in (64, 1024))
    lit = few.error[..., 1] > 0.0
    ratio = np.sqrt((few.error[..., 1][lit] ** 2).mean() / (many.error[..., 1][lit] ** 2).mean())
    assert 3.0 < ratio < 5.5  # 4 by the square root
    assert many.stats["samples"] == 1024 * 48 * 32 * 2


def test_a_pixel_stops_at_a_fixed_number_of_batches():
    s = asymmetric()
    early = truth.solve(s, method="monte_carlo", samples=1024, rtol=0.05)
    full = truth.solve(s, method="monte_carlo", samples=1024)
    assert early.stats["samples"] < full.stats["samples"]
    again = truth.solve(s, method="monte_carlo", samples=1024, rtol=0.05, threads=3)
    np.testing.assert_array_equal(early.image, again.image)


def test_saturating_ambient_is_the_same_by_both():
    s = scene([spot()], [ground()], ambient=(0.3, 0.2, 0.1), extinction=(0.02, 0.0, 0.05))
    a = truth.solve(s, ambient="saturating")
    b = truth.solve(s, ambient="saturating", method="monte_carlo", samples=64)
    rest_a, rest_b = (r.image - r.buffers["beam"] - r.buffers["surface"] for r in (a, b))
    np.testing.assert_allclose(rest_a, rest_b, atol=1e-13)
