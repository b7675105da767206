"""The tables of a scene file, schema 1: the question (image, camera, lights, medium, objects) and how to answer it."""

from __future__ import annotations

import copy
import datetime
import math
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, Strict, model_validator

from atmoref.scene.camera import Camera, Vec3
from atmoref.scene.describe import Allowed, found
from atmoref.scene.errors import Contradiction, Problem, contradiction
from atmoref.scene.fields import Extinctions, Fractions, Radiances, Table, quantity
from atmoref.scene.lights import Light, Sun
from atmoref.scene.objects import Box, Ground, Object, Sphere

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
    arithmetic: Literal["float32", "float64", "interval"] | None = quantity(
        "", "Precision of the shading; intervals enclose what correct builds may store.", None
    )
    interval: Literal["device", "envelope"] | None = quantity(
        "",
        "With arithmetic = interval: builds on this device (if left out), or on any that the specifications permit.",
        None,
    )
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
        tuple[Annotated[Light, Field(discriminator="type")], ...],
        Strict(False),
        Allowed('one or more [[lights]] tables, each with type = "spot", "projector" or "sun"'),
    ] = quantity("", "The lights; several add up.", min_length=1)
    medium: Medium = quantity("", "What fills the space.")
    objects: Annotated[
        tuple[Annotated[Object, Field(discriminator="type")], ...],
        Strict(False),
        Allowed('[[objects]] tables, each with type = "sphere", "box", "ground", "mesh" or "height_field"'),
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
        if isinstance(light, Sun):
            continue
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
    if not isinstance(item, Box):
        return ""  # triangles enclose nothing for certain
    pairs = list(zip(item.min_m, point, item.max_m, strict=True))
    if all(low < at < high for low, at, high in pairs) or (
        touching and all(low <= at <= high for low, at, high in pairs)
    ):
        return f"inside {name} (box from {found(item.min_m)} to {found(item.max_m)})"
    return ""
