"""The particles by name: one file each, one line here."""

from atmoref.optics.aerosol import AEROSOL, CORNETTE, HAZY, ISOTROPIC, MURKY
from atmoref.optics.air import AIR, Molecules
from atmoref.optics.analytic import Formula
from atmoref.optics.cloud import CLOUD
from atmoref.optics.crystals import Aggregate, Crystals
from atmoref.optics.cumulus import CUMULUS
from atmoref.optics.drops import Drops
from atmoref.optics.ice import ICE
from atmoref.optics.plates import PLATES
from atmoref.optics.rain import RAIN
from atmoref.optics.snow import SNOW
from atmoref.optics.tabulated import Tabulated

__all__ = ["DROPS", "PARTICLES", "Particle"]

Particle = Molecules | Formula | Drops | Crystals | Aggregate | Tabulated

DROPS: dict[str, Drops] = {"cloud": CLOUD, "cumulus": CUMULUS, "rain": RAIN}
"""Name -> water drops."""
PARTICLES: dict[str, Particle] = {
    "air": AIR,
    **DROPS,
    "ice": ICE,
    "plates": PLATES,
    "snow": SNOW,
    "aerosol": AEROSOL,
    "cornette_shanks": CORNETTE,
    "hazy": HAZY,
    "murky": MURKY,
    "isotropic": ISOTROPIC,
}
"""Name -> what it does to light; all have `extinction_m2`, `split` and `single`."""
