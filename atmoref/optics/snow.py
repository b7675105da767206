"""Snow: crystals as long as wide whose facets are tilted at random, so that there is no halo.

The paper says no more than "random ice crystals"; extinction: its Table 2 (2 pi r^2 for 1.5 mm).  Facets tilt up to 35
degrees, 25 degrees in the root mean square; aggregates of many shapes would be smoother still.
"""

from atmoref.optics.crystals import Crystals

__all__ = ["SNOW"]

SNOW = Crystals(aspect=1.0, extinction_m2=1.41e-5, tilt_deg=35.0)
