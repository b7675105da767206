"""The particles by name: one file each, one line here."""

from atmoref.optics.cloud import CLOUD
from atmoref.optics.cumulus import CUMULUS
from atmoref.optics.drops import Drops
from atmoref.optics.rain import RAIN

__all__ = ["PARTICLES"]

PARTICLES: dict[str, Drops] = {"cloud": CLOUD, "cumulus": CUMULUS, "rain": RAIN}
"""Name -> what it does to light."""
