"""How one render stores and computes: formats, code class, arithmetic, device, window.  Shared by all techniques."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from atmoref.buffers.blend import Mixed
from atmoref.buffers.bounds import Bounds, allocate_bounds
from atmoref.buffers.device import DEVICES, Device, Rounding, Rule, rule
from atmoref.buffers.formats import FORMATS, Format
from atmoref.buffers.interval_blend import RuleBounds, rule_bounds
from atmoref.buffers.interval_sampler import TextureBounds, texture_bounds
from atmoref.buffers.layout import Buffer, CodeClass, allocate, code_class, needed_bytes
from atmoref.buffers.sampler import Texture, texture
from atmoref.lanes import Double, Interval, N, Single
from atmoref.memory import Account
from atmoref.pipeline import Bank
from atmoref.scene import Scene, SceneError
from atmoref.scene.errors import nearest

Crop = tuple[int, int, int, int]
Arithmetic = Literal["float32", "float64", "interval"]
Rules = tuple[Rule, Rule, Rule] | tuple[RuleBounds, RuleBounds, RuleBounds]
Readable = Texture | TextureBounds
TEXTURE_COPIES = 8  # of a buffer's bytes while a texture is made of it (measured: up to 7.5; codes, padded, packed)


@dataclass(frozen=True, slots=True)
class Setting:
    """Formats by buffer name, and what kernels are compiled and run with."""

    scene: Scene
    formats: Mapping[str, Format]
    arithmetic: Arithmetic
    device: Device
    rounding: Rounding | None
    form: CodeClass
    crop: Crop | None
    account: Account
    envelope: bool = False  # of intervals: any rounding that the specifications permit

    @property
    def intervals(self) -> bool:
        """Whether values are intervals."""
        return self.arithmetic == "interval"

    @property
    def arith(self) -> Single | Double | Interval:
        """The tag of the lanes."""
        if self.intervals:
            budget = self.device.budget
            weight = budget.weight_permitted if self.envelope else budget.weight
            return Interval(budget.coordinate, budget.attribute, weight)
        return self.point_arith

    @property
    def point_arithmetic(self) -> Literal["float32", "float64"]:
        """The arithmetic of what is a point for intervals too: arrays of the host, and triangles as they are drawn."""
        return "float64" if self.arithmetic == "float64" else "float32"

    @property
    def point_arith(self) -> Single | Double:
        """Its tag."""
        return Double() if self.arithmetic == "float64" else Single()

    @property
    def dtype(self) -> type[np.floating[Any]]:
        """The element type of the lanes."""
        return np.float64 if self.arithmetic == "float64" else np.float32

    def rules(self, name: str) -> Rules:
        """Return the rules of a buffer's three channels."""
        fmt = self.formats[name]
        if self.intervals:
            override, envelope = self.rounding_of(fmt), self.envelope
            d, e, f = (rule_bounds(fmt, self.device, override, channel, envelope=envelope) for channel in range(3))
            return d, e, f
        a, b, c = (rule(fmt, self.device, self.rounding_of(fmt), channel) for channel in range(3))
        return a, b, c

    def rounding_of(self, fmt: Format) -> Rounding | None:
        """Return the scene's override where it applies: stores of unorm codes."""
        return self.rounding if fmt.kind == "unorm" else None

    def target(self, bank: Bank, name: str, key: str, width: int, height: int, channels: int = 3) -> Buffer:
        """Allocate a render target of the frame's code class and enter it as `key`."""
        return self._allocate(bank, name, key, width, height, channels, self.form)

    def depth_target(self, bank: Bank, name: str, key: str, width: int, height: int) -> Buffer:
        """Allocate a depth buffer: always of class Mixed, so that kernels have one type of it."""
        return self._allocate(bank, name, key, width, height, 1, Mixed(), read=name != "depth")

    def _allocate(
        self,
        bank: Bank,
        name: str,
        key: str,
        width: int,
        height: int,
        channels: int,
        form: CodeClass,
        read: bool = False,
    ) -> Buffer:
        real = self.point_arithmetic
        ends = (2 if self.intervals else 1) * (1 + TEXTURE_COPIES if read else 1)
        needed = ends * needed_bytes(width, height, channels, form, real)
        self.account.require(needed, f"buffer {key} ({width} x {height})", keep=True)
        fmt = self.formats[name]
        if self.intervals:
            bank[key] = allocate_bounds(key, fmt, width, height, channels)
        else:
            bank[key] = allocate(key, fmt, width, height, channels, form, real)
        return bank[key]

    def image(self, bank: Bank, name: str, key: str, values: NDArray[np.float64]) -> Buffer:
        """Enter a texture that the host computed, (H, W) or (H, W, C), row 0 at v = 0, encoded by the device."""
        texels = values if values.ndim == 3 else values[..., None]
        height, width, channels = texels.shape
        buffer = self._allocate(bank, name, key, width, height, channels, Mixed(), read=True)
        buffer.put(texels[::-1], self.device, self.rounding_of(self.formats[name]))
        return buffer

    def texture(self, buffer: Buffer, compare: Literal["nearest", "pcf"] = "nearest") -> Readable:
        """Return a buffer as a texture."""
        if isinstance(buffer, Bounds):
            low, high = self._texture(buffer.low.codes(), buffer.format, compare), buffer.high.codes()
            return self._bounds(low, self._texture(high, buffer.format, compare), buffer.format)
        return self._texture(buffer.codes(), buffer.format, compare)

    def blank(self, value: float, fmt: Format) -> Readable:
        """Return a texture of one texel, for a read that a scene does not make."""
        one = texture(np.full((1, 1), value), fmt, self.device, self.dtype, filter="exact")
        return self._bounds(one, one, fmt) if self.intervals else one

    def _texture(self, codes: NDArray[Any], fmt: Format, compare: Literal["nearest", "pcf"]) -> Texture:
        return texture(codes[::-1], fmt, self.device, self.dtype, compare=compare)

    def _bounds(self, low: Texture, high: Texture, fmt: Format) -> TextureBounds:
        return texture_bounds(low, high, eight_bits=fmt.name == "unorm8", envelope=self.envelope)

    def window(self) -> tuple[int, int, int, int]:
        """Return columns and rows to draw, row 0 at the bottom; the first column is a multiple of the lane width."""
        width, height = self.scene.image.width, self.scene.image.height
        if self.crop is None:
            return 0, width, 0, height
        x, y, w, h = self.crop
        return x // N * N, x + w, height - y - h, height - y


def check_crop(scene: Scene, crop: Crop | None) -> None:
    """Refuse a crop that is not inside the image.

    Raises
    ------
    SceneError
    """
    if crop is None:
        return
    x, y, w, h = crop
    width, height = scene.image.width, scene.image.height
    if w < 1 or h < 1 or x < 0 or y < 0 or x + w > width or y + h > height:
        raise SceneError(
            f"{scene.origin}: crop: found x {x}, y {y}, {w} x {h}; allowed: inside the {width} x {height} image, "
            f"at least 1 x 1 pixel"
        )


def make_setting(
    scene: Scene, defaults: Mapping[str, str], arithmetic: Arithmetic, crop: Crop | None, account: Account
) -> Setting:
    """Return the setting of a scene.

    Parameters
    ----------
    scene : Scene
    defaults : mapping of buffer name to format name
        `frame` and those that a scene may set under [buffers.NAME]; the value "frame" follows the frame.
    arithmetic : str
        Of the preset; the scene may override it.
    crop : (x, y, width, height) or None
    account : Account
        Where memory is asked for.

    Raises
    ------
    SceneError
        Unknown buffer name, or a format that a buffer cannot have.
    """
    asked = scene.buffers
    names = dict(defaults)
    if asked.format is not None:
        names["frame"] = asked.format
    for name, entry in asked.per_buffer.items():
        if name not in defaults or name == "frame":
            known = [n for n in defaults if n != "frame"]
            raise SceneError(
                f"{scene.origin}: buffers.{name}: no such buffer{nearest(name, known)}; "
                f"allowed: {', '.join(known)}, and buffers.format for the frame"
            )
        names[name] = entry.format
    formats = {n: FORMATS[names["frame"] if f == "frame" else f] for n, f in names.items()}
    for name in formats:
        _check_format(scene, name, formats[name])
    chosen = asked.arithmetic or arithmetic
    device = DEVICES[asked.device]
    if asked.rounding is not None and not device.rounding_is_open:
        raise SceneError(
            f"{scene.origin}: buffers.rounding: found {asked.rounding!r}; device {device.name} decides its rounding "
            f"itself; allowed: no rounding, or device ideal, geforce3 or geforce_fx"
        )
    blended = [formats[n] for n in ("frame", "f_h") if n in formats]
    form = Mixed() if chosen == "interval" else code_class(blended, chosen)
    return Setting(
        scene, formats, chosen, device, asked.rounding, form, crop, account, asked.interval == "envelope"
    )  # fmt: skip


def _check_format(scene: Scene, name: str, fmt: Format) -> None:
    depth = ("depth", "shadow_map")
    allowed = [f for f in FORMATS if (name in depth) == (f in ("depth24", "float32", "float64", "unorm16"))]
    if name not in depth:
        allowed = [f for f in FORMATS if f != "depth24"]
    if fmt.name not in allowed:
        key = "buffers.format" if name == "frame" else f"buffers.{name}.format"
        raise SceneError(f"{scene.origin}: {key}: found {fmt.name!r}; allowed: {', '.join(allowed)}")
