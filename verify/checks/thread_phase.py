"""Passes of a thread mill that do not run in the grooves of the passes before: out of phase, or of the other hand.

All turns of one thread lie on one helix, z = h P a / 2 pi + c, with the angle a round its axis, the pitch P and the
hand h. Turns of one tool in one place must agree in h, and in c but for whole pitches. Otherwise the teeth cut off the
crests that the passes before have left.

Coordinates are in the frame of the tool, lengths in mm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from geometry.mesh import F64

FULL = 2.0 * math.pi
OFF = 0.1
"""Pitches that two passes of one thread may be apart along its axis."""
ROUND = 0.05
"""Pitches by which a turn may leave its circle: more is a lead in or out."""
SLOPE = 0.02
"""Share by which a turn may rise more or less than a pitch."""
STEPS = 8  # beginnings of a turn that are tried within one
TURNS = 512  # of one tool, at most


class Turn(NamedTuple):
    """One turn of a helix.

    move   : index of its middle move
    run    : index of the first move of its helix
    centre : (2,) float64, mm
    low    : mm, height of the tip where it is lowest; high : where it is highest
    hand   : 1 for a right-hand thread, -1 for a left-hand one
    phase  : mm, from 0 to the pitch, height of the helix at the angle 0
    """

    move: int
    run: int
    centre: F64
    low: float
    high: float
    hand: int
    phase: float


def turns_of(flat: F64, high: F64, first: int, pitch: float) -> list[Turn]:
    """The turns of one run of moves that rise by the pitch, one after the other.

    flat  : (n + 1, 2) float64, mm, frame of the tool, square to the axis, ends of n moves
    high  : (n + 1,) float64, mm, frame of the tool, along the axis
    first : index of the first move
    """
    d = np.diff(flat, axis=0)
    corner = (np.diff(np.arctan2(d[:, 1], d[:, 0])) + math.pi) % FULL - math.pi
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (np.r_[corner[:1], corner] + np.r_[corner, corner[-1:]]))])
    sense = 1 if turned[-1] > 0.0 else -1
    turned, k = np.maximum.accumulate(turned * sense), 0
    out: list[Turn] = []
    while len(out) < TURNS:
        end = int(np.searchsorted(turned, turned[k] + 0.99 * FULL))
        if end >= len(turned):
            break
        turn = _turn(flat[k:end + 1], high[k:end + 1], float(turned[end] - turned[k]), sense, pitch)
        if turn is not None:
            out.append(turn._replace(move=first + (k + end) // 2, run=first))
        k = end if turn is not None else k + max((end - k) // STEPS, 1)
    return out


def _turn(flat: F64, high: F64, angle: float, sense: int, pitch: float) -> Turn | None:
    """The turn through places (n, 2) and (n,), mm, of ``angle`` rad; None where they are on no helix of the pitch."""
    rise = float(high[-1] - high[0]) * FULL / angle
    if abs(abs(rise) - pitch) > SLOPE * pitch:
        return None
    about = flat.mean(axis=0)
    w = flat - about
    solution, *_ = np.linalg.lstsq(np.column_stack([2.0 * w, np.ones(len(w))]), (w * w).sum(axis=1), rcond=None)
    centre = about + solution[:2]
    radius = np.linalg.norm(flat - centre, axis=1)
    if np.ptp(radius) > ROUND * pitch:
        return None
    hand = sense if rise > 0.0 else -sense
    x, y = flat[0] - centre
    phase = (float(high[0]) - hand * pitch * math.atan2(y, x) / FULL) % pitch
    return Turn(0, 0, centre, float(high.min()), float(high.max()), hand, phase)


def off_phase(turns: Sequence[Turn], pitch: float, length: float, near: float) -> list[tuple[int, float]]:
    """The first move of each helix that does not run in the thread of earlier ones, and by how much.

    pitch  : mm; length : mm, of the teeth
    near   : mm, axes so near to each other are one

    Returns index of the move and mm along the axis, 0 where the thread has the other hand.
    """
    found: dict[int, tuple[int, float]] = {}
    runs = np.array([t.run for t in turns])
    centres = np.array([t.centre for t in turns]).reshape(-1, 2)
    lows, highs = np.array([t.low for t in turns]), np.array([t.high for t in turns])
    for k, turn in enumerate(turns):
        if turn.run in found:
            continue
        same = (runs[:k] != turn.run) & (np.linalg.norm(centres[:k] - turn.centre, axis=1) <= near)
        same &= (lows[:k] <= turn.high + length + pitch) & (turn.low <= highs[:k] + length + pitch)
        rows = np.flatnonzero(same)
        if not len(rows):
            continue
        other = turns[int(rows[np.argmin(np.abs(lows[rows] - turn.low))])]
        off = abs(math.remainder(turn.phase - other.phase, pitch))
        if other.hand != turn.hand:
            found[turn.run] = turn.move, 0.0
        elif off > OFF * pitch:
            found[turn.run] = turn.move, off
    return list(found.values())


__all__ = ["Turn", "off_phase", "turns_of"]
