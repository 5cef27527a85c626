"""Counts the words of every sentence in the documentation; none may have more than 40.

``python .ci/plain_words.py`` lists the sentences that are too long and exits with 1 where there is one; ``--table``
prints one row for each page; page names restrict it to those.

What counts as a sentence: it ends at a full stop, a question mark or an exclamation mark before a space. Paragraphs,
headings, table cells, list items and captions of pictures end one as well; semicolons and colons do not. A link counts
by its text, a code span as one word, code blocks and comments not at all.
"""

from __future__ import annotations

import argparse
import re
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIMIT = 40
RULE = 25
PAGES = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**/*.md")

FENCE = re.compile(r"^\s*(?:>\s*)*(?:[-*+]\s+|\d+[.)]\s+)?(`{3,}|~{3,})")
ITEM = re.compile(r"^\s*(?:[-*+]|\d{1,3}[.)])\s+(?:\[[ xX]\]\s+)?")
HEADING = re.compile(r"^\s{0,3}#{1,6}\s+|\s+#+\s*$")
UNDERLINE = re.compile(r"^\s*(?:=+|-{3,}|\*{3,}|_{3,})\s*$")
RULER = re.compile(r"^[\s|:-]+$")
REFERENCE = re.compile(r"^\s{0,3}\[[^\]]+\]:\s+\S+")
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
CODE = re.compile(r"(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.DOTALL)
IMAGE = re.compile(r"!\[((?:[^\[\]]|\[[^\]]*\])*)\](?:\([^()]*(?:\([^()]*\)[^()]*)*\)|\[[^\]]*\])")
LINK = re.compile(r"\[((?:[^\[\]]|\[[^\]]*\])*)\](?:\([^()]*(?:\([^()]*\)[^()]*)*\)|\[[^\]]*\])")
TAG = re.compile(r"<(?:(?P<url>https?://[^>\s]+)|/?[A-Za-z][^<>]*)>")
STOP = re.compile(r"(?<=[.!?])[\"'”’)\]]*\s+")
NO_END = re.compile(r"(?:^|[\s(\"'“])(?:e\.g|i\.e|cf|vs|approx|resp|incl|[Ff]igs?|[Ee]qs?|[Ss]ec|ch|pp?|Dr|Mr|Ms)\.$")
MAYBE_END = re.compile(r"(?:\.\.\.|…|\betc\.|\bal\.)[\"'”’)\]]*$")
SPAN = "\N{OBJECT REPLACEMENT CHARACTER}"


@dataclass(frozen=True)
class Sentence:
    """A sentence: the line its block begins in (from 1), its text, its words (count)."""

    line: int
    text: str
    words: int


def cells(row: str) -> list[str]:
    """Cells of a table row; a bar in a code span or behind a backslash separates nothing."""
    masked = CODE.sub(lambda m: "x" * len(m[0]), row.replace(r"\|", "xx"))
    bars = [-1, *(i for i, c in enumerate(masked) if c == "|"), len(row)]
    return [row[a + 1:b].replace(r"\|", "|").strip() for a, b in zip(bars, bars[1:], strict=False)]


def blocks(page: str) -> Iterator[tuple[int, str]]:
    """Headings, paragraphs, list items and table cells of a Markdown page with the line each begins in, from 1."""
    page = COMMENT.sub(lambda m: "\n" * m[0].count("\n"), page)
    start, held, fence, listed = 0, [], "", False

    def flush() -> Iterator[tuple[int, str]]:
        if held:
            yield start, " ".join(held)
        held.clear()

    for number, raw in enumerate(page.splitlines(), 1):
        opened = FENCE.match(raw)
        if fence:
            if opened and raw.strip().strip(">").strip() == fence[0] * max(len(fence), len(opened[1])):
                fence = ""
            continue
        line = re.sub(r"^\s{0,3}(?:>\s?)+", "", raw)
        if opened and "`" not in raw[opened.end():]:
            fence = opened[1]
            yield from flush()
        elif not line.strip():
            yield from flush()
        elif REFERENCE.match(line):
            yield from flush()
        elif HEADING.match(line):
            yield from flush()
            listed = False
            yield number, HEADING.sub("", line)
        elif UNDERLINE.match(line):
            yield from flush()
        elif line.lstrip().startswith("|"):
            yield from flush()
            if not RULER.match(line):
                yield from ((number, cell) for cell in cells(line) if cell)
        elif ITEM.match(line):
            yield from flush()
            listed, start = True, number
            held.append(ITEM.sub("", line))
        elif not held and line.startswith(("    ", "\t")) and not listed:
            continue
        else:
            if not held:
                start, listed = number, listed and line.startswith(" ")
            held.append(line.strip())
    yield from flush()


def plain(block: str) -> Iterator[str]:
    """Plain text of a block, code spans as one sign and links as their text, then the caption of each picture."""
    text = CODE.sub(SPAN, block)
    captions = [m[1] for m in IMAGE.finditer(text)]
    text = IMAGE.sub(" ", text)
    for piece in (text, *captions):
        piece = LINK.sub(r"\1", piece)
        piece = TAG.sub(lambda m: SPAN if m["url"] else " ", piece)
        piece = re.sub(r"(?<!\w)[*_]{1,3}(?=\S)|(?<=\S)[*_]{1,3}(?!\w)", "", piece).replace("\\", "")
        yield re.sub(r"\s+", " ", piece).strip()


def split(text: str) -> list[str]:
    """Sentences of plain text."""
    found, begin = [], 0
    for stop in STOP.finditer(text):
        said, after = text[begin:stop.end()].rstrip(), text[stop.end():]
        if NO_END.search(said) or (MAYBE_END.search(said) and after[:1].islower()) or re.fullmatch(r"\d+\.", said):
            continue
        found.append(said)
        begin = stop.end()
    return [s for s in (*found, text[begin:].strip()) if s]


def words(sentence: str) -> int:
    """Words of a sentence: what stands between spaces and has a letter or a digit; a code span is one."""
    return sum(1 for w in sentence.split() if SPAN in w or any(c.isalnum() for c in w))


def sentences(page: str) -> list[Sentence]:
    """All sentences of a Markdown page."""
    return [Sentence(line, s.replace(SPAN, "`…`"), words(s))
            for line, block in blocks(page) for text in plain(block) for s in split(text) if words(s)]


def pages(names: list[str]) -> list[Path]:
    """The pages that are measured, or those named."""
    if names:
        return [ROOT / name for name in names]
    return sorted({p for pattern in PAGES for p in ROOT.glob(pattern)})


def row(name: str, counts: list[int]) -> str:
    """One row of the table: sentences, median, 95th percentile, longest, over the rule, over the limit."""
    if not counts:
        return f"| {name} | 0 | | | | | |"
    high = sorted(counts)[min(len(counts) - 1, int(0.95 * len(counts)))]
    return (f"| {name} | {len(counts)} | {statistics.median(counts):g} | {high} | {max(counts)} | "
            f"{sum(c > RULE for c in counts)} | {sum(c > LIMIT for c in counts)} |")


def main(arguments: list[str]) -> int:
    """List or tabulate; 1 where a sentence is over the limit."""
    parser = argparse.ArgumentParser(description=f"Sentences of more than {LIMIT} words in the documentation.")
    parser.add_argument("names", nargs="*", metavar="PAGE", help="path from the project's root; default: all")
    parser.add_argument("--table", action="store_true", help="print one row for each page instead")
    given = parser.parse_args(arguments)
    measured = {p.relative_to(ROOT).as_posix() if p.is_relative_to(ROOT) else str(p):
                sentences(p.read_text(encoding="utf-8")) for p in pages(given.names)}
    long = [(name, s) for name, found in measured.items() for s in found if s.words > LIMIT]
    if given.table:
        print(f"| page | sentences | median | p95 | longest | over {RULE} | over {LIMIT} |\n" + "|---" * 7 + "|")
        print("\n".join(row(name, [s.words for s in found]) for name, found in measured.items()))
        print(row("all", [s.words for found in measured.values() for s in found]))
    else:
        print("\n".join(f"{name}:{s.line}: {s.words} words: {s.text}" for name, s in long)
              or f"no sentence of {len(measured)} pages has more than {LIMIT} words")
    return 1 if long else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
