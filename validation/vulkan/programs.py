"""WGSL pipelines: includes, bindings and struct layouts read from the shaders, uniforms from named tuples."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from atmoref.stages.ray_cast import Solids
from validation.gl.programs import exp_constants

SHADERS = Path(__file__).parent / "shaders"
_INCLUDE = re.compile(r'^#include "([a-z_.]+)"\n', re.MULTILINE)
_BINDING = re.compile(r"@group\(0\) @binding\((\d+)\) var(?:<([a-z, ]+)>)? (\w+): ([\w<>]+);")
_OVERRIDE = re.compile(r"^override (\w+): ", re.MULTILINE)
_STRUCT = re.compile(r"^struct (\w+) \{(.*?)^\}", re.MULTILINE | re.DOTALL)
_FIELD = re.compile(r"(\w+): f32")

SPHERE = np.dtype([("centre", "f4", 3), ("radius", "f4"), ("scale", "f4"), ("id", "i4"), ("", "V8")])
BOX = np.dtype([("low", "f4", 3), ("id", "i4"), ("high", "f4", 3), ("", "V4")])
GROUND = np.dtype([("height", "f4"), ("id", "i4")])


@cache
def source(name: str) -> str:
    """Return a shader's text with its includes, and with the constants of the mirror's exp before it."""

    def included(match: re.Match[str]) -> str:
        return (SHADERS / match[1]).read_text(encoding="utf-8")

    text = _INCLUDE.sub(included, (SHADERS / name).read_text(encoding="utf-8"))
    lines = [f"const {key}: f32 = {value!r};" for key, value in exp_constants().items()]
    return "\n".join((*lines, text))


def fields(name: str, struct: str) -> list[str]:
    """Return the members of a struct of f32 in the shader's order."""
    (body,) = (body for found, body in _STRUCT.findall(source(name)) if found == struct)
    return _FIELD.findall(re.sub("//.*", "", body))


def _layout(space: str, kind: str) -> dict[str, Any]:
    """Return what WebGPU wants to know of a binding, besides number and stages."""
    if space:
        return {"buffer": {"type": "uniform" if space == "uniform" else "read-only-storage"}}
    if kind.startswith("sampler"):
        return {"sampler": {"type": "comparison" if kind.endswith("comparison") else "filtering"}}
    return {"texture": {"sample_type": "depth" if kind == "texture_depth_2d" else "float"}}


class Program:
    """One pass as a pipeline: `bind` what its shader names, then draw.

    Parameters
    ----------
    device : wgpu.GPUDevice
    name : str
        Of the fragment shader's file; its vertex stage is `plane.wgsl`.
    switches : mapping
        Values of the shader's overrides; those that it does not have are let pass.
    colour : str or None
        Format of the colour target.
    depth : str
        "write", "test" or "none".
    blend : bool
        ONE, ONE instead of replacing.
    """

    def __init__(
        self, device: Any, name: str, switches: Mapping[str, int], colour: str | None, depth: str, blend: bool
    ) -> None:
        self.device, self.name = device, name
        text = source(name)
        self.bindings = {found[2]: (int(found[0]), found[1], found[3]) for found in _BINDING.findall(text)}
        visible = wgpu.ShaderStage.VERTEX | wgpu.ShaderStage.FRAGMENT
        entries = [
            {"binding": number, "visibility": visible, **_layout(space, kind)}
            for number, space, kind in self.bindings.values()
        ]
        self.layout = device.create_bind_group_layout(entries=entries)
        constants = {key: switches.get(key, 0) for key in _OVERRIDE.findall(text)}
        module = device.create_shader_module(code=text)
        one = {"src_factor": "one", "dst_factor": "one", "operation": "add"}
        target = {"format": colour, **({"blend": {"color": one, "alpha": one}} if blend else {})}
        compare = {"depth_compare": "less" if depth == "test" else "always", "depth_write_enabled": depth == "write"}
        self.pipeline = device.create_render_pipeline(
            layout=device.create_pipeline_layout(bind_group_layouts=[self.layout]),
            vertex={"module": module, "entry_point": "cover"},
            primitive={"topology": "triangle-strip"},
            depth_stencil=None if depth == "none" else {"format": "depth24plus", **compare},
            fragment={
                "module": module, "entry_point": "main", "targets": [target] if colour else [],
                "constants": constants,
            },
        )  # fmt: skip

    def bind(self, given: Mapping[str, Any]) -> Any:
        """Return the bind group of what the shader names, out of buffers, texture views and samplers."""
        entries = []
        for name, (number, space, _) in self.bindings.items():
            entries.append({"binding": number, "resource": {"buffer": given[name]} if space else given[name]})
        return self.device.create_bind_group(layout=self.layout, entries=entries)


def buffer(device: Any, data: NDArray[Any], usage: str = "STORAGE") -> Any:
    """Return a buffer of an array; one element of zeros where it is empty, which WebGPU wants."""
    held = np.ascontiguousarray(data) if data.size else np.zeros(1, data.dtype)
    padded = held.tobytes() + bytes(-held.nbytes % 16)
    return device.create_buffer_with_data(data=padded, usage=getattr(wgpu.BufferUsage, usage))


def uniforms(device: Any, shader: str, struct: str, values: Any) -> Any:
    """Return the uniform buffer of a struct from the named tuple of the same fields.

    The mirror keeps uniforms as float64 and rounds them once to float32 when a kernel starts; so does this.
    """
    return buffer(device, np.array([getattr(values, f) for f in fields(shader, struct)], np.float32), "UNIFORM")


def solid_buffers(device: Any, solids: Solids, light_grounds: tuple[NDArray[Any], NDArray[Any]]) -> dict[str, Any]:
    """Return the objects of `ray_cast.wgsl`, and the grounds that an endless sun is kept out by."""
    spheres = np.zeros(len(solids.spheres), SPHERE)
    spheres["centre"], spheres["radius"] = solids.spheres[:, :3], solids.spheres[:, 3]
    spheres["scale"], spheres["id"] = 1.0 / solids.spheres[:, 3], solids.sphere_ids
    boxes = np.zeros(len(solids.boxes), BOX)
    boxes["low"], boxes["high"], boxes["id"] = solids.boxes[:, :3], solids.boxes[:, 3:], solids.box_ids
    counts = np.array([len(spheres), len(boxes), len(solids.grounds), len(light_grounds[0])], np.uint32)
    return {
        "counts": buffer(device, counts, "UNIFORM"), "spheres": buffer(device, spheres), "boxes": buffer(device, boxes),
        "grounds": buffer(device, _grounds(solids.grounds, solids.ground_ids)),
        "light_grounds": buffer(device, _grounds(*light_grounds)),
        "albedo": buffer(device, np.asarray(solids.albedo, np.float32)),
    }  # fmt: skip


def _grounds(heights: NDArray[Any], ids: NDArray[Any]) -> NDArray[Any]:
    found = np.zeros(len(heights), GROUND)
    found["height"], found["id"] = heights, ids
    return found
