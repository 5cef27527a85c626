"""Splits a plan into parts whose programs are small enough for the control.

A part ends at a tool change where possible, since the machine stands there anyway. Where one tool alone makes too much,
a part ends between two of its steps. A step is never split.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from geometry.errors import OutputError
from output.gcode.dialects.base import Dialect
from output.gcode.program_writer import write_program
from output.workplan import Workplan


def parts_of(plan: Workplan, dialects: Sequence[Dialect], limit: int) -> list[Workplan]:
    """The plan itself where its programs are small enough, else its parts in order.

    limit : bytes of the largest program

    Returns one or more plans. Together they have the steps of the plan, in order; their names end in 'part 2 of 3'.

    Raises
    ------
    OutputError
        program_too_large: one step alone is larger; else as ``output.gcode.program_writer.write_program``.
    """
    if _size(plan, dialects) <= limit:
        return [plan]
    named = replace(plan, name=f"{plan.name} part 999 of 999", number=9999)
    alone = [_size(replace(named, steps=(s,)), dialects) for s in plan.steps]
    if max(alone) > limit:
        step = plan.steps[alone.index(max(alone))]
        raise OutputError(f"the program of {step.id} alone has {max(alone)} bytes, the limit is {limit}",
                          code="program_too_large", subjects=(step.id, "machine.max_program_kb"), measured=max(alone),
                          limit=limit, remedy="allow larger programs, or a coarser scallop height")
    ends, begun = [], 0
    while begun < len(plan.steps):
        end = _reach(alone, begun, limit)
        if end < len(plan.steps):
            end = next((k for k in range(end, begun, -1) if _changes(plan, k)), end)
        ends.append(end)
        begun = end
    names = [f"{plan.name} part {k} of {len(ends)}" for k in range(1, len(ends) + 1)]
    return [replace(plan, name=name, steps=plan.steps[a:b])
            for name, a, b in zip(names, [0, *ends], ends, strict=False)]


def _size(plan: Workplan, dialects: Sequence[Dialect]) -> int:
    return max(len(write_program(plan, d)) for d in dialects)


def _reach(alone: Sequence[int], begun: int, limit: int) -> int:
    """Number of the step after the last one that fits, from step ``begun`` on.

    The size of a step alone, with its header, is never less than its share of a longer program.
    """
    end, size = begun + 1, alone[begun]
    while end < len(alone) and size + alone[end] <= limit:
        size += alone[end]
        end += 1
    return end


def _changes(plan: Workplan, k: int) -> bool:
    """Whether the tool is changed before step ``k``."""
    return plan.steps[k].tool != plan.steps[k - 1].tool or plan.steps[k].fresh


__all__ = ["parts_of"]
