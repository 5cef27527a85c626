"""Solids of the part's file that are not the part, and the tools that enter the boxes that hold them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.part import OtherSolid
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.findings import Source
from verify.model import ProofSetup
from verify.moves import Moves, cutter_table
from verify.tool_bodies import Bodies

TOUCH = 1e-3  # mm, rounding of a program: less is no entry


def other_assumptions(moves: Moves, source: Source, tools: Sequence[ToolBody], setup: ProofSetup) -> Iterator[Assumed]:
    """Other solids whose boxes a tool enters; the proof takes them for absent.

    moves : in the frame of the proof, mm; ``tools`` are those that they refer to
    """
    for other in setup.others:
        met = np.flatnonzero(_enters(other, moves, tools, setup))
        if len(met):
            m = int(met[0])
            yield Assumed(AssumedKind.OTHER_SOLIDS, f"{other} is absent; T{source.tool[m]} enters a box that holds it "
                          f"(line {source.line[m]})", "a tool mills into what stands there", "state part.others")


def _enters(other: OtherSolid, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup) -> NDArray[np.bool_]:
    """(m,) bool, moves on which a tool enters the boxes that hold a solid; a tool that leans counts as a ball."""
    cutters, bodies = cutter_table(tools), Bodies.of(tools, setup)
    reach, out = bodies.reach(cutters), np.zeros(len(moves), np.bool_)
    for k, tool in enumerate(tools):
        mine = np.flatnonzero(moves.tool == k)
        if moves.axes is None:
            own = bodies.rows[bodies.first[k]:bodies.first[k + 1]]
            discs = [(0.0, tool.flute_length, tool.widest_radius),
                     *((z0, z1, max(r0, r1) - gap) for z0, z1, r0, r1, gap, _ in own.tolist())]
        else:
            discs = [(-reach[k], reach[k], reach[k])]
        for low, high, wide in discs:
            room = np.array([[wide, wide, high], [wide, wide, -low]]) - TOUCH
            for box in other.held_by:
                out[mine] |= _crosses(moves.start[mine], moves.end[mine], box + room * [[-1.0], [1.0]])
    return out


def _crosses(start: F64, end: F64, box: F64) -> NDArray[np.bool_]:
    """(n,) bool, segments between two places, (n, 3) mm, that meet a box, (2, 3) mm."""
    way = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (box[0] - start) / way, (box[1] - start) / way
    flat, within = way == 0.0, (start >= box[0]) & (start <= box[1])
    first = np.where(flat, np.where(within, -np.inf, np.inf), np.minimum(a, b)).max(axis=1)
    last = np.where(flat, np.where(within, np.inf, -np.inf), np.maximum(a, b)).min(axis=1)
    return np.asarray(np.maximum(first, 0.0) <= np.minimum(last, 1.0))


__all__ = ["other_assumptions"]
