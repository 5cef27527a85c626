"""Contacts of tools that a change has put lower than the program expects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from verify.findings import SAME_PLACE
from verify.model import Finding, FindingKind
from verify.program.program import Program, Swap


def as_collisions(findings: Sequence[Finding], read: Sequence[Program]) -> list[Finding]:
    """The findings; a rapid that meets something at the height a tool change left is a collision, which names the tool.

    A change in which the spindle stays leaves the tip of the new tool at a height that no word of the program states,
    until a word moves Z.
    """
    causes = {(p.name, line): swap for p in read for swap in p.swaps for line in _lines(p, swap)}
    out = []
    for f in findings:
        swap = causes.get((f.program, f.line))
        if swap is None or f.kind is not FindingKind.RAPID or f.near:
            out.append(f)
            continue
        was = f"T{swap.old}" if swap.old else "the empty spindle"
        out.append(replace(f, kind=FindingKind.COLLISION, limit=0.0, message=(
            f"{f.message}. T{swap.new} is {swap.longer:.3f} mm longer than {was}, and the tool change of line "
            f"{swap.line} at Z{swap.height:.3f} leaves its tip at Z{swap.height - swap.longer:.3f}: send Z home before "
            "it, or state machine.change_position")))
    return out


def _lines(p: Program, swap: Swap) -> set[int]:
    """Lines of the moves between a change and the first word of Z after it."""
    rows = np.arange(swap.moves, len(p))
    level = np.abs(p.end[rows, 2] - (swap.height - swap.longer)) <= SAME_PLACE
    count = len(rows) if level.all() else int(np.argmin(level))
    return {swap.line, *p.line[rows[:count]].tolist()}


__all__ = ["as_collisions"]
