"""Users' phase functions from files: what they mean, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from atmoref.optics.drops import cosines
from atmoref.optics.phase_functions import HENYEY_GREENSTEIN, evaluate
from atmoref.optics.tabulated import ParticleFileError, Tabulated, read_particle
from atmoref.tables.scattered import Axes, scattered

ANGLES = np.arange(0.0, 180.1, 0.25)


def hg(g: float) -> np.ndarray:
    return evaluate(HENYEY_GREENSTEIN, g, cosines(np.minimum(ANGLES, 180.0)))


def csv_file(path: Path, head: str, columns: list[np.ndarray], delta: str = "") -> Path:
    rows = [",".join(map(repr, map(float, row))) for row in zip(np.minimum(ANGLES, 180.0), *columns, strict=True)]
    path.write_text("\n".join(["# made by a test", head, *([delta] if delta else []), *rows]) + "\n")
    return path


def both(tmp_path: Path) -> list[Tabulated]:
    """Return the same two phase functions from a CSV, with wavelengths descending, and from an NPZ."""
    text = csv_file(tmp_path / "p.csv", "angle_deg,680,440", [hg(0.7), hg(0.3)], "delta,0.25,0.5")
    arrays = {"angles_deg": np.minimum(ANGLES, 180.0), "wavelengths_nm": np.array([440.0, 680.0])}
    np.savez(tmp_path / "p.npz", **arrays, phase_function=np.array([hg(0.3), hg(0.7)]), delta=np.array([0.5, 0.25]))
    return [read_particle(text), read_particle(tmp_path / "p.npz")]


def test_files_hold_what_they_say(tmp_path: Path) -> None:
    one, other = both(tmp_path)
    for name in ("angles_deg", "wavelengths_nm", "values", "delta", "integrals"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_allclose(one.integrals, 1.0, atol=1e-3)
    parts = one.split(680.0, 4)
    assert parts.delta == 0.25
    np.testing.assert_allclose(parts.rest, 0.7 ** np.arange(4.0), atol=1e-4)
    assert one.cross_sections(440.0).asymmetry == pytest.approx(0.5 + 0.5 * 0.3, abs=1e-4)
    single = one.single(560.0, [0.0, 45.0, 180.0])  # halfway between both
    assert single.delta == pytest.approx(0.375)
    expected = 0.5 * (evaluate(HENYEY_GREENSTEIN, 0.3, 0.0) + evaluate(HENYEY_GREENSTEIN, 0.7, 0.0))
    assert one.single(560.0, [0.0, 90.0, 180.0]).values[1] == pytest.approx(float(expected), rel=1e-3)
    with pytest.raises(ParticleFileError, match=r"p\.csv.*700 nm.*440 to 680"):
        one.split(700.0, 2)


def test_one_wavelength_is_enough(tmp_path: Path) -> None:
    one = read_particle(csv_file(tmp_path / "g.csv", "angle_deg,550", [hg(0.5)]))
    assert one.split(550.0, 2).rest[1] == pytest.approx(0.5, abs=1e-4)


def test_tables_know_files_by_their_content(tmp_path: Path) -> None:
    """One number in the middle of many is another table; the name of the file and its kind are none."""
    one, other = both(tmp_path)
    assert repr(one) == repr(other)
    changed = hg(0.7)
    changed[360] *= 1.01
    moved = read_particle(csv_file(tmp_path / "q.csv", "angle_deg,680,440", [changed, hg(0.3)], "delta,0.25,0.5"))
    assert repr(moved) != repr(one)
    axes = Axes((680.0,), columns=181, orders=2)
    tables = [scattered(particle, axes) for particle in (one, moved)]
    assert (tables[0].values != tables[1].values).any()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("first line", "angle_deg")),
        ("angle,550\n0,1\n", ("first line",)),
        ("angle_deg,green\n0,1\n", ("line 1", "numbers")),
        ("angle_deg,550\n0,1\n90,x\n180,1\n", ("line 3", "'x'")),
        ("angle_deg,550\n0,1\n90,1,1\n180,1\n", ("line 3", "3 columns", "2")),
        ("angle_deg,550\n0,1\n180,1\n", ("angles", "3 to")),
        ("angle_deg,550\n0,1\n90,1\n170,1\n", ("angles", "0 to 180, ascending")),
        ("angle_deg,550\n0,1\n90,1\n90,1\n180,1\n", ("ascending",)),
        ("angle_deg,550\n0,1\n90,nan\n180,1\n", ("phase_function", "NaN")),
        ("angle_deg,550\n0,1\n90,-1\n180,1\n", ("phase_function", "negative")),
        ("angle_deg,550\n0,1\n90,1\n180,1\n", ("integral", "12.5664", "4 pi")),
        ("angle_deg,550\n0,2\n90,2\n180,2\n", ("integral", "25.13")),
        ("angle_deg,550\ndelta,1.5\n0,1\n90,1\n180,1\n", ("delta", "below 1")),
        ("angle_deg,550,550\n0,1,1\n90,1,1\n180,1,1\n", ("wavelengths", "different")),
    ],
)
def test_wrong_csv_files_are_refused(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    path = tmp_path / "w.csv"
    path.write_text(text)
    with pytest.raises(ParticleFileError) as refused:
        read_particle(path)
    assert all(word in str(refused.value) for word in (str(path), *words)), refused.value


def test_other_wrong_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "b.npz").write_bytes(b"PK\x03\x04 no archive")
    (tmp_path / "p.txt").write_text("angle_deg,550\n")
    np.savez(tmp_path / "m.npz", angles_deg=ANGLES)
    np.savez(tmp_path / "o.npz", angles_deg=np.array([None]), wavelengths_nm=ANGLES, phase_function=ANGLES)
    shapes = {"angles_deg": ANGLES, "wavelengths_nm": np.array([550.0]), "phase_function": ANGLES}
    shapes["angles_deg"] = np.minimum(ANGLES, 180.0)
    np.savez(tmp_path / "s.npz", **shapes)
    for name, word in (
        ("b.csv", "no text"), ("b.npz", "damaged"), ("p.txt", ".csv, .npz"), ("m.npz", "missing"),
        ("o.npz", "objects"), ("s.npz", "allowed: (1, 721)"),
    ):  # fmt: skip
        with pytest.raises(ParticleFileError) as refused:
            read_particle(tmp_path / name)
        assert word in str(refused.value), refused.value
    with pytest.raises(OSError, match=r"no\.csv"):
        read_particle(tmp_path / "no.csv")
