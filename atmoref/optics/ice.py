"""Ice crystals of cirrus as in Riley et al. 2004: smooth hexagonal columns in random orientation, length 2.5 diameters.

Extinction: the paper's Table 2, twice a mean projected area of 9.1e-7 m^2 (R-E15); it does not give the crystal.
"""

from atmoref.optics.crystals import Crystals

__all__ = ["ICE"]

ICE = Crystals(aspect=2.5, extinction_m2=1.82e-6)
