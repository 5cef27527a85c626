"""ARCHITECTURE.md has one row for each folder there is, and folders stay small enough to see through."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from tests.source_tree import PACKAGES, ROOT

LARGEST = 16
"""Modules a folder holds at most, ``__init__.py`` not counted."""
OF_ONE_KIND = {"examples/family"}
"""Folders whose modules are all of one kind may hold more."""


def folders() -> dict[str, list[Path]]:
    """Every folder of the product that holds modules, with its modules."""
    found: dict[str, list[Path]] = {}
    for path in (p for name in PACKAGES for p in (ROOT / name).rglob("*.py")):
        if path.name != "__init__.py":
            found.setdefault(path.parent.relative_to(ROOT).as_posix(), []).append(path)
    return found


def test_the_table_has_one_row_for_each_folder() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    table = text[text.index("Each folder"):text.index("## Invariants")]
    rows = [m[1].rstrip("/") for m in re.finditer(r"^\| `([\w/]+)` \|", table, re.MULTILINE)]
    there = set(folders())
    assert len(there) > 40
    assert sorted(rows) == sorted(there | {"web", "tests", "benchmarks"})


def test_no_folder_is_crowded() -> None:
    sizes = {name: len(files) for name, files in folders().items() if name not in OF_ONE_KIND}
    crowded = {name: size for name, size in sizes.items() if size > LARGEST}
    assert not crowded, "a folder this full hides a second room"


def test_every_room_says_what_lives_there_and_what_must_not() -> None:
    silent = []
    for name in folders():
        path = ROOT / name / "__init__.py"
        text = ast.get_docstring(ast.parse(path.read_text())) if path.is_file() else None
        if not name.startswith("examples") and "migrations" not in name and not (text and len(text) > 30):
            silent.append(name)
    assert not silent
