"""Verdicts as JUnit XML, which every CI server shows."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from atmoref.compare import Verdict

if TYPE_CHECKING:
    from atmoref.judge.check import CheckVerdict  # its room compiles kernels

_UNPRINTABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_of_compare(verdict: Verdict, name: str) -> str:
    """Return one test case for each limit; without a limit, one that passed."""
    cases = [(limit.name, "" if limit.passed else f"{limit.outside} elements outside, furthest at {limit.worst}")
             for limit in verdict.limits]  # fmt: skip
    return _suite(f"atmoref compare {name}", cases or [("measured", "")], verdict.table())


def junit_of_check(verdict: CheckVerdict) -> str:
    """Return one test case for each buffer that was judged."""
    cases = []
    for draw in verdict.draws:
        told = "" if draw.passed else f"{draw.outside} of {draw.pixels} pixels outside, {draw.off} differ; {draw.worst}"
        cases.append((draw.name, "\n".join([told, *map(str, draw.explanations)]) if told else ""))
    return _suite(f"atmoref check {verdict.scene}", cases, "")


def _suite(name: str, cases: list[tuple[str, str]], out: str) -> str:
    failures = sum(bool(problem) for _, problem in cases)
    suite = ElementTree.Element(
        "testsuite", name=_clean(name), tests=str(len(cases)), failures=str(failures), errors="0"
    )
    for case, problem in cases:
        item = ElementTree.SubElement(suite, "testcase", classname=_clean(name), name=_clean(case))
        if problem:
            message = _clean(problem)
            ElementTree.SubElement(item, "failure", message=message.partition("\n")[0]).text = message
    if out:
        ElementTree.SubElement(suite, "system-out").text = _clean(out)
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _clean(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return _UNPRINTABLE.sub("?", text)
