"""Links and verbs in the documentation lead somewhere."""

from __future__ import annotations

import re

import pytest

from tests.source_tree import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_relative_links_exist(page):
    text = page.read_text(encoding="utf-8")
    dead = [t for t in LINK.findall(text) if "://" not in t and not (page.parent / t).exists()]
    assert not dead, f"{page.name} links to {dead}"


def test_the_readme_names_only_verbs_the_makefile_has():
    verbs = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z-]+)", (ROOT / "README.md").read_text(), flags=re.MULTILINE))
    assert {"demo", "test"} <= named <= verbs


def test_adrs_have_their_four_parts():
    records = sorted((ROOT / "docs" / "adr").glob("[0-9]*.md"))
    assert records
    for record in records:
        text = record.read_text(encoding="utf-8")
        for part in ("## Context", "## Decision", "## Rejected", "## How we would know it was wrong"):
            assert part in text, f"{record.name} has no {part!r}"
