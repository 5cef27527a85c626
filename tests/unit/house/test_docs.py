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


@pytest.mark.parametrize(("page", "some"), [("README.md", {"demo", "test"}), ("CONTRIBUTING.md", {"setup", "check"})])
def test_the_first_pages_name_only_verbs_the_makefile_has(page, some):
    verbs = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z-]+)", (ROOT / page).read_text(), flags=re.MULTILINE))
    assert some <= named <= verbs


def test_the_index_has_one_line_for_each_page():
    docs = ROOT / "docs"
    rows = [line for line in (docs / "README.md").read_text().splitlines() if line.startswith("| [")]
    linked = [target for line in rows for target in LINK.findall(line)]
    pages = {p.relative_to(docs).as_posix() for p in docs.rglob("*.md")} - {"README.md"} | {"bibliography.bib"}
    assert sorted(linked) == sorted(pages), "docs/README.md and the pages under docs/ differ"


def test_adrs_have_their_four_parts():
    records = sorted((ROOT / "docs" / "adr").glob("[0-9]*.md"))
    assert records
    for record in records:
        text = record.read_text(encoding="utf-8")
        for part in ("## Context", "## Decision", "## Rejected", "## How we would know it was wrong"):
            assert part in text, f"{record.name} has no {part!r}"
