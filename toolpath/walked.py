"""What a tool has walked whole, so that it need not walk it again."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.levels import Line, place_keys

LEVEL = 1e-6  # mm, of a level line
ON = 1e-5  # mm off a move, and still on it


class Walked:
    """Lines that one tool has walked from end to end, by the places they go through.

    Of level lines the moves are known, for they are cut to the samples they serve and one may be part of another; of
    others only the whole.
    """

    def __init__(self) -> None:
        self._moves: dict[bytes, list[F64]] = {}
        self._lines: set[bytes] = set()

    def add(self, line: Line) -> None:
        """Remember a line that was walked whole."""
        if not _level(line):
            self._lines.add(_digest(line))
            return
        keys = place_keys(line.points)
        for a, b, p, q in zip(keys[:-1], keys[1:], line.points[:-1], line.points[1:], strict=True):
            self._moves.setdefault(a, []).append(q)
            self._moves.setdefault(b, []).append(p)

    def fresh(self, line: Line) -> NDArray[np.bool_]:
        """Which moves (n - 1,) of a line were not walked whole before.

        A move is known where it is part of one that was walked, and shares an end with it.
        """
        count = len(line.points) - 1
        if not _level(line):
            return np.full(count, _digest(line) not in self._lines)
        keys, points = place_keys(line.points), line.points
        return np.array([not (self._along(keys[k], points[k], points[k + 1])
                              or self._along(keys[k + 1], points[k + 1], points[k])) for k in range(count)])

    def _along(self, key: bytes, start: F64, end: F64) -> bool:
        """Whether a walked move from ``start`` goes over ``end``."""
        for q in self._moves.get(key, ()):
            way, asked = q - start, end - start
            size = float(way @ way)
            share = float(asked @ way) / size if size > 0.0 else 0.0
            off = asked - share * way
            if 0.0 <= share * size <= size + ON * size**0.5 and float(off @ off) < ON * ON:
                return True
        return False

    def copied(self) -> Walked:
        """The same, to be added to on its own."""
        out = Walked()
        out._moves, out._lines = {key: list(ends) for key, ends in self._moves.items()}, set(self._lines)
        return out

    def become(self, other: Walked) -> None:
        """Take over what a copy of this has come to."""
        self._moves, self._lines = other._moves, other._lines


def _level(line: Line) -> bool:
    return float(np.ptp(line.points[:, 2])) < LEVEL


def _digest(line: Line) -> bytes:
    return hashlib.blake2b(b"".join(place_keys(line.points)), digest_size=16).digest()
