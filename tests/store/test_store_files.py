"""Files written whole or not at all, and NPZ files that lie about themselves."""

import io
import os
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from atmoref import store


def names(directory: Path) -> list[str]:
    return sorted(p.name for p in directory.iterdir())


def test_success_replaces_the_file_and_keeps_its_suffix(tmp_path: Path) -> None:
    target = tmp_path / "image.exr"
    target.write_text("old")
    with store.atomic_path(target) as path:
        assert path.parent == tmp_path
        assert path.suffix == ".exr"
        path.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert names(tmp_path) == ["image.exr"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, SystemExit])
def test_failure_leaves_the_old_file_alone(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "image.exr"
    target.write_text("old")

    def write() -> None:
        with store.atomic_path(target) as path:
            path.write_text("half")
            raise error

    with pytest.raises(error):
        write()
    assert target.read_text() == "old"
    assert names(tmp_path) == ["image.exr"]


def test_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "file")
    with store.atomic_path(tmp_path / "link") as path:
        path.write_text("x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "x"


def test_directories_and_devices_are_refused(tmp_path: Path) -> None:
    for wrong in (tmp_path, Path(os.devnull)):
        with pytest.raises(OSError, match="not a regular file"), store.atomic_path(wrong):
            pytest.fail("entered")
    assert Path(os.devnull).is_char_device()
    with pytest.raises(FileNotFoundError, match="no such directory"), store.atomic_path(tmp_path / "a" / "b"):
        pytest.fail("entered")


def test_what_a_killed_process_left_is_removed_by_the_next_writer(tmp_path: Path) -> None:
    target = tmp_path / "out.npz"
    text = (
        "import os, signal\nfrom atmoref import store\n"
        f"with store.atomic_path({str(target)!r}) as path:\n"
        "    path.write_text('half')\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    assert subprocess.run([sys.executable, "-c", text], check=False).returncode == -signal.SIGKILL
    assert len(names(tmp_path)) == 1
    with store.atomic_path(target) as path, store.atomic_path(target) as second:
        path.write_text("whole")  # a living process's file is left alone
        second.write_text("other")
    assert names(tmp_path) == ["out.npz"]
    assert target.read_text() == "whole"


def test_mode_follows_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with store.atomic_path(tmp_path / "f") as path:
            path.write_text("x")
    finally:
        os.umask(before)
    assert (tmp_path / "f").stat().st_mode & 0o777 == 0o640


def test_npz_round_trip(tmp_path: Path) -> None:
    arrays = {
        "f": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "empty": np.zeros((0, 3), np.float32),
        "scalar": np.array(3, np.uint8),
        "text": np.array(["a", "bc"]),
    }
    path = tmp_path / "a.npz"
    store.write_npz(path, arrays)
    for read in (store.read_npz(path), dict(np.load(path))):
        assert list(read) == list(arrays)
        for name, array in arrays.items():
            assert read[name].dtype == array.dtype
            np.testing.assert_array_equal(read[name], array)
    with pytest.raises(ValueError, match=r"[Oo]bject"):
        store.write_npz(tmp_path / "b.npz", {"o": np.array([{}], object)})
    assert names(tmp_path) == ["a.npz"]


def test_compressed_npz_is_read(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", x=np.arange(1000))
    np.testing.assert_array_equal(store.read_npz(tmp_path / "a.npz")["x"], np.arange(1000))


def write_member(path: Path, header: dict[str, object], body: bytes) -> None:
    stream = io.BytesIO()
    np.lib.format.write_array_header_2_0(stream, header)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", stream.getvalue() + body)


@pytest.mark.parametrize(
    ("shape", "descr", "message"),
    [
        ((1 << 40, 1 << 20), "<f8", "declares shape"),
        ((5,), "<f8", "declares shape"),
        ((-4, -2), "<f8", "declares shape"),
        ((8,), "|O", "holds objects"),
        ((3,), "no type", "damaged or no NPZ"),
    ],
)
def test_headers_that_lie_are_refused(tmp_path: Path, shape, descr: str, message: str) -> None:
    write_member(tmp_path / "a.npz", {"shape": shape, "fortran_order": False, "descr": descr}, bytes(64))
    with pytest.raises(store.StoreError, match=message):
        store.read_npz(tmp_path / "a.npz")


def test_absurd_sizes_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    write_member(path, {"shape": (1 << 21,), "fortran_order": False, "descr": "<f8"}, bytes(1 << 24))
    assert path.stat().st_size < 1 << 17
    with pytest.raises(store.StoreError, match="declares 16777"):
        store.read_npz(path, max_bytes=1 << 20)
    assert store.read_npz(path)["x"].size == 1 << 21


def test_other_files_are_refused(tmp_path: Path) -> None:
    for name, content in {"empty": b"", "text": b"hello", "zip": None}.items():
        path = tmp_path / name
        if content is None:
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("readme.txt", "hello")
        else:
            path.write_bytes(content)
        with pytest.raises(store.StoreError, match="damaged or no NPZ"):
            store.read_npz(path)
    with pytest.raises(FileNotFoundError):
        store.read_npz(tmp_path / "absent")
