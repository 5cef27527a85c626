"""The order in which the lines of a Siemens program run: subprograms, repeats, jumps, conditions and loops.

A call is followed into a program of the same file (``siemens_sections``). Loops and jumps are bounded by ``MAX_JUMPS``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field

from verify.gcode.block_words import BlockError
from verify.gcode.dialects.base import Jumps, Machine
from verify.gcode.dialects.siemens.siemens_expressions import Value, ValueReader, Variables, same
from verify.gcode.dialects.siemens.siemens_sections import (
    PLAIN,
    Section,
    body_of,
    find_sections,
    label_lines,
    statement,
)

MAX_JUMPS = 200_000
MAX_CALLS = 16
"""Nested calls that the control runs."""
_KEYWORD = re.compile(r"(IF|ELSE|ENDIF|WHILE|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEATB|REPEAT|UNTIL|CASE|GOTOF|GOTOB"
                      r"|GOTOC|GOTOS|GOTO|RET|M17|EXTCALL|PCALL|ISOCALL|CALLPATH|CALL|PROC|ENDPROC|EXTERN|MCALL)(?![A-Z_0-9=(])|"
                      r"(IF|WHILE|UNTIL|CASE|EXTCALL|PCALL|RET|CALLPATH)(?=\()")
_CALL = re.compile(r"(L[0-9]+|[A-Z_]{2}[A-Z_0-9]*)\s*(\(|P\b|P[0-9=]|$)")
_RETURN = re.compile(r"(?<![A-Z_0-9$\"])(M17|M0?2|M30|RET)(?![A-Z_0-9=(])")
_DECIDES = re.compile(r"(?<![A-Z_0-9$])(IF|CASE|WHILE|UNTIL|GOTO[FBC]?)(?![A-Z_0-9=])")
Steps = Generator[tuple[int, str], None, int]
"""Lines to run, and the line that follows them."""
_OPENS = {"WHILE": "ENDWHILE", "FOR": "ENDFOR", "LOOP": "ENDLOOP", "REPEAT": "UNTIL", "IF": "ENDIF"}


@dataclass
class _Frame:
    """One running call: where it returns, its section, and the repeats that are left there."""

    section: Section
    back: int
    left: int = 1
    repeats: dict[int, int] = field(default_factory=dict)
    returns: dict[int, int] = field(default_factory=dict)
    given: tuple[tuple[str, str, tuple[int, ...]], ...] = ()
    saved: Callable[[], str] | None = None
    modal: bool = False


class SiemensFlow:
    """One run through the lines of a file.

    lines     : of the file
    variables : R parameters and variables
    machine   : the reader that runs the blocks
    modes     : keeps the modes of the control; what it gives restores them and gives the words for the rest (SAVE)
    """

    def __init__(self, lines: Sequence[str], variables: Variables, machine: Machine,
                 modes: Callable[[], Callable[[], str]]) -> None:
        self.lines, self.variables, self.machine, self.modes = lines, variables, machine, modes
        self.sections = find_sections(lines)
        self.pairs: dict[int, dict[str, int]] = {}
        self.modal = ""  # the call that MCALL repeats after each move
        self._jumps = Jumps(machine.log)
        self._calls: list[_Frame] = []
        self._paired: set[int] = set()
        self._labels: dict[str, list[int]] | None = None

    @property
    def frame(self) -> _Frame:
        """The running call."""
        return self._calls[-1]

    def run(self, moved: Callable[[], bool]) -> Iterator[tuple[int, str]]:
        """Line numbers from 1 and lines, in order; ``moved`` says whether the latest line moved along its path.

        Raises
        ------
        BlockError
            A jump, loop or call cannot be followed.
        ProgramError
            Code program_too_long: more than ``MAX_JUMPS`` jumps, or a loop without end.
        """
        main = self.sections[""]
        self._calls = [_Frame(main, -1)]
        at = main.first
        while at >= 0:
            if self.frame.returns:
                at = self.frame.returns.pop(at, at)
            if at >= self.frame.section.end:
                if len(self._calls) == 1:
                    return
                at = yield from self._back(at)
                continue
            raw = self.lines[at]
            if PLAIN.fullmatch(raw):
                yield at + 1, raw
                at += 1
                at = self._repeated(moved, at)
                continue
            text = statement(raw)
            self.machine.log.pass_line(at + 1)
            head, body = body_of(text)
            if body and (m := _KEYWORD.match(body)):
                word = m[1] or m[2]
                if head.startswith("/"):
                    raise BlockError(f"a / before {word}: the order of the program would depend on a switch of the "
                                     f"machine")
                at = yield from self._flow(word, body, at)
            elif body and (m := _CALL.match(body)) and (m[1] in self.sections or m[1][1:].isdigit()):
                at = self._call(body, at + 1)
            elif len(self._calls) > 1 and (m := _RETURN.search(body)):
                rest = f"{body[:m.start()]} {body[m.end():]}".strip()
                if rest:
                    yield at + 1, rest
                at = yield from self._back(at)
            else:
                yield at + 1, raw
                at += 1
                at = self._repeated(moved, at)

    def _repeated(self, moved: Callable[[], bool], at: int) -> int:
        """The call of MCALL after a line that moved, unless it is a line of that subprogram itself."""
        if not self.modal or not moved() or any(f.modal for f in self._calls):
            return at
        at = self._call(self.modal, at)
        self.frame.modal = True
        return at

    def _flow(self, word: str, body: str, at: int) -> Steps:
        reader = ValueReader(body, self.variables, len(word))
        if word in ("RET", "M17"):
            if body[len(word):].strip():
                raise BlockError(f"{body[:40]}: {word} with other words, or with a place to return to")
            if len(self._calls) == 1:
                yield at + 1, "M30"
                return len(self.lines)
            return (yield from self._back(at))
        if word == "MCALL":
            return (yield from self._modal(body, at))
        if word in ("PROC", "EXTERN", "ENDPROC"):
            return at + 1
        if word in ("EXTCALL", "PCALL", "ISOCALL", "CALLPATH"):
            raise BlockError(f"{body[:60]}: {word} runs a program that is not in this file",
                             "copy that program into the file as a subprogram (PROC NAME to RET) and call it by name")
        if word == "CALL":
            name = reader.value()
            if not isinstance(name, str) or reader.text[reader.at:].strip():
                raise BlockError(f"{body[:60]}: CALL is followed with the name of a program alone")
            return self._call(re.sub(r"^_N_|_[MS]PF$", "", name.upper().rsplit("/", 1)[-1]), at + 1)
        if word == "GOTOS" and len(self._calls) == 1 and not self._decides():
            log = self.machine.log
            log.note(f"line {at + 1}: GOTOS begins the main program again without end; the proof reads it once")
            log.repeats = at + 1
            yield at + 1, "M30"
            return len(self.lines)
        if word.startswith("GOTO"):
            return self._goto(word, reader, at)
        return self._structure(word, reader, at)

    def _decides(self) -> bool:
        """Whether a line of the main program decides which one is next."""
        main = self.sections[""]
        return any(_DECIDES.search(statement(line)) for line in self.lines[main.first:main.end])

    def _modal(self, body: str, at: int) -> Steps:
        """MCALL of a subprogram is kept here; that of a cycle by the reader of the words."""
        name = body[len("MCALL"):].strip()
        m = _CALL.match(name)
        self.modal = name if m and (m[1] in self.sections or m[1][1:].isdigit()) else ""
        if not self.modal:
            yield at + 1, body
        return at + 1

    def _goto(self, word: str, reader: ValueReader, at: int) -> int:
        reader.skip()
        rest = reader.text[reader.at:].strip()
        if rest[:1] == '"' or self.variables.known(rest):
            name = str(reader.value())
            rest = name.upper()
        first, end = self.frame.section.first, self.frame.section.end
        if word == "GOTOS":
            return self._jump(first, at)
        if not re.fullmatch(r"[A-Z_]{2}[A-Z_0-9]*|N[0-9]+", rest):
            raise BlockError(f"cannot read the destination '{rest[:40]}' of {word}")
        ahead, behind = range(at + 1, end), range(at, first - 1, -1)
        found = self._find(rest, [ahead] if word == "GOTOF" else [behind] if word == "GOTOB" else [ahead, behind])
        if found is None:
            if word == "GOTOC":
                return at + 1
            raise BlockError(f"{word} {rest}: there is no such label in that direction")
        return self._jump(found, at)

    def _find(self, name: str, ranges: Sequence[range]) -> int | None:
        """The line of a label or block number that comes first in one of the ranges."""
        if self._labels is None:
            self._labels = label_lines(self.lines)
        places = self._labels.get(f"N{int(name[1:])}" if name[0] == "N" and name[1:].isdigit() else name, [])
        for lines in ranges:
            found = [k for k in places if k in lines]
            if found:
                return found[0] if lines.step > 0 else found[-1]
        return None

    def _jump(self, to: int, at: int | None = None) -> int:
        """Count a jump, and give where it goes to; ``at`` is the line of a GOTO."""
        self._jumps.add(MAX_JUMPS)
        if at is not None and to <= at:
            calls = [(f.back, f.left, f.repeats, f.returns) for f in self._calls]
            self._jumps.back(at, (self.variables.r, self.variables.frames, self.machine.s, self.modal, calls))
        return to

    def _structure(self, word: str, reader: ValueReader, at: int) -> int:
        if word == "IF":
            holds = reader.number() != 0
            rest = reader.text[reader.at:].strip()
            if m := re.match(r"(GOTO[FBC]?)(?![A-Z_0-9])", rest):
                reader.at = reader.text.index(m[1], reader.at) + len(m[1])
                return self._goto(m[1], reader, at) if holds else at + 1
            if rest:
                raise BlockError(f"'{rest[:40]}' after the condition of IF: only GOTOF, GOTOB, GOTO and GOTOC may "
                                 f"follow")
            pair = self._pair(at)
            return at + 1 if holds else pair.get("ELSE", pair["end"]) + 1
        if word == "CASE":
            return self._case(reader, at)
        if word in ("REPEAT", "REPEATB") and (found := self._repeat(word, reader, at)) is not None:
            return found
        pair = self._pair(at)
        if word == "ELSE":
            return pair["end"] + 1
        if word == "WHILE":
            return at + 1 if reader.number() != 0 else pair["end"] + 1
        if word in ("ENDWHILE", "ENDLOOP"):
            return self._jump(pair["start"] + (word == "ENDLOOP"))
        if word == "UNTIL":
            return at + 1 if reader.number() != 0 else self._jump(pair["start"] + 1)
        if word == "FOR":
            name, index = self._counter(reader)
            reader.need("=")
            self.variables.put(name, index, reader.number())
            return at + 1 if self._counts(reader, name, index) else pair["end"] + 1
        if word == "ENDFOR":
            _, body = body_of(statement(self.lines[pair["start"]]))
            begun = ValueReader(body, self.variables, len("FOR"))
            name, index = self._counter(begun)
            begun.need("=")
            begun.number()
            value = self.variables.read(name, index)
            self.variables.put(name, index, float(value) + 1)
            return self._jump(pair["start"] + 1) if self._counts(begun, name, index) else at + 1
        return at + 1  # ENDIF, LOOP

    def _counter(self, reader: ValueReader) -> tuple[str, tuple[int, ...]]:
        reader.skip()
        m = re.compile(r"[A-Z_][A-Z_0-9]*").match(reader.text, reader.at)
        if m is None:
            raise BlockError("FOR needs a variable")
        reader.at = m.end()
        return m[0], reader.index()

    def _counts(self, reader: ValueReader, name: str, index: tuple[int, ...]) -> bool:
        """Whether the counter of a FOR is not yet past its last value."""
        reader.need("TO")
        last = reader.number()
        return float(self.variables.read(name, index)) <= last

    def _case(self, reader: ValueReader, at: int) -> int:
        wanted = reader.value()
        reader.need("OF")
        while True:
            reader.skip()
            rest = reader.text[reader.at:]
            default = rest.startswith("DEFAULT")
            if not rest:
                return at + 1
            if default:
                reader.at += len("DEFAULT")
            else:
                value = reader.value()
            reader.skip()
            m = re.compile(r"(GOTO[FBC]?)\s+([A-Z_0-9]+)").match(reader.text, reader.at)
            if m is None:
                raise BlockError(f"cannot read '{reader.text[reader.at:reader.at + 40]}' in CASE")
            reader.at = m.end()
            if default or same(value, wanted):
                return self._goto(m[1], ValueReader(f"{m[1]} {m[2]}", self.variables, len(m[1])), at)

    def _repeat(self, word: str, reader: ValueReader, at: int) -> int | None:
        """REPEAT of a stretch between labels; None where it opens a loop that UNTIL closes."""
        frame = self.frame
        rest = reader.text[reader.at:].strip()
        if word == "REPEAT" and not rest:
            return None
        m = re.fullmatch(r"([A-Z_]{2}[A-Z_0-9]*|N[0-9]+)(?:\s+([A-Z_]{2}[A-Z_0-9]*|N[0-9]+))?(?:\s+P\s*=?\s*(.+))?",
                         rest)
        if m is None:
            raise BlockError(f"cannot read '{reader.text[:50]}'")
        if at not in frame.repeats:
            reader.at = len(reader.text) - len(m[3] or "")
            times = reader.number() if m[3] else 1.0
            if times != int(times) or not 0 <= times <= MAX_JUMPS:
                raise BlockError(f"{word} P={times:g} is not a count")
            frame.repeats[at] = int(times)
        first, end = frame.section.first, frame.section.end
        if frame.repeats[at] == 0:
            del frame.repeats[at]
            return at + 1
        frame.repeats[at] -= 1
        start = self._find(m[1], [range(at, first - 1, -1), range(at, end)])
        if start is None:
            raise BlockError(f"{word} {m[1]}: there is no such label in this program")
        if word == "REPEATB":
            last: int | None = start
        elif m[2] or start > at:
            last = self._find(m[2] or "ENDLABEL", [range(start, end)])
        else:
            ends = self._find("ENDLABEL", [range(start, at)])
            last = at - 1 if ends is None else ends
        if last is None:
            raise BlockError(f"{word} {m[1]}: its end {m[2] or 'ENDLABEL'} is not behind it")
        if start <= at <= last:
            raise BlockError(f"{word} {m[1]} repeats a stretch that it stands in")
        frame.returns[last + 1] = at
        return self._jump(start)

    def _pair(self, at: int) -> dict[str, int]:
        """Lines of the other parts of the structure of a line."""
        section = self.frame.section
        if section.first not in self._paired:
            self._paired.add(section.first)
            self._match(section)
        if at not in self.pairs:
            raise BlockError(f"'{body_of(statement(self.lines[at]))[1][:30]}' has no counterpart in this program")
        return self.pairs[at]

    def _match(self, section: Section) -> None:
        open_: list[tuple[str, dict[str, int], int]] = []
        for k in range(section.first, section.end):
            m = _KEYWORD.match(body) if (body := body_of(statement(self.lines[k]))[1]) else None
            word = (m[1] or m[2]) if m else ""
            if word in _OPENS and not (word == "IF" and "GOTO" in body) and not (word == "REPEAT" and body != word):
                open_.append((word, {"start": k}, k))
            elif word == "ELSE":
                if open_ and open_[-1][0] == "IF":
                    open_[-1][1]["ELSE"] = k
            elif word in _OPENS.values() and open_ and _OPENS[open_[-1][0]] == word:
                _, pair, start = open_.pop()
                pair["end"] = k
                for line in {start, k, pair.get("ELSE", k)}:
                    self.pairs[line] = pair

    def _call(self, body: str, back: int) -> int:
        """Enter a subprogram of the file; ``back`` is the line after the call."""
        m = _CALL.match(body)
        name = m[1] if m else body
        section = self.sections.get(name)
        if section is None or section is self.sections[""]:
            raise BlockError(f"the subprogram {name[:40]} is not in this file",
                             f"copy it into the file, from PROC {name[:40]} to RET")
        if len(self._calls) > MAX_CALLS:
            raise BlockError(f"more than {MAX_CALLS} nested calls; the control runs no more")
        reader = ValueReader(body, self.variables, len(name))
        given = self._arguments(reader) if section.parameters or reader.takes("(") else []
        times = 1.0
        if reader.takes("P"):
            reader.takes("=")
            times = reader.number()
        if reader.text[reader.at:].strip():
            raise BlockError(f"'{reader.text[reader.at:].strip()[:40]}' after the call of {name}: give it its own "
                             f"block")
        if times != int(times) or not 0 <= times <= 9999:
            raise BlockError(f"P{times:g} is not a count of repeats")
        frame = _Frame(section, back, int(times), saved=self.modes() if section.saves else None)
        if times == 0:
            return back
        scope: dict[str, tuple[str, Value]] = {}
        outs = []
        for k, (kind, parameter, default, changes) in enumerate(section.parameters):
            value, source = given[k] if k < len(given) else (None, None)
            if value is None:
                value = ValueReader(default, self.variables).value() if default else "" if kind == "STRING" else 0.0
            scope[parameter] = (kind, value)
            if changes and source is not None:
                outs.append((parameter, *source))
        if len(given) > len(section.parameters):
            raise BlockError(f"{name} takes {len(section.parameters)} values, not {len(given)}")
        frame.given = tuple(outs)
        self._calls.append(frame)
        self.variables.frames.append({})
        self.variables.types.append({})
        for parameter, (kind, value) in scope.items():
            self.variables.define(kind, parameter, value)
        return self._jump(section.first)

    def _arguments(self, reader: ValueReader) -> list[tuple[Value | None, tuple[str, tuple[int, ...]] | None]]:
        """Values between brackets, and the variable each comes from."""
        if reader.text[reader.at - 1:reader.at] != "(" and not reader.takes("("):
            return []
        out: list[tuple[Value | None, tuple[str, tuple[int, ...]] | None]] = []
        if reader.takes(")"):
            return out
        while True:
            reader.skip()
            if reader.text[reader.at:reader.at + 1] in (",", ")"):
                out.append((None, None))
            else:
                m = re.compile(r"([A-Z_][A-Z_0-9]*)\s*[,)]").match(reader.text, reader.at)
                out.append((reader.value(), (m[1], ()) if m else None))
            if reader.takes(")"):
                return out
            reader.need(",")

    def _back(self, at: int) -> Steps:
        """Leave the running subprogram, or run it again."""
        frame = self.frame
        frame.left -= 1
        if frame.left > 0:
            frame.repeats.clear()
            frame.returns.clear()
            return self._jump(frame.section.first)
        values = [(self.variables.read(name), target, index) for name, target, index in frame.given]
        self._calls.pop()
        self.variables.frames.pop()
        self.variables.types.pop()
        for value, target, index in values:
            self.variables.put(target, index, value)
        if frame.saved is not None:
            yield min(at, len(self.lines) - 1) + 1, frame.saved()
        return frame.back


__all__ = ["SiemensFlow"]
