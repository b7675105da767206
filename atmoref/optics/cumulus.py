"""Cumulus drops of Bouthors et al. 2008: modified gamma, effective radius 6 um, gamma = 2, so scale 1.5 um.

Extinction: 2 pi times the mean square radius of 13.5 um^2 (B-E6: the printed N_0 pi r_e^2 mixes moments).
"""

import math

from atmoref.optics.drops import Drops
from atmoref.optics.sizes import ModifiedGamma

__all__ = ["CUMULUS"]

CUMULUS = Drops(
    ModifiedGamma(scale_m=1.5e-6, gamma=2.0),
    radii=1000,
    extinction_m2=2.0 * math.pi * 13.5e-12,
    fine_radii=4000,
    size_error=0.0055,
)
