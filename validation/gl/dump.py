"""A GL build's buffers as a dump that ``atmoref check`` judges: what an engine would do, with its own read-backs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from atmoref.judge.dumps import DumpWriter

if TYPE_CHECKING:
    from validation.gl.build import Build


def write_dump(build: Build, directory: Path, about: str = "") -> Path:
    """Draw the whole picture on the build's own buffers and write every one of them; return the directory."""
    case = build.case
    formats = {name: fmt.name for name, fmt in case.setting.formats.items()}
    writer = DumpWriter(directory, about or f"validation/gl, {case.format}", bottom_first=True)
    for light in case.lights:
        for key in ("light_map", "q", "q_rest"):
            name = f"{light.prefix}/{key}"
            if name in case.bank:
                writer.add("", name, formats["q" if key.startswith("q") else key], case.codes(name))
    for light, device in zip(case.lights, build.lights, strict=True):
        device.draw_shadow_map()
        name = f"{light.prefix}/shadow_map"
        writer.add(name, name, formats["shadow_map"], device.read_shadow_map())
    build.draw_base()
    writer.add("opaque", "frame", formats["frame"], build.read("frame"))
    writer.add("opaque", "depth", formats["depth"], build.read("depth"))
    for light, device in zip(case.lights, build.lights, strict=True):
        if light.opaque is not None:
            device.draw_opaque()
            writer.add(f"{light.prefix}/opaque", "frame", formats["frame"], build.read("frame"))
    for device in build.lights:
        prefix = device.light.prefix
        if build.fast is None:
            for k in range(len(device.draws.z)):
                device.draw_vertex_planes(k, k + 1)
                writer.add(f"{prefix}/plane_{k:03d}", "frame", formats["frame"], build.read("frame"))
            continue
        first = device.draws.first
        for k in range(len(device.draws.main_z)):
            slab, count = f"{prefix}/slab_{k:03d}", int(first[k + 1] - first[k])
            device.draw_sub_planes(k)
            if count:
                writer.add(f"{slab}/sub_{count - 1:03d}", "f_h", formats["f_h"], build.read("f_h"))
            device.draw_main_plane(k)
            writer.add(f"{slab}/main", "frame", formats["frame"], build.read("frame"))
    writer.close()
    return Path(directory)
