"""Cloud drops of Riley et al. 2004: around 10 um, narrow, so that glory and fogbow stay; lognormal.

Extinction: the paper's Table 2, 2 pi r^2 of its "0.01 mm sphere", which is a radius (R-E15).
"""

from atmoref.optics.drops import Drops
from atmoref.optics.sizes import Lognormal

__all__ = ["CLOUD"]

CLOUD = Drops(Lognormal(median_m=10e-6, sigma_g=1.2), radii=1000, extinction_m2=6.28e-10, size_error=0.0043)
