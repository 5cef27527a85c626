"""Paths drawn by hand, from lines and arcs, as judges of what a reader makes of a program."""

import math
from dataclasses import dataclass

import numpy as np

NEAR = 1e-3
"""mm, what a reading may be apart from a drawn path."""
TURNED = 1e-6
"""Length by which unit vectors of a tool axis may differ."""


@dataclass(frozen=True)
class Piece:
    """A line or arc: 0 for a rapid and 1 for a feed, its end (3,) mm, the tool axis there, and for an arc in XY its
    centre (2,) mm and its turn in deg, positive to the left."""

    kind: int
    end: tuple
    axis: tuple | None = None
    centre: tuple | None = None
    turn: float = 0.0


def rapid(*end, axis=None):
    """A rapid to a place; coordinates in mm."""
    return Piece(0, end, axis)


def feed(*end, axis=None):
    """A straight feed to a place; coordinates in mm."""
    return Piece(1, end, axis)


def arc(centre, turn, *end):
    """An arc by its centre (2,) mm, its turn in deg and its end in mm."""
    return Piece(1, end, None, centre, turn)


def lines(*places):
    """Straight feeds to places in a row."""
    return [feed(*p) for p in places]


def departure(program, path):
    """Largest distance of the moves of a program from a drawn path, mm.

    Raises ValueError where kinds, order, ends or tool axes differ, or the distance is above ``NEAR``.
    """
    rows, far, before = _moving(program), 0.0, None
    at = 0
    for n, piece in enumerate(path):
        gone = 0.0
        while True:
            if at >= len(rows):
                raise ValueError(f"the program ends before piece {n} of the path, {piece.end}")
            k = rows[at]
            at += 1
            if program.kind[k] != piece.kind:
                raise ValueError(f"line {program.line[k]}: kind {program.kind[k]} at piece {n}, {piece.end}")
            off, gone = _off(program, k, piece, before, gone)
            if off > NEAR:
                raise ValueError(f"line {program.line[k]}: {program.end[k]} is {off:.6f} mm off piece {n}, {piece.end}")
            far = max(far, off)
            last = float(np.abs(program.end[k] - piece.end).max())
            if last <= NEAR and _turned(program, k, piece) and (piece.centre is None or abs(gone - piece.turn) < 0.01):
                far = max(far, last)
                break
        before = np.array(piece.end, dtype=float)
    if at != len(rows):
        raise ValueError(f"line {program.line[rows[at]]}: {program.end[rows[at]]} is beyond the path")
    return far


def _moving(p):
    moves = (np.abs(p.start - p.end) > 1e-7).any(axis=1)
    moves[p.unknown[:, 0]] = True
    if p.poses is not None:
        moves |= (np.abs(p.poses.start_axis - p.poses.end_axis) > 1e-9).any(axis=1)
    return np.flatnonzero(moves)


def _turned(p, k, piece):
    if piece.axis is None:
        return True
    axis = np.array(piece.axis) / np.linalg.norm(piece.axis)
    here = np.array([0.0, 0.0, 1.0]) if p.poses is None else p.poses.end_axis[k]
    return float(np.abs(here - axis).max()) <= TURNED


def _off(p, k, piece, before, gone):
    """mm from the piece, and deg gone along it so far."""
    if before is None:  # where it starts is not known
        return 0.0, gone
    if piece.centre is None:
        way = np.array(piece.end, dtype=float) - before
        t = np.clip((p.end[k] - before) @ way / max(way @ way, 1e-30), 0.0, 1.0)
        return float(np.linalg.norm(p.end[k] - before - t * way)), gone
    u, v = p.start[k, :2] - piece.centre, p.end[k, :2] - piece.centre
    gone += math.degrees(math.atan2(u[0] * v[1] - u[1] * v[0], u @ v))
    round_off = abs(float(np.linalg.norm(v)) - math.dist(before[:2], piece.centre))
    height = before[2] + (piece.end[2] - before[2]) * gone / piece.turn
    return max(round_off, abs(float(p.end[k, 2]) - height)), gone
