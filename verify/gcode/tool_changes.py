"""Tool changes: where the spindle stands while the tool is changed, and how low the new tool hangs from it.

LinuxCNC changes where the spindle stands, unless its configuration names a position (TOOL_CHANGE_POSITION, QUILL_UP).
The new tool then hangs lower by as much as it is longer. Other controls send the spindle to a position of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from verify.gcode.rotary_words import Rotary
from verify.program.move_kinds import RAPID
from verify.program.program import NAN, Swap


class ToolChanges(Rotary):
    """Tool changes of one reading.

    change  : mm, frame of the program, Z or X, Y and Z of the spindle face at a tool change, nan where the frame leaves
              them open; None where the setup states none
    hangs   : mm by T number, spindle face to tip, of the tools whose length is known; 0 for an empty spindle
    stays   : whether the control changes the tool where the spindle stands
    """

    change: tuple[float, ...] | None = None
    hangs: Mapping[int, float] = {}
    stays = True

    def _change_tool(self, number: int, loaded: bool) -> None:
        """Put tool ``number`` in for the one of the state, which may be none (0).

        loaded : whether the program has said what is in the spindle
        """
        s, log = self.s, self.log
        old, length = s.tool, self.hangs.get(number)
        if self.change is not None and not s.tilted:
            self._leave([len(self.change) == 3, len(self.change) == 3, True])
            s.position[:2] = self.change[:2] if len(self.change) == 3 else s.position[:2]
            s.position[2] = NAN if length is None else self.change[-1] - length
            if math.isnan(self.change[-1]):
                log.unplaced.append(log.line)
            s.parked = False
            return
        height, before = s.position[2], self.hangs.get(old)
        if math.isnan(height):
            return self._leave([False, False, True])
        if not self.stays or s.tilted or not loaded or length is None or before is None:
            log.unplaced.append(log.line)
            return self._leave([False, False, True])
        x, y = s.position[:2]
        log.swaps.append(Swap(log.line, old, number, length - before, height, log.count))
        s.position = [x, y, height + before - length]
        if length > before and not math.isnan(x + y):
            log.move((x, y, height), s.position, RAPID, NAN, number, 0)
        return None


__all__ = ["ToolChanges"]
