"""What makes a command start sooner."""

from __future__ import annotations

import importlib
import sys


def load_numba_without_blas() -> None:
    """Load Numba's array support without SciPy's linear algebra, a quarter of a second.

    Numba imports it only to learn whether BLAS is there, for products of matrices; our kernels have none.  Done for
    commands alone: a program that uses the package may need both.
    """
    if "scipy.linalg" in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]  # an import of it fails at once
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del sys.modules["scipy.linalg"]
