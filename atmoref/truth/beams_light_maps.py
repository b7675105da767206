# mypy: allow-untyped-defs, allow-untyped-calls
# (device functions: Numba infers their types)
"""Lights with a picture: projectors and suns as rows of tables, and where along a view ray their I_l changes formula.

I_l is bilinear between texel centres. On a view ray both picture coordinates are quotients of linear functions of the
place, X = (x0 + x1 u) / (w0 + w1 u) (for a sun w = 1), and rise or fall all the way, so that each line of texel centres
is crossed once, at the root of a linear equation. Between two crossings I_l is a polynomial of degree two in X and Y.

Pictures are kept with one more texel around, a copy of the edge, in which X = U W + 1/2 and Y (downwards) count texels:
the clamped outer half texels are then cells like all others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atmoref._jit import subroutine

__all__ = [
    "Picture",
    "Projector",
    "Sun",
    "cell_coefficients",
    "clip_linear",
    "is_constant",
    "pad_pictures",
    "picture_value",
    "projector_at",
    "projector_row",
    "sun_at",
    "sun_row",
    "walk_cells",
]

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]


class Picture(NamedTuple):
    """Which texels are a light's picture."""

    first: int  # row of the table of texels
    width: int  # without the copy of the edge
    height: int


class Projector(NamedTuple):
    """A point light with a picture: from the light, U = 1/2 + across · X / axis · X, downwards 1/2 + down · X / ..."""

    position: Triple
    axis: Triple
    across: Triple
    down: Triple
    intensity: Triple  # W/sr where the picture is 1
    picture: Picture


class Sun(NamedTuple):
    """Parallel light: U = 1/2 + across · (P - center), downwards 1/2 + down · (P - center).

    P is ``depth`` · (P - center) behind the window, along the light; without a window all three vectors are 0.
    """

    axis: Triple
    center: Triple
    across: Triple
    down: Triple
    depth: Triple
    irradiance: Triple  # W/m² where the picture is 1
    picture: Picture
    windowed: bool


@subroutine
def _three(table, i, column):
    return table[i, column], table[i, column + 1], table[i, column + 2]


@subroutine
def _picture_at(table, i, column):
    return Picture(int(table[i, column]), int(table[i, column + 1]), int(table[i, column + 2]))


@subroutine
def projector_at(table: Floats, i: int) -> Projector:
    """Return row ``i`` of a question's projectors."""
    return Projector(
        _three(table, i, 0),
        _three(table, i, 3),
        _three(table, i, 6),
        _three(table, i, 9),
        _three(table, i, 12),
        _picture_at(table, i, 15),
    )


@subroutine
def sun_at(table: Floats, i: int) -> Sun:
    """Return row ``i`` of a question's suns."""
    return Sun(
        _three(table, i, 0),
        _three(table, i, 3),
        _three(table, i, 6),
        _three(table, i, 9),
        _three(table, i, 12),
        _three(table, i, 15),
        _picture_at(table, i, 18),
        table[i, 21] != 0.0,
    )


def projector_row(light: Any, picture: Picture) -> list[float]:
    """Return the numbers of a projector: 18, as :func:`projector_at` reads them."""
    axis = np.array(light.axis())
    right = np.cross(axis, light.up)
    right /= math.sqrt(float(right @ right))
    across = right / (2.0 * math.tan(math.radians(light.horizontal_half_angle_deg)))
    down = -np.cross(right, axis) * (math.sqrt(float(across @ across)) * picture.width / picture.height)
    intensity = light.peak * np.array(light.radiant_intensity_w_per_sr)
    return [*light.position_m, *axis, *across, *down, *intensity, *map(float, picture)]


def sun_row(light: Any, picture: Picture) -> list[float]:
    """Return the numbers of a sun: 22, as :func:`sun_at` reads them."""
    axis = np.array(light.axis())
    irradiance = np.array(light.irradiance_w_per_m2)
    window = light.window
    if window is None:
        return [*axis, *np.zeros(12), *irradiance, *map(float, picture), 0.0]
    right, up = np.array(window.across_m), np.array(window.up_m)
    normal = np.cross(right, up)
    volume = float(axis @ normal)
    across, down = np.cross(up, axis) / volume, -np.cross(axis, right) / volume
    vectors = (*axis, *window.center_m, *across, *down, *(normal / volume), *(window.peak * irradiance))
    return [*vectors, *map(float, picture), 1.0]


def pad_pictures(pictures: Sequence[Floats | None]) -> tuple[Floats, list[Picture]]:
    """Return the texels (n, 3) of pictures (H, W, 3) with copies of their edges, and where each one lies.

    None stands for one white texel.
    """
    tables = [np.zeros((0, 3))]
    places = []
    first = 0
    for picture in pictures:
        array = np.ones((1, 1, 3)) if picture is None else np.asarray(picture, np.float64)
        padded = np.pad(array, ((1, 1), (1, 1), (0, 0)), mode="edge")
        places.append(Picture(first, array.shape[1], array.shape[0]))
        tables.append(padded.reshape(-1, 3))
        first += padded.shape[0] * padded.shape[1]
    return np.concatenate(tables), places


@subroutine
def clip_linear(g0, g1, low, high):
    """Return the part of [low, high] where g0 + g1 u >= 0; empty (low > high) if there is none."""
    if g1 == 0.0:
        return (low, high) if g0 >= 0.0 else (math.inf, -math.inf)
    root = -g0 / g1
    return (max(low, root), high) if g1 > 0.0 else (low, min(high, root))


@subroutine
def _cell(picture, x, y):
    """Return the texel at the least corner of the cell around (X, Y)."""
    i = min(max(math.floor(x), 0), picture.width)
    j = min(max(math.floor(y), 0), picture.height)
    return picture.first + j * (picture.width + 2) + i


@subroutine
def cell_coefficients(texels, picture, cell, c):
    """Return what I_l is in a cell: i, j, and value, x, y, xy coefficients from its least corner on, for a channel."""
    at = cell - picture.first
    below = cell + picture.width + 2
    a = texels[cell, c]
    x = texels[cell + 1, c] - a
    y = texels[below, c] - a
    i = at % (picture.width + 2)
    return i, at // (picture.width + 2), a, x, y, (texels[below + 1, c] - a) - x - y


@subroutine
def picture_value(texels, picture, across, down, c):
    """Return the picture's channel ``c`` at (U, downwards from the top edge), 0 outside the unit square."""
    if not (0.0 <= across <= 1.0 and 0.0 <= down <= 1.0):
        return 0.0
    x, y = across * picture.width + 0.5, down * picture.height + 0.5
    i, j, a, kx, ky, kxy = cell_coefficients(texels, picture, _cell(picture, x, y), c)
    return a + kx * (x - i) + ky * (y - j) + kxy * (x - i) * (y - j)


@subroutine
def is_constant(texels, picture, cell):
    """Tell whether a cell's four corners are the same."""
    below = cell + picture.width + 2
    for c in range(3):
        a = texels[cell, c]
        if texels[cell + 1, c] != a or texels[below, c] != a or texels[below + 1, c] != a:
            return False
    return True


@subroutine
def _same(texels, a, b):
    return texels[a, 0] == texels[b, 0] and texels[a, 1] == texels[b, 1] and texels[a, 2] == texels[b, 2]


@subroutine
def _at(x0, x1, w0, w1, u):
    if u == math.inf:
        return x1 / w1
    return (x0 + x1 * u) / (w0 + w1 * u)


@subroutine
def _track(x0, x1, w0, w1, size, low, high):
    """Return the first and last line of texel centres that may be crossed from ``low`` to ``high``, and the step."""
    slope = x1 * w0 - x0 * w1
    if slope == 0.0:
        return 1, 0, 1
    first = min(max(_at(x0, x1, w0, w1, low), 0.0), size + 1.0)
    last = min(max(_at(x0, x1, w0, w1, high), 0.0), size + 1.0)
    if slope > 0.0:
        return max(math.floor(first), 1), min(math.ceil(last), size), 1
    return min(math.ceil(first), size), max(math.floor(last), 1), -1


@subroutine
def _next(x0, x1, w0, w1, k, last, step, u, high):
    """Return the next line from ``k`` on that is crossed between ``u`` and ``high``, and where; infinite for none.

    Lines that are crossed on the ray's continuation, beyond infinity, are passed over.
    """
    while (last - k) * step >= 0:
        root = -(x0 - k * w0) / (x1 - k * w1)
        if u < root < high:
            return k, root
        k += step
    return k, math.inf


@subroutine
def walk_cells(texels, picture, x, y, w, low, high, ends, cells, n):
    """Cut a lit piece of a ray at every line of texel centres; leave out what is black, join what is constant.

    Parameters
    ----------
    texels, picture
        The table and the place of the picture in it.
    x, y, w
        (2,) coefficients of X w, Y w and w along the ray.
    low, high
        The piece; ``high`` may be infinite. It lies inside the picture.
    ends, cells
        Appended: (m, 2) ends, and the cell (its least corner's texel) of each.
    n
        How many there are already.

    Returns
    -------
    n
        How many there are now; -1 if they do not fit.
    """
    x0, x1 = x
    y0, y1 = y
    w0, w1 = w
    column, last_column, column_step = _track(x0, x1, w0, w1, picture.width, low, high)
    line, last_line, line_step = _track(y0, y1, w0, w1, picture.height, low, high)
    before = n
    a = low
    while a < high:
        column, next_x = _next(x0, x1, w0, w1, column, last_column, column_step, a, high)
        line, next_y = _next(y0, y1, w0, w1, line, last_line, line_step, a, high)
        b = min(next_x, next_y, high)
        middle = 0.5 * (a + b) if b < math.inf else a + 1.0 + abs(a)
        cell = _cell(picture, _at(x0, x1, w0, w1, middle), _at(y0, y1, w0, w1, middle))
        if is_constant(texels, picture, cell):
            black = texels[cell, 0] == 0.0 and texels[cell, 1] == 0.0 and texels[cell, 2] == 0.0
            join = n > before and ends[n - 1, 1] == a and is_constant(texels, picture, cells[n - 1])
            if black:
                a = b
                continue
            if join and _same(texels, cell, cells[n - 1]):
                ends[n - 1, 1] = b
                a = b
                continue
        if n == ends.shape[0]:
            return -1
        ends[n, 0], ends[n, 1], cells[n] = a, b, cell
        n += 1
        a = b
    return n
