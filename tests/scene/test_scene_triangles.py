"""Meshes and height fields: what is read, where it stands, and what is refused."""

from __future__ import annotations

import base64
import json
import os
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from atmoref.images import from_rgb, write
from atmoref.scene import Scene, SceneError, assets, mesh_files, scene_from_mapping
from atmoref.scene.mesh_files import MissingExtra

trimesh = pytest.importorskip("trimesh", reason="optional: trimesh")

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint16)
HEIGHTS = np.array([[0.0, 1.0, 0.5], [0.25, 2.0, -1.0]])


def scene_with(folder: Path, item: dict[str, Any]) -> Scene:
    """Return a scene with one object."""
    mapping = {
        "schema": 1,
        "image": {"width": 8, "height": 8},
        "camera": {"position_m": [0.0, 1.0, 9.0], "look_at_m": [0.0, 1.0, 0.0], "vertical_fov_deg": 40.0},
        "lights": [{"type": "sun", "elevation_deg": 30.0, "azimuth_deg": 0.0, "irradiance_w_per_m2": 1.0}],
        "medium": {"extinction_per_m": 0.1, "single_scattering_albedo": 0.9},
        "objects": [item],
    }
    return scene_from_mapping(mapping, origin="try.toml", path=folder / "try.toml")


def mesh(path: str, **keys: Any) -> dict[str, Any]:
    return {"type": "mesh", "path": path, "albedo": 0.5} | keys


def field(path: str, **keys: Any) -> dict[str, Any]:
    return {"type": "height_field", "path": path, "cell_m": 2.0, "height_scale_m": 10.0, "albedo": 0.5} | keys


def _buffer(data: bytes) -> dict[str, Any]:
    text = base64.b64encode(data).decode()
    return {"byteLength": len(data), "uri": f"data:application/octet-stream;base64,{text}"}


def gltf(**changes: Any) -> dict[str, Any]:
    """Return a glTF tree of the tetrahedron, in one file."""
    data = POINTS.tobytes() + FACES.tobytes()
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 2, 3]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [_buffer(data)],
    }  # fmt: skip
    return tree | changes


def glb(tree: dict[str, Any] | None = None) -> bytes:
    """Return a GLB file of a tree whose buffer goes to the binary chunk."""
    tree = dict(tree or gltf())
    data = POINTS.tobytes() + FACES.tobytes()
    tree["buffers"] = [{"byteLength": len(data)}]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def ply(head: str, body: bytes = b"") -> bytes:
    return f"ply\nformat {head}\nend_header\n".encode() + body


TWO_ELEMENTS = (
    "{} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_indices"
)
PLY_TEXT = ply(TWO_ELEMENTS.format("ascii", 4, 4), b"0 0 0\n1 0 0\n0 2 0\n0 0 3\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
PLY_BINARY = ply(
    TWO_ELEMENTS.format("binary_little_endian", 4, 4),
    POINTS.astype("<f4").tobytes() + b"".join(struct.pack("<B3i", 3, *map(int, f)) for f in FACES),
)
STL = bytes(80) + struct.pack("<I", 4) + b"".join(
    struct.pack("<3f", 0, 0, 0) + POINTS[f].astype("<f4").tobytes() + b"\0\0" for f in FACES
)  # fmt: skip


def corners(scene: Scene) -> np.ndarray[Any, Any]:
    """Return the sorted triangles of the first object, (F, 9)."""
    found = scene.triangles(0)
    assert found is not None
    assert found.vertices.dtype == np.float64
    assert found.faces.dtype == np.int32
    assert not found.vertices.flags.writeable
    assert not found.faces.flags.writeable
    rows = [sorted(map(tuple, found.vertices[f].tolist())) for f in found.faces]
    return np.array(sorted(rows))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("t.obj", TETRAHEDRON.encode()),
        ("t.ply", PLY_TEXT),
        ("b.PLY", PLY_BINARY),
        ("t.stl", STL),
        ("t.glb", glb()),
        ("t.gltf", json.dumps(gltf()).encode()),
    ],
)
def test_every_kind_of_file_gives_the_same_triangles(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    expected = np.array(sorted(sorted(map(tuple, POINTS[f].astype(float).tolist())) for f in FACES))
    np.testing.assert_array_equal(corners(scene_with(tmp_path, mesh(name))), expected)


def test_a_mesh_is_scaled_then_turned_then_moved(tmp_path: Path) -> None:
    (tmp_path / "t.obj").write_text(TETRAHEDRON)
    plain = scene_with(tmp_path, mesh("t.obj")).triangles(0)
    for angle, x, z in (
        (90.0, (0, 0, -1), (1, 0, 0)),
        (-450.0, (0, 0, 1), (-1, 0, 0)),
        (180.0, (-1, 0, 0), (0, 0, -1)),
    ):
        turn = np.array([x, (0, 1, 0), z], float)
        item = mesh("t.obj", scale=3.0, rotate_y_deg=angle % 360.0, position_m=[4.0, 5.0, 6.0])
        moved = scene_with(tmp_path, item).triangles(0)
        assert plain is not None
        assert moved is not None
        np.testing.assert_array_equal(moved.vertices, plain.vertices * 3.0 @ turn + [4.0, 5.0, 6.0])
    moved = scene_with(tmp_path, mesh("t.obj", rotate_y_deg=30.0)).triangles(0)
    assert plain is not None
    assert moved is not None
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    np.testing.assert_allclose(
        moved.vertices, plain.vertices @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]), atol=1e-15
    )


def test_polygons_are_cut_and_lines_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "q.obj").write_text("v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\nf 1 2 2\nf 1 1 1\n")
    found = corners(scene_with(tmp_path, mesh("q.obj")))
    assert found.shape == (2, 3, 3)
    areas = [np.linalg.norm(np.cross(t[1] - t[0], t[2] - t[0])) / 2 for t in found]
    assert areas == [2.0, 2.0]


def test_parts_of_a_gltf_scene_stand_where_its_nodes_put_them(tmp_path: Path) -> None:
    nodes = [
        {"children": [1, 2], "scale": [2.0, 2.0, 2.0]},
        {"mesh": 0, "translation": [10.0, 0.0, 0.0]},
        {"mesh": 0, "translation": [0.0, 5.0, 0.0]},
    ]
    (tmp_path / "t.glb").write_bytes(glb(gltf(nodes=nodes)))
    found = corners(scene_with(tmp_path, mesh("t.glb")))
    one = np.array([POINTS[f].astype(float) for f in FACES])
    both = [*(one * 2.0 + [20.0, 0.0, 0.0]), *(one * 2.0 + [0.0, 10.0, 0.0])]
    expected = np.array(sorted(sorted(map(tuple, t.tolist())) for t in both))
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_surfaces_need_not_be_closed_or_manifold(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 1\nv 9 9 9\nf 1 2 3\nf 1 2 4\nf 1 2 5\nf 2 1 3\n"
    (tmp_path / "t.obj").write_text(text)
    assert corners(scene_with(tmp_path, mesh("t.obj"))).shape == (4, 3, 3)


def test_material_files_are_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "m.mtl")  # opening it would wait for ever
    (tmp_path / "t.obj").write_text("mtllib m.mtl\nmtllib /dev/zero\nusemtl a\n" + TETRAHEDRON)
    assert corners(scene_with(tmp_path, mesh("t.obj"))).shape == (4, 3, 3)


@pytest.mark.parametrize("name", ["h.npy", "h.exr", "h.png"])
def test_a_height_field_is_two_triangles_a_cell(tmp_path: Path, name: str) -> None:
    heights: Any = HEIGHTS
    if name == "h.npy":
        np.save(tmp_path / name, heights)
    elif name == "h.exr":
        write(tmp_path / name, from_rgb(heights.astype(np.float32)))
    else:
        codes = np.array([[0, 65535, 32768], [1, 2, 65534]], np.uint16)
        write(tmp_path / name, from_rgb(codes))
        heights = codes / 65535.0
    found = scene_with(tmp_path, field(name, center_m=[100.0, 50.0, -20.0])).triangles(0)
    assert found is not None
    x, z = np.meshgrid([98.0, 100.0, 102.0], [-21.0, -19.0])
    np.testing.assert_allclose(found.vertices.reshape(2, 3, 3), np.stack([x, 50.0 + 10.0 * heights, z], -1), rtol=1e-15)
    np.testing.assert_array_equal(found.faces, [[0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2]])
    a, b, c = (found.vertices[found.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 1] > 0.0).all()  # counter-clockwise from above


def test_the_file_counts_in_the_digest(tmp_path: Path) -> None:
    np.save(tmp_path / "h.npy", HEIGHTS)
    first = scene_with(tmp_path, field("h.npy"))
    np.save(tmp_path / "h.npy", HEIGHTS * 2.0)
    assert scene_with(tmp_path, field("h.npy")).digest() != first.digest()


def _obj(text: str) -> Callable[[Path], dict[str, Any]]:
    return _file("t.obj", text.encode())


def _file(name: str, content: bytes) -> Callable[[Path], dict[str, Any]]:
    def make(folder: Path) -> dict[str, Any]:
        (folder / name).write_bytes(content)
        return mesh(name)

    return make


def _tree(**changes: Any) -> Callable[[Path], dict[str, Any]]:
    return _file("t.gltf", json.dumps(gltf(**changes)).encode())


def _heights(array: Any, **keys: Any) -> Callable[[Path], dict[str, Any]]:
    def make(folder: Path) -> dict[str, Any]:
        np.save(folder / "h.npy", np.asarray(array))
        return field("h.npy", **keys)

    return make


def _picture(array: Any) -> Callable[[Path], dict[str, Any]]:
    def make(folder: Path) -> dict[str, Any]:
        write(folder / "h.png", from_rgb(array))
        return field("h.png")

    return make


def _linked(target: str) -> Callable[[Path], dict[str, Any]]:
    def make(folder: Path) -> dict[str, Any]:
        (folder / "t.obj").symlink_to(target)
        return mesh("t.obj")

    return make


def _made(act: Callable[[Path], Any], item: dict[str, Any]) -> Callable[[Path], dict[str, Any]]:
    def make(folder: Path) -> dict[str, Any]:
        act(folder)
        return item

    return make


def _accessors(place: int, **changes: Any) -> list[Any]:
    found = [dict(a) for a in gltf()["accessors"]]
    found[place] |= changes
    return found


BIG = TWO_ELEMENTS.format
VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
HOSTILE: dict[str, tuple[Callable[[Path], dict[str, Any]], str]] = {
    "missing": (lambda folder: mesh("none.obj"), "no such file"),
    "absolute": (lambda folder: mesh("/etc/passwd"), "in the folder of the scene"),
    "up": (lambda folder: mesh("../t.obj"), "in the folder of the scene"),
    "up and down again": (lambda folder: mesh("a/../t.obj"), "in the folder of the scene"),
    "link that leaves": (_linked("/etc/passwd"), "in the folder of the scene"),
    "link in a circle": (_linked("t.obj"), "t.obj"),
    "directory": (_made(lambda f: (f / "t.obj").mkdir(), mesh("t.obj")), "is a directory"),
    "pipe": (_made(lambda f: os.mkfifo(f / "t.obj"), mesh("t.obj")), "no regular file"),
    "null in the name": (lambda folder: mesh("t\0.obj"), "not a file name"),
    "long name": (lambda folder: mesh("x" * 1000), "t"),
    "unknown kind": (_file("t.fbx", b"x"), "one of .obj"),
    "no suffix": (_file("t", b"x"), "one of .obj"),
    "a picture": (_file("t.png", b"x"), "one of .obj"),
    "empty obj": (_obj(""), "empty"),
    "obj of noise": (_file("t.obj", bytes(range(256)) * 4), "allowed"),
    "obj without faces": (_obj(VERTICES), "no triangles"),
    "obj of points": (_obj(VERTICES + "p 1 2 3\n"), "no triangles"),
    "obj of lines": (_obj(VERTICES + "l 1 2 3\n"), "no triangles"),
    "obj with a corner too many": (_obj(VERTICES + "f 1 2 4\n"), "allowed"),
    "obj with corner 0": (_obj(VERTICES + "f 0 1 2\n"), "allowed"),
    "obj with words": (_obj("v a b c\n" + VERTICES + "f 1 2 3\n"), "allowed"),
    "obj with nan": (_obj("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "finite"),
    "obj with inf": (_obj("v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "finite"),
    "obj that overflows": (_obj("v 1e400 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "finite"),
    "obj too far": (_obj("v 2e9 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "within 1e+09 m"),
    "obj without area": (_obj("v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 1 1 2\n"), "apart from 2 without area"),
    "ply without header": (_file("t.ply", b"ply\nformat ascii 1.0\n"), "no header"),
    "ply of noise": (_file("t.ply", b"\xff\xfe" * 99), "no PLY"),
    "truncated ply": (_file("t.ply", PLY_BINARY[:-9]), "damaged"),
    "truncated text ply": (_file("t.ply", PLY_TEXT[:-30]), "allowed"),
    "ply claims vertices": (_file("t.ply", ply(BIG("binary_little_endian", 10**12, 1))), "allowed: 0 to"),
    "ply claims faces": (_file("t.ply", ply(BIG("ascii", 3, 10**9))), "allowed: 0 to"),
    "ply claims more than there is": (_file("t.ply", ply(BIG("ascii", 3000, 1))), "in "),
    "ply with a negative count": (_file("t.ply", ply(BIG("ascii", 3, -1))), "claims -1"),
    "ply with a word for a count": (_file("t.ply", ply(BIG("ascii", "many", 1))), "damaged"),
    "ply index": (_file("t.ply", PLY_TEXT.replace(b"3 1 2 3", b"3 1 2 9")), "corners that are not"),
    "ply negative index": (_file("t.ply", PLY_TEXT.replace(b"3 1 2 3", b"3 1 2 -1")), "corners that are not"),
    "truncated stl": (_file("t.stl", STL[:-7]), "allowed"),
    "stl of noise": (_file("t.stl", b"\x01\x02" * 200), "allowed"),
    "stl with nan": (_file("t.stl", STL[:96] + struct.pack("<f", float("nan")) + STL[100:]), "finite"),
    "stl claims triangles": (_file("t.stl", STL[:80] + b"\xff\xff\xff\xff" + STL[84:]), "allowed"),
    "truncated glb": (_file("t.glb", glb()[:-9]), "truncated"),
    "glb of another version": (_file("t.glb", b"glTF" + struct.pack("<I", 1) + glb()[8:]), "version 2"),
    "glb of noise": (_file("t.glb", b"glTFglTFglTFglTFglTFglTF"), "version 2"),
    "glb of two bytes": (_file("t.glb", b"gl"), "damaged"),
    "gltf that is no json": (_file("t.gltf", b"{" * 50), "damaged"),
    "gltf nested deeply": (_file("t.gltf", b"[" * 200_000), "damaged"),
    "gltf that is a list": (_file("t.gltf", b"[]"), "damaged"),
    "gltf of no meshes": (_tree(nodes=[], meshes=[], scenes=[{"nodes": []}]), "allowed"),
    "gltf beside a file": (_tree(buffers=[{"byteLength": 72, "uri": "t.bin"}]), "one file that holds everything"),
    "gltf out of the folder": (_tree(buffers=[{"byteLength": 72, "uri": "../../etc/passwd"}]), "one file"),
    "gltf from the net": (_tree(buffers=[{"byteLength": 72, "uri": "http://127.0.0.1:9/x"}]), "one file"),
    "gltf with draco": (_tree(extensionsRequired=["KHR_draco_mesh_compression"]), "uncompressed"),
    "gltf claims": (_tree(accessors=_accessors(0, count=10**10)), "allowed: 0 to"),
    "gltf claims without data": (_tree(accessors=[{"componentType": 5126, "count": 10**7, "type": "VEC3"}]), "without"),
    "gltf reads on": (_tree(accessors=_accessors(0, count=400)), "what its buffer holds"),
    "gltf starts beyond": (_tree(accessors=_accessors(0, byteOffset=10**9)), "what its buffer holds"),
    "gltf starts before": (_tree(accessors=_accessors(0, byteOffset=-12)), "outside of its buffer"),
    "gltf sparse": (_tree(accessors=_accessors(0, sparse={"count": 1})), "sparse"),
    "gltf of unknown numbers": (_tree(accessors=_accessors(0, componentType=9)), "damaged"),
    "gltf in a circle": (_tree(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}]), "a tree"),
    "gltf node of itself": (_tree(nodes=[{"mesh": 0}, {"children": [1]}]), "a tree"),
    "gltf of two parents": (_tree(nodes=[{"children": [2]}, {"children": [2]}, {"mesh": 0}]), "a tree"),
    "gltf child that is not": (_tree(nodes=[{"mesh": 0, "children": [7]}]), "child"),
    "gltf index": (_tree(buffers=[_buffer(POINTS.tobytes() + (FACES + 9).tobytes())]), "corners that are not"),
    "heights of one row": (_heights(np.zeros((1, 9))), "at least 2 x 2"),
    "heights of one sample": (_heights(np.zeros((1, 1))), "at least 2 x 2"),
    "no heights": (_heights(np.zeros((0, 4))), "allowed"),
    "heights of three channels": (_heights(np.zeros((4, 4, 3))), "a single one"),
    "heights with alpha": (_heights(np.zeros((4, 4, 2))), "a single one"),
    "heights in colour": (_picture(np.zeros((4, 4, 3), np.uint8)), "a single one"),
    "heights of four axes": (_heights(np.zeros((4, 4, 1, 1))), "allowed"),
    "heights in integers": (_heights(np.zeros((4, 4), np.int32)), "real numbers"),
    "heights in complex": (_heights(np.zeros((4, 4), complex)), "allowed"),
    "heights with nan": (_heights([[0.0, np.nan], [0.0, 0.0]]), "row 0, column 1"),
    "heights with inf": (_heights([[0.0, 0.0], [-np.inf, 0.0]]), "row 1, column 0"),
    "heights that overflow": (_heights([[0.0, 1e308], [0.0, 0.0]], height_scale_m=1e9), "finite, within"),
    "heights too far": (_heights(np.ones((2, 2)), height_scale_m=1e9, center_m=[0.0, 1e9, 0.0]), "finite, within"),
    "a field too wide": (_heights(np.ones((9, 9)), cell_m=1e9), "finite, within"),
    "too many heights": (_heights(np.zeros((1600, 1600), np.float16)), "4000000 triangles"),
    "too large a field": (_heights(np.zeros((2, 9000), np.float16)), "at most 8192"),
    "heights in a mesh file": (lambda folder: field("t.obj") if _obj(TETRAHEDRON)(folder) else {}, "one of .png"),
    "a damaged png": (lambda folder: field("h.png") if _file("h.png", b"\x89PNG\r\n\x1a\n12")(folder) else {}, "h.png"),
    "pickled heights": (_heights(np.array([{}, 1], object)), "allowed"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_wrong_files_are_refused_with_one_clear_line(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    make, words = HOSTILE[name]
    item = make(tmp_path)
    start = time.process_time()
    with pytest.raises(SceneError) as error:
        scene_with(tmp_path, item)
    assert time.process_time() - start < 5.0
    text = str(error.value)
    assert "\n" not in text
    assert text.startswith("try.toml: objects[0].path: ")
    assert words in text
    assert "allowed" in text or "not a file name" in text
    assert Path(item["path"]).name.replace("\0", "\\x00")[:40].rstrip("x") in text
    assert len(text) < 1000
    assert capfd.readouterr() == ("", "")


def test_bytes_turned_at_random_are_read_or_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    sound = {"t.obj": TETRAHEDRON.encode(), "t.ply": PLY_BINARY, "a.ply": PLY_TEXT, "t.stl": STL, "t.glb": glb(),
             "t.gltf": json.dumps(gltf()).encode()}  # fmt: skip
    refused = 0
    for name, content in sound.items():
        for _ in range(40):
            data = bytearray(content)
            for place in rng.integers(0, len(data), rng.integers(1, 6)):
                data[place] = rng.integers(0, 256)
            (tmp_path / name).write_bytes(bytes(data[: rng.integers(1, len(data) + 1)] if rng.random() < 0.3 else data))
            try:
                found = scene_with(tmp_path, mesh(name)).triangles(0)
                assert found is not None
                assert np.isfinite(found.vertices).all()
                assert found.faces.min() >= 0
                assert found.faces.max() < len(found.vertices)
            except SceneError:
                refused += 1
    assert refused > 60


def test_large_files_are_refused_before_they_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "t.obj").write_text(TETRAHEDRON)
    monkeypatch.setattr(assets, "MOST_BYTES", 20)
    monkeypatch.setattr(Path, "read_bytes", lambda self: pytest.fail("it was read"))
    with pytest.raises(SceneError, match="allowed: at most 20"):
        scene_with(tmp_path, mesh("t.obj"))


def test_many_triangles_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "t.stl").write_bytes(STL)
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 3 0\nv 0 2 0\nf 1 2 3 4 5\n")
    nodes = [{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0}]
    (tmp_path / "t.glb").write_bytes(glb(gltf(nodes=nodes)))
    monkeypatch.setattr(mesh_files, "MOST_TRIANGLES", 2)
    for name in ("t.stl", "t.obj", "t.glb"):
        with pytest.raises(SceneError, match=r"allowed: (0 to|at most)"):
            scene_with(tmp_path, mesh(name))


def test_without_trimesh_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from atmoref.cli.failures import verdict_of

    (tmp_path / "t.obj").write_text(TETRAHEDRON)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingExtra, match=r"pip install atmoref\[mesh\]") as error:
        scene_with(tmp_path, mesh("t.obj"))
    assert verdict_of(error.value)[0] == 3
