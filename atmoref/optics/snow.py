"""Snow: rough aggregates, as a mixture of plates, compact crystals and columns whose facets are tilted at random.

The paper says no more than "random ice crystals"; extinction: its Table 2 (2 pi r^2 for 1.5 mm).  Facets tilt up to 35
degrees, 25 degrees in the root mean square, so that there is no halo; shapes share the projected area equally.
"""

from atmoref.optics.crystals import Aggregate, Crystals

__all__ = ["SNOW"]

SNOW = Aggregate(tuple(Crystals(aspect, extinction_m2=1.41e-5, tilt_deg=35.0) for aspect in (0.2, 1.0, 4.0)))
