"""Spectra to linear sRGB: chromaticities from public tables, white, linearity, few and many wavelengths."""

from __future__ import annotations

import math

import numpy as np
import pytest

from atmoref.optics.colour import matching_functions, to_srgb, weights

NM = np.arange(380.0, 781.0, 5.0)


def black_body(kelvin: float, nm: np.ndarray) -> np.ndarray:
    return nm**-5.0 / np.expm1(1.4387768775e7 / (nm * kelvin))


def chromaticity(spectrum: np.ndarray) -> np.ndarray:
    xyz = spectrum @ matching_functions()[1]
    return xyz[:2] / xyz.sum()


def test_chromaticities_are_those_of_the_cie() -> None:
    """CIE 15: illuminant A (2855.5 K with today's constant); illuminant E; a black body of 6500 K (CCT tables)."""
    np.testing.assert_allclose(chromaticity(black_body(2855.54, NM)), [0.44757, 0.40745], atol=1e-4)
    np.testing.assert_allclose(chromaticity(np.ones(NM.size)), [1 / 3, 1 / 3], atol=1e-4)
    np.testing.assert_allclose(chromaticity(black_body(6500.0, NM)), [0.3135, 0.3237], atol=2e-4)
    grid, functions = matching_functions()
    assert grid[functions[:, 1].argmax()] == 555.0
    assert functions[:, 1].max() == 1.0
    assert functions[:, 1].sum() * 5.0 == pytest.approx(106.857, rel=2e-5)  # the integral of y, CIE 15


def test_the_chosen_white_is_white_and_colours_add() -> None:
    sun = black_body(5778.0, NM)
    np.testing.assert_allclose(to_srgb(np.ones(NM.size), NM), 1.0, atol=1e-12)
    np.testing.assert_allclose(to_srgb(3.0 * sun, NM, sun), 3.0, atol=1e-12)
    assert np.ptp(to_srgb(sun, NM) / to_srgb(sun, NM).max()) > 0.02  # against a flat white sunlight has a tint
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 4, 5, NM.size))
    np.testing.assert_allclose(to_srgb(a + 2.0 * b, NM), to_srgb(a, NM) + 2.0 * to_srgb(b, NM), atol=1e-12)


def test_pure_colours_are_where_they_belong() -> None:
    """Of 450, 550, 620 nm blue, green, red is the greatest; a pure green lies outside of sRGB."""
    matrix = weights(NM)
    assert [int(matrix[int(np.flatnonzero(nm == NM)[0])].argmax()) for nm in (620.0, 550.0, 450.0)] == [0, 1, 2]
    assert matrix[int(np.flatnonzero(NM == 510.0)[0])][0] < 0.0


def test_thirty_one_wavelengths_are_as_good_as_many_for_smooth_spectra() -> None:
    few = np.linspace(400.0, 700.0, 31)
    many = np.linspace(400.0, 700.0, 301)

    def bow(nm: np.ndarray) -> np.ndarray:
        return 1.0 + 0.6 * np.sin((nm - 400.0) / 300.0 * 2.0 * math.pi)

    np.testing.assert_allclose(to_srgb(bow(few), few), to_srgb(bow(many), many), atol=2e-3)
    shuffled = np.random.default_rng(4).permutation(31)
    np.testing.assert_allclose(to_srgb(bow(few)[shuffled], few[shuffled]), to_srgb(bow(few), few), atol=1e-13)


def test_wrong_spectra_are_refused() -> None:
    for waves in ([550.0], [300.0, 500.0], [500.0, 500.0, 600.0]):
        with pytest.raises(ValueError, match="wavelengths"):
            weights(waves)
    with pytest.raises(ValueError, match="white"):
        weights([450.0, 550.0, 650.0], [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="last axis"):
        to_srgb(np.ones((3, 4)), [450.0, 550.0, 650.0])
