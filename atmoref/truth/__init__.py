"""Truth: the same questions answered by other means than the techniques, with an error for every pixel.

It shares scene and optics with the techniques and nothing of a method: docs/decisions/0003-truth-independence.md.
"""

from __future__ import annotations

import sys
import types
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Literal

    from atmoref.scene.result import Result

__all__ = ["solve"]


def solve(
    scene: object,
    *,
    method: Literal["quadrature", "monte_carlo"] = "quadrature",
    threads: int | None = None,
    rtol: float = 1e-9,
    samples: int = 256,
    seed: int = 0,
    crop: tuple[int, int, int, int] | None = None,
    progress: Callable[[int, int], None] | None = None,
    ambient: Literal["constant", "saturating"] = "constant",
) -> Result:
    """Return the true radiance of a scene, not clipped, with its error.

    Parameters
    ----------
    scene
        From ``atmoref.load_scene``.
    method
        ``"quadrature"``: lit pieces of each ray, found exactly and integrated until the estimated error of the beam
        term is below ``rtol`` of it. ``"monte_carlo"``: an independent estimate, with standard errors.
    threads
        How many; None for all processors. The result has the same bits for any number.
    rtol
        Relative error to reach; with Monte Carlo a pixel stops early if its standard error is below it.
    samples
        Monte Carlo: samples per pixel and light, a multiple of 16, at least 64.
    seed
        Monte Carlo: another number, another independent estimate.
    crop
        (x, y, width, height) in pixels, row 0 at the top; the result has the crop's size.
    progress
        Called as ``progress(done, rows)``.
    ambient
        ``"constant"`` adds the medium's ambient radiance everywhere, ``"saturating"`` times 1 - exp(-sigma_t T)
        (erratum D-E34).

    Returns
    -------
    Result
        ``image`` (H, W, 3) in W/(m² sr); ``error``, per pixel and channel, an absolute error estimate or a standard
        error (Monte Carlo); ``buffers`` ``beam`` and ``surface``; ``stats`` with counts, seconds and how many values
        missed ``rtol``. Where a lit ray runs exactly through a light the radiance is infinite, and so is the value.

    Raises
    ------
    ValueError
        For an unknown method or mode, rtol outside [1e-13, 1), a crop outside the image, less than one thread, or an
        unsuitable number of samples.
    """
    from atmoref.truth.beams import solve_beams

    return solve_beams(scene, method, threads, rtol, samples, seed, crop, progress, ambient)


class _CallableRoom(types.ModuleType):
    """A package that is also the function it is named after: ``atmoref.truth`` is ``atmoref.truth.solve``."""

    __call__ = staticmethod(solve)


sys.modules[__name__].__class__ = _CallableRoom
