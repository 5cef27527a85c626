"""ARCHITECTURE.md names every module there is, and none that is gone."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("geometry", "zones", "toolpath", "output", "verify", "schemas", "service", "examples")


def named() -> set[str]:
    """Modules of the table, as package/path; `folder/` before a bracket stands before the names in it."""
    text = (ROOT / "ARCHITECTURE.md").read_text()
    table = text[text.index("Every module"):text.index("## Invariants")]
    out: set[str] = set()
    package = ""
    for line in table.splitlines():
        head = re.match(r"\| \*\*(\w+)\*\*", line)
        package = head.group(1) if head else package
        if not package or head or not line.startswith("|"):
            continue
        folder = before = ""
        for token in re.findall(r"`[^`]+`|[()]", line.split("|")[1]):
            if token == "(":
                folder = before
            elif token == ")":
                folder = ""
            else:
                before = token.strip("`")
                out |= {f"{package}/{folder}{before}"} if before.endswith(".py") else set()
    return out


def test_the_table_of_modules_is_that_of_the_tree() -> None:
    there = {p.relative_to(ROOT).as_posix() for name in PACKAGES for p in (ROOT / name).rglob("*.py")
             if p.name != "__init__.py"}
    assert len(there) > 100
    assert named() == there
