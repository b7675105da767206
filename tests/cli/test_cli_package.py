"""The package as Python sees it: names, laziness, rooms that are functions, time of import."""

from __future__ import annotations

import inspect
import subprocess
import sys

import numpy as np
import pytest

import atmoref


def python(code: str) -> str:
    """Return what a fresh interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_everything_that_is_promised_is_there() -> None:
    for name in atmoref.__all__:
        assert callable(getattr(atmoref, name)), name
        assert name in dir(atmoref)
    with pytest.raises(AttributeError, match="no attribute 'rendr'"):
        _ = atmoref.rendr  # type: ignore[attr-defined]


def test_import_takes_no_library_along() -> None:
    code = (
        "import sys, atmoref; "
        "print([m for m in ('numpy', 'numba', 'pydantic', 'scipy', 'typer', 'rich') if m in sys.modules])"
    )
    assert python(code).strip() == "[]"


def test_import_takes_less_than_half_a_second() -> None:
    code = "import time; t = time.perf_counter(); import atmoref; print(time.perf_counter() - t)"
    assert min(float(python(code)) for _ in range(3)) < 0.5


def test_scenes_and_command_come_without_numba() -> None:
    code = (
        "import sys, atmoref; from atmoref.cli import main; atmoref.load_scene('quick'); "
        "main(['validate', 'fig4d']); main(['scenes']); main(['--version']); "
        "print(file=sys.stderr); sys.exit('numba' in sys.modules)"
    )
    assert "fig4c" in python(code)


@pytest.mark.parametrize("room", ["truth", "compare"])
@pytest.mark.parametrize(
    "imports",
    ["import atmoref", "import atmoref.{0}", "import atmoref.{0}, atmoref", "from atmoref import {0}; import atmoref"],
)
def test_rooms_are_functions_in_any_order_of_imports(room: str, imports: str) -> None:
    look = f"print(callable(atmoref.{room}), atmoref.{room} is sys.modules['atmoref.{room}'])"
    code = f"{imports.format(room)}; import sys; {look}"
    assert python(code).split() == ["True", "True"]


def test_rooms_answer_like_their_functions() -> None:
    from atmoref.compare import compare
    from atmoref.truth import solve

    image = np.linspace(0.0, 1.0, 24).reshape(4, 6)
    assert atmoref.compare(image, image, abs=0.0).passed
    assert "rtol" in inspect.signature(atmoref.truth).parameters
    scene = atmoref.load_scene("quick", ["image.width=4", "image.height=6"])
    np.testing.assert_array_equal(atmoref.truth(scene, rtol=1e-7).image, solve(scene, rtol=1e-7).image)
    assert type(atmoref.compare(image, image)) is type(compare(image, image)) is atmoref.Verdict


def test_render_from_python() -> None:
    scene = atmoref.load_scene("quick", ["image.width=24", "image.height=36"])
    result = atmoref.render(scene)
    assert isinstance(result, atmoref.Result)
    assert result.image.shape == (36, 24, 3)
    assert result.provenance["scene_sha256"] == scene.digest()
