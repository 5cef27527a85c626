"""Slender walls of the finished part: places of thin sheets and their distance from a support, found by rays.

A place is *thin* where the inward ray along its normal leaves by a face that looks the other way. The search follows
the sheet from its middle, an upright one down, up and to both sides, a level one in eight directions. Rays across it
give its thickness. The sheet is supported where it becomes twice as thick as it was on the way and what it meets there
stands without it (``geometry.mesh_queries.sheet_pieces``): a foot, a bend, a rib or a connection, and not a head on the
free end. It is not supported where it ends. A level sheet is supported also where it rests on table or fixtures. Only
the triangles are used, not walls, zones or connections.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.mesh_queries.sheet_pieces import FACING, SheetPieces, sheet_pieces, sheets_of
from geometry.sampling import SurfaceSamples

LEVEL = math.cos(math.radians(30.0))
"""Of the Z of a normal from which on a sheet is level: it leans by more than 60 degrees."""
HELD = 2.0
"""Ratio of thickness at which a sheet counts as supported. Bending stiffness grows with its cube: 8 times."""
STEP = 0.5
"""Of the thickness: distance between two measurements across a sheet."""
MAX_SAMPLES = 120_000  # samples from which rays start
MAX_PLACES = 8000  # of all thin walls, one per cell
A_CELL = 4.0  # mean number of samples in the square of a cell: one cell in fifty is empty
DIRECTIONS = 8  # in which a level sheet is followed: the nearest support is no farther than 1.08 times its distance
TOUCHES = 0.02  # mm between two faces that rest on each other
SKIN_SHARE = 1e-7  # of the size of the part: rays do not meet the triangle they start on
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


class Lie(Enum):
    """How sheets lie: those that lean by more than 60 degrees are level."""

    UPRIGHT = "upright"
    LEVEL = "level"


@dataclass(frozen=True, eq=False)
class Rests:
    """What holds level sheets from below.

    plane    : mm, Z of the plane that the part lies on; -inf where it lies on none
    fixtures : boxes as (2, 3) float64 corners, mm
    """

    plane: float = -math.inf
    fixtures: tuple[F64, ...] = ()

    def hold(self, low: F64) -> BOOL:
        """Which places of undersides lie on the plane or on a fixture.

        low : (n, 3) float64, mm, setup frame

        Returns (n,) bool.
        """
        out = low[:, 2] <= self.plane + TOUCHES
        for lower, upper in self.fixtures:
            inside = ((low[:, :2] >= lower[:2]) & (low[:, :2] <= upper[:2])).all(axis=1)
            out |= inside & (np.abs(low[:, 2] - upper[2]) <= TOUCHES)
        return np.asarray(out)


@dataclass(frozen=True, eq=False)
class ThinWalls:
    """The n places of sheets that are somewhere free for more than a ratio of their thickness.

    row       : (n,) int64, index, sample of each place
    points, normals : (n, 3) float64, mm and unit, of one side
    across, beyond  : (n, 3) float64, mm and unit, exit of the inward ray and the normal there
    thickness : (n,) float64, mm between the two
    free      : (n,) bool, the finished part does not support the sheet within ``limit``
    limit     : (n,) float64, mm, the ratio times the mean thickness of the sheet below the place; of a level sheet, in
                the direction where it is thickest
    support   : (n,) float64, mm, a way along the sheet to what holds it in the finished part, no more than ``limit``;
                inf where ``free``
    wall      : (n,) int64, index, places of one sheet share a number
    spacing   : mm, size of the cells that hold at most one place
    """

    row: INT
    points: F64
    normals: F64
    across: F64
    beyond: F64
    thickness: F64
    free: BOOL
    limit: F64
    support: F64
    wall: INT
    spacing: float

    def __len__(self) -> int:
        return len(self.row)

    def only(self, chosen: BOOL) -> ThinWalls:
        """The places where ``chosen`` (n,) bool is true."""
        return ThinWalls(self.row[chosen], self.points[chosen], self.normals[chosen], self.across[chosen],
                         self.beyond[chosen], self.thickness[chosen], self.free[chosen], self.limit[chosen],
                         self.support[chosen], self.wall[chosen], self.spacing)


def thin_walls(tree: TriangleTree, samples: SurfaceSamples, ratio: float, lie: Lie = Lie.UPRIGHT,
               rests: Rests | None = None) -> ThinWalls:
    """Places of sheets that are free, in the finished part, for more than ``ratio`` times their thickness.

    tree    : TriangleTree of the part; samples : on it, outward normals; frame of both with Z up
    lie     : sheets that are examined; rests : what holds level ones from below

    Returns ThinWalls: all examined places of each such sheet. Places near a support are among them, since they tell
    where stock stands. Empty where no sheet is so slender.

    Notes
    -----
    Thickness is exact on the mesh. The distance to a support is accurate to ``STEP`` of the thickness; along a curved
    sheet it is the sum of chords of that step.
    """
    size = tree.mesh.bounds[1] - tree.mesh.bounds[0]
    skin = SKIN_SHARE * float(np.linalg.norm(size))
    rests = rests or Rests()
    stride = max(1, -(-len(samples) // MAX_SAMPLES))
    tried = np.arange(0, len(samples), stride)
    tried = tried[(np.abs(samples.normals[tried, 2]) >= LEVEL) == (lie is Lie.LEVEL)]
    # no place is so thick that is high or like one that is
    way = float(np.hypot(*size[:2])) if lie is Lie.LEVEL else float(size[2]) / math.sqrt(1.0 - LEVEL**2)
    most = HELD / ratio * way
    far, hit = first_hits(tree, samples.points[tried], -samples.normals[tried], t_min=skin, t_max=most)
    beyond = tree.mesh.normals[np.maximum(hit, 0)]
    sheet = (hit >= 0) & ((beyond * samples.normals[tried]).sum(axis=1) < FACING)
    row, far, beyond = tried[sheet], far[sheet], beyond[sheet]
    high = _high(tree, samples.points[row], samples.normals[row], far, ratio, lie)
    if lie is Lie.LEVEL:
        high &= ~rests.hold(_lower(samples.points[row], samples.normals[row], far))
    if not high.any():
        return _none()
    like = far < HELD * float(far[high].max())  # places nearer to the foot tell where stock stands
    row, far, beyond = row[like], far[like], beyond[like]
    points = samples.points[row]
    cell = max(float(np.median(far)) * STEP, math.sqrt(A_CELL * stride * float(samples.area[row].mean())))
    while len(one := _one_a_cell(points, cell)) > MAX_PLACES:
        cell *= 1.25
    row, far, beyond, points = row[one], far[one], beyond[one], points[one]
    normals = samples.normals[row]
    ways = _Ways(tree, ratio, skin, _level_ways(normals) if lie is Lie.LEVEL else _upright_ways(normals),
                 lie, rests, HELD * float(far.max()))
    support, limit = ways.support(points, normals, far)
    free = np.isinf(support) & _high(tree, points, normals, limit, 1.0, lie)
    support = np.where(free, np.inf, np.minimum(support, limit))
    if not free.any():
        return _none()
    wall = sheets_of(points - 0.5 * far[:, None] * normals, normals, np.maximum(2.5 * cell, far), far)
    out = ThinWalls(row, points, normals, points - far[:, None] * normals, beyond, far, free, limit, support,
                    wall, cell)
    return out.only(np.isin(wall, np.unique(wall[free])))


def _high(tree: TriangleTree, points: F64, normals: F64, length: F64, times: float, lie: Lie) -> BOOL:
    """(n,) bool: places from which ``times`` a length, mm, along the sheet ends above the bottom of the part; of level
    sheets, within its width."""
    if lie is Lie.LEVEL:
        low, high = tree.mesh.bounds[:, :2]
        way = np.hypot(*np.maximum(points[:, :2] - low, high - points[:, :2]).T)
        return np.asarray(times * length < way)
    lean = np.sqrt(1.0 - normals[:, 2] ** 2)
    return np.asarray(times * length * lean < points[:, 2] - tree.mesh.bounds[0, 2])


def _lower(points: F64, normals: F64, thickness: F64) -> F64:
    """(n, 3) mm, the lower of the two sides of level sheets."""
    return np.where(normals[:, 2:] < 0.0, points, points - thickness[:, None] * normals)


def _none() -> ThinWalls:
    none, rows = np.zeros((0, 3)), np.zeros(0, np.int64)
    lengths = np.zeros(0)
    return ThinWalls(rows, none, none, none, none, lengths, np.zeros(0, np.bool_), lengths, lengths, rows, 0.0)


def _one_a_cell(points: F64, cell: float) -> INT:
    """Of points (n, 3), mm, the first in each cell of ``cell`` mm."""
    keys = np.floor(points / cell).astype(np.int64)
    return np.sort(np.unique(keys, axis=0, return_index=True)[1])


def _upright_ways(normals: F64) -> list[F64]:
    """Down, up and to both sides along upright sheets, (n, 3) unit each."""
    down = np.array([0.0, 0.0, -1.0]) + normals[:, 2:] * normals
    down /= np.linalg.norm(down, axis=1)[:, None]
    aside = np.cross(normals, down)
    return [down, -down, aside, -aside]


def _level_ways(normals: F64) -> list[F64]:
    """``DIRECTIONS`` along level sheets, (n, 3) unit each."""
    first = np.cross(normals, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(normals, first)
    return [math.cos(a) * first + math.sin(a) * second
            for a in (2.0 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS).tolist()]


@dataclass(eq=False)
class _Ways:
    """Follows sheets up to ``ratio`` times their mean thickness.

    ways     : directions, (n, 3) unit each, the first that of the limit of upright sheets
    thickest : mm, sheets are thinner
    """

    tree: TriangleTree
    ratio: float
    skin: float
    ways: list[F64]
    lie: Lie
    rests: Rests
    thickest: float
    pieces: SheetPieces | None = None

    def support(self, points: F64, normals: F64, thickness: F64) -> tuple[F64, F64]:
        """A way along the sheet to its support within the limit of each place, mm, inf for none, and that limit, mm."""
        support = np.full(len(points), np.inf)
        if self.lie is Lie.LEVEL:
            support[self.rests.hold(_lower(points, normals, thickness))] = 0.0
        limit = self.ratio * thickness
        for k, way in enumerate(self.ways):
            left = np.flatnonzero(np.isinf(support))
            if not len(left):
                break
            support[left], length, ends = self._way(points[left], normals[left], thickness[left], way[left])
            if k == 0 and self.lie is Lie.UPRIGHT:
                limit[left] = length
            elif self.lie is Lie.LEVEL:
                limit[left] = np.maximum(limit[left], np.where(ends, 0.0, length))
        return support, limit

    def _way(self, points: F64, normals: F64, thickness: F64, along: F64) -> tuple[F64, F64, BOOL]:
        """Follow sheets one way: how far the support of each is, mm, inf where none is within the limit; the limit, mm;
        whether it ends before.

        A step is ``STEP`` of the thickness, or of the mean so far where that is more. The thickness of a wedge is k
        times the way s from its edge and the mean k s / 2, so each step makes the way 1 + ``STEP`` k / 2 times longer.
        """
        n = len(points)
        support, ends, limit = np.full(n, np.inf), np.zeros(n, np.bool_), self.ratio * thickness
        live = np.arange(n)
        middle, square, way = points - 0.5 * thickness[:, None] * normals, normals.copy(), along.copy()
        step = STEP * thickness
        gone, total, looks = np.zeros(n), thickness * step, step.copy()  # the thickness over the way, and the way
        while len(live):
            at = middle[live] + step[live, None] * way[live]
            wide, mid, turned, inside = _across(self.tree, at, square[live], self.skin)
            thick = inside & (wide > HELD * total[live] / looks[live])
            met = live[thick]
            stand = self._stand(points[met], normals[met], thickness[met], mid[thick], turned[thick], wide[thick],
                                limit[met])
            support[met[stand]] = gone[met[stand]] + step[met[stand]]
            if self.lie is Lie.LEVEL:
                rests = inside & ~thick & self.rests.hold(mid - 0.5 * wide[:, None] * _upwards(turned))
                support[live[rests]] = gone[live[rests]] + step[live[rests]]
                thick |= rests
            ends[live[~inside]] = True
            on = inside & ~thick
            rows = live[on]
            gone[rows] += step[rows]
            total[rows] += wide[on] * step[rows]
            looks[rows] += step[rows]
            limit[rows] = self.ratio * total[rows] / looks[rows]
            step[rows] = STEP * np.maximum(thickness[rows], total[rows] / looks[rows])
            middle[rows], square[rows] = mid[on], turned[on]
            along_now = way[rows] - (way[rows] * square[rows]).sum(axis=1)[:, None] * square[rows]
            way[rows] = along_now / np.maximum(np.linalg.norm(along_now, axis=1), 1e-9)[:, None]
            live = rows[gone[rows] < limit[rows]]
        return support, limit, ends

    def _stand(self, points: F64, normals: F64, thickness: F64, mid: F64, across: F64, wide: F64, limit: F64) -> BOOL:
        """Whether what sheets (n,) meet at thick places (n,) stands without them."""
        if not len(points):
            return np.zeros(0, np.bool_)
        if self.pieces is None:
            self.pieces = sheet_pieces(self.tree, self.thickest, float(limit.min()))
        sheet = self.pieces.sheet_at(points - 0.5 * thickness[:, None] * normals)
        half = 0.5 * wide[:, None] * across
        return np.asarray(self.pieces.stand_without(mid + half, sheet) | self.pieces.stand_without(mid - half, sheet))


def _upwards(normals: F64) -> F64:
    """(n, 3) unit normals, turned to look up."""
    return np.where(normals[:, 2:] < 0.0, -normals, normals)


def _across(tree: TriangleTree, at: F64, square: F64, skin: float) -> tuple[F64, F64, F64, BOOL]:
    """Thickness of the part across places (n, 3), mm, the middle of it, its normal, and whether a place is in it."""
    plus, a = first_hits(tree, at, square, t_min=skin)
    minus, b = first_hits(tree, at, -square, t_min=skin)
    out, back = tree.mesh.normals[np.maximum(a, 0)], tree.mesh.normals[np.maximum(b, 0)]
    inside = ((a >= 0) & (b >= 0) & ((out * square).sum(axis=1) > 0.0) & ((back * square).sum(axis=1) < 0.0))
    plus, minus = np.where(inside, plus, 0.0), np.where(inside, minus, 0.0)
    turned = out - back
    size = np.linalg.norm(turned, axis=1)
    turned = np.where((size > 1.0)[:, None], turned / np.maximum(size, 1e-9)[:, None], square)
    return plus + minus, at + (0.5 * (plus - minus))[:, None] * square, turned, inside


__all__ = ["Lie", "Rests", "ThinWalls", "thin_walls"]
