"""Round trips of every kind of file, and refusals."""

from __future__ import annotations

import contextlib
import io
import json
import math
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from atmoref.images import Image, ImageError, from_rgb, read, srgb_encode, write

RNG = np.random.default_rng(20021)


def random_plane(kind: str, shape: tuple[int, int] = (5, 7)) -> np.ndarray:
    if kind.startswith("uint"):
        return RNG.integers(0, np.iinfo(kind).max, shape, dtype=kind, endpoint=True)
    return RNG.standard_normal(shape).astype(kind)


def assert_same(left: Image, right: Image) -> None:
    assert list(sorted(left.channels)) == list(sorted(right.channels))
    for name, plane in left.channels.items():
        assert plane.dtype == right.channels[name].dtype, name
        np.testing.assert_array_equal(plane, right.channels[name])


@pytest.mark.parametrize("kind", ["float16", "float32", "uint8", "uint16", "uint32"])
@pytest.mark.parametrize("shape", [(1, 1), (5, 7), (40, 33)])
def test_exr_keeps_every_type_that_it_can_hold(tmp_path: Path, kind: str, shape: tuple[int, int]) -> None:
    image = Image({name: random_plane(kind, shape) for name in ("R", "stage.plane_007.R", "T.G")})
    write(tmp_path / "a.exr", image)
    assert_same(read(tmp_path / "a.exr"), image)


def test_exr_mixes_types_and_keeps_attributes(tmp_path: Path) -> None:
    attributes = {
        "scene_hash": "ab" * 32,
        "frames": -3,
        "interval_m": 0.1,
        "note": "größe",
        "empty": "",
        "format": "unorm8",
    }
    image = Image({"R": random_plane("float32"), "H": random_plane("float16"), "C": random_plane("uint8")}, attributes)
    write(tmp_path / "a.exr", image)
    again = read(tmp_path / "a.exr")
    assert_same(again, image)
    assert again.attributes == attributes


def test_exr_rounds_float64_to_float32_and_says_so(tmp_path: Path) -> None:
    image = Image({"R": random_plane("float64"), "G": random_plane("float32")})
    write(tmp_path / "a.exr", image)
    again = read(tmp_path / "a.exr")
    assert again.attributes == {"float32_of_float64": "R"}
    np.testing.assert_array_equal(again.channels["R"], image.channels["R"].astype(np.float32))
    with pytest.raises(ImageError, match=r"beyond float32; write \.npz"):
        write(tmp_path / "b.exr", Image({"R": np.array([[1e300]])}))


def test_exr_holds_infinity_and_nan(tmp_path: Path) -> None:
    plane = np.array([[math.inf, -math.inf, math.nan, -0.0]], np.float32)
    write(tmp_path / "a.exr", Image({"Y": plane}))
    again = read(tmp_path / "a.exr").channels["Y"]
    assert again.tobytes() == plane.tobytes()


def test_exr_is_zip_compressed_and_opens_with_the_library_alone(tmp_path: Path) -> None:
    import OpenEXR

    write(tmp_path / "a.exr", from_rgb(np.arange(60, dtype=np.float32).reshape(4, 5, 3)))
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        np.testing.assert_array_equal(file.channels()["RGB"].pixels, np.arange(60).reshape(4, 5, 3))


@pytest.mark.parametrize("name", ["channels", "dataWindow", "compression", "", "x" * 256])
def test_exr_refuses_reserved_attribute_names(tmp_path: Path, name: str) -> None:
    with pytest.raises(ImageError, match="cannot be used"):
        write(tmp_path / "a.exr", Image({"R": random_plane("float32")}, {name: "x"}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["float16", "float32", "float64", "uint8", "uint16", "uint32"])
def test_npz_keeps_every_type(tmp_path: Path, kind: str) -> None:
    attributes = {"t": "ü", "i": 2**40, "f": 0.1}
    image = Image(
        {"R": random_plane(kind), "stage.plane_001.R": random_plane(kind), "file": random_plane(kind)}, attributes
    )
    write(tmp_path / "a.npz", image)
    again = read(tmp_path / "a.npz")
    assert_same(again, image)
    assert again.attributes == attributes
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["R"], image.channels["R"])


def test_npz_of_equal_images_has_equal_bytes(tmp_path: Path) -> None:
    image = Image({"R": random_plane("float64")}, {"a": 1})
    write(tmp_path / "a.npz", image)
    write(tmp_path / "b.npz", image)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_npz_of_another_program(tmp_path: Path) -> None:
    colour = RNG.random((4, 6, 3))
    np.savez(tmp_path / "a.npz", picture=colour)
    np.testing.assert_array_equal(read(tmp_path / "a.npz").rgb(), colour)
    np.savez_compressed(tmp_path / "b.npz", depth=colour[..., 0], Y=np.asfortranarray(colour[..., 1]))
    again = read(tmp_path / "b.npz")
    np.testing.assert_array_equal(again.channels["Y"], colour[..., 1])
    np.savez(tmp_path / "c.npz", depth=colour[..., 0], table=np.zeros(3))
    with pytest.raises(ImageError, match="table"):
        read(tmp_path / "c.npz")


@pytest.mark.parametrize("array", [RNG.random((3, 4)), RNG.random((3, 4, 3)).astype(">f4"), np.ones((2, 2), bool)])
def test_npy(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "a.npy", array)
    again = read(tmp_path / "a.npy").rgb()
    np.testing.assert_array_equal(again, array if array.ndim == 3 else np.stack([array] * 3, axis=-1))


def test_pickles_are_refused_and_never_run(tmp_path: Path) -> None:
    class Bomb:
        def __reduce__(self):  # type: ignore[no-untyped-def]
            return (Path.touch, (tmp_path / "ran",))

    np.save(tmp_path / "a.npy", np.array([[Bomb()]], object), allow_pickle=True)
    np.savez(tmp_path / "a.npz", R=np.array([[Bomb()]], object))
    for name in ("a.npy", "a.npz"):
        with pytest.raises(ImageError, match=f"{name}.*object"):
            read(tmp_path / name)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(("order", "scale"), [("<f4", b"-1.0"), (">f4", b"1.0"), ("<f4", b"-2.5")])
@pytest.mark.parametrize("channels", [1, 3])
def test_pfm_is_turned_upright(tmp_path: Path, order: str, scale: bytes, channels: int) -> None:
    upright = RNG.random((3, 4, channels)).astype(np.float32)
    kind = b"PF" if channels == 3 else b"Pf"
    data = upright[::-1].astype(order).tobytes()
    (tmp_path / "a.pfm").write_bytes(kind + b"\n4 3\n" + scale + b"\n" + data)
    image = read(tmp_path / "a.pfm")
    np.testing.assert_array_equal(image.rgb(), upright if channels == 3 else np.repeat(upright, 3, axis=2))
    assert image.attributes["pfm_scale"] == abs(float(scale))


def test_png_keeps_every_8_bit_code(tmp_path: Path) -> None:
    from PIL import Image as Picture

    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    for image in (
        from_rgb(codes),
        from_rgb(np.stack([codes, codes.T, 255 - codes], -1)),
        from_rgb(np.stack([codes] * 4, -1)),
    ):
        write(tmp_path / "a.png", image)
        again = read(tmp_path / "a.png")
        assert_same(again, image)
        assert again.attributes["transfer"] == "codes"
        with Picture.open(tmp_path / "a.png") as picture:
            assert picture.text["Description"] == "codes as they are stored, not encoded for display, format unorm8"
            assert "srgb" not in picture.info


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_png_keeps_every_16_bit_code(tmp_path: Path, channels: int) -> None:
    codes = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    image = from_rgb(np.stack([np.roll(codes, 97 * at) for at in range(channels)], -1), {"format": "unorm16"})
    write(tmp_path / "a.png", image)
    again = read(tmp_path / "a.png")
    assert_same(again, image)
    assert again.attributes["format"] == "unorm16"


def test_16_bit_grey_is_what_pillow_reads_and_writes(tmp_path: Path) -> None:
    from PIL import Image as Picture

    codes = RNG.integers(0, 65536, (9, 13), dtype=np.uint16)
    write(tmp_path / "a.png", from_rgb(codes))
    with Picture.open(tmp_path / "a.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), codes)
    Picture.fromarray(codes).save(tmp_path / "b.png")
    np.testing.assert_array_equal(read(tmp_path / "b.png").channels["Y"], codes)


def encode_rows(planes: np.ndarray, kinds: list[int]) -> bytes:
    """Filter rows as the PNG text defines it (clause 9.2), in the plainest form, and pack a file."""
    height, width, channels = planes.shape
    step = 2 * channels
    rows = planes.astype(">u2").tobytes()
    length = width * step
    out = bytearray()
    for y in range(height):
        out.append(kinds[y])
        for x in range(length):
            here = rows[y * length + x]
            left = rows[y * length + x - step] if x >= step else 0
            up = rows[(y - 1) * length + x] if y else 0
            corner = rows[(y - 1) * length + x - step] if y and x >= step else 0
            estimate = left + up - corner
            paeth = min((left, up, corner), key=lambda value: abs(estimate - value))
            guess = (0, left, up, (left + up) // 2, paeth)[kinds[y]]
            out.append((here - guess) % 256)
    colour = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 16, colour, 0, 0, 0)),
        (b"IDAT", zlib.compress(bytes(out))),
    ]
    packed = b"".join(
        struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        for name, content in [*chunks, (b"IEND", b"")]
    )
    return b"\x89PNG\r\n\x1a\n" + packed


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_16_bit_png_with_all_row_filters(tmp_path: Path, channels: int) -> None:
    planes = RNG.integers(0, 65536, (12, 6, channels), dtype=np.uint16)
    (tmp_path / "a.png").write_bytes(encode_rows(planes, [4, 3, 2, 1, 0, 1, 3, 4, 4, 2, 3, 1]))
    image = read(tmp_path / "a.png")
    np.testing.assert_array_equal(np.stack(list(image.channels.values()), -1), planes)
    assert image.attributes["transfer"] == "unstated"


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("exposure", [1.0, 0.25])
def test_png_of_values_is_exposed_and_srgb_encoded(tmp_path: Path, bits: int, exposure: float) -> None:
    values = np.array([[-1.0, 0.0, 0.001, 0.2, 0.5, 1.0, 3.0, 5.0]])
    image = from_rgb(np.stack([values] * 3, -1))
    write(tmp_path / "a.png", image, exposure=exposure, bits=bits)
    again = read(tmp_path / "a.png")
    top = 2**bits - 1
    expected = np.floor(srgb_encode(np.clip(values * exposure, 0, 1)) * top + 0.5)
    np.testing.assert_array_equal(again.channels["R"], expected)
    assert again.attributes["transfer"] == "srgb"
    assert again.attributes["exposure"] == exposure


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_png_refuses_what_is_not_finite_and_leaves_the_old_file(tmp_path: Path, value: float) -> None:
    plane = np.zeros((3, 4))
    write(tmp_path / "a.png", from_rgb(plane))
    before = (tmp_path / "a.png").read_bytes()
    plane[2, 1] = value
    with pytest.raises(ImageError, match=r"a\.png: .*in channel Y at x = 1, y = 2"):
        write(tmp_path / "a.png", from_rgb(plane))
    assert (tmp_path / "a.png").read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.png"]


def test_png_refuses_what_it_cannot_hold(tmp_path: Path) -> None:
    plane = np.zeros((2, 2), np.float32)
    for channels, told in (
        ({"R": plane, "G": plane, "B": plane, "T.R": plane}, "T.R"),
        ({"R": plane, "G": plane}, "no colour"),
        ({"Y": plane.astype(np.uint32)}, "uint32"),
    ):
        with pytest.raises(ImageError, match=told):
            write(tmp_path / "a.png", Image(channels))
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from atmoref.images import exr

    image = from_rgb(np.ones((4, 4)))
    write(tmp_path / "a.exr", image)
    before = (tmp_path / "a.exr").read_bytes()

    def interrupted(path: Path, image: Image) -> None:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(exr, "write_exr", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "a.exr", image)
    assert (tmp_path / "a.exr").read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.exr"]


def test_names_that_are_refused(tmp_path: Path) -> None:
    image = from_rgb(np.ones((2, 2)))
    (tmp_path / "empty.png").write_bytes(b"")
    (tmp_path / "folder.exr").mkdir()
    for name, told in (
        ("a.gif", "suffix '.gif' is not read"),
        ("missing.exr", "no such file"),
        ("empty.png", "empty"),
        ("folder.exr", "is a directory"),
    ):
        with pytest.raises(ImageError, match=told):
            read(tmp_path / name)
    with pytest.raises(ImageError, match="not written"):
        write(tmp_path / "a.jpg", image)
    with pytest.raises(ImageError, match="does not exist"):
        write(tmp_path / "no" / "a.exr", image)


@pytest.mark.parametrize("suffix", [".exr", ".npz", ".png"])
@pytest.mark.parametrize("other", [".exr", ".npz", ".npy", ".png", ".pfm"])
def test_a_wrong_suffix_is_named(tmp_path: Path, suffix: str, other: str) -> None:
    if suffix == other:
        return
    write(tmp_path / f"a{suffix}", from_rgb(np.ones((4, 4))))
    wrong = (tmp_path / f"a{suffix}").rename(tmp_path / f"b{other}")
    with pytest.raises(ImageError, match="wrong suffix"):
        read(wrong)


def sample_files(folder: Path) -> list[Path]:
    values, codes = RNG.random((40, 21, 3)).astype(np.float32), RNG.integers(0, 65536, (20, 11, 3), dtype=np.uint16)
    write(folder / "a.exr", from_rgb(values, {"note": "x" * 50}))
    write(folder / "a.npz", from_rgb(values, {"note": "x" * 50}))
    write(folder / "a.png", from_rgb(values))
    write(folder / "b.png", from_rgb(codes))
    np.save(folder / "a.npy", values)
    (folder / "a.pfm").write_bytes(b"PF\n21 40\n-1\n" + values.tobytes())
    return sorted(folder.iterdir())


def test_truncated_files_are_refused_at_every_length(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for path in sample_files(tmp_path):
        whole = path.read_bytes()
        lengths = {*range(1, 40), *np.linspace(40, len(whole) - 1, 40).astype(int).tolist(), len(whole) - 1}
        for length in sorted(lengths):
            path.write_bytes(whole[:length])
            with pytest.raises(ImageError, match=path.name):
                read(path)
    assert "Exception" not in "".join(capfd.readouterr())


def test_damaged_bytes_give_an_image_or_a_sentence(tmp_path: Path) -> None:
    for path in sample_files(tmp_path):
        whole = bytearray(path.read_bytes())
        for _ in range(60):
            damaged = bytearray(whole)
            for at in RNG.integers(0, len(whole), 3):
                damaged[at] ^= int(RNG.integers(1, 256))
            path.write_bytes(damaged)
            with contextlib.suppress(ImageError):
                assert read(path).channels


def test_huge_dimensions_are_refused_before_allocation(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", from_rgb(np.ones((4, 4), np.float32)))
    data = (tmp_path / "a.exr").read_bytes()
    at = data.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    for width, height in ((60000, 60000), (2**30, 2**30), (4, 2**20)):
        (tmp_path / "a.exr").write_bytes(data[:at] + struct.pack("<4i", 0, 0, width, height) + data[at + 16 :])
        with pytest.raises(ImageError, match=r"a\.exr"):
            read(tmp_path / "a.exr")
    header = struct.pack(">IIBBBBB", 100000, 100000, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", 13) + b"IHDR" + header + struct.pack(">I", zlib.crc32(b"IHDR" + header))
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunk)
    (tmp_path / "a.pfm").write_bytes(b"PF\n99999 99999\n-1\n")
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, {"shape": (10**6, 10**6), "fortran_order": False, "descr": "<f8"})
    (tmp_path / "a.npy").write_bytes(content.getvalue())
    for name in ("a.png", "a.pfm", "a.npy"):
        with pytest.raises(ImageError, match=f"{name}.*limit"):
            read(tmp_path / name)


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    with (
        zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("R.npy", "w") as member,
    ):
        np.lib.format.write_array_header_1_0(member, {"shape": (4096, 4096), "fortran_order": False, "descr": "|u1"})
        for _ in range(16):
            member.write(bytes(1 << 20))
    with pytest.raises(ImageError, match="limit"):
        read(tmp_path / "a.npz", max_bytes=1 << 23)
    assert read(tmp_path / "a.npz").shape == (4096, 4096)


def test_a_png_with_more_data_than_its_size_is_refused(tmp_path: Path) -> None:
    whole = encode_rows(np.zeros((4, 4, 3), np.uint16), [0] * 4)
    bomb = zlib.compress(bytes(1 << 20))
    at = whole.index(b"IDAT") - 4
    chunk = struct.pack(">I", len(bomb)) + b"IDAT" + bomb + struct.pack(">I", zlib.crc32(b"IDAT" + bomb))
    (tmp_path / "a.png").write_bytes(
        whole[:at] + chunk + struct.pack(">I", 0) + b"IEND" + struct.pack(">I", zlib.crc32(b"IEND"))
    )
    with pytest.raises(ImageError, match="longer than its header says"):
        read(tmp_path / "a.png")


def test_attributes_that_are_no_table_are_refused(tmp_path: Path) -> None:
    for text in ("[1]", "{", json.dumps({"a": [1]})):
        np.savez(tmp_path / "a.npz", R=np.ones((2, 2)), __attributes__=np.frombuffer(text.encode(), np.uint8))
        with pytest.raises(ImageError, match=r"a\.npz"):
            read(tmp_path / "a.npz")


def test_import_is_cheap_and_lazy() -> None:
    code = "import sys, atmoref.compare, atmoref.images; print(*sorted(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.split())
    assert not loaded & {"OpenEXR", "skimage", "flip_evaluator", "PIL", "scipy", "numba", "matplotlib"}
