"""Commands of the documentation, read from its pages: fences, transcripts and code spans."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.source_tree import ROOT

LEFT_OUT = {"CHANGELOG.md": "its entries are about earlier releases"}
PLACES = ("*.md", ".github/**/*.md", "docs/**/*.md", "examples/**/README*", "tests/**/README*")
PAGES = sorted(path for pattern in PLACES for path in ROOT.glob(pattern)
               if path.name not in LEFT_OUT and not {"node_modules", "target"} & set(path.parts))

FENCE = re.compile(r"^ {0,3}```[^\S\n]*([^\s`]*)[^\S\n]*([^\n`]*)\n(.*?)^ {0,3}```[^\S\n]*$", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"(?<!`)(`+)(?!`)((?:(?!\n\s*\n).)+?)(?<!`)\1(?!`)", re.DOTALL)
INDENTED = re.compile(r"(?<=\n\n)(?: {4}|\t)(\S[^\n]*)")
ASSIGNED = re.compile(r"([A-Za-z_]\w*)=(.*)", re.DOTALL)
NESTED = re.compile(r"\$\(([^()]*)\)")
BETWEEN = {";", "&&", "||", "|", "&"}


@dataclass(frozen=True)
class Fence:
    """A fenced block: page, line (from 1), language, name of the file that its text is, text."""

    page: Path
    line: int
    language: str
    name: str
    text: str


@dataclass(frozen=True)
class Command:
    """One command line as a page has it, with the output that a transcript shows.

    inline : it stands in running text
    unit   : it stands in a unit of systemd
    """

    page: Path
    line: int
    text: str
    output: str = ""
    inline: bool = False
    unit: bool = False

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}: {self.text}"


@dataclass(frozen=True)
class Simple:
    """A part of a command line that runs one program: its variables and its words."""

    variables: dict[str, str]
    words: list[str]

    @property
    def program(self) -> str:
        """Name of the program; of one in a virtual environment without the folder."""
        first = self.words[0] if self.words else ""
        return re.sub(r"^(?:\.\./)*\.venv/bin/", "", first)


@cache
def fences(page: Path) -> list[Fence]:
    """Every fenced block of a page."""
    text = page.read_text(encoding="utf-8")
    return [Fence(page, text.count("\n", 0, m.start()) + 1, m[1], m[2].strip(), m[3]) for m in FENCE.finditer(text)]


def lines_of(fence: Fence) -> list[Command]:
    """Commands of a fence: every line of ``sh``, the lines after ``$`` of ``console``, ``ExecStart`` of a unit."""
    out: list[Command] = []
    lines = fence.text.splitlines()
    k = 0
    while k < len(lines):
        line, at = lines[k], fence.line + 1 + k
        k += 1
        if fence.language == "ini":
            if line.startswith("ExecStart="):
                out.append(Command(fence.page, at, line.partition("=")[2].removeprefix("/opt/zonemill/"), unit=True))
            continue
        if fence.language == "console":
            if not line.startswith("$ "):
                if out:
                    out[-1] = Command(fence.page, out[-1].line, out[-1].text, f"{out[-1].output}{line}\n")
                continue
            line = line[2:]
        while line.endswith("\\") and k < len(lines):
            line = f"{line[:-1].rstrip()} {lines[k].strip()}"
            k += 1
        if line.strip() and not line.lstrip().startswith("#"):
            out.append(Command(fence.page, at, line.strip()))
    return out


def commands(fence: Fence) -> list[Command]:
    """Commands of a fence; none where its language is not one of commands."""
    return lines_of(fence) if fence.language in ("sh", "console", "ini") else []


@cache
def spans(page: Path) -> list[Command]:
    """Every code span outside fences, as a command that may be none."""
    text = FENCE.sub(lambda m: "\n" * m[0].count("\n"), page.read_text(encoding="utf-8"))
    return [Command(page, text.count("\n", 0, m.start()) + 1, re.sub(r"\s+", " ", m[2]).replace(r"\|", "|").strip(),
                    inline=True) for m in SPAN.finditer(text)]


@cache
def indented(page: Path) -> list[Command]:
    """The first line of every block that four spaces make code."""
    text = FENCE.sub(lambda m: "\n" * m[0].count("\n"), page.read_text(encoding="utf-8"))
    return [Command(page, text.count("\n", 0, m.start()) + 1, m[1]) for m in INDENTED.finditer(text)]


def simple(text: str) -> Iterator[Simple]:
    """The programs that a command line runs, those in ``$( )`` first; redirections are left out."""
    for inner in NESTED.findall(text):
        yield from simple(inner)
    lexer = shlex.shlex(NESTED.sub("OUTPUT", text), posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    words: list[str] = []
    skip = False
    for token in [*lexer, ";"]:
        if token in BETWEEN:
            variables = {}
            while words and (match := ASSIGNED.fullmatch(words[0])):
                variables[match[1]] = match[2]
                words.pop(0)
            if words or variables:
                yield Simple(variables, words)
            words = []
        elif skip or re.fullmatch(r"[<>]+", token):
            skip = not skip
        else:
            words.append(token)
