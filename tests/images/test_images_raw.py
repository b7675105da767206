"""Raw texels with a sidecar: what is read, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from atmoref.images import ImageError, read

GOOD: dict[str, Any] = {"width": 4, "height": 2, "channels": 3, "type": "<u2"}


def put(folder: Path, texels: np.ndarray, **told: Any) -> Path:
    (folder / "a.raw").write_bytes(texels.tobytes())
    (folder / "a.json").write_text(json.dumps({**GOOD, **told}))
    return folder / "a.raw"


def test_texels_come_back(tmp_path: Path) -> None:
    texels = np.arange(24, dtype="<u2").reshape(2, 4, 3)
    np.testing.assert_array_equal(read(put(tmp_path, texels)).rgb(), texels)
    np.testing.assert_array_equal(read(put(tmp_path, texels, origin="bottom")).rgb(), texels[::-1])
    image = read(put(tmp_path, texels.astype(">f4"), type=">f4", transfer="srgb"))
    np.testing.assert_array_equal(image.rgb(), texels)
    assert image.attributes["transfer"] == "srgb"
    assert read(put(tmp_path, texels, format="unorm12")).top("R") == 4095


@pytest.mark.parametrize(
    ("told", "problem"),
    [
        ({"width": 5}, "truncated"),
        ({"width": 3}, "longer"),
        ({"width": 0}, "width: found 0"),
        ({"width": True}, "width: found True"),
        ({"width": 1 << 20, "height": 1 << 20}, "nothing was allocated"),
        ({"channels": 5}, "channels"),
        ({"type": "O"}, "type"),
        ({"type": "<i4"}, "type"),
        ({"type": 7}, "type"),
        ({"origin": "left"}, "origin"),
        ({"transfer": []}, "transfer"),
        ({"format": 8}, "format"),
    ],
)
def test_wrong_sidecars_are_refused(tmp_path: Path, told: dict[str, Any], problem: str) -> None:
    path = put(tmp_path, np.zeros((2, 4, 3), np.uint16), **told)
    with pytest.raises(ImageError, match=problem):
        read(path)


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 100_000, "7"])
def test_sidecars_that_are_none_are_refused(tmp_path: Path, text: str) -> None:
    path = put(tmp_path, np.zeros((2, 4, 3), np.uint16))
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(ImageError, match=r"a\.json"):
        read(path)
    (tmp_path / "a.json").unlink()
    with pytest.raises(ImageError, match="sidecar"):
        read(path)
