"""Every key that a docstring cites is in docs/bibliography.bib; every entry there says what it is and is cited."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from tests.source_tree import ROOT, modules

TEXT = (ROOT / "docs" / "bibliography.bib").read_text(encoding="utf-8")
ENTRY = re.compile(r"^@(\w+)\{([^,\s]+),\n(.*?)^\}$", re.MULTILINE | re.DOTALL)
FIELD = re.compile(r"^  (\w+)\s*=\s*\{(.+?)\},?$", re.MULTILINE | re.DOTALL)
KEY = r"[A-Z][A-Za-z]+(?:19|20)\d{2}[a-z]?|(?:ISO|RFC|DIN)\d+(?:-\d+)*"
CITED = re.compile(rf"\[((?:{KEY})(?:[,;] ?(?:{KEY}))*)(?:, [^\]]*)?\]")
ENTRIES = {key: (kind, dict(FIELD.findall(body))) for kind, key, body in ENTRY.findall(TEXT)}


def cited(text: str) -> list[str]:
    """Keys in brackets: ``[Lee2003]``, ``[Lin1996; Lee2003]``, ``[DeBerg2008, chapter 6]``."""
    parts = [part for match in CITED.finditer(text) for part in re.split(r"[,;] ?", match.group()[1:-1])]
    return [part for part in parts if re.fullmatch(KEY, part)]


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of every docstring, and of strings that stand behind an assignment."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.lineno, node.value.value


def test_every_key_cited_in_a_docstring_is_in_the_bibliography():
    wrong = [f"{name}:{line} cites [{key}]" for name, tree in modules() for line, text in docstrings(tree)
             for key in cited(text) if key not in ENTRIES]
    assert not wrong, "\n".join(wrong)


def test_every_key_cited_in_the_documentation_is_in_the_bibliography():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    wrong = [f"{page.name} cites [{key}]" for page in pages for key in cited(page.read_text(encoding="utf-8"))
             if key not in ENTRIES]
    assert not wrong, "\n".join(wrong)


def test_every_entry_is_cited_by_the_product_or_its_documentation():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    texts += [text for _, tree in modules() for _, text in docstrings(tree)]
    named = {key for text in texts for key in cited(text)}
    assert not [key for key in ENTRIES if key not in named]


def test_entries_are_read_whole_and_stand_once():
    keys = re.findall(r"^@\w+\{([^,\s]+)", TEXT, re.MULTILINE)
    assert len(keys) == len(set(keys)) and keys == list(ENTRIES)
    assert len(keys) > 40 and TEXT.count("{") == TEXT.count("}")


@pytest.mark.parametrize("key", ENTRIES)
def test_an_entry_has_author_title_year_and_a_key_of_the_right_form(key):
    kind, fields = ENTRIES[key]
    assert re.fullmatch(KEY, key)
    assert {"author", "title", "year"} <= set(fields)
    assert key.startswith(("ISO", "RFC", "DIN")) or fields["year"] == re.sub(r"\D", "", key)[-4:]
    place = {"article": "journal", "book": "publisher", "inproceedings": "booktitle", "mastersthesis": "school",
             "techreport": "institution", "misc": "title"}
    assert place[kind] in fields


@pytest.mark.parametrize(("text", "keys"), [
    ("as in [Lee2003].", ["Lee2003"]),
    ("[Lin1996; Lee2003] and [Wang1993a]", ["Lin1996", "Lee2003", "Wang1993a"]),
    ("[DeBerg2008, chapter 6]", ["DeBerg2008"]),
    ("[Sarkar2015, equations 2.1 to 2.5; Thompson1985]", ["Sarkar2015", "Thompson1985"]),
    ("[ISO14649-10] [RFC9110, 14.1.2]", ["ISO14649-10", "RFC9110"]),
    ("x[0], a[T1], tools[].life_min, [1], [see Lee2003], [Lee 2003], F[2003]", []),
])
def test_keys_are_told_from_other_brackets(text, keys):
    assert cited(text) == keys
