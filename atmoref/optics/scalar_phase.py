"""The phase functions for plain float64 Numba code (truth, transport). See ``phase_functions.py``."""

from __future__ import annotations

import math

from atmoref._jit import scalar
from atmoref.optics.phase_functions import phase_source

__all__ = ["phase"]

phase = scalar(phase_source(math.sqrt))
