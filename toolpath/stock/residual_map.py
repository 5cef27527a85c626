"""Residual material that passes leave at samples of a zone, so that the planner can add passes.

Upright tools are measured by ``kernels.residual``, which knows level planes and walls and stops at cut material. Tilted
ones are measured by ``kernels.leaning``: the plain signed distance to the cutting part, so that a gouge has its depth.
Arrays are float64. Places are in mm, normals and axes dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.binning import by_cell, limits_of
from geometry.errors import GeometryError
from geometry.kernels.cutter_sizes import CutterSizes
from geometry.mesh import F64
from geometry.mesh_queries.drop import one_thread
from geometry.tool_body import ToolBody
from toolpath.kernels.leaning import lower_leaning
from toolpath.kernels.residual import LEVEL_PLANE, UPRIGHT, PlaceSquares, SampleCells, lower, lower_parallel
from toolpath.stock.cut_history import PER_MM

CELL = 0.6  # mm
MIN_MARGIN = 0.02  # mm
UNTOUCHED = 1e3  # mm, residual of a sample that no pass came near
UNIT = 1e-6  # error of the length of an axis


class ResidualMap:
    """Residual material at samples, lowered pass by pass.

    points   : (n, 3) float64, mm, access frame
    normals  : (n, 3) float64, unit, access frame
    margin   : mm, a cutter farther away does not count
    covers   : (n,) float64, mm: radius of the flat place that a sample of a level or upright plane stands for, 0 for
               its point alone; None: 0 for all
    residual : (n,) float64, mm, distance to the nearest swept cutting part so far; below 0 where one entered. For a
               flat place, that of its farthest point from the one move that comes nearest.
    """

    def __init__(self, points: F64, normals: F64, cell: float = CELL, margin: float = MIN_MARGIN,
                 covers: F64 | None = None) -> None:
        self.points = np.ascontiguousarray(points)
        self.residual = np.full(len(points), UNTOUCHED)
        self.margin = max(margin, MIN_MARGIN)
        self._cells = _binned(points, cell)
        # in the order of the cells: a pass looks at the samples of a cell together
        order = self._cells.items
        upright = np.abs(normals[:, 2]) < 0.5
        level = np.where(normals[:, 2] > 1.0 - 1e-6, LEVEL_PLANE, np.where(upright, UPRIGHT, 0)).astype(np.int8)
        self._by_cell, self._level = self.points[order], level[order]
        self._squares = _squares(normals[order], self._level, None if covers is None else covers[order])
        self._widest = float(self._squares.half.max(initial=0.0))

    def copied(self) -> ResidualMap:
        """A copy with a residual of its own."""
        out = copy.copy(self)
        out.residual = self.residual.copy()
        return out

    def cut(self, path: F64, tool: ToolBody, above: float = math.inf) -> None:
        """Lower the residual by one polyline of tips, with heights as a program rounds them.

        path  : (m, 3) float64, mm, access frame
        above : mm; what the side of the tool leaves on samples farther above each move need not be measured

        A flat end that only just comes down to a place at the top of a wall passes over it where rounding lifts it.
        """
        self.cut_all([path], tool, above)

    def cut_all(self, paths: Sequence[F64], tool: ToolBody, above: float = math.inf) -> None:
        """Lower the residual by polylines of tips, one after the other, as ``cut`` does.

        paths : each (m, 3) float64, mm, access frame
        above : as in ``cut``
        """
        paths = [p for p in paths if len(p)]
        if not paths:
            return
        path = np.vstack(paths)
        path[:, 2] = np.rint(path[:, 2] * PER_MM) / PER_MM
        starts = np.cumsum([0, *map(len, paths)])
        cells, sizes = self._cells, _sizes(tool)
        sizes = sizes._replace(length=min(sizes.length, above + self._widest))
        steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
        steps[starts[1:-1] - 1] = 0.0
        area = cells.ncx * cells.ncy * cells.size**2
        share = min(1.0, float(2.0 * steps.sum() * (tool.radius + self.margin)) / area)
        call = lower if one_thread(int(share * len(self.points))) else lower_parallel
        call(self._by_cell, self._level, self._squares, cells, path, starts, sizes, self.margin, self.residual)

    def cut_leaning(self, tips: F64, axes: F64, tool: ToolBody) -> None:
        """Lower the residual by poses of a tilted tool: to the least signed distance, below 0 where it gouges.

        tips, axes : (m, 3) float64, mm and unit, tip to spindle, access frame, as for ``leaning_depths``

        Samples farther than ``margin`` from the tool keep their residual, and so do those that would be lowered by no
        more than 1e-6 mm. Level planes do not count: a tilted end has no plane of its own.

        Raises
        ------
        GeometryError
            Code 'bad_axis', as ``leaning_depths``.
        """
        tips, axes = _poses(tips, axes)
        lower_leaning(self.points, self._cells, tips, axes, _sizes(tool), self.margin, self.residual)


def leaning_depths(points: F64, tips: F64, axes: F64, tool: ToolBody, margin: float) -> F64:
    """Least signed distance from points to the cutting part of a tool over all poses of a pass.

    points     : (n, 3) float64, mm, access frame
    tips, axes : (m, 3) float64, mm and unit, access frame, tip to spindle; neighbouring axes less than a right angle
                 apart; a single pose is a tool that stands still
    tool       : its cutting part counts: nose, and cylinder up to the end of the flutes, where a disc closes it
    margin     : mm

    Returns (n,) float64, mm: below 0 by the depth of a point under the surface of the cutting part, the disc at the end
    of the flutes included; UNTOUCHED beyond ``margin``.

    Raises
    ------
    GeometryError
        Code 'bad_axis': an axis is not unit, or a right angle or more from the one before.

    Notes
    -----
    From pose to pose the tip goes straight and the axis turns on the great circle at an even rate, by sine and cosine,
    without an error [Shoemake1985]. (Chords of the turn made unit lag and lead by 0.016 theta^3 rad, 0.3 um at the end
    of a 20 mm tool that turns 0.1 rad.) A result is never too low and at most 1e-6 mm too high, by the bound in
    ``kernels.leaning``.
    """
    points = np.ascontiguousarray(points, float)
    tips, axes = _poses(tips, axes)
    least = np.full(len(points), UNTOUCHED)
    lower_leaning(points, _binned(points, CELL), tips, axes, _sizes(tool), float(margin), least)
    return least


def _poses(tips: F64, axes: F64) -> tuple[F64, F64]:
    """Tips and axes as the kernel takes them, a single one as a move that goes nowhere."""
    tips, axes = np.ascontiguousarray(tips, float), np.ascontiguousarray(axes, float)
    size = np.linalg.norm(axes, axis=1)
    bad = ~(np.abs(size - 1.0) <= UNIT)
    bad[1:] |= (axes[1:] * axes[:-1]).sum(axis=1) <= 0.0
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        at = "({})".format(", ".join(f"{x:.3f}" for x in tips[k]))
        raise GeometryError(f"the tool axis at {at} is not a unit vector, or turns 90 degrees or more in one move",
                            code="bad_axis", subjects=(at,), measured=None, limit=None,
                            remedy="give axes of length 1 and poses close enough that axes turn less")
    axes = axes / size[:, None]
    return (np.repeat(tips, 2, axis=0), np.repeat(axes, 2, axis=0)) if len(tips) == 1 else (tips, axes)


def _sizes(tool: ToolBody) -> CutterSizes:
    if (arcs := tool.arcs) is not None:
        return CutterSizes(tool.radius, tool.radius - arcs.flat, tool.flute_length, arcs.high, arcs.low, 0.0, arcs.out,
                           arcs.up, arcs.bow)
    if tool.taper > 0.0:
        wide = tool.widest_radius
        return CutterSizes(wide, wide - tool.radius + tool.corner_radius, tool.flute_length, tool.flute_length,
                           tool.corner_radius, tool.taper)
    return CutterSizes(tool.radius, tool.corner_radius, tool.flute_length)


def _squares(normals: F64, level: NDArray[np.int8], covers: F64 | None) -> PlaceSquares:
    """The squares that hold the places of samples; tilted faces have none."""
    half = np.zeros(len(normals)) if covers is None else np.where(level != 0, covers, 0.0)
    upright = (level == UPRIGHT) & (half > 0.0)
    x, y = np.where(upright, -normals[:, 1], 0.0), np.where(upright, normals[:, 0], 0.0)
    return PlaceSquares(half, x, y)


def _binned(points: F64, cell: float) -> SampleCells:
    """Points (n, 3), mm, in square cells in plan."""
    lo, hi = limits_of(points[:, :2]) if len(points) else (np.zeros(2), np.zeros(2))
    ncx, ncy = (np.floor((hi - lo) / cell).astype(int) + 1).tolist()
    key = np.zeros(0, np.int64)
    if len(points):
        c = np.floor((points[:, :2] - lo) / cell).astype(np.int64)
        key = c[:, 1] * ncx + c[:, 0]
    items, starts = by_cell(key, ncx * ncy)
    low, high = np.full(ncx * ncy, np.inf), np.full(ncx * ncy, -np.inf)
    full = np.flatnonzero(np.diff(starts))
    if len(full):
        z = points[items, 2]
        low[full], high[full] = np.minimum.reduceat(z, starts[full]), np.maximum.reduceat(z, starts[full])
    return SampleCells(starts, items, float(lo[0]), float(lo[1]), cell, ncx, ncy, low, high)
