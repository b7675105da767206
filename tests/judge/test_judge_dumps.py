"""Manifests and files of dumps are read with suspicion: every refusal is one clear sentence, nothing is followed."""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from atmoref.judge.dumps import MANIFEST, DumpError, DumpWriter, open_dump, read_entry


def manifest(directory: Path, **changes: Any) -> Path:
    """Write a dump of one good entry, changed; return the directory."""
    np.save(directory / "a.npy", np.arange(24, dtype=np.uint8).reshape(2, 4, 3))
    entry = {"draw": "opaque", "buffer": "frame", "format": "unorm8", "file": "a.npy"}
    entry.update(changes.pop("entry", {}))
    content = {"kind": "atmoref stages", "manifest": 1, "draws": [entry], **changes}
    (directory / MANIFEST).write_text(json.dumps(content))
    return directory


def test_a_good_dump_is_read(tmp_path: Path) -> None:
    (entry,) = open_dump(manifest(tmp_path)).entries
    np.testing.assert_array_equal(read_entry(entry, (2, 4, 3)), np.arange(24).reshape(2, 4, 3))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"kind": "other"}, "kind"),
        ({"manifest": 2}, "manifest: found 2"),
        ({"crop": [0, 0, 1, 1]}, "crop"),
        ({"draws": []}, "draws"),
        ({"draws": "all"}, "draws"),
        ({"draws": [7]}, "draws.0: found 7"),
        ({"entry": {"draw": 3}}, "draws.0.draw"),
        ({"entry": {"format": "rgba8"}}, "draws.0.format"),
        ({"entry": {"file": "../a.npy"}}, "draws.0.file"),
        ({"entry": {"file": "/etc/passwd"}}, "draws.0.file"),
        ({"entry": {"file": "..\\a.npy"}}, "draws.0.file"),
        ({"entry": {"file": "C:a.npy"}}, "draws.0.file"),
        ({"entry": {"file": "a\0.npy"}}, "draws.0.file"),
        ({"entry": {"file": ".."}}, "draws.0.file"),
        ({"entry": {"file": "a.txt"}}, "draws.0.file"),
        ({"entry": {"file": "b.npy"}}, "does not exist"),
        ({"entry": {"file": "a" * 5000 + ".npy"}}, "draws.0.file"),
    ],
)
def test_wrong_manifests_are_refused(tmp_path: Path, changes: dict[str, Any], told: str) -> None:
    with pytest.raises(DumpError, match=told):
        open_dump(manifest(tmp_path, **changes))


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b"[" * 100_000, b"null", b'{"kind": NaN}'])
def test_manifests_that_are_none_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / MANIFEST).write_bytes(content)
    with pytest.raises(DumpError, match=MANIFEST):
        open_dump(tmp_path)


def test_links_out_of_the_directory_are_refused(tmp_path: Path) -> None:
    inside = tmp_path / "dump"
    inside.mkdir()
    manifest(inside, entry={"file": "b.npy"})
    np.save(tmp_path / "secret.npy", np.zeros((2, 4, 3), np.uint8))
    (inside / "b.npy").symlink_to(tmp_path / "secret.npy")
    with pytest.raises(DumpError, match="link out of the directory"):
        open_dump(inside)


def test_an_entry_listed_twice_is_refused(tmp_path: Path) -> None:
    manifest(tmp_path)
    content = json.loads((tmp_path / MANIFEST).read_text())
    content["draws"] *= 2
    (tmp_path / MANIFEST).write_text(json.dumps(content))
    with pytest.raises(DumpError, match="listed twice"):
        open_dump(tmp_path)


@pytest.mark.parametrize(
    ("texels", "fmt", "told"),
    [
        (np.zeros((2, 5, 3), np.uint8), "unorm8", "5 x 2 texels"),
        (np.full((2, 4, 3), 300, np.uint16), "unorm8", "code 300"),
        (np.full((2, 4, 3), np.nan, np.float32), "float32", "NaN"),
        (np.full((2, 4, 3), np.inf, np.float32), "unorm8", "NaN or infinity"),
        (np.full((2, 4, 3), 0.3001, np.float32), "unorm8", "no code of unorm8"),
        (np.full((2, 4, 3), 1.5, np.float32), "unorm8", "no code of unorm8"),
        (np.zeros((2, 4, 3), np.uint16), "float16", "integers"),
        (np.zeros((2, 4, 2), np.uint8), "unorm8", ""),
        (np.zeros((600, 600, 3), np.float32), "float32", "more than the limit|bytes"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, texels: np.ndarray, fmt: str, told: str) -> None:
    manifest(tmp_path, entry={"format": fmt})
    np.save(tmp_path / "a.npy", texels)
    (entry,) = open_dump(tmp_path).entries
    if not told:  # two channels are taken as one, with an alpha that is left out
        assert read_entry(entry, (2, 4, 3)).shape == (2, 4, 3)
        return
    with pytest.raises(DumpError, match=told):
        read_entry(entry, (2, 4, 3))


def test_pickles_are_not_loaded(tmp_path: Path) -> None:
    manifest(tmp_path)
    np.save(tmp_path / "a.npy", np.array([print], object), allow_pickle=True)
    (entry,) = open_dump(tmp_path).entries
    with pytest.raises(DumpError, match=r"a\.npy"):
        read_entry(entry, (2, 4, 3))


def test_damaged_files_give_one_kind_of_error(tmp_path: Path) -> None:
    """Every truncation, and 200 single changed bytes, of an NPY file: read, or refused."""
    good = (manifest(tmp_path) / "a.npy").read_bytes()
    (entry,) = open_dump(tmp_path).entries
    rng = np.random.default_rng(4)
    variants = [good[:n] for n in range(0, len(good), 7)]
    for _ in range(200):
        changed = bytearray(good)
        changed[int(rng.integers(len(good)))] = int(rng.integers(256))
        variants.append(bytes(changed))
    told = []
    for content in variants:
        entry.path.write_bytes(content)
        with contextlib.suppress(DumpError):
            read_entry(entry, (2, 4, 3))
            continue
        with pytest.raises(DumpError) as refusal:
            read_entry(entry, (2, 4, 3))
        told.append(str(refusal.value))
    assert len(told) > len(variants) // 3
    assert all("a.npy" in text for text in told)


def test_rows_can_be_given_bottom_first(tmp_path: Path) -> None:
    writer = DumpWriter(tmp_path, bottom_first=True)
    texels = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    writer.add("opaque", "frame", "unorm8", texels)
    writer.close()
    (entry,) = open_dump(tmp_path).entries
    np.testing.assert_array_equal(read_entry(entry, (2, 4, 3)), texels[::-1])


PROGRAM = """
#include "atmoref_dump.hpp"
int main(int argc, char** argv) {
    unsigned char bytes[24];
    for (int i = 0; i < 24; ++i) bytes[i] = static_cast<unsigned char>(i);
    const float numbers[6] = {0.0f, 0.5f, 1.0f, 2.0f, 4.0f, 0.25f};
    atmoref::DumpWriter dump(argv[1], "a \\"quoted\\" engine\\n", argc > 2);
    dump.add("opaque", "frame", "unorm8", bytes, 3, 2, 4);
    dump.add("light_0/slab_000/main", "frame", "float32", numbers, 1, 2, 3);
    if (!dump.close()) { std::fprintf(stderr, "%s\\n", dump.error().c_str()); return 1; }
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="optional: no C++ compiler")
def test_the_c_plus_plus_writer(tmp_path: Path) -> None:
    header = resources.files("atmoref.export").joinpath("atmoref_dump.hpp")
    (tmp_path / "atmoref_dump.hpp").write_text(header.read_text("utf-8"))
    (tmp_path / "main.cpp").write_text(PROGRAM)
    flags = ["-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run(["g++", *flags, "main.cpp", "-o", "main"], cwd=tmp_path, check=True, timeout=120)
    out = tmp_path / "dump"
    assert subprocess.run(["./main", "dump"], cwd=tmp_path, check=False, capture_output=True).returncode == 1
    out.mkdir()
    for turned in ((), ("bottom",)):
        subprocess.run(["./main", "dump", *turned], cwd=tmp_path, check=True, timeout=20)
        first, second = open_dump(out).entries
        texels = np.arange(24).reshape(2, 3, 4)[..., :3]
        np.testing.assert_array_equal(read_entry(first, (2, 3, 3)), texels[::-1] if turned else texels)
        numbers = np.array([[[0.0, 0.5, 1.0]], [[2.0, 4.0, 0.25]]])
        np.testing.assert_array_equal(read_entry(second, (2, 1, 3)), numbers[::-1] if turned else numbers)
        assert open_dump(out).told["about"] == 'a "quoted" engine\n'
