"""Pairs the O-words of a program before it runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from verify.gcode.block_words import BlockError
from verify.gcode.flow.parametric_lines import OWord, is_plain, read_o_word

_OPENS = frozenset({"sub", "if", "while", "do", "repeat"})
_CLOSES = {"endsub": "sub", "endif": "if", "endwhile": "while", "endrepeat": "repeat"}


@dataclass
class OWordStep:
    """An O-word and the O-words it belongs to; lines are numbered from 0.

    word  : the O-word
    at    : its line
    start : line of the opening O-word (for break and continue: of the loop)
    end   : line of the closing O-word
    other : for if and elseif, the next line where the condition does not hold
    kind  : keyword of the opening O-word: sub, if, while, do, repeat
    """

    word: OWord
    at: int
    start: int = -1
    end: int = -1
    other: int = -1
    kind: str = ""


@dataclass
class Structure:
    """Steps by line and subroutines by label, with lines numbered from 0.

    plain : by line, whether it skips the stage before the blocks
    again : by line, whether a loop or call may run it more than once
    """

    steps: dict[int, OWordStep] = field(default_factory=dict)
    subs: dict[str, OWordStep] = field(default_factory=dict)
    plain: list[bool] = field(default_factory=list)
    again: list[bool] = field(default_factory=list)


class StructureError(BlockError):
    """An O-word without its counterpart; ``line`` is numbered from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def find_structure(lines: Sequence[str]) -> Structure:
    """Pair the O-words of a program up to its closing %.

    Raises StructureError with the line: an O-word that closes or continues nothing, one that is never closed, a label
    that appears twice, a subroutine inside another O-word.
    """
    found, percents = Structure(), 0
    pairing = _Pairing(found)
    for at, raw in enumerate(lines):
        percents += raw.strip() == "%"
        if percents == 2:
            break
        found.plain.append(is_plain(raw))
        found.again.append(False)
        if found.plain[-1]:
            continue
        try:
            word = read_o_word(raw)
            if word is not None:
                pairing.place(OWordStep(word, at))
        except BlockError as problem:
            raise StructureError(str(problem), at + 1) from None
    pairing.finish()
    return found


class _Pairing:
    """The open O-words while the lines are scanned."""

    def __init__(self, found: Structure) -> None:
        self.found = found
        self.open: list[OWordStep] = []
        self.last: list[OWordStep] = []  # the latest branch of each open step
        self.members: list[list[OWordStep]] = []
        self.labels: set[tuple[str, str]] = set()

    def place(self, step: OWordStep) -> None:
        word = step.word
        self.found.steps[step.at] = step
        top = self.open[-1] if self.open else None
        if word.keyword == "while" and top is not None and top.kind == "do" and top.word.label == word.label:
            self._close(step)
        elif word.keyword in _OPENS:
            self._open(step)
        elif word.keyword in _CLOSES:
            self._needs(step, _CLOSES[word.keyword])
            self._close(step)
        elif word.keyword in ("else", "elseif"):
            self._branch(step)
        elif word.keyword in ("break", "continue"):
            self._leave(step)
        elif word.keyword == "return" and not (self.open and self.open[0].kind == "sub"):
            raise BlockError("return outside a subroutine")

    def finish(self) -> None:
        if self.open:
            step = self.open[-1]
            raise StructureError(f"{_name(step)} is never closed", step.at + 1)

    def _open(self, step: OWordStep) -> None:
        word = step.word
        sub = self.open[0].word.label if self.open and self.open[0].kind == "sub" else ""
        if word.keyword == "sub" and self.open:
            raise BlockError(f"{_name(step)} inside {_name(self.open[-1])}")
        key = ("", word.label) if word.keyword == "sub" else (sub + "#", word.label)
        if key in self.labels:
            raise BlockError(f"the label of {_name(step)} appears twice: each loop, condition and subroutine "
                             "needs its own")
        self.labels.add(key)
        step.kind, step.start = word.keyword, step.at
        if word.keyword == "sub":
            self.found.subs[word.label] = step
        self.open.append(step)
        self.last.append(step)
        self.members.append([step])

    def _close(self, step: OWordStep) -> None:
        first, members = self.open.pop(), self.members.pop()
        last = self.last.pop()
        if last.word.keyword != "else":
            last.other = step.at
        step.kind = first.kind
        if first.kind != "if":
            self.found.again[first.at:step.at] = [True] * (step.at - first.at)
        for member in [*members, step]:
            member.start, member.end = first.at, step.at

    def _branch(self, step: OWordStep) -> None:
        first = self._needs(step, "if")
        if self.last[-1].word.keyword == "else":
            raise BlockError(f"{_name(step)} after else of {_name(first)}")
        step.kind = "if"
        self.last[-1].other = step.at
        self.last[-1] = step
        self.members[-1].append(step)

    def _leave(self, step: OWordStep) -> None:
        for k in range(len(self.open) - 1, -1, -1):
            loop = self.open[k]
            if loop.kind in ("while", "do", "repeat") and loop.word.label == step.word.label:
                if loop.kind == "repeat":
                    raise BlockError(f"{_name(step)} in a repeat: LinuxCNC does not run it; use while and endwhile")
                if loop.kind == "do" and step.word.keyword == "continue":
                    raise BlockError(f"{_name(step)} in do and while: LinuxCNC takes it for the end of the loop; "
                                     "use while and endwhile")
                step.kind = loop.kind
                self.members[k].append(step)
                return
        raise BlockError(f"{_name(step)} is not in a loop of that label")

    def _needs(self, step: OWordStep, kind: str) -> OWordStep:
        top = self.open[-1] if self.open else None
        if top is None or top.kind != kind or top.word.label != step.word.label:
            inside = f"inside {_name(top)} of line {top.at + 1}" if top else "without an open O-word"
            raise BlockError(f"{_name(step)} {inside}: it belongs to {kind} of the same label")
        return top


def _name(step: OWordStep) -> str:
    label = step.word.label
    return f"O{label if label.isdigit() else f'<{label}>'} {step.word.keyword}"
