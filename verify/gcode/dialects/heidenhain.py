"""Heidenhain, conversational: a keyword opens each block, FMAX makes a rapid for one block, F is modal.

The reader knows BEGIN and END PGM, BLK FORM, TOOL CALL, TOOL DEF, M words, LBL and STOP. Of motion it knows L, CC with
C or with CP and IPA, and CR, and the cycles 247 (preset) and 32 (tolerance). It knows PLANE SPATIAL with STAY while
M128 is on: X, Y, Z count in the setup frame turned about its X, then Y, then Z, the tip stays, and no axis moves. It
reads M126 and M127 where they make no difference. It refuses by name planes that move axes, radius compensation, other
incremental words (IX), other arcs, Q parameters, calls and shifts. F of an INCH program counts tenths of an inch.
"""

from __future__ import annotations

import math
import re

from geometry.mesh import F64
from verify.gcode.dialects.base import NUMBER, BlockError, DialectReader, zero_word
from verify.gcode.dialects.tilted_planes import placed, turn

_NUM = r"[+-]?(?:[0-9]{1,8}(?:\.[0-9]*)?|\.[0-9]+)"
_LINE = re.compile(rf"L((?: +[XYZABC]{_NUM})*)(?: +R0)?(?: +(FMAX|F{_NUM}))?((?: +M[0-9]+)*)")
_CENTRE = re.compile(rf"CC(?: +X({_NUM}))?(?: +Y({_NUM}))?")
_ARC = re.compile(rf"(C|CR)((?: +[XYZ]{_NUM})*)(?: +R({_NUM}))? +DR([+-])(?: +R0)?(?: +(F{_NUM}))?")
_POLAR = re.compile(rf"CP +IPA({_NUM})(?: +Z({_NUM}))? +DR([+-])(?: +R0)?(?: +(F{_NUM}))?")
_TOOL = re.compile(rf'TOOL CALL(?: +"?([0-9]+)"?)?(?: +([XYZ]))?(?: +S({NUMBER}))?(?: +F({NUMBER}))?'
                   r"(?: +D[LR][+-]?0*\.?0*)*")
_BEGIN = re.compile(r"BEGIN PGM (?:\S.*)? ?(MM|INCH)")
_PLANE = re.compile(rf"PLANE SPATIAL SPA({_NUM}) SPB({_NUM}) SPC({_NUM}) STAY")
_START, _END = (3, 4, 8, 13, 14, 128), (0, 1, 2, 5, 9, 30, 129)  # M words that act at the start or end of the block
SMALL = 0.01
"""deg, deviation of a rotary axis that needs no note."""
_SHORTEST, _AS_WRITTEN = 126, 127
HALF_A_TURN = 180.000001  # deg, rounding included
_WORDS = {13: "M3 M8", 14: "M4 M8", 128: "M428", 129: "M429"}
_IDLE = ("BLK FORM", "TOOL DEF", "CYCL DEF 32.0", "* -")


def is_conversational(text: str) -> bool:
    """Whether a text begins as a conversational program."""
    return re.match(r"\s*(?:[0-9]+\s+)?BEGIN PGM\b", text.upper()) is not None


class HeidenhainReader(DialectReader):
    """TNC 320 to 640, iTNC 530, TNC7."""

    home_from = 1

    def __init__(self) -> None:
        super().__init__()
        self.unbounded = True
        self.preset = self.tcp = self.inch = self.shortest = False
        self.turned: dict[str, float] = {}  # angles of the rotary axes after their words, deg
        self.plane: F64 | None = None  # columns are its axes in the setup frame
        self.at = [math.nan] * 3  # setup frame, in the unit of the program
        self.centre = [math.nan] * 2

    def blocks(self, raw: str) -> list[str]:
        """Blocks of one line, by its keyword; BlockError where it cannot be read."""
        text = re.sub(r"^\s*[0-9]+\s+(?=[A-Z*;])", "", raw.upper()).split(";", 1)[0].strip()
        if m := _LINE.fullmatch(text):
            return self._straight(m[1], m[2], [int(w[1:]) for w in m[3].split()])
        if self.preset:
            return self._preset(text)
        if not text or text.startswith(_IDLE) or re.fullmatch(r'LBL +(?:[0-9]+|"[^"]*")', text):
            return []
        if m := _BEGIN.fullmatch(text):
            self.inch = m[1] == "INCH"
            return [f"G{21 if m[1] == 'MM' else 20} G17 G90 G94 G40"]
        if m := _TOOL.fullmatch(text):
            return self._tool(m)
        if re.fullmatch(r"(?:STOP)?(?: *M[0-9]+)*", text):
            return self._machine([int(w) for w in re.findall(r"M([0-9]+)", text)], "M0" if "STOP" in text else "")
        if m := _CENTRE.fullmatch(text):
            self.centre = [c if w is None else float(w) for c, w in zip(self.centre, m.groups(), strict=True)]
            return []
        if m := _ARC.fullmatch(text):
            return self._arc(m)
        if m := _POLAR.fullmatch(text):
            return self._polar(m)
        if text.startswith("PLANE"):
            return self._tilt(text)
        if m := re.fullmatch(rf"CYCL DEF 32\.1(?: T({NUMBER}))?", text):
            self.bound(float(m[1] or 0.0) != 0.0)
            if not self.unbounded:
                return [f"G64 P{float(m[1]):.6f}"]
            self.notes.append("cycle 32 is off: machine parameters decide how far the control rounds corners; the "
                              "error bound does not include it")
            return []
        if m := re.fullmatch(rf"CYCL DEF 32\.2(?: HSC-MODE:[01])?(?: TA({NUMBER}))?", text):
            if m[1] and float(m[1]) > SMALL:
                self.notes.append(f"cycle 32 allows rotary axes a deviation of {m[1]} deg: the error bound does not "
                                  "include it")
            return []
        if re.fullmatch(r"CYCL DEF 247( [A-Z -]*)? ?~", text):
            self.preset = True
            return []
        return ["M30"] if text.startswith("END PGM") else self._no(text)

    def _no(self, text: str) -> list[str]:
        raise BlockError(f"cannot read '{text[:60]}'")

    def _tilt(self, text: str) -> list[str]:
        if re.fullmatch(r"PLANE RESET STAY", text):
            self.plane = None
            return []
        m = _PLANE.fullmatch(text)
        if m is None or not self.tcp:
            raise BlockError(f"cannot read '{text[:60]}': the reader knows PLANE SPATIAL and PLANE RESET with STAY, "
                             "and only while M128 is on")
        a, b, c = (math.radians(float(v)) for v in m.groups())
        self.plane = turn(2, c) @ turn(1, b) @ turn(0, a)
        return []

    def _setup(self, words: str, machine: bool) -> str:
        """The words with X, Y, Z in the setup frame."""
        named = {w[0]: w[1:] for w in words.split()}
        linear = [float(named[k]) if k in named else math.nan for k in "XYZ"]
        self._turn({k: float(v) for k, v in named.items() if k not in "XYZ"})
        if machine:
            self.at = [math.nan if k in named else v for k, v in zip("XYZ", self.at, strict=True)]
            return words
        if self.plane is None:
            self.at = [v if math.isnan(w) else w for v, w in zip(self.at, linear, strict=True)]
            return words
        if not named.keys() & set("XYZ"):
            return words
        self.at = placed(self.plane, self.at, named)
        turns = [k + v for k, v in named.items() if k not in "XYZ"]
        return " ".join([*(f"{k}{v:.9f}" for k, v in zip("XYZ", self.at, strict=True)), *turns])

    def _turn(self, angles: dict[str, float]) -> None:
        """Record the angles of the rotary words, deg. With M126 only turns of half a turn or less are certain."""
        for letter, angle in angles.items():
            way = angle - self.turned.get(letter, angle)
            if self.shortest and abs(way) > HALF_A_TURN:
                raise BlockError(f"with M126 {letter} turns by {way:g} deg or by {math.remainder(way, 360.0):g}, "
                                 "depending on whether its display counts beyond 360 deg",
                                 "turn by half a turn or less in a block")
        self.turned.update(angles)

    def _preset(self, text: str) -> list[str]:
        self.preset = False
        m = re.fullmatch(r"Q339= *\+?([0-9]+)", text)
        if m is None:
            raise BlockError(f"cycle 247 continues with '{text[:40]}' instead of Q339, the row of the preset table")
        return [zero_word(int(m[1]), f"preset {m[1]}")]

    def _tool(self, m: re.Match[str]) -> list[str]:
        if m[2] not in (None, "Z"):
            raise BlockError(f"TOOL CALL with the tool axis {m[2]}: only Z is read")
        if self.tcp:
            raise BlockError("TOOL CALL while M128 is on", "program M129 before it and M128 after it")
        out = [f"S{m[3]}"] if m[3] else []
        out += [self._feed(f"F{m[4]}")] if m[4] else []
        if m[1]:
            self.at[2] = math.nan
            out = [f"T{m[1]} M6", *out, *([f"G43 H{m[1]}"] if int(m[1]) else [])]
        return out

    def _straight(self, places: str, feed: str | None, ms: list[int]) -> list[str]:
        if self.plane is not None and 91 in ms:
            raise BlockError("M91 in a tilted plane")
        if self.tcp and 91 in ms:
            raise BlockError("M91 while M128 is on", "program M129 in a block before")
        self.shortest |= _SHORTEST in ms
        words = self._setup(" ".join(places.split()), 91 in ms)
        feed = self._feed(feed) if feed and feed != "FMAX" else feed
        ms = self._switch(ms)
        if not ms:
            return [f"G0 {words}" if feed == "FMAX" else f"G1 {words} {feed}" if feed else f"G1 {words}"]
        if unknown := [m for m in ms if m not in (*_START, *_END, 91)]:
            raise BlockError(f"unknown word M{unknown[0]}")
        motion = "G0" if feed == "FMAX" else "G1"
        machine = "G53 " if 91 in ms else ""
        rate = feed if feed and feed != "FMAX" else ""
        block = f"{machine}{motion} {words} {rate}".strip() if words else rate
        before = [_WORDS.get(m, f"M{m}") for m in ms if m in _START]
        after = [_WORDS.get(m, f"M{m}") for m in ms if m in _END]
        return [*before, *([block] if block else []), *after]

    def _feed(self, word: str) -> str:
        """The F word in units of the program per minute: F10 is one inch per minute in an INCH program."""
        return f"F{0.1 * float(word[1:]):.9f}" if self.inch else word

    def _switch(self, ms: list[int]) -> list[int]:
        """The M words without M126 and M127, which are kept as state."""
        self.tcp = 129 not in ms and (self.tcp or 128 in ms)
        self.shortest = _AS_WRITTEN not in ms and (self.shortest or _SHORTEST in ms)
        return [m for m in ms if m not in (_SHORTEST, _AS_WRITTEN)]

    def _arc(self, m: re.Match[str]) -> list[str]:
        """C round the centre of CC, or CR by a radius, whose sign chooses between the two arcs."""
        start, words = list(self.at), self._setup(" ".join(m[2].split()), False)
        if (m[1] == "CR") != (m[3] is not None):
            raise BlockError(f"{m[1]} {'without' if m[1] == 'CR' else 'with'} a radius R")
        return self._round(words, f"R{m[3]}" if m[3] else self._offset("C", start), m[4], m[5])

    def _polar(self, m: re.Match[str]) -> list[str]:
        """CP round the centre of CC by an angle of less than a turn in the direction DR; Z makes a helix."""
        angle = math.radians(float(m[1]))
        if not 0.0 < abs(angle) < 2.0 * math.pi or (angle > 0.0) != (m[3] == "+"):
            raise BlockError(f"CP IPA{m[1]} DR{m[3]}: the angle must be less than a turn and have the sign of DR")
        start, centre = list(self.at), self._offset("CP", self.at)
        (u, v), c, s = [a - b for a, b in zip(start[:2], self.centre, strict=True)], math.cos(angle), math.sin(angle)
        end = [self.centre[0] + c * u - s * v, self.centre[1] + s * u + c * v]
        words = " ".join([*(f"{k}{p:.12f}" for k, p in zip("XY", end, strict=True)), *([f"Z{m[2]}"] if m[2] else [])])
        return self._round(self._setup(words, False), centre, m[3], m[4])

    def _offset(self, word: str, start: list[float]) -> str:
        """Words I and J: the centre of an arc relative to its start."""
        if any(math.isnan(v) for v in (*start[:2], *self.centre)):
            raise BlockError(f"{word} needs a centre (CC) and a start that the program has stated")
        return " ".join(f"{k}{c - s:.12f}" for k, c, s in zip("IJ", self.centre, start, strict=False))

    def _round(self, words: str, centre: str, sense: str, feed: str | None) -> list[str]:
        if self.plane is not None:
            raise BlockError("an arc in a tilted plane")
        block = f"{'G3' if sense == '+' else 'G2'} {words} {centre}"
        return [f"{block} {self._feed(feed)}" if feed else block]

    def _machine(self, ms: list[int], stop: str) -> list[str]:
        ms = self._switch(ms)
        if unknown := [m for m in ms if m not in (*_START, *_END)]:
            raise BlockError(f"unknown word M{unknown[0]}")
        return [*(_WORDS.get(m, f"M{m}") for m in ms), *([stop] if stop else [])]
