"""Moves of a block of a Siemens program, from its words: places, arcs, polar words, tapping, dwells and cycles."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.siemens.siemens_arguments import CycleCall, check_override
from verify.gcode.dialects.siemens.siemens_corners import SiemensCorners
from verify.gcode.dialects.siemens.siemens_cycles import drilling_blocks
from verify.gcode.dialects.siemens.siemens_words import UNBOUNDED
from verify.gcode.dialects.stated_places import digits
from verify.gcode.flow.input_increment import counted, is_fine
from verify.program.arc_chords import PLANE_AXES

CURVES = frozenset({"CIP", "CT"})
"""Motions that are named, not numbered."""


@dataclass
class Line:
    """What the words of one block come to.

    out, before, after : words of the block, blocks before it and after it
    places : X, Y, Z, A, B, C as written, with their kind ('', AC, IC, ...); centre : I, J, K in the same way
    values : other names with a number; codes : G words
    set_here : names of variables that the block sets
    """

    out: list[str] = field(default_factory=list)
    before: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)
    places: dict[str, tuple[float, str]] = field(default_factory=dict)
    centre: dict[str, tuple[float, str]] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    codes: list[int] = field(default_factory=list)
    set_here: list[str] = field(default_factory=list)
    frame: str = ""
    modal: bool = False
    change: bool = False


class SiemensMoves(SiemensCorners):
    """Motion of the control.

    motion    : G number or name of the motion in force, None before the first
    tolerance : mm or inch, of the path (CTOL); rounding : of corners (ADIS)
    follows   : the name of the value that bounds the rounding in force (CTOL, ADIS), '' for none
    by_data   : whether machine data decide which of the two counts (G642 to G645; MD20480)
    axis_tolerance : deg, of the tool axis (OTOL); cycle_lean : deg, of CYCLE832
    smooths   : the words in force, besides G642 to G645, for which OTOL counts: ORISON, a compressor
    cycle     : the drilling cycle that MCALL repeats after each move
    end       : (3,) mm, end of the latest move in the coordinates of the control
    """

    def __init__(self) -> None:
        super().__init__()
        self.motion: int | str | None = None
        self.tolerance: float | None = None
        self.rounding: float | None = None
        self.axis_tolerance = self.cycle_lean = 0.0
        self.smooths: set[str] = set()
        self.follows, self.by_data = "", False
        self.least_speed, self.top_speed = 0.0, math.inf  # 1/min, of G25 S and G26 S
        self.cycle: CycleCall | None = None
        self.end = [math.nan] * 3

    def count(self, line: Line) -> None:
        """Round the words of a block as the control counts, in a reading that does; note increments that are finer."""
        from_place = self.relative or not {110, 112}.isdisjoint(line.codes)
        for name, (number, kind) in line.places.items():
            line.places[name] = self._counted(name, number, kind == "IC" or (from_place and not kind)), kind
        for name in ("AP", "RP"):
            if line.kinds.get(name) == "IC":
                line.values[name] = self._counted(name, line.values[name], True)
        if "CR" in line.values:
            line.values["CR"] = self._counted("CR", line.values["CR"], False)

    def _counted(self, name: str, number: float, adds: bool) -> float:
        """The number that this reading takes for a word; ``adds``: whether it counts from the latest place."""
        unit = 1.0 if name in ("A", "B", "C", "AP") else self.unit
        short = counted("X", number * unit, (), False)
        if not is_fine(number * unit, short, "X", False):
            return number
        if self.machine.counts:
            return short / unit
        if adds:
            self.note_fine()
        return number

    def note_fine(self) -> None:
        """Note the running line as one whose digits the control does not count."""
        if not self.machine.counts:
            self.machine.fine_line = self.machine.fine_line or self.machine.log.line

    def feed_of_block(self, line: Line) -> None:
        """FB, the feed of one block: it counts as F, and the F before it counts again in the next block."""
        if "FB" not in line.values:
            return
        s = self.machine.s
        old = line.values.get("F", s.feed if s.feed_mode == 93 else s.feed / s.scale)
        line.values["F"] = line.values["FB"]
        if not math.isnan(old):
            line.after.append(f"F{digits(old)}")

    def _rates(self, line: Line) -> list[str]:
        return [f"{k}{digits(line.values[k])}" for k in "SF" if k in line.values]

    def _cycle_there(self, line: Line) -> list[str]:
        """The cycle of MCALL at the end of the move."""
        assert self.cycle is not None
        place = self.end
        if self.machine.s.motion not in (self.motion, None) and not isinstance(self.motion, int):
            raise BlockError("a cycle of MCALL after CIP or CT")
        return self._restored(drilling_blocks(self.cycle, place, self.machine))

    def _restored(self, blocks: list[str]) -> list[str]:
        """Blocks of a cycle, and the motion in force again."""
        return [*blocks, f"G{self.motion}"] if isinstance(self.motion, int) else blocks

    def _move(self, line: Line) -> list[str | tuple[int, str]]:
        """The move of a block; ``end`` is its end afterwards."""
        machine_place = "G53" in line.out
        corner = self.corner_of(line.values)
        words, centre = self._absolute(line, machine_place)
        if {"AP", "RP"} & line.values.keys():
            self._polar(line, words)
        if "AR" in line.values:
            self._opened(line, words, centre)
        here = self.here()
        self.end = [h if k not in words else float(words[k]) * self.unit + (
            h if self.relative and k in line.places and line.places[k][1] != "AC" else 0.0)
            for k, h in zip("XYZ", here, strict=True)]
        linear = {k: v for k, v in words.items() if k in "XYZ"}
        turns = {k: v for k, v in words.items() if k not in "XYZ"}
        vector = [line.values.get(k) for k in ("A3", "B3", "C3")]
        plane = {"XYZ"[n] for n in PLANE_AXES[self.machine.s.plane][:2]}
        level = all(k in plane or abs(self.end["XYZ".index(k)] - here["XYZ".index(k)]) < 1e-9 for k in linear)
        if corner is not None and not (plane & linear.keys() and level):
            self.left_out(corner[0], self.number)
            corner = None
        if self.held is not None and (not level or self.changes_plane(line.codes)):
            return [*self.flushed(), *self._move(line)]
        if self.held is not None or corner is not None:
            if (machine_place or self.relative or turns or any(v is not None for v in vector)
                    or {"TURN", "FB"} & line.values.keys() or self.motion not in (0, 1, 2, 3)
                    or self.cycle is not None):
                raise BlockError("a corner (RND, RNDM, CHF, CHR) next to a move that is not a plain G0, G1, G2 or G3 "
                                 "in "
                                 "absolute coordinates")
            spin = [f"S{digits(line.values['S'])}"] if "S" in line.values else []
            return self.cornered([*line.out, *spin], f"G{self.motion}", self.end, centre, line.values, corner)
        if any(v is not None for v in vector) or (self.circle and turns and self.tcp and not machine_place):
            return list(self._turned(line, linear, turns, vector))
        if self.motion == "CT":
            return [self._with(line, self.tangent_arc(linear))]
        if self.motion == "CIP":
            return [self._with(line, self.point_arc(linear, self._through(line)))]
        if not machine_place and not self.relative:
            settled = self.settle(linear, self.motion == 0)
            if settled is None and not turns:
                head = [*line.out, *self._rates(line)]
                return [" ".join(head)] if head else []
            linear = settled or {}
        motion = [] if {0, 1, 2, 3} & set(line.codes) or not isinstance(self.motion, int) else [f"G{self.motion}"]
        out = [*line.out, *motion, *(f"{k}{v}" for k, v in {**linear, **turns}.items()),
               *(f"{k}{v}" for k, v in centre.items())]
        if "CR" in line.values:
            out.append(f"R{digits(line.values['CR'])}")
        if "TURN" in line.values:
            if self.motion not in (2, 3):
                raise BlockError("TURN= without G2 or G3")
            out.append(f"P{digits(line.values['TURN'] + 1)}")
        if self.motion in (2, 3):
            self.note_arc(out)
        return [" ".join([*out, *self._rates(line)])]

    def _with(self, line: Line, block: str) -> str:
        """A block of its own motion with the other words of its line."""
        return " ".join([*line.out, block, *self._rates(line)])

    def _through(self, line: Line) -> dict[str, float]:
        here = self.here()
        out = {}
        for k, letter in enumerate("XYZ"):
            name = "IJK"[k] + "1"
            if name in line.values:
                relative = line.kinds[name] == "IC" or (self.relative and line.kinds[name] != "AC")
                out[letter] = line.values[name] * self.unit + (here[k] if relative else 0.0)
        return out

    def _turned(self, line: Line, linear: dict[str, str], turns: dict[str, str],
                vector: list[float | None]) -> list[str]:
        """A straight move that turns the tool axis to a vector or along a great circle."""
        if self.motion not in (0, 1):
            raise BlockError("a tool vector (A3, B3, C3) or ORIWKS in an arc")
        if self.machine.s.feed_mode == 93 or 93 in line.codes:
            raise BlockError("a tool vector (A3, B3, C3) or ORIWKS with inverse time feed (G93)")
        given = None if all(v is None for v in vector) else [v or 0.0 for v in vector]
        if given is not None and turns:
            raise BlockError("a tool vector (A3, B3, C3) and rotary words in one block")
        settled = self.settle(linear, self.motion == 0) or {}
        feed = f"F{digits(line.values['F'])}" if "F" in line.values else ""
        blocks = self.oriented(f"G{self.motion}", settled, feed, given, {k: float(v) for k, v in turns.items()})
        head = [w for w in line.out if w not in ("G0", "G1")]
        head += [f"S{digits(line.values['S'])}"] if "S" in line.values else []
        return [*([" ".join(head)] if head else []), *blocks]

    def _absolute(self, line: Line, machine_place: bool) -> tuple[dict[str, str], dict[str, str]]:
        """Words of coordinates and centre as the reader counts them: AC, IC and the like are resolved."""
        here = self.here()
        words: dict[str, str] = {}
        for letter, (number, kind) in line.places.items():
            if letter in "XYZ":
                self.counts(letter, not machine_place and kind != "AC" and (kind == "IC" or self.relative))
            if kind in ("DC", "ACP", "ACN") or (kind and letter in "ABC"):
                words[letter] = digits(self._rotary(letter, number, kind))
            elif not kind or (kind == "IC") == self.relative:
                words[letter] = digits(number)
            else:
                at = here["XYZ".index(letter)] / self.unit
                if math.isnan(at):
                    raise BlockError(f"{letter}={kind}({number:g}) starts at a place that the program has not stated")
                words[letter] = digits(at + number if kind == "IC" else number - at)
            if machine_place and kind == "IC":
                raise BlockError(f"{letter}=IC( ) with SUPA or G53")
        centre = {}
        for letter, (number, kind) in line.centre.items():
            at = here["IJK".index(letter)] / self.unit
            if kind == "AC" and math.isnan(at):
                raise BlockError(f"{letter}=AC({number:g}): the arc starts at a place that the program has not stated")
            centre[letter] = digits(number - at if kind == "AC" else number)
        return words, centre

    def _rotary(self, letter: str, number: float, kind: str) -> float:
        """deg, the angle after a rotary word with DC (shorter way), ACP, ACN (positive, negative way), AC or IC."""
        if letter not in self.machine.rotary:
            if letter in "XYZ":
                raise BlockError(f"{letter}={kind}( ) is for rotary axes")
            return number
        now = self.machine.s.turn[self.machine.rotary.index(letter)]
        if kind != "AC":
            self.machine.log.ways_told.add(self.machine.log.line)
        if kind == "AC":
            found = number
        elif kind == "IC":
            found = now + number
        elif kind == "DC":
            found = now + math.remainder(number - now, 360.0)
        else:
            way = (number - now) % 360.0
            found = now + (way if kind == "ACP" or way == 0 else way - 360.0)
        return found - now if self.relative else found

    def _polar(self, line: Line, words: dict[str, str]) -> None:
        """Put the end of polar words into the words of the block; an arc has its centre in the pole."""
        i, j, _ = PLANE_AXES[self.machine.s.plane]
        if self.relative or "XYZ"[i] in words or "XYZ"[j] in words:
            raise BlockError("polar words (AP, RP) with words of the plane, or in incremental coordinates")
        angle, radius = line.values.get("AP"), line.values.get("RP")
        if angle is not None and line.kinds["AP"] == "IC":
            angle += self.polar[1]
        if radius is not None:
            radius *= self.unit
            if line.kinds["RP"] == "IC":
                radius += self.polar[0]
        here = self.known("a polar word") if self.motion in (2, 3) else self.here()
        if self.motion in (2, 3) and radius is None:
            radius = math.hypot(here[i] - self.pole[i], here[j] - self.pole[j])
        u, v = self.polar_end(radius, angle)
        words["XYZ"[i]], words["XYZ"[j]] = digits(u / self.unit), digits(v / self.unit)
        if self.motion in (2, 3) and not line.centre and "CR" not in line.values:
            for n in (i, j):
                words["IJK"[n]] = digits((self.pole[n] - here[n]) / self.unit)

    def _opened(self, line: Line, words: dict[str, str], centre: dict[str, str]) -> None:
        """An arc by its opening angle AR, deg: the radius follows from its end, or its end from the centre."""
        angle, here = math.radians(line.values["AR"]), self.known("AR=")
        if self.relative or not 0.0 < angle < math.tau or "CR" in line.values:
            raise BlockError("AR= in incremental coordinates, with CR=, or outside of 0 to 360 deg")
        i, j, _ = PLANE_AXES[self.machine.s.plane]
        start = complex(here[i], here[j]) / self.unit
        if line.centre:
            arm = -complex(*(float(centre.get("IJK"[n], "0")) for n in (i, j)))
            end = start - arm + arm * cmath.rect(1.0, angle if self.motion == 3 else -angle)
            if {"XYZ"[i], "XYZ"[j]} & words.keys():
                raise BlockError("AR= with both the end and the centre of an arc")
            words["XYZ"[i]], words["XYZ"[j]] = digits(end.real), digits(end.imag)
            return
        end = complex(*(float(words.get("XYZ"[n], repr(here[n] / self.unit))) for n in (i, j)))
        radius = 0.5 * abs(end - start) / math.sin(0.5 * angle)
        line.values["CR"] = radius if angle <= math.pi else -radius

    def held_speed(self, speed: float) -> float:
        """A speed of the spindle within G25 and G26, 1/min; one of 0 stays."""
        return min(max(speed, self.least_speed), self.top_speed) if speed > 0.0 else speed

    def _special(self, line: Line) -> list[str] | None:
        """Blocks whose coordinates mean something else; None for all others."""
        codes = set(line.codes)
        places = {k: v for k, (v, _) in line.places.items()}
        if 4 in codes:
            return self._dwell(line)
        head = [" ".join([*line.out, *self._rates(line)])] if line.out else []
        if codes & {25, 26}:
            if "S" in line.values:
                self.least_speed, self.top_speed = ((self.least_speed, line.values["S"]) if 26 in codes
                                                    else (line.values["S"], self.top_speed))
                now = self.machine.s.speed
                head += [f"S{digits(held)}"] if (held := self.held_speed(now)) != now and now > 0.0 else []
            return head
        if pole := codes & {110, 111, 112}:
            if line.values.keys() & {"AP", "RP"}:
                raise BlockError("a pole given by polar words")
            self.set_pole(min(pole), places)
            return head
        if codes & {74, 75}:
            names = {k for k in "XYZABC" if k in places or k + "1" in line.values}
            if not names:
                raise BlockError("G74 or G75 needs the axes that go")
            if line.values.get("FP", 1.0) != 1.0:
                raise BlockError(f"G75 FP={line.values['FP']:g}: the proof does not know where that fixed point is",
                                 "go to the first fixed point (FP=1), or to a place of the program")
            self.forget()
            turned = sorted(names & set("ABC"))
            way = " ".join(["G0 G53", *(f"{k}0" for k in sorted(names))])
            if turned and not set(turned) <= set(self.machine.rotary):
                raise BlockError(f"G74 or G75 {turned[0]}: the machine has no such rotary axis")
            return self._restored([*head, way])
        if codes & {63, 331, 332}:
            check_override("tapping (G63, G331, G332)", self.machine)
            return self._tapped(line, places, 63 in codes)
        return None

    def _dwell(self, line: Line) -> list[str]:
        """G4 F (seconds) or S (turns of the spindle)."""
        if line.places:
            raise BlockError("coordinates in a block with G4")
        speed = self.machine.s.speed
        if "F" in line.values:
            seconds = line.values["F"]
        elif "S" in line.values and speed > 0:
            seconds = line.values["S"] * 60.0 / speed
        else:
            raise BlockError("G4 without F (seconds)")
        rest = [w for w in line.out if w != "G4"]
        return [*([" ".join(rest)] if rest else []), f"G4 P{digits(seconds)}"]

    def _tapped(self, line: Line, places: Mapping[str, float], chuck: bool) -> list[str]:
        """G331 and G332 (rigid, pitch in I, J, K) and G63 (floating chuck, with F): a straight feed.

        Rigid tapping turns the spindle itself and leaves it standing.
        """
        words, _ = self._absolute(line, False)
        speed = line.values.get("S", self.machine.s.speed)
        feed = line.values.get("F")
        if not chuck:
            pitch = max((abs(v) for v, _ in line.centre.values()), default=0.0)
            if not pitch or not speed > 0:
                raise BlockError("G331 and G332 need a pitch (I, J, K) and a speed (S)")
            feed = pitch if self.machine.s.feed_mode == 95 else pitch * speed
            self.machine.log.tap(any(v < 0 for v, _ in line.centre.values()), out=332 in line.codes)
        if not places:
            raise BlockError("tapping without coordinates")
        old = self.machine.s.feed
        rate = [] if feed is None else [f"F{digits(feed)}"]
        settled = words if self.relative else self.settle(words, False)
        block = " ".join([*line.out, "G1", *(f"{k}{v}" for k, v in (settled or {}).items()), *rate,
                          *([f"S{digits(line.values['S'])}"] if "S" in line.values else [])])
        spin = not chuck and not self.machine.s.turning
        back = [] if math.isnan(old) or chuck else [f"F{digits(old / self.unit)}"]
        return self._restored([*([f"S{digits(speed)} M3"] if spin else []), block, *back, *([] if chuck else ["M5"])])

    def _path(self, line: Line) -> list[str]:
        """Words that bound the rounding of corners, and how far the tool axis leans off."""
        words = self._rounded(line)
        if "OTOL" in line.values:
            self.axis_tolerance = max(line.values["OTOL"], 0.0)
        if "COMPRESS" in line.values:
            self.smooths.add("COMPRESS")
        self.lean = max(self.cycle_lean, self.axis_tolerance if self.smooths or self.by_data else 0.0)
        return words

    def _rounded(self, line: Line) -> list[str]:
        """Words that bound the rounding of corners."""
        values, again = line.values, ""
        if "CTOL" in values:
            self.tolerance, again = values["CTOL"] if values["CTOL"] >= 0 else None, "CTOL"
        if "ADIS" in values or "ADISPOS" in values:
            self.rounding, again = max(values.get("ADIS", 0.0), values.get("ADISPOS", 0.0)), again or "ADIS"
        if not {60, 64, 641, 642, 643, 644, 645}.isdisjoint(line.codes):
            self.follows, self.by_data = "", not UNBOUNDED.difference({64}).isdisjoint(line.codes)
        if 641 in line.codes or (again == self.follows == "ADIS"):
            if self.rounding is None:
                raise BlockError("G641 without ADIS in its block or before: the rounding of corners is unknown")
            self.follows = "ADIS"
            self.bound(True)
            return [f"G64 P{self.rounding:.6f}"]
        if self.by_data or "COMPRESS" in values:
            self.follows = "CTOL"
        rounds = not UNBOUNDED.isdisjoint(line.codes)
        begins = (rounds and 64 not in line.codes) or "COMPRESS" in values
        by_data = (self.rounding or 0.0) if self.by_data else 0.0
        if (begins or again == self.follows == "CTOL") and self.tolerance is not None and 64 not in line.codes:
            self.bound(True)
            return [f"G64 P{max(self.tolerance, by_data):.6f}"]
        if rounds:
            self.notes.append("G64 or G642 to G645 without a tolerance (CTOL): machine data decide how far the control "
                              "rounds corners; the error bound does not include it")
            self.bound(False)
        if by_data and (rounds or again == "ADIS"):
            return [f"G64 P{by_data:.6f}"]
        if rounds:
            return []
        if "COMPRESS" in values:
            self.notes.append("a compressor (COMPON, COMPCURV, COMPCAD, COMPSURF) without CTOL: machine data decide "
                              "how far it "
                              "leaves the path; the error bound does not include it")
            self.bound(False)
        return []


__all__ = ["CURVES", "Line", "SiemensMoves"]
