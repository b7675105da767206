"""A reference pack read back by other people's readers: OpenEXR, a C compiler, ktx-parse under Node."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from atmoref.buffers.formats import FORMATS
from atmoref.export import PackError, export_pack
from atmoref.export.ktx2 import ktx2_bytes
from atmoref.scene import load_scene
from atmoref.techniques.render import render

ROOT = Path(__file__).resolve().parents[2]
SMALL = (
    "image.width=24", "image.height=36", "technique.interval_m=5.0", "technique.shadow_map_size=64",
    "technique.light_map_size=32", "technique.q_table_size=16",
)  # fmt: skip


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("packs") / "quick"
    export_pack(load_scene("quick", SMALL), directory)
    return directory


def told(pack: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((pack / "manifest.json").read_text())
    return content


def test_every_file_has_its_hash(pack: Path) -> None:
    listed = told(pack)["sha256"]
    files = {str(path.relative_to(pack)) for path in pack.rglob("*") if path.is_file()} - {"manifest.json"}
    assert set(listed) == files
    for name, digest in listed.items():
        assert hashlib.sha256((pack / name).read_bytes()).hexdigest() == digest


def test_openexr_reads_the_reference_of_the_last_stage(pack: Path) -> None:
    import OpenEXR

    last = [stage for stage in told(pack)["stages"] if stage["buffer"] == "frame"][-1]
    expected = render(load_scene("quick", SMALL)).image
    with OpenEXR.File(str(pack / last["reference"])) as file:
        pixels = file.channels()["RGB"].pixels
    np.testing.assert_allclose(pixels, expected, rtol=0, atol=2.0**-24)
    with OpenEXR.File(str(pack / last["lo"])) as low, OpenEXR.File(str(pack / last["hi"])) as high:
        assert (low.channels()["RGB"].pixels <= pixels).all()
        assert (high.channels()["RGB"].pixels >= pixels).all()


def test_uniforms_are_numbers(pack: Path) -> None:
    uniforms = json.loads((pack / "uniforms.json").read_text())
    slabs = uniforms["light_0/slabs"]
    assert slabs["uniforms"]["slab"]["sigma_r"] == 0.02
    assert len(slabs["draws"]["main_z"]) > 2


def texture(pack: Path, buffer: str) -> dict[str, Any]:
    return next(one for one in told(pack)["textures"] if one["buffer"] == buffer)


def raw(pack: Path, buffer: str) -> np.ndarray:
    one = texture(pack, buffer)
    shape = (one["height"], one["width"], one["channels"])
    return np.frombuffer((pack / "inputs" / one["file"]).read_bytes(), one["type"]).reshape(shape)


C_PROGRAM = """
#include <stdio.h>
#include "inputs/light_0_q.h"
#include "inputs/light_0_light_map.h"
int main(void) {
    unsigned long sum = 0;
    for (int i = 0; i < light_0_q_width * light_0_q_height * light_0_q_channels; ++i)
        sum += light_0_q_texels[i] * (i % 251UL);
    printf("%lu %d %d", sum, light_0_light_map_width, light_0_light_map_texels[16 * 32 + 16]);
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="optional: no C compiler")
def test_a_c_program_reads_the_headers(pack: Path, tmp_path: Path) -> None:
    (tmp_path / "main.c").write_text(C_PROGRAM)
    line = ["cc", "-std=c99", "-Wall", "-Werror", f"-I{pack}", "main.c", "-o", "main"]
    subprocess.run(line, cwd=tmp_path, check=True, timeout=60)
    out = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True, timeout=20).stdout
    q = raw(pack, "light_0/q").ravel().astype(np.int64)
    expected = (q * (np.arange(q.size) % 251)).sum()
    assert out == f"{expected} 32 {raw(pack, 'light_0/light_map')[16, 16, 0]}"


NODE_PROGRAM = """
const { read } = require("ktx-parse");
const { readFileSync } = require("fs");
const file = read(new Uint8Array(readFileSync(process.argv[2])));
const level = file.levels[0].levelData;
let sum = 0;
for (let i = 0; i < level.length; ++i) sum += level[i] * (i % 251);
console.log(JSON.stringify({ format: file.vkFormat, width: file.pixelWidth, height: file.pixelHeight,
  bytes: level.length, sum, samples: file.dataFormatDescriptor[0].samples.length,
  orientation: file.keyValue.KTXorientation }));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="optional: no Node")
def test_ktx_parse_reads_the_textures(pack: Path, tmp_path: Path) -> None:
    modules = os.environ.get("NODE_PATH", str(ROOT / ".node" / "node_modules"))
    (tmp_path / "main.cjs").write_text(NODE_PROGRAM)
    path = pack / "inputs" / "light_0_q.ktx2"
    done = subprocess.run(["node", "main.cjs", str(path)], cwd=tmp_path, capture_output=True, text=True,
                          env={**os.environ, "NODE_PATH": modules}, check=False, timeout=60)  # fmt: skip
    if "Cannot find module 'ktx-parse'" in done.stderr:
        pytest.skip("optional: no ktx-parse (make system-deps, or NODE_PATH)")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    q = raw(pack, "light_0/q").ravel().astype(np.int64)
    assert (found["width"], found["height"], found["bytes"], found["format"]) == (16, 16, q.size, 9)
    assert found["sum"] == (q * (np.arange(q.size) % 251)).sum()
    assert found["samples"] == 1


@pytest.mark.parametrize(
    ("fmt", "channels", "vulkan"),
    [
        ("unorm8", 1, 9),
        ("unorm8", 3, 37),
        ("unorm16", 4, 91),
        ("float16", 3, 97),
        ("float32", 1, 100),
        ("float32", 2, 103),
    ],
)
def test_ktx2_says_what_it_holds(fmt: str, channels: int, vulkan: int) -> None:
    """By the table of the specification: format, type size, level index, data."""
    texels = np.arange(6 * channels).reshape(2, 3, channels).astype(FORMATS[fmt].storage)
    content = ktx2_bytes(texels, FORMATS[fmt])
    assert content[:12] == bytes.fromhex("AB4B5458203230BB0D0A1A0A")
    vk, size, width, height, depth, layers, faces, levels, scheme = struct.unpack_from("<9I", content, 12)
    assert (vk, width, height, depth, layers, faces, levels, scheme) == (vulkan, 3, 2, 0, 0, 1, 1, 0)
    at, length, plain = struct.unpack_from("<3Q", content, 80)
    assert length == plain == len(content) - at
    assert at % (size * (4 if channels == 3 else channels)) == 0
    held = np.frombuffer(content[at:], texels.dtype).reshape(2, 3, -1)
    np.testing.assert_array_equal(held[..., :channels], texels)


def test_other_directories_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(PackError, match="holds other files"):
        export_pack(load_scene("quick", SMALL), tmp_path)
    with pytest.raises(PackError, match="does not exist"):
        export_pack(load_scene("quick", SMALL), tmp_path / "a" / "b")
    (tmp_path / "link").symlink_to(tmp_path)
    with pytest.raises(PackError, match="is no directory"):
        export_pack(load_scene("quick", SMALL), tmp_path / "link")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "mine.txt"]
