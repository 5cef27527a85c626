"""Fanuc: nearly the words of the reader itself.

Differences: further work offsets are G54.1 P, fast contouring is G05.1 Q, G04 and P of cycles count ms, Q without a
decimal point counts thousandths, ';' ends a block. X10 without a decimal point is 10 mm or 0.010 mm, depending on a
parameter. Subprograms and macros are followed by ``verify.gcode.flow.macro_flow``.

Words that change speed, smoothing, coolant or devices of the machine move nothing and are left out: they are listed
here. What holds for other M words is in ``verify.gcode.machine_words``. A word that moves or cuts and is not followed
is refused by its name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence

from verify.assumptions import Assumed, AssumedKind
from verify.gcode.block_words import FURTHER, bare
from verify.gcode.dialects.base import NUMBER, BlockError, Machine
from verify.gcode.dialects.fanuc_planes import FanucPlanes
from verify.gcode.flow.input_increment import INPUT, counted, is_fine, without_fine_digits
from verify.gcode.flow.macro_flow import MacroFlow, has_macros
from verify.gcode.machine_words import FANUC_M

_PLAIN = re.compile(r"(?:N[0-9]+ ?)?(?:G0?[01] ?)?(?:[XYZABC][+-]?(?:[0-9]*\.[0-9]*|0) ?)*(?:F[0-9]+\.[0-9]* ?)?\r?")
_WORD = re.compile(rf"([A-Z])({NUMBER})")
_ADDS = re.compile(r"G\s*0*9([12])(?![0-9]|\.0*[1-9])", re.IGNORECASE)
"""G91 and G92."""
_NAME = re.compile(r"[O:](?:[0-9]+|<[^<>]*>)?(?:<[^<>]*>)?|<[^<>]*>")
_CORNER = re.compile(r",[RC][-+.0-9]*")
LENGTH_BY_PLANE = Assumed(AssumedKind.LENGTH_AXIS, "Z in the planes G18 and G19 too", "where parameter 5001#1 is 1, "
                          "G43 moves the axis across the plane by the length of the tool, and Z without it",
                          "program G17 before G43")
_PAIR = re.compile(r"\([^()]*\)")
_CHANGES = re.compile(r"[XYZABCGTFHDS]|M0*(?:2|3|4|5|6|19|29|30)(?![0-9.])")
"""Words that move the tool, or that a later move depends on; stops and coolant are not among them."""
_TAPE = re.compile(r"%[O:]?[0-9]*")
_DELETED = re.compile(r"(N[0-9]+)?/[1-9]?(?=[A-Z]|$)")
_FOREIGN: dict[str, frozenset[float]] = {
    "M": frozenset({70, 71, 72, 73}), "G": frozenset({59.1, 59.2, 59.3, 92.2, 92.3})}
ROUNDING = "parameters of the machine set how far the control rounds corners: the error bound does not include it"
_PLACES = "XYZABCIJKRUVW"
ORIENTS = 19
"""The M word that stops the spindle at an angle; Haas gives the angle as P or R."""
_AFTER_TAPS = frozenset({0.0, 1.0, 2.0, 3.0, 73.0, 76.0, 80.0, 81.0, 82.0, 83.0, 85.0, 86.0, 89.0})
_AXES = "XYZABCUVW"
_OWN_DATA: dict[float, Callable[[float], bool]] = {
    5.1: lambda q: q in (2.0, 3.0), 22.0: lambda q: True, 23.0: lambda q: False, 26.0: lambda q: False}
"""Words that move nothing, and whether coordinates are their data, by Q: axes to smooth, limits of a stroke check."""
_TABLES = {20.0: "an offset of G54.1", 50.0: "parameters of the control", 52.0: "parameters of the control"}
_NO_P: frozenset[float] = frozenset({0, 1, 2, 3, 17, 18, 19, 20, 21, 40, 41, 42, 43, 49, 54, 55, 56, 57, 58, 59, 61, 64,
                                     80, 90, 91, 93, 94, 95, 98, 99})
"""G words that take no P: in a block with them it is that of the M word."""
_KNOWN_M = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, ORIENTS, 30})
IDLE_G: frozenset[float] = frozenset({9, 11, 13.1, 22, 23, 25, 26, 40.1, 50.2, 62, 63, 67, 69.1, 94.1, 97, 113})
"""G words without effect on a move: exact stop, end of G10, modes of taps and cutting, stroke checks, ends of modes."""
_CONTOURING = frozenset({0.0, 1.0, 2.0, 3.0, 10000.0})
"""P of G05 that set how fast contours run; from P10001 on it calls a machining cycle."""
SMOOTHING: frozenset[float] = frozenset({5, 5.1, 5.4, 8, 64, 61.1})
REFUSED: dict[float, str] = {
    2.2: "an involute", 3.2: "an involute", 2.3: "an exponential", 3.3: "an exponential", 2.4: "an arc in space",
    3.4: "an arc in space", 6.2: "a spline", 7.1: "cylindrical interpolation", 10.6: "a retract",
    12: "a circular pocket", 12.1: "polar interpolation", 13: "a circular pocket",
    27: "a check of the reference point", 29: "a return from the reference point", 31: "probing", 33: "threading",
    36: "probing", 37: "probing", 41.1: "normal direction control", 42.1: "normal direction control",
    41.2: "compensation in space",
    42.2: "compensation in space", 45: "a tool offset", 46: "a tool offset", 47: "a tool offset", 48: "a tool offset",
    60: "positioning from one side", 65: "a macro call", 66: "a macro call", 66.1: "a macro call",
    53.6: "a turn of the tool", 68.3: "a tilted plane", 68.4: "a tilted plane", 70: "a pattern of holes",
    71: "a pattern of holes", 72: "a pattern of holes", 77: "back boring", 87: "back boring",
    88: "boring with a manual retract", 96: "constant surface speed"}
"""G words that move or cut and are not followed, and what they are."""


class FanucReader(FanucPlanes):
    """Fanuc 0i, 30i and relatives.

    further : G word of the work offsets after G59; counts : letters of whole numbers in a drilling cycle
    refused_g : G words that are refused, and what they are
    length_words : G words that say whether the length offset holds
    rigid   : M word that begins rigid tapping; None: every tapping cycle is rigid
    """

    title = "Fanuc"
    further = 54.1
    counts = "K"
    local_calls = False
    bounds_path = False
    further_words = FURTHER
    refused_m = FANUC_M
    refused_g: Mapping[float, str] = REFUSED
    repeats = "KL"
    rigid: int | None = 29
    looks_ahead = 1.0
    increment = INPUT
    home_from, gives_up_length = 0, True
    length_words: tuple[float, ...] = (43, 43.4, 43.5, 49)

    def __init__(self) -> None:
        super().__init__()
        self.unbounded = True
        self.polar = False
        self.hole = False
        self.exact = self.limited = False
        self.synchronous = self.taps = False
        self.drops = ""

    def order(self, lines: Sequence[str], machine: Machine) -> Iterator[tuple[int, str]]:
        """As in the base class; ``verify.gcode.flow.macro_flow`` follows subprograms, macros, jumps and variables."""
        self.machine = machine
        lines = self._without_leader(lines)
        run = (MacroFlow(lines, machine, self.local_calls, self._taken).lines_run() if has_macros(lines)
               else super().order(lines, machine))
        return self._short(run) if machine.counts else run

    def _short(self, run: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        """The lines without the digits that the control drops (``verify.gcode.flow.input_increment``)."""
        for number, raw in run:
            yield number, without_fine_digits(raw, self._inch, self.vectors)

    def _taken(self, letter: str, number: float, codes: frozenset[float]) -> float:
        """The number that this reading takes for a word of a variable; notes the line where a control takes another."""
        short = counted(letter, number, codes, self._inch, self.vectors)
        if self.machine.counts:
            return short
        if not self.machine.fine_line and is_fine(number, short, letter, self._inch):
            self.machine.fine_line = self.machine.log.line
        return number

    @property
    def _inch(self) -> bool:
        return self.machine.s.scale != 1.0

    def _note_fine(self, raw: str) -> None:
        """Note a line in G91 whose digits a control drops, and a shift (G92) from a place that it does not count."""
        if self.machine.fine_line or self.machine.counts:
            return
        words = _ADDS.findall(raw) if "91" in raw or "92" in raw else ()
        adds = (self.machine.s.relative or "1" in words) and without_fine_digits(raw, self._inch, self.vectors) != raw
        if adds or ("2" in words and any(is_fine(at, counted("X", at, (), False), "X", False)
                                         for at in self.machine.here() if at == at)):
            self.machine.fine_line = self.machine.log.line

    def _without_leader(self, lines: Sequence[str]) -> Sequence[str]:
        """The lines, those before the first % empty: a control reads from there. Lines that may be blocks stay."""
        first = next((k for k, line in enumerate(lines) if line.lstrip().startswith("%")), 0)
        ahead = [k for k in range(first) if lines[k].strip()]
        if not ahead or any(_may_run(lines[k]) for k in ahead):
            return lines
        self.notes.append(f"lines {ahead[0] + 1} to {ahead[-1] + 1} stand before the % and are not read"
                          if len(ahead) > 1 else f"line {ahead[0] + 1} stands before the % and is not read")
        return [*([""] * first), *lines[first:]]

    def blocks(self, raw: str) -> list[str]:
        """A plain straight move unchanged; every other line word by word.

        Raises
        ------
        BlockError
            The line cannot be read, or could be read in two ways.
        """
        if self.drops:  # by the line before
            self.dropped, self.drops = self.drops, ""
        if self.machine.s.relative or "9" in raw:
            self._note_fine(raw)
        if not self.polar and not self.taps and _PLAIN.fullmatch(raw):
            return [raw]
        text = self._bare(raw)
        if not text or _TAPE.fullmatch(text):
            return [text[:1]] if text else []
        if _NAME.fullmatch(text):
            return []
        deleted = _DELETED.match(text)
        if deleted:
            text = (deleted[1] or "") + text[deleted.end():]
        words = _WORD.findall(text)
        if corner := _CORNER.search(text):
            raise BlockError(f"{corner[0]} (a chamfer or rounded corner) is not followed")
        if "".join(a + b for a, b in words) != text:
            raise BlockError(f"cannot read '{text[:60]}'")
        count = len(words)
        words = [(a, b) for a, b in words if not (a == "M" and self._idle_m(b))]
        codes = [float(b) for a, b in words if a == "G"]
        self._follow(codes)
        oriented = any(a == "M" and float(b) == ORIENTS for a, b in words)
        words = self._without_data(words, codes, oriented or len(words) < count)
        for letter, digits in words:
            self._check(letter, digits)
        if len(ms := [b for a, b in words if a == "M"]) > 1:
            self._several(ms)
        return self._translated(words, codes, deleted is not None)

    def _translated(self, words: list[tuple[str, str]], codes: list[float], deleted: bool) -> list[str]:
        """Blocks of a line from its words and G words."""
        values = dict(words)
        if 68.2 in codes:
            if 91 in codes:
                raise BlockError("G68.2 in incremental coordinates (G91)")
            self.plane(values)
            return []
        if 53.1 in codes:
            return self.square(values)
        before = [*self._spindle_of_taps(codes), *(self.level() if 69 in codes and self.frame is not None else [])]
        out = []
        arc = not {2.0, 3.0}.isdisjoint(codes) or (self.machine.s.motion in (2, 3) and {0.0, 1.0}.isdisjoint(codes)
                                                   and not self.hole)
        if arc and "P" in values and codes_move(codes) and not values.keys().isdisjoint("XYZIJKR"):
            raise BlockError(f"P{values['P']} in a block of an arc: the control has no turns there")
        if self.vectors and not values.keys().isdisjoint("IJK"):
            out = self.vector(values, arc)
            words = [(a, b) for a, b in words if a not in "IJK"]
        for letter, digits in words:
            out += self._word(letter, digits, codes, values)
        block = " ".join(out)
        if deleted and not _CHANGES.search(block):
            deleted = False
        return [*before, *([f"/{block}" if deleted else block] if block else []), *self._after(codes, values)]

    def _without_data(self, words: list[tuple[str, str]], codes: list[float], device: bool) -> list[tuple[str, str]]:
        """The words of a block without those that are data of a word that moves nothing.

        device : whether the block has an M word of the machine, or M19 with its angle, which may take P, and others
            where nothing else does

        Raises
        ------
        BlockError
            The block moves as well, or its coordinates belong to no word.
        """
        letters = {a for a, _ in words}
        data = ""
        if (own := next((c for c in codes if c in _OWN_DATA), None)) is not None:
            level = next((float(b) for a, b in words if a == "Q"), 0.0)
            if not letters.isdisjoint(_AXES) and (len(codes) > 1 or not _OWN_DATA[own](level)):
                raise BlockError(f"coordinates in a block with G{own:g}, which moves nothing",
                                 "give each its own block")
            data = "R" + _AXES if own == 5.1 else _AXES + "IJKPQR"
        if device and _NO_P.issuperset(codes) and not self.hole:
            data += "P" if not letters.isdisjoint(_AXES + "IJK") else "PQRLE"
        return [(a, b) for a, b in words if a not in data] if data else words

    def _spindle_of_taps(self, codes: list[float]) -> list[str]:
        """Words of the spindle before a block of G words ``codes``.

        Rigid tapping turns the spindle itself, and leaves it standing at its end. Where M29 does not say so, a
        parameter of the machine decides whether a tapping cycle is rigid: the proof counts on a spindle that stands.
        """
        if self.taps and not _AFTER_TAPS.isdisjoint(codes):
            self.taps = self.synchronous = False
            return ["M5"]
        if {74.0, 84.0}.isdisjoint(codes):
            return []
        begins, self.taps = not self.taps, True
        rigid = self.synchronous or self.rigid is None
        return ["M3"] if begins and rigid and not self.machine.s.turning else []

    def _follow(self, codes: list[float]) -> None:
        """Keep the modes that the words of later blocks depend on."""
        if 91 in codes and (self.polar or 16 in codes):
            raise BlockError("G91 with polar coordinates (G16), which controls read differently")
        plane = next((c for c in codes if c in (17, 18, 19)), self.machine.s.plane)
        if 43 in codes and plane != 17:
            self.leave_open(LENGTH_BY_PLANE)
        if 15 in codes:
            self.polar = False
        if 16 in codes:
            self.polar = True
        if not {43.5, 43, 43.4, 49}.isdisjoint(codes):
            self.vectors = 43.5 in codes
        for code in codes:
            if code in (0, 1, 2, 3, 80):
                self.hole = False
            elif 73 <= code <= 89:
                self.hole = True
            elif code in self.length_words:
                self.dropped = ""

    def _bare(self, raw: str) -> str:
        """The line without comments and blanks."""
        raw = _uncommented(raw)
        before, _, after = raw.partition(";")
        if _may_run(after):
            raise BlockError(f"'{after.strip()[:40]}' follows a ; which ends the block: give it its own line")
        text = "".join(bare(before).upper().split())
        if "#" in text or "[" in text:
            raise BlockError(f"cannot read the macro '{text[:40]}'")
        return text

    def _check(self, letter: str, digits: str) -> None:
        number = float(digits)
        if number in _FOREIGN.get(letter, frozenset()):
            raise BlockError(f"{letter}{digits} is a word of LinuxCNC with another meaning, or none, on {self.title}")
        if letter == "G" and number in self.refused_g:
            raise BlockError(f"unknown word G{number:g} ({self.refused_g[number]})")
        if letter in _PLACES and "." not in digits and number != 0 and not (
                letter in "IJK" and self.vectors or self.hole and letter in self.counts):
            raise BlockError(f"{letter}{digits} without a decimal point is {digits} or {number / 1000:g}, depending on "
                             "a parameter of the machine", "write the decimal point: X10. is 10 mm everywhere")

    def _idle_m(self, digits: str) -> bool:
        """Whether an M word moves nothing that the proof knows."""
        number = float(digits)
        if number == self.rigid:
            self.synchronous = True
            return True
        if number in _KNOWN_M or number in _FOREIGN["M"] or number in (96, 97, 98, 99) or number % 1:
            return False
        self.function(int(number))
        return True

    def _several(self, ms: list[str]) -> None:
        """A block has several M words, with the numbers ``ms``. Spindle and coolant together are usual."""
        names, kinds = " and ".join(f"M{m}" for m in ms), {float(m) for m in ms}
        if len(ms) == 2 and len(kinds & {3, 4, 5}) == 1 and len(kinds & {7, 8, 9}) == 1:
            self.leave_open(Assumed(AssumedKind.COOLANT, f"{names} in one block both count", "where parameter "
                                    "3404#7 is 0 the control runs only the last of them: the spindle may stand",
                                    "give each M word its own block"))
            return
        self.remarks.append(f"{names} in one block: parameter 3404#7 decides whether the control runs both or only the "
                            "last; give each its own block")

    def _word(self, letter: str, digits: str, codes: list[float], values: dict[str, str]) -> list[str]:
        """One word in the words of the reader; none where another word of the block includes it."""
        if letter == "G":
            return self._code(float(digits), values)
        if letter in "MPR" and float(values.get("M", "0")) == ORIENTS:
            return ["M5"] if letter == "M" else []
        if letter in "PX" and 4 in codes:
            seconds = float(digits) if letter == "X" or self._in_seconds(digits) else float(digits) / 1000.0
            return [f"P{seconds:.6f}"]
        if self.hole and letter == "P":
            return [f"P{float(digits) if self._in_seconds(digits) else float(digits) / 1000.0:.6f}"]
        if self.hole and letter == "Q" and "." not in digits and float(digits) >= 100:
            return [f"Q{float(digits) / 1000.0:.6f}"]
        if letter == "P" and 30 in codes:
            if float(digits) != 2:
                raise BlockError(f"G30 P{digits}: the proof does not know where that reference point is")
            return []
        if letter == "P" and 51 in codes and "." not in digits:
            raise BlockError(f"G51 P{digits} without a decimal point counts thousandths or hundred-thousandths, "
                             "depending on a parameter of the machine",
                             "write the decimal point: P2. doubles everywhere")
        if self.polar and letter in "XY" and codes_move(codes):
            return [("@" if letter == "X" else "^") + digits]
        smooth = not SMOOTHING.isdisjoint(codes)
        taken = {"P": self.further in codes or smooth or 187 in codes, "E": 187 in codes, "Q": smooth, "R": smooth}
        return [] if taken.get(letter) else [letter + digits]

    def _in_seconds(self, digits: str) -> bool:
        """Whether the P of a dwell is in s."""
        return False

    def _code(self, code: float, values: dict[str, str]) -> list[str]:
        if code == self.further:
            return [self.zero(6 + int(float(values.get("P", "0"))), f"G{code:g} P{values.get('P', '')}")]
        if code == 43.5:
            return ["G43.4"]
        if code == 5.1 and float(values.get("Q", "-1")) not in (0.0, 1.0, 3.0):
            raise BlockError("G05.1 without Q0, Q1 or Q3" if values.get("Q") != "2" else
                             "G05.1 Q2 (a curve through the places) is not followed")
        if code == 5 and float(values.get("P", "-1")) not in _CONTOURING:
            raise BlockError(f"G05 P{values['P']}, which runs a cycle of the memory of the control, is not followed"
                             if "P" in values else "G05 without P, which takes moves from another computer")
        if code in (61, 62, 63, *SMOOTHING):
            self.exact = code == 61
            self.bound(self.exact or self.limited)
        if code == 61:
            return ["G61"]
        if code in SMOOTHING:
            if not self.limited:
                self.notes.append(ROUNDING)
            return []
        if code == 76:
            self.notes.append("G76 is read without its shift at the bottom: a parameter decides its direction")
        if code in (15, 16) or code in IDLE_G:
            return []
        if code == 10 and (what := _TABLES.get(float(values.get("L", "0")))):
            raise BlockError(f"G10 L{values['L']} ({what}): it is not followed")
        return [f"G{code:g}"]

    def _after(self, codes: list[float], values: Mapping[str, str]) -> list[str]:
        """Blocks that follow a block with these G words and values.

        A move in Z to a fixed place of the machine drops the length offset, though G43 stays in force (operator's
        manual B-63844EN/02, 14.1.2). A parameter decides whether the next block or only G43 with H brings it back: the
        second is the safe one to take.
        """
        away = next((word for word in (28, 30, 53) if word in codes), None)
        if away is not None and not self.machine.s.tcp_word and (
                "Z" in values or (away != 53 and values.keys().isdisjoint(_AXES))):
            self.drops = f"G{away:g}"
        return []


def _uncommented(raw: str) -> str:
    """A line without its comments. A comment ends at its first closing parenthesis; pairs within it are let pass.

    Raises
    ------
    BlockError
        Between that parenthesis and the one that closes the outer pair stands what the control may run.
    """
    out, at = [], 0
    while (opened := raw.find("(", at)) >= 0:
        depth, end = 1, opened + 1
        while end < len(raw) and depth:
            depth += {"(": 1, ")": -1}.get(raw[end], 0)
            end += 1
        if depth:
            break
        behind = _PAIR.sub(" ", raw[raw.index(")", opened) + 1:end - 1])
        if _may_run(behind):
            raise BlockError(f"'{behind.strip()[:40]}' stands behind the first ) of a comment, and the control may run "
                             "it: write the comment without parentheses in it")
        out += [raw[at:opened], " "]
        at = end
    return "".join([*out, raw[at:]])


def _may_run(text: str) -> bool:
    """Whether a text behind a ; may be a block, or one of several: plain language and text without a number are
    comments."""
    for part in text.upper().split(";"):
        words = _DELETED.sub(lambda m: m[1] or "", "".join(part.split())).replace(",", "").replace("GOTO", "N")
        if words and ("#" in words or "[" in words or "".join(a + b for a, b in _WORD.findall(words)) == words):
            return True
    return False


def codes_move(codes: Sequence[float]) -> bool:
    """Whether X and Y of a block with these G words are places of a move, not of a shift or a machine place."""
    return {4, 10, 28, 30, 51, 51.1, 50.1, 52, 53, 68, 92}.isdisjoint(codes)
