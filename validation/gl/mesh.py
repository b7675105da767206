"""The meshes of a light's planes on the device."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np

from validation.gl.geometry import mesh_attributes, mesh_corners, mesh_triangles


class MeshOnDevice:
    """The meshes of all planes of one light in one vertex buffer, one index buffer for each of them."""

    def __init__(self, ctx: Any, given: Mapping[str, Any]) -> None:
        switches = given["uniforms"].slab_switches
        uv, colours = mesh_attributes(given)
        slab = given["uniforms"].slab
        corners = mesh_corners(switches.mesh_x, switches.mesh_y, (slab.cell_x, slab.cell_y))
        corners = np.broadcast_to(corners, (*uv.shape[:2], 2))
        data = np.concatenate([corners, uv, colours], -1).astype(np.float32)
        triangles = mesh_triangles(switches.mesh_x, switches.mesh_y).ravel()
        starts = np.arange(len(uv), dtype=np.int32)[:, None] * uv.shape[1]
        self._ctx, self._count = ctx, triangles.size
        self._data = ctx.buffer(data.tobytes())
        self._index = ctx.buffer((triangles + starts).astype(np.int32).tobytes())
        self._attributes = ctx.buffer(np.concatenate([uv, colours], -1).tobytes())
        self._arrays: dict[Any, Any] = {}

    def bind(self, binding: int) -> None:
        """Hand the attributes to a fragment shader that interpolates by itself."""
        self._attributes.bind_to_storage_buffer(binding)

    def draw(self, program: Any, plane: int) -> None:
        """Draw one plane."""
        if program not in self._arrays:
            used = {"corner": "2f", "vertex_uv": "2f", "vertex_colour": "3f"}
            layout = " ".join(f if name in program else f"{4 * int(f[0])}x" for name, f in used.items())
            names = [name for name in used if name in program]
            self._arrays[program] = self._ctx.vertex_array(program, [(self._data, layout, *names)], self._index)
        self._arrays[program].render(moderngl.TRIANGLES, vertices=self._count, first=plane * self._count)
