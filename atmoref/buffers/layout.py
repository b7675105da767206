"""Memory of buffers: shape, padding, orientation, and codes packed in words.

Orientation, stated once for the whole program: kernels draw as OpenGL does, *row 0 at the bottom*, so that coordinates
round as they do there. Whatever leaves a buffer (`values`, `codes`) or enters it (`put`) has *row 0 at the top*; the
flip happens here and nowhere else. Texel centres lie at + 1/2 in both. Textures are no pictures: their row 0 is v = 0.

Beyond the border lies nothing: buffers are not read outside, textures clamp to the edge.

A buffer is one flat array: channel after channel, row after row, each row filled up to a multiple of the lane width.
The filling is written by kernels and never handed out.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.buffers.blend import Exact, Mixed, Unorm
from atmoref.buffers.device import DEVICES, Device, Rounding
from atmoref.buffers.formats import Arithmetic, Format, decode, encode
from atmoref.lanes import N

CodeClass = Unorm | Exact | Mixed
LARGEST_SIDE: Final = 1 << 20


def code_class(formats: Iterable[Format], arithmetic: Arithmetic) -> CodeClass:
    """Return the tag of the kernels that can hold all these formats in this arithmetic."""
    held = list(formats)
    if held and all(f.kind == "unorm" and f.bits <= 16 for f in held):
        return Unorm()
    return Exact() if all(f.name == arithmetic for f in held) else Mixed()


def _element(form: CodeClass, arithmetic: Arithmetic) -> np.dtype[Any]:
    """Return the type of a buffer's array."""
    return np.dtype(np.uint16 if isinstance(form, Unorm) else arithmetic)


def row_pitch(width: int) -> int:
    """Return the elements of a row: the width filled up to a multiple of the lane width."""
    return -(-width // N) * N


def needed_bytes(width: int, height: int, channels: int, form: CodeClass, arithmetic: Arithmetic) -> int:
    """Return what `allocate` would take, in bytes.

    Raises
    ------
    ValueError
        A size that no buffer can have.
    """
    for name, size in (("width", width), ("height", height)):
        if not 1 <= size <= LARGEST_SIDE:
            raise ValueError(f"{name} of a buffer is {size}, allowed: 1 ... {LARGEST_SIDE} texels")
    if not 1 <= channels <= 4:
        raise ValueError(f"a buffer has 1 ... 4 channels, not {channels}")
    elements = row_pitch(width) * height * channels
    if elements >= 1 << 31:
        raise ValueError(f"a buffer of {width} x {height} x {channels} has more elements than a 32-bit index reaches")
    return elements * _element(form, arithmetic).itemsize


@dataclass(frozen=True, slots=True)
class Buffer:
    """A named render target: `data` is flat and planar, row 0 at the bottom."""

    name: str
    format: Format
    width: int
    height: int
    channels: int
    pitch: int
    data: NDArray[Any]

    @property
    def plane(self) -> int:
        """Elements from one channel to the next."""
        return self.pitch * self.height

    @property
    def nbytes(self) -> int:
        """Memory of the array."""
        return int(self.data.nbytes)

    def _top_first(self) -> NDArray[Any]:
        """Return a view (H, W, C) of the stored numbers, row 0 at the top."""
        planar = self.data.reshape(self.channels, self.height, self.pitch)
        return np.moveaxis(planar[:, ::-1, : self.width], 0, -1)

    def codes(self) -> NDArray[Any]:
        """Return a copy (H, W, C), row 0 at the top, of type `format.storage`: unorm codes, or numbers."""
        return np.ascontiguousarray(self._top_first().astype(self.format.storage))

    def values(self) -> NDArray[np.float64]:
        """Return the values (H, W, C), row 0 at the top."""
        return decode(self.codes(), self.format)

    def put(self, image: ArrayLike, device: Device = DEVICES["ideal"], rounding: Rounding | None = None) -> None:
        """Store a picture, row 0 at the top, (H, W) for one channel or (H, W, C).

        Integers are codes of a unorm format. Reals are encoded by the device; numbers that the format can represent
        are kept as they are by every device.

        Raises
        ------
        ValueError
            Another shape, codes out of range, or integers for a float format.
        """
        texels = np.asarray(image)
        if texels.ndim == 2:
            texels = texels[..., None]
        if texels.shape != (self.height, self.width, self.channels):
            expected = (self.height, self.width, self.channels)
            raise ValueError(f"buffer {self.name} has shape {expected} (rows, columns, channels), not {texels.shape}")
        target = self._top_first()
        if np.issubdtype(texels.dtype, np.integer):
            top = self.format.top if self.format.kind == "unorm" else -1
            if top < 0:
                raise ValueError(f"integers are codes, which format {self.format.name} of {self.name} does not have")
            if texels.min() < 0 or texels.max() > top:
                found = f"{texels.min()} ... {texels.max()}"
                raise ValueError(f"{self.format.name} of {self.name} has codes 0 ... {top}, found {found}")
            target[...] = texels
            return
        for c in range(self.channels):
            target[..., c] = encode(texels[..., c], self.format, device, rounding=rounding, channel=c)

    def clear(self, code: float = 0) -> None:
        """Set every texel, filling included, to one code (of a float format, to one number)."""
        self.data[...] = code


def allocate(
    name: str,
    fmt: Format,
    width: int,
    height: int,
    channels: int,
    form: CodeClass,
    arithmetic: Arithmetic,
    *,
    max_bytes: int | None = None,
) -> Buffer:
    """Return a cleared buffer for kernels of a code class; sizes are checked before anything is allocated.

    Parameters
    ----------
    name
        Of the buffer, for messages and dumps.
    fmt
        Its format.
    width, height, channels
        In texels; 1 ... 4 channels.
    form, arithmetic
        Of the kernels that use it; see `code_class`.
    max_bytes
        Refuse more than this.

    Raises
    ------
    ValueError
        A size or format that the buffer cannot have.
    MemoryError
        More than `max_bytes`.
    """
    needed = needed_bytes(width, height, channels, form, arithmetic)
    if isinstance(form, Unorm) and (fmt.kind != "unorm" or fmt.bits > 16):
        raise ValueError(f"buffer {name}: kernels of class Unorm hold unorm2 ... unorm16, not {fmt.name}")
    if isinstance(form, Exact) and fmt.name != arithmetic:
        raise ValueError(f"buffer {name}: kernels of class Exact hold {arithmetic}, not {fmt.name}")
    if max_bytes is not None and needed > max_bytes:
        raise MemoryError(f"buffer {name} needs {needed} bytes, allowed: {max_bytes}")
    pitch = row_pitch(width)
    data = np.zeros(pitch * height * channels, _element(form, arithmetic))
    return Buffer(name, fmt, width, height, channels, pitch, data)


# ---- words
def pack_words(codes: ArrayLike, fmt: Format) -> NDArray[np.uint16]:
    """Return codes of 10 or 12 bits in the high bits of 16-bit words, low bits zero, as GPUs lay them out."""
    return np.asarray(np.asarray(codes).astype(np.uint16) << np.uint16(_free_bits(fmt)))


def unpack_words(words: ArrayLike, fmt: Format) -> NDArray[np.uint16]:
    """Return the codes of `pack_words`; low bits are ignored."""
    return np.asarray(np.asarray(words).astype(np.uint16) >> np.uint16(_free_bits(fmt)))


def _free_bits(fmt: Format) -> int:
    if fmt.kind != "unorm" or fmt.bits > 16:
        raise ValueError(f"16-bit words hold unorm2 ... unorm16, not {fmt.name}")
    return 16 - fmt.bits
