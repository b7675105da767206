"""atmoref: CPU reference of published GPU methods for light in the atmosphere.

`load_scene` reads a question, `render` answers it as a GPU would (the mirror), `truth` by other means and with an error
for every pixel, `compare` judges two images.  NumPy arrays in, NumPy arrays out.  Everything is imported when it is
first used, so that ``import atmoref`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from atmoref.compare import Verdict as Verdict
    from atmoref.compare import compare as compare
    from atmoref.scene import Result as Result
    from atmoref.scene import Scene as Scene
    from atmoref.scene import SceneError as SceneError
    from atmoref.scene import load_scene as load_scene
    from atmoref.techniques.render import render as render
    from atmoref.truth import solve as truth

__version__ = "0.1.0"
__all__ = ["Result", "Scene", "SceneError", "Verdict", "compare", "load_scene", "render", "truth"]

_HOMES = {
    "Result": "atmoref.scene.result",
    "Scene": "atmoref.scene",
    "SceneError": "atmoref.scene",
    "Verdict": "atmoref.compare",
    "load_scene": "atmoref.scene",
    "render": "atmoref.techniques.render",
}
_CALLABLE_ROOMS = ("compare", "truth")  # packages that are also the function they are named after


def __getattr__(name: str) -> Any:
    if name in _CALLABLE_ROOMS:
        return import_module(f"atmoref.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
