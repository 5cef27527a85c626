"""Motion of a block: straight lines, arcs, drilling cycles, moves to fixed places of the machine."""

from __future__ import annotations

import itertools
import math

import numpy as np

from geometry.mesh import F64
from verify.gcode.block_words import CYCLES, SHIFTS, TURNS, Block, BlockError, whole
from verify.gcode.drilling_cycles import Hole, HoleExit, hole_moves
from verify.gcode.flow.input_increment import is_fine_arc
from verify.gcode.frame_words import FrameWords
from verify.gcode.rotary_words import between
from verify.program.arc_chords import (
    PLANE_AXES,
    ArcError,
    ArcTooLong,
    arc_sweep,
    centre_from_radius,
    swept_points,
)
from verify.program.move_kinds import FEED, RAPID
from verify.program.move_log import MAX_MOVES_A_BLOCK
from verify.program.program import NAN
from verify.program.turn_subdivision import TIP

COUNT, INCH_COUNT = 1e-3, 2.54
"""mm, what controls count in, and what that is in inches (0.0001 inch) by comparison."""
SAME_ENDS = 1e-6
"""mm: ends of an arc that are no farther apart are one place in ``arc_sweep``."""
WAY_HOME = "a move of X or Y to a fixed place of the machine"
_EXITS = {74: HoleExit.FEED_TO_CLEAR, 84: HoleExit.FEED_TO_CLEAR, 85: HoleExit.FEED_TO_CLEAR, 89: HoleExit.FEED}


class BlockMotion(FrameWords):
    """Moves of the blocks, written to the log; ``dwell`` is the sum of their dwells, s."""

    dwell = 0.0

    def _move(self, block: Block) -> None:
        s, values = self.s, block.values
        axes = [values.get(a) for a in "XYZ"]
        self._polar_words(block)
        plane = PLANE_AXES[s.plane]
        self.across = bool(self.polar) or axes[plane[0]] is not None or axes[plane[1]] is not None
        turn = self._turn(values, absolute=53 in block.codes)
        circle = s.motion in (2, 3) and not values.keys().isdisjoint("IJK")
        moves = turn is not None or bool(self.polar) or circle or any(a is not None for a in axes)
        if 4 in block.codes and not (self._wait(moves, values) and moves):
            return None
        if not SHIFTS.isdisjoint(block.codes):
            self._settled("a word that moves program zero")
            return self._shift_origin(block, axes)
        if not TURNS.isdisjoint(block.codes):
            return self._turn_word(block, axes)
        if 53 in block.codes:
            return self._machine_place(axes, turn)
        if not {28, 30}.isdisjoint(block.codes):
            return self._home(axes, turn, values)
        if not moves:
            return None
        if s.motion is None or s.motion == 80:
            return self.log.error("coordinates without a motion word")
        self.incremental_moved = True
        if self.turned:
            self._check_turned(axes)
        if s.motion in CYCLES:
            if turn is not None and turn != s.turn:
                return self.log.error("a drilling cycle turns a rotary axis in its block: turn it in a block before")
            return self._cycle(axes, values)
        target = self._target(axes)
        if s.motion == 0:
            return self._go(target, RAPID, NAN, turn)
        feed = self._feed(values)
        if feed is None:
            return None
        self._check_cutting(target)
        if s.motion == 1:
            rate, minutes = self._timing(feed, math.dist(self._here(), target), turn)
            return self._go(target, FEED, rate, turn, minutes)
        return self._arc(target, values, feed, turn)

    def _wait(self, moves: bool, values: dict[str, float]) -> bool:
        """G4: whether it is followed. LinuxCNC dwells before it moves; P would be the turns of an arc as well."""
        refused = ""
        if "P" not in values:
            refused = "G4 needs P"
        elif values["P"] < 0:
            refused = f"G4 P{values['P']:g} is a negative dwell"
        elif moves and self.control is not None:
            refused = "coordinates in a block with G4: some controls move, some dwell"
        elif moves and self.s.motion not in (0, 1):
            refused = "coordinates in a block with G4 that G0 or G1 does not lead to"
        if refused:
            self.log.error(refused)
            return False
        self.dwell += values["P"]
        self.log.dwells.append((self.log.line, self.log.count, values["P"]))
        return True

    def _target(self, axes: list[float | None]) -> list[float]:
        s = self.s
        if s.relative:
            for letter, a, p in zip("XYZ", axes, s.position, strict=True):
                if a and math.isnan(p):
                    self.log.remark("incremental_unknown", f"an incremental move ({letter}{a:g}, G91 of line "
                                    f"{self.incremental_line}) starts at a place that the program has not stated")
        target = [p if a is None else (p + a * s.scale if s.relative else a * s.scale + zero)
                  for a, p, zero in zip(axes, self._here(), s.origin, strict=True)]
        if self.polar:
            target[:2] = self._polar_place(*self.polar)
        return target

    def _machine_place(self, axes: list[float | None], turn: list[float] | None) -> None:
        """G53: the linear axes named are unknown afterwards, the rotary axes stand at their words.

        Only home is known to lie above everything: another Z gets a remark.
        """
        s = self.s
        self._settled("G53")
        if s.motion != 0 and self.control is None:
            return self.log.error("G53 needs G0: the proof cannot see a feed move in machine coordinates")
        if axes[2]:
            self.log.remark("machine_height", f"G53 Z{axes[2]:g} goes to a height that the proof does not know; only "
                            "Z0 (home) counts as above everything", self.log.line)
        named = [a is not None for a in axes]
        self.log.places.extend((self.log.line, k, a * s.scale) for k, a in enumerate(axes) if a is not None)
        if s.relative and (any(named) or turn is not None):
            self.log.remark("machine_relative", "G53 in incremental coordinates (G91), which controls read "
                            "differently", self.log.line)
        return self._away(named, turn)

    def _home(self, axes: list[float | None], turn: list[float] | None, values: dict[str, float]) -> None:
        """G28 and G30: pass a programmed point, then the axes named (all if none is) go home; rotary home is 0."""
        self._settled("G28 or G30")
        named = [a is not None for a in axes]
        self._told(letter for letter in self.rotary if letter in values or not (any(named) or turn))
        if not any(named) and turn is None:
            return self._away([True] * 3, [0.0, 0.0] if self.rotary else None)
        self._line_to(self._target(axes), RAPID, NAN, turn)
        if turn is not None:
            turn = [0.0 if letter in values else t for letter, t in zip(self.rotary, turn, strict=True)]
        return self._away(named, turn)

    def _away(self, named: list[bool], turn: list[float] | None) -> None:
        """Move the linear axes named to fixed places of the machine, the rotary axes to ``turn`` (2,) deg.

        A move in X or Y, or one that turns an axis, gets a remark unless Z is home before.
        """
        s = self.s
        if not any(named):
            return None if turn is None else self._line_to(list(s.position), RAPID, NAN, turn)
        if not math.isnan(s.position[2]):
            if (named[0] or named[1]) and (s.tilted or not self.stop(WAY_HOME, room=True)):
                self.log.remark("machine_way", f"X or Y moves to a fixed place of the machine from Z{s.position[2]:g}; "
                                "the proof does not know where that leaves the tool: send Z home first", self.log.line)
            if turn is not None and turn != s.turn:
                self.log.remark("machine_turn", "a rotary axis turns during a move to a fixed place of the machine "
                                f"from Z{s.position[2]:g}; the proof does not know that path: send Z home first",
                                self.log.line)
        along, s.along_tool = s.along_tool, False
        if not (named[0] or named[1]):
            self._lift(along)
        self._leave(named)
        if along and s.tilted:
            s.position = [NAN] * 3
        s.parked |= named[0] or named[1]
        return None if turn is None else self._stand(turn)

    def _lift(self, along: bool) -> None:
        """Write the way home in Z from a known place as a rapid of no length: only the proof knows how far it goes.

        along : whether it goes along the tool
        """
        tip = self._tip()
        if not any(map(math.isnan, tip)):
            self.log.lifts.append((self.log.count, along))
            self.log.move(tip, tip, RAPID, NAN, self.s.tool, 0)

    def _feed(self, values: dict[str, float]) -> float | None:
        s = self.s
        feed = (values.get("F", NAN) if s.feed_mode == 93 else s.feed) * s.override
        if not feed > 0:
            self.log.error("inverse time feed (G93) needs F in every block" if s.feed_mode == 93
                           else "a feed move without a feed (F)")
            return None
        if s.feed_mode == 95:
            if not s.speed > 0:
                self.log.error("feed per turn (G95) without a spindle speed")
                return None
            return feed * s.speed
        return feed

    def _check_cutting(self, target: list[float]) -> None:
        s, remark = self.s, self.log.remark
        if s.tool == 0:
            remark("no_tool", "a feed move without a tool in the spindle (no T and M6 before it)")
        if self.pallet:
            remark("pallet", f"a feed move behind M60 of line {self.pallet}, which changes the pallet: another blank "
                   "is there then; a pause is M0")
        if s.offset is None:
            remark("offset_off", f"a feed move with the length offset off ({self._no_length()})", s.tool)
        elif s.offset != s.tool:
            remark("offset_stale", f"a feed move with length offset H{s.offset} and tool T{s.tool}", (s.offset, s.tool))
        if not s.turning:
            why = "no M3" if not s.spindle else "no S given" if math.isnan(s.speed) else f"S{s.speed:g}"
            remark("spindle", f"a feed move with the spindle standing ({why})", (s.tool, why))
        if any(math.isnan(v) for v in target):
            remark("unknown", "a feed move starts at a place that the program has not stated")

    def _arc(self, target: list[float], values: dict[str, float], feed: float, turn: list[float] | None) -> None:
        s, error = self.s, self.log.error
        if any(math.isnan(v) for v in s.position):
            return error("an arc starts at a place that the program has not stated")
        axes = PLANE_AXES[s.plane]
        start, end = np.array(self._here()), np.array(target)
        letters = ["IJK"[axes[0]], "IJK"[axes[1]]]
        turns = whole(values, "P", 1)
        try:
            if "R" in values:
                centre = centre_from_radius(start, end, values["R"] * s.scale, s.motion == 2, axes)
                self._note_fine_arc(start[list(axes[:2])], end[list(axes[:2])], values["R"] * s.scale)
            elif any(c in values for c in letters):
                offset = np.array([values.get(c, 0.0) * s.scale for c in letters])
                if s.centre_absolute and not all(c in values for c in letters):
                    return error(f"absolute arc centres (G90.1) need both {letters[0]} and {letters[1]}")
                centre = offset + (np.array(s.origin) if s.centre_absolute else start)[list(axes[:2])]
            else:
                return error(f"an arc without its centre ({letters[0]}, {letters[1]}) or R in plane G{s.plane}")
            if values.get("IJK"[axes[2]], 0.0) != 0 and "R" not in values:
                return error(f"the word {'IJK'[axes[2]]} has no meaning in plane G{s.plane}")
            sweep = arc_sweep(start, end, centre, s.motion == 2, axes, turns)
            middle = float(centre[0]), float(centre[1])
            if "R" not in values and not self.fits:
                self._one_place(start[list(axes[:2])], end[list(axes[:2])], centre)
            if self.contour is not None:
                rate, _ = self._timing(feed, _length(start, end, centre, sweep, axes), turn)
                return self._bow(target, complex(*middle), sweep, rate)
            if self.actual is not None:
                return error("an arc right after G40: the tool must come back to the contour in a straight move first")
            points = swept_points(start.tolist(), target, middle, sweep, axes, self._arc_chord(turn),
                                  MAX_MOVES_A_BLOCK).tolist()
        except ArcTooLong as problem:
            return self.log.room(problem.points)
        except ArcError as problem:
            return error(str(problem))
        self.log.room(len(points))
        length = sum(math.dist(a, b) for a, b in itertools.pairwise([start.tolist(), *points]))
        rate, minutes = self._timing(feed, length, turn)
        was, n = s.turn, len(points)
        if turn is None:
            return self._chords(points, rate, minutes / n)
        for k, p in enumerate(points, 1):
            self._line_to(p, FEED, rate, between(was, turn, k / n), minutes / n)
        return None

    def _note_fine_arc(self, start: F64, end: F64, radius: float) -> None:
        """Note the line of an arc by its radius whose centre hangs on digits that the control does not count.

        start, end : (2,) float64, mm, in the plane of the arc; radius : mm, negative for the longer arc
        """
        if self.fine_line or self.counts or self.control is None or self.control.increment is None:
            return
        increment = self.control.increment
        if is_fine_arc(start, end, radius, increment.step if self.s.scale == 1.0 else increment.inch_step):
            self.fine_line = self.log.line

    def _one_place(self, start: F64, end: F64, centre: F64) -> None:
        """Tell of an arc whose ends a control that counts in 0.001 mm (0.0001 inch) takes for one place.

        start, end, centre : (2,) mm, in the plane of the arc

        An arc that ends where it begins is a whole circle.
        """
        step, apart = COUNT * (1.0 if self.s.scale == 1.0 else INCH_COUNT), float(np.hypot(*(end - start)))
        if apart < SAME_ENDS or math.dist(start, centre) < step:
            return
        if any((cut(start / step) == cut(end / step)).all() for cut in (np.round, np.trunc)):
            self.log.remark("short_arc", f"the ends of an arc are {apart:.2g} mm apart: a control that counts in "
                            f"{step:g} mm takes them for one place and runs a whole circle of radius "
                            f"{math.dist(start, centre):.3f} mm; write a straight line")

    def _arc_chord(self, turn: list[float] | None) -> float:
        """Largest distance of chords from their arc, mm; half where a turning axis bends the tip path once more."""
        bent = turn is not None and turn != self.s.turn and not self.s.tcp
        frame = self._frame()
        chord = max(self.chord - TIP, 0.5 * self.chord) if bent else self.chord
        return chord / (1.0 if frame is None else frame.scale_in(self.s.plane))

    def _cycle(self, axes: list[float | None], values: dict[str, float]) -> None:
        """Write a drilling cycle along the third axis of the plane as rapids and feeds [Kramer2000].

        In a series, G98 returns to the height where the series began, and G91 counts R from it, as in LinuxCNC. Its
        move to the next hole climbs on its way where the last hole was left at R. LinuxCNC goes up to R first where the
        series begins below it. Fanuc and Haas go aside at the height where the tool stands, and G98 returns there.
        """
        s, error = self.s, self.log.error
        self._settled("a drilling cycle")
        k, here = PLANE_AXES[s.plane][2], self._here()
        if s.feed_mode == 93:
            return error("a drilling cycle in inverse time (G93), whose moves have no feed of their own: program G94 "
                         "or G95 before it")
        if s.cycle.setdefault("plane", s.plane) != s.plane:
            return error("a drilling cycle continues in another plane: end it with G80 first")
        self._pecks(values)
        s.cycle.update({c: values[c] for c in "RQP" if c in values})
        if (depth := axes[k]) is not None:
            s.cycle["XYZ"[k]] = depth
        step = () if s.motion not in (73, 83) or (self._shrinks() and "I" in s.cycle) else ("Q",)
        missing = [c for c in ("XYZ"[k], "R", *step) if c not in s.cycle]
        if missing:
            return error(f"a drilling cycle without {', '.join(missing)}")
        if math.isnan(here[k]):
            return error("a drilling cycle starts at a height that the program has not stated")
        if s.cycle.get("P", 0.0) < 0:
            return error(f"P{s.cycle['P']:g} is a negative dwell")
        feed = self._feed(values)
        repeats = self._holes(values)
        hole = self._hole(k, values, depth) if feed is not None else None
        if hole is None or feed is None:
            return None
        self.log.room(repeats * hole.moves)
        if s.motion in (74, 84) and repeats:
            self.log.tap(s.motion == 74)
        across = [None if axis == k else a for axis, a in enumerate(axes)]
        if self.control is None and repeats and s.cycle["top"] + s.origin[k] < hole.clear != here[k]:
            self._line_to([hole.clear if axis == k else p for axis, p in enumerate(here)], RAPID, NAN)
        for _ in range(repeats):
            at = self._target(across)
            if self.control is None:
                at[k] = at[k] if at[k] > hole.clear else hole.back
            self._check_cutting(at)
            for point, kind in hole_moves(hole, at, k):
                self._line_to(point, kind, feed if kind == FEED else NAN)
            self.dwell += 0.0 if s.motion in (81, 85) else s.cycle.get("P", 0.0)
        return None

    def _holes(self, values: dict[str, float]) -> int:
        """Number of holes of a block; 0 where the control only keeps its words."""
        letters = "LK" if self.control is None else self.control.repeats
        letter = next((c for c in letters if c in values), letters[0])
        return 0 if values.get(letter) == 0 and self.control is not None else whole(values, letter, 1)

    def _hole(self, k: int, values: dict[str, float], depth: float | None) -> Hole | None:
        """The hole of the cycle in force along axis ``k``; ``values`` and ``depth`` are the words of its block.

        LinuxCNC counts R and depth anew in each block, other controls where their words stand.
        """
        s = self.s
        top = s.cycle.setdefault("top", self._here()[k] - s.origin[k]) + s.origin[k]
        clear = s.cycle["R"] * s.scale + (top if s.relative else s.origin[k])
        if self.control is not None:
            clear = s.cycle["clear"] = clear if "R" in values else s.cycle.get("clear", clear)
        bottom = s.cycle["XYZ"[k]] * s.scale + (clear if s.relative else s.origin[k])
        if self.control is not None:
            bottom = s.cycle["bottom"] = bottom if depth is not None else s.cycle.get("bottom", bottom)
        if top > clear and self.stated.isdisjoint((98, 99)):
            word = "G99 (return to R)" if s.retract_to_r else "G98 (return to start height)"
            self.log.note(f"neither G98 nor G99 is stated: drilling cycles are read with {word}")
        if bottom > clear:
            self.log.error(f"the drilling depth {'XYZ'[k]} is above R")
            return None
        pecking = s.motion in (73, 83)
        shrinks = self._shrinks() and "I" in s.cycle
        word = "I" if shrinks else "Q"
        peck = abs(s.cycle[word]) * s.scale if pecking else max(clear - bottom, 1e-9)
        if peck <= 0 and clear > bottom:
            self.log.error(f"a drilling cycle with {word}0 has no end")
            return None
        step, least = (abs(s.cycle.get(c, 0.0)) * s.scale if shrinks else 0.0 for c in "JK")
        flush = 0.0 if shrinks or not self._shrinks() else abs(s.cycle.get("K", 0.0)) * s.scale
        out = _EXITS.get(int(s.motion or 0), HoleExit.RAPID)
        if s.motion in (74, 84) and self.control is None:  # LinuxCNC feeds a tap all the way up
            out = HoleExit.FEED
        back = clear if s.retract_to_r else top if self.control is not None else max(top, clear)
        hole = Hole(clear, bottom, back, peck, s.motion == 83, out, step, least, flush or math.inf)
        if shrinks and math.isinf(hole.pecks):
            self.log.error(f"pecks that J{s.cycle['J']:g} shortens to nothing above the bottom: give K, the shortest")
            return None
        return hole

    def _pecks(self, values: dict[str, float]) -> None:
        """Keep the words I, J and K of pecks. Q ends those of a block before, and I ends its Q."""
        if not self._shrinks():
            return
        if "Q" in values and not values.keys().isdisjoint("IJ"):
            raise BlockError("Q with I or J in a peck cycle, which are two kinds of pecks: leave one of them out")
        cycle = self.s.cycle
        for letter in "IJK" if "Q" in values else "Q" if "I" in values else "":
            cycle.pop(letter, None)
        cycle.update({c: values[c] for c in "IJK" if c in values})

    def _shrinks(self) -> bool:
        """Whether I, J and K of the cycle in force are its first peck, what each is shorter by, and the shortest."""
        return self.control is not None and self.control.shrinking_pecks and self.s.motion in (73, 83)


def _length(start: F64, end: F64, centre: F64, sweep: float, axes: tuple[int, int, int]) -> float:
    """mm, length of an arc or helix; arguments as those of ``arc_points``."""
    i, j, k = axes
    radius = 0.5 * (math.dist(start[[i, j]], centre) + math.dist(end[[i, j]], centre))
    return math.hypot(radius * sweep, end[k] - start[k])
