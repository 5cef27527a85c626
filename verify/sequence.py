"""Programs one after the other: read, started from above, and as one list of moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.errors import VerificationError
from geometry.mesh import F64
from geometry.part import Part
from geometry.toolbody import ToolBody
from verify.findings import Source
from verify.fitness import from_above, top_of_all
from verify.model import ProofSetup
from verify.progress import Report, Stages
from verify.reader import FEED, Program, read_program
from verify.removal import Moves
from verify.toolaxes import ToolAxes

BLEND = 0.001  # mm, what G64 may leave the path by, or this share of the gouge tolerance; it is in the error bound
BLEND_SHARE = 0.1


def check_numbers(tools: Sequence[ToolBody]) -> None:
    """Refuse two tools of one T number (VerificationError, code tool_number_twice)."""
    numbers = [t.number for t in tools]
    if len(set(numbers)) != len(numbers):
        raise VerificationError("two tools share a T number", code="tool_number_twice",
                                subjects=tuple(t.id for t in tools if numbers.count(t.number) > 1),
                                remedy="give every tool its own number")


def read_all(programs: Sequence[tuple[str, str]], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
             spindle_tool: int, report: Report) -> list[Program]:
    """Read programs in the order they run; a first descent that lacks only its height comes from above everything.

    programs, spindle_tool : as ``verify.prove.prove`` takes them, and errors as it raises them
    report   : called with the share read, 0 to 1
    """
    stages, total, done = Stages(report), max(sum(len(text) for _, text in programs), 1), 0
    above = top_of_all(part.mesh.bounds, setup) + setup.clearance_rapid
    read = []
    for name, text in programs:
        program = read_program(
            text, name=name, tools=frozenset(t.number for t in tools), work_offset=setup.work_offset,
            blend_limit=max(BLEND, BLEND_SHARE * setup.gouge_tolerance), kinematics=setup.kinematics,
            gauge_length=setup.gauge_length, spindle_tool=spindle_tool,
            report=stages.span(done / total, (done + len(text)) / total))
        read.append(from_above(program, above))
        done += len(text)
    return read


def moves_of(read: Sequence[Program], tools: Sequence[ToolBody]) -> tuple[Moves, Source]:
    """All programs one after the other. Moves without a tool have nothing to simulate; the reader named them.

    tools : of the moves; ``Moves.tool`` is the place in it
    """
    row = {t.number: i for i, t in enumerate(tools)}
    number = np.concatenate([p.tool for p in read]) if read else np.zeros(0, np.int32)
    known = _known(read, tools) if read else np.zeros(0, np.bool_)
    start = np.concatenate([p.start for p in read])[known] if read else np.zeros((0, 3))
    end = np.concatenate([p.end for p in read])[known] if read else np.zeros((0, 3))
    kind = np.concatenate([p.kind for p in read])[known] if read else np.zeros(0, np.int8)
    line = np.concatenate([p.line for p in read])[known] if read else np.zeros(0, np.int32)
    program = np.repeat(np.arange(len(read), dtype=np.int32), [len(p) for p in read])[known]
    number = number[known]
    tool = np.array([row[int(n)] for n in np.unique(number)], np.int32)[np.searchsorted(np.unique(number), number)] \
        if len(number) else np.zeros(0, np.int32)
    axes = None
    if any(p.poses is not None for p in read):
        axes = ToolAxes.between(np.concatenate([_axes(p, True) for p in read])[known],
                                np.concatenate([_axes(p, False) for p in read])[known])
    moves = Moves(np.ascontiguousarray(start), np.ascontiguousarray(end), kind == FEED, tool, axes)
    return moves, Source(tuple(p.name for p in read), program, line, number)


def slides_of(read: Sequence[Program], tools: Sequence[ToolBody], setup: ProofSetup) -> F64 | None:
    """(m, 3, 3) directions of the linear axes, move by move, as ``moves_of`` takes them; None where no table turns."""
    if setup.kinematics is None or not setup.dogleg or all(p.poses is None for p in read):
        return None
    turn = np.concatenate([np.zeros((len(p), 2)) if p.poses is None else p.poses.start_turn for p in read])
    return setup.kinematics.slides(turn[_known(read, tools)])


def _known(read: Sequence[Program], tools: Sequence[ToolBody]) -> NDArray[np.bool_]:
    """(m,) bool: moves with a tool of the table in the spindle."""
    return np.isin(np.concatenate([p.tool for p in read]), [t.number for t in tools])


def _axes(p: Program, at_start: bool) -> F64:
    """(m, 3) tool axes of a program at the start or the end of its moves."""
    if p.poses is None:
        return np.tile([0.0, 0.0, 1.0], (len(p), 1))
    return p.poses.start_axis if at_start else p.poses.end_axis
