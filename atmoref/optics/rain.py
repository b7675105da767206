"""Raindrops of Riley et al. 2004: lognormal around 0.75 mm (25 mm/h), cut at twice its width: 0.37 to 1.5 mm.

Extinction: the paper's Table 2, 2 pi r^2 of its "1 mm sphere", which is a radius (R-E15).  Half of the light is
diffracted into less than 0.1 degrees: integrals over a table of angles need the peak taken out (R-E17).
"""

from atmoref.optics.drops import Drops
from atmoref.optics.sizes import Lognormal

__all__ = ["RAIN"]

RAIN = Drops(
    Lognormal(median_m=0.75e-3, sigma_g=1.42, cut=2.0),
    radii=300,
    extinction_m2=6.28e-6,
    through="angles",
    fine_radii=2400,
    size_error=0.0093,
)
