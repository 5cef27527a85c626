"""The script that counts words by sentence finds sentences where a reader finds them."""

from __future__ import annotations

import importlib.util
import sys

import pytest

from tests.source_tree import ROOT

_SPEC = importlib.util.spec_from_file_location("plain_words", ROOT / ".ci" / "plain_words.py")
assert _SPEC is not None and _SPEC.loader is not None
plain_words = importlib.util.module_from_spec(_SPEC)
sys.modules["plain_words"] = plain_words
_SPEC.loader.exec_module(plain_words)


def found(page: str) -> list[str]:
    return [s.text for s in plain_words.sentences(page)]


def counted(page: str) -> list[int]:
    return [s.words for s in plain_words.sentences(page)]


@pytest.mark.parametrize(("text", "expected"), [
    ("One idea. Another one! A third? Yes.", ["One idea.", "Another one!", "A third?", "Yes."]),
    ("It cuts 0.5 mm at 1.25 rad. Then it stops.", ["It cuts 0.5 mm at 1.25 rad.", "Then it stops."]),
    ("Tools, e.g. balls, lean. Others, i.e. flats, do not.",
     ["Tools, e.g. balls, lean.", "Others, i.e. flats, do not."]),
    ("See Fig. 3 and eq. 3.8 there. Next.", ["See Fig. 3 and eq. 3.8 there.", "Next."]),
    ("Bars, webs, etc. are connections. Bars, webs, etc. The rest is air.",
     ["Bars, webs, etc. are connections.", "Bars, webs, etc.", "The rest is air."]),
    ("As de Berg et al. show it is fast.", ["As de Berg et al. show it is fast."]),
    ("A lower case name begins. zonemill goes on.", ["A lower case name begins.", "zonemill goes on."]),
    ("It ends along Z. The next begins.", ["It ends along Z.", "The next begins."]),
    ('He wrote "stop." Then he left. (It was late.) All left.',
     ['He wrote "stop."', "Then he left.", "(It was late.)", "All left."]),
    ("It goes on ... and on. Or so... No.", ["It goes on ... and on.", "Or so...", "No."]),
    ("A colon: no end; nor is this.", ["A colon: no end; nor is this."]),
    ("No stop at the end", ["No stop at the end"]),
    ("The subject has 72 characters at most. 40 words are the limit.",
     ["The subject has 72 characters at most.", "40 words are the limit."]),
])
def test_sentences_end_where_a_reader_ends_them(text, expected):
    assert found(text) == expected


def test_lines_of_a_paragraph_are_one_text_and_an_empty_line_ends_it():
    assert found("A sentence over\ntwo lines. And\nanother.\n\nThe next paragraph") == [
        "A sentence over two lines.", "And another.", "The next paragraph"]


@pytest.mark.parametrize("page", [
    "Before.\n```\nCode that. Is not read.\n```\nAfter.",
    "Before.\n\n~~~python\nCode. Here.\n```\n~~~\nAfter.",
    "Before.\n````\n```\nInner.\n```\n````\nAfter.",
    "Before.\n\n    indented code. Here.\n\nAfter.",
    "Before.\n<!-- a remark. over\ntwo lines. -->\nAfter.",
    "Before.\n\n[label]: https://example.org/a.b.c\n\nAfter.",
    "Before.\n\n---\n\nAfter.",
    "> Before.\n> ```\n> code. here.\n> ```\n\nAfter.",
])
def test_code_comments_and_rules_are_not_read(page):
    assert found(page) == ["Before.", "After."]


def test_a_fence_inside_a_list_item_is_not_read_and_the_item_goes_on():
    assert found("1. Run it:\n   ```\n   zonemill plan. Now.\n   ```\n   It prints a report.\n2. Read it.") == [
        "Run it:", "It prints a report.", "Read it."]


def test_each_list_item_stands_for_itself_with_its_further_lines():
    page = "Verbs:\n- make setup\n- make check goes\n  over two lines\n  - nested\n* star\n1. one\n2) two\n- [x] done\n"
    assert found(page) == [
        "Verbs:", "make setup", "make check goes over two lines", "nested", "star", "one", "two", "done"]


def test_a_number_or_dash_inside_a_line_begins_no_item():
    assert found("It takes\n1.5 mm and - as said - more.") == ["It takes 1.5 mm and - as said - more."]
    assert counted("It takes\n1.5 mm and - as said - more.") == [8]


def test_each_table_cell_stands_for_itself():
    page = "| word | meaning |\n|:---|---:|\n| `a|b` | One. Two |\n| x \\| y | [a link](p) |\n"
    assert found(page) == ["word", "meaning", "`…`", "One.", "Two", "x | y", "a link"]
    assert counted("| a b | c |\n|---|---|\n| d e f | |\n") == [2, 1, 3]


def test_headings_stand_for_themselves():
    assert found("# One title #\nText under it.\n## 2. Another\nMore") == [
        "One title", "Text under it.", "2. Another", "More"]
    assert found("A title\n=======\nText") == ["A title", "Text"]


def test_quotes_are_read_without_their_marks():
    assert found("> A quote over\n> two lines.\n> > Nested.") == ["A quote over two lines.", "Nested."]


@pytest.mark.parametrize(("text", "words"), [
    ("[two words](a/very/long/path.md#with.dots)", 2),
    ("[two words][ref] and [alone]", 4),
    ("[a (b) c](x(y).md) end", 4),
    ("see <https://example.org/a.b> there", 3),
    ("`service/cli.py: plan` reads the setup", 4),
    ("``a ` b`` is one", 3),
    ("<b>bold</b> and **strong** and *soft* and _under_", 7),
    ("snake_case_name * 3 = 9", 3),
    ("a/b and c-d, 3 mm → 4 — 5", 7),
    ("h < R and k > 0", 5),
])
def test_words_are_counted_as_they_are_read(text, words):
    assert counted(text) == [words]


def test_a_stop_inside_code_or_a_link_ends_nothing():
    assert found("Run `a. B c` or [the page](x. Y) now. Done.") == ["Run `…` or the page now.", "Done."]


def test_the_caption_of_a_picture_is_a_text_of_its_own():
    assert found("![What it shows. In two](a.png)\nText beside it.") == ["Text beside it.", "What it shows.", "In two"]
    assert found("[![Badge](b.svg)](c) Text") == ["Text", "Badge"]


def test_the_line_of_a_sentence_is_that_of_its_block():
    assert [(s.line, s.text) for s in plain_words.sentences("# T\n\nOne.\nTwo.\n\n- three\n\n| a | b |\n")] == [
        (1, "T"), (3, "One."), (3, "Two."), (6, "three"), (8, "a"), (8, "b")]


def test_the_limit_is_kept_to_the_word(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("w " * 39 + "w.\n")
    assert plain_words.main([str(page)]) == 0
    page.write_text("w " * 40 + "w.\n")
    assert plain_words.main([str(page)]) == 1
    assert "page.md:1: 41 words" in capsys.readouterr().out
    assert plain_words.main(["--table", str(page)]) == 1
    assert "| 1 | 41 | 41 | 41 | 1 | 1 |" in capsys.readouterr().out
