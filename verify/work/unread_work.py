"""Faces that lines behind the end of a program would work on: a stray M2 or M30 leaves them undone.

The lines are read as if the program went on at its end. Coordinates are float64, mm, frame of the proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.tool_body import ToolBody
from verify.checks.program_sequence import FramedProgram, counted, moves_of
from verify.program.program import Program
from verify.surface.removal import residual_on_normals
from verify.work.asked_faces import Cutting, Measured, worked_faces


@dataclass(frozen=True)
class UnreadWork:
    """Faces and tools of the lines that did not run.

    faces : their numbers, ascending; tools : places in the sequence of tools
    """

    faces: tuple[int, ...] = ()
    tools: tuple[int, ...] = ()


def unread_work(whole: Program, framed: FramedProgram, measured: Measured, cutting: Cutting,
                tools: Sequence[ToolBody]) -> UnreadWork:
    """What the lines behind the end of a program would do after it.

    whole   : the program read on through its end; its first moves are those of ``framed``
    cutting : of the program that ran

    Raises
    ------
    SetupError
        As ``verify.surface.removal.residual_on_normals``.
    """
    numbers = [t.number for t in tools]
    ran = int(counted([framed], numbers).sum())
    moves, _ = moves_of([replace(framed, program=whole)], tools)
    rest = moves.only(np.arange(len(moves)) >= ran)
    if not rest.feed.any():
        return UnreadWork()
    s = measured.samples
    left, mover = residual_on_normals(s.points, s.normals, measured.residual, rest, tools, threads=cutting.threads)
    faces = worked_faces(s, left, mover, measured.reach, replace(cutting, moves=rest))
    return UnreadWork(faces, tuple(np.unique(rest.tool[rest.feed]).tolist()))


__all__ = ["UnreadWork", "unread_work"]
