"""Two arrays and a budget make a verdict."""

from atmoref.compare.frame import CompareError
from atmoref.compare.limits import Limit, Limits
from atmoref.compare.metrics import Place
from atmoref.compare.picture import amplified_image, difference_image
from atmoref.compare.verdict import Verdict, compare

__all__ = [
    "CompareError",
    "Limit",
    "Limits",
    "Place",
    "Verdict",
    "amplified_image",
    "compare",
    "difference_image",
]
