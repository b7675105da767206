"""The camera's basis and rays against closed forms: one axis swapped or mirrored fails here."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from atmoref.scene import Camera, pixel_to_camera_plane, ray_directions
from atmoref.scene.camera import unit_vector

finite = st.floats(-1e9, 1e9)
vectors = st.tuples(finite, finite, finite)


def camera(**keys: object) -> Camera:
    values = {"position_m": (0.0, 0.0, 0.0), "look_at_m": (0.0, 0.0, -1.0), "vertical_fov_deg": 90.0} | keys
    return Camera.model_validate(values)


def test_looking_along_minus_z_has_x_on_the_right_and_along_plus_z_on_the_left() -> None:
    assert camera().basis() == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
    assert camera(look_at_m=(0.0, 0.0, 4.0)).basis() == ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    assert camera(look_at_m=(2.0, 0.0, 0.0)).basis() == ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))


@pytest.mark.parametrize("degrees", [-170.0, -30.0, 7.0, 45.0, 120.0])
def test_a_tilted_up_rolls_the_camera(degrees: float) -> None:
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    right, up, _ = camera(up=(3.0 * sine, 3.0 * cosine, 0.0)).basis()
    np.testing.assert_allclose(right, (cosine, -sine, 0.0), atol=1e-15)
    np.testing.assert_allclose(up, (sine, cosine, 0.0), atol=1e-15)


def test_no_negative_zeros() -> None:
    for axis in camera(look_at_m=(0.0, 0.0, 4.0)).basis():
        assert all(math.copysign(1.0, component) > 0 for component in axis if component == 0.0)


@settings(deadline=None)
@given(eye=vectors, target=vectors, up=vectors)
def test_the_basis_is_orthonormal_with_up_above(
    eye: tuple[float, ...], target: tuple[float, ...], up: tuple[float, ...]
) -> None:
    try:
        right, above, forward = camera(position_m=eye, look_at_m=target, up=up).basis()
    except ValueError:
        assume(False)
    frame = np.array([right, above, forward])
    gram = (frame[:, None, :] * frame[None, :, :]).sum(axis=2)
    np.testing.assert_allclose(gram, np.eye(3), atol=2e-10)  # measured 6e-11 at a sine of 1e-6
    np.testing.assert_allclose(np.cross(right, above), np.negative(forward), atol=2e-10)
    assert sum(a * b for a, b in zip(above, unit_vector(up), strict=True)) > 0.0


@settings(deadline=None)
@given(v=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3).filter(any))
def test_unit_vector_has_length_one_without_overflow_or_underflow(v: tuple[float, float, float]) -> None:
    length = sum(Fraction(component) ** 2 for component in unit_vector(v))
    assert abs(length - 1) < 1e-15


def test_pixels_of_a_right_angle_camera_by_hand() -> None:
    """90 degrees, 4 x 2 pixels: the plane at depth 1 is 4 wide and 2 high, a pixel is 1 x 1."""
    rays = ray_directions(camera(), 4, 2)
    assert rays.shape == (2, 4, 3)
    assert rays.dtype == np.float64
    np.testing.assert_allclose(rays[0, 0], (-1.5, 0.5, -1.0), atol=1e-15)
    np.testing.assert_allclose(rays[0, 3], (1.5, 0.5, -1.0), atol=1e-15)
    np.testing.assert_allclose(rays[1, 0], (-1.5, -0.5, -1.0), atol=1e-15)


def test_corners_lie_at_the_opening_angle() -> None:
    view = camera(vertical_fov_deg=36.0)
    left, top = pixel_to_camera_plane(view, 300, 450, 0.0, 0.0)
    right, bottom = pixel_to_camera_plane(view, 300, 450, 300.0, 450.0)
    assert math.degrees(math.atan(top)) == pytest.approx(18.0, abs=1e-13)
    assert (left, bottom) == (-right, -top)
    assert right / top == pytest.approx(300 / 450, rel=1e-15)
    assert pixel_to_camera_plane(view, 300, 450, 150.0, 225.0) == (0.0, 0.0)


def test_a_point_in_space_projects_to_its_pixel() -> None:
    """Through the ray of pixel (row 7, column 3), walk to a point; project it back by scalar products."""
    view = camera(position_m=(3.0, 7.0, -38.0), look_at_m=(0.5, 8.0, 0.0), up=(0.12, 1.0, 0.0), vertical_fov_deg=36.0)
    ray = ray_directions(view, 12, 8)[7, 3]
    right, up, forward = map(np.array, view.basis())
    offset = 41.5 * ray
    depth = (offset * forward).sum()
    assert depth == pytest.approx(41.5, rel=1e-14)
    ex, ey = pixel_to_camera_plane(view, 12, 8, 3.5, 7.5)
    assert (offset * right).sum() / depth == pytest.approx(ex, abs=1e-14)
    assert (offset * up).sum() / depth == pytest.approx(ey, abs=1e-14)
    assert ex < 0.0 > ey, "left and low"
