"""SHA-256 of every buffer of every bundled scene, as small pictures, per code class; a script for processes, too.

    python bits_manifest.py unorm8/float32 float16/float32 ...

prints one JSON object: "class scene buffer" -> hash.
"""

from __future__ import annotations

import hashlib
import json
import sys
from typing import Any

import numpy as np

from atmoref.scene import load_scene
from atmoref.techniques.render import render

CLASSES = ("unorm8/float32", "float16/float32", "float32/float32", "float64/float64", "unorm8/float64")
SCENES = {
    "fig4a": (37, 41),
    "fig4b": (19, 30),
    "fig4c": (37, 41),
    "fig10a_shafts": (45, 30),
    "fig9a": (45, 30),
    "fig9b": (45, 30),
    "keller": (36, 40),
    "quick": (17, 23),
    "slide": (45, 30),
    "two_lights": (45, 30),
}


def small(name: str, code_class: str, *overrides: str) -> Any:
    """Return a bundled scene as a small picture in a code class; classes without codes use the preset `analysis`."""
    fmt, arithmetic = code_class.split("/")
    width, height = SCENES[name]
    preset = ["technique.preset=analysis"] if fmt == "float64" else []
    return load_scene(
        name,
        [
            f"image.width={width}", f"image.height={height}", f"buffers.format={fmt}",
            f"buffers.arithmetic={arithmetic}",
            *preset, *overrides,
        ],
    )  # fmt: skip


def hashes(buffers: dict[str, Any]) -> dict[str, str]:
    """Return the hash of every buffer: codes or numbers, row 0 at the top, without padding."""
    return {
        name: hashlib.sha256(np.ascontiguousarray(buffer.codes()).tobytes()).hexdigest()
        for name, buffer in sorted(buffers.items())
    }


def manifest(classes: list[str]) -> dict[str, str]:
    """Return the hashes of all bundled scenes."""
    found = {}
    for code_class in classes:
        for scene in SCENES:
            for name, value in hashes(render(small(scene, code_class), threads=1).buffers).items():
                found[f"{code_class} {scene} {name}"] = value
    return found


if __name__ == "__main__":
    print(json.dumps(manifest(sys.argv[1:])))
