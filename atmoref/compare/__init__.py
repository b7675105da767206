"""Two arrays and a budget make a verdict."""

import sys
import types

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


class _CallableRoom(types.ModuleType):
    """A package that is also the function it is named after: ``atmoref.compare`` is ``atmoref.compare.compare``."""

    __call__ = staticmethod(compare)


sys.modules[__name__].__class__ = _CallableRoom
