"""Thin sheets of a solid and the pieces that they join, by rays from places spread over its surface.

A place belongs to a *sheet* where the solid is thin, and to a *piece* elsewhere. Thin places share a sheet where they
are near each other, look alike and differ in thickness by less than twice. Other places share a piece where they are
neighbours on the surface. Sheets and pieces are the nodes of a graph, and neighbours join them. A piece *stands*
without a sheet where it is joined with the lowest places of the solid in some other way than through that sheet. So a
head on a thin web does not stand without the web, and a foot, a rib or a bar to another wall does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import sample_surface

FACING = -0.5
"""Largest cosine between the normals of the two faces of a sheet: they are more than 120 degrees apart."""
TIMES = 2.0
"""Ratio of thickness from which on two neighbours are not of one sheet."""
FEWEST, MOST = 20_000, 150_000  # places on the surface
A_LENGTH = 3.0  # places on the length that is to be told apart
NEIGHBOURS = 12
FAR = 4.0  # of the spacing of places: neighbours are no farther apart
REACH = 2.0  # of the spacing: thin places of one sheet are no farther apart
LEAN = 0.3  # cosine between normals and the line to a neighbour: walls apart by 0.6 spacings are two
THROUGH_AIR = 0.8  # cosine to the line between two places that both face each other: a right-angled corner has 0.71
LATERALS = 4  # directions across a place
SKIN_SHARE = 1e-7  # of the size of the solid: rays do not meet the triangle they start on
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


def sheets_of(middle: F64, normals: F64, reach: F64, thickness: F64, lean: float = 0.7) -> INT:
    """Number of the sheet of each thin place: near places with similar normals and thickness share it.

    middle    : (n, 3) float64, mm, any frame, halfway through the sheet
    normals   : (n, 3) float64, unit, same frame, of either side
    reach     : (n,) float64, mm, neighbours are no farther away
    thickness : (n,) float64, mm
    lean      : largest cosine between the normals and the line from one neighbour to the other

    Returns (n,) int64, index.
    """
    tree = cKDTree(middle)
    pairs = tree.query_pairs(float(reach.max()), output_type="ndarray") if len(middle) else np.zeros((0, 2), np.int64)
    a, b = pairs[:, 0], pairs[:, 1]
    apart = middle[b] - middle[a]
    size = np.maximum(np.linalg.norm(apart, axis=1), 1e-12)
    # across a gap between two walls the line from one to the other lies along the normals
    alike = np.abs((normals[a] * normals[b]).sum(axis=1)) > 0.5
    along = np.abs((apart * normals[a]).sum(axis=1)) < lean * size + 1e-3
    near = size <= np.minimum(reach[a], reach[b])
    equal = np.maximum(thickness[a], thickness[b]) < TIMES * np.minimum(thickness[a], thickness[b])
    chosen = alike & along & near & equal
    return _components(len(middle), a[chosen], b[chosen])


@dataclass(frozen=True, eq=False)
class _Others:
    """Places without one sheet, and whether each stands, (n,) bool, or is of a node with too few places to tell."""

    places: cKDTree
    stands: BOOL


@dataclass(frozen=True, eq=False)
class SheetPieces:
    """Sheets and pieces of a solid as places of its surface, and which of them are joined.

    points : (n, 3) float64, mm, places on the surface
    middle : (n, 3) float64, mm, halfway through the solid there; the place itself where it is not thin
    node   : (n,) int64, index, sheet or piece of each place; sheets come first
    sheets : number of sheets
    joints : (k, 2) int64, index, pairs of nodes that are joined
    low    : (m,) bool, nodes that have one of the lowest places of the solid
    spacing : mm, between places
    """

    points: F64
    middle: F64
    node: INT
    sheets: int
    joints: INT
    low: BOOL
    spacing: float

    @cached_property
    def _known(self) -> dict[int, _Others | None]:
        return {}

    @cached_property
    def _thin(self) -> INT:
        return np.flatnonzero(self.node < self.sheets)

    @cached_property
    def _middles(self) -> cKDTree:
        return cKDTree(self.middle[self._thin])

    def sheet_at(self, middle: F64) -> INT:
        """The sheet nearest to places.

        middle : (n, 3) float64, mm, frame of the mesh, halfway through the sheet

        Returns (n,) int64, index, -1 where there is no sheet.
        """
        if not len(self._thin):
            return np.full(len(middle), -1, np.int64)
        return np.asarray(self.node[self._thin[self._middles.query(middle)[1]]])

    def stand_without(self, places: F64, sheet: INT) -> BOOL:
        """Whether what lies at places stands without a sheet.

        places : (n, 3) float64, mm, frame of the mesh, on the surface; what lies there is the nearest other node
        sheet  : (n,) int64, index, -1 for none

        Returns (n,) bool, true for all places of a sheet that has all the lowest places, and where nothing that hangs
        on the sheet is sure to lie: it is farther away than neighbours are, or has fewer places than a place has
        neighbours. What a sheet meets gradually, as a bar behind a large fillet, may be counted as part of the sheet.
        """
        out = np.ones(len(places), np.bool_)
        for number in np.unique(sheet[sheet >= 0]).tolist():
            if number not in self._known:
                self._known[number] = self._without(number)
            others = self._known[number]
            if others is not None:
                rows = np.flatnonzero(sheet == number)
                off, near = others.places.query(places[rows])
                out[rows] = others.stands[near] | (off > REACH * self.spacing)
        return out

    def _without(self, sheet: int) -> _Others | None:
        """The places of other nodes than a sheet; None where all of these stand without it."""
        standing, size = self._standing(sheet)
        if standing[np.arange(len(standing)) != sheet].all():
            return None
        others = np.flatnonzero(self.node != sheet)
        return _Others(cKDTree(self.points[others]), (standing | (size < NEIGHBOURS))[self.node[others]])

    def _standing(self, sheet: int) -> tuple[BOOL, INT]:
        """Of the m nodes, which are joined with a lowest place without one sheet, and how many places are joined."""
        low = self.low.copy()
        low[sheet] = False
        kept = self.joints[(self.joints != sheet).all(axis=1)]
        group = _components(len(low), kept[:, 0], kept[:, 1])
        size = np.bincount(group, np.bincount(self.node, minlength=len(low)))[group].astype(np.int64)
        return (np.isin(group, np.unique(group[low])) if low.any() else np.ones(len(low), np.bool_)), size


def sheet_pieces(tree: TriangleTree, thickest: float, length: float) -> SheetPieces:
    """Sheets of a solid up to a thickness, and the pieces that they join.

    tree     : TriangleTree of a closed mesh, Z up
    thickest : mm, a sheet is thinner
    length   : mm, sheets of this width are told apart from what they join, where ``MOST`` places suffice
    """
    area = float(tree.mesh.areas.sum())
    count = float(np.clip(area * (A_LENGTH / length) ** 2, FEWEST, MOST))
    spacing = float(np.sqrt(area / count))
    samples = sample_surface(tree.mesh, count / area, seed=1)
    points, normals = samples.points, samples.normals
    thickness, middle, across = _thickness(tree, points, normals, thickest)
    thin = np.flatnonzero(np.isfinite(thickness))
    node = np.full(len(points), -1, np.int64)
    node[thin] = sheets_of(middle[thin], across[thin], np.full(len(thin), REACH * spacing), thickness[thin],
                           LEAN)
    sheets = int(node.max(initial=-1)) + 1
    a, b = _neighbours(points, normals, spacing)
    thick = np.flatnonzero(node < 0)
    both = (node[a] < 0) & (node[b] < 0)
    place = np.full(len(points), -1, np.int64)
    place[thick] = np.arange(len(thick))
    node[thick] = sheets + _components(len(thick), place[a[both]], place[b[both]])
    low = np.zeros(int(node.max(initial=-1)) + 1, np.bool_)
    first, second = np.minimum(node[a], node[b]), np.maximum(node[a], node[b])
    joints = np.column_stack(np.divmod(np.unique((first * len(low) + second)[first < second]), len(low)))
    floor = float(tree.mesh.bounds[0, 2])
    low[node[points[:, 2] <= max(floor, float(points[:, 2].min())) + 1e-3]] = True
    return SheetPieces(points, middle, node, sheets, joints, low, spacing)


def _components(count: int, a: INT, b: INT) -> INT:
    """(count,) number of the connected group of each, by pairs a and b (k,)."""
    graph = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _thickness(tree: TriangleTree, points: F64, normals: F64, thickest: float) -> tuple[F64, F64, F64]:
    """Thickness at places (n, 3), mm, inf from ``thickest`` on; the middle there, and the direction across.

    The inward ray gives it on the two sides of a sheet. On its edge faces, which look along it, chords give it half the
    thickness inwards.
    """
    skin = SKIN_SHARE * float(np.linalg.norm(tree.mesh.bounds[1] - tree.mesh.bounds[0]))
    far, hit = first_hits(tree, points, -normals, t_min=skin, t_max=thickest)
    facing = (tree.mesh.normals[np.maximum(hit, 0)] * normals).sum(axis=1) < FACING
    thickness = np.where((hit >= 0) & facing, far, np.inf)
    thin = np.isfinite(thickness)
    middle = points - np.where(thin, 0.5 * far, 0.0)[:, None] * normals
    across = normals.copy()
    rows = np.flatnonzero(~thin)
    inner = points[rows] - 0.25 * thickest * normals[rows]
    first = np.cross(normals[rows], np.eye(3)[np.argmin(np.abs(normals[rows]), axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(normals[rows], first)
    for angle in (np.arange(LATERALS) * np.pi / LATERALS).tolist():
        way = np.cos(angle) * first + np.sin(angle) * second
        plus, a = first_hits(tree, inner, way, t_max=thickest)
        minus, b = first_hits(tree, inner, -way, t_max=thickest)
        out, back = tree.mesh.normals[np.maximum(a, 0)], tree.mesh.normals[np.maximum(b, 0)]
        inside = ((a >= 0) & (b >= 0) & ((out * way).sum(axis=1) > 0.0) & ((back * way).sum(axis=1) < 0.0)
                  & ((out * back).sum(axis=1) < FACING))
        chord = np.where(inside, plus + minus, np.inf)
        better = (chord < thickest) & (chord < thickness[rows])
        at = rows[better]
        thickness[at], across[at] = chord[better], way[better]
        middle[at] = inner[better] + (0.5 * (plus[better] - minus[better]))[:, None] * way[better]
    return thickness, middle, across


def _neighbours(points: F64, normals: F64, spacing: float) -> tuple[INT, INT]:
    """Pairs of near places (k,), (k,) with solid or surface between them, and not air alone."""
    count = min(NEIGHBOURS + 1, len(points))
    apart, near = cKDTree(points).query(points, k=count, distance_upper_bound=FAR * spacing)
    a, b = np.repeat(np.arange(len(points)), count), near.reshape(-1).astype(np.int64)
    size = apart.reshape(-1)
    found = np.isfinite(size) & (a != b)
    a, b, size = a[found], b[found], np.maximum(size[found], 1e-12)
    way = (points[b] - points[a]) / size[:, None]
    air = ((normals[a] * way).sum(axis=1) > THROUGH_AIR) & ((normals[b] * way).sum(axis=1) < -THROUGH_AIR)
    return a[~air], b[~air]


__all__ = ["FACING", "SheetPieces", "sheet_pieces", "sheets_of"]
