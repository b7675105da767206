"""Pytest plugin: assert that an image, or a dump, is what a scene's mirror says.  Nothing heavy is imported before use.

``assert_matches_oracle(image, scene, codes=1)`` in any test, or the fixture ``oracle``, which also writes the HTML page
of a failure into the directory of ``--atmoref-report DIR``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from atmoref.compare import Verdict

__all__ = ["Oracle", "assert_matches_oracle", "oracle"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--atmoref-report DIR``."""
    group = parser.getgroup("atmoref", "atmoref: images against a CPU reference")
    group.addoption(
        "--atmoref-report", metavar="DIR", default=None, help="write an HTML page for every image that fails into DIR"
    )


def assert_matches_oracle(
    image: Any, scene: Any, *, codes: int | None = None, abs: float | None = None, rel: float | None = None,
    bounds: tuple[Any, Any] | None = None, mask: Any = None, technique: str | None = None,
    overrides: Sequence[str] = (), report: str | Path | None = None,
) -> Verdict:  # fmt: skip
    """Assert that an image lies within limits of what the mirror of a scene draws; return the verdict.

    Parameters
    ----------
    image : path, Image or array
        A file that ``atmoref compare`` reads, or (H, W) or (H, W, 3), row 0 at the top. Unsigned integers are codes.
    scene : str, path or Scene
        A scene file, a bundled name, or a loaded scene; or the path of an image that is the reference itself.
    codes, abs, rel, bounds, mask
        As in `atmoref.compare`. With no limit: one code where both are codes, else ``abs = 1e-4, rel = 1e-4``.
    technique : str or None
        Instead of the scene's own.
    overrides : sequence of str
        ``key=value`` changes of the scene.
    report : path or None
        Where the HTML page of a failure goes.

    Raises
    ------
    AssertionError
        With the verdict's table.
    SceneError, ImageError, CompareError
        Nothing could be compared.
    """
    __tracebackhide__ = True
    from atmoref.compare import Limits, compare
    from atmoref.images import Image, read

    test = read(image) if isinstance(image, str | Path) else image
    if isinstance(test, Image) and "A" in test.channels and len(test.channels) > 1:
        test = Image({name: plane for name, plane in test.channels.items() if name != "A"}, test.attributes)
    reference = _reference(scene, technique, overrides, _holds_codes(test))
    asked = Limits(bounds, codes, abs, rel)
    if asked == Limits():
        both = _holds_codes(test) and _holds_codes(reference)
        asked = Limits(codes=1) if both else Limits(abs=1e-4, rel=1e-4)
    verdict = compare(test, reference, bounds=asked.bounds, codes=asked.codes, abs=asked.abs, rel=asked.rel, mask=mask)
    if verdict.passed is False:
        where = ""
        if report is not None:
            from atmoref.report.html import report_of_compare

            path = Path(report)
            path.parent.mkdir(parents=True, exist_ok=True)
            page = report_of_compare(
                test, reference, verdict, asked, mask, f"{image if isinstance(image, str) else 'image'}"
            )
            path.write_text(page, encoding="utf-8")
            where = f"\nreport: {path}"
        raise AssertionError(f"the image does not match the oracle\n{verdict.table()}{where}")
    return verdict


def _holds_codes(image: Any) -> bool:
    planes = list(image.channels.values()) if hasattr(image, "channels") else [image]
    return all(getattr(getattr(plane, "dtype", None), "kind", "") == "u" for plane in planes)


def _reference(scene: Any, technique: str | None, overrides: Sequence[str], codes: bool) -> Any:
    """Return the reference: an image file, or what the mirror draws; its codes where the test has codes."""
    from atmoref.images import READABLE, read

    if isinstance(scene, str | Path) and Path(scene).suffix.lower() in READABLE:
        return read(scene)
    from atmoref.scene import Scene, load_scene

    question = scene if isinstance(scene, Scene) else load_scene(str(scene), tuple(overrides))
    from atmoref.images import from_rgb
    from atmoref.techniques.render import render

    result = render(question, technique=technique)
    frame = result.buffers["frame"]
    if codes and frame.format.kind == "unorm":
        return from_rgb(frame.codes(), {"format": frame.format.name})
    return from_rgb(result.image)


class Oracle:
    """What the fixture `oracle` gives: the same assertion, with a page for each failure where one was asked for."""

    def __init__(self, test: str, directory: str | None) -> None:
        self._test, self._directory, self._count = test, directory, 0

    def assert_matches(self, image: Any, scene: Any, **limits: Any) -> Verdict:
        """Call `assert_matches_oracle`; a failure writes TEST.html, TEST-2.html ... into the report directory."""
        __tracebackhide__ = True
        self._count += 1
        if self._directory is not None and "report" not in limits:
            stem = re.sub(r"[^A-Za-z0-9_.-]+", "_", self._test)[-120:]
            tail = f"-{self._count}" if self._count > 1 else ""
            limits["report"] = Path(self._directory) / f"{stem}{tail}.html"
        return assert_matches_oracle(image, scene, **limits)

    def assert_dump(self, directory: str | Path, scene: Any, **options: Any) -> None:
        """Assert that a dump of draws passes `atmoref check`."""
        __tracebackhide__ = True
        from atmoref.judge.check import check
        from atmoref.report import check_table, report_of_check
        from atmoref.scene import Scene, load_scene

        question = scene if isinstance(scene, Scene) else load_scene(str(scene), tuple(options.pop("overrides", ())))
        verdict = check(directory, question, **options)
        if not verdict.passed:
            if self._directory is not None:
                stem = re.sub(r"[^A-Za-z0-9_.-]+", "_", self._test)[-120:]
                path = Path(self._directory) / f"{stem}-check.html"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(report_of_check(verdict), encoding="utf-8")
            raise AssertionError(f"the dump does not match the oracle\n{check_table(verdict)}")


@pytest.fixture
def oracle(request: pytest.FixtureRequest) -> Oracle:
    """Return an `Oracle` for this test."""
    return Oracle(request.node.nodeid, request.config.getoption("--atmoref-report"))
