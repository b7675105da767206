"""`optics plot`, `optics table`, `tables build --all`, `tables export`: files, numbers read again, refusals."""

from __future__ import annotations

import csv
import json
import struct
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from cli_runs import refused, run, well

from atmoref.images import read
from atmoref.optics.tabulated import read_particle
from atmoref.store import read_npz
from atmoref.tables.scattered import Axes, scattered

FEW = ("--columns", "181", "--orders", "3")


def rows(text: str) -> list[list[str]]:
    return list(csv.reader(line for line in text.splitlines() if not line.startswith("#")))


def test_a_printed_phase_function_is_a_particle(tmp_path: Path) -> None:
    path = tmp_path / "ice.csv"
    well("optics", "table", "ice", "-o", path)
    again, table = read_particle(path), scattered("ice")
    np.testing.assert_allclose(again.delta[::-1], table.delta[:, 0], rtol=1e-12)
    np.testing.assert_allclose(again.integrals, 1.0, atol=1e-5)
    told = json.loads(well("optics", "table", path, "--kind", "sections", *FEW, "--json").out)
    assert told["head"] == ["wavelength_nm", "extinction_m2", "asymmetry", "delta"]
    np.testing.assert_allclose([row[2] for row in told["rows"]], table.asymmetry, atol=2e-4)


def test_numbers_are_those_of_the_table() -> None:
    table = scattered("aerosol", Axes((600.0, 500.0), 181, 3))
    asked = ("optics", "table", "aerosol", "--wavelengths", "600,500", *FEW)
    head, delta, *body = rows(well(*asked).out)
    assert head == ["angle_deg", "600", "500"]
    assert delta == ["delta", "0.0", "0.0"]
    np.testing.assert_allclose(np.array(body, float)[:, 1:].T, table.values[:, 0], rtol=1e-7)
    third = np.array(rows(well(*asked, "--kind", "orders", "--order", "3").out)[2:], float)
    np.testing.assert_allclose(third[:, 1:].T, table.values[:, 2], rtol=1e-7)
    forward = np.array(rows(well(*asked, "--kind", "forward").out)[1:], float)
    np.testing.assert_array_equal(forward[:, 1:].T, table.forward)
    found = rows(well("optics", "table", "rain", "--kind", "features").out)
    assert [row[0] for row in found[1:3]] == ["primary bow", "secondary bow"]


@pytest.mark.parametrize(
    "what", [("cloud", "--kind", "closeups"), ("cloud", "ice", "--kind", "orders"), ("rain", "snow", "air"),
             ("cloud", "air", "--kind", "polar"), ("ice", "--kind", "forward")],
)  # fmt: skip
def test_pictures_are_drawn(tmp_path: Path, what: tuple[str, ...]) -> None:
    path = tmp_path / "p.png"
    well("optics", "plot", *what, "-o", path)
    picture = read(path)
    values = np.stack([picture.values(name) for name in ("R", "G", "B")], -1)
    assert 0.005 < (values.min(-1) < 0.8).mean() < 0.6  # neither blank nor black
    assert picture.shape[1] >= 1000


def test_wrong_questions_are_refused(tmp_path: Path) -> None:
    refused(run("optics", "table", "fog"), 2, "'fog'", "allowed: air")
    refused(run("optics", "table", tmp_path / "no.csv"), 2, "no such file")
    (tmp_path / "w.csv").write_text("angle_deg,550\n0,9\n90,9\n180,9\n")
    refused(run("optics", "table", tmp_path / "w.csv"), 2, "integral", "113.097")
    refused(run("optics", "table", "ice", "--wavelengths", "300,500"), 2, "--wavelengths", "380 to 780")
    refused(run("optics", "table", "ice", "--columns", "10"), 2, "odd")
    refused(run("optics", "table", "ice", "--kind", "orders", "--order", "27"), 2, "--order", "1 to 26")
    refused(run("optics", "plot", "ice", "-o", tmp_path / "p.exr"), 2, "-o", ".png")
    refused(run("tables", "export", "fog", "-o", tmp_path / "p.exr"), 2, "'fog'")
    refused(run("tables", "export", "ice", "-o", tmp_path / "p.txt"), 2, "-o", ".ktx2")
    refused(run("tables", "build", "--all", "quick"), 2, "--all")
    refused(run("tables", "build", "-o", tmp_path), 2, "--all")
    refused(run("tables", "build", "--all", "--only", "fog"), 2, "--only", "cloud")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["w.csv"]


def test_a_table_is_exported_as_textures(tmp_path: Path) -> None:
    """EXR by the OpenEXR library, raw and NPZ by their readers, KTX2 by its header and bytes."""
    table = scattered("aerosol", Axes(columns=181, orders=3))
    texels = np.moveaxis(table.values, 0, -1)
    for suffix in (".exr", ".raw", ".npz", ".ktx2"):
        well("tables", "export", "aerosol", *FEW, "-o", tmp_path / f"a{suffix}")
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels = file.channels()
        np.testing.assert_array_equal(np.stack([channels[name].pixels for name in "RGB"], -1), texels)
    raw = read(tmp_path / "a.raw")
    np.testing.assert_array_equal(np.stack([raw.channels[name] for name in "RGB"], -1), texels)
    np.testing.assert_array_equal(read_npz(tmp_path / "a.npz")["values"], table.values)
    data = (tmp_path / "a.ktx2").read_bytes()
    assert struct.unpack("<4I", data[12:28]) == (109, 4, 181, 3)  # VK_FORMAT_R32G32B32A32_SFLOAT
    held = np.frombuffer(data[-texels.shape[0] * 181 * 16 :], "<f4").reshape(3, 181, 4)
    np.testing.assert_array_equal(held[..., :3], texels)
    well("tables", "export", "aerosol", *FEW, "-o", tmp_path / "u.ktx2", "--storage", "unorm16")
    told = json.loads((tmp_path / "u.ktx2.json").read_text())
    codes = np.frombuffer((tmp_path / "u.ktx2").read_bytes()[-3 * 181 * 8 :], "<u2").reshape(3, 181, 4)[..., :3]
    np.testing.assert_allclose(codes / 65535.0 * np.array(told["scales"])[:, None], texels, atol=texels.max() * 1e-5)
    assert told["forward"] == table.forward.tolist()


def test_a_shipped_table_is_built_again(tmp_path: Path) -> None:
    done = well("tables", "build", "--all", "--only", "cloud", "-o", tmp_path)
    assert done.out.startswith("cloud")
    assert done.out.endswith("as shipped\n")
    (path,) = tmp_path.iterdir()
    data = bytearray(path.read_bytes())
    assert len(data) > 1_000_000


def test_without_matplotlib_plots_say_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    refused(run("optics", "plot", "ice", "-o", tmp_path / "p.png"), 3, "Matplotlib", "pip install atmoref[report]")
    assert list(tmp_path.iterdir()) == []
