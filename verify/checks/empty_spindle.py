"""An empty spindle is a body too: its nose meets what a tool would meet."""

from __future__ import annotations

from collections.abc import Sequence

from geometry.tool_body import ToolBody
from verify.checks.program_sequence import FramedProgram, counted
from verify.model import ProofSetup
from verify.program.move_kinds import FEED
from verify.tool_bodies import NOSE_LENGTH

EMPTY = 0  # T number
SMALLEST_NOSE = 69.832  # mm, taper 30 of DIN 2079: the smallest spindle nose of a milling machine with a steep taper


def with_nose(tools: Sequence[ToolBody], read: Sequence[FramedProgram], setup: ProofSetup) -> Sequence[ToolBody]:
    """The tools, and the spindle nose as tool 0 where a program moves without a tool.

    Its face is at the Z of the program. Where a length offset is on, the nose is higher than that. A program that feeds
    without a tool has a finding for it; its moves without a tool are not those of a nose, and they are left out.
    """
    if any(t.number == EMPTY for t in tools) or not any(counted([r], [EMPTY]).any() for r in read):
        return tools
    if any(((r.program.tool == EMPTY) & (r.program.kind == FEED)).any() for r in read):
        return tools
    wide = setup.nose_diameter or SMALLEST_NOSE
    return [*tools, ToolBody("spindle nose", EMPTY, wide, 0.0, NOSE_LENGTH, wide, NOSE_LENGTH, wide, NOSE_LENGTH)]


__all__ = ["EMPTY", "SMALLEST_NOSE", "with_nose"]
