"""The tables of a scene file, schema 1: the question (image, camera, lights, medium, objects) and how to answer it."""

from __future__ import annotations

import copy
import datetime
import math
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, Strict, model_validator

from atmoref.scene.camera import Camera, Vec3, unit_vector
from atmoref.scene.describe import Allowed, found
from atmoref.scene.errors import Contradiction, Problem, contradiction
from atmoref.scene.fields import FARTHEST_M, Extinctions, Fractions, Radiances, Table, Vector, quantity

MAX_PIXELS = 1 << 26
FormatName = Literal[
    "unorm2",
    "unorm8",
    "unorm10",
    "unorm12",
    "unorm16",
    "depth24",
    "float16",
    "r11g11b10f",
    "float32",
    "float64",
]
DeviceName = Literal["ideal", "gl_llvmpipe", "geforce3", "geforce_fx"]
RoundingName = Literal["nearest_even", "half_up", "truncate"]
PhaseName = Literal["isotropic", "henyey_greenstein", "rayleigh", "nishita_hazy", "nishita_murky", "cornette_shanks"]
PHASES_WITH_G = ("henyey_greenstein", "cornette_shanks")


class Image(Table):
    """The picture's size and what its channels stand for."""

    width: int = quantity("pixels", "Columns.", ge=1, le=16384)
    height: int = quantity("pixels", "Rows; row 0 is at the top.", ge=1, le=16384)
    wavelengths_nm: Annotated[
        tuple[float, float, float], Strict(False), Allowed("a list of three numbers, each >= 10 and <= 1e6")
    ] = quantity("nm", "What the three channels of every colour stand for.", (680.0, 550.0, 440.0))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.width * self.height > MAX_PIXELS:
            pixels = f"{self.width} x {self.height} = {self.width * self.height} pixels"
            raise contradiction((), pixels, f"width times height <= {MAX_PIXELS} pixels")
        if not all(10.0 <= wavelength <= 1e6 for wavelength in self.wavelengths_nm):
            raise contradiction(("wavelengths_nm",), found(self.wavelengths_nm), "three numbers >= 10 and <= 1e6 (nm)")
        return self


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


class PhaseFunction(Table):
    """How the medium spreads light; integrates to 1 over the sphere; cosine 1 is forward."""

    type: PhaseName = quantity("", "Which phase function.", "isotropic")
    g: Annotated[float, Field(gt=-1.0, lt=1.0)] = quantity(
        "", "Mean cosine (henyey_greenstein) or asymmetry (cornette_shanks); only these two take it.", 0.0
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.type in PHASES_WITH_G and "g" not in self.model_fields_set:
            raise Contradiction(Problem(("g",), f"missing; needed by {self.type}: a number, > -1 and < 1"))
        if self.type not in PHASES_WITH_G and "g" in self.model_fields_set:
            raise contradiction(
                ("g",), f"{self.g}", f"no g with {self.type}; only {' and '.join(PHASES_WITH_G)} take it"
            )
        return self


class Medium(Table):
    """A uniform participating medium that fills all space."""

    extinction_per_m: Extinctions = quantity("1/m", "Extinction coefficient; one number or one per channel.")
    single_scattering_albedo: Fractions = quantity("", "Scattering over extinction; one number or one per channel.")
    phase_function: PhaseFunction = quantity("", "How light is spread.", PhaseFunction())
    ambient_radiance: Radiances = quantity(
        "W/(m2 sr)", "Added to every pixel (I_a); one number or one per channel.", (0.0, 0.0, 0.0)
    )


class Sphere(Table):
    """A solid sphere."""

    type: Literal["sphere"] = quantity("", "Kind of object.")
    center_m: Vector = quantity("m", "Centre [x, y, z].")
    radius_m: float = quantity("m", "Radius.", gt=0.0, le=FARTHEST_M)
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")


class Box(Table):
    """A solid box with faces along the axes."""

    type: Literal["box"] = quantity("", "Kind of object.")
    min_m: Vector = quantity("m", "Corner with the least coordinates [x, y, z].")
    max_m: Vector = quantity("m", "Corner with the greatest coordinates [x, y, z].")
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not all(low < high for low, high in zip(self.min_m, self.max_m, strict=True)):
            below = f"less than max_m = {found(self.max_m)} in every coordinate (m)"
            raise contradiction(("min_m",), found(self.min_m), below)
        return self


class Ground(Table):
    """The plane y = height, seen from both sides."""

    type: Literal["ground"] = quantity("", "Kind of object.")
    height_m: float = quantity("m", "Height y of the plane.", 0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    albedo: Fractions = quantity("", "Lambert reflectance; one number or one per channel.")


Object = Sphere | Box | Ground


class Technique(Table):
    """Which method answers, and its parameters: all further keys, which the technique itself checks."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Any] = Field(init=False)

    name: (
        Annotated[
            str,
            Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=64),
            Allowed('text of lower-case letters, digits and underscores, e.g. "beams"'),
        ]
        | None
    ) = quantity("", "Name of the technique (atmoref techniques lists them), or truth.", None)
    preset: Literal["paper", "corrected", "analysis"] = quantity(
        "", "Where the parameters that are not given come from.", "corrected"
    )

    @model_validator(mode="after")
    def _plain(self) -> Self:
        problems = [problem for key, value in self.parameters.items() for problem in _unstorable((key,), value)]
        if problems:
            raise Contradiction(*problems)
        return self

    @property
    def parameters(self) -> dict[str, Any]:
        """A copy of the keys beside name and preset."""
        return copy.deepcopy(self.__pydantic_extra__ or {})


def _unstorable(path: tuple[str | int, ...], value: Any) -> list[Problem]:
    """Return what in a technique's parameter is neither text, number, truth value, list nor table."""
    if isinstance(value, dict):
        return [problem for key, item in value.items() for problem in _unstorable((*path, key), item)]
    if isinstance(value, list | tuple):
        return [problem for index, item in enumerate(value) for problem in _unstorable((*path, index), item)]
    if isinstance(value, float) and not math.isfinite(value):
        return [Problem(path, f"found {value}; allowed: a finite number")]
    if isinstance(value, datetime.date | datetime.time) or not isinstance(value, bool | int | float | str):
        return [Problem(path, f"found {found(value)}; allowed: numbers, text, true, false, lists, tables")]
    return []


class BufferFormat(Table):
    """How one named buffer is stored."""

    format: FormatName = quantity("", "Storage format of this buffer.")


class Buffers(Table):
    """How numbers are stored and rounded; what is left out is the technique's own default."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, BufferFormat] = Field(init=False)

    format: FormatName | None = quantity("", "Storage format of the frame.", None)
    arithmetic: Literal["float32", "float64"] | None = quantity("", "Precision of the shading.", None)
    device: DeviceName = quantity("", "Whose rules for storing, filtering and comparing.", "ideal")
    rounding: RoundingName | None = quantity("", "How unorm stores round, where the device leaves it open.", None)

    @property
    def per_buffer(self) -> dict[str, BufferFormat]:
        """The tables [buffers.NAME], by name."""
        return dict(self.__pydantic_extra__ or {})


class SceneFile(Table):
    """A whole scene file."""

    schema_version: Literal[1] = quantity("", "Version of this file format.", alias="schema")
    image: Image = quantity("", "The picture.")
    camera: Camera = quantity("", "The eye.")
    lights: Annotated[
        tuple[Spot, ...], Strict(False), Allowed('one or more [[lights]] tables, each with type = "spot"')
    ] = quantity("", "The lights; several add up.", min_length=1)
    medium: Medium = quantity("", "What fills the space.")
    objects: Annotated[
        tuple[Annotated[Object, Field(discriminator="type")], ...],
        Strict(False),
        Allowed('[[objects]] tables, each with type = "sphere", "box" or "ground"'),
    ] = quantity("", "Opaque things that are seen and cast shadows.", ())
    technique: Technique = quantity("", "How to answer.", Technique())
    buffers: Buffers = quantity("", "How numbers are stored on the way.", Buffers())

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problems = [*_misplaced_lights(self), *_misplaced_eye(self)]
        if problems:
            raise Contradiction(*problems)
        return self


def _misplaced_eye(scene: SceneFile) -> list[Problem]:
    eye = scene.camera.position_m
    return [
        Problem(("camera", "position_m"), f"found {found(eye)}, which is {where}; allowed: a point outside (m)")
        for index, item in enumerate(scene.objects)
        if (where := _inside(eye, item, f"objects[{index}]", touching=True))
    ]


def _misplaced_lights(scene: SceneFile) -> list[Problem]:
    problems = []
    for number, light in enumerate(scene.lights):
        path, at = ("lights", number, "position_m"), light.position_m
        if at == scene.camera.position_m:
            problems.append(Problem(path, f"found {found(at)}, the camera's position; allowed: another point (m)"))
        for index, item in enumerate(scene.objects):
            if where := _inside(at, item, f"objects[{index}]", touching=False):
                problems.append(Problem(path, f"found {found(at)}, which is {where}; allowed: a point outside (m)"))
    return problems


def _inside(point: Vec3, item: Object, name: str, *, touching: bool) -> str:
    """Return in which object a point lies, or nothing; a surface counts as inside only when touching."""
    if isinstance(item, Ground):
        return f"in the plane of {name} (ground at y = {item.height_m} m)" if point[1] == item.height_m else ""
    if isinstance(item, Sphere):
        offset = [a - b for a, b in zip(point, item.center_m, strict=True)]
        distance = math.hypot(*offset)
        if distance < item.radius_m or (touching and distance == item.radius_m):
            return f"inside {name} (sphere at {found(item.center_m)}, radius {item.radius_m} m)"
        return ""
    pairs = list(zip(item.min_m, point, item.max_m, strict=True))
    if all(low < at < high for low, at, high in pairs) or (
        touching and all(low <= at <= high for low, at, high in pairs)
    ):
        return f"inside {name} (box from {found(item.min_m)} to {found(item.max_m)})"
    return ""
