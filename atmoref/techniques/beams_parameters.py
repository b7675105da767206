"""Parameters of the light-beam techniques: every reading of an erratum is a key, a preset is a set of values."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, Strict, model_validator

from atmoref.scene.describe import Allowed
from atmoref.scene.errors import contradiction
from atmoref.scene.fields import Table, quantity

MAX_PLANES = 4096
MAX_SUB_PLANES = 65536  # of one light
MAX_TEXTURE = 8192

Cells = Annotated[
    tuple[Annotated[int, Field(ge=1, le=1024)], Annotated[int, Field(ge=1, le=1024)]],
    Strict(False),
    Allowed("a list of two whole numbers [columns, rows], each >= 1 and <= 1024"),
]
_Distance = Annotated[float, Field(gt=0.0, le=1e6)]


def _several(value: Any) -> Any:
    """Return one number as a list of one; anything else as it is."""
    return (value,) if isinstance(value, int | float) and not isinstance(value, bool) else value


Distances = Annotated[
    tuple[_Distance, ...],
    Field(min_length=1),
    Strict(False),
    BeforeValidator(_several, json_schema_input_type=_Distance | list[_Distance]),
    Allowed("one number for all lights, or a list with one number per light, each > 0 and <= 1e6 (m)"),
]


class SpotlightParameters(Table):
    """What both light-beam techniques share: the light's maps, the mesh, the opaque scene, the extent of the planes."""

    base_distance_m: Distances | None = quantity(
        "m", "Length d_0 of the light's bounding pyramid, one number or one per light; left out: to the ground.", None
    )
    bounds: Literal["depth", "euclid"] = quantity(
        "", "Extent of the pyramid: along the optical axis, or as distances from the eye as printed (D-E9).", "depth"
    )
    dt_mode: Literal["paper", "cosine", "exact"] = quantity(
        "",
        "Length of a ray in a slab (D-E6): dt for all pixels as published; times 1/cos psi; or cut exactly "
        "(beams: only with q = exact).",
        "cosine",
    )
    coordinates: Literal["vertex", "pixel"] = quantity(
        "", "Where texture coordinates and vertex colours are computed (D-E15).", "pixel"
    )
    mesh: Cells = quantity("cells", "Mesh of each plane [columns, rows], used with coordinates = vertex.", (10, 15))
    visibility: Literal["shadow_map", "exact"] = quantity("", "How shadows are found.", "shadow_map")
    shadow_map_size: int = quantity("texels", "Edge of the square shadow map.", 512, ge=1, le=MAX_TEXTURE)
    shadow_filter: Literal["nearest", "pcf"] = quantity(
        "", "One compare, or four weighted ones (percentage-closer).", "pcf"
    )
    shadow_bias_m: float = quantity(
        "m", "How far in front of a point its shadow is looked up, against self-shadowing.", 0.1, ge=0.0, le=1e6
    )
    shadow_near_m: float = quantity("m", "Near plane of the shadow map.", 0.5, gt=0.0, le=1e6)
    light_distribution: Literal["light_map", "exact"] = quantity(
        "", "I_l from a projected texture or in closed form.", "light_map"
    )
    light_map_size: int = quantity("texels", "Edge of the square light map.", 256, ge=1, le=MAX_TEXTURE)
    albedo_in_source: bool = quantity(
        "", "rho F = I_0 sigma_s p; false reads it without the albedo, I_0 sigma_t p (D-E2).", True
    )
    scattering_angle: Literal["forward", "backward"] = quantity(
        "", "cos alpha = -u'/s, forward at 0; or the opposite sign (D-E3).", "forward"
    )
    surface_fog: Literal["transmittance", "printed"] = quantity(
        "", "Surfaces seen through exp(-sigma_t T), or through g(T) as printed (D-E1).", "transmittance"
    )
    ambient: Literal["constant", "saturating"] = quantity(
        "", "I_a as it is, or I_a (1 - exp(-sigma_t T)) (D-E34).", "constant"
    )
    skip: bool = quantity("", "Leave out what contributes exactly nothing; the bits stay.", True)


class BeamsParameters(SpotlightParameters):
    """Keys of [technique] name = "beams": main planes with a q table, sub-planes for light and shadow."""

    interval_m: float | None = quantity(
        "m", "Spacing dt of the main planes; left out: by the paper's rule.", None, gt=0.0, le=1e6
    )
    delta_min_m: float = quantity("m", "Step in which the rule tries dt.", 0.1, gt=0.0, le=1e6)
    delta_max_m: float = quantity("m", "Greatest dt that the rule tries.", 2.0, gt=0.0, le=1e6)
    v_ref_m: float | None = quantity(
        "m",
        "The rule looks at q from this distance to the light on (D-E8); left out: a fifth of base_distance_m.",
        None,
        gt=0.0,
        le=1e6,
    )
    i_max: float = quantity("", "Greatest value a table holds.", 1.0, gt=0.0, le=1e6)
    interval_rule: Literal["last_below", "first_above"] = quantity(
        "", "dt is the last step whose q stays below i_max, or, as printed, the first above (D-E7).", "last_below"
    )
    plane_count: Literal["floor", "ceil"] = quantity(
        "", "Rounding of (t_max - t_min) / dt in the number of planes (D-E9).", "floor"
    )
    epsilon: float = quantity("", "A slab gets one sub-plane for each epsilon of f_l on the centre ray.", 0.01, gt=0.0)
    sub_plane_rule: Literal["floor", "ceil", "one"] = quantity(
        "", "Rounding of f_l / epsilon (D-E11), or no sub-planes beyond the main plane itself.", "floor"
    )
    sub_plane_positions: Literal["printed", "left", "mid", "trap"] = quantity(
        "",
        "Depth of sub-plane j in its slab: j/(m-1), j/m, (j+1/2)/m, or j/(m-1) with half weights at the ends (D-E10).",
        "mid",
    )
    sub_plane_weights: Literal["equal", "telescoped"] = quantity(
        "", "1/m each, or codes that add up to the format's top (D-E12).", "telescoped"
    )
    sub_plane_depth_test: bool = quantity(
        "", "Sub-planes behind a surface are not drawn, so f_h carries the part of the slab in front (D-E33).", True
    )
    f_h: Literal["mean", "printed"] = quantity(
        "", "f_h is the mean over the slab, or the integral as printed, dt times too large (D-E5).", "mean"
    )
    q: Literal["table", "exact"] = quantity("", "q from a texture, or integrated for each pixel and plane.", "table")
    q_table_size: int = quantity("texels", "Edge of the square q table.", 256, ge=2, le=MAX_TEXTURE)
    q_least_v_m: float = quantity("m", "Least distance from the light in the table.", 0.05, gt=0.0, le=1e6)
    q_storage: Literal["clamped", "scaled", "overflow", "split", "unclamped"] = quantity(
        "",
        "q clamped at i_max as published; divided by the greatest useful q; clamped, with the rest in a second "
        "channel; high and low byte in two channels; or as it is (float formats).",
        "overflow",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.dt_mode == "exact" and self.q != "exact":
            raise contradiction(("dt_mode",), '"exact"', '"paper" or "cosine" with q = "table" (a table has one dt)')
        if self.dt_mode == "exact" and self.coordinates != "pixel":
            raise contradiction(("dt_mode",), '"exact"', '"paper" or "cosine" with coordinates = "vertex"')
        if self.delta_min_m > self.delta_max_m:
            raise contradiction(
                ("delta_min_m",), f"{self.delta_min_m}", f"at most delta_max_m = {self.delta_max_m} (m)"
            )
        return self


class BeamsVertexParameters(SpotlightParameters):
    """Keys of [technique] name = "beams_vertex": the previous method, g dt at the vertices of many planes."""

    dt_mode: Literal["paper", "cosine"] = quantity(
        "", "Length of a ray between planes (D-E6): dt for all pixels as published, or times 1/cos psi.", "cosine"
    )
    mesh: Cells = quantity("cells", "Mesh of each plane [columns, rows], used with coordinates = vertex.", (60, 90))
    planes: int = quantity("", "Number of planes between both ends of the pyramid.", 40, ge=1, le=MAX_PLANES)
    plane_positions: Literal["left", "mid"] = quantity("", "Where in its interval a plane stands.", "left")


class BeamsInterleavedParameters(SpotlightParameters):
    """Keys of [technique] name = "beams_interleaved": images with shifted planes, averaged or put side by side."""

    dt_mode: Literal["paper", "cosine"] = quantity(
        "", "Length of a ray between planes (D-E6): dt for all pixels as published, or times 1/cos psi.", "cosine"
    )
    mesh: Cells = quantity("cells", "Mesh of each plane [columns, rows], used with coordinates = vertex.", (10, 15))
    planes: int = quantity("", "Number of planes of each image.", 40, ge=1, le=MAX_PLANES)
    images: int = quantity(
        "", "Number of images; image i shifts its planes by i / images of their spacing.", 4, ge=1, le=64
    )
    composition: Literal["average", "interleave"] = quantity(
        "",
        "The mean of full images, as published; or n x n images of 1 / n the resolution put together, pixel by pixel.",
        "average",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.composition == "interleave" and math.isqrt(self.images) ** 2 != self.images:
            raise contradiction(("images",), f"{self.images}", 'a square number with composition = "interleave"')
        return self


_SHARED_ANALYSIS: dict[str, Any] = {
    "coordinates": "pixel", "visibility": "exact", "light_distribution": "exact", "dt_mode": "cosine",
}  # fmt: skip
PRESETS: dict[str, dict[str, dict[str, Any]]] = {
    "beams": {
        "paper": {
            "dt_mode": "paper", "coordinates": "vertex", "shadow_filter": "nearest",
            "sub_plane_positions": "printed", "sub_plane_weights": "equal", "q_storage": "clamped",
        },
        "corrected": {},
        "analysis": {**_SHARED_ANALYSIS, "q": "exact", "sub_plane_weights": "equal"},
    },
    "beams_vertex": {
        "paper": {"dt_mode": "paper", "coordinates": "vertex", "shadow_filter": "nearest"},
        "corrected": {"plane_positions": "mid"},
        "analysis": {**_SHARED_ANALYSIS},
    },
    "beams_interleaved": {
        "paper": {"dt_mode": "paper", "coordinates": "vertex", "shadow_filter": "nearest"},
        "corrected": {},
        "analysis": {**_SHARED_ANALYSIS},
    },
}  # fmt: skip
"""Per technique and preset: what differs from the defaults of the model."""
