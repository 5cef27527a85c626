"""Trapezoidal map of segments in plan, its look-up, and the faces of the arrangement.

1. The segments are snap-rounded to pieces on a grid (``zones.plan_view.snap_rounding``).
2. The pieces are put into the map in random order (``zones.kernels.trapezoid``), inside a box.
3. Trapezoids that are neighbours across a wall belong to one face.

The map of a set of pieces is unique. Trapezoids and faces are numbered by their left points, so the numbers do not
depend on the seed or on the order of the segments. docs/theory/subdivision.md has the argument. All places lie in
the plan frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from geometry.errors import GeometryError, InputError, InternalError
from geometry.mesh import F64
from zones.kernels import trapezoid as kernel
from zones.plan_view.snap_rounding import I64, Noding, finite_pairs, node_segments

REPAIRS = 64  # largest number of crossings missed by floating point; above it the noding fails
FIRST_ROUND = 256  # pieces inserted in random order, regardless of place


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces of the arrangement inside the box; face 0 is the outer one.

    of_trapezoid : (t,) int64, face of every trapezoid
    above, below : (n + 2,) int64, face on either side of every piece (left and right of a vertical one), and of
                   the bottom and top of the box, which have -1 outside
    doubled      : (f,) int64, exact: twice the area in squares of the grid step
    areas        : (f,) float64, mm²
    """

    of_trapezoid: I64
    above: I64
    below: I64
    doubled: I64
    areas: F64

    def merged(self, across: NDArray[np.bool_]) -> Faces:
        """Faces joined across some pieces, numbered by their first trapezoid. across : (n + 2,) bool."""
        both = across & (self.above >= 0) & (self.below >= 0)
        f = len(self.doubled)
        pairs = coo_matrix((np.ones(int(both.sum()), np.int8), (self.above[both], self.below[both])), shape=(f, f))
        label = _by_first(connected_components(pairs, directed=False)[1])
        doubled, areas = np.zeros(int(label.max()) + 1, np.int64), np.zeros(int(label.max()) + 1)
        np.add.at(doubled, label, self.doubled)
        np.add.at(areas, label, self.areas)
        above, below = (np.where(side >= 0, label[side], -1) for side in (self.above, self.below))
        return Faces(label[self.of_trapezoid], above, below, doubled, areas)


@dataclass(frozen=True, eq=False)
class TrapezoidMap:
    """Trapezoids between n pieces inside a box; all indices int64.

    noding      : the pieces and their segments; its grid (mm) is the unit of ``points``
    points      : (m, 2) grid steps, ends of pieces and corners of the box (the first and last two), by x, then y
    pieces      : (n + 2, 2) indices into ``points``, lesser first, in the order of ``noding.pieces``; then the bottom
                  and the top of the box
    top, bottom : (t,) pieces
    left, right : (t,) points, whose walls bound the trapezoid
    neighbours  : (t, 4) trapezoids upper left, lower left, upper right, lower right; -1 where none. An upper one
                  has the same top, a lower one the same bottom.
    flat        : (t,) bool, no width: left and right have one x. They link neighbours from point to point up a common
                  wall and are never the answer to a look-up.
    """

    noding: Noding
    points: I64
    pieces: I64
    top: I64
    bottom: I64
    left: I64
    right: I64
    neighbours: I64
    flat: NDArray[np.bool_]
    nodes: NDArray[np.int32]
    inserted: I64

    @staticmethod
    def of(segments: ArrayLike, grid: float = 1e-3, seed: int = 0, margin: float = 1.0) -> TrapezoidMap:
        """Map of any segments [DeBerg2008, chapter 6].

        segments : (s, 2, 2) float64, mm, in plan
        grid     : mm, step of the grid of the arrangement
        seed     : of the order of insertion; changes the time, never the map
        margin   : mm, > 0, of the box round the segments, rounded up to the grid
        Raises InputError (bad_segments, not_finite, bad_grid, bad_margin, out_of_bounds), GeometryError (not_noded),
        InternalError (broken_map).

        >>> TrapezoidMap.of([[[0, 0], [4, 0]], [[4, 0], [0, 3]], [[0, 3], [0, 0]]]).faces().areas.round(6).tolist()
        [24.0, 6.0]
        """
        noding = node_segments(segments, grid)
        for _ in range(REPAIRS):
            made = _built(noding, seed, margin)
            if isinstance(made, TrapezoidMap):
                return made
            noding = noding.with_crossing(*made)
        return TrapezoidMap.of_noding(noding, seed, margin)

    @staticmethod
    def of_noding(noding: Noding, seed: int = 0, margin: float = 1.0) -> TrapezoidMap:
        """Map of pieces that meet only at their ends, which the construction checks exactly [DeBerg2008, chapter 6].

        Raises GeometryError (not_noded, with the numbers of two pieces), InputError (bad_margin, out_of_bounds),
        InternalError (broken_map).
        """
        made = _built(noding, seed, margin)
        if isinstance(made, TrapezoidMap):
            return made
        raise GeometryError(f"pieces {made[0]} and {made[1]} cross, touch or lie on each other", code="not_noded",
                            subjects=(str(made[0]), str(made[1])), limit="pieces meet at their ends only",
                            remedy="node the segments first, as TrapezoidMap.of does")

    def corners(self) -> F64:
        """(t, 4, 2) float64, mm, in plan: left bottom, right bottom, right top, left top.

        Heights are rounded to 2 ulp of the coordinate in grid steps. A triangle has two equal corners; a flat
        trapezoid is a stretch of wall.
        """
        x = [self.points[self.left, 0], self.points[self.right, 0]]
        here = [self.points[self.left, 1], self.points[self.right, 1]]
        rows = [(x[k], self._height(line, x[k], here[k]))
                for line, k in ((self.bottom, 0), (self.bottom, 1), (self.top, 1), (self.top, 0))]
        return np.stack([np.stack(r, axis=-1) for r in rows], axis=1) * self.noding.grid

    def locate(self, points: ArrayLike) -> I64:
        """(k,) int64, index of the trapezoid of each point; see ``look_up``.

        points : (k, 2) float64, mm, in plan
        """
        return self.look_up(points)[0]

    def look_up(self, points: ArrayLike) -> tuple[I64, I64]:
        """Trapezoid and depth of the search for points [DeBerg2008, chapter 6].

        points : (k, 2) float64, mm, in plan

        Points are rounded to 1/256 of the grid step. A point on a piece belongs above it; on a vertical piece, or
        under or over a point of the map, right of it. Returns the trapezoid, (k,) int64, index, -1 outside the
        box (and on its right and top side), and the visited inner nodes, (k,) int64, count.
        Raises InputError (bad_segments, not_finite).
        """
        steps = finite_pairs(points, "(n, 2)") / self.noding.grid
        far = float(kernel.LIMIT)
        places = np.floor(np.clip(steps, -far, far) * kernel.SUB + 0.5).astype(np.int64)
        found, depth = kernel.find_trapezoids(self.nodes, self.points, self.inserted, places)
        return found, depth

    def faces(self) -> Faces:
        """Trapezoids merged across their walls, with exact areas."""
        t = len(self.top)
        rows, column = np.nonzero(self.neighbours[:, 2:] >= 0)
        pairs = (rows, self.neighbours[rows, column + 2])
        _, label = connected_components(coo_matrix((np.ones(len(rows), np.int8), pairs), shape=(t, t)), directed=False)
        face = _by_first(label)
        above = np.full(len(self.pieces), -1, np.int64)
        below = above.copy()
        above[self.bottom], below[self.top] = face, face
        p, q = self.points[self.pieces[:, 0]], self.points[self.pieces[:, 1]]
        # twice the area between piece and bottom of the box; partial sums may overflow, the result fits
        strip = (q[:, 0] - p[:, 0]) * (p[:, 1] + q[:, 1] - 2 * self.points[0, 1])
        doubled = np.zeros(int(face.max()) + 1, np.int64)
        np.add.at(doubled, below[below >= 0], strip[below >= 0])
        np.subtract.at(doubled, above[above >= 0], strip[above >= 0])
        return Faces(face, above, below, doubled, doubled.astype(np.float64) * (0.5 * self.noding.grid**2))

    def windings(self, faces: Faces) -> I64:
        """(f,) int64, count: winding number of the input segments around each face, counter-clockwise positive.

        The outer face has 0. The segments run from their first end to their second and must form closed lines.

        Raises
        ------
        InternalError
            Code 'broken_map': a face has no path to the outer one.
        """
        n, s = len(self.noding.pieces), self.noding.segments
        ahead = (s[:, 0, 0] < s[:, 1, 0]) | ((s[:, 0, 0] == s[:, 1, 0]) & (s[:, 0, 1] < s[:, 1, 1]))
        passed = np.zeros(n, np.int64)  # passes along each piece from its lesser end, less those in the other direction
        np.add.at(passed, np.repeat(np.arange(n), np.diff(self.noding.starts)),
                  np.where(ahead, 1, -1)[self.noding.sources])
        left, right = faces.above[:n], faces.below[:n]
        out = np.zeros(len(faces.doubled), np.int64)
        known = np.arange(len(out)) == 0
        while not known.all():
            up, down = known[right] & ~known[left], known[left] & ~known[right]
            if not (up.any() or down.any()):
                raise InternalError("a face of the trapezoidal map has no path to the outer one", code="broken_map")
            out[left[up]] = out[right[up]] + passed[up]
            out[right[down]] = out[left[down]] - passed[down]
            known[left[up]] = known[right[down]] = True
        return out

    def outline(self, faces: Faces, face: int) -> shapely.Polygon | shapely.MultiPolygon:
        """One face as a polygon with its holes, mm, without pieces that have the face on both sides."""
        edge = (faces.above == face) != (faces.below == face)
        lines = self.points[self.pieces[edge]]
        if face == 0:
            b, d, a, c = self.points[0], self.points[1], self.points[-2], self.points[-1]
            lines = np.concatenate([lines, [[b, d], [a, c]]])
        return shapely.build_area(shapely.multilinestrings(lines * self.noding.grid))

    def _height(self, line: I64, x: I64, fallback: I64) -> F64:
        """y of pieces at x, grid steps; ``fallback`` on a vertical one."""
        p, q = self.points[self.pieces[line, 0]], self.points[self.pieces[line, 1]]
        run = q[:, 0] - p[:, 0]
        rise = (q[:, 1] - p[:, 1]) * (x - p[:, 0])
        return np.where(run == 0, fallback, p[:, 1] + rise / np.maximum(run, 1))


def _by_first(label: NDArray[np.int32]) -> I64:
    """Labels (k,) numbered in the order of their first occurrence."""
    _, first, at = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[at.ravel()].astype(np.int64)


def insertion_order(points: I64, pieces: I64, seed: int) -> I64:
    """Random order of insertion in which neighbours in plan often follow each other, for the cache [Amenta2003].

    points : (m, 2) int64, index of the grid, in plan
    pieces : (n, 2) int64, index of the points
    Returns (n,) int64, index of the pieces.
    A random permutation is cut into rounds, each as large as all before it. Every round is sorted along a Hilbert
    curve. Rounds remain random samples, which keeps the expected cost. The depth of the look-up is measured, not
    proved.
    References: Amenta, Choi and Rote, Incremental constructions con BRIO, 2003.
    """
    n = len(pieces)
    order = np.random.default_rng(seed).permutation(n)
    rank = np.arange(n)
    turn = np.where(rank < FIRST_ROUND, 0, 1 + np.floor(np.log2(np.maximum(rank, 1) / FIRST_ROUND)))
    middle = points[pieces[order]].sum(axis=1)
    key = np.where(rank < FIRST_ROUND, rank, _hilbert(middle))
    return order[np.lexsort((key, turn))]


def _hilbert(xy: I64) -> I64:
    """Place along a Hilbert curve of 2^16 x 2^16 cells over the extent of xy (n, 2) int64. Returns (n,) int64."""
    if len(xy) == 0:
        return np.zeros(0, np.int64)
    cell = xy - xy.min(axis=0)
    cell >>= max(0, int(cell.max()).bit_length() - 16)
    x, y = cell[:, 0], cell[:, 1]
    place = np.zeros(len(xy), np.int64)
    for bit in range(15, -1, -1):
        east, north = (x >> bit) & 1, (y >> bit) & 1
        place = (place << 2) | ((3 * east) ^ north)
        flip = (north == 0) & (east == 1)  # the lower quarters are rotated: mirror the right one, swap axes in both
        x, y = np.where(flip, 0xFFFF - x, x), np.where(flip, 0xFFFF - y, y)
        x, y = np.where(north == 0, y, x), np.where(north == 0, x, y)
    return place


def _built(noding: Noding, seed: int, margin: float) -> TrapezoidMap | tuple[int, int]:
    """The map, or two pieces that meet away from their ends."""
    points, pieces = _boxed(noding, margin)
    n = len(pieces) - 2
    order = np.append(insertion_order(points, pieces[:n], seed), [n, n + 1])
    inserted = np.ascontiguousarray(pieces[order])
    state, s, t, trap, nodes = kernel.build_map(points, inserted)
    if state == kernel.MEET:
        return int(order[s]), int(order[t])
    if state == kernel.LOST:
        raise InternalError(f"the trapezoidal map has a broken link along piece {int(order[s])}", code="broken_map")
    live = np.flatnonzero(trap[:, kernel.TOP] >= 0)
    table = trap[live].astype(np.int64)
    top, bottom = order[table[:, kernel.TOP]], order[table[:, kernel.BOTTOM]]
    rank = np.lexsort((top, bottom, table[:, kernel.RIGHT], table[:, kernel.LEFT]))
    number = np.full(len(trap) + 1, -1, np.int64)  # its last entry is the answer for -1
    number[live[rank]] = np.arange(len(live))
    table, leaf = table[rank], nodes[:, 0] == kernel.IS_LEAF
    nodes[leaf, 1] = number[nodes[leaf, 1]]
    left, right = table[:, kernel.LEFT], table[:, kernel.RIGHT]
    return TrapezoidMap(noding, points, pieces, top[rank], bottom[rank], left, right,
                        number[table[:, kernel.UL : kernel.LEAF]], points[left, 0] == points[right, 0], nodes, inserted)


def _boxed(noding: Noding, margin: float) -> tuple[I64, I64]:
    """Points with the corners of the box, sorted, and pieces with its bottom and top."""
    if not (np.isfinite(margin) and margin > 0.0):
        raise InputError(f"the margin of the box is {margin} mm", code="bad_margin", measured=float(margin), limit=0.0,
                         remedy="give a positive length, such as 1 mm")
    used, at = np.unique(noding.pieces, return_inverse=True)
    points = noding.hot[used].reshape(-1, 2)
    steps = np.ceil(min(margin / noding.grid, 2.0 * kernel.LIMIT))
    around = points if len(points) else np.zeros((1, 2), np.int64)
    (x0, y0), (x1, y1) = around.min(axis=0) - int(steps), around.max(axis=0) + int(steps)
    most = int(max(-x0, -y0, x1, y1))
    if most >= kernel.LIMIT:
        raise InputError(f"the box extends to {most * noding.grid:.6g} mm, beyond {kernel.LIMIT - 1} grid steps",
                         code="out_of_bounds", measured=most * noding.grid, limit=(kernel.LIMIT - 1) * noding.grid,
                         remedy="take a coarser grid or a smaller margin, or move the segments to the origin")
    boxed = np.concatenate([[[x0, y0], [x0, y1]], points, [[x1, y0], [x1, y1]]]).astype(np.int64)
    m = len(boxed)
    return boxed, np.concatenate([at.reshape(-1, 2) + 2, [[0, m - 2], [1, m - 1]]]).astype(np.int64)
