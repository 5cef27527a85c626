"""What a set of passes leaves standing at surface samples: the planner's own measure.

For a tip at c the cutter (corner r, radius R, endless upwards) is as far from a point p as
    sqrt(u^2 + w^2) - r,   u = max(rho - (R - r), 0),  w = max(c_z + r - p_z, 0),
rho the distance of p from the axis in plan. The least over all tips of the passes is what remains at p to within
the cosine of the angle between the sample normal and the direction of contact (under 1 % at a cusp). The side of a
tapered mill leans: above the end of its corner the distance to that line counts. A circle segment mill has
two arcs, and the distance is that to the nearer of them. On a level
plane, where a sharp-cornered end passes beside p or over it, the height above p is taken instead,
and a wall below such an end counts as untouched. Along a
straight move the least lies at the nearest point in plan, at the nearest point in space to the corner's centre,
or at an end; all are tried.

A sample that stands for a flat place round it is as far from a move as the farthest corner of the square that holds the
place: what a move sweeps is convex, so the whole place is no farther.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from geometry.kernels.cutter_sizes import CutterSizes

FAR = 1e3
BANDS = 16  # of the rows of cells, shared among the threads
SECTIONS = 24  # of a move, to 1e-5 of its length
BELOW = 1e-6  # mm that a sharp-cornered end may stand over a place of a wall, whose tip a program has rounded
LEVEL_PLANE, UPRIGHT = 1, 2


class SampleCells(NamedTuple):
    """Samples by square cells in plan; cell (i, j) is row i ncx + j, access frame.

    start    : (ncx ncy + 1,) int64, index, first of each cell's samples in ``items``
    items    : (n,) int64, index, numbers of the samples
    x0, y0   : float, mm, lower corner of cell (0, 0)
    size     : float, mm, side of a cell
    ncx, ncy : int, count of cells along x and y
    low, high : (ncx ncy,) float64, mm, lowest and highest sample of each cell; inf and -inf where it has none
    """

    start: NDArray[np.int64]
    items: NDArray[np.int64]
    x0: float
    y0: float
    size: float
    ncx: int
    ncy: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]


class MillEnd(NamedTuple):
    """The end of a mill, frame of the tool.

    flat, corner : float, mm, radius of the flat bottom and corner radius
    sine, cosine : float, of the angle between the side and the axis; 0 and 1 for an upright side
    out, up, bow : float, mm, centre (distance from the axis, height) and radius of the upper arc of a circle segment
                   mill, whose lower arc is the corner; ``up`` is 0 for others, and ``cosine`` then counts
    radius, high : float, mm, where the upper arc ends
    """

    flat: float
    corner: float
    sine: float
    cosine: float
    out: float
    up: float
    bow: float
    radius: float
    high: float


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _end_of(cutter: CutterSizes):
    flat = cutter.radius - cutter.corner
    if cutter.taper > 0.0:
        cosine = 1.0 / np.sqrt(1.0 + cutter.taper * cutter.taper)
        return MillEnd(flat, cutter.round, cutter.taper * cosine, cosine, 0.0, 0.0, 0.0, cutter.radius, 0.0)
    if cutter.up > 0.0:
        return MillEnd(flat, cutter.round, 1.0, 0.0, cutter.out, cutter.up, cutter.bow, cutter.radius, cutter.cone)
    return MillEnd(flat, cutter.corner, 0.0, 1.0, 0.0, 0.0, 0.0, cutter.radius, 0.0)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _arcs_gap(rho, h, end: MillEnd, level):
    """Distance from a place beside the axis to a circle segment mill; on a level plane that along the axis.

    Places nearest to an arc are on the side of the join where that is, seen from its centre.
    """
    far = end.bow - end.corner
    sine, cosine = (end.flat - end.out) / far, (end.up - end.corner) / far
    x, y = rho - end.flat, end.corner - h
    if level == LEVEL_PLANE:
        if rho > end.radius:
            return FAR
        if x <= 0.0:
            return -h
        if x > end.corner * sine:
            x = rho - end.out
            return end.up - np.sqrt(max(end.bow * end.bow - x * x, 0.0)) - h
        return end.corner - np.sqrt(max(end.corner * end.corner - x * x, 0.0)) - h
    if x <= 0.0:
        return -h if h < 0.0 else max(-h, rho - end.radius)
    if x * cosine <= y * sine:
        return np.sqrt(x * x + y * y) - end.corner
    # beyond the end of the upper arc the side counts, and under it the rim where that leans
    x, y = rho - end.out, end.up - h
    if (y >= 0.0) if end.bow <= 0.0 else x * (end.up - end.high) <= y * (end.radius - end.out):
        return np.sqrt(x * x + y * y) - end.bow
    return rho - end.radius if h >= end.high else np.sqrt((rho - end.radius) ** 2 + (h - end.high) ** 2)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _arcs_move(p, a, d, end: MillEnd, level):
    """``_arcs_gap`` where it is least on a move from a by d: it is convex along the move."""
    lo, hi, best = 0.0, 1.0, FAR
    for _ in range(SECTIONS):
        for side in range(2):
            s = lo + (hi - lo) * (0.381966 if side == 0 else 0.618034)
            x, y = p[0] - a[0] - s * d[0], p[1] - a[1] - s * d[1]
            gap = _arcs_gap(np.sqrt(x * x + y * y), p[2] - a[2] - s * d[2], end, level)
            best = min(best, gap)
            if side == 0:
                left = gap
        if left <= gap:
            hi = lo + (hi - lo) * 0.618034
        else:
            lo = lo + (hi - lo) * 0.381966
    return best


@njit(cache=True, nogil=True, no_cfunc_wrapper=True, inline="always")
def _gap(px, py, pz, cx, cy, cz, end: MillEnd, level):
    corner, out = end.corner, np.sqrt((px - cx) ** 2 + (py - cy) ** 2) - end.flat
    if end.up > 0.0:
        return _arcs_gap(out + end.flat, pz - cz, end, level)
    if level == LEVEL_PLANE:
        if out > corner:
            return FAR
        return cz - pz + (corner - np.sqrt(corner * corner - out * out) if out > 0.0 else 0.0)
    w = cz + corner - pz
    if end.sine > 0.0:
        x, y = out - corner * end.cosine, -w + corner * end.sine
        if x * end.sine + y * end.cosine > 0.0:
            return x * end.cosine - y * end.sine
    u, w = max(out, 0.0), max(w, 0.0)
    if level == UPRIGHT and corner == 0.0 and w > BELOW:
        return FAR
    return np.sqrt(u * u + w * w) - corner


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _segment_gap(p, a, b, end: MillEnd, level):
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    best = min(_gap(p[0], p[1], p[2], a[0], a[1], a[2], end, level),
               _gap(p[0], p[1], p[2], b[0], b[1], b[2], end, level))
    d2 = dx * dx + dy * dy
    if d2 > 0.0:
        s = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / d2
        if 0.0 < s < 1.0:
            best = min(best, _gap(p[0], p[1], p[2], a[0] + s * dx, a[1] + s * dy, a[2] + s * dz, end, level))
    d3 = d2 + dz * dz
    if d3 > 0.0 and dz != 0.0 and end.up > 0.0:
        best = min(best, _arcs_move(p, a, (dx, dy, dz), end, level))
    elif d3 > 0.0 and dz != 0.0:
        s = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy + (p[2] - a[2] - end.corner) * dz) / d3
        if 0.0 < s < 1.0:
            best = min(best, _gap(p[0], p[1], p[2], a[0] + s * dx, a[1] + s * dy, a[2] + s * dz, end, level))
    return best


class PlaceSquares(NamedTuple):
    """Squares round samples, access frame: in the level plane, or upright.

    half : (n,) float64, mm, half a side; 0 where a sample stands for its point alone
    x, y : (n,) float64, unit, level direction of the sides of an upright square; both 0 for a level one
    """

    half: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _farthest_corner(p, squares: PlaceSquares, s, a, b, end: MillEnd, level, z_hi, enough):
    """Distance of the farthest corner of square s round p from a move; any value above ``enough`` where it is more."""
    half, worst = squares.half[s], -FAR
    corner_of = np.empty(3)
    for k in range(4):
        e, f = half if k < 2 else -half, half if k % 2 else -half
        if level == LEVEL_PLANE:
            corner_of[0], corner_of[1], corner_of[2] = p[0] + e, p[1] + f, p[2]
        else:
            corner_of[0], corner_of[1], corner_of[2] = p[0] + e * squares.x[s], p[1] + e * squares.y[s], p[2] + f
        if corner_of[2] > z_hi:
            return FAR
        worst = max(worst, _segment_gap(corner_of, a, b, end, level))
        if worst > enough:
            return worst
    return worst


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def lower(points, level, squares: PlaceSquares, cells: SampleCells, path, starts, cutter: CutterSizes, margin,
          residual):
    """Lower residual (n,) by polylines of tips, path[starts[k]:starts[k + 1]]; samples are in square cells in plan.

    points (n, 3), level (n,) and squares are in the order of ``cells.items``, residual in that of the samples. level: 1
    on a level plane, 2 on a wall, else 0; margin: mm beyond the cutter within which it is measured.
    """
    _lower_rows(points, level, squares, cells, path, starts, cutter, margin, 0, cells.ncy, residual)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True, parallel=True)
def lower_parallel(points, level, squares: PlaceSquares, cells: SampleCells, path, starts, cutter: CutterSizes, margin,
                   residual):
    """``lower`` on the threads numba has, each over bands of rows of cells; the same bytes on any number of them."""
    for band in prange(BANDS):
        _lower_rows(points, level, squares, cells, path, starts, cutter, margin, cells.ncy * band // BANDS,
                    cells.ncy * (band + 1) // BANDS, residual)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lower_rows(points, level, squares: PlaceSquares, cells: SampleCells, path, starts, cutter: CutterSizes, margin,
                first, end, residual):
    """``lower`` for the samples in the rows of cells from ``first`` to before ``end``."""
    cell_start, cell_items, gx, gy, cell, ncx = cells.start, cells.items, cells.x0, cells.y0, cells.size, cells.ncx
    radius, flute, end_shape = cutter.radius, cutter.length, _end_of(cutter)
    corner = end_shape.corner
    r, line = radius + margin, 1
    for k in range(len(path) - 1):
        if k + 1 == starts[line]:
            line += 1  # from one polyline to the next
            continue
        a, b = path[k], path[k + 1]
        dx, dy = b[0] - a[0], b[1] - a[1]
        d2 = dx * dx + dy * dy
        j0 = max(int((min(a[0], b[0]) - r - gx) / cell), 0)
        j1 = min(int((max(a[0], b[0]) + r - gx) / cell), ncx - 1)
        i0 = max(int((min(a[1], b[1]) - r - gy) / cell), first)
        i1 = min(int((max(a[1], b[1]) + r - gy) / cell), end - 1)
        z_lo, z_hi = min(a[2], b[2]) - margin, max(a[2], b[2]) + flute
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                c = i * ncx + j
                if cells.high[c] < z_lo or cells.low[c] > z_hi:
                    continue
                for q in range(cell_start[c], cell_start[c + 1]):
                    z = points[q, 2]
                    if z < z_lo or z > z_hi:
                        continue
                    s = cell_items[q]
                    left, kind = residual[s], level[q]
                    low = min(a[2], b[2]) - z
                    if left <= 0.0 or kind == LEVEL_PLANE and low >= left:
                        continue
                    if kind == UPRIGHT and corner == 0.0 and low > BELOW:
                        continue
                    # in plan no point of the cutter is nearer than that: most samples were cut as far before
                    ex, ey = points[q, 0] - a[0], points[q, 1] - a[1]
                    f = min(max((ex * dx + ey * dy) / d2, 0.0), 1.0) if d2 > 0.0 else 0.0
                    ex, ey = ex - f * dx, ey - f * dy
                    near = radius if kind == LEVEL_PLANE else radius + left
                    if ex * ex + ey * ey > near * near:
                        continue
                    d = _segment_gap(points[q], a, b, end_shape, kind)
                    if d < left and squares.half[q] > 0.0:
                        d = max(d, _farthest_corner(points[q], squares, q, a, b, end_shape, kind, z_hi, left))
                    if d < left:
                        residual[s] = d
