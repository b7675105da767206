"""Read and write images by the suffix of their file."""

from __future__ import annotations

from pathlib import Path

from atmoref.images.image import MAX_BYTES, Image, ImageError

READABLE = (".exr", ".npz", ".npy", ".png", ".pfm", ".raw")
WRITABLE = (".exr", ".npz", ".png")
_BEGINNINGS = (
    (b"\x76\x2f\x31\x01", ".exr", "an OpenEXR"),
    (b"PK\x03\x04", ".npz", "an NPZ (ZIP)"),
    (b"\x93NUMPY", ".npy", "an NPY"),
    (b"\x89PNG", ".png", "a PNG"),
)


def read(path: str | Path, *, max_bytes: int = MAX_BYTES) -> Image:
    """Read an EXR, NPZ, NPY, PNG or PFM file, or raw texels with a sidecar; row 0 is the top row.

    Raises
    ------
    ImageError
        If the file is missing, truncated, damaged, of another kind than its suffix says, or takes more than
        `max_bytes` when decoded (refused before allocation). Nothing in a file is executed: pickled arrays are refused.
    """
    from atmoref.images import arrays, exr, pfm, png, raw

    where = Path(path)
    suffix = where.suffix.lower()
    if suffix not in READABLE:
        raise ImageError.of(where, f"suffix {suffix!r} is not read; readable are {', '.join(READABLE)}")
    try:
        if not where.is_file():
            raise ImageError.of(where, "is a directory" if where.is_dir() else "no such file")
        with where.open("rb") as stream:
            start = stream.read(8)
        if not start:
            raise ImageError.of(where, "the file is empty")
        for beginning, kind, told in _BEGINNINGS:
            if start.startswith(beginning) and suffix not in (kind, ".raw"):
                raise ImageError.of(where, f"wrong suffix: the file begins as {told} file, not as {suffix}")
        readers = {
            ".exr": exr.read_exr,
            ".npz": arrays.read_npz,
            ".npy": arrays.read_npy,
            ".png": png.read_png,
            ".pfm": pfm.read_pfm,
            ".raw": raw.read_raw,
        }
        return readers[suffix](where, max_bytes)
    except OSError as error:
        raise ImageError.of(where, f"cannot be read ({error.strerror or error})") from error


def write(path: str | Path, image: Image, *, exposure: float = 1.0, bits: int = 8) -> None:
    """Write an EXR, NPZ or PNG file, atomically: on any failure the old file, or no file, stands there.

    Parameters
    ----------
    path : path
        Its suffix decides. EXR stores float64 as float32 and says so in an attribute; NPZ keeps it.
    image : Image
        For PNG: ``R G B [A]`` or ``Y [A]``.
    exposure : float
        Factor on values before they are shown; PNG of values only.
    bits : int
        8 or 16; PNG of values only.

    Raises
    ------
    ImageError
        If the suffix is not known or the image cannot be held by that kind of file.
    OSError
        If the file system refuses.
    """
    from atmoref.images import arrays, exr, png
    from atmoref.store import atomic_path

    where = Path(path)
    suffix = where.suffix.lower()
    if suffix not in WRITABLE:
        raise ImageError.of(where, f"suffix {suffix!r} is not written; writable are {', '.join(WRITABLE)}")
    if not where.parent.is_dir():
        raise ImageError.of(where, f"the directory {where.parent} does not exist")
    with atomic_path(where) as temporary:
        try:
            if suffix == ".exr":
                exr.write_exr(temporary, image)
            elif suffix == ".npz":
                arrays.write_npz(temporary, image)
            else:
                png.write_png(temporary, image, exposure=exposure, bits=bits)
        except ImageError as error:
            raise ImageError(str(error).replace(str(temporary), str(where))) from error
