"""Aerosol without optics of its own: formulas that programs of the time used for haze, and two of one parameter.

The cross-section is that of accumulation-mode particles, radius 0.15 um, extinction efficiency 2: a visibility of 20 km
takes some 1.4e9 of them in a cubic metre.
"""

from atmoref.optics.analytic import Formula, disc_m2

__all__ = ["AEROSOL", "CORNETTE", "HAZY", "ISOTROPIC", "MURKY"]

AEROSOL = Formula("henyey_greenstein", extinction_m2=disc_m2(0.15e-6), g=0.7)
CORNETTE = Formula("cornette_shanks", extinction_m2=disc_m2(0.15e-6), g=0.7)
HAZY = Formula("nishita_hazy", extinction_m2=disc_m2(0.15e-6))
MURKY = Formula("nishita_murky", extinction_m2=disc_m2(0.15e-6))
ISOTROPIC = Formula("isotropic", extinction_m2=disc_m2(0.15e-6))
