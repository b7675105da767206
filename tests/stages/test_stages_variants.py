"""A kernel has at most eight compiled variants: formats, devices, presets and options are uniforms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from reference.scenes import bundled

from atmoref.buffers.formats import FORMATS
from atmoref.stages import beam_planes, opaque, shadow_map, triangles, vertex_planes
from atmoref.techniques import TECHNIQUES
from atmoref.techniques.render import render

MOST = 8
KERNELS: dict[str, Any] = {
    "beam_planes": beam_planes.beam_planes,
    "vertex_planes": vertex_planes.vertex_planes,
    "opaque_base": opaque.opaque_base,
    "opaque_light": opaque.opaque_light,
    "shadow_map": shadow_map.shadow_map,
    "rasterise": triangles.rasterise,
    "set_up_triangles": triangles.set_up_triangles,
}


def _render(technique: str, fmt: str, arithmetic: str, *overrides: str) -> None:
    scene = bundled(
        "two_lights", f"buffers.format={fmt}", f"buffers.arithmetic={arithmetic}", *overrides,
        "technique.shadow_map_size=16", "technique.light_map_size=16", width=5, height=3,
    )  # fmt: skip
    assert np.isfinite(render(scene, technique=technique, threads=1).image).all()


def _counts() -> dict[str, int]:
    return {name: len(kernel.signatures) for name, kernel in KERNELS.items()}


def test_formats_of_a_class_devices_presets_and_options_share_a_variant() -> None:
    """unorm8 first; whatever else 16 bits hold, by whatever rule, needs nothing new (analysis mixes classes)."""
    for technique in ("beams", "beams_vertex"):
        _render(technique, "unorm8", "float32")
        _render(technique, "unorm8", "float32", "technique.preset=analysis")
    before = _counts()
    for technique in ("beams", "beams_vertex"):
        for preset in ("paper", "corrected", "analysis"):
            for fmt in ("unorm2", "unorm10", "unorm12", "unorm16"):
                _render(technique, fmt, "float32", f"technique.preset={preset}")
            for device in ("gl_llvmpipe", "geforce3", "geforce_fx"):
                _render(technique, "unorm8", "float32", f"technique.preset={preset}", f"buffers.device={device}")
        _render(technique, "unorm8", "float32", "buffers.depth.format=float32", "buffers.shadow_map.format=unorm16")
        _render(technique, "unorm8", "float32", "buffers.light_map.format=float16", "buffers.light_map.format=float64")
        _render(technique, "unorm8", "float32", "technique.coordinates=vertex", "technique.visibility=exact")
        _render(technique, "unorm8", "float32", "technique.light_distribution=exact", "technique.skip=false")
    assert _counts() == before
    assert max(before.values()) <= MOST


@pytest.mark.slow
def test_at_most_eight_variants_over_everything() -> None:
    colours = [f for f in FORMATS if f != "depth24"]
    for technique in TECHNIQUES:
        for arithmetic in ("float32", "float64"):
            for fmt in colours:
                for preset in ("paper", "corrected", "analysis"):
                    _render(technique, fmt, arithmetic, f"technique.preset={preset}")
    found = _counts()
    assert max(found.values()) <= MOST, found
    assert found["beam_planes"] == 6, found  # three classes of buffers in two arithmetics
