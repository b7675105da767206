"""Pages, JUnit and JSON of verdicts: self-contained, well-formed, and with what went wrong in them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from atmoref.buffers.formats import FORMATS
from atmoref.compare import Limits, compare
from atmoref.images import from_rgb
from atmoref.judge.allowance import Allowed
from atmoref.judge.check import CheckVerdict, DrawVerdict, EndToEnd, Worst, judge_texels
from atmoref.judge.diagnosis import SHADOW, Explanation
from atmoref.judge.dumps import Entry
from atmoref.report import check_json, check_table, junit_of_check, junit_of_compare, report_of_check, report_of_compare

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


def pictures(height: int = 48, width: int = 64) -> tuple[Any, Any]:
    rng = np.random.default_rng(3)
    reference = rng.integers(0, 200, (height, width, 3), np.uint8)
    test = reference.copy()
    test[10:12, 20:25] += 9
    return from_rgb(test, {"format": "unorm8"}), from_rgb(reference, {"format": "unorm8"})


class Page(HTMLParser):
    """Collects what a page refers to, and its tags."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for key, value in attrs if key in ("src", "href")]


def parsed(text: str) -> Page:
    page = Page()
    page.feed(text)
    return page


def compare_page(**size: int) -> str:
    test, reference = pictures(**size)
    verdict = compare(test, reference, codes=1)
    return report_of_compare(test, reference, verdict, Limits(codes=1), None, "a <b> & c")


def test_a_page_needs_no_other_file() -> None:
    page = parsed(compare_page())
    assert page.tags.count("img") == 4  # reference, test, difference, violation
    assert page.tags.count("rect") >= 2
    assert all(link.startswith("data:") for link in page.links)
    assert not re.search(r"https?://", compare_page())


def test_names_cannot_break_out_of_the_page() -> None:
    text = compare_page()
    assert "a <b>" not in text
    assert "a &lt;b&gt; &amp; c" in text


def test_a_page_of_a_large_picture_stays_below_5_mb() -> None:
    assert len(compare_page(height=1080, width=1920)) < 5_000_000


def test_violations_are_marked_where_they_are() -> None:
    from atmoref.compare.frame import pair
    from atmoref.compare.limits import outside

    left, right, _ = pair(*pictures())
    marked = outside(Limits(codes=1), left, right, np.ones((48, 64), np.bool_))
    expected = np.zeros((48, 64), np.bool_)
    expected[10:12, 20:25] = True
    np.testing.assert_array_equal(marked, expected)


def check_verdict() -> CheckVerdict:
    worst = Worst(3, 4, 0, 9.0, 5.0, (4.0, 6.0))
    told = (Explanation(SHADOW, "no shadow bias", 0.01),)
    draws = (
        DrawVerdict("opaque", "frame", "unorm8", 1, "1 code", 100, 0, 0, True, None),
        DrawVerdict("light_0/slab_000/main", "frame", "unorm8", 1, "1 code", 100, 7, 9, False, worst, told),
    )
    grey = np.arange(100.0).reshape(10, 10, 1)
    return CheckVerdict("d", "quick", "beams", "ideal", draws, EndToEnd("light_0/slab_000/main", 100, 9, worst), (), {
        draws[1].name: (grey + 2.0, grey, grey - 1.0, grey + 1.0)})  # fmt: skip


def test_the_report_of_a_check_names_stage_pixel_and_cause() -> None:
    for text in (report_of_check(check_verdict()), check_table(check_verdict()), junit_of_check(check_verdict())):
        assert "light_0/slab_000/main" in text
        assert "x 3, y 4" in text
        assert "shadow bias/compare" in text
    plain = json.loads(json.dumps(check_json(check_verdict())))
    assert plain["verdict"] == "failed"
    assert plain["first"] == "light_0/slab_000/main -> frame"
    assert plain["diagnosis"]["kind"] == SHADOW


def test_junit_counts_its_cases() -> None:
    suite = ElementTree.fromstring(junit_of_check(check_verdict())).find("testsuite")
    assert suite is not None
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    test, reference = pictures()
    suite = ElementTree.fromstring(junit_of_compare(compare(test, reference, codes=1), "bad \x00 name")).find(
        "testsuite"
    )
    assert suite is not None
    assert suite.get("failures") == "1"


@pytest.mark.parametrize(("few", "passed"), [(1.0, True), (0.01, False)])
def test_few_pixels_may_use_a_tolerance(few: float, passed: bool) -> None:
    entry = Entry("d", "frame", FORMATS["unorm8"], Path("x"))
    mirror = np.full((10, 10, 1), 5, np.uint8)
    build = mirror.copy()
    build[:2] += 1
    allowed = Allowed(mirror - 1.0, mirror + 1.0, few)
    found = judge_texels(entry, build, mirror, allowed, np.ones((10, 10), np.bool_), 1)
    assert (found.passed, found.outside, found.off) == (passed, 0, 20)


DRIVER = """
<script>
window.addEventListener("load", () => {
  const section = document.querySelector("section"), images = section.querySelectorAll("img");
  const flip = section.querySelector(".flip"), zoom = section.querySelector(".zoom");
  const width = section.querySelector(".stack").offsetWidth;
  flip.value = 1; flip.dispatchEvent(new Event("input"));
  zoom.value = 4; zoom.dispatchEvent(new Event("input"));
  const wider = section.querySelector(".stack").offsetWidth;
  document.title = [images[0].style.opacity, images[1].style.opacity, wider / width].join(" ");
});
</script>
"""


@pytest.mark.skipif(CHROMIUM is None, reason="optional: no Chromium")
def test_the_page_works_in_a_browser(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(compare_page().replace("</body>", DRIVER + "</body>"), encoding="utf-8")
    line = [
        str(CHROMIUM),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        "--dump-dom",
        page.as_uri(),
    ]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in done.stderr
    found = re.search("<title>(.*?)</title>", done.stdout)
    assert found is not None
    assert found[1] == "0 1 4"
