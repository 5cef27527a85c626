"""Words of a block of a Heidenhain program: coordinates, feeds, M words, radius compensation."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from verify.gcode.cutter_compensation import Approach, Corner, Style
from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.corners import Leg
from verify.gcode.dialects.heidenhain.heidenhain_flow import HeidenhainFlow
from verify.gcode.dialects.heidenhain.heidenhain_frames import HeidenhainFrames
from verify.gcode.dialects.heidenhain.heidenhain_q import VALUE, QParameters
from verify.gcode.dialects.orientation import needed
from verify.gcode.dialects.stated_places import digits
from verify.gcode.machine_words import HEIDENHAIN_M

HEIDENHAIN_STYLE = Style(Corner.ARC, Approach.NEXT_NORMAL)
INCH = 25.4
HALF_A_TURN = 180.000001  # deg, rounding included
M_BEFORE = frozenset({3, 4, 6, 8, 13, 14, 19, 128})
"""M words that act at the start of their block."""
M_AFTER = frozenset({0, 1, 2, 5, 9, 30, 129})
"""M words that act at the end of their block."""
M_WORDS = {0: "M0 M5 M9", 1: "M1 M5 M9", 6: "M5", 13: "M3 M8", 14: "M4 M8", 19: "M5", 128: "M428", 129: "M429"}
"""Their words for the reader. M0, M1, M6 and M19 stop the spindle, M0 and M1 the coolant too."""
M_IDLE = frozenset({7, 101, 102, 103, 105, 106, 107, 108, 110, 111, 113, 115, 116, 117, 118, 120, 126, 127, 137, 141,
                    145, 148, 149, 150})
"""M words that change feed, tool life or messages only; M126 and M127 are kept as state."""
_KNOWN_M = M_BEFORE | M_AFTER | M_IDLE | {89, 91, 99}
_WORD = re.compile(rf"""\s*(?:M\s*(?P<m>[0-9]+)(?![0-9.])
    |(?P<side>R0|RL|RR)(?![A-Z0-9.])
    |DR\s*(?P<sense>[+-])(?![0-9.])
    |F\s*(?P<feed>MAX|AUTO|[UZ]?\s*{VALUE})
    |(?P<name>I?[XYZABC]|I?P[AR]|N[XYZ]|T[XYZ]|CCA|LEN|R)\s*(?P<value>{VALUE}))(?![A-Z0-9.])""", re.VERBOSE)
_STRIPPED = re.compile(rf"\bM118(?:\s+[XYZABC]\s*{VALUE})*|\bM120(?:\s+LA\s*[0-9]+)?|\bM103(?:\s+F\s*{VALUE})?")
_RETRACT = re.compile(rf"\bM140(?:\s+MB\s*(MAX|{VALUE}))(?:\s+F\s*(MAX|{VALUE}))?")
_TCP_FEED = re.compile(rf"\b(M128)\s+F\s*{VALUE}")
_COUNTS = re.compile(r"\bM94(?:\s+([ABC]))?(?![0-9])")


@dataclass
class Words:
    """Words of a block: coordinates (value, whether incremental), other names, feed, side, sense and M words."""

    places: dict[str, tuple[float, bool]] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    feed: str = ""
    side: str = ""
    sense: str = ""
    ms: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class Move:
    """One move in the coordinates of the control, mm.

    number : its line; start, end : (3,); named : letters to write; centre, left, laps : of an arc
    rapid, feed, side : how it goes; turns : rotary words, deg; before, after : blocks round it
    """

    number: int
    start: tuple[float, ...]
    end: tuple[float, ...]
    named: str
    centre: complex | None = None
    left: bool = False
    laps: int = 1
    rapid: bool = False
    feed: str = ""
    side: str = ""
    turns: tuple[tuple[str, float], ...] = ()
    vector: tuple[float, ...] | None = None
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    radius: float = 0.0

    @property
    def leg(self) -> Leg:
        """The move in the plane XY."""
        return Leg(complex(*self.start[:2]), complex(*self.end[:2]), self.centre, self.left)


@dataclass(frozen=True)
class Way:
    """An approach: its kind, the place where the contour begins, and its sizes."""

    kind: str
    start: tuple[float, ...]
    end: tuple[float, ...]
    size: float
    angle: float
    side: str
    feed: str
    rapid: bool
    number: int
    after: tuple[str, ...]
    before: tuple[str, ...]


Blocks = list[str | tuple[int, str]]


class HeidenhainWords(HeidenhainFrames):
    """Motion of the control.

    held     : the move before a corner, and the corner: kind, size, F word, line
    approach : an APPR whose first contour move is not known yet
    side     : of radius compensation, 1 left, -1 right, 0 off; wider, rounder : DR, mm, and DR2 of TOOL CALL
    wound    : deg by which a rotary word counts less than the axis has turned (M94)
    calls    : whether the latest move calls a cycle at its end, ``end``; modal_call : whether every move does (M89)
    rate     : the F word in force; auto : feed of TOOL CALL
    per_turn : units of the program per turn of the spindle (FU, FZ), None where F counts per minute
    per_tooth : units of the program per tooth (FZ), None where F counts otherwise
    auto_turn : whether F of TOOL CALL counts per turn; auto_tooth : its FZ, None where it has none
    """

    style, refused_m = HEIDENHAIN_STYLE, HEIDENHAIN_M
    flow: HeidenhainFlow

    def __init__(self) -> None:
        super().__init__()
        self.q = QParameters(self._served)
        self.value = self.q.value
        self.in_mm = False  # whether F counts in mm where a rotary axis turns (M116)
        self.inch = self.shortest = self.modal_call = self.calls = self.last_rapid = False
        self.tool = self.side = self.number = 0
        self.wider = self.rounder = 0.0
        self.turned: dict[str, float] = {}
        self.spatial: dict[str, float] = {}
        self.wound: dict[str, float] = {}
        self.centre = [math.nan] * 2
        self.rate = ""
        self.auto: float | None = None
        self.per_turn: float | None = None
        self.per_tooth: float | None = None
        self.auto_turn = False
        self.auto_tooth: float | None = None
        self.held: Move | None = None
        self.corner: tuple[str, float, str, int] | None = None
        self.approach: Way | None = None
        self.end: list[float] = [math.nan] * 3

    @property
    def factor_of_unit(self) -> float:
        """mm for one unit of the program."""
        return INCH if self.inch else 1.0

    def _served(self, name: str) -> float | None:
        """Q parameters that the control sets: radius and number of the tool."""
        if name == "Q108" and self.tool in self.machine.radii:
            return (self.machine.radii[self.tool] + self.wider) / self.factor_of_unit
        return None

    def here(self) -> list[float]:
        """(3,) mm, the programmed place after all moves, also those held back."""
        if self.held is not None:
            return list(self.held.end)
        if self.approach is not None:
            return list(self.approach.end)
        return super().here()

    def feed_word(self, number: float) -> str:
        """The F word in units of the program per minute: F10 is one inch per minute in an INCH program.

        Raises
        ------
        BlockError
            It is no feed.
        """
        if math.isinf(number):
            if self.auto is None:
                raise BlockError("FAUTO, FMAX or MAX as the feed of a cycle, and TOOL CALL has no F",
                                 "give the feed as a number")
            if self.auto_turn:
                return self.turning(self.machine.s.speed, self.auto)
            number = self.auto
        return f"F{0.1 * number:.9f}" if self.inch else f"F{digits(number)}"

    def _unheld(self, word: str) -> None:
        """Refuse a block between a corner or approach and the move after it."""
        if self.held is not None or self.approach is not None:
            raise BlockError(f"{word} between RND, CHF or APPR and the move after it")

    def _check_m91(self, machine: bool) -> None:
        if machine and self.plane is not None and not self.swung and self.wanted is None:
            raise BlockError("M91 in a tilted plane")
        if machine and self.tcp:
            raise BlockError("M91 while M128 is on", "program M129 in a block before")

    def _note_turns(self, angles: Mapping[str, float]) -> None:
        """Record the angles of the rotary words, deg. With M126 only turns of half a turn or less are certain."""
        for letter, angle in angles.items():
            way = angle - self.turned.get(letter, angle)
            if self.shortest and abs(way) > HALF_A_TURN:
                raise BlockError(f"with M126 {letter} turns by {way:g} deg or by {math.remainder(way, 360.0):g}, "
                                 "depending on whether its display counts beyond 360 deg",
                                 "turn by half a turn or less in a block")
        self.turned.update(angles)

    def _check_turn(self, turns: bool, rapid: bool) -> None:
        """Refuse a feed move that turns an axis under M116 and without tool centre point control."""
        if turns and self.in_mm and not rapid and not self.tcp:
            raise BlockError("a feed move that turns an axis under M116: F counts in mm at the tool, which is not "
                             "followed", "end it with M117, and program F in degrees")

    def _switch(self, ms: list[int]) -> list[int]:
        """The M words without M126 and M127; tool centre point control is kept as state.

        M129 ends nothing where the machine has no rotary axes.
        """
        if 128 in ms and self.longer:
            raise BlockError("M128 after TOOL CALL with DL is not followed")
        if 128 in ms or 129 in ms:
            self.tcp, self.spat, self.circle = 129 not in ms, False, None
            if self.tcp:
                self.wanted = None
            self.forget()
        self.shortest = 127 not in ms and (self.shortest or 126 in ms)
        self.in_mm = 117 not in ms and (self.in_mm or 116 in ms)
        if 128 in ms:
            needed(self.machine.machine, "M128")
        idle = (126, 127, 129) if self.machine.machine is None else (126, 127)
        return [m for m in ms if m not in idle]

    def ordered_words(self, rest: str) -> tuple[list[str], list[str]]:
        """Blocks of M words alone: those before a move, and those after it.

        Raises
        ------
        BlockError
            Another word.
        """
        rest, retract = self._retracted(rest)
        w = self._read(rest)
        if w.places or w.values or w.feed not in ("", "MAX") or w.side or w.sense:
            raise BlockError(f"cannot read '{rest[:40]}'")
        before, after = self._ms(w.ms)
        return [*before, *retract], after

    def _ms(self, ms: list[int]) -> tuple[list[str], list[str]]:
        """M words as blocks before and after the move."""
        for m in ms:
            idle_here = m in (97, 98, 197) and self.side == 0 or m == 130 and self.plane is None
            if not (m in _KNOWN_M or idle_here):
                self.function(m)
        if 89 in ms or 99 in ms:
            self.modal_call, self.calls = 99 not in ms, True
        ms = self._switch(ms)
        before = [M_WORDS.get(m, f"M{m}") for m in ms if m in M_BEFORE]
        return before, [M_WORDS.get(m, f"M{m}") for m in ms if m in M_AFTER]

    def _retracted(self, rest: str) -> tuple[str, list[str]]:
        """Take M140, M94 and words of speed out of a line: (the rest, blocks of M140)."""
        rest = _TCP_FEED.sub(r"\1", _STRIPPED.sub(" ", rest))
        if m := _COUNTS.search(rest):
            rest = rest[:m.start()] + rest[m.end():]
            for letter, angle in self.turned.items():
                if m[1] in (None, letter):
                    self.wound[letter] = math.floor((angle - 1e-9) / 360.0) * 360.0 if not 0 <= angle <= 360 else 0.0
        m = _RETRACT.search(rest)
        if m is None:
            return rest, []
        if self.tcp and m[1] == "MAX" and any(self.machine.s.turn):
            self.notes.append("M140 MB MAX under M128 with a turned axis ends at a place that is not known")
        feed = self.feed_word(self.q.value(m[2])) if m[2] and m[2] != "MAX" else ""
        return rest[:m.start()] + rest[m.end():], self.retract(m[1], feed)

    def _read(self, rest: str) -> Words:
        w, at = Words(), 0
        while rest[at:].strip():
            m = _WORD.match(rest, at)
            if m is None:
                raise BlockError(f"cannot read '{rest[at:].strip()[:40]}'")
            at = m.end()
            if m["m"]:
                w.ms.append(int(m["m"]))
            elif m["side"]:
                w.side = m["side"]
            elif m["sense"]:
                w.sense = m["sense"]
            elif m["feed"]:
                if w.feed:
                    raise BlockError(f"two feeds in one block: F{w.feed} and F{m['feed']}")
                w.feed = m["feed"]
            else:
                self._put_word(w, m["name"], self.q.value(m["value"]))
        return w

    def _put_word(self, w: Words, name: str, value: float) -> None:
        letter = name.removeprefix("I")
        if name in w.values or letter in w.places:
            raise BlockError(f"the word {name} appears twice")
        if letter in ("X", "Y", "Z", "A", "B", "C"):
            w.places[letter] = (value * (self.factor_of_unit if letter in "XYZ" else 1.0), name != letter)
        elif name in ("PR", "IPR", "R", "LEN"):
            w.values[name] = value * self.factor_of_unit
        else:
            w.values[name] = value

    def _rate(self, feed: str) -> str:
        """The F word of a block, '' for FMAX and where it has none."""
        if feed == "AUTO":
            if self.auto is None:
                raise BlockError("FAUTO, and TOOL CALL has no F")
            self.rate, self.per_tooth = self.counted(self.auto, self.auto_turn), self.auto_tooth
            return self.rate
        if feed and feed != "MAX":
            value, self.per_tooth = self.q.value(feed.lstrip("UZ ")), None
            if feed.startswith("Z"):
                self.per_tooth, value = value, value * self.teeth()
            self.rate = self.counted(value, feed.startswith(("U", "Z")))
            return self.rate
        return ""

    def counted(self, number: float, per_turn: bool) -> str:
        """The F word of a feed, and keep how it counts: per minute, or per turn of the spindle (FU).

        Raises
        ------
        BlockError
            A feed per turn without a spindle speed.
        """
        self.per_turn = number if per_turn else None
        return self.turning(self.machine.s.speed, number) if per_turn else self.feed_word(number)

    def teeth(self) -> int:
        """Number of teeth of the tool in the spindle.

        Raises
        ------
        BlockError
            Nothing states it.
        """
        found = self.machine.teeth.get(self.tool)
        if found is None:
            raise BlockError(f"FZ (a feed per tooth) with T{self.tool}, whose number of teeth is not known",
                             "give the feed per turn (FU) or per minute")
        self.notes.append(f"feeds per tooth (FZ) of T{self.tool} count with the {found} teeth (flutes) of the setup")
        return found

    def turning(self, speed: float, per_turn: float) -> str:
        """The F word of a feed per turn, units of the program, at a spindle speed, turns per minute.

        Raises
        ------
        BlockError
            The spindle has no speed.
        """
        if not speed > 0:
            raise BlockError(f"FU{per_turn:g} without a spindle speed", "give S in TOOL CALL")
        return f"F{digits(per_turn * speed)}"

    def _side(self, word: str) -> str:
        """The word of the reader that begins or ends radius compensation, '' for none."""
        if not word:
            return ""
        side = {"R0": 0, "RL": 1, "RR": -1}[word]
        if side == self.side:
            return ""
        if side and self.side:
            raise BlockError("RL and RR follow each other without R0 between them")
        self.side = side
        if side == 0:
            return "G40"
        code = "G41" if side > 0 else "G42"
        if self.tool not in self.machine.radii:
            return f"{code} D{self.tool}"
        diameter = 2 * (self.machine.radii[self.tool] + self.wider)
        if diameter < 0:
            raise BlockError(f"TOOL CALL with DR makes the radius of T{self.tool} negative")
        return f"{code}.1 D{digits(diameter / self.factor_of_unit)}"


__all__ = ["M_AFTER", "M_BEFORE", "M_IDLE", "M_WORDS", "Blocks", "HeidenhainWords", "Move", "Way", "Words"]
