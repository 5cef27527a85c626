"""Heidenhain, conversational: a keyword opens each block, FMAX makes a rapid for one block, F is modal.

Straight moves, arcs, polar moves, roundings, chamfers, approaches and departures are in ``heidenhain_paths``,
transformed coordinates in ``heidenhain_frames``, cycles in ``heidenhain_cycles``, parameters and jumps in
``heidenhain_q`` and ``heidenhain_flow``. PLANE SPATIAL turns about X, Y and Z of the setup frame in that order. With
M128 on and STAY it turns coordinates only. Otherwise it turns the rotary axes (MOVE, TURN), or a block after it does
(STAY), and the reader keeps the tip in the setup frame from there on. A tool's name is its id in the setup. F of an
INCH program counts tenths of an inch.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from verify.gcode.dialects.base import NUMBER, BlockError, Machine
from verify.gcode.dialects.heidenhain.heidenhain_arguments import CycleCall
from verify.gcode.dialects.heidenhain.heidenhain_cycles import (
    AT_ONCE,
    DRILLS,
    NOT_FOLLOWED,
    OLD,
    TOUCHES,
    cycle_blocks,
    defined,
    old_cycle,
)
from verify.gcode.dialects.heidenhain.heidenhain_flow import HeidenhainFlow, block_text
from verify.gcode.dialects.heidenhain.heidenhain_paths import HeidenhainPaths
from verify.gcode.dialects.heidenhain.heidenhain_q import VALUE
from verify.gcode.dialects.heidenhain.heidenhain_words import M_AFTER, M_BEFORE
from verify.gcode.dialects.orientation import needed
from verify.gcode.dialects.stated_places import digits

_NUM = r"[+-]?(?:[0-9]{1,8}(?:\.[0-9]*)?|\.[0-9]+)"
_LINE = re.compile(rf"\s*(?:[0-9]+ +)?L((?: +[XYZABC]{_NUM})*)(?: +R0)?(?: +(FMAX|F{_NUM}))?((?: +M[0-9]+)*)\s*")
_TOOL = re.compile(rf'TOOL CALL(?:\s*("[^"]*"|{NUMBER}|QS?[0-9]+))?(?:\s+([XYZUVW])(?![A-Z0-9+-]))?(.*)')
_TOOL_WORD = re.compile(rf"\s*(S|FU|FZ|F|DL|DR2|DR)\s*({VALUE})(?=\s|$)|\s*(VC)\s*=?\s*{VALUE}(?=\s|$)")
_BEGIN = re.compile(r"BEGIN PGM (?:\S.*)? ?(MM|INCH)")
_DOTTED = re.compile(r"CYCL DEF ([0-9]+)\.([0-9]+)\s*(.*)")
_TCPM = re.compile(rf"FUNCTION TCPM(?:\s+F\s*(TCP|CONT))?(?:\s+AXIS\s*(POS|SPAT))?(?:\s+PATHCTRL\s*(AXIS|VECTOR))?"
                   rf"(?:\s+REFPNT\s*(\S+))?(?:\s+F\s*{VALUE})?")
_CALLED = re.compile(r"CYCL CALL(?:\s+(POS|PAT))?\s*(.*)")
_COORDINATE = re.compile(rf"\s*(I?)([XYZABC])\s*({VALUE})(?=\s|$)")
_UNTILTED = re.compile(rf"(?:(?:[ABCF]|ABST|DIST)\s*{VALUE}\s*)*")
_SKIPPED = re.compile(r"\s*(?:/\s*|([0-9]+\s+)/\s*)(?=[0-9A-Za-z])")
_STATEMENT = re.compile(r"(?:CALL\s+)?LBL|FN\s*[0-9]|Q[LRS]?[0-9]+\s*=|(?:CALL|BEGIN|END)\s+PGM")
_DEVICES = re.compile(r"(?:STOP|L)?\s*(?:M[0-9]+\s*)+")
_CHANGES = re.compile(r"[XYZABCGTFS]|M0*(?:2|3|4|5|6|19|30)(?![0-9.])")
"""Words that move the tool, or that a later move depends on."""
SMALL = 0.01
"""deg, deviation of a rotary axis that needs no note."""
_RESET = re.compile(r"TRANS (MIRROR|ROTATION|SCALE) RESET")
_DEF = re.compile(rf"TOOL DEF\s+(\"[^\"]*\"|{NUMBER}|QS?[0-9]+)((?:\s+[LR]\s*{VALUE})*)")
_SIZE = re.compile(rf"([LR])\s*({VALUE})")
_IDLE = ("BLK FORM", "* -", "*", "FUNCTION PROG PATH OFF", "FUNCTION MODE MILL", "FUNCTION FEED DWELL",
         "FUNCTION S-PULSE RESET",
         "FUNCTION DWELL", "WMAT", "CYCL DEF 13.", "FUNCTION FILE", "OPEN TABLE",
         *(f"FUNCTION COUNT {word}" for word in ("INC", "RESET", "ADD", "SET", "TARGET")),
         "FUNCTION FEED RESET",
         "FUNCTION AFC", "SEL TABLE", "FUNCTION DCM", "CYCL DEF 14.",
         "FUNCTION DRESS OFF")
_REFUSED = {
    "FPOL": "a free contour", "FL": "a free contour", "FC": "a free contour", "FLT": "a free contour",
    "FCT": "a free contour",
    "FSELECT": "a free contour", "SPL": "a spline", "TCH PROBE": "a touch probe", "PATTERN DEF": "a pattern of points",
    "CONTOUR DEF": "a contour formula", "SEL PATTERN": "a table of points", "SEL CONTOUR": "a contour formula",
    "SEL PGM": "another program", "FUNCTION PARAXCOMP": "parallel axes", "FUNCTION PARAXMODE": "parallel axes",
    "FUNCTION TURNDATA": "turning", "FUNCTION MODE TURN": "turning", "FUNCTION LIFTOFF": "a lift of the tool",
    "TRANS MIRROR": "a mirror", "TRANS ROTATION": "a rotation", "TRANS SCALE": "a scale",
    "POLARKIN": "polar kinematics",
    "FUNCTION POLARKIN": "polar kinematics", "SEL CORR-TABLE": "a correction table",
    "FUNCTION CORRDATA": "a correction table",
    "TRANS DATUM TABLE": "a datum table", "SEL TABLE": "a datum table", "FUNCTION TURNING": "turning",
    "FUNCTION COUNT": "a jump that the counter of the control decides",
    "FUNCTION PROG PATH": "a path along the contour, not of the tool",
    "CALL PGM": "another program", "FUNCTION S-PULSE P-TIME": "a spindle speed that swings",
}
"""Openings of blocks that move or cut and are not followed, and what they are."""


def is_conversational(text: str) -> bool:
    """Whether a text begins as a conversational program."""
    return re.match(r"\s*(?:[0-9]+\s+)?BEGIN PGM\b", text.upper()) is not None


class HeidenhainReader(HeidenhainPaths):
    """TNC 320 to 640, iTNC 530, TNC7."""

    home_from = 1

    def __init__(self) -> None:
        super().__init__()
        self.unbounded = True
        self.cycle: CycleCall | None = None
        self.dotted: dict[int, dict[int, str]] = {}
        self.lengths: dict[int, float] = {}  # mm, by T number, of TOOL DEF

    def order(self, lines: Sequence[str], machine: Machine) -> Iterator[tuple[int, str]]:
        """Blocks in the order they run, as ``HeidenhainFlow.run`` has it; raises as that does."""
        self.machine = machine
        self.tool = machine.s.tool
        self.flow = HeidenhainFlow(lines, self.q, machine)
        for number, raw in self.flow.run():
            self.number = number
            yield number, raw

    def blocks(self, raw: str) -> list[str | tuple[int, str]]:
        """Blocks of one line, by its keyword. Raises BlockError where it cannot be read."""
        if self.is_simple and (m := _LINE.fullmatch(raw)) and not _corner_ahead(self.flow.ahead):
            return list(self._simple(m[1], m[2], [int(w[1:]) for w in m[3].split()]))
        if skipped := _SKIPPED.match(raw):
            return self._switched((skipped[1] or "") + raw[skipped.end():])
        text = block_text(raw)
        if not text or text.startswith(_IDLE) and not text.startswith("SEL TABLE"):
            if text.startswith("FUNCTION AFC CUT BEGIN"):
                self.machine.log.note("FUNCTION AFC lets the control change feeds by the load of the spindle; the "
                                      "proof takes the feeds of the program")
            return []
        if (moved := self.motion_blocks(text)) is not None:
            return self._called_after(moved)
        return list(self._other(text))

    def _switched(self, raw: str) -> list[str | tuple[int, str]]:
        """Blocks of a line with a /, which a switch of the machine leaves out.

        Raises
        ------
        BlockError
            The order of the blocks, or a value, would depend on that switch.
        """
        text = block_text(raw)
        if _STATEMENT.match(text):
            raise BlockError(f"a / before '{text[:20]}': the flow of the program would depend on a switch of the "
                             "machine")
        out = self.blocks(raw)
        idle = not text or text.startswith(_IDLE) or _DEVICES.fullmatch(text)
        if not idle or any(_CHANGES.search(b if isinstance(b, str) else b[1]) for b in out):
            self.remarks.append("a block with / depends on a switch of the machine; the proof runs it")
        return out

    @property
    def is_simple(self) -> bool:
        """Whether a straight move needs nothing but its words now."""
        return (self.frame is None and self.held is None and self.approach is None and self.side == 0 and not self.spat
                and self.wanted is None and self.unspun is None and not self.modal_call and self.circle is not True
                and not any(self.wound.values()))

    def _simple(self, places: str, feed: str | None, ms: list[int]) -> list[str]:
        """L with plain numbers, in coordinates of the setup frame."""
        if any(m not in M_BEFORE and m not in M_AFTER and m not in (91, 126, 127) for m in ms) or 99 in ms or 89 in ms:
            return [b if isinstance(b, str) else b[1] for b in self._called_after(
                self.motion_blocks(f"L {places} {feed or ''} {' '.join(f'M{m}' for m in ms)}") or [])]
        return self.plain_line(" ".join(places.split()), feed, ms)

    def _other(self, text: str) -> list[str]:
        if m := _BEGIN.fullmatch(text):
            self.inch = m[1] == "INCH"
            return [f"G{21 if m[1] == 'MM' else 20} G17 G90 G94 G40"]
        if m := _TOOL.fullmatch(text):
            return self._tool(m)
        if text.startswith("TOOL DEF"):
            return self._tool_def(text)
        if text.startswith("CYCL DEF"):
            return self._define(text)
        if m := _CALLED.fullmatch(text):
            return self._call(m[1] or "", m[2])
        if text.startswith("PLANE"):
            self._unheld("PLANE")
            out = self.tilt(text)
            self.q.held.update({f"Q{120 + 'ABC'.index(k)}": v for k, v in self.plane_angles.items()})
            return out
        if text.startswith("FUNCTION"):
            return self._function(text)
        if m := re.fullmatch(r"PRESET SELECT #\s*([0-9]+)", text):
            self._unheld("PRESET SELECT")
            self.reset_frames()
            return [self.zero(int(m[1]), f"preset {m[1]}")]
        if text.startswith("TRANS DATUM"):
            return self._datum(text)
        if (m := _RESET.fullmatch(text)) and not self.is_set(m[1]):
            return []
        if re.fullmatch(r"(?:STOP)?\s*(?:M.*)?", text):
            out = self.machine_words(text)
            called, self.calls = self.calls and not self.modal_call, False
            return [*out, *(self.cycle_there(0.0) if called else [])]
        if self.q.run(text):
            return []
        if text.startswith("END PGM"):
            self._unheld("END PGM")
            return ["M30"]
        if re.match(r"QS[0-9]+\s*=", text):
            return []
        for opening, what in _REFUSED.items():
            if text.startswith(opening):
                raise BlockError(f"{text[:40]} ({what}) is not followed", "let the post write plain moves (L, C)")
        raise BlockError(f"cannot read '{text[:60]}'")

    def _tool(self, m: re.Match[str]) -> list[str]:
        self._unheld("TOOL CALL")
        if m[2] not in (None, "Z"):
            raise BlockError(f"TOOL CALL with the tool axis {m[2]}: only Z is read")
        if self.tcp:
            raise BlockError("TOOL CALL while M128 is on", "program M129 before it and M128 after it")
        given, at, rest = {}, 0, m[3]
        while rest[at:].strip():
            w = _TOOL_WORD.match(rest, at)
            if w is None:
                raise BlockError(f"cannot read '{rest[at:].strip()[:40]}' of TOOL CALL")
            if w[1]:
                given[w[1]] = self.q.value(w[2])
            at = w.end()
        if m[1] is None and not {"DL", "DR", "DR2"}.isdisjoint(given):
            raise BlockError("TOOL CALL with DL or DR and without a tool is not followed", "name the tool in it")
        before = self.tool
        self.tool = before if m[1] is None else self._numbered(m[1])
        out = [*([f"S{digits(given['S'])}"] if "S" in given else []), *self._tool_feed(given, self.tool != before)]
        if m[1] is None:
            return [*out] if not out else [" ".join(out)]
        number = self.tool
        self.wider = given.get("DR", 0.0) * self.factor_of_unit
        self.forget()
        self.lengthen(given.get("DL", 0.0) * self.factor_of_unit)
        if self.longer and self.swung:
            raise BlockError("TOOL CALL with DL in a tilted plane")
        self.rounder = given.get("DR2", 0.0)
        if self.rounder:
            self.notes.append("TOOL CALL with DR2 changes the compensation in space only; the reader has none")
        return [" ".join([f"T{number} M6", *out]), *([f"G43 H{number}"] if number else [])]

    def _tool_feed(self, given: Mapping[str, float], other: bool) -> list[str]:
        """The F word of a TOOL CALL, or none. given : its values by letter; other : whether it calls another tool."""
        speed = given.get("S", self.machine.s.speed)
        if "F" in given:
            self.auto, self.auto_turn = given["F"], False
            self.per_tooth = self.auto_tooth = None
            self.rate = self.counted(given["F"], False)
            return [self.rate]
        if "FU" in given or "FZ" in given:
            self.per_tooth = self.auto_tooth = given.get("FZ")
            self.per_turn = given["FZ"] * self.teeth() if "FZ" in given else given["FU"]
            self.auto, self.auto_turn = self.per_turn, True
        elif other and self.tool:
            if self.auto_tooth is not None:
                self.auto = self.auto_tooth * self.teeth()
            if self.per_tooth is not None:
                self.per_turn = self.per_tooth * self.teeth()
        elif "S" not in given:
            return []
        if self.per_turn is None or ("S" not in given and not {"FU", "FZ"} & given.keys() and self.per_tooth is None):
            return []
        self.rate = self.turning(speed, self.per_turn)
        return [self.rate]

    def _tool_def(self, text: str) -> list[str]:
        """TOOL DEF: a tool that is made ready. Sizes have to be those that the proof has.

        The first length of a tool counts as the true one.
        """
        m = _DEF.fullmatch(text)
        if m is None:
            raise BlockError(f"cannot read '{text[:40]}'")
        sizes = {w[1]: self.q.value(w[2]) * self.factor_of_unit for w in _SIZE.finditer(m[2])}
        if not sizes:
            return []
        number = self._numbered(m[1])
        radius = self.machine.radii.get(number)
        if "R" in sizes and (radius is None or abs(sizes["R"] - radius) > 1e-6):
            raise BlockError(f"TOOL DEF {number} with the radius {sizes['R']:g} mm: the setup gives T{number} "
                             + ("no radius" if radius is None else f"{radius:g} mm"))
        if "L" in sizes and abs(self.lengths.setdefault(number, sizes["L"]) - sizes["L"]) > 1e-6:
            raise BlockError(f"TOOL DEF {number} with the length {sizes['L']:g} mm: an earlier one gives it "
                             f"{self.lengths[number]:g} mm")
        if "L" in sizes:
            self.machine.log.lengths.setdefault(number, (sizes["L"], self.machine.log.line))
        return []

    def _numbered(self, word: str) -> int:
        """T number of a tool by its name (the id of the setup), its number, or a parameter."""
        if word.startswith('"'):
            name = word[1:-1]
            names = {k.upper(): v for k, v in self.names.items()}
            found = self.names.get(name, names.get(name.upper()))
            if found is None and re.fullmatch("T?[0-9]+", name.upper()):
                found = int(name.upper().removeprefix("T"))
            if found is None:
                raise BlockError(f'TOOL CALL "{name}": no tool of the setup has this id',
                                 f"give a tool of the setup the id {name}" + (
                                     f" (it has {', '.join(sorted(self.names)[:8])})" if self.names else ""))
            return found
        if word.startswith("QS"):
            raise BlockError(f"TOOL CALL {word}: texts in parameters are not followed", "write the name of the tool")
        number = self.q.value(word)
        if number != int(number) or number < 0:
            raise BlockError(f"TOOL CALL {word}: tools with an index are not followed")
        return int(number)

    def _define(self, text: str) -> list[str]:
        self._unheld("CYCL DEF")
        if m := _DOTTED.fullmatch(text):
            return self._dotted(int(m[1]), int(m[2]), m[3].strip())
        call = defined(text, self.q.value)
        if call is None:
            raise BlockError(f"cannot read '{text[:60]}'")
        for name, number in call.values.items():
            self.q.held.pop(name, None)
            if math.isfinite(number):
                self.q.held[name] = number
        n = call.number
        if n == 247:
            row = call.values.get("Q339")
            if row is None or row != int(row):
                raise BlockError(f"cycle 247 continues with '{text.partition('247')[2].strip()[:40]}' instead of Q339, "
                                 f"the row "
                                 "of the preset table")
            self.reset_frames()
            return [self.zero(int(row), f"preset {int(row)}")]
        if n in (7, 8, 9, 10, 11, 19, 26, 32):
            raise BlockError(f"cannot read '{text[:60]}'")
        if n in AT_ONCE or (n not in DRILLS and n not in NOT_FOLLOWED):  # others work when they are called
            kind = "turning" if n >= 800 or n == 290 else "which may work when it is defined"
            what = NOT_FOLLOWED.get(n, "a touch probe" if n in TOUCHES or n >= 1000 else kind)
            raise BlockError(f"cycle {n} ({what}) is not followed")
        self.cycle = call
        return []

    def _dotted(self, cycle: int, part: int, rest: str) -> list[str]:
        """A block CYCL DEF n.k of an older cycle."""
        if part == 0:
            self.dotted[cycle] = {}
            if cycle in (20, 21, 22, 23, 24, 25, 27, 28, 29, 39):
                self.cycle = CycleCall(cycle, {})
            elif cycle in OLD:
                self.cycle = None
            elif cycle not in (7, 8, 9, 10, 11, 13, 14, 19, 32):
                raise BlockError(f"cycle {cycle} is not followed")
            return []
        items = self.dotted.setdefault(cycle, {})
        items[part] = rest
        if cycle == 7:
            self.shift_datum(self._shifts(rest))
        elif cycle == 8:
            axes = "".join(rest.split())
            if re.fullmatch("[XYZ]*", axes) is None:
                raise BlockError(f"cycle 8 with '{rest[:20]}'")
            self.mirror(axes)
        elif cycle == 9:
            return [f"G4 P{digits(self._single(rest, 'DWELL|V.ZEIT|VZEIT|'))}"]
        elif cycle == 10:
            self.rotate(math.radians(self._single(rest, "I?ROT")), "IROT" in rest)
        elif cycle == 11:
            self.scale(self._single(rest, "SCL"))
        elif cycle == 19:
            self._untilted(rest)
        elif cycle == 32:
            return self._tolerant(part, rest)
        return []

    def _untilted(self, rest: str) -> None:
        """Cycle 19 without a tilt: all angles are 0, or none is given."""
        if _UNTILTED.fullmatch(rest) is None or any(self.q.value(v) for v in re.findall(rf"[ABC]\s*({VALUE})", rest)):
            raise BlockError("cycle 19 (a tilted plane) is not followed", "let the post write PLANE SPATIAL")
        if self.plane is not None:
            raise BlockError("cycle 19 in a plane of PLANE: end it with PLANE RESET")

    def _single(self, rest: str, word: str) -> float:
        m = re.fullmatch(rf"(?:{word})\s*({VALUE})(?:\s+DIST\s*{VALUE})?", rest)
        if m is None:
            raise BlockError(f"cannot read '{rest[:40]}' of a cycle")
        return self.q.value(m[1])

    def _shifts(self, rest: str) -> dict[str, tuple[float, bool]]:
        """Words of a datum shift, mm."""
        out: dict[str, tuple[float, bool]] = {}
        at = 0
        while rest[at:].strip():
            m = _COORDINATE.match(rest, at)
            if m is None or m[2] not in "XYZ":
                raise BlockError(f"a datum shift with '{rest[at:].strip()[:30]}' is not followed: X, Y and Z are")
            out[m[2]] = (self.q.value(m[3]) * self.factor_of_unit, bool(m[1]))
            at = m.end()
        return out

    def _tolerant(self, part: int, rest: str) -> list[str]:
        """Cycle 32: the tolerance of the path, and that of rotary axes."""
        if part == 1:
            m = re.fullmatch(rf"(?:T\s*({VALUE}))?", rest)
            if m is None:
                raise BlockError(f"cannot read '{rest[:40]}' of cycle 32")
            tolerance = self.q.value(m[1]) if m[1] else 0.0
            self.bound(tolerance != 0.0)
            self.lean = self.lean if tolerance else 0.0
            if tolerance:
                return [f"G64 P{tolerance:.6f}"]
            self.notes.append("cycle 32 is off: machine parameters decide how far the control rounds corners; the "
                              "error bound does not include it")
            return []
        m = re.fullmatch(rf"(?:HSC-MODE:[01])?\s*(?:TA\s*({VALUE}))?", rest)
        if m is None:
            raise BlockError(f"cannot read '{rest[:40]}' of cycle 32")
        self.lean = self.q.value(m[1]) if m[1] else 0.0
        if self.lean > SMALL:
            self.notes.append(f"cycle 32 allows rotary axes a deviation of {m[1]} deg: the error bound does not "
                              "include it")
        return []

    def _datum(self, text: str) -> list[str]:
        """TRANS DATUM AXIS and TRANS DATUM RESET."""
        self._unheld("TRANS DATUM")
        if text == "TRANS DATUM RESET":
            self.shift_datum(dict.fromkeys("XYZ", (0.0, False)))
            return []
        if not text.startswith("TRANS DATUM AXIS"):
            raise BlockError(f"{text[:40]} (a datum table) is not followed")
        self.shift_datum(self._shifts(text.removeprefix("TRANS DATUM AXIS")))
        return []

    def _function(self, text: str) -> list[str]:
        self._unheld("FUNCTION")
        if text.startswith("FUNCTION RESET TCPM"):
            self.tcp, self.spat, self.circle = False, False, None
            return [] if self.machine.machine is None else ["M429"]
        m = _TCPM.fullmatch(text)
        if m is None:
            for opening, what in _REFUSED.items():
                if text.startswith(opening):
                    raise BlockError(f"{text[:40]} ({what}) is not followed")
            raise BlockError(f"cannot read '{text[:60]}'")
        if m[4] not in (None, "TIP-TIP"):
            raise BlockError(f"FUNCTION TCPM with REFPNT {m[4]}: only the tip (TIP-TIP) is followed")
        if self.longer:
            raise BlockError("FUNCTION TCPM after TOOL CALL with DL is not followed")
        needed(self.machine.machine, "FUNCTION TCPM")
        self.tcp, self.spat, self.circle = True, m[2] == "SPAT", m[3] == "VECTOR"
        self.spatial = {}
        self.forget()
        return ["M428"]

    def _call(self, kind: str, rest: str) -> list[str]:
        """CYCL CALL, CYCL CALL POS X Y Z."""
        self._unheld("CYCL CALL")
        if kind == "PAT":
            raise BlockError("CYCL CALL PAT (a pattern or table of points) is not followed")
        over, out = 0.0, []
        if kind == "POS":
            words, over = self.position(rest)
            out += words
            return [*out, *self.cycle_there(over, self.cycle_place)]
        before, after = self.ordered_words(rest)
        self.calls = False
        return [*before, *self.cycle_there(over), *after]

    def cycle_there(self, over: float, place: Sequence[float] | None = None) -> list[str]:
        """Blocks of the cycle in force at a place, where the tool stands if None.

        over  : mm, added to the surface
        place : (3,) mm, in the coordinates of the control

        Raises
        ------
        BlockError
            No cycle is defined, or it cannot be followed.
        """
        self.uncompensated("a drilling cycle")
        here = self.here() if place is None else place
        call = None if self.cycle is None else replace(self.cycle, values={
            k: self.q.held.get(k, v) for k, v in self.cycle.values.items()})  # the program may have changed them since
        if call is None:
            number = max((n for n in self.dotted if n in OLD and self.dotted[n]), default=0)
            if not number:
                raise BlockError("a call of a cycle, and none is defined")
            if math.isnan(here[2]):
                raise BlockError(f"cycle {number} at a height that the program has not stated")
            call = old_cycle(number, self.dotted[number], here[2] / self.unit, self.q.value)
        radius = self.machine.radii.get(self.tool)
        blocks = cycle_blocks(call, here, self.machine, over, self.feed_word, radius)
        return [*blocks, *([self.rate] if self.rate and any("F" in b for b in blocks) else [])]

    def _called_after(self, blocks: list[str | tuple[int, str]]) -> list[str | tuple[int, str]]:
        """Blocks of a move, with the cycle that M99 or M89 calls at its end."""
        if not self.calls:
            return blocks
        self.calls = False
        if self.held is not None:
            raise BlockError("M99 or M89 before a rounding or chamfer")
        return [*blocks, *self.cycle_there(0.0, self.end)]


def _corner_ahead(raw: str) -> bool:
    return "RND" in raw or "CHF" in raw or "rnd" in raw or "chf" in raw


__all__ = ["SMALL", "HeidenhainReader", "is_conversational"]
