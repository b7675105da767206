"""The public call: accuracy against its own refinement, threads, crop, progress, refusals, hostile scenes."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from truth_scenes import asymmetric, box, ground, scene, sphere, spot

import atmoref.truth as truth
from atmoref.scene import load_scene
from atmoref.truth.beams_quadrature import quadrature
from atmoref.truth.beams_question import ask
from atmoref.truth.quadrature_rules import gauss_legendre
from atmoref.truth.rows import make_crop, run_rows


def _refined(s):
    """Return beam and image from twice the nodes on a third of every panel, without adaptivity."""
    shape = (s.image.height, s.image.width)
    out = quadrature(
        ask(s), shape, make_crop(None, shape[1], shape[0]), rule=gauss_legendre(42), first_split=3, adaptive=False
    )
    return out["beam"], out["image"]


def _scenes():
    yield "fig4d", load_scene("fig4d", ["image.width=100", "image.height=150"])
    yield "two_lights", load_scene("two_lights", ["image.width=120", "image.height=80"])
    yield "asymmetric", asymmetric()


@pytest.mark.parametrize(("name", "s"), list(_scenes()), ids=[name for name, _ in _scenes()])
def test_every_lit_pixel_agrees_with_its_own_refinement(name, s):
    result = truth.solve(s)
    beam, image = _refined(s)
    lit = beam > 0.0
    assert lit.any(axis=2).mean() > 0.3
    np.testing.assert_array_equal(result.buffers["beam"] > 0.0, lit)
    np.testing.assert_allclose(result.buffers["beam"][lit], beam[lit], rtol=1e-9)
    assert (abs(result.image - image) <= result.error).all()
    assert result.stats["values_over_rtol"] == 0
    assert result.stats["worst_relative_error"] <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig4d", "two_lights"])
def test_every_lit_pixel_of_the_full_images_agrees_with_its_own_refinement(name):
    s = load_scene(name)
    result = truth.solve(s)
    beam, image = _refined(s)
    lit = beam > 0.0
    np.testing.assert_array_equal(result.buffers["beam"] > 0.0, lit)
    np.testing.assert_allclose(result.buffers["beam"][lit], beam[lit], rtol=1e-9)
    assert (abs(result.image - image) <= result.error).all()


@pytest.mark.parametrize("g", [-0.95, 0.95])
def test_sharp_phase_functions_meet_the_tolerance(g):
    s = asymmetric()
    s.medium.phase_function.g = g
    result = truth.solve(s)
    beam, _ = _refined(s)
    np.testing.assert_allclose(result.buffers["beam"], beam, rtol=1e-9)
    assert result.stats["values_over_rtol"] == 0
    assert result.stats["panels"] >= result.stats["lit_pieces"]


def test_a_looser_tolerance_is_cheaper_and_still_told():
    s = asymmetric()
    s.medium.phase_function.g = 0.95
    s.medium.extinction_per_m = (2.0, 0.5, 0.0)
    loose, tight = truth.solve(s, rtol=1e-4), truth.solve(s, rtol=1e-12)
    assert loose.stats["panels"] <= tight.stats["panels"]
    assert (abs(loose.image - tight.image) <= loose.error + tight.error).all()


def test_threads_crop_and_progress():
    s = asymmetric()
    seen = []
    whole = truth.solve(s, threads=1, progress=lambda done, rows: seen.append((done, rows)))
    assert seen[0] == (0, 32)
    assert seen[-1] == (32, 32)
    assert seen == sorted(seen)
    for threads in (2, 5):
        other = truth.solve(s, threads=threads)
        np.testing.assert_array_equal(other.image, whole.image)
        np.testing.assert_array_equal(other.error, whole.error)
    part = truth.solve(s, crop=(5, 9, 20, 11))
    np.testing.assert_array_equal(part.image, whole.image[9:20, 5:25])
    np.testing.assert_array_equal(part.buffers["surface"], whole.buffers["surface"][9:20, 5:25])
    assert part.provenance["crop"] == (5, 9, 20, 11)


def test_row_zero_is_at_the_top():
    s = load_scene("fig4d", ["image.width=30", "image.height=45"])
    image = truth.solve(s).image
    assert image[:8].max() == 0.0  # above the light
    assert image[-1].max() > 0.0  # the floor


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "guess"}, "allowed are quadrature, monte_carlo"),
        ({"rtol": 0.0}, "rtol"),
        ({"rtol": math.nan}, "rtol"),
        ({"crop": (0, 0, 49, 1)}, "not inside the image of 48 x 32"),
        ({"crop": (0, 0, 0, 1)}, "crop"),
        ({"threads": 0}, "threads = 0"),
        ({"ambient": "dim"}, "ambient mode 'dim'"),
        ({"method": "monte_carlo", "samples": 100}, "samples = 100"),
        ({"method": "monte_carlo", "seed": -1}, "seed = -1"),
    ],
)
def test_bad_requests_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        truth.solve(asymmetric(), **options)


@pytest.mark.parametrize("part", ["lights", "objects", "camera"])
def test_what_has_no_equation_here_is_refused(part):
    s = asymmetric()
    thing = s.camera if part == "camera" else getattr(s, part)[0]
    thing.type = "fisheye"
    with pytest.raises(ValueError, match="'fisheye'"):
        truth.solve(s)


def test_an_error_in_a_row_reaches_the_caller():
    def fails(first, last):
        raise ArithmeticError(f"{first} {last}")

    with pytest.raises(ArithmeticError, match=r"\d+ \d+"):
        run_rows(fails, 20, 2)


HOSTILE = {
    "no extinction": scene([spot()], [sphere((0.0, 8.0, 0.0), 2.0), ground()], extinction=(0.0,) * 3),
    "optical depth 50": scene([spot()], [sphere((0.0, 8.0, 0.0), 2.0), ground()], extinction=(1.0, 1.1, 1.2)),
    "optical depth 3000": scene([spot()], [ground()], extinction=(60.0,) * 3),
    "light inside the beam's view": scene([spot((0.0, 14.0, 0.0), (0.0, 0.0, 1.0))], [ground()]),
    "light shines at the eye": scene([spot((0.0, 14.0, 0.0), (0.0, 0.0, -1.0))], [ground()]),
    "eye inside the beam": scene([spot((0.0, 30.0, -45.0))], [ground()]),
    "light behind the camera": scene([spot((0.0, 14.0, -60.0), (0.0, 0.0, 1.0))], [sphere((0.0, 14.0, 0.0), 3.0)]),
    "light in a sphere's shadow": scene([spot(), spot((0.0, 4.0, 0.0))], [sphere((0.0, 8.0, 0.0), 2.0), ground()]),
    "wide cone": scene([spot(inner=88.0, outer=89.0)], [ground(), box((-9.0, 0.0, -9.0), (-5.0, 5.0, -5.0))]),
    "no falloff at all": scene([spot(inner=30.0, outer=30.0)], [ground()]),
    "no falloff, linear": scene([spot(inner=30.0, outer=30.0, falloff="linear_angle")], [ground()]),
    "narrow cone": scene([spot(inner=0.01, outer=0.02)], [ground()]),
    "nothing hit": scene([spot((0.0, 14.0, -44.0), (0.0, 0.3, 1.0), 30.0, 60.0)]),
    "far away": scene([spot((0.0, 1e6, 1e6), (0.0, 0.0, -1.0))], [ground(-1e7)], extinction=(1e-7,) * 3),
    "light touches a box": scene([spot((0.0, 20.0, 0.0))], [box((-1.0, 20.0, -1.0), (1.0, 22.0, 1.0))]),
    "camera on a level with planes": scene([spot()], [box((-2.0, 13.0, -2.0), (2.0, 14.0, 2.0)), ground(14.0)]),
}


@pytest.mark.parametrize("name", list(HOSTILE))
def test_odd_questions_have_answers_with_an_error(name):
    s = HOSTILE[name]
    result = truth.solve(s)
    assert not np.isnan(result.image).any()
    assert not np.isnan(result.error).any()
    assert (result.image >= 0.0).all()
    assert np.isfinite(result.error).all()
    beam, image = _refined(s)
    close = abs(result.image - image) <= result.error
    assert (close | np.isinf(image)).all()
    normal = np.isfinite(beam) & (beam > 1e-290)
    np.testing.assert_allclose(result.buffers["beam"][normal], beam[normal], rtol=1e-9)


def test_beams_that_miss_the_image_leave_it_black_and_cost_little():
    s = scene([spot((0.0, 14.0, -80.0), (0.0, 0.0, -1.0)) for _ in range(50)], width=100, height=100)
    result = truth.solve(s, threads=1)
    assert result.stats["lit_rays"] == 0
    assert result.stats["panels"] == 0
    assert (result.image == 0.0).all()


@pytest.mark.slow
def test_the_full_figure_takes_less_than_three_seconds_of_processor_time():
    s = load_scene("fig4d")
    truth.solve(s, crop=(0, 0, 1, 1))
    seconds = truth.solve(s, threads=1).stats["cpu_seconds"]
    assert seconds < 3.0  # measured 0.5 to 0.9


def test_importing_truth_does_not_import_numba():
    code = "import sys, atmoref.truth, atmoref.optics.phase_functions; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=os.environ, check=False).returncode == 0
