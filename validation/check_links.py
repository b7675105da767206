"""Check that relative links in Markdown files lead somewhere.

Run as ``python validation/check_links.py README.md docs``: prints each broken link with its file and line.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)(?:\s+\"[^\"]*\")?\)")
ELSEWHERE = re.compile(r"^(?:[a-z][a-z0-9+.-]*:|#)")


def broken_links(page: Path) -> list[str]:
    """Return one line of text per relative link of `page` whose target does not exist; code blocks are not read."""
    found: list[str] = []
    fenced = False
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        elif not fenced:
            for target in LINK.findall(line):
                if not ELSEWHERE.match(target) and not (page.parent / target.partition("#")[0]).exists():
                    found.append(f"{page}:{number}: no such file: {target}")
    return found


def main(arguments: list[str]) -> int:
    """Check the named files and directories; return the exit code."""
    roots = [Path(argument) for argument in arguments]
    pages = [page for root in roots for page in (sorted(root.rglob("*.md")) if root.is_dir() else [root])]
    broken = [line for page in pages for line in broken_links(page)]
    print("\n".join([*broken, f"{len(pages)} pages, {len(broken)} broken links"]))
    return 1 if broken or not pages else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
