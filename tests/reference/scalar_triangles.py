"""Triangles drawn pixel by pixel, scalar, from the records that the set-up made."""

import functools
from typing import Any

from reference.scalar_math import entry


@functools.cache
def triangle_loop(real: Any) -> Any:
    """Return the loop in one precision: every pixel looks at every triangle."""
    zero, half, one, far = real(0), real(0.5), real(1), real(1e30)

    @entry
    def rasterise(drawn, grid, records, window):
        size, f = window.height * window.pitch, records.functions
        for row in range(window.row0, window.row1):
            y = ((real(row) + half) * grid.step_y + grid.start_y) * grid.scale_y
            for column in range(window.column0, window.column1):
                x = ((real(column) + half) * grid.step_x + grid.start_x) * grid.scale_x
                best, index = far, -one
                for i in range(records.number[0]):
                    if row < records.boxes[i, 0] or row >= records.boxes[i, 1]:
                        continue
                    if column < records.boxes[i, 2] or column >= records.boxes[i, 3]:
                        continue
                    if f[i, 0] * x + (f[i, 1] * y + f[i, 2]) < zero:
                        continue
                    if f[i, 3] * x + (f[i, 4] * y + f[i, 5]) < zero:
                        continue
                    if f[i, 6] * x + (f[i, 7] * y + f[i, 8]) < zero:
                        continue
                    z = f[i, 9] * x + (f[i, 10] * y + f[i, 11])
                    if z <= zero:
                        continue
                    if grid.parallel == 0:
                        z = one / z
                    z = max(min(z, f[i, 13]), f[i, 12])
                    if z < best:
                        best, index = z, real(records.indices[i])
                drawn[row * window.pitch + column] = best
                drawn[row * window.pitch + column + size] = index

    return rasterise
