"""Check that relative links, anchors and images in Markdown files lead somewhere.

Run as ``python validation/check_links.py README.md docs``: prints each broken link with its file and line; exit code 1
if there is one. Addresses elsewhere (``https:``, ``mailto:``) are not asked for.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

LINK = re.compile(r"(!?)\[[^\]]*\]\(([^)\s]+)(?:\s+\"[^\"]*\")?\)")
ELSEWHERE = re.compile(r"^[a-z][a-z0-9+.-]*:")
HEADING = re.compile(r"^#{1,6}\s+(.*?)\s*#*$")
CODE = re.compile(r"`[^`]*`")
PICTURES = (".png", ".svg", ".jpg", ".jpeg", ".gif")


def prose(page: Path) -> Iterator[tuple[int, str]]:
    """Yield the numbered lines of a page that are not inside a fenced block of code."""
    fence = ""
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        mark = line.lstrip()[:3]
        if fence:
            fence = "" if mark == fence else fence
        elif mark in ("```", "~~~"):
            fence = mark
        else:
            yield number, line


@cache
def anchors(page: Path) -> frozenset[str]:
    """Return the anchors of a page's headings, made as GitHub makes them; a repeated heading gets -1, -2 ..."""
    seen: dict[str, int] = {}
    found = set()
    for _, line in prose(page):
        if match := HEADING.match(line):
            text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", match[1]).replace("`", "")
            slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
            found.add(f"{slug}-{seen[slug]}" if slug in seen else slug)
            seen[slug] = seen.get(slug, 0) + 1
    return frozenset(found)


def problem(page: Path, is_image: bool, target: str) -> str | None:
    """Return what is wrong with one link of a page, or None."""
    if ELSEWHERE.match(target):
        return None
    name, _, anchor = target.partition("#")
    file = page.parent / name if name else page
    if not file.exists():
        return f"no such file: {target}"
    if is_image and (file.suffix.lower() not in PICTURES or not file.stat().st_size):
        return f"no picture: {target}"
    if anchor and (file.suffix != ".md" or anchor not in anchors(file.resolve())):
        return f"no such anchor: {target}"
    return None


def broken_links(page: Path) -> list[str]:
    """Return one line of text, with file and line number, per broken link of a page."""
    return [
        f"{page}:{number}: {wrong}"
        for number, line in prose(page)
        for mark, target in LINK.findall(CODE.sub(lambda code: "x" * len(code[0]), line))
        if (wrong := problem(page, bool(mark), target))
    ]


def main(arguments: list[str]) -> int:
    """Check the named files and directories; return the exit code."""
    roots = [Path(argument) for argument in arguments]
    missing = [f"{root}:1: no such file" for root in roots if not root.exists()]
    pages = [page for root in roots for page in (sorted(root.rglob("*.md")) if root.is_dir() else [root])]
    broken = missing + [line for page in pages if page.exists() for line in broken_links(page)]
    print("\n".join([*broken, f"{len(pages)} pages, {len(broken)} broken links"]))
    return 1 if broken or not pages else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
