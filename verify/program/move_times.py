"""Times of the moves of a program on a machine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.machine_rates import Rates
from geometry.mesh import F64
from geometry.move_timing import move_seconds
from verify.model import ProofSetup, Spent
from verify.program.move_kinds import RAPID
from verify.program.program import Program

RAPID_TURN = float(np.radians(7200.0))
"""rad/min, of a rotary axis in a rapid where the setup gives no rate: 20 turns."""
PATH = 0.001
"""mm, deviation at corners where a program allows less or states none: its coordinates are no finer."""


def minutes_of(program: Program, setup: ProofSetup) -> F64:
    """Time of each move of a program with changes of speed, without dwells.

    Returns (m,) float64, min.

    Notes
    -----
    The control stops at tool changes, where only a rotary axis moves, and between rapids and feed moves, which no
    control blends. Moves of one line are chords of its arc. A feed move of unknown time, since its start is unknown,
    counts as a rapid. The profile between is that of ``geometry.move_timing``.
    """
    way, rapid = program.end - program.start, program.kind == RAPID
    length = np.linalg.norm(way, axis=1)
    even = np.where(rapid, length / setup.rapid_feed, program.minutes)
    if program.poses is not None:
        turned = np.abs(program.poses.end_turn - program.poses.start_turn).max(axis=1)
        even = np.where(rapid, np.maximum(even, turned / (setup.rotary_rate or RAPID_TURN)), even)
    even = np.where(np.isfinite(even), even, length / setup.rapid_feed)
    moving = (length > 0.0) & (even > 0.0)
    feed = np.where(moving, length / np.where(moving, even, 1.0), 1.0)
    stop = np.zeros(len(way), np.bool_)
    stop[1:] = (program.tool[1:] != program.tool[:-1]) | (rapid[1:] != rapid[:-1])
    curve = np.zeros(len(way), np.bool_)
    curve[1:] = (program.line[1:] == program.line[:-1]) & ~stop[1:]
    rates = Rates(setup.rapid_feed, setup.acceleration, max(program.blend, PATH), setup.jerk)
    return np.where(moving, move_seconds(way, feed, rates, stop, curve) / 60.0, even)


def spent(read: Sequence[Program], took: F64, known: NDArray[np.bool_], cut: NDArray[np.bool_]) -> Spent:
    """Times of programs by kind of move.

    took  : (m,) float64, min, of all moves, program after program
    known : (m,) bool, moves with a tool
    cut   : (k,) bool, for each of those, whether it removes stock
    """
    if not read:
        return Spent(0.0, 0.0, 0.0, 0, 0)
    rapid = np.concatenate([p.kind == RAPID for p in read])
    inside = np.zeros(len(took), np.bool_)
    inside[known] = cut
    retracts = sum(int((~r[:-1] & r[1:]).sum()) for r in (p.kind == RAPID for p in read))
    return Spent(60.0 * float(took.sum()) + sum(p.dwell for p in read), 60.0 * float(took[inside].sum()),
                 60.0 * float(took[rapid].sum()), retracts, sum(p.changes for p in read))
