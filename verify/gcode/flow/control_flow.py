"""The stage before the blocks: evaluates parameters, runs subroutines, conditions and loops, and yields plain blocks.

A program without any of these skips this stage. Every block keeps the line number of its text. An error in a parameter
or an O-word ends the reading, since the next line of the program is then unknown.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from geometry.errors import ProgramError
from verify.gcode.block_words import BlockError, bare
from verify.gcode.flow.expressions import Value
from verify.gcode.flow.o_words import OWordStep, Structure, StructureError, find_structure
from verify.gcode.flow.parameters import LOCAL, CallFrame, Parameters
from verify.gcode.flow.parametric_lines import ParametricLine, read_line
from verify.program.move_log import Log

MAX_BLOCKS = 5_000_000
MAX_CALLS = 9
"""Nested calls that LinuxCNC runs."""
MAX_KEPT = 20_000
_CALL = re.compile(r"[mM][ \t]*0*9([89])(?![0-9.])")
_COMMENT = re.compile(r"\([^()]*\)|;.*")
_LABEL = re.compile(r"\s*[oO][ \t]*0*([0-9]+)\s*(?:[;(].*)?")
_LETTER = re.compile(r"([A-Z])([0-9.]+)")
_O_WORD = re.compile(r"[oO][ \t]*(?:[<\[#]|[0-9]+[ \t]*[a-zA-Z])")


def has_flow(text: str) -> bool:
    """Whether a program has parameters, expressions or O-words; also True where only a comment seems to have them."""
    if "#" in text or "[" in text or _CALL.search(text):
        return True
    for letter in "oO":
        at = text.find(letter)
        while at >= 0:
            if _O_WORD.match(text, at):
                return True
            at = text.find(letter, at + 1)
    return False


class FlowReader(Protocol):
    """The part of the reader that the flow needs."""

    log: Log

    def served(self, key: int | str) -> float:
        """A parameter of the control."""

    def enter(self) -> None:
        """A subroutine begins."""

    def leave(self) -> None:
        """A subroutine ends."""


class Flow:
    """One run of a program: parameters, O-words and calls as in LinuxCNC, whose language extends [Kramer2000].

    lines   : its text
    machine : the reader; it gives its state and hears of calls
    """

    def __init__(self, lines: Sequence[str], machine: FlowReader) -> None:
        self.lines, self.machine = lines, machine
        self.scope = Parameters(machine.served)
        self.structure = Structure()
        self._back: list[int] = []
        self._latest: dict[int, tuple[int, int]] = {}
        self._programs: dict[int, list[int]] = {}
        self._runs_left: list[list[int]] = []  # of M98: line to come back to, first line, runs left
        self._kept: dict[int, ParametricLine] = {}
        self._runs: dict[str, Callable[[OWordStep], int]] = {
            "sub": lambda step: step.end + 1, "endsub": self._return, "return": self._return, "call": self._call,
            "if": self._if, "else": lambda step: step.end + 1, "elseif": lambda step: step.end + 1,
            "endif": lambda step: step.at + 1, "while": self._while, "endwhile": lambda step: step.start,
            "do": lambda step: step.at + 1, "repeat": self._repeat, "endrepeat": self._again,
            "break": lambda step: step.end + 1, "continue": lambda step: step.start,
        }

    def blocks(self) -> Iterator[tuple[int, str]]:
        """Line numbers from 1 and plain blocks, in the order they are run; an error is logged and ends them.

        Raises
        ------
        ProgramError
            Code program_too_long: more than 5 000 000 lines run.
        """
        try:
            self.structure = find_structure(self.lines)
        except StructureError as problem:
            return self.machine.log.error(str(problem), problem.line)
        at, runs = 0, 0
        if any(map(_CALL.search, self.lines)):
            self._programs[-1] = []
            for k, line in enumerate(self.lines):
                if label := _LABEL.fullmatch(line):
                    self._programs.setdefault(int(label[1]), []).append(k)
        plain, steps = self.structure.plain, self.structure.steps
        if not all(plain) and not steps:  # O-words with a keyword are LinuxCNC's alone
            self.machine.log.note("parameters, expressions and O-words are read as in LinuxCNC; other controls differ")
        while at < len(plain):
            runs += 1
            if runs > MAX_BLOCKS:
                self._endless(at + 1)
            if plain[at] and self._programs and _CALL.search(self.lines[at]) and (
                    call := _CALL.search(_COMMENT.sub(" ", self.lines[at]))):
                self.machine.log.pass_line(at + 1)
                try:
                    goal = self._fanuc_call(at, call[1])
                except BlockError as problem:
                    return self.machine.log.error(str(problem))
                if goal is not None:
                    at = goal
                    continue
                yield at + 1, "M2"
                return None
            if plain[at]:
                at += 1
                yield at, self.lines[at - 1]
                continue
            self.machine.log.pass_line(at + 1)
            try:
                if at in steps:
                    at = self._runs[steps[at].word.keyword](steps[at])
                    continue
                text = self._line(at).run(self.scope)
            except BlockError as problem:
                return self.machine.log.error(str(problem))
            at += 1
            if text:
                yield at, text
        if len(plain) < len(self.lines):
            yield len(plain) + 1, "%"
        return None

    def _fanuc_call(self, at: int, word: str) -> int | None:
        """Line after M98 (P, L) or M99, which LinuxCNC has beside its O-words; None where M99 ends the main program."""
        text = "".join(bare(self.lines[at]).upper().split())
        words = {a: float(b) for a, b in _LETTER.findall(text)}
        if text != "".join(a + b for a, b in _LETTER.findall(text)) or not words.keys() <= set("NMPL"):
            raise BlockError(f"M9{word} with other words in its block: give it its own block")
        if word == "9":
            if not self._runs_left:
                self.machine.log.note(f"line {at + 1}: M99 repeats the main program without end; the proof reads it "
                                      "once")
                self.machine.log.repeats = at + 1
                return None
            call = self._runs_left[-1]
            call[2] -= 1
            return call[1] if call[2] > 0 else self._runs_left.pop()[0]
        number, times = int(words.get("P", -1)), int(words.get("L", 1))
        found = self._programs.get(number, [])
        if not found:
            raise BlockError(f"M98 P{number}: the program O{number} is not in the file")
        if len(found) > 1:
            raise BlockError(f"M98 P{number}: O{number} stands twice in the file, at the lines {found[0] + 1} and "
                             f"{found[1] + 1}")
        if len(self._runs_left) >= MAX_CALLS:
            raise BlockError(f"more than {MAX_CALLS} nested calls; LinuxCNC runs no more")
        if times < 1:
            return at + 1
        self._runs_left.append([at + 1, found[0] + 1, times])
        return found[0] + 1

    def _line(self, at: int) -> ParametricLine:
        """The parsed line; it is cached only where it can run again, as caching all lines slows garbage collection."""
        line = self._kept.get(at)
        if line is None:
            line = read_line(self.lines[at])
            if self.structure.again[at] and len(self._kept) < MAX_KEPT:
                self._kept[at] = line
        return line

    def _endless(self, line: int) -> None:
        log = self.machine.log
        raise ProgramError(f"{log.name}, line {line}: the program runs more than {MAX_BLOCKS} lines; a loop may have "
                           "no end", code="program_too_long", subjects=(f"line {line}",), measured=MAX_BLOCKS + 1,
                           limit=MAX_BLOCKS, remedy="correct the condition of the loop, or split the program")

    def _holds(self, step: OWordStep) -> bool:
        return step.word.values[0](self.scope) != 0

    def _if(self, step: OWordStep) -> int:
        """Line of the first branch whose condition holds."""
        while step.word.keyword in ("if", "elseif") and not self._holds(step):
            step = self.structure.steps[step.other]
            self.machine.log.pass_line(step.at + 1)
        return step.at + 1

    def _while(self, step: OWordStep) -> int:
        holds = self._holds(step)
        if holds and self._latest.get(step.at) == (self.scope.changes, len(self._back)):
            self._endless(step.at + 1)  # no parameter has changed since the condition held before
        self._latest[step.at] = self.scope.changes, len(self._back)
        if step.kind == "do":
            return step.start + 1 if holds else step.at + 1
        return step.at + 1 if holds else step.end + 1

    def _repeat(self, step: OWordStep) -> int:
        times = step.word.values[0](self.scope)
        self.scope.frame.repeats[step.start] = round(times) if times < MAX_BLOCKS else MAX_BLOCKS
        return step.at + 1 if self.scope.frame.repeats[step.start] > 0 else step.end + 1

    def _again(self, step: OWordStep) -> int:
        self.scope.frame.repeats[step.start] -= 1
        self.scope.changes += 1
        return step.start + 1 if self.scope.frame.repeats[step.start] > 0 else step.at + 1

    def _call(self, step: OWordStep) -> int:
        word = step.word
        label = word.label if word.computed is None else _label(word.computed, self.scope)
        sub = self.structure.subs.get(label)
        if sub is None:
            raise BlockError(f"the subroutine '{label}' is not in the program (LinuxCNC reads it from {label}.ngc): "
                             "copy it into the program")
        if len(self._back) >= MAX_CALLS:
            raise BlockError(f"more than {MAX_CALLS} nested calls; LinuxCNC runs no more")
        numbers = dict.fromkeys(range(1, LOCAL + 1), 0.0)
        numbers.update(enumerate((value(self.scope) for value in word.values), 1))
        self.scope.frames.append(CallFrame(numbers))
        self._back.append(step.at + 1)
        self.scope.changes += 1
        self.machine.enter()
        return sub.at + 1

    def _return(self, step: OWordStep) -> int:
        values = step.word.values
        self.scope.returned = (values[0](self.scope), 1.0) if values else (0.0, 0.0)
        self.scope.frames.pop()
        self.scope.changes += 1
        self.machine.leave()
        return self._back.pop()


def _label(computed: Value, scope: Parameters) -> str:
    number = computed(scope)
    if number < 0 or number != round(number):
        raise BlockError(f"O{number:g} is not a label")
    return str(int(number))
