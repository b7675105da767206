"""Phase functions that users bring: CSV or NPZ files of angles and values.

CSV: a head line ``angle_deg,680,550,440`` (wavelengths in nm), then one row an angle, ascending from 0 to 180 degrees,
values in 1/sr; ``delta`` in the place of the angle gives the share of a forward peak that the values leave out; lines
that start with # are comments.  NPZ: ``angles_deg`` (A,), ``wavelengths_nm`` (W,), ``phase_function`` (W, A), and if
there is one ``delta`` (W,).
"""

from __future__ import annotations

import csv
import hashlib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atmoref.optics import legendre
from atmoref.optics.drops import CrossSections
from atmoref.optics.orders import Split
from atmoref.optics.single import Progress, Single, normalised
from atmoref.store import StoreError, read_npz

__all__ = ["ParticleFileError", "Tabulated", "read_particle"]

Floats = NDArray[np.float64]
MOST_BYTES = 1 << 28
MOST_ANGLES = 100_000
TERMS = 3000
ALLOWED = 0.02
"""How far from 1 the integral of a file's values may be; they are divided by it."""


class ParticleFileError(ValueError):
    """A file is no phase function; the message names file, place and what is allowed."""


@dataclass(frozen=True, repr=False)
class Tabulated:
    """A phase function at angles, for one wavelength or several; linear between angles and between wavelengths.

    `values` (W, A) are those of the rest beside `delta` (W,), divided so that their integrals are 1; `integrals` (W,)
    are what they were divided by.
    """

    name: str
    angles_deg: Floats
    wavelengths_nm: Floats
    values: Floats
    delta: Floats
    integrals: Floats
    extinction_m2: float = 1e-12

    def __repr__(self) -> str:
        """Name the content by its hash: arrays in words are abbreviated, and tables are known by these words."""
        digest = hashlib.sha256()
        for array in (self.angles_deg, self.wavelengths_nm, self.values, self.delta):
            digest.update(f"{array.shape}".encode() + np.ascontiguousarray(array, np.float64).tobytes())
        return f"Tabulated(sha256={digest.hexdigest()!r}, extinction_m2={self.extinction_m2!r})"

    def _at(self, wavelength_nm: float) -> tuple[float, Floats]:
        grid = self.wavelengths_nm
        if not grid[0] <= wavelength_nm <= grid[-1]:
            raise ParticleFileError(
                f"{self.name}: found wavelength {wavelength_nm:g} nm; allowed: {grid[0]:g} to {grid[-1]:g} nm"
            )
        i = min(max(int(np.searchsorted(grid, wavelength_nm)) - 1, 0), max(grid.size - 2, 0))
        j = min(i + 1, grid.size - 1)
        t = 0.0 if i == j else (wavelength_nm - grid[i]) / (grid[j] - grid[i])
        delta = float(self.delta[i] + t * (self.delta[j] - self.delta[i]))
        return delta, self.values[i] + t * (self.values[j] - self.values[i])

    def cross_sections(self, wavelength_nm: float) -> CrossSections:
        """Return the cross-sections (nothing is absorbed) and the mean cosine, peak included."""
        parts = self.split(wavelength_nm, 2)
        asymmetry = parts.delta + (1.0 - parts.delta) * float(parts.rest[1])
        return CrossSections(self.extinction_m2, self.extinction_m2, asymmetry)

    def split(self, wavelength_nm: float, count: int) -> Split:
        """Return the forward peak and the first coefficients of the rest, of bins between the angles' middles."""
        delta, values = self._at(wavelength_nm)
        middles = 0.5 * (self.angles_deg[:-1] + self.angles_deg[1:])
        a = legendre.of_bins(values, np.concatenate([[0.0], middles, [180.0]]), count)
        return Split(delta, a / a[0])

    def single(self, wavelength_nm: float, angles_deg: ArrayLike, progress: Progress | None = None) -> Single:
        """Return light scattered once (see `Single`)."""
        delta, values = self._at(wavelength_nm)
        at = np.interp(np.asarray(angles_deg, np.float64), self.angles_deg, values)
        return Single(delta, at, self.split(wavelength_nm, TERMS).rest)


def read_particle(path: str | Path, extinction_m2: float = 1e-12) -> Tabulated:
    """Return a phase function from a CSV or NPZ file.

    Raises
    ------
    ParticleFileError
        Naming the file, the line or array, what was found and what is allowed.
    OSError
        If the file cannot be read.
    """
    file = Path(path)
    if file.stat().st_size > MOST_BYTES:
        raise ParticleFileError(f"{file}: found {file.stat().st_size} bytes; allowed: at most {MOST_BYTES}")
    readers = {".csv": _from_csv, ".npz": _from_npz}
    if file.suffix.lower() not in readers:
        raise ParticleFileError(f"{file}: found {file.suffix or 'no suffix'!r}; allowed: .csv, .npz")
    return _checked(file, *readers[file.suffix.lower()](file), extinction_m2)


def _from_csv(file: Path) -> tuple[Floats, Floats, Floats, Floats]:
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise ParticleFileError(f"{file}: is no text: {error}") from error
    rows = [(n, next(csv.reader([text]))) for n, text in enumerate(lines, 1) if text.strip() and text[0] != "#"]
    if not rows or rows[0][1][0].strip() != "angle_deg" or len(rows[0][1]) < 2:
        raise ParticleFileError(
            f"{file}: the first line must be angle_deg and wavelengths in nm: angle_deg,680,550,440"
        )
    width = len(rows[0][1])

    def numbers(line: int, cells: list[str]) -> list[float]:
        if len(cells) != width:
            raise ParticleFileError(f"{file}, line {line}: found {len(cells)} columns; allowed: {width}")
        try:
            return [float(cell) for cell in cells]
        except ValueError as error:
            raise ParticleFileError(f"{file}, line {line}: {error}; allowed: numbers") from error

    wavelengths = numbers(rows[0][0], ["0", *rows[0][1][1:]])[1:]
    delta, table = [0.0] * (width - 1), []
    for line, cells in rows[1:]:
        if cells[0].strip() == "delta":
            delta = numbers(line, ["0", *cells[1:]])[1:]
        else:
            table.append(numbers(line, cells))
    held = np.array(table, np.float64).reshape(-1, width)
    return held[:, 0], np.array(wavelengths), held[:, 1:].T, np.array(delta)


def _from_npz(file: Path) -> tuple[Floats, Floats, Floats, Floats]:
    try:
        arrays = read_npz(file, max_bytes=MOST_BYTES)
    except StoreError as error:
        raise ParticleFileError(str(error)) from error
    missing = [name for name in ("angles_deg", "wavelengths_nm", "phase_function") if name not in arrays]
    if missing:
        raise ParticleFileError(f"{file}: found {', '.join(sorted(arrays)) or 'nothing'}; {missing[0]} is missing")
    try:
        found = {name: np.asarray(array, np.float64) for name, array in arrays.items()}
    except (TypeError, ValueError) as error:
        raise ParticleFileError(f"{file}: {error}; allowed: arrays of numbers") from error
    waves = found["wavelengths_nm"]
    return found["angles_deg"], waves, found["phase_function"], found.get("delta", np.zeros(waves.shape))


def _checked(
    file: Path, angles: Floats, waves: Floats, values: Floats, delta: Floats, extinction_m2: float
) -> Tabulated:
    """Return the particle of arrays that make sense."""

    def refuse(what: str, found: object, allowed: str) -> ParticleFileError:
        return ParticleFileError(f"{file}: {what}: found {found}; allowed: {allowed}")

    if angles.ndim != 1 or not 3 <= angles.size <= MOST_ANGLES:
        raise refuse("angles", f"shape {angles.shape}", f"3 to {MOST_ANGLES} in one row")
    if not np.isfinite(angles).all() or angles[0] != 0.0 or angles[-1] != 180.0 or (np.diff(angles) <= 0.0).any():
        raise refuse("angles", f"{angles[0]:g} to {angles[-1]:g}", "0 to 180, ascending")
    if waves.ndim != 1 or not waves.size or not np.isfinite(waves).all() or (np.diff(waves) == 0.0).any():
        raise refuse("wavelengths", waves.tolist() if waves.size < 9 else waves.shape, "different numbers, nm")
    if values.shape != (waves.size, angles.size) or delta.shape != waves.shape:
        raise refuse("phase_function", f"shape {values.shape}", f"({waves.size}, {angles.size})")
    if not (np.isfinite(values) & (values >= 0.0)).all():
        raise refuse("phase_function", "negative values, NaN or infinity", "numbers from 0")
    if not ((delta >= 0.0) & (delta < 1.0)).all():
        raise refuse("delta", delta.tolist(), "0 to below 1")
    order = np.argsort(waves)
    divided, integrals = zip(*(normalised(values[i], angles) for i in order), strict=True)
    whole = np.array(integrals)
    for integral, share in zip(whole, delta[order], strict=True):
        if abs(integral - 1.0) > ALLOWED and abs(integral + share - 1.0) > ALLOWED:
            times = "; divide by 4 pi" if abs(integral / (4.0 * math.pi) - 1.0) < ALLOWED else ""
            raise refuse("integral over the sphere", f"{integral:.6g}{times}", f"1 (or 1 - delta) within {ALLOWED}")
    return Tabulated(file.name, angles, waves[order], np.array(divided), delta[order], whole, extinction_m2)
