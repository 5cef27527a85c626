"""The modal state of a program and the words that set it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping

import numpy as np

from verify.gcode.block_words import COMPENSATES, CYCLES, MOTION_CODES, SAVES, WORK_OFFSETS, Block, BlockError
from verify.gcode.saved_modes import SavedModes
from verify.gcode.tool_changes import ToolChanges
from verify.kinematics import Kinematics
from verify.program.move_log import Log
from verify.program.program import NAN, Pause, StopPoint

INCH = 25.4
PATH_MODES: frozenset[float] = frozenset({61, 61.1, 64})


class Modes(ToolChanges):
    """State, log, and all modes that a block sets before it moves.

    tools       : T numbers of the tool table; any number where None
    work_offset : the one of the setup
    blend_limit : mm, deviation that path blending may have without a remark
    machine     : rotary axes of the machine, or None
    gauge       : mm by T number, spindle face to tip
    spindle_tool : T number in the spindle, its length offset on, before the first line; 0 for none
    fits        : whether the control drops points by the P of a G64 without Q
    before_cycle : the motion before the cycle in force or the latest one, None for none
    register     : number of the latest H word, None before the first
    assumed      : words that the program does not state before its first move
    ends_contour : whether a G40 stands before the first move
    pallet       : line of the latest change of pallets, 0 before the first
    """

    fits = True

    def __init__(self, log: Log, tools: Collection[int] | None, work_offset: str, blend_limit: float,
                 machine: Kinematics | None = None, gauge: Mapping[int, float] | None = None,
                 spindle_tool: int = 0) -> None:
        super().__init__(log, machine, gauge or {})
        self.tools, self.work_offset, self.blend_limit = tools, work_offset, blend_limit
        self.saved = SavedModes()
        self.spindle_tool, self.loaded = spindle_tool, False
        if spindle_tool:
            self.s.tool = self.s.selected = self.s.offset = spindle_tool
        self.incremental_line = 0
        self.incremental_after_cuts = self.incremental_moved = self.cut_absolute = False
        self.stated: set[float] = set()
        self.before_cycle: float | None = None
        self.register: int | None = spindle_tool or None
        self.assumed: tuple[str, ...] = ()
        self.ends_contour = False
        self.pallet = 0

    def _set_modes(self, block: Block) -> None:
        s, values, scale = self.s, block.values, self.s.scale
        if not SAVES.isdisjoint(block.ms):
            if values or block.codes or len(block.ms) > 1:
                raise BlockError(f"M{block.ms[0]} with other words in one block: give it its own block")
            self.saved.run(block.ms[0], s)
        if "S" in values:
            s.speed = values["S"]
            if s.speed < 0:
                self.log.remark("speed", f"S{s.speed:g} is not a spindle speed", self.log.line)
        if "T" in values:
            self._select(int(values["T"]))
        self._spindle(block.ms, values)
        if s.turning:
            self.log.turns(s.tool, s.speed)
        if not {7, 8, 9}.isdisjoint(block.ms):
            s.coolant, self.log.cools = 9 not in block.ms, True
        speed, coolant = s.speed if s.turning else 0.0, s.coolant
        self._in_order(lambda: self.log.runs(speed, coolant))
        if not {428, 429}.isdisjoint(block.ms):
            self._control(s.tcp_word, 428 in block.ms)
            self.tip_told = True
        for g in sorted(block.codes, key=lambda g: g != 80):  # with a motion word G80 only ends the cycle before it
            self._mode(g, values)
        if 64 in block.codes:
            self._blending(values)
        if "F" in values and s.scale != scale:
            self.log.remark("unit_feed", f"F{values['F']:g} in the block that changes the unit: LinuxCNC reads it "
                            "in the old unit, other controls in the new one; give F its own line", self.log.line)
        if "F" in values:
            s.feed = values["F"] * (1.0 if s.feed_mode == 93 else scale if self.fits else s.scale)

    def _in_order(self, run: Callable[[], None]) -> None:
        """Do something after the moves before it are written."""
        run()

    def _settled(self, word: str) -> None:
        """Refuse a block that cutter radius compensation does not go with, where it is on; ``word`` names it."""

    def _select_zero(self, name: str) -> None:
        """Put a work offset in force."""
        raise NotImplementedError

    def _length_error(self, number: int) -> float:
        """mm, by which a length offset differs from the length of its tool."""
        raise NotImplementedError

    def _own_register(self, number: int) -> bool:
        """Whether a register that no tool has by number belongs to the tool in the spindle."""
        raise NotImplementedError

    def _settle_length(self) -> None:
        """Another length comes into force."""
        raise NotImplementedError

    def _unturn(self, word: float) -> None:
        """End a rotation (G69) or a scale (G50) of the programmed coordinates."""
        raise NotImplementedError

    def _compensation(self, word: float, values: dict[str, float]) -> None:
        """Begin or end cutter radius compensation."""
        raise NotImplementedError

    def _select(self, number: int) -> None:
        if self.tools is not None and number not in self.tools and number != 0:
            self.log.error(f"T{number} is not in the tool table")
        self.s.selected = number

    def _spindle(self, ms: list[int], values: dict[str, float]) -> None:
        s = self.s
        if 61 in ms and (values.get("Q", -1.0) < 0 or values["Q"] % 1):
            raise BlockError("M61 without Q, the number of the tool in the spindle")
        for m in (0, 1):
            if m in ms:
                self.pause(f"M{m}", s.tool)
        if 60 in ms:
            self.pallet = self.log.line
        if 61 in ms:
            self._settled("M61")
            number = int(values["Q"])
            # a stop right before it is for a change by hand
            waited = any(p.event == "M0" and p.moves == self.log.count for p in self.log.pauses[-1:])
            if self.loaded and s.tool not in (0, number) and not waited:
                self.log.remark("m61", f"M61 says that T{number} is in the spindle, and T{s.tool} was put in: a tool "
                                "change is missing", (s.tool, number))
            s.tool = s.selected = number
            self.loaded = True
        if 6 in ms:
            self._settled("M6")
            self.pause("tool change", s.selected)
            self.stop("tool change")
            if s.selected != s.tool:
                self.log.changes += s.tool > 0
                self._change_tool(s.selected, s.tool > 0 or self.loaded)
            s.tool, s.spindle, self.loaded = s.selected, False, True
        if 3 in ms or 4 in ms:
            s.spindle = True
            self.log.spins(4 in ms)
        if 5 in ms or 19 in ms:  # LinuxCNC stops or orients the spindle before the motion of the block
            s.spindle = False

    def _mode(self, g: float, values: dict[str, float]) -> None:
        """Apply one G word that sets a state."""
        s = self.s
        again = g in self.stated
        self.stated.add(g)
        if g in MOTION_CODES:
            self._motion(g)
        elif g in (17, 18, 19):
            if g != s.plane:
                self._settled(f"G{g:g}")
            s.plane = int(g)
        elif g in (50, 69):
            self._unturn(g)
        elif g in COMPENSATES:
            self._compensation(g, values)
        elif g in (20, 21):
            self._unit(int(g))
        elif g in (90, 91):
            self._distance(g == 91)
        elif g in (90.1, 91.1):
            s.centre_absolute = g == 90.1
        elif g in (93, 94, 95):
            if self.fits or not again or g != s.feed_mode:  # LinuxCNC drops F with each of them, others at a change
                s.feed = NAN
            s.feed_mode = int(g)
        elif g in (98, 99):
            s.retract_to_r = g == 99
        elif g in (43, 43.4, 49):
            self._length_offset(g, values)
        elif g in WORK_OFFSETS:
            self._select_zero(WORK_OFFSETS[g])
        elif g in PATH_MODES and self.log.path_stated is None:
            self.log.path_stated = self.log.count

    def _assume(self) -> None:
        """Record the modes that the first move assumes: a control keeps the modes of the program before."""
        groups: dict[str, Collection[float]] = {"G21": (20, 21), "G90": (90, 91), "G17": (17, 18, 19),
                                                "G94": (93, 94, 95), self.work_offset: WORK_OFFSETS}
        words = [word for word, group in groups.items() if self.stated.isdisjoint(group)]
        if self.spindle_tool and not self.loaded:
            words.append(f"T{self.spindle_tool} M6")
        if self.spindle_tool and self.stated.isdisjoint({43, 43.4, 49}):
            words.append(f"G43 H{self.spindle_tool}")
        words.extend(f"{letter}0" for letter in self.rotary if letter not in self.stated_axes)
        self.assumed, self.ends_contour = tuple(words), 40 in self.stated

    def stop(self, event: str, *, room: bool = False) -> bool:
        """Record where the program stops, if the height is known, or the place where the tool is tilted.

        room : whether the tool has to keep the rapid clearance there

        Returns whether it was recorded; without a tool in the spindle it is not.
        """
        s = self.s
        x, y, z = self._tip()
        up = (0.0, 0.0, 1.0)
        if s.tilted and self.machine is not None:
            up = tuple(self.machine.axis(np.radians([s.turn]))[0].tolist())
        known = s.tool > 0 and not math.isnan(z if up[2] == 1.0 else x + y + z)
        if known:
            self.log.stops.append(StopPoint(self.log.line, event, s.tool, (x, y, z), up, room))
        return known

    def pause(self, event: str, tool: int) -> None:
        """Record the state of the machine where the program waits or ends."""
        s, log = self.s, self.log
        counted = s.offset is not None or self.stated.isdisjoint({43, 43.4, 49})
        log.pauses.append(Pause(log.line, event, tool, log.count, s.speed if s.turning else 0.0, s.coolant, s.tcp,
                                s.relative, s.home, counted))

    def _motion(self, g: float) -> None:
        """Set the motion mode; a new cycle keeps no words of the one before.

        G80 ends a cycle. After it LinuxCNC needs a motion word; on other controls that of before the cycle counts.
        """
        s = self.s
        if s.motion not in CYCLES:
            s.cycle, self.before_cycle = {}, s.motion
        s.motion = g if g != 80 or self.fits else self.before_cycle

    def _unit(self, g: int) -> None:
        s = self.s
        scale = INCH if g == 20 else 1.0
        if scale != s.scale and (self.log.moved or any(v == v for v in s.position)):
            self.log.remark("unit", f"G{g} changes the unit within the program", self.log.line)
        s.scale = scale

    def _distance(self, relative: bool) -> None:
        """Enter or leave incremental coordinates.

        Incremental moves are simulated exactly, and a program that states a place and then runs in G91 is right. A G91
        after absolute cuts that no G90 follows is usually a mistake, and its effect may show hundreds of lines later:
        ``read`` puts a remark on its line. A G91 that a G90 ends needs none.
        """
        s = self.s
        if relative == s.relative:
            return
        feeds = self.log.take_feeds()
        if relative:
            self.cut_absolute |= feeds
            self.incremental_line, self.incremental_after_cuts = self.log.line, self.cut_absolute
            self.incremental_moved = False
        s.relative = relative

    def _length_offset(self, g: float, values: dict[str, float]) -> None:
        """G43 and G49 end the tool centre point control of G43.4: one modal group."""
        s = self.s
        if g == 43.4 and s.tcp_word:
            self.log.kept_on.append(self.log.line)
        self._settle_length()
        self._control(g == 43.4, s.tcp_switch)
        self.tip_told |= g == 43.4
        if g == 49:
            s.offset, s.length = None, 0.0
            return
        if "H" in values:
            self.register = int(values["H"])
        elif not self.fits and self.register is None:
            self.log.remark("no_length_offset", f"G{g:g} without H: the control takes the H that it had before the "
                            "program, or none", s.tool)
        number = s.tool if self.register is None or ("H" not in values and self.fits) else self.register
        s.length = self._length_error(number)
        if number != s.tool and self.tools is not None and number not in self.tools and self._own_register(number):
            self.log.note(f"H{number} counts as the length of T{s.tool}: the setup has no tool of that number")
            number = s.tool
        s.offset = number
        if s.length and s.tilted:
            raise BlockError(f"G43 H{number} differs from the length of its tool while a rotary axis stands off 0")
        if s.offset != s.tool:
            self.log.remark("length_offset", f"length offset H{s.offset} with tool T{s.tool} in the spindle",
                            self.log.line)

    def _blending(self, values: dict[str, float]) -> None:
        """G64: the control may round corners by P (0 or absent: without bound) and drop points of lines within Q.

        LinuxCNC takes P where Q is absent; other controls have no Q.
        """
        limit = self.blend_limit
        p = values.get("P", 0.0) * self.s.scale
        q = values.get("Q", values.get("P", 0.0) if self.fits else 0.0) * self.s.scale
        self.log.blend, self.log.leaves = max(self.log.blend, p), max(self.log.leaves, p + max(q, 0.0))
        if p == 0:
            word = "G64 without a P above 0" if self.fits else "a path mode without a tolerance"
            self.log.remark("blending", f"{word} lets the control leave the path by any amount (limit {limit:g} mm)",
                            self.log.line)
        elif not 0 < p <= limit + 1e-12:
            word = f"G64 P{values['P']:g}" if self.fits else "the path tolerance"
            self.log.remark("blending", f"{word} lets the control leave the path by {p:g} mm (limit {limit:g} mm)",
                            self.log.line)
        if "Q" in values and not 0 <= q <= limit + 1e-12:
            self.log.remark("line_fitting", f"G64 Q{values['Q']:g} lets the control leave the path by {q:g} mm (limit "
                            f"{limit:g} mm)", self.log.line)
