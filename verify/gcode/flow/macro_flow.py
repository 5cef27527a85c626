"""Order of the lines of a Fanuc or Haas program: subprograms, macros, jumps and loops, with their variables.

Followed: M98 and M99 with P, L and Q, M97 of Haas, G65 with its letters, GOTO, IF THEN, IF GOTO, WHILE DO END,
variables and arithmetic. A called program must be in the same text, as O and its number. Lines come out in the order
they run, with numbers in the place of variables. The errors name what cannot be known: a program that is not in the
text, a variable that the program has not set, a label that is missing, a loop without an end.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from geometry.errors import ProgramError
from verify.gcode.block_words import NUMBER, BlockError, bare
from verify.gcode.dialects.base import Machine
from verify.gcode.flow.expressions import ExpressionReader, Value
from verify.gcode.flow.macro_variables import ARGUMENTS, MACRO_GRAMMAR, WORD_GRAMMAR, MacroVariables
from verify.gcode.flow.parameters import CallFrame
from verify.gcode.flow.parametric_lines import digits

MAX_CALLS = 10
MAX_RUNS = 5_000_000
MAX_JUMPS = 200_000
MAX_KEPT = 20_000
_FLOW = re.compile(r"[#\[]|M\s*0*9[6789]|G\s*0*65|GOTO|WHILE|DO\s*[0-9]|END\s*[0-9]|DPRNT|POPEN|PCLOS", re.IGNORECASE)
_HINT = re.compile(r"[#\[MGWDEPmgwdep]")  # a tenth of the time of _FLOW
_PROGRAM = re.compile(r"\s*[O:]\s*0*([0-9]+)", re.IGNORECASE)
_LABEL = re.compile(r"\s*/?\s*N\s*0*([0-9]+)", re.IGNORECASE)
_STATEMENT = re.compile(r"(?:/?)(?:n[0-9]+)?(if|while|goto|do|end|#|popen|pclos|dprnt|bprnt|setvn)")
_LOOP = re.compile(r"(?:n[0-9]+)?(?:while\[.*\])?do([0-9]+)|(?:n[0-9]+)?end([0-9]+)")
_IDLE = frozenset({"popen", "pclos", "dprnt", "bprnt", "setvn"})
_WORD = re.compile(rf"([A-Z])({NUMBER})")
_COUNTS = "GMNTHDLPSO"
_POINTED = "XYZABCIJKRUVW"
Taken = Callable[[str, float, frozenset[float]], float]


@dataclass
class _Section:
    """One program of the text.

    start, end : lines, from 0; ``end`` is the first one behind it
    labels  : lines by N number; partner : line of END by line of DO, and back
    """

    number: int
    start: int
    end: int = 0
    labels: dict[int, list[int]] = field(default_factory=dict)
    partner: dict[int, int] = field(default_factory=dict)


@dataclass(frozen=True)
class _CallWords:
    """A call as written: M97, M98, M99 or G65, and its words."""

    kind: str
    written: list[tuple[str, str]]

    @property
    def words(self) -> dict[str, float]:
        """Numbers by letter."""
        return {a: float(b) for a, b in self.written}


@dataclass
class _Call:
    """A running call: where to go on, the section that called, where it begins, runs left, whether it has a level."""

    back: int
    caller: _Section
    start: int
    section: _Section
    left: int
    level: bool


@dataclass(frozen=True)
class _Filled:
    """A block with variables: its letters, each with what is written behind it and the value of that; its G words."""

    head: str
    words: tuple[tuple[str, str, Value | None], ...]
    codes: frozenset[float] = frozenset()

    @classmethod
    def read(cls, text: str) -> _Filled:
        """Parse a block without blanks, in lower case."""
        head = "/" if text.startswith("/") else ""
        if "#" not in text and "[" not in text:
            return cls(text.upper(), ())
        reading, words = ExpressionReader(text, WORD_GRAMMAR), []
        reading.at = len(head)
        while reading.rest:
            letter = text[reading.at].upper()
            if not letter.isalpha():
                raise BlockError(f"cannot read '{reading.rest}'")
            reading.at += 1
            start = reading.at
            value = reading.value()
            written = text[start:reading.at].upper()
            words.append((letter, written, None if re.fullmatch(NUMBER, written) else value))
        return cls(head, tuple(words), frozenset(float(w) for a, w, v in words if a == "G" and v is None))

    def text(self, scope: MacroVariables, taken: Taken) -> str:
        """The block with numbers in the place of its variables and expressions, without words of vacant variables.

        taken : gives the number that the control takes for a letter, from its value and the G words of the block
        """
        out = self.head
        for letter, written, value in self.words:
            if value is None:
                out += letter + written
                continue
            found = value(scope)
            if found != found and written.startswith("#") and scope.emptied():
                scope.ignored.append(f"{letter}{written}")
                continue
            known = scope.known(found, f"{letter}{written}")
            number = digits(letter, known if 65 in self.codes else taken(letter, known, self.codes))
            out += letter + (number if "." in number or letter in _COUNTS else number + ".")
        return out


_Step = Callable[[int, _Section], int]


class MacroFlow:
    """One run of a program.

    lines   : its text
    machine : the reader
    haas    : whether M97 is known and P of M98 has no count
    taken   : gives the number that the control takes for a word of a variable: letter, value, G words of the block
    """

    def __init__(self, lines: Sequence[str], machine: Machine, haas: bool = False, taken: Taken | None = None) -> None:
        self.lines, self.machine, self.haas = lines, machine, haas
        self.taken = taken or (lambda letter, number, codes: number)
        self.scope = MacroVariables(machine.served, None if haas else machine.angle)
        self.sections = _sections(lines)
        self.calls: list[_Call] = []
        self.jumps = 0
        self._latest: dict[int, tuple[int, int]] = {}
        self._steps: dict[int, _Step | _Filled | None] = {}

    def lines_run(self) -> Iterator[tuple[int, str]]:
        """Numbers of lines, from 1, and their text, in the order they run.

        Raises
        ------
        BlockError
            The order, or a value, cannot be known.
        ProgramError
            Code program_too_long: a loop has no end.
        """
        section, at, runs = self.sections[0], 0, 0
        while at < len(self.lines):
            runs += 1
            if runs > MAX_RUNS or self.jumps > MAX_JUMPS:
                self._endless(at + 1)
            raw = self.lines[at]
            if at >= section.end and self.calls:
                self.machine.log.line = at
                raise BlockError(f"O{section.number} ends without M99")
            if at >= section.end and section is not self.sections[-1] and raw.strip() != "%":
                return
            if not (_HINT.search(raw) and _FLOW.search(raw)):
                yield at + 1, raw
                at += 1
                continue
            self.machine.log.pass_line(at + 1)
            step = self._step(at)
            if step is None:
                yield at + 1, raw
                at += 1
                continue
            if not isinstance(step, _Filled):
                at = step(at, section)
                continue
            rest, call = self._split(step.text(self.scope, self.taken))
            if self.scope.ignored:
                self.machine.log.note(f"line {at + 1}: {' and '.join(self.scope.ignored)} is ignored, as its variable "
                                      "is vacant")
                self.scope.ignored.clear()
            if rest:
                yield at + 1, rest
            if call is None:
                at += 1
                continue
            self.machine.log.line = at + 1
            self.jumps += 1
            self.scope.changes += 1
            if call.kind == "M99" and not self.calls and "P" not in call.words:
                self.machine.log.note(f"line {at + 1}: M99 ends the main program and repeats it without end; the proof "
                                      "reads it once")
                self.machine.log.repeats = at + 1
                yield at + 1, "M30"
                return
            section, at = self._jump(call, at, section)

    def _jumps_from(self, at: int) -> None:
        """Count a jump back; one from where no variable has changed since the jump before has no end."""
        self.jumps += 1
        if self.jumps > MAX_JUMPS or self._latest.get(at) == (self.scope.changes, len(self.calls)):
            self._endless(at + 1)
        self._latest[at] = self.scope.changes, len(self.calls)

    def _endless(self, line: int) -> None:
        log = self.machine.log
        raise ProgramError(f"{log.name}, line {line}: the program runs more than {MAX_RUNS} lines or {MAX_JUMPS} "
                           "jumps and calls; a loop may have no end", code="program_too_long",
                           subjects=(f"line {line}",), measured=self.jumps, limit=MAX_JUMPS,
                           remedy="correct the condition of the loop, or split the program")

    def _step(self, at: int) -> _Step | _Filled | None:
        """What a line does, parsed once; None where it is a plain block."""
        if at in self._steps:
            return self._steps[at]
        step: _Step | _Filled | None = None
        try:
            text = "".join(bare(self.lines[at]).lower().split())
        except BlockError:  # the block names it
            text = ""
        if "#" in text or "[" in text or _FLOW.search(text):
            found = _STATEMENT.match(text)
            step = self._statement(text, found) if found else _Filled.read(text)
        if len(self._steps) < MAX_KEPT:
            self._steps[at] = step
        return step

    def _statement(self, text: str, found: re.Match[str]) -> _Step:
        """A statement of a macro as a function that gives the line that runs next."""
        kind = found[1]
        if kind in _IDLE or (kind == "do" and not text.startswith("/")):
            return lambda at, section: at + 1
        if text.startswith("/"):
            raise BlockError("a / before a statement of a macro: the flow of the program would depend on a switch of "
                             "the machine")
        reading = ExpressionReader(text, MACRO_GRAMMAR)
        reading.at = found.start(1) if kind == "#" else found.end(1)
        if kind == "#":
            assign = self._assignment(reading)
            return lambda at, section: assign() or at + 1
        if kind == "end":
            return self._loop_start
        if kind == "goto":
            value = reading.value()
            return lambda at, section: self._label(self.scope.known(value(self.scope), "GOTO"), at, section)
        holds = self._condition(reading)
        if kind == "while":
            return lambda at, section: self._while(holds(), at, section)
        if reading.rest.startswith("goto"):
            reading.take("goto")
            goal = reading.value()
            return lambda at, section: (self._label(self.scope.known(goal(self.scope), "GOTO"), at, section)
                                        if holds() else at + 1)
        reading.take("then")
        then = self._assignment(reading)
        return lambda at, section: (holds() and then()) or at + 1

    def _while(self, holds: bool, at: int, section: _Section) -> int:
        if at not in section.partner:
            raise BlockError("WHILE without DO and END of the same number")
        return at + 1 if holds else section.partner[at] + 1

    def _condition(self, reading: ExpressionReader) -> Callable[[], bool]:
        """The condition in brackets; more of them may follow, joined by AND, OR, XOR."""
        terms = [("or", reading.bracket())]
        while word := next((w for w in ("and", "or", "xor") if reading.rest.startswith(w)), None):
            reading.take(word)
            terms.append((word, reading.bracket()))

        def holds() -> bool:
            result = False
            for word, term in terms:
                more = term(self.scope) != 0
                result = result and more if word == "and" else result or more if word == "or" else result != more
            return result
        return holds

    def _assignment(self, reading: ExpressionReader) -> Callable[[], int]:
        """Assignments to the end of the line; run, they give 0."""
        parts: list[tuple[Value, Value, str]] = []
        while reading.rest:
            target = reading.target()
            if target.number is None:
                raise BlockError(f"#<{target.name}>: macros have numbered variables only")
            reading.take("=")
            start = reading.at
            alone = ExpressionReader(reading.text, MACRO_GRAMMAR)
            alone.at = start
            alone.value()
            value, copied = reading.whole(), reading.text[start] == "#" and alone.at == reading.at
            parts.append((target.number, value, "" if copied else reading.text[start:reading.at].upper()))
            if reading.rest.startswith(","):
                reading.take(",")

        def run() -> int:
            for number, value, formula in parts:
                found = value(self.scope)
                if formula or not self.scope.emptied():  # controls count a vacant variable as 0 in a formula
                    self.scope.known(found, formula or "an assignment")
                self.scope.put(self.scope.known(number(self.scope), "#"), found)
            return 0
        return run

    def _loop_start(self, at: int, section: _Section) -> int:
        if at not in section.partner:
            raise BlockError("END without DO of the same number before it")
        self._jumps_from(at)
        return section.partner[at]

    def _label(self, number: float, at: int, section: _Section) -> int:
        found = section.labels.get(round(number), [])
        if not found:
            raise BlockError(f"GOTO {number:g}: N{number:g} is not in the program")
        after = bisect_right(found, at)
        goal = found[after] if after < len(found) else found[0]
        if goal <= at:
            self._jumps_from(at)
        return goal

    def _split(self, text: str) -> tuple[str, _CallWords | None]:
        """The block without its call, and the call; None where it has none."""
        words = _WORD.findall(text.removeprefix("/"))
        kinds = [f"{a}{float(b):g}" for a, b in words if a in "GM"]
        call = next((k for k in ("M98", "M99", "M97", "G65", "M96") if k in kinds), None)
        if call is None:
            return text, None
        if "".join(a + b for a, b in words) != text.removeprefix("/"):
            raise BlockError(f"cannot read '{text[:60]}'")
        if call == "M96" or (call == "M97" and not self.haas):
            raise BlockError(f"unknown word {call} ({'an interrupt' if call == 'M96' else 'a local call of Haas'})")
        if text.startswith("/"):
            raise BlockError(f"a / before {call}: the flow of the program would depend on a switch of the machine")
        if call == "G65":
            rest = [a + b for a, b in words if a == "G" and float(b) != 65]
            own = [(a, b) for a, b in words if a not in "GN"]
        else:
            own = [(a, b) for a, b in words if a in "PLQ"]
            rest = [a + b for a, b in words if a not in "PLQN" and f"{a}{float(b):g}" != call]
        return " ".join(rest), _CallWords(call, own)

    def _jump(self, call: _CallWords, at: int, section: _Section) -> tuple[_Section, int]:
        words, kind = call.words, call.kind
        if kind == "M99":
            return self._return(words, at, section)
        if "P" not in words:
            raise BlockError(f"{kind} without P, the number of the program")
        number, times = round(words["P"]), round(words.get("L", 1.0))
        if kind == "M97":
            target, start = section, self._local(number, section)
        else:
            target, times = self._program(kind, number, times, "L" in words)
            start = target.start
            if kind == "M98" and "Q" in words:
                start = self._local(round(words["Q"]), target)
        if len(self.calls) >= MAX_CALLS:
            raise BlockError(f"more than {MAX_CALLS} nested calls")
        if times < 1:
            raise BlockError(f"{kind} L{times}: a call that runs no times, or once, is not certain", "leave it out")
        if kind == "G65":
            self.scope.frames.append(CallFrame(_arguments(call.written)))
        self.calls.append(_Call(at + 1, section, start, target, times - 1, kind == "G65"))
        return target, start

    def _local(self, number: int, section: _Section) -> int:
        found = section.labels.get(number, [])
        if not found:
            raise BlockError(f"N{number} is not in the program")
        _check_single(f"N{number}", found)
        return found[0]

    def _program(self, kind: str, number: int, times: int, counted: bool) -> tuple[_Section, int]:
        """The section of a called program and how often it runs; eight digits of M98 are count and number."""
        found = [s for s in self.sections if s.number == number]
        if not found and kind == "M98" and not self.haas and not counted and number >= 10_000:
            times, number = divmod(number, 10_000)
            found = [s for s in self.sections if s.number == number]
        if found:
            _check_single(f"O{number}", [s.start for s in found])
            return found[0], times
        raise BlockError(f"{kind} P{number}: the program O{number} is not in the file",
                         f"put O{number} into the file, behind the end of the main program")

    def _return(self, words: dict[str, float], at: int, section: _Section) -> tuple[_Section, int]:
        if not self.calls:
            return section, self._label(words["P"], at, section)
        if "L" in words:
            raise BlockError("M99 with L: controls differ in how often the subprogram runs then",
                             "leave L out and count in M98")
        call = self.calls[-1]
        if call.left > 0 and "P" not in words:
            call.left -= 1
            return call.section, call.start
        self.calls.pop()
        if call.level:
            self.scope.frames.pop()
        if "P" in words:
            _check_single(f"N{words['P']:g}", call.caller.labels.get(round(words["P"]), []))
            return call.caller, self._label(words["P"], call.back - 1, call.caller)
        return call.caller, call.back


def _check_single(name: str, lines: Sequence[int]) -> None:
    """Refuse a destination that stands at several lines (from 0): controls differ in which one they take, or stop."""
    if len(lines) > 1:
        raise BlockError(f"{name} stands at the lines {', '.join(str(k + 1) for k in lines[:4])}, and controls "
                         "differ in which one runs", "give each its own number")


def has_macros(lines: Sequence[str]) -> bool:
    """Whether a program has calls, variables or jumps; also True where only a comment seems to have them."""
    return any(_HINT.search(line) and _FLOW.search(line) for line in lines)


def _sections(lines: Sequence[str]) -> list[_Section]:
    """The programs of a text in order; the first one is what runs."""
    found: list[_Section] = []
    for at, raw in enumerate(lines):
        if name := _PROGRAM.match(raw):
            if found:
                found[-1].end = at
            found.append(_Section(int(name[1]), at))
        elif found and raw.strip() == "%" and found[-1].end == 0:
            found[-1].end = at
    if not found:
        found = [_Section(-1, 0, len(lines))]
    for section in found:
        section.end = section.end or len(lines)
        _survey(section, lines)
    return found


def _survey(section: _Section, lines: Sequence[str]) -> None:
    """Find the labels of a section and pair its loops."""
    open_loops: dict[str, list[int]] = {}
    for at in range(section.start, section.end):
        raw = lines[at]
        if label := _LABEL.match(raw):
            section.labels.setdefault(int(label[1]), []).append(at)
        if "D" not in raw and "d" not in raw:  # DO, END
            continue
        loop = _LOOP.fullmatch("".join(re.sub(r"\([^()]*\)", "", raw).lower().split()))
        if loop is None:
            continue
        if loop[1]:
            open_loops.setdefault(loop[1], []).append(at)
        elif open_loops.get(loop[2]):
            start = open_loops[loop[2]].pop()
            section.partner[start], section.partner[at] = at, start


def _arguments(words: Sequence[tuple[str, str]]) -> dict[int, float]:
    """Local variables that the letters of G65 fill; a second I, J or K means the list of ten triples."""
    letters = [a for a, _ in words]
    for letter, number in words:
        if letter in _POINTED and "." not in number and float(number) != 0:
            raise BlockError(f"{letter}{number} of G65 without a decimal point is {number} or {float(number) / 1000:g}"
                             ", depending on a parameter of the machine", "write the decimal point")
    out: dict[int, float] = {}
    triples = any(letters.count(c) > 1 for c in "IJK")
    seen = dict.fromkeys("IJK", 0)
    for letter, number in words:
        if letter in "PL":
            continue
        if letter not in ARGUMENTS:
            raise BlockError(f"G65 takes no {letter}")
        place = ARGUMENTS[letter]
        if triples and letter in "IJK":
            place += 3 * seen[letter]
            seen[letter] += 1
        out[place] = float(number)
    return out


__all__ = ["MacroFlow", "has_macros"]
