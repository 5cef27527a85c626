"""Earlier cuts of a tool, so that it does not repeat them. Places are tips in mm, access frame, float64."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.kernels.walked import chain_all, fresh_moves, note, repeated_moves
from toolpath.lines import Line, dense, pieces_where, place_keys
from zones.lattice import Lattice

PER_MM = 10_000  # steps of a program in a mm; its writer multiplies and rounds the same
WRITTEN = 1.0 / PER_MM  # mm, resolution of programs: places that round alike are the same
OVERLAP = 3  # known moves of a line repeated on each side, fewer than the proof counts as a stretch cut twice
ON = 2.0 * WRITTEN  # mm off a move that still count as on it
CELL = 10.0 * WRITTEN  # mm, cells in which equal places are searched


class Depths:
    """Depth that one tool has cut, by place: it cannot reach the stock that the map still shows there."""

    def __init__(self, lattice: Lattice) -> None:
        self._lattice = lattice
        self._places: dict[bytes, float] = {}  # mm, Z of the lowest cut by place of a tip
        self._cells = np.full((lattice.ny, lattice.nx), math.inf)  # mm, the same by cell, along the moves too
        self._spots = np.zeros((lattice.ny, lattice.nx, 2))  # mm, X and Y of that
        self._moves: set[tuple[bytes, bytes]] = set()
        self.ways: list[F64] = []  # in their original form, as cut

    def cut(self, points: F64) -> None:
        """Remember a cut along a way of tips.

        points : (n, 3) float64, mm, access frame
        """
        self.ways.append(points)
        for place, z in zip(place_keys(points[:, :2]), points[:, 2].tolist(), strict=True):
            self._places[place] = min(z, self._places.get(place, math.inf))
        keys = _written(points)
        self._moves.update(zip(keys[:-1], keys[1:], strict=True))
        way = dense(points, 0.5 * self._lattice.step)
        way = way[self._lattice.inside(way)]
        way = way[np.argsort(-way[:, 2], kind="stable")]  # of several places in one cell the last one counts
        i, j = self._lattice.cells(way)
        deeper = way[:, 2] < self._cells[i, j]
        i, j, way = i[deeper], j[deeper], way[deeper]
        self._cells[i, j], self._spots[i, j] = way[:, 2], way[:, :2]

    def lowest(self, place: F64) -> float:
        """Z of the lowest cut at exactly the place of a tip, mm; inf where there was none.

        place : (3,) float64, mm, access frame
        """
        return self._places.get(place_keys(place[None, :2])[0], math.inf)

    def were_cut(self, points: F64) -> NDArray[np.bool_]:
        """Whether moves of a line were cut before, each as it stands, (n - 1,) bool.

        points : (n, 3) float64, mm, access frame
        """
        keys = _written(points)
        return np.array([move in self._moves for move in zip(keys[:-1], keys[1:], strict=True)], np.bool_)

    def near(self, place: F64, reach: float) -> F64:
        """Places within ``reach`` mm of a place where the tool has been, nearest first, the lowest of each cell.

        The tool can come down there again from above.

        place : (2,) float64, mm, access frame

        Returns (n, 3) float64, mm, access frame.
        """
        lat = self._lattice
        (i0, i1), (j0, j1) = (sorted(k.tolist()) for k in lat.cells(np.array([place - reach, place + reach])))
        low, at = self._cells[i0:i1 + 1, j0:j1 + 1], self._spots[i0:i1 + 1, j0:j1 + 1]
        been = np.isfinite(low)
        out = np.column_stack([at[been], low[been]])
        far = np.hypot(*(out[:, :2] - place).T)
        return np.ascontiguousarray(out[np.argsort(far, kind="stable")][:int((far <= reach).sum())])

    def above(self, points: F64) -> F64:
        """Height of the lowest earlier cut above a line, all along it, (m,) float64, mm; inf without one.

        points : (n, 3) float64, mm, access frame
        """
        way = dense(points, self._lattice.step)
        there = self._cells[self._lattice.cells(way)] - way[:, 2]
        return np.where(self._lattice.inside(way), there, math.inf)

    def been(self, points: F64) -> NDArray[np.bool_]:
        """Whether the tool has been within a lattice step of places as deep, to what a program can tell, (n,) bool.

        points : (n, 3) float64, mm, access frame

        A cell holds one place of a way that crosses it, so a place on that way may be found in a cell beside its own.
        """
        lat, out = self._lattice, np.zeros(len(points), np.bool_)
        i, j = lat.cells(points)
        for up, right in itertools.product((-1, 0, 1), repeat=2):
            at = np.clip(i + up, 0, lat.ny - 1), np.clip(j + right, 0, lat.nx - 1)
            near = np.hypot(*(self._spots[at] - points[:, :2]).T) <= lat.step
            out |= near & (self._cells[at] <= points[:, 2] + WRITTEN)
        return out

    def copied(self) -> Depths:
        """A copy with a history of its own."""
        out = Depths(self._lattice)
        out._places, out._moves = dict(self._places), set(self._moves)
        out._cells, out._spots, out.ways = self._cells.copy(), self._spots.copy(), list(self.ways)
        return out

    def become(self, other: Depths) -> None:
        """Takes over the history of a copy."""
        self._places, self._moves, self.ways = other._places, other._moves, other.ways
        self._cells, self._spots = other._cells, other._spots


class Walked:
    """Ways that one tool has cut, by their moves.

    Lines are cut to the samples they serve, so one may be part of another. Places nearer than ``ON`` are one: a program
    rounds them in the frame of the part, which may be tilted to this one.
    """

    def __init__(self) -> None:
        self._count, self._notes = 0, _Notes.of(0)
        self.ways: list[F64] = []  # in their original form

    def add(self, points: F64) -> None:
        """Remember a way that the tool has cut from end to end.

        points : (n, 3) float64, mm, access frame
        """
        self.ways.append(points)
        count = self._count + 2 * (len(points) - 1)
        if count > len(self._notes.after):
            self._notes = self._notes.grown(self._count, 2 * count)
        note(self._count, 0, len(points) - 1, np.ascontiguousarray(points), CELL, *self._notes)
        self._count = count

    def fresh(self, line: Line) -> NDArray[np.bool_]:
        """Whether moves of a line were not cut whole before, (n - 1,) bool.

        A move is known where it is part of an earlier move and shares an end with it.
        """
        out = np.ones(len(line.points) - 1, np.bool_)
        fresh_moves(np.ascontiguousarray(line.points), ON, CELL, *self._notes, out)
        return out

    @staticmethod
    def again(line: Line) -> NDArray[np.bool_]:
        """Whether moves of a line repeat earlier moves of the same line, (n - 1,) bool, as turns of a spiral at a
        border do."""
        out = np.zeros(len(line.points) - 1, np.bool_)
        repeated_moves(np.ascontiguousarray(line.points), ON, CELL, *_Notes.of(2 * len(out)), out)
        return out

    def copied(self) -> Walked:
        """A copy with a history of its own."""
        out = Walked()
        out._count, out._notes, out.ways = self._count, self._notes.grown(self._count, 0), list(self.ways)
        return out

    def become(self, other: Walked) -> None:
        """Takes over the history of a copy."""
        self._count, self._notes, self.ways = other._count, other._notes, other.ways


class _Notes(NamedTuple):
    """Moves by the cells of their ends, as ``toolpath.kernels.walked`` reads them.

    ends : (m, 6) float64, mm;  after : (m,) int64;  cells : (s, 2) int64
    """

    ends: F64
    after: NDArray[np.int64]
    cells: NDArray[np.int64]

    @classmethod
    def of(cls, room: int) -> _Notes:
        """Room for so many notes; no more than half of the table is ever used."""
        return cls(np.empty((room, 6)), np.empty(room, np.int64),
                   np.full((2 ** max(2 * room, 2).bit_length(), 2), -1, np.int64))

    def grown(self, count: int, room: int) -> _Notes:
        """A copy of ``count`` notes with room for ``room``, or as much as here where that is more."""
        if room <= len(self.after):
            return _Notes(self.ends.copy(), self.after.copy(), self.cells.copy())
        out = _Notes.of(room)
        out.ends[:count] = self.ends[:count]
        chain_all(count, CELL, *out)
        return out


def still_to_walk(line: Line, fresh: NDArray[np.bool_]) -> list[Line]:
    """The pieces of a line that its fresh moves make up, with ``OVERLAP`` known moves on each side.

    fresh : (n - 1,) bool

    Returns the line itself where every move is fresh.
    """
    if fresh.all():
        return [line]
    wanted = np.concatenate([fresh, [False]]) | np.concatenate([[False], fresh])
    grown = wanted.copy()
    for k in range(1, OVERLAP + 1):
        grown[k:] |= wanted[:-k]
        grown[:-k] |= wanted[k:]
    return pieces_where(line, grown, 0.0, 0.0)


def _written(points: F64) -> list[bytes]:
    """A key for each of points (n, 3), mm, the same for points that round alike in a program."""
    return [row.tobytes() for row in np.rint(points * PER_MM).astype(np.int64)]
