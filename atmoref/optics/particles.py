"""The particles by name: one file each, one line here."""

from atmoref.optics.air import AIR, Molecules
from atmoref.optics.cloud import CLOUD
from atmoref.optics.crystals import Crystals
from atmoref.optics.cumulus import CUMULUS
from atmoref.optics.drops import Drops
from atmoref.optics.ice import ICE
from atmoref.optics.rain import RAIN
from atmoref.optics.snow import SNOW

__all__ = ["DROPS", "PARTICLES"]

DROPS: dict[str, Drops] = {"cloud": CLOUD, "cumulus": CUMULUS, "rain": RAIN}
"""Name -> water drops."""
PARTICLES: dict[str, Molecules | Drops | Crystals] = {"air": AIR, **DROPS, "ice": ICE, "snow": SNOW}
"""Name -> what it does to light; all have `extinction_m2` and `split`."""
