"""The order in which the blocks of a Heidenhain program run: subprograms, repeats and jumps to labels."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from verify.gcode.dialects.base import BlockError, Jumps, Machine
from verify.gcode.dialects.heidenhain.heidenhain_q import QParameters

MAX_JUMPS = 200_000
MAX_CALLS = 19
"""Nested calls that the control runs."""
_MAYBE = re.compile(r"LBL|FN|PGM|SEL |SELECTED|CYCL DEF 12|CYCLE", re.IGNORECASE)
_COMMENT = re.compile(r"\s*(?:[0-9]+\s*)?(?:;|$)")
_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")  # the decimal sign of controls set to German
_NUMBER = re.compile(r"^\s*[0-9]+\s+(?=[A-Z*])|^\s*[0-9]+\s*$")
_CALL = re.compile(r'CALL LBL\s*("[^"]*"|[0-9]+)(?:\s+REP\s*([0-9]+)(?:/[0-9]+)?)?')
_LABEL = re.compile(r'LBL\s*("[^"]*"|[0-9]+)')
_OTHER = re.compile(r"CALL PGM|SEL PGM|CALL SELECTED|SEL CYCLE|CALL TABLE|CYCL DEF 12(?:\.|\b)|PGM CALL")


def block_text(raw: str) -> str:
    """A line without its number and comment, upper case outside of quotes, with single blanks."""
    text = raw.split(";", 1)[0] if '"' not in raw else _bare(raw)
    if "," in text and '"' not in text:
        text = _COMMA.sub(".", text)
    text = _NUMBER.sub("", text.upper() if '"' not in text else _upper(text))
    return " ".join(text.split()) if "  " in text or "\t" in text or "\r" in text else text.strip()


def _bare(raw: str) -> str:
    """A line up to the ; that is not within quotes."""
    quoted = False
    for at, c in enumerate(raw):
        if c == '"':
            quoted = not quoted
        elif c == ";" and not quoted:
            return raw[:at]
    return raw


def _upper(text: str) -> str:
    return '"'.join(part if k % 2 else part.upper() for k, part in enumerate(text.split('"')))


class HeidenhainFlow:
    """One run through the blocks of a program.

    lines   : of the text; q : its parameters; machine : the reader that runs the blocks
    """

    def __init__(self, lines: Sequence[str], q: QParameters, machine: Machine) -> None:
        self.lines, self.q, self.machine = lines, q, machine
        self.ahead = ""
        self._labels: dict[str, int] | None = None
        self._back: list[int] = []
        self._left: dict[int, int] = {}
        self._jumps = Jumps(machine.log)

    def run(self) -> Iterator[tuple[int, str]]:
        """Line numbers from 1 and blocks, in order; a block over several lines (~) comes whole.

        Raises
        ------
        BlockError
            A jump or call cannot be followed.
        ProgramError
            Code program_too_long: more than ``MAX_JUMPS`` jumps, or a loop without end.
        """
        at, lines = 0, self.lines
        while at < len(lines):
            raw, number = lines[at], at + 1
            at += 1
            if raw.rstrip().endswith("~"):
                raw, at = self._joined(at - 1)
                self.machine.log.passed.update(range(number, at + 1))
            self.ahead = self._following(at)
            if not _MAYBE.search(raw):
                yield number, raw
                continue
            self.machine.log.pass_line(number)
            text = block_text(raw)
            if text.startswith("END PGM"):
                yield number, raw
                return
            at = self._step(text, at)
            if not text.startswith(("CALL LBL", "LBL")) and not (text.startswith("FN") and " GOTO " in text):
                yield number, raw

    def _following(self, at: int) -> str:
        """The next line that is no comment."""
        while at < len(self.lines) and _COMMENT.match(self.lines[at]):
            at += 1
        return self.lines[at] if at < len(self.lines) else ""

    def _joined(self, at: int) -> tuple[str, int]:
        """A block over several lines, and the line after it."""
        parts = []
        while at < len(self.lines):
            raw = self.lines[at].rstrip()
            at += 1
            more = raw.endswith("~")
            parts.append(_bare(raw.removesuffix("~")).strip())
            if not more:
                break
        return " ".join(parts), at

    def _step(self, text: str, at: int) -> int:
        """The line that follows a block; ``at`` is the next one of the text."""
        if m := _CALL.fullmatch(text):
            return self._call(m[1], m[2], at)
        if m := _LABEL.fullmatch(text):
            return self._back.pop() if m[1] == "0" and self._back else at
        if text.startswith("CALL LBL"):
            raise BlockError(f"cannot read '{text[:50]}'")
        if _OTHER.match(text):
            raise BlockError(f"'{text[:50]}' runs a program that is not in this file",
                             "copy it into the file as a subprogram (LBL to LBL 0) and call it by CALL LBL")
        if text.startswith("FN") and (label := self.q.jump(text)) is not None:
            return self._jump(self._find(label), at) if label else at
        return at

    def _call(self, label: str, times: str | None, at: int) -> int:
        if label == "0":
            raise BlockError("CALL LBL 0: label 0 ends subprograms and cannot be called")
        target = self._find(label)
        if times is None:
            if len(self._back) >= MAX_CALLS:
                raise BlockError(f"more than {MAX_CALLS} nested calls; the control runs no more")
            self._back.append(at)
            return self._jump(target)
        left = self._left.get(at, int(times))
        if left <= 0:
            self._left.pop(at, None)
            return at
        self._left[at] = left - 1
        return self._jump(target)

    def _find(self, label: str) -> int:
        """Line after a label."""
        if self._labels is None:
            self._labels = {}
            for k, raw in enumerate(self.lines):
                if "LBL" in raw.upper() and (m := _LABEL.fullmatch(block_text(raw))) and m[1] != "0":
                    if m[1] in self._labels:
                        raise BlockError(f"the label {m[1]} stands in lines {self._labels[m[1]]} and {k + 1}")
                    self._labels[m[1]] = k + 1
        if label not in self._labels:
            raise BlockError(f"the label {label} is not in the program")
        return self._labels[label]

    def _jump(self, to: int, at: int | None = None) -> int:
        """Count a jump, and give where it goes to; ``at`` is the line behind an FN."""
        self._jumps.add(MAX_JUMPS)
        if at is not None and to < at:
            self._jumps.back(at, (self.q.held, self.machine.s, self._left, self._back))
        return to


__all__ = ["HeidenhainFlow", "block_text"]
