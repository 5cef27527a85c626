"""Siemens 840D: names as well as letters, = before a value, ';' before a comment, cycles with arguments.

Only the length of the first cutting edge, D1, is known; a new tool has it at once (machine data 20270). A tool's name
is its id in the setup. R parameters, variables, subprograms, loops and jumps are followed where the file has them
(``siemens_flow``). TRAORI and TRAFOOF may switch the work offset off (G500): a move after one of them is refused until
the program states a work offset again, unless it suppresses all frames (SUPA, G53). CYCLE800 with direction 0, while
TRAORI is on, turns coordinates and moves no axis. With direction -1 or 1 it turns the axes, and the reader keeps the
tip in the setup frame from there on. The coordinates are the setup frame turned about its X, then the new Y and new Z
(mode 57).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

from verify.gcode.dialects.base import ZEROS, BlockError, Machine
from verify.gcode.dialects.orientation import needed
from verify.gcode.dialects.siemens.siemens_arguments import DRILLS, PATTERNS
from verify.gcode.dialects.siemens.siemens_calls import SiemensCalls
from verify.gcode.dialects.siemens.siemens_expressions import MAX_ELEMENTS, Value, ValueReader, Variables, arguments
from verify.gcode.dialects.siemens.siemens_flow import SiemensFlow
from verify.gcode.dialects.siemens.siemens_moves import CURVES, Line
from verify.gcode.dialects.siemens.siemens_sections import LABEL, NUMBERED, PLAIN, statement
from verify.gcode.dialects.siemens.siemens_words import (
    COMPRESSORS,
    CONTOUR_FEED,
    FEEDS,
    IDLE,
    IDLE_CALLS,
    IDLE_CODES,
    IDLE_VALUES,
    LENGTH_BY_PLANE,
    MOVES,
    NOT_FOLLOWED,
    REFUSED,
    SAME,
    SHARP_STYLE,
    SIEMENS_STYLE,
    SMOOTHS,
    UNBOUNDED,
    UNITS,
    VALUES,
    check_limit,
    factor_of_feeds,
)
from verify.gcode.flow.input_increment import RESOLUTION, counted, is_fine
from verify.gcode.machine_words import SIEMENS_M

_MARKS = re.compile(r"^\s*(?:N[0-9]+\s+)?[^;(\n]*\b(?:TRAORI|TRAFOOF|CYCLE8[0-9]{1,2}\s*\(|SUPA|G710|G700|G641|G642"
                    r"|G645|COMPCAD|COMPOF|FFWON|ORIAXES|ORIMKS|ORIWKS|MCALL|WORKPIECE\s*\(|MSG\s*\(|G[123]\b.*\bCR=|A?TRANS\s+[XYZ]"
                    r"|A?ROT\s+(?:[XYZ]|RPL=)|PROC\s+[A-Z]|R[0-9]+=|GOTO[FB]\s)|^%_N_|^;\$PATH", re.MULTILINE)
_LETTER = re.compile(r"([A-Z])([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?!_)")
_NAME = re.compile(r"\$?[A-Z_][A-Z_0-9]*")
_DEF = re.compile(r"DEF\s+(?:(?:NCK|CHAN)\s+)?(?:SYNR\s+|SYNW\s+|SYNRW\s+)?"
                  r"(REAL|INT|BOOL|CHAR|STRING\s*\[\s*[0-9]+\s*\])\s+")
_FINE = re.compile(r"\.[0-9]{3}0*[1-9]")
_HARMLESS = re.compile(r"\$(?:AC_TIMER|AC_MARKER|AC_PARAM|A_OUT|A_DB[BWDR]|A_DLB|AC_SYNA)")
"""Values of the control that move nothing: timers, counters and outputs."""
_FRAMES = frozenset({"TRANS", "ATRANS", "ROT", "AROT", "MIRROR", "AMIRROR", "SCALE", "ASCALE"})
_ORIENTS = {"ORIWKS": (25, True), "ORIMKS": (25, False), "ORIVECT": (51, True), "ORIPLANE": (51, True),
            "ORIAXES": (51, False)}
"""Group of each word, and whether it means great circles. Machine data 21104 decide which of the groups counts."""
_M = {n: n for n in (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 30)} | {19: 5, 70: 5}  # a spindle that takes a position stands


def is_siemens(text: str) -> bool:
    """Whether a text has words that only Siemens has."""
    return bool(_MARKS.search(text.upper()))


class SiemensReader(SiemensCalls):
    """840D sl, 828D and ONE."""

    home_from, gives_up_length = 1, True
    looks_ahead = 3.0
    increment = RESOLUTION
    contour_feed = True  # CFC, as delivered (MD20150)
    style, refused_m = SIEMENS_STYLE, SIEMENS_M

    def __init__(self) -> None:
        super().__init__()
        self.unbounded = True
        self.tool = self.selected = 0
        self.edge = 1
        self.lost = ""  # the word after which the program has not stated a work offset
        self.moved = False
        self.ways: dict[int, bool] = {}  # by group of words, whether the last one means great circles
        self.variables = Variables(self._served)

    def order(self, lines: Sequence[str], machine: Machine) -> Iterator[tuple[int, str]]:
        """Lines in the order they run, as ``SiemensFlow.run`` has it; raises as that does."""
        self.machine = machine
        self.tool = self.selected = machine.s.tool
        flow = SiemensFlow(lines, self.variables, machine, self._modes)
        for number, raw in flow.run(lambda: self.moved):
            self.number = number
            yield number, raw

    def _served(self, name: str, index: str) -> Value:
        """A value of the control."""
        if name in ("$AA_IW", "$P_EP", "$AA_IWP") and index in ("X", "Y", "Z"):
            place = self.here()["XYZ".index(index)]
            if place == place:
                if is_fine(place, counted("X", place, (), False), "X", False):
                    self.note_fine()
                return place / self.unit
            raise BlockError(f"{name}[{index}] is unknown because the program has not stated {index}")
        if name in ("$P_SEARCH", "$P_SEARCHL", "$P_SIM", "$P_ISTEST"):
            return 0.0  # the proof is that of a run on the machine, from the first block
        if name in ("$P_TOOLNO", "$TC_MPP6"):
            return float(self.tool)
        if name == "$P_TOOLR" and self.tool in self.machine.radii:
            return self.machine.radii[self.tool] / self.unit
        if name == "$PI":
            return math.pi
        raise BlockError(f"{name}{f'[{index}]' if index else ''} is a value of the control that the proof cannot know",
                         "write the number instead")

    def blocks(self, raw: str) -> list[str | tuple[int, str]]:
        """A plain straight move unchanged; every other line word by word.

        Raises
        ------
        BlockError
            The line cannot be read, or could be read in two ways.
        """
        self.moved = False
        if PLAIN.fullmatch(raw) and self._is_plain() and not self._counts(raw):
            self.note_place()
            self.moved = "X" in raw or "Y" in raw or "Z" in raw
            if (at := raw.find("G")) >= 0:
                self.motion = int(raw[at + 1])
            return [raw]
        if raw.startswith("%"):
            return []
        text = statement(raw)
        skipped = text.startswith("/")
        if skipped:
            text = re.sub(r"^/[0-9]?\s*", "", text)
        if label := LABEL.match(text):
            text = text[label.end():].strip()
        elif number := NUMBERED.match(text):
            text = text[number.end():].strip()
        if not text:
            return []
        if text.startswith("DEF "):
            return list(self._definition(text))
        out = self._words(text)
        return [f"/{b}" if isinstance(b, str) else b for b in out] if skipped else out

    def _counts(self, raw: str) -> bool:
        """Whether the numbers of a straight move may be others on a control that counts in its resolution."""
        return (self.machine.counts or self.relative) and (self.unit != 1.0 or _FINE.search(raw) is not None)

    def _is_plain(self) -> bool:
        """Whether a straight move needs nothing but its words now."""
        return (not self.lost and self.frame is None and not self.cornering and self.motion not in CURVES
                and self.cycle is None and not self.shifted
                and self.machine.s.motion in (self.motion, None) and self.circle is not True)

    def _definition(self, text: str) -> list[str]:
        """DEF: new variables, with their first values."""
        m = _DEF.match(text)
        if m is None:
            raise BlockError(f"cannot read '{text[:50]}': variables of REAL, INT, BOOL, CHAR and STRING are followed")
        kind = m[1].split("[")[0].strip()
        reader = ValueReader(text, self.variables, m.end())
        while True:
            reader.skip()
            name = _NAME.match(text, reader.at)
            if name is None:
                raise BlockError(f"cannot read the name of a variable at '{text[reader.at:reader.at + 30]}'")
            reader.at = name.end()
            self._define(kind, name[0], reader)
            if not reader.takes(","):
                break
        if text[reader.at:].strip():
            raise BlockError(f"cannot read '{text[reader.at:].strip()[:40]}'")
        return []

    def _define(self, kind: str, name: str, reader: ValueReader) -> None:
        sizes = reader.index()
        nothing: Value = "" if kind == "STRING" else 0.0
        if not sizes:
            self.variables.define(kind, name, reader.value(2) if reader.takes("=") else nothing)
            return
        if min(sizes) < 1 or len(sizes) > 3 or math.prod(sizes) > MAX_ELEMENTS:
            raise BlockError(f"{name}{list(sizes)} is an array that the reader does not hold")
        places: list[tuple[int, ...]] = [()]
        for size in sizes:
            places = [(*p, k) for p in places for k in range(size)]
        held = dict.fromkeys(places, nothing)
        if reader.takes("="):
            bracketed = reader.takes("SET(") or reader.takes("(")
            for place in places:
                held[place] = reader.value(2)
                if not reader.takes(","):
                    break
            if bracketed:
                reader.need(")")
        self.variables.define(kind, name, held)

    def _words(self, text: str) -> list[str | tuple[int, str]]:
        line = Line()
        reader = ValueReader(text, self.variables)
        if text.startswith("MCALL"):
            line.modal, reader.at = True, len("MCALL")
            self.cycle = None
        others = ""  # what is not the setting of a variable
        while True:
            reader.skip()
            if reader.at >= len(text):
                break
            begin, sets = reader.at, len(line.set_here)
            self._word(reader, line)
            others += " " if len(line.set_here) > sets else text[begin:reader.at]
        _check_order(line, others)
        if line.change:  # T and D may stand behind M6
            stated = [w for w in line.out if w.startswith(("G43 H", "G49"))]
            line.out = [w for w in line.out if w not in stated]
            self.tool, self.edge = self.selected, self.edge if stated else 1
            self.shifted.add("Z")
            self.forget()
            line.after.insert(0, f"G43 H{self.tool}" if self.edge else "G49")
        if line.frame:
            return list(self._framed(line))
        return self._block(line)

    def _word(self, reader: ValueReader, line: Line) -> None:
        text, at = reader.text, reader.at
        if name := _NAME.match(text, at):
            behind = text[name.end():].lstrip()
            if behind.startswith("("):
                reader.at = text.index("(", name.end()) + 1
                return self._call(name[0], arguments(reader), line)
            if behind.startswith("=") and not behind.startswith("=="):
                reader.at = text.index("=", name.end()) + 1
                return self._value(name[0], reader, line)
            if behind.startswith("[") and (m := re.compile(r"[^=\]]*\]\s*=(?!=)").match(text,
                                                                                        text.index("[",
                                                                                                   name.end()) + 1)):
                return self._indexed(name[0], reader, line, name.end(), m.end())
        if (m := _LETTER.match(text, at)) and not (name and self._is_word(name[0])):
            reader.at = m.end()
            return self._letter(m[1], m[2], line)
        if name is None:
            raise BlockError(f"cannot read '{text[at:at + 40].strip()}'")
        reader.at = name.end()
        return self._name(name[0], line)

    def _is_word(self, name: str) -> bool:
        return any(name in words for words in (IDLE, FEEDS, SMOOTHS, REFUSED, COMPRESSORS, _ORIENTS))

    def _indexed(self, name: str, reader: ValueReader, line: Line, behind: int, end: int) -> None:
        """NAME[...]= : an element of an array, a value of the control, or a limit of an axis."""
        if name.startswith("$"):
            return self._system(name, reader, end)
        if name in ("SPOS", "SPOSA"):
            reader.at = behind
            spindle = reader.index()
            reader.need("=")
            self._stood(reader)
            line.out += ["M5"] if spindle == (1,) else []
            return None
        if name in IDLE_VALUES:
            reader.at = end
            return check_limit(name, reader.text[behind:end], reader.value())
        if name in REFUSED:
            raise BlockError(f"{name} ({REFUSED[name]}) is not followed")
        reader.at = behind
        index = reader.index()
        reader.need("=")
        return self._set(name, index, reader, line)

    def _set(self, name: str, index: tuple[int, ...], reader: ValueReader, line: Line) -> None:
        self.variables.put(name, index, reader.value())
        line.set_here.append(name)

    def _system(self, name: str, reader: ValueReader, at: int) -> None:
        if not _HARMLESS.match(name):
            raise BlockError(f"{name} is set: a value of the control whose effect on moves the proof does not know")
        reader.at = at
        reader.value()

    def _letter(self, letter: str, written: str, line: Line) -> None:
        number = float(written)
        if letter in "XYZABC":
            return self._place(letter, number, "", line)
        if letter in "IJK":
            line.centre[letter] = (number, "")
            return None
        if letter in "FS":
            if letter in line.values:
                raise BlockError(f"the word {letter} appears twice")
            line.values[letter] = self._held(letter, number, line)
            return None
        if letter == "H" or letter == "N":
            return None
        if letter not in "GMTD" or number != int(number) or number < 0:
            raise BlockError(f"unknown word {letter}{written}")
        n = int(number)
        if letter == "G":
            return self._code(n, line)
        if letter == "M":
            return self._m(n, line)
        if letter == "T":
            return self._select(n, line)
        return self._edge(n, line)

    def _held(self, letter: str, number: float, line: Line) -> float:
        """The number of an F or S word; a speed is held within G25 and G26, but for words that are no speed."""
        return number if letter == "F" or {4, 25, 26} & set(line.codes) else self.held_speed(number)

    def _place(self, letter: str, number: float, kind: str, line: Line) -> None:
        if letter in line.places:
            raise BlockError(f"the word {letter} appears twice")
        line.places[letter] = (number, kind)

    def _select(self, n: int, line: Line) -> None:
        self.selected = n
        line.out.append(f"T{n}")

    def _edge(self, n: int, line: Line) -> None:
        if n > 1:
            raise BlockError(f"D{n}: only the length of the first cutting edge (D1) is known")
        self.edge = n
        line.out.append(f"G43 H{self.tool}" if n else "G49")

    def _m(self, n: int, line: Line) -> None:
        if n in _M:
            line.out.append(f"M{_M[n]}")
            line.change |= n == 6
        elif not 40 <= n <= 45:  # gears
            self.function(n)

    def _code(self, n: int, line: Line) -> None:
        line.codes.append(n)
        if n in (0, 1, 2, 3):
            self.motion = n
        if n in (18, 19):
            self.leave_open(LENGTH_BY_PLANE)
        if n in SAME:
            line.out.append(f"G{n}")
        elif n in (41, 42):
            line.out.append(self._compensated(n))
        elif n in (450, 451):
            self.style = SIEMENS_STYLE if n == 450 else SHARP_STYLE
        elif n == 70:
            raise BlockError("G70 counts coordinates in inches, and F in the basic unit of the machine",
                             "write G700, which counts F in inches too")
        elif n in UNITS:
            line.out.append(f"G{UNITS[n]}")
        elif 505 <= n <= 599:
            line.out.append(self.zero(n - 500, f"G{n}"))
        elif n == 60:
            self.bound(True)
            line.out.append("G61")
        elif n == 153:
            line.out.append("G53")
        elif n == 500:
            self.lost = "G500"
        elif n in MOVES:
            raise BlockError(f"G{n} ({MOVES[n]}) is not followed")
        elif n not in IDLE_CODES and n not in UNBOUNDED and n not in (4, 25, 26, 63, 74, 75, 110, 111, 112, 331, 332,
                                                                      641):
            raise BlockError(f"unknown word G{n}")

    def _value(self, name: str, reader: ValueReader, line: Line) -> None:
        """NAME = value: a word of the block, a parameter or a variable."""
        if name in ("T", "T1") and not self.variables.known(name):
            return self._tool(reader.value(), line)
        if name.startswith("$"):
            return self._system(name, reader, reader.at)
        if re.fullmatch(r"R[0-9]+", name) or self.variables.known(name):
            return self._set(name, (), reader, line)
        if name in REFUSED:
            raise BlockError(f"{name}= ({REFUSED[name]}) is not followed")
        if name == "OVR":
            self.machine.s.override = factor_of_feeds(reader.number())
            return None
        if name == "DISC" or name in IDLE_VALUES or re.fullmatch(r"H[0-9]+", name):
            value = self._stood(reader) if name in ("SPOS", "SPOSA") else reader.value()
            check_limit(name, "", value)
            if name == "DISC" and value:
                raise BlockError("DISC= above 0 (other outside corners of cutter radius compensation) is not followed")
            if name in ("SPOS", "SPOSA"):
                line.out.append("M5")
            return None
        kind = reader.placed()
        number = reader.number()
        if kind:
            reader.need(")")
        return self._named(name, number, kind, line)

    def _stood(self, reader: ValueReader) -> Value:
        """The angle at which the spindle is to stand, with or without DC( ), ACP( ) and the like."""
        placed, angle = reader.placed(), reader.value()
        if placed:
            reader.need(")")
        return angle

    def _tool(self, value: Value, line: Line) -> None:
        """T = number or name: the name is an id of the setup, or a number."""
        if isinstance(value, float):
            if value != int(value) or value < 0:
                raise BlockError(f"T={value:g} is not a tool")
            return self._select(int(value), line)
        names = {k.upper(): v for k, v in self.names.items()}
        if value in self.names or value.upper() in names:
            return self._select(self.names.get(value, names.get(value.upper(), 0)), line)
        number = value.upper().removeprefix("T")
        if not number.isdigit():
            raise BlockError(f'T="{value}": no tool of the setup has this id',
                             f"give a tool of the setup the id {value}" + (
                                 f" (it has {', '.join(sorted(self.names)[:8])})" if self.names else ""))
        return self._select(int(number), line)

    def _named(self, name: str, number: float, kind: str, line: Line) -> None:
        if name in ("X", "Y", "Z", "A", "B", "C"):
            return self._place(name, number, kind, line)
        if name in ("I", "J", "K"):
            line.centre[name] = (number, kind)
        elif name in ("F", "S", "S1"):
            line.values[name[0]] = self._held(name[0], number, line)
        elif name in ("M", "M1") and number == int(number) and number >= 0:
            self._m(int(number), line)
        elif name == "G" and number == int(number) and number >= 0:
            self._code(int(number), line)
        elif name == "D" and number == int(number) and number >= 0:
            self._edge(int(number), line)
        elif name in VALUES:
            line.values[name], line.kinds[name] = number, kind
        else:
            raise BlockError(f"unknown word {name}={number:g}")
        return None

    def _name(self, word: str, line: Line) -> None:
        if word in _ORIENTS:
            self._orients(word)
        elif word in _FRAMES:
            if line.frame or line.places or line.codes:
                raise BlockError(f"{word} with other words: a frame needs its own block")
            line.frame = word
        elif word in COMPRESSORS:
            line.values["COMPRESS"] = 1.0
        elif word in ("CUT2D", "CUT2DF"):
            self.in_frame = word == "CUT2DF"
        elif word in SMOOTHS:
            name, begins = SMOOTHS[word]
            (self.smooths.add if begins else self.smooths.discard)(name)
        elif word in FEEDS:
            self.contour_feed = word == CONTOUR_FEED
        elif word == "RTLIOF":
            self.own_speed = True
        elif word in CURVES:
            self.motion = word
        elif word in ("TRAORI", "TRAFOOF"):
            self._transform(word, line)
        elif word == "SUPA":
            line.out.append("G53")
        elif word in REFUSED:
            raise BlockError(f"{word} ({REFUSED[word]}) is not followed")
        elif word not in IDLE and word not in IDLE_CALLS:
            raise BlockError(f"unknown word {word[:40]}" + (
                ": it is no subprogram of this file" if len(word) > 2 and not line.out else ""))

    def _orients(self, word: str) -> None:
        """ORIMKS and ORIAXES turn the axes evenly, ORIWKS and ORIVECT the tool axis along a great circle."""
        group, self.circle = _ORIENTS[word]
        self.ways[group] = self.circle

    def open_way(self) -> str:
        """As ``OrientedMoves.open_way``: the control has a word of each group in force, whatever the program says."""
        if len(self.ways) == 2 and set(self.ways.values()) == {self.circle}:
            return ""
        return "ORIWKS with ORIVECT, or ORIMKS with ORIAXES, behind TRAORI"

    def _transform(self, word: str, line: Line) -> None:
        if self.programmed is not None:
            raise BlockError(f"{word} while TRANS, ROT, MIRROR or SCALE is in force: end it before")
        if self.swivel is not None and word == "TRAFOOF":
            raise BlockError("M429 in a plane of CYCLE800" if not self.swung else "TRAFOOF in a plane of CYCLE800",
                             "end the plane with CYCLE800() before")
        if word == "TRAORI" and self.swung:
            raise BlockError("TRAORI in a plane of CYCLE800", "end the plane with CYCLE800() before")
        if word == "TRAORI" and self.loose:
            self.notes.append(self.loose)
        self.lost, self.tcp = word, word == "TRAORI"
        self.forget()
        if self.tcp:
            needed(self.machine.machine, "TRAORI")
        if self.machine.machine is not None:
            line.out.append("M428" if self.tcp else "M429")

    def _call(self, name: str, parts: list[str], line: Line) -> None:
        if name == "TRAORI" and parts in ([""], ["1"]):
            return self._name("TRAORI", line)
        if name == "CYCLE800":
            line.after += self.swivelled(parts, self._number)
        elif name in DRILLS:
            self._drill(self._called(name, parts), line)
        elif name == "FGROUP" and parts != [""] and not {"X", "Y", "Z"} <= {p.strip() for p in parts}:
            raise BlockError("FGROUP( ) without X, Y and Z: F does not count along the whole path",
                             "name X, Y and Z in it")
        elif name == "SETMS" and parts not in ([""], ["1"]):
            raise BlockError(f"SETMS({','.join(parts)[:20]}): another spindle becomes the master, and S and M3 turn "
                             "that one")
        elif name == "SETAL":
            raise BlockError(f"SETAL({','.join(parts)[:20]}): the program stops here with an alarm")
        elif name in PATTERNS:
            self._row(self._called(name, parts), line)
        elif name == "CYCLE832":
            line.out += self._tolerant(parts)
        elif name in NOT_FOLLOWED:
            raise BlockError(f"{name}( ) ({NOT_FOLLOWED[name]}) is not followed",
                             "let the post write its moves (G1, G2, G3) instead of the cycle")
        elif name in REFUSED:
            raise BlockError(f"{name}( ) ({REFUSED[name]}) is not followed")
        elif name in ("M1", "M"):
            self._m(int(self._number(parts[0])), line)
        elif name not in IDLE_CALLS:
            raise BlockError(f"{name[:40]}( ): unknown cycle or function, and no subprogram of this file")
        return None

    def _check_context(self, line: Line) -> None:
        """Refuse names whose value nothing in the block uses."""
        allowed = {"RPL": False, **dict.fromkeys(("CR", "TURN", "AR"), self.motion in (2, 3))}
        allowed |= dict.fromkeys(("I1", "J1", "K1"), self.motion == "CIP")
        fixed = not {74, 75}.isdisjoint(line.codes)
        allowed |= dict.fromkeys(("X1", "Y1", "Z1", "A1", "B1", "C1", "FP"), fixed)
        for name in line.values:
            if not allowed.get(name, True):
                raise BlockError(f"{name}= is used by no word of its block")
        if line.centre and self.motion not in (2, 3) and not {63, 331, 332} & set(line.codes):
            raise BlockError(f"{next(iter(line.centre))} without an arc (G2, G3)")

    def _framed(self, line: Line) -> list[str]:
        """A block of TRANS, ROT, MIRROR or SCALE."""
        self.unheld(line.frame)
        if line.out or line.codes or line.centre or set(line.values) - {"RPL"} or any(
                k not in "XYZ" or kind for k, (_, kind) in line.places.items()):
            raise BlockError(f"{line.frame} with other words than X, Y, Z or RPL: it needs its own block")
        self.program_frame(line.frame, {k: v for k, (v, _) in line.places.items()}, line.values)
        return []

    def _block(self, line: Line) -> list[str | tuple[int, str]]:
        codes = line.codes
        if any(54 <= n <= 57 or 505 <= n <= 599 for n in codes):
            self.lost = ""
        self.relative = self.relative if 90 not in codes and 91 not in codes else 91 in codes
        self.count(line)
        self._check_context(line)
        special = self._special(line)
        if special is not None:
            self.unheld("G4, a pole, a fixed point or tapping")
            return list(special)
        moves = bool(line.places) or bool(line.values.keys() & {"AP", "RP", "A3", "B3", "C3"}) or (
            self.motion in (2, 3) and bool(line.centre))
        if self.lost and "G53" not in line.out and moves:
            raise BlockError(f"a move after {self.lost} without a work offset: it may be off (G500)",
                             "state the work offset (G54 to G57, G505 and up) before the move")
        line.out += self._path(line)
        self.feed_of_block(line)
        if not moves:
            self.corner_of({k: v for k, v in line.values.items() if k in ("RNDM", "FRCM")})
            head = [*line.out, *self._rates(line)]
            ends = self.flushed() if {"M2", "M30"} & set(line.out) or self.changes_plane(codes) else []
            if line.after or any(w[0] in "TG" for w in line.out):
                self.unheld("another word")
            return [*line.before, *ends, *([" ".join(head)] if head else []), *line.after]
        if "G53" in line.out:
            self.forget()
        self.note_place()
        self.moved = not {"X", "Y", "Z"}.isdisjoint(line.places) or not {"AP", "RP"}.isdisjoint(line.values)
        blocks: list[str | tuple[int, str]] = [*line.before, *self._move(line), *line.after]
        if self.cycle is not None and self.moved and "G53" not in line.out:
            blocks += self._cycle_there(line)
        return blocks


def _check_order(line: Line, others: str) -> None:
    """Refuse a block that sets a variable and reads it in a word of another kind, such as X=R1.

    Whether the word takes the old value or the new one is not stated; SINUMERIK 802D asks for blocks of their own.
    """
    bare = re.sub(r'"[^"]*"', "", others)  # texts, as of MSG, read nothing
    for name in line.set_here:
        if re.search(rf"(?<![A-Z_0-9$]){re.escape(name)}(?![A-Z_0-9])", bare):
            raise BlockError(f"{name} is set and read in one block: the move may take the old or the new value",
                             f"set {name} in a block of its own before")


__all__ = ["ZEROS", "SiemensReader", "is_siemens"]
