"""The moves of all programs of a proof, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from verify.cycles import FEED
from verify.findings import Source
from verify.model import ProofSetup
from verify.program import Program
from verify.removal import Moves
from verify.toolaxes import ToolAxes


def joined(read: Sequence[Program], tools: Sequence[ToolBody]) -> tuple[Moves, Source]:
    """All programs one after the other. Moves without a tool have nothing to simulate; the reader named them."""
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
    """(m, 3, 3) directions of the linear axes, move by move, as ``joined`` takes them; None where no table turns."""
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
