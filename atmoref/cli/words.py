"""Words of the command line that stand for numbers: sizes and rectangles."""

from __future__ import annotations

import re

from atmoref.cli.failures import RequestError

_UNITS = {"": 1, "b": 1}
for _power, _letter in enumerate("kmgt", start=1):
    _UNITS |= {_letter: 1000**_power, f"{_letter}b": 1000**_power, f"{_letter}ib": 1024**_power}
_SIZE = re.compile(r"\s*([0-9]{1,15}(?:\.[0-9]{1,9})?)\s*([a-zA-Z]*)\s*")
_CROP_FORM = "four whole numbers X,Y,WIDTH,HEIGHT in pixels, row 0 at the top, e.g. 100,50,64,64"


def parse_size(text: str | None) -> int | None:
    """Return bytes: 500MB, 1.5GiB, 2G, or plain bytes; None stays None.

    Raises
    ------
    RequestError
    """
    if text is None:
        return None
    match = _SIZE.fullmatch(text)
    factor = _UNITS.get(match[2].lower()) if match else None
    size = int(float(match[1]) * factor) if match and factor else 0
    if size < 1:
        raise RequestError(
            f"--max-memory: found {text[:60]!r}; allowed: a number above 0 with B, kB, MB, GB, TB, KiB, MiB, GiB or "
            "TiB, e.g. 500MB"
        )
    return size


def parse_crop(text: str | None) -> tuple[int, int, int, int] | None:
    """Return (x, y, width, height); None stays None.

    Raises
    ------
    RequestError
    """
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 4 or not all(re.fullmatch(r"[0-9]{1,9}", part) for part in parts):
        raise RequestError(f"--crop: found {text[:60]!r}; allowed: {_CROP_FORM}")
    x, y, width, height = (int(part) for part in parts)
    return x, y, width, height
