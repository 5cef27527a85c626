"""The plan view cut into cells, each with the names of the areas over it.

The borders of the areas, and lines that cut without enclosing anything, go into one trapezoidal map
(``zones.plan_view.trapezoidal_map``). Its faces are the cells, and each cell has the names of the areas that cover it.
A look-up descends the search DAG of the map, so it costs O(log n) in the number of segments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from geometry.mesh import F64
from zones.plan_view.trapezoidal_map import Faces, TrapezoidMap

OUTSIDE = -1  # cell of a place outside the box of the map


@dataclass(frozen=True)
class PlanArea:
    """A named area in plan that covers some cells.

    name  : 'H1', 'W1', 'C2' ...
    shape : shapely Polygon or MultiPolygon, mm
    """

    name: str
    shape: shapely.Geometry


@dataclass(frozen=True, eq=False)
class PlanMap:
    """Cells of the plan view; all lengths mm in the frame of the areas.

    map   : TrapezoidMap of all borders and lines
    faces : its faces, which are the cells
    names : names of the areas, in the order they were given
    over  : (cells, areas) bool, which area covers which cell
    """

    map: TrapezoidMap
    faces: Faces
    names: tuple[str, ...]
    over: NDArray[np.bool_]

    @staticmethod
    def of(areas: Sequence[PlanArea], lines: Sequence[F64] = (), grid: float = 1e-3, seed: int = 0) -> PlanMap:
        """Map of areas, and of lines that cut cells in two without naming either side [DeBerg2008, chapter 6].

        areas : PlanArea, mm
        lines : polylines (k, 2) float64, mm, in plan
        grid  : mm, grid step of the borders; thinner areas may vanish
        seed  : of the random order of insertion; changes the time, never the cells
        """
        borders = [np.asarray(ring.coords) for a in areas for ring in _rings(a.shape)]
        pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in (*borders, *lines) if len(line) > 1]
        segments = np.concatenate(pieces) if pieces else np.zeros((0, 2, 2))
        made = TrapezoidMap.of(segments, grid, seed)
        faces = made.faces()
        inside = _inner_points(made, faces)
        over = np.zeros((len(inside), len(areas)), np.bool_)
        for k, a in enumerate(areas):
            over[:, k] = shapely.contains_xy(a.shape, inside[:, 0], inside[:, 1])
        return PlanMap(made, faces, tuple(a.name for a in areas), over)

    @staticmethod
    def of_cover(name: str, border: F64, grid: float = 1e-3, seed: int = 0) -> PlanMap:
        """Map of one area with the largest possible cells.

        border : (k, 2, 2) float64, mm, in plan, directed borders that form closed lines
                 (``zones.plan_view.plan_cover``); the area is where they wind counter-clockwise
        """
        made = TrapezoidMap.of(border, grid, seed)
        faces = made.faces()
        inside = np.append(made.windings(faces) > 0, False)  # the last entry stands for places outside the box
        cells = faces.merged(inside[faces.above] == inside[faces.below])
        over = np.zeros((len(cells.doubled), 1), np.bool_)
        over[cells.of_trapezoid, 0] = inside[faces.of_trapezoid]
        return PlanMap(made, cells, (name,), over)

    def shape(self, name: str) -> shapely.Geometry:
        """Shape of an area, from its cells, mm."""
        cells = np.flatnonzero(self.over[:, self.names.index(name)])
        return shapely.union_all([self.map.outline(self.faces, k) for k in cells.tolist()])

    def cell_at(self, xy: ArrayLike) -> NDArray[np.int64]:
        """(n,) int64, index of the cell at each place, ``OUTSIDE`` beyond the box. xy : (n, 2) float64, mm, in plan."""
        at = self.map.locate(xy)
        return np.where(at >= 0, self.faces.of_trapezoid[at], OUTSIDE)

    def over_at(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """(n, areas) bool: areas that cover each place. xy : (n, 2) float64, mm, in plan."""
        cell = self.cell_at(xy)
        return np.where((cell >= 0)[:, None], self.over[cell], False)


def _rings(shape: shapely.Geometry) -> list[shapely.LinearRing]:
    polygons = shapely.get_parts(shape)
    return [ring for p in polygons if p.geom_type == "Polygon" and not p.is_empty
            for ring in (p.exterior, *p.interiors)]


def _inner_points(made: TrapezoidMap, faces: Faces) -> F64:
    """(faces, 2) float64, mm: the middle of the largest trapezoid of each face."""
    c = made.corners()
    area = 0.5 * (c[:, 1, 0] - c[:, 0, 0]) * ((c[:, 3, 1] - c[:, 0, 1]) + (c[:, 2, 1] - c[:, 1, 1]))
    order = np.lexsort((-area, faces.of_trapezoid))
    _, first = np.unique(faces.of_trapezoid[order], return_index=True)
    return np.asarray(c[order[first]].mean(axis=1))
