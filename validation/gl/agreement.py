"""How far two pictures of codes or values are apart, and the comparison of every stage of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from validation.gl.case import Case
from validation.gl.geometry import mesh_attributes
from validation.gl.interpolation import interpolated, mirrored

if TYPE_CHECKING:
    from validation.gl.build import Build, LightOnDevice


@dataclass(frozen=True, slots=True)
class Agreement:
    """One stage: pixels whose channels all agree in every bit, and the worst difference.

    `worst` is in codes of a unorm format, in units in the last place of a float one; `apart` is the greatest difference
    of values, in codes of a unorm format as well.
    """

    stage: str
    pixels: int
    equal: int
    worst: int
    apart: float
    where: tuple[int, int]  # x, y of the greatest difference of values, row 0 at the bottom

    @property
    def fraction(self) -> float:
        """Of equal pixels."""
        return self.equal / self.pixels


def steps(values: NDArray[Any]) -> NDArray[np.int64]:
    """Return numbers as integers that count representable steps: codes as they are, floats in order of their bits."""
    if not np.issubdtype(values.dtype, np.floating):
        return values.astype(np.int64)
    bits = values.view({2: np.int16, 4: np.int32}[values.dtype.itemsize]).astype(np.int64)
    lowest = -(1 << (8 * values.dtype.itemsize - 1))
    return np.where(bits < 0, lowest - bits, bits)


def agreement(stage: str, device: NDArray[Any], mirror: NDArray[Any]) -> Agreement:
    """Compare (H, W, C) arrays of one type."""
    if device.shape != mirror.shape or device.dtype != mirror.dtype:
        raise ValueError(f"{stage}: {device.dtype} {device.shape} beside {mirror.dtype} {mirror.shape}")
    off = np.abs(steps(device) - steps(mirror)).max(-1)
    apart = np.abs(device.astype(np.float64) - mirror.astype(np.float64)).max(-1)
    y, x = divmod(int(apart.argmax()), off.shape[1])
    return Agreement(stage, off.size, int((off == 0).sum()), int(off.max()), float(apart.max()), (x, y))


def stages(case: Case, build: Build) -> Iterator[Agreement]:
    """Draw stage by stage on both, each on the mirror's previous buffers, and compare what each stores."""
    for light, device in zip(case.lights, build.lights, strict=True):
        case.draw(light.shadow)
        device.draw_shadow_map()
        mirror = case.codes(f"{light.prefix}/shadow_map")
        yield agreement(f"{light.prefix}/shadow_map", device.read_shadow_map(), mirror)
        device.write_shadow_map(mirror)
        case.draw(light.upload)
    case.draw(case.base)
    build.draw_base()
    for name in ("frame", "depth"):
        yield agreement(f"opaque, {name}", build.read(name), case.codes(name))
        build.write(name, case.codes(name))
    for light, device in zip(case.lights, build.lights, strict=True):
        if light.opaque is not None:
            case.draw(light.opaque)
            device.draw_opaque()
            yield agreement(f"{light.prefix}/opaque", build.read("frame"), case.codes("frame"))
            build.write("frame", case.codes("frame"))
    for device in build.lights:
        yield from (_planes if build.fast is None else _slabs)(case, build, device)


def _slabs(case: Case, build: Build, device: LightOnDevice) -> Iterator[Agreement]:
    first, prefix = device.draws.first, device.light.prefix
    for k in range(len(device.draws.main_z)):
        main = int(first[k + 1]) + k
        case.draw(device.light.planes, int(first[k]) + k, main)
        device.draw_sub_planes(k)
        yield agreement(f"{prefix}/slab_{k:03d}/f_h", build.read("f_h"), case.codes("f_h"))
        build.write("f_h", case.codes("f_h"))
        case.draw(device.light.planes, main, main + 1)
        device.draw_main_plane(k)
        yield agreement(f"{prefix}/slab_{k:03d}/main", build.read("frame"), case.codes("frame"))
        build.write("frame", case.codes("frame"))
    yield agreement(f"{prefix}/depth afterwards", build.read("depth"), case.codes("depth"))


def _planes(case: Case, build: Build, device: LightOnDevice) -> Iterator[Agreement]:
    for k in range(len(device.draws.z)):
        case.draw(device.light.planes, k, k + 1)
        device.draw_vertex_planes(k, k + 1)
        yield agreement(f"{device.light.prefix}/plane_{k:03d}", build.read("frame"), case.codes("frame"))
        build.write("frame", case.codes("frame"))


def attributes(case: Case, device: LightOnDevice) -> Iterator[Agreement]:
    """Compare interpolated u, v and colour of every plane with the mirror's rule and with llvmpipe's own."""
    switches = device.uniforms.slab_switches
    mesh = (switches.mesh_x, switches.mesh_y)
    uv, colours = mesh_attributes(device.given)
    names = ("u", "v", "r", "g") if uv.any() else ("", "", "r", "g")
    for k in range(len(uv)):
        drawn = device.draw_attributes(k)
        for channel, name in enumerate(names):
            values = (uv if channel < 2 else colours)[k, :, channel % 2]
            for rule, function in (("mirror", mirrored), ("llvmpipe", interpolated)) if name else ():
                expected = function(values, mesh, case.size)[..., None]
                stage = f"{device.light.prefix}/plane_{k:03d}, {name} by the rule of {rule}"
                yield agreement(stage, drawn[..., channel : channel + 1], expected)


def whole(case: Case, build: Build) -> Agreement:
    """Draw the whole picture on both, each on its own buffers, and compare the frames."""
    picture = build.draw_all()
    for light in case.lights:
        case.draw(light.shadow)
        case.draw(light.upload)
    case.draw(case.base)
    for light in case.lights:
        if light.opaque is not None:
            case.draw(light.opaque)
    for light in case.lights:
        case.draw(light.planes)
    return agreement("frame, own buffers throughout", picture, case.codes("frame"))
