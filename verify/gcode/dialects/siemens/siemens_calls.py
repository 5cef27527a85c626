"""Calls of Siemens cycles that drill, and that set how near the path is followed; compensation, and modes of SAVE."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.orientation import needed
from verify.gcode.dialects.siemens.siemens_arguments import CYCLES, CycleCall, called
from verify.gcode.dialects.siemens.siemens_cycles import drilling_blocks, row_of_holes
from verify.gcode.dialects.siemens.siemens_expressions import ValueReader, Variables
from verify.gcode.dialects.siemens.siemens_moves import Line, SiemensMoves
from verify.gcode.dialects.stated_places import digits, level
from verify.program.arc_chords import PLANE_AXES

_TEXT = re.compile(r'"([^"]*)"')
SMALL = 0.01
"""deg, deviation of a tool axis that needs no note: 0.01 mm at 57 mm above the tip."""
MAX_MODE = 999
"""Largest mode of CYCLE832 that says nothing but the kind of the work; those of older controls have six digits."""


class SiemensCalls(SiemensMoves):
    """What calls of cycles do.

    variables : Variables of the program
    loose     : note for the first turning tool axis, empty for none
    tool, edge : T number in the spindle and the number of its edge, 0 without a length
    in_frame  : whether cutter radius compensation counts in the plane of the frame (CUT2DF)
    """

    variables: Variables
    loose = ""
    tool, edge = 0, 1
    in_frame = False

    def _number(self, text: str) -> float:
        reader = ValueReader(text, self.variables)
        number = reader.number()
        if text[reader.at:].strip():
            raise BlockError(f"cannot read the value '{text[:40]}'")
        return number

    def _called(self, name: str, parts: Sequence[str]) -> CycleCall:
        """The call of a cycle with the values of its arguments, given as text."""
        known = CYCLES[name]
        values: list[float | str | None] = []
        for k, part in enumerate(parts):
            text = _TEXT.fullmatch(part.strip()) if k < len(known) and known[k].text else None
            values.append(text[1] if text else self._number(part) if part else None)
        return called(name, values)

    def _drill(self, call: CycleCall, line: Line) -> None:
        self.uncompensated(call.name)
        if line.modal:
            self.cycle = call
            return
        if line.places:
            raise BlockError(f"{call.name} and coordinates in one block")
        line.after += self._restored(drilling_blocks(call, self.here(), self.machine))

    def _row(self, call: CycleCall, line: Line) -> None:
        if self.cycle is None:
            raise BlockError(f"{call.name} without a cycle of MCALL")
        i, j, k = PLANE_AXES[self.machine.s.plane]
        place = self.here()
        for u, v in row_of_holes(call, self.machine):
            target = list(place)
            target[i], target[j] = u * self.unit, v * self.unit
            if self.relative:
                raise BlockError(f"{call.name} in incremental coordinates")
            line.after.append(f"G0 {'XYZ'[i]}{digits(u)} {'XYZ'[j]}{digits(v)}")
            blocks = drilling_blocks(self.cycle, target, self.machine)
            line.after += blocks
            place = list(target)
            place[k] = math.nan
        line.after = self._restored(line.after)

    def _tolerant(self, parts: list[str]) -> list[str]:
        """CYCLE832: the tolerance of the path."""
        if parts == [""] or (len(parts) > 1 and self._is_off(parts[1])):
            self.notes.append("CYCLE832 is off: machine data decide how far the control rounds corners; the error "
                              "bound does not include it")
            self.bound(False)
            self.cycle_lean = 0.0
            return []
        if any(part.strip() not in ("", "0") for part in parts[3:]):
            raise BlockError(f"CYCLE832 with {len(parts)} arguments: the proof knows 3", "leave out those behind them")
        if len(parts) > 1 and parts[1].isdigit() and int(parts[1]) > MAX_MODE and self.machine.machine is not None:
            raise BlockError(f"CYCLE832 with the mode {parts[1]}, which may switch TRAORI on or off, is not followed",
                             "write a mode of two digits, and TRAORI or TRAFOOF in a block of its own")
        tolerance = self._number(parts[0])
        self._oriented_within(parts)
        self.bound(True)
        return [f"G64 P{tolerance:.6f}"]

    def _is_off(self, mode: str) -> bool:
        """Whether a mode of CYCLE832 is off: a number, a variable of the program, or a name of the control."""
        try:
            return self._number(mode) == 0
        except BlockError:  # a name of the control
            return mode == "_OFF"

    def _oriented_within(self, parts: list[str]) -> None:
        """Keep a note for the first turning tool axis where CYCLE832 allows it more than a small deviation."""
        stated = len(parts) > 2 and re.fullmatch("1[0-9]|_ORI_[A-Z]+", parts[1]) and parts[2]
        self.loose, self.cycle_lean = "", self._number(parts[2]) if stated else 0.0
        if stated and self.cycle_lean <= SMALL:
            return
        amount = f"of {parts[2]} deg" if stated else "that setting data decide"
        self.loose = f"CYCLE832 allows the tool axis a deviation {amount}: the error bound does not include it"

    def _compensated(self, n: int) -> str:
        """Compensation by the radius of the tool in the spindle; D0 has none.

        It counts in the plane of G17 to G19 of the machine, with CUT2DF in that of the frame.
        """
        turned = self.swung and not needed(self.machine.machine, "CYCLE800").tilts_head  # the part with its frame
        if self.frame is not None and not level(self.frame) and not self.in_frame and not turned:
            raise BlockError(f"G{n} in tilted coordinates without CUT2DF: the control offsets in the plane that is "
                             "not tilted", "program CUT2DF before it")
        if self.edge and self.tool not in self.machine.radii:
            return f"G{n} D{self.tool}"
        return f"G{n}.1 D{digits(2 * self.machine.radii[self.tool] / self.unit) if self.edge else 0}"

    def _modes(self) -> Callable[[], str]:
        """A call that restores the modes and the programmable frame of now; it gives the words for what is left."""
        s = self.machine.s
        kept, frames, named = replace(s), (self.swivel, self.programmed), (
            self.motion, self.circle, self.style, self.contour_feed)

        def restore() -> str:
            if self.swivel is not frames[0] or (s.work_offset, s.side) != (kept.work_offset, kept.side):
                raise BlockError("a subprogram with SAVE changes the work offset, the plane of CYCLE800 or cutter "
                                 "radius compensation: machine data decide whether its return brings it back")
            if self.programmed is not frames[1]:
                self.program_again(frames[1])
            self.motion, self.circle, self.style, self.contour_feed = named
            words = [f"G{kept.plane}", "G91" if kept.relative else "G90"]
            words += [f"G{kept.feed_mode}"] if s.feed_mode != kept.feed_mode else []
            words += ["G710" if kept.scale == 1.0 else "G700"] if s.scale != kept.scale else []
            return " ".join([*words, *([f"G{self.motion}"] if isinstance(self.motion, int) else [])])
        return restore
