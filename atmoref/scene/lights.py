"""The kinds of light: spot, projector, sun."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from atmoref.scene.camera import Vec3, cross, unit_vector
from atmoref.scene.describe import found
from atmoref.scene.errors import Contradiction, Problem, contradiction
from atmoref.scene.fields import BESIDE, FileName, Radiances, Table, Vector, quantity

LEAST_SINE = 1e-3
Encoding = Literal["srgb", "linear"]


_RADIANS = 3.141592653589793 / 180.0


def sun_axis(elevation_deg: float, azimuth_deg: float) -> Vec3:
    """Return the unit vector along which sunlight travels; azimuth from north (-z) to east (+x)."""
    import numpy as np

    from atmoref.elementary import cos, sin

    high, round_ = np.float64(elevation_deg * _RADIANS), np.float64(azimuth_deg * _RADIANS)
    level = float(cos(high))
    return unit_vector((-float(sin(round_)) * level, -float(sin(high)), float(cos(round_)) * level))


class Spot(Table):
    """A point that shines into a cone; I_l is its dimensionless light distribution, at most 1."""

    type: Literal["spot"] = quantity("", "Kind of light.")
    position_m: Vector = quantity("m", "Where the light is [x, y, z].")
    direction: Vector = quantity("", "Axis of the cone, in the direction the light travels. Any length but zero.")
    inner_half_angle_deg: float = quantity(
        "degrees", "From the axis to where the light starts to fall off.", gt=0.0, le=89.0
    )
    outer_half_angle_deg: float = quantity("degrees", "From the axis to where the light ends.", gt=0.0, le=89.0)
    falloff: Literal["smoothstep_cosine", "linear_angle", "none"] = quantity(
        "",
        "From inner to outer cone: x*x*(3 - 2x) with x linear in the cosine; linear in the angle; or full up to the "
        "outer cone.",
        "smoothstep_cosine",
    )
    peak: float = quantity("", "I_l inside the inner cone; a light map stores it in [0, 1].", 1.0, gt=0.0, le=1.0)
    radiant_intensity_w_per_sr: Radiances = quantity("W/sr", "Where I_l is 1; one number or one per channel.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.inner_half_angle_deg > self.outer_half_angle_deg:
            outer = f"at most outer_half_angle_deg, which is {self.outer_half_angle_deg} (degrees)"
            raise contradiction(("inner_half_angle_deg",), f"{self.inner_half_angle_deg}", outer)
        if self.direction == (0.0, 0.0, 0.0):
            raise contradiction(("direction",), "[0, 0, 0]", "a direction of non-zero length")
        return self

    def axis(self) -> Vec3:
        """Return the unit vector along which the light travels (the same bits on every machine)."""
        return unit_vector(self.direction)


class Projector(Table):
    """A point that projects a picture: I_l is the picture's value, bilinear, zero outside."""

    type: Literal["projector"] = quantity("", "Kind of light.")
    position_m: Vector = quantity("m", "Where the light is [x, y, z].")
    direction: Vector = quantity("", "Through the picture's middle, in the direction the light travels. Any length.")
    up: Vector = quantity(
        "", "Where the picture's top edge points; tilt it to roll the picture. Any length.", (0.0, 1.0, 0.0)
    )
    horizontal_half_angle_deg: float = quantity(
        "degrees",
        "From the axis to the middle of the picture's left and right edges; its pixels are square.",
        gt=0.0,
        le=89.0,
    )
    image: FileName = quantity("", f"The picture, 1 or 3 channels, 0 to 1 (PNG, EXR, NPY). {BESIDE}")
    image_encoding: Encoding | None = quantity(
        "", "How its numbers stand for light; left out: srgb for PNG, linear for EXR and NPY.", None
    )
    peak: float = quantity("", "I_l where the picture is 1.", 1.0, gt=0.0, le=1.0)
    radiant_intensity_w_per_sr: Radiances = quantity("W/sr", "Where I_l is 1; one number or one per channel.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for key in ("direction", "up"):
            if getattr(self, key) == (0.0, 0.0, 0.0):
                raise contradiction((key,), "[0, 0, 0]", "a direction of non-zero length")
        if max(map(abs, cross(self.axis(), unit_vector(self.up)))) < LEAST_SINE:
            raise contradiction(("up",), f"{found(self.up)}, parallel to direction", "a direction across it")
        return self

    def axis(self) -> Vec3:
        """Return the unit vector along which the light travels (the same bits on every machine)."""
        return unit_vector(self.direction)


class Window(Table):
    """An opening that the sun shines through: a parallelogram, with a picture in it or clear."""

    center_m: Vector = quantity("m", "Middle of the opening [x, y, z].")
    across_m: Vector = quantity("m", "From its left edge to its right edge [x, y, z].")
    up_m: Vector = quantity("m", "From its bottom edge to its top edge [x, y, z].")
    image: FileName | None = quantity(
        "", f"The glass, 1 or 3 channels, 0 to 1 (PNG, EXR, NPY); left out: clear. {BESIDE}", None
    )
    image_encoding: Encoding | None = quantity(
        "", "How its numbers stand for light; left out: srgb for PNG, linear for EXR and NPY.", None
    )
    peak: float = quantity("", "I_l where the picture is 1, or of the clear opening.", 1.0, gt=0.0, le=1.0)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for key in ("across_m", "up_m"):
            if getattr(self, key) == (0.0, 0.0, 0.0):
                raise contradiction((key,), "[0, 0, 0]", "a vector of non-zero length (m)")
        if max(map(abs, cross(unit_vector(self.across_m), unit_vector(self.up_m)))) < LEAST_SINE:
            raise contradiction(("up_m",), f"{found(self.up_m)}, parallel to across_m", "a vector across it (m)")
        if self.image is None and self.image_encoding is not None:
            raise contradiction(("image_encoding",), found(self.image_encoding), "no image_encoding without an image")
        return self

    def normal(self) -> Vec3:
        """Return a unit vector across the opening."""
        return unit_vector(cross(unit_vector(self.across_m), unit_vector(self.up_m)))


class Sun(Table):
    """Parallel light of infinite distance, everywhere or through a window; without a disc."""

    type: Literal["sun"] = quantity("", "Kind of light.")
    direction: Vector | None = quantity(
        "", "The direction the light travels; any length but zero. Or the two angles.", None
    )
    elevation_deg: float | None = quantity(
        "degrees", "Of the sun above the horizon; with azimuth_deg.", None, ge=-90.0, le=90.0
    )
    azimuth_deg: float | None = quantity(
        "degrees", "Of the sun, from north (-z) to east (+x); with elevation_deg.", None, ge=-360.0, le=360.0
    )
    irradiance_w_per_m2: Radiances = quantity(
        "W/m2", "On a surface that faces the sun, where I_l is 1; one number or one per channel."
    )
    window: Window | None = quantity(
        "", "The opening that the light comes through; left out: none, light everywhere.", None
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        angles = (self.elevation_deg, self.azimuth_deg)
        if (self.direction is None) == (angles == (None, None)) or (None in angles and angles != (None, None)):
            given = ", ".join(k for k in ("direction", "elevation_deg", "azimuth_deg") if getattr(self, k) is not None)
            raise Contradiction(
                Problem(
                    (), f"found {given or 'none of them'}; allowed: either direction, or elevation_deg and azimuth_deg"
                )
            )
        if self.direction == (0.0, 0.0, 0.0):
            raise contradiction(("direction",), "[0, 0, 0]", "a direction of non-zero length")
        if self.window is not None:
            sine = abs(sum(a * b for a, b in zip(self.axis(), self.window.normal(), strict=True)))
            if sine < LEAST_SINE:
                raise contradiction(
                    ("window", "up_m"),
                    f"{found(self.window.up_m)}, so that the light grazes the window",
                    "a window that the light comes through (m)",
                )
        return self

    def axis(self) -> Vec3:
        """Return the unit vector along which the light travels (the same bits on every machine)."""
        if self.direction is not None:
            return unit_vector(self.direction)
        assert self.elevation_deg is not None
        assert self.azimuth_deg is not None
        return sun_axis(self.elevation_deg, self.azimuth_deg)


Light = Spot | Projector | Sun
