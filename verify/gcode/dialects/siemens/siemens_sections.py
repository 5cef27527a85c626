"""The programs in a Siemens file, and what a line of one is made of: block number, label, statement, comment.

A file holds one program, or several: each begins with ``%_N_NAME_MPF``, ``%_N_NAME_SPF`` or ``PROC NAME``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from verify.gcode.block_words import BlockError

_NUM = r"[+-]?(?:[0-9]{1,8}(?:\.[0-9]*)?|\.[0-9]+)"
PLAIN = re.compile(rf"(?:N[0-9]+ ?)?(?:G[01] ?)?(?:[XYZABC]{_NUM} ?)*(?:F{_NUM} ?)?\r?")
"""A straight move without anything else."""
NUMBERED = re.compile(r"(?:N|:)[0-9]+\s*")
_NUMBERED_LINE = re.compile(r"\s*N([0-9]{1,9})(?![0-9])", re.IGNORECASE)
LABEL = re.compile(r"(?:(?:N|:)[0-9]+\s*)?([A-Z_]{2}[A-Z_0-9]*):(?!=)\s*")
_SECTION = re.compile(r"%_N_([A-Z_0-9]+?)(?:_(?:MPF|SPF|CYC))?\s*(?:;.*)?", re.IGNORECASE)
_PROC = re.compile(r"PROC\s+([A-Z_][A-Z_0-9]*)\s*(?:\((.*?)\))?\s*([A-Z ]*)")
_PARAMETER = re.compile(r"(VAR\s+)?(REAL|INT|BOOL|CHAR|STRING\s*\[\s*[0-9]+\s*\])\s+([A-Z_][A-Z_0-9]*)\s*(?:=\s*(.+))?")


def statement(raw: str) -> str:
    """A line without its comment, upper case outside of quotes, blanks stripped."""
    if ";" not in raw and '"' not in raw:
        return raw.upper().strip()
    out, quoted = [], False
    for part in re.split(r'(")', raw):
        if part == '"':
            quoted = not quoted
            out.append(part)
            continue
        before, comment, _ = (part, "", "") if quoted else part.partition(";")
        out.append(before if quoted else before.upper())
        if comment:
            break
    return "".join(out).strip()


@dataclass(frozen=True)
class Section:
    """One program of the file: lines ``first`` to ``end`` (not included), its parameters and attributes.

    parameters : type, name, default and whether the caller's variable changes too
    """

    first: int
    end: int
    parameters: tuple[tuple[str, str, str, bool], ...] = ()
    saves: bool = False


@dataclass
class _Head:
    """The head of a program: its line, its names, and what its PROC says."""

    first: int
    names: list[str]
    proc: bool = False
    parameters: tuple[tuple[str, str, str, bool], ...] = ()
    saves: bool = False


def label_lines(lines: Sequence[str]) -> dict[str, list[int]]:
    """Numbers of lines by their label, and by their block number without leading zeros (N10)."""
    out: dict[str, list[int]] = {}
    for k, raw in enumerate(lines):
        if m := _NUMBERED_LINE.match(raw):
            out.setdefault(f"N{int(m[1])}", []).append(k)
        if ":" in raw and (m := LABEL.match(statement(raw))):
            out.setdefault(m[1], []).append(k)
    return out


def body_of(text: str) -> tuple[str, str]:
    """A statement without its skip sign, block number and label: (the sign, the rest)."""
    head = ""
    if text.startswith("/"):
        m = re.match(r"/[0-9]?\s*", text)
        head = m[0] if m else ""
    rest = text[len(head):]
    if m := LABEL.match(rest):
        return head, rest[m.end():]
    m = NUMBERED.match(rest)
    return head, rest[m.end():] if m else rest


def find_sections(lines: Sequence[str]) -> dict[str, Section]:
    """Programs of a file by name; '' is the first, which runs.

    Raises
    ------
    BlockError
        Two programs have one name, or the head of one cannot be read.
    """
    heads: list[_Head] = []
    for k, raw in enumerate(lines):
        m = _SECTION.fullmatch(raw.strip()) if raw[:1] == "%" else None
        if m:
            heads.append(_Head(k, [m[1].upper()]))
        elif "PROC" in raw.upper() and (p := _PROC.match(body_of(statement(raw))[1])):
            if not heads or heads[-1].proc or any(statement(x) for x in lines[heads[-1].first + 1:k]):
                heads.append(_Head(k, []))
            heads[-1].names.append(p[1])
            heads[-1].proc, heads[-1].parameters = True, _parameters(p[2] or "")
            heads[-1].saves = "SAVE" in (p[3] or "").split()
    if not heads or any(statement(x) for x in lines[:heads[0].first]):
        heads.insert(0, _Head(0, []))
    out: dict[str, Section] = {}
    for n, head in enumerate(heads):
        end = heads[n + 1].first if n + 1 < len(heads) else len(lines)
        section = Section(head.first + (n > 0 or bool(head.names)), end, head.parameters, head.saves)
        if n == 0:
            out[""] = section
        for name in set(head.names):
            if name in out:
                raise BlockError(f"two programs of the file have the name {name}")
            out[name] = section
    return out


def _parameters(text: str) -> tuple[tuple[str, str, str, bool], ...]:
    out = []
    for part in filter(None, (p.strip() for p in text.split(","))):
        m = _PARAMETER.fullmatch(part)
        if m is None:
            raise BlockError(f"cannot read the parameter '{part[:40]}' of PROC")
        out.append((m[2].split("[")[0].strip(), m[3], m[4] or "", bool(m[1])))
    return tuple(out)


__all__ = ["LABEL", "NUMBERED", "PLAIN", "Section", "body_of", "find_sections", "label_lines", "statement"]
