"""The phase functions for lanes: the source of ``phase_functions.py`` over ``atmoref.lanes.sqrt``."""

from __future__ import annotations

from atmoref._jit import device
from atmoref.lanes import sqrt
from atmoref.optics.phase_functions import phase_source

__all__ = ["lane_phase"]

lane_phase = device(phase_source(sqrt))
