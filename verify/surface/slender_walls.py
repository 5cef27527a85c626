"""Slender walls of the finished part: places of thin sheets and their distance from a support, found by rays.

A place is *thin* where the inward ray along its normal leaves by a face that looks the other way. The search follows
the sheet from its middle down, up and to both sides; rays across it give its thickness. The sheet is supported where it
becomes twice as thick as it was on the way, as at a foot, a bend, a rib or a connection, and not where it ends. Only
the triangles are used, not walls, zones or connections.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples

FACING = -0.5
"""Largest cosine between the normals of the two faces of a sheet: they are more than 120 degrees apart."""
HELD = 2.0
"""Ratio of thickness at which a sheet counts as supported. Bending stiffness grows with its cube: 8 times."""
STEP = 0.5
"""Of the thickness: distance between two measurements across a sheet."""
MAX_SAMPLES = 120_000  # samples from which rays start
MAX_PLACES = 8000  # of all thin walls, one per cell
A_CELL = 4.0  # mean number of samples in the square of a cell: one cell in fifty is empty
SKIN_SHARE = 1e-7  # of the size of the part: rays do not meet the triangle they start on
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ThinWalls:
    """The n places of sheets that are somewhere free for more than a ratio of their thickness.

    row       : (n,) int64, index, sample of each place
    points, normals : (n, 3) float64, mm and unit, of one side
    across, beyond  : (n, 3) float64, mm and unit, exit of the inward ray and the normal there
    thickness : (n,) float64, mm between the two
    free      : (n,) bool, the finished part does not support the sheet within ``limit``
    limit     : (n,) float64, mm, the ratio times the mean thickness of the sheet below the place
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
    wall: INT
    spacing: float

    def __len__(self) -> int:
        return len(self.row)

    def only(self, chosen: BOOL) -> ThinWalls:
        """The places where ``chosen`` (n,) bool is true."""
        return ThinWalls(self.row[chosen], self.points[chosen], self.normals[chosen], self.across[chosen],
                         self.beyond[chosen], self.thickness[chosen], self.free[chosen], self.limit[chosen],
                         self.wall[chosen], self.spacing)


def thin_walls(tree: TriangleTree, samples: SurfaceSamples, ratio: float) -> ThinWalls:
    """Places of sheets that are free, in the finished part, for more than ``ratio`` times their thickness.

    tree    : TriangleTree of the part; samples : on it, outward normals; frame of both with Z up

    Returns ThinWalls: all examined places of each such sheet. Places near a support are among them, since they tell
    where stock stands. Empty where no sheet is so slender.

    Notes
    -----
    Thickness is exact on the mesh. The distance to a support is accurate to ``STEP`` of the thickness; along a curved
    sheet it is the sum of chords of that step.
    """
    size = tree.mesh.bounds[1] - tree.mesh.bounds[0]
    skin = SKIN_SHARE * float(np.linalg.norm(size))
    stride = max(1, -(-len(samples) // MAX_SAMPLES))
    tried = np.arange(0, len(samples), stride)
    tried = tried[np.abs(samples.normals[tried, 2]) < math.cos(math.radians(30.0))]
    far, hit = first_hits(tree, samples.points[tried], -samples.normals[tried], t_min=skin)
    beyond = tree.mesh.normals[np.maximum(hit, 0)]
    sheet = (hit >= 0) & ((beyond * samples.normals[tried]).sum(axis=1) < FACING)
    row, far, beyond = tried[sheet], far[sheet], beyond[sheet]
    high = _high(tree, samples.points[row], samples.normals[row], far, ratio)
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
    free, limit = _followed(tree, points, normals, far, ratio, skin)
    free &= _high(tree, points, normals, limit, 1.0)
    if not free.any():
        return _none()
    wall = _sheets(points - 0.5 * far[:, None] * normals, normals, np.maximum(2.5 * cell, far))
    out = ThinWalls(row, points, normals, points - far[:, None] * normals, beyond, far, free, limit, wall, cell)
    return out.only(np.isin(wall, np.unique(wall[free])))


def _high(tree: TriangleTree, points: F64, normals: F64, length: F64, times: float) -> BOOL:
    """(n,) bool: places from which ``times`` a length, mm, down along the sheet ends above the bottom of the part."""
    lean = np.sqrt(1.0 - normals[:, 2] ** 2)
    return np.asarray(times * length * lean < points[:, 2] - tree.mesh.bounds[0, 2])


def _none() -> ThinWalls:
    none, rows = np.zeros((0, 3)), np.zeros(0, np.int64)
    return ThinWalls(rows, none, none, none, none, np.zeros(0), np.zeros(0, np.bool_), np.zeros(0), rows, 0.0)


def _one_a_cell(points: F64, cell: float) -> INT:
    """Of points (n, 3), mm, the first in each cell of ``cell`` mm."""
    keys = np.floor(points / cell).astype(np.int64)
    return np.sort(np.unique(keys, axis=0, return_index=True)[1])


def _sheets(middle: F64, normals: F64, reach: F64) -> INT:
    """(n,) number of the sheet of each of (n, 3) middles: near places with similar normals share it."""
    tree = cKDTree(middle)
    pairs = tree.query_pairs(float(reach.max()), output_type="ndarray") if len(middle) else np.zeros((0, 2), np.int64)
    a, b = pairs[:, 0], pairs[:, 1]
    apart = middle[b] - middle[a]
    size = np.maximum(np.linalg.norm(apart, axis=1), 1e-12)
    # across a gap between two walls the line from one to the other lies along the normals
    alike = np.abs((normals[a] * normals[b]).sum(axis=1)) > 0.5
    along = np.abs((apart * normals[a]).sum(axis=1)) < 0.7 * size + 1e-3
    near = size <= np.minimum(reach[a], reach[b])
    a, b = a[alike & along & near], b[alike & along & near]
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(middle), len(middle)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _followed(tree: TriangleTree, points: F64, normals: F64, thickness: F64, ratio: float,
              skin: float) -> tuple[BOOL, F64]:
    """Whether the sheet has no support within the limit of each place, and that limit, mm."""
    down = np.array([0.0, 0.0, -1.0]) + normals[:, 2:] * normals
    down /= np.linalg.norm(down, axis=1)[:, None]
    aside = np.cross(normals, down)
    held, limit = _way(tree, points, normals, thickness, down, ratio, skin)
    for way in (-down, aside, -aside):
        left = np.flatnonzero(~held)
        if not len(left):
            break
        held[left] = _way(tree, points[left], normals[left], thickness[left], way[left], ratio, skin)[0]
    return ~held, limit


def _way(tree: TriangleTree, points: F64, normals: F64, thickness: F64, along: F64, ratio: float,
         skin: float) -> tuple[BOOL, F64]:
    """Follow sheets one way: whether each has support within ``ratio`` times its mean thickness; that length, mm.

    A step is ``STEP`` of the thickness, or of the mean so far where that is more. The thickness of a wedge is k times
    the way s from its edge and the mean k s / 2, so each step makes the way 1 + ``STEP`` k / 2 times longer.
    """
    n = len(points)
    held, limit = np.zeros(n, np.bool_), ratio * thickness
    live = np.arange(n)
    middle, square, way = points - 0.5 * thickness[:, None] * normals, normals.copy(), along.copy()
    step = STEP * thickness
    gone, total, looks = np.zeros(n), thickness * step, step.copy()  # the thickness over the way, and the way
    while len(live):
        at = middle[live] + step[live, None] * way[live]
        wide, mid, turned, inside = _across(tree, at, square[live], skin)
        mean = total[live] / looks[live]
        thick = inside & (wide > HELD * mean)
        held[live[thick]] = True
        on = inside & ~thick
        rows = live[on]
        gone[rows] += step[rows]
        total[rows] += wide[on] * step[rows]
        looks[rows] += step[rows]
        limit[rows] = ratio * total[rows] / looks[rows]
        step[rows] = STEP * np.maximum(thickness[rows], total[rows] / looks[rows])
        middle[rows], square[rows] = mid[on], turned[on]
        along_now = way[rows] - (way[rows] * square[rows]).sum(axis=1)[:, None] * square[rows]
        way[rows] = along_now / np.maximum(np.linalg.norm(along_now, axis=1), 1e-9)[:, None]
        live = rows[gone[rows] < limit[rows]]
    return held, limit


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


__all__ = ["ThinWalls", "thin_walls"]
