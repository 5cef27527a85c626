"""Level planes: an end mill with a flat bottom follows the walls at the height of the plane, then rings inside.

All moves are level. Places that the lines of the planning lattice miss are treated again in small windows on finer
lattices: corners of the free region between two walls narrower than a cell, and islands where rings turn sharply.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64
from toolpath.lines import Line, thinned
from toolpath.passes.contours import contour_pieces, dilated, free_pieces, lines_at
from zones.lattice import blocked_beside
from zones.reach.tip_field import INSIDE, LEVEL_TOLERANCE, TipField

SAME_PLANE = 5e-4  # mm
EXACT = INSIDE / 3.0  # mm: contour, thinning, and where a crossing is placed: together they stay within INSIDE
ROUND = 0.25  # of the flat radius over which rings are rounded, which takes the steps of the lattice out of them
SPOT = 0.25  # of the flat radius: a smaller ring is a straight line
THIN = 0.02  # lattice steps that thinned lines keep
FINER = 4  # ratio of the lattice of one round to that of the next
NEAR = 2.0  # steps of the planning lattice round the residual that get lines, at least
COVERED = 0.95  # of the flat radius: a place that reaches farther inside a ring needs another one
MAX_FINER = 2  # rounds on finer lattices
MAX_NODES = 250_000  # of a window, where its lattice is finer than that of the planner


def plane_heights(tips: F64) -> list[float]:
    """Heights at which level area is touched, mm, descending; tips less than ``SAME_PLANE`` mm apart are one.

    tips : (n, 3) float64, mm, access frame
    """
    z = np.sort(tips[:, 2])[::-1]
    cuts = np.flatnonzero(np.diff(z) < -SAME_PLANE) + 1
    return [float(np.median(group)) for group in np.split(z, cuts) if len(group)]


def planes(field: TipField, tips: F64, tolerance: float, finer: int = 0,
           covers: F64 | None = None) -> list[list[Line]]:
    """Passes over level area, plane by plane from the top.

    field     : TipField of a tool whose bottom is flat out to R - r
    tips      : (n, 3) float64, mm, access frame, tips that touch the samples
    tolerance : mm, of the lines along walls; never more than ``EXACT``
    finer     : 0 for lines over all the area; k for lines near the residual, on lattices ``FINER``**k finer
    covers    : (n,) float64, mm: radius of the flat place round each sample that has to be covered; None: 0 for all

    Returns
    -------
    list of lists of Line, one list a plane
        Rings at most 0.8 of the flat diameter apart, half that with every k, one more where the innermost leaves its
        middle uncovered, and the line that touches obstacles beside the plane.
    """
    tool, step = field.tool, field.lattice.step
    out = []
    for z in plane_heights(tips):
        here = np.abs(tips[:, 2] - z) < 2.0 * SAME_PLANE
        mine, place = tips[here], 0.0 if covers is None else float(covers[here].max())
        if finer:
            near = max(NEAR * step, step + place)
            parts = [_plane(w, z, t, min(tolerance, EXACT), 2.0**-finer, near, near, place)
                     for w, t in _windows(field, mine, finer, 1.5 * near)]
            out.append([line for lines in parts for line in lines])
        else:
            near = max(1.5 * step, 0.2 * tool.radius)
            out.append(_plane(field, z, mine, min(tolerance, EXACT), 1.0, near, 2.0 * tool.radius, place))
    return out


def _plane(field: TipField, z: float, tips: F64, tolerance: float, share: float, near: float,
           join: float, place: float) -> list[Line]:
    """Rings ``share`` times as far apart as usual over the tips at z, and contours within ``near`` mm of them.

    place : mm, radius of the widest flat place that one move has to cover whole
    """
    lat, tool = field.lattice, field.tool
    flat = tool.flat_radius
    mask = dilated(lat.mask(tips[:, :2]), near / lat.step)
    free = field.height <= z + LEVEL_TOLERANCE
    lines = _rings(field, z, mask & free, 0.2 * flat, 1.6 * flat * share, COVERED * flat - place)
    return lines + contour_pieces(field, z, dilated(mask, join / lat.step), mask, near, join, tolerance)


def _windows(field: TipField, tips: F64, finer: int, room: float) -> Iterator[tuple[TipField, F64]]:
    """The field on a finer lattice round each group of tips (n, 3), mm, nearer together than twice ``room``."""
    lat = field.lattice
    cells = 2.0 * room / lat.step
    labels, count = ndimage.label(dilated(lat.mask(tips[:, :2]), 0.5 * cells), np.ones((3, 3)))
    group = labels[lat.cells(tips[:, :2])]
    for k in range(1, count + 1):
        mine = tips[group == k]
        lower, upper = mine[:, :2].min(axis=0) - cells * lat.step, mine[:, :2].max(axis=0) + cells * lat.step
        step = max(lat.step / FINER**finer, float(np.sqrt(np.prod(upper - lower) / MAX_NODES)))
        yield field.window(lower, upper, min(step, lat.step)), mine


def _rings(field: TipField, z: float, area: NDArray[np.bool_], first: float, spacing: float,
           covered: float) -> list[Line]:
    """Lines inside an area of the lattice, at ``first`` mm from its border and every ``spacing`` mm further in.

    Where a ring has no next one inside it and there is more than ``covered`` mm, another one goes there.
    """
    lat, flat = field.lattice, field.tool.flat_radius
    far = blocked_beside(np.pad(area, 1), lat.step)[0][1:-1, 1:-1]
    deepest = float(far.max()) if far.size else 0.0
    d = min(max(first, 0.6 * lat.step), 0.9 * deepest)
    far, everywhere = np.ascontiguousarray(far), np.ones(area.shape, np.bool_)
    middles = _middles(far, d, spacing, covered)
    out: list[Line] = []
    while 0 < d < deepest:
        found = lines_at(field, z, far, d, everywhere, (lat.x0, lat.y0), ROUND * flat)
        mine = middles & (far > d) & (far < d + spacing)
        if mine.any():
            found += lines_at(field, z, far, d + covered, dilated(mine, 2.0), (lat.x0, lat.y0), ROUND * flat)
        out.extend(Line(thinned(q.points, THIN * lat.step), q.closed)
                   for p in found for q in (_across(field, p) if _is_spot(p, flat) else [p]))
        d += spacing
    return out


def _middles(far: F64, first: float, spacing: float, covered: float) -> NDArray[np.bool_]:
    """(ny, nx) bool: places more than ``covered`` mm inside a ring that has no next one inside it.

    far            : (ny, nx) float64, mm, from the border of the area
    first, spacing : mm, of the rings
    """
    deep = far - first
    ring = np.floor(deep / spacing)
    beyond = (deep > 0.0) & (deep - ring * spacing > covered)
    if not beyond.any():
        return beyond
    groups, count = ndimage.label(beyond, np.ones((3, 3)))
    # a group that has a ring inside it touches a place behind that ring
    inner = ndimage.maximum_filter(ring, 3) > ring
    open_inside = np.bincount(groups[beyond & inner], minlength=count + 1) > 0
    return np.asarray(beyond & ~open_inside[groups])


def _is_spot(line: Line, flat: float) -> bool:
    """Whether a ring is so small that the flat covers the same place along its length alone."""
    return line.closed and float(np.ptp(line.points[:, :2], axis=0).max()) < SPOT * flat


def _across(field: TipField, ring: Line) -> list[Line]:
    """The free pieces of the straight line between the two ends of a ring."""
    first = ring.points[int(np.argmax(np.linalg.norm(ring.points - ring.points[0], axis=1)))]
    last = ring.points[int(np.argmax(np.linalg.norm(ring.points - first, axis=1)))]
    return free_pieces(field, np.vstack([first, last]), False)
