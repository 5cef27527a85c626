"""Parallel passes dragged over shallow area, to and fro."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from toolpath.kernels.follow import follow
from toolpath.levels import Line, dense, dilated, pieces_where, thinned, true_runs
from toolpath.stock import StockMap
from zones.reach import TipField

SMALLEST = 0.004  # mm: a tip path that still rises steeper than STEEPEST over this is broken
STEEPEST = 4.0
SIDE_STEP_FLOOR = 0.02


def side_step(corner_radius: float, normals: F64, cusp: float) -> float:
    """Distance between parallel passes in plan that leaves a given cusp.

    corner_radius : mm; normals : (n, 3) float64 of the area; cusp : mm, along the normal
    Returns mm: sqrt(8 h r) along the surface, times the cosine of the steepest slope across (95 % quantile).
    Second order in h/r; tighter convex places are found by measuring.
    """
    if not len(normals):
        return math.sqrt(8.0 * cusp * corner_radius)
    cosine = float(np.quantile(normals[:, 2], 0.05))
    return max(SIDE_STEP_FLOOR, math.sqrt(8.0 * cusp * corner_radius) * max(cosine, 0.2))


def along_x(mask: NDArray[np.bool_]) -> bool:
    """Whether passes along x are fewer than passes along y over a mask (ny, nx)."""
    rows = np.count_nonzero(np.diff(mask.astype(np.int8), axis=1) == 1)
    cols = np.count_nonzero(np.diff(mask.astype(np.int8), axis=0) == 1)
    return bool(rows <= cols)


def passes(field: TipField, tips: F64, step: float, shift: float, tolerance: float, x_first: bool,
           overrun: float) -> list[Line]:
    """Parallel passes over the places where the tool touches an area.

    field     : TipField
    tips      : (n, 3) float64, mm, tips that touch the samples of the area
    step      : mm between passes in plan
    shift     : passes lie at (k + shift) * step, so that two sets interleave
    tolerance : mm, chordal
    x_first   : passes run along x, else along y
    overrun   : mm the passes run past the area

    Returns
    -------
    list of Line
        In order across, every second one reversed.
    """
    lat = field.lattice
    if not len(tips):
        return []
    mask = dilated(lat.mask(tips[:, :2]), max(1.5, overrun / lat.step))
    across = 1 if x_first else 0
    where = (field.tree.arrays, field.noncut, field.coarse_row)
    shape = (field.grown_radius, field.grown_corner, field.allowance)
    origin, count = (lat.y0, lat.ny) if x_first else (lat.x0, lat.nx)
    lo, hi = tips[:, across].min() - overrun, tips[:, across].max() + overrun
    out: list[Line] = []
    flip = False
    for k in range(math.floor(lo / step - shift), math.ceil(hi / step - shift) + 1):
        at = (k + shift) * step
        row = round((at - origin) / lat.step)
        if not 0 <= row < count:
            continue
        cells = mask[row, :] if x_first else mask[:, row]
        found: list[Line] = []
        for a, b in _joined(true_runs(cells), field.tool.radius / lat.step):
            p = (lat.x0 + lat.step * a, at) if x_first else (at, lat.y0 + lat.step * a)
            q = (lat.x0 + lat.step * (b - 1), at) if x_first else (at, lat.y0 + lat.step * (b - 1))
            points, broken = follow(*where, *p, *q, *shape, min(lat.step, 0.15), 0.5 * tolerance, SMALLEST, STEEPEST)
            for i, j in true_runs(~broken[:-1]):
                found.append(Line(thinned(points[i:j + 1], 0.5 * tolerance), False))
        out.extend([line.reversed() for line in reversed(found)] if flip else found)
        flip ^= bool(found)
    return out


def _joined(runs: list[tuple[int, int]], gap: float) -> list[tuple[int, int]]:
    out: list[tuple[int, int]] = []
    for a, b in runs:
        if out and a - out[-1][1] < gap:
            out[-1] = (out[-1][0], b)
        else:
            out.append((a, b))
    return out


def skimmed(line: Line, stock: StockMap, tool: ToolBody, skin: float, slope: float) -> list[Line]:
    """A pass, and before it the same pass lifted where going downhill would take more than a skin off at once.

    A descent is worked off only by going sideways: over a piece of length s each layer after the first adds what
    ``slope`` times s allows. So a place where stock stands h above the pass is taken in n equal layers, n the least
    with h / n <= skin and h - (n - 1) slope s <= skin; short pieces get many thin ones.

    line  : Line; level ones are returned alone
    stock : StockMap as it stands
    skin  : mm, the most that is taken off in a descent
    slope : mm per mm, of the ramp down which the tool may go for any length

    Returns
    -------
    list of Line
        The layers of each piece from the top down; the pass itself is last.
    """
    rise = np.ptp(line.points[:, 2])
    if rise < 1e-6:
        return [line]
    points = dense(line.points, 0.3 * tool.radius)
    deep = _steep_stock(points, stock, tool)
    out: list[Line] = []
    for piece in pieces_where(Line(points, False), deep > skin, tool.radius, 4.0 * tool.radius):
        over = float(_steep_stock(dense(piece.points, 0.3 * tool.radius), stock, tool).max())
        run = float(np.linalg.norm(np.diff(piece.points[:, :2], axis=0), axis=1).sum())
        layers = max(math.ceil(over / skin), 1 + math.ceil(max(over - skin, 0.0) / max(slope * run, 1e-3)))
        out.extend(Line(piece.points + np.array([0.0, 0.0, k * over / layers]), False)
                   for k in range(layers - 1, 0, -1))
    return [*out, line]


def _steep_stock(points: F64, stock: StockMap, tool: ToolBody) -> F64:
    """(n,) float64, mm: how far stock stands above the cutter where the pass goes up or down; 0 elsewhere."""
    over = stock.overlap(points, tool, -0.3)
    if tool.corner_radius == 0.0:  # the edge of a flat cuts going down, and a short move takes no more than a rim
        over = np.maximum(over, stock.standing(points, tool))
    return np.where(np.isfinite(over) & _descends(points), over, 0.0)


def _descends(points: F64) -> NDArray[np.bool_]:
    """(n,) bool: one of the moves at a point is steeper than 3 degrees, either way."""
    move = np.diff(points, axis=0)
    steep = np.abs(move[:, 2]) > 0.05 * np.hypot(move[:, 0], move[:, 1])
    return np.concatenate([steep, [False]]) | np.concatenate([[False], steep])
