"""Read meshes through trimesh: geometry alone, nothing that a file refers to, sizes checked before they are believed.

Trimesh reads a file's claims (so many elements, this node below that one) as they come.  Claims that could make it
allocate without end, read beyond a buffer or walk in a circle are looked at here first.
"""

from __future__ import annotations

import io
import json
import logging
import struct
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_TRIANGLES = 4_000_000
MOST_BYTES = 256 << 20
SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf")
_MOST_NUMBERS = 16 * MOST_TRIANGLES  # of a text file: triangles, and vertices with texture coordinates and normals
_LONGEST_HEADER = 1 << 16
_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_JSON, _GLTF = 0x4E4F534A, 0x46546C67


class MeshProblem(ValueError):
    """What is wrong with the content of a mesh file."""


class MissingExtra(ImportError):
    """An optional package is not installed."""


def read_mesh(data: bytes, suffix: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return corners (V, 3), in the file's own units, and triangles (F, 3) of the content of a mesh file.

    Polygons are cut into triangles; the parts of a glTF scene stand where its nodes put them.

    Raises
    ------
    MeshProblem
        The content is damaged, of another kind, too large, refers to other files, or holds no triangles.
    MissingExtra
        Without trimesh.
    """
    try:
        import trimesh
    except ImportError as error:
        raise MissingExtra("meshes are read by trimesh, which is not installed: pip install atmoref[mesh]") from error
    _check_claims(data, suffix)
    before = logging.getLogger("trimesh").level
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(
                io.BytesIO(data), file_type=suffix[1:], process=False, maintain_order=True, skip_materials=True
            )
            return _joined(scene)
    except MeshProblem:
        raise
    except Exception as error:  # whatever a reader of hostile bytes may run into
        raise MeshProblem(f"is damaged or no {suffix[1:].upper()} file ({_told(error)})") from None
    finally:
        logging.getLogger("trimesh").setLevel(before)


def _told(error: BaseException) -> str:
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0][:80]}" if text else type(error).__name__


def _joined(scene: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return all triangles of a trimesh scene as one mesh."""
    parts: list[tuple[Any, Any]] = []
    total = 0
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not hasattr(geometry, "faces"):
            continue  # points and lines
        total += len(geometry.faces)
        if total > MOST_TRIANGLES:
            raise MeshProblem(f"holds more than {MOST_TRIANGLES} triangles; allowed: at most so many")
        parts.append((matrix, geometry))
    vertices, faces, before = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for matrix, geometry in parts:
        points, corners = np.asarray(geometry.vertices, np.float64), np.asarray(geometry.faces)
        if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3:
            raise MeshProblem("holds something else than triangles in space")
        if corners.dtype.kind not in "iu" or (corners.size and not 0 <= corners.min() <= corners.max() < len(points)):
            raise MeshProblem(f"has triangles of corners that are not among its {len(points)}")
        vertices.append(_moved(points, np.asarray(matrix, np.float64)))
        faces.append(corners.astype(np.int64) + before)
        before += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def _moved(points: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points where a 4 x 4 matrix puts them: sums in one order, the same bits on every machine."""
    if np.array_equal(matrix, np.eye(4)):
        return points
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    return np.stack([x * row[0] + y * row[1] + z * row[2] + row[3] for row in matrix[:3]], -1)


# ---- claims
def _check_claims(data: bytes, suffix: str) -> None:
    if not data:
        raise MeshProblem("is empty")
    checks = {".obj": _check_text, ".ply": _check_ply, ".stl": _check_stl, ".glb": _check_glb, ".gltf": _check_gltf}
    try:
        checks[suffix](data)
    except MeshProblem:
        raise
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, struct.error) as error:
        raise MeshProblem(f"is damaged or no {suffix[1:].upper()} file ({_told(error)})") from None


def _at_most(count: int, most: int, what: str) -> None:
    if not 0 <= count <= most:
        raise MeshProblem(f"claims {count} {what}; allowed: 0 to {most}")


def _check_text(data: bytes) -> None:
    _at_most(data.count(b" ") + data.count(b"\t") + data.count(b"\n"), _MOST_NUMBERS, "numbers")
    _at_most(data.count(b"\nf"), MOST_TRIANGLES, "faces")


def _check_ply(data: bytes) -> None:
    head, end, _ = data[:_LONGEST_HEADER].partition(b"end_header")
    if not data.startswith(b"ply") or not end:
        raise MeshProblem("is damaged or no PLY file (no header)")
    if b"format ascii" in head:
        _check_text(data)
    for line in head.split(b"\n"):
        words = line.split()
        if words[:1] == [b"element"]:
            count, name = int(words[2]), words[1].decode("ascii", "replace")
            _at_most(count, MOST_TRIANGLES if name == "face" else 3 * MOST_TRIANGLES, f"elements {name}")
            _at_most(count, len(data), f"elements {name} in {len(data)} bytes")


def _check_stl(data: bytes) -> None:
    if len(data) >= 84 and 84 + 50 * (count := struct.unpack("<I", data[80:84])[0]) == len(data):
        _at_most(count, MOST_TRIANGLES, "triangles")
    else:
        _check_text(data)


def _check_glb(data: bytes) -> None:
    magic, version, length, size, kind = struct.unpack("<5I", data[:20])
    if magic != _GLTF or version != 2 or kind != _JSON:
        raise MeshProblem("is damaged or no GLB file of version 2")
    if length != len(data) or 20 + size > len(data):
        raise MeshProblem(f"is truncated or damaged: its header states {length} bytes, found {len(data)}")
    _check_tree(json.loads(data[20 : 20 + size]), len(data))


def _check_gltf(data: bytes) -> None:
    _check_tree(json.loads(data), len(data))


def _check_tree(tree: Any, available: int) -> None:
    """Look at what a glTF file claims of buffers, accessors and nodes."""
    for name in tree.get("extensionsRequired", []):
        if any(word in str(name).lower() for word in ("draco", "meshopt")):
            raise MeshProblem(f"needs the extension {name}; allowed: uncompressed geometry")
    for buffer in tree.get("buffers", []):
        if not str(buffer.get("uri", "data:")).startswith("data:"):
            raise MeshProblem(f"refers to {str(buffer['uri'])[:60]!r}; allowed: one file that holds everything")
    views = tree.get("bufferViews", [])
    for accessor in tree.get("accessors", []):
        count = int(accessor["count"])
        _at_most(count, 3 * MOST_TRIANGLES, "elements of an accessor")
        if "sparse" in accessor:
            raise MeshProblem("has sparse accessors; allowed: plain ones")
        if "bufferView" not in accessor:
            _at_most(count, available, f"elements without data in {available} bytes")
            continue
        view = views[accessor["bufferView"]]
        size = _COMPONENT_BYTES[accessor["componentType"]] * _COMPONENTS[accessor["type"]]
        stride, start = int(view.get("byteStride", size)), int(accessor.get("byteOffset", 0))
        length = int(view["byteLength"])
        if start < 0 or int(view.get("byteOffset", 0)) < 0 or not 1 <= stride <= 1 << 16 or length > available:
            raise MeshProblem("places an accessor outside of its buffer")
        if count and start + stride * (count - 1) + size > length:
            raise MeshProblem(f"claims {count} elements in {length} bytes; allowed: what its buffer holds")
    _check_nodes(tree)


def _check_nodes(tree: Any) -> None:
    """Refuse nodes with two parents or in a circle, and more triangles than allowed when every mesh is put in place."""
    nodes, meshes, accessors = tree.get("nodes", []), tree.get("meshes", []), tree.get("accessors", [])
    _at_most(len(nodes), 100_000, "nodes")
    parents = [0] * len(nodes)
    for child in _children(nodes):
        _at_most(child, len(nodes) - 1, "as a node's child")
        parents[child] += 1
    reached, queue = 0, [i for i, count in enumerate(parents) if count == 0]
    while queue:
        reached += 1
        queue += nodes[queue.pop()].get("children", [])
        if reached > len(nodes):
            break
    if max(parents, default=0) > 1 or reached != len(nodes):
        raise MeshProblem("has nodes with two parents or in a circle; allowed: a tree")
    total = 0
    for node in nodes:
        for part in meshes[node["mesh"]]["primitives"] if "mesh" in node else ():
            total += int(accessors[part.get("indices", part["attributes"]["POSITION"])]["count"])
            _at_most(total, 3 * MOST_TRIANGLES, "corners of triangles")


def _children(nodes: list[Any]) -> Iterator[int]:
    for node in nodes:
        yield from node.get("children", [])
