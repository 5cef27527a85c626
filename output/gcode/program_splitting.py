"""A plan in parts, each of which makes programs no larger than a control takes.

A part ends where the tool changes, if it can: a machinist changes the program where the machine stands anyway. Where
one tool alone makes too much, a part ends between two of its steps. A step is never cut.
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

    Returns one plan or more; the steps of all of them are those of the plan, in order, and their names say 'part 2 of
    3'.

    Raises
    ------
    OutputError
        Code program_too_large: a step alone is larger; else as ``output.gcode.program_writer.write_program``.
    """
    if _size(plan, dialects) <= limit:
        return [plan]
    named = replace(plan, name=f"{plan.name} part 999 of 999", number=9999)
    alone = [_size(replace(named, steps=(s,)), dialects) for s in plan.steps]
    if max(alone) > limit:
        step = plan.steps[alone.index(max(alone))]
        raise OutputError(f"{step.id} alone makes a program of {max(alone)} bytes, allowed are {limit}",
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
    """How far steps fit in, from one on: what each makes alone, its header counted, is never less than its share."""
    end, size = begun + 1, alone[begun]
    while end < len(alone) and size + alone[end] <= limit:
        size += alone[end]
        end += 1
    return end


def _changes(plan: Workplan, k: int) -> bool:
    """Whether the tool is changed before step ``k``."""
    return plan.steps[k].tool != plan.steps[k - 1].tool or plan.steps[k].fresh


__all__ = ["parts_of"]
