"""Hexagonal ice plates in random orientation: a tenth as thick as wide, smooth.

Two thirds of the light that is not diffracted pass undeviated; the 22 degree halo is weaker than the columns'.
Extinction: that of `ice`, for want of another (the paper has columns alone).
"""

from atmoref.optics.crystals import Crystals

__all__ = ["PLATES"]

PLATES = Crystals(aspect=0.1, extinction_m2=1.82e-6)
