"""Refractive indices against the check values their publishers print."""

from __future__ import annotations

import numpy as np
import pytest

from atmoref.optics import refraction

# IAPWS R9-97, Table 3 (0.1 MPa): wavelength nm, Celsius, index; the density of 0 C is that of IAPWS-95
RELEASE = [(226.50, 0.0, "1.394527"), (589.00, 0.0, "1.334344"), (1013.98, 0.0, "1.326135")]


@pytest.mark.parametrize(("nm", "celsius", "index"), RELEASE)
def test_water_has_the_values_of_the_release(nm, celsius, index):
    assert f"{float(refraction.water_vacuum(nm, celsius)):.6f}" == index


def test_water_has_the_values_in_which_the_density_is_given():
    """Published with the IAPWS formulations' programs: density, kelvin and micrometres as here."""
    assert f"{float(refraction.water_vacuum(226.5, 298.15 - 273.15, 997.047435)):.8f}" == "1.39277824"
    assert f"{float(refraction.water_vacuum(589.3, 773.15 - 273.15, 30.4758534)):.8f}" == "1.00949307"


@pytest.mark.parametrize(("celsius", "density"), [(3.983035, 999.97495), (20.0, 998.2071), (25.0, 997.0479)])
def test_density_of_water(celsius, density):
    """Tabulated densities at 101,325 Pa."""
    assert refraction.water_density(celsius) == pytest.approx(density, rel=1e-6)


@pytest.mark.parametrize(
    ("nm", "index"), [(680, 1.33129), (650, 1.33200), (550, 1.33503), (515, 1.33645), (440, 1.34065)]
)
def test_drops_in_air_have_the_indices_of_the_sheet(nm, index):
    assert float(refraction.water(nm)) == pytest.approx(index, abs=1e-5)


def test_air():
    assert float(refraction.air(589.3)) == pytest.approx(1.000277, abs=5e-7)
    assert (np.diff(refraction.air(np.arange(380.0, 781.0))) < 0.0).all()


@pytest.mark.parametrize(
    ("nm", "index", "absorption"),
    [
        (390, 1.3203, 2.0e-11),
        (440, 1.3163, 6.268e-11),
        (550, 1.3110, 2.289e-9),
        (680, 1.3073, 2.09e-8),
        (780, 1.3053, 1.02e-7),
    ],
)
def test_ice_has_the_values_of_the_table(nm, index, absorption):
    assert float(refraction.ice(nm)) == pytest.approx(index, abs=1e-12)
    assert float(refraction.ice_absorption(nm)) == pytest.approx(absorption, rel=1e-12)


def test_ice_between_the_rows_is_linear_in_the_logarithm():
    middle = np.sqrt(510.0 * 520.0)
    assert float(refraction.ice(middle)) == pytest.approx(0.5 * (1.3126 + 1.3121), abs=1e-12)
    assert float(refraction.ice_absorption(middle)) == pytest.approx(np.sqrt(8.036e-10 * 1.076e-9), rel=1e-12)


def test_indices_fall_with_wavelength():
    nm = np.arange(380.0, 780.5, 0.5)
    for function in (refraction.water, refraction.ice):
        values = function(nm)
        assert values.shape == nm.shape
        assert (np.diff(values) < 0.0).all()
        assert ((values > 1.30) & (values < 1.35)).all()


@pytest.mark.parametrize("nm", [379.0, 781.0, float("nan")])
def test_other_wavelengths_are_refused(nm):
    for function in (refraction.water, refraction.ice, refraction.ice_absorption, refraction.air):
        with pytest.raises(ValueError, match="380 to 780 nm"):
            function(nm)


def test_other_temperatures_are_refused():
    with pytest.raises(ValueError, match="0 to 40 C"):
        refraction.water(550.0, -5.0)
    with pytest.raises(ValueError, match="200 to 1100 nm"):
        refraction.water_vacuum(100.0)
