"""Earlier cuts of a tool, so that it does not repeat them. Places are tips in mm, access frame, float64."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64
from toolpath.lines import Line, dense, pieces_where, place_keys
from zones.lattice import Lattice

PER_MM = 10_000  # steps of a program in a mm; its writer multiplies and rounds the same
WRITTEN = 1.0 / PER_MM  # mm, resolution of programs: places that round alike are the same
OVERLAP = 3  # known moves of a line repeated on each side, fewer than the proof counts as a stretch cut twice
ON = 2.0 * WRITTEN  # mm off a move that still count as on it
CELL = 10.0 * WRITTEN  # mm, cells in which equal places are searched
CELL_BITS = 2**21 - 1
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


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
        self._moves: dict[int, list[tuple[F64, F64]]] = {}
        self.ways: list[F64] = []  # in their original form

    def add(self, points: F64) -> None:
        """Remember a way that the tool has cut from end to end.

        points : (n, 3) float64, mm, access frame
        """
        self.ways.append(points)
        keys = _cells(points).tolist()
        for a, b, p, q in zip(keys[:-1], keys[1:], points[:-1], points[1:], strict=True):
            self._moves.setdefault(a, []).append((p, q))
            self._moves.setdefault(b, []).append((q, p))

    def fresh(self, line: Line) -> NDArray[np.bool_]:
        """Whether moves of a line were not cut whole before, (n - 1,) bool.

        A move is known where it is part of an earlier move and shares an end with it.
        """
        points, moves = line.points, self._moves
        out = np.ones(len(points) - 1, np.bool_)
        near = _cells(points[:, None, :] + ON * CORNERS).tolist()
        known = [[key for key in dict.fromkeys(keys) if key in moves] for keys in near]
        for k in range(len(out)):
            p, q = points[k], points[k + 1]
            out[k] = not (known[k] and self._along(p, q, known[k]) or known[k + 1] and self._along(q, p, known[k + 1]))
        return out

    @staticmethod
    def again(line: Line) -> NDArray[np.bool_]:
        """Whether moves of a line repeat earlier moves of the same line, (n - 1,) bool, as turns of a spiral at a
        border do."""
        out = np.zeros(len(line.points) - 1, np.bool_)
        if len(cKDTree(line.points).query_pairs(ON)) <= 1:  # a ring comes back to its beginning
            return out
        so_far = Walked()
        for k in range(len(out)):
            move = line.points[k:k + 2]
            out[k] = not so_far.fresh(Line(move, False))[0]
            so_far.add(move)
        return out

    def _along(self, start: F64, end: F64, near: Sequence[int]) -> bool:
        """Whether an earlier move from ``start``, in one of the cells ``near`` it, passes over ``end``."""
        for p, q in (move for key in near for move in self._moves[key]):
            if float((p - start) @ (p - start)) >= ON * ON:
                continue
            way, there = q - start, end - start
            size = float(way @ way)
            share = float(there @ way) / size if size > 0.0 else 0.0
            off = there - share * way
            if 0.0 <= share * size <= size + ON * size**0.5 and float(off @ off) < ON * ON:
                return True
        return False

    def copied(self) -> Walked:
        """A copy with a history of its own."""
        out = Walked()
        out._moves, out.ways = {key: list(ends) for key, ends in self._moves.items()}, list(self.ways)
        return out

    def become(self, other: Walked) -> None:
        """Takes over the history of a copy."""
        self._moves, self.ways = other._moves, other.ways


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


def _cells(points: F64) -> NDArray[np.int64]:
    """A number (...) for the cell of each of points (..., 3), mm; cells ``2**21`` apart share one."""
    cells = np.floor(points / CELL).astype(np.int64) & CELL_BITS
    return np.asarray(cells[..., 0] << 42 | cells[..., 1] << 21 | cells[..., 2])
