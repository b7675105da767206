"""Interleaved sampling: shifted images are what they claim, one by one and together."""

import numpy as np
import pytest

from atmoref.scene import SceneError, load_scene
from atmoref.techniques.render import render

FLOAT = (
    "image.width=48",
    "image.height=72",
    'technique.preset="analysis"',
    'buffers.format="float64"',
    'buffers.arithmetic="float64"',
)


def interleaved(*overrides: str) -> tuple[str, ...]:
    return ('technique={name="beams_interleaved",base_distance_m=20.0,planes=10}', *FLOAT, *overrides)


def test_the_average_of_shifted_images_is_one_image_of_all_their_planes() -> None:
    """Four times 10 planes, shifted by quarters, sample where 40 planes sample (left ends of the intervals)."""
    mean = render(load_scene("fig4a", interleaved()))
    all_planes = render(load_scene("fig4a", (*FLOAT, "technique.planes=40", 'technique.plane_positions="left"')))
    np.testing.assert_allclose(mean.image, all_planes.image, rtol=1e-12, atol=1e-14)
    assert mean.image.max() > 0.5


def test_an_interleaved_image_takes_each_pixel_from_the_image_it_belongs_to() -> None:
    whole = render(load_scene("fig4a", interleaved('technique.composition="interleave"'))).image
    images = render(load_scene("fig4a", interleaved())).buffers
    for index in range(4):
        i, j = index % 2, index // 2  # j counts rows from the bottom
        full = images[f"image_{index}/frame"].values()
        np.testing.assert_allclose(whole[1 - j :: 2, i::2], full[1 - j :: 2, i::2], rtol=1e-9, atol=1e-13)


def test_one_image_is_the_previous_method() -> None:
    one = render(load_scene("fig4a", interleaved("technique.images=1")))
    plain = render(load_scene("fig4a", (*FLOAT, "technique.planes=10", 'technique.plane_positions="left"')))
    np.testing.assert_array_equal(one.image, plain.image)


@pytest.mark.parametrize("composition", ["average", "interleave"])
def test_an_asymmetric_scene_is_not_mirrored(composition: str) -> None:
    asked = ("image.width=48", "image.height=32", 'technique={name="beams_interleaved",planes=24}')
    image = render(load_scene("two_lights", (*asked, f'technique.composition="{composition}"'))).image
    plain = render(load_scene("two_lights", (*asked[:2], 'technique={name="beams_vertex",planes=96}'))).image
    distance = np.abs(image - plain).mean()
    for turned in (plain[::-1], plain[:, ::-1], plain[::-1, ::-1]):
        assert distance < 0.35 * np.abs(image - turned).mean()


def test_an_image_that_cannot_be_divided_is_refused() -> None:
    odd = load_scene("fig4a", interleaved('technique.composition="interleave"', "image.width=49"))
    with pytest.raises(SceneError, match=r"49 x 72 pixels; allowed .* multiples of 2"):
        render(odd)
    with pytest.raises(SceneError, match=r"technique\.images: found 5; allowed: a square number"):
        render(load_scene("fig4a", interleaved('technique.composition="interleave"', "technique.images=5")))
