"""Calls of Siemens cycles that drill, and that set how near the path is followed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from verify.gcode.dialects.base import NUMBER, BlockError
from verify.gcode.dialects.siemens.siemens_cycles import DrillingCall, drilling_blocks, row_of_holes
from verify.gcode.dialects.siemens.siemens_expressions import ValueReader, Variables
from verify.gcode.dialects.siemens.siemens_moves import Line, SiemensMoves
from verify.gcode.dialects.siemens.siemens_swivel import is_number
from verify.gcode.dialects.stated_places import digits
from verify.program.arc_chords import PLANE_AXES

SMALL = 0.01
"""deg, deviation of a tool axis that needs no note: 0.01 mm at 57 mm above the tip."""


class SiemensCalls(SiemensMoves):
    """What calls of cycles do.

    variables : Variables of the program
    loose     : note for the first turning tool axis, empty for none
    """

    variables: Variables
    loose = ""

    def _number(self, text: str) -> float:
        reader = ValueReader(text, self.variables)
        number = reader.number()
        if text[reader.at:].strip():
            raise BlockError(f"cannot read the value '{text[:40]}'")
        return number

    def _drill(self, call: DrillingCall, line: Line) -> None:
        self.uncompensated(call.name)
        if line.modal:
            self.cycle = call
            return
        if line.places:
            raise BlockError(f"{call.name} and coordinates in one block")
        line.after += self._restored(drilling_blocks(call, self.here(), self.machine))

    def _row(self, name: str, values: Sequence[float | None], line: Line) -> None:
        if self.cycle is None:
            raise BlockError(f"{name} without a cycle of MCALL")
        i, j, k = PLANE_AXES[self.machine.s.plane]
        place = self.here()
        for u, v in row_of_holes(name, values):
            target = list(place)
            target[i], target[j] = u * self.unit, v * self.unit
            if self.relative:
                raise BlockError(f"{name} in incremental coordinates")
            line.after.append(f"G0 {'XYZ'[i]}{digits(u)} {'XYZ'[j]}{digits(v)}")
            blocks = drilling_blocks(self.cycle, target, self.machine)
            line.after += blocks
            place = list(target)
            place[k] = math.nan
        line.after = self._restored(line.after)

    def _tolerant(self, parts: list[str]) -> list[str]:
        """CYCLE832: the tolerance of the path."""
        if parts == [""] or parts[1:2] in (["0"], ["_OFF"]):
            self.notes.append("CYCLE832 is off: machine data decide how far the control rounds corners; the error "
                              "bound does not include it")
            self.bound(False)
            return []
        if not is_number(parts[0]):
            raise BlockError(f"CYCLE832({','.join(parts)}): its tolerance is not a plain number")
        self._oriented_within(parts)
        self.bound(True)
        return [f"G64 P{float(parts[0]):.6f}"]

    def _oriented_within(self, parts: list[str]) -> None:
        """Keep a note for the first turning tool axis where CYCLE832 allows it more than a small deviation."""
        stated = len(parts) > 2 and re.fullmatch("1[0-9]|_ORI_[A-Z]+", parts[1]) and re.fullmatch(NUMBER, parts[2])
        self.loose = ""
        if stated and float(parts[2]) <= SMALL:
            return
        amount = f"of {parts[2]} deg" if stated else "that setting data decide"
        self.loose = f"CYCLE832 allows the tool axis a deviation {amount}: the error bound does not include it"
