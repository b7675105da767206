"""The phase functions for plain float64 Numba code (truth, transport). See ``phase_functions.py``."""

from __future__ import annotations

import math

from atmoref._jit import subroutine
from atmoref.optics.phase_functions import phase_source

__all__ = ["phase"]

phase = subroutine(phase_source(math.sqrt))
