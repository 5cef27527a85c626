"""Level planes: an end mill with a flat bottom follows the walls at the height of the plane, then rings inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64
from toolpath.levels import Line, contours, dilated, lines_at, pieces_where, thinned
from zones.reach import LEVEL_TOLERANCE, TipField

SAME_PLANE = 5e-4  # mm


def plane_heights(tips: F64) -> list[float]:
    """The heights at which level area is touched, descending; tips less than ``SAME_PLANE`` mm apart are one.

    tips : (n, 3) float64, mm
    """
    z = np.sort(tips[:, 2])[::-1]
    cuts = np.flatnonzero(np.diff(z) < -SAME_PLANE) + 1
    return [float(np.median(group)) for group in np.split(z, cuts) if len(group)]


def planes(field: TipField, tips: F64, tolerance: float) -> list[list[Line]]:
    """Passes over level area, plane by plane from the top.

    field     : TipField of a tool whose bottom is flat out to R - r
    tips      : (n, 3) float64, mm, tips that touch the samples
    tolerance : mm, of the lines along walls

    Returns
    -------
    list of lists of Line, one list a plane
        Rings at most 0.8 of the flat diameter apart, and the line that touches whatever stands beside the plane.
    """
    lat, tool = field.lattice, field.tool
    flat = tool.radius - tool.corner_radius
    out = []
    for z in plane_heights(tips):
        mine = tips[np.abs(tips[:, 2] - z) < 2.0 * SAME_PLANE]
        mask = dilated(lat.mask(mine[:, :2]), max(1.5, 0.2 * tool.radius / lat.step))
        free = field.height <= z + LEVEL_TOLERANCE
        lines = _rings(field, z, mask & free, 0.2 * flat, 1.6 * flat)
        active = dilated(mask, 2.0 * tool.radius / lat.step)
        for line in contours(field, z, active, tolerance):
            near = mask[lat.cells(line.points[:, :2])]
            lines.extend(pieces_where(line, np.asarray(near), 0.2 * tool.radius, 2.0 * tool.radius))
        out.append(lines)
    return out


def _rings(field: TipField, z: float, area: NDArray[np.bool_], first: float, spacing: float) -> list[Line]:
    """Lines inside an area of the lattice, at ``first`` mm from its border and every ``spacing`` mm further in."""
    lat = field.lattice
    padded = np.pad(area, 1)
    far = ndimage.distance_transform_edt(padded)[1:-1, 1:-1] * lat.step
    deepest = float(far.max()) if far.size else 0.0
    out: list[Line] = []
    d = min(max(first, 0.6 * lat.step), 0.9 * deepest)
    far, everywhere = np.ascontiguousarray(far), np.ones(area.shape, np.bool_)
    while 0 < d < deepest:
        out.extend(Line(thinned(p.points, 0.3 * lat.step), p.closed)
                   for p in lines_at(field, z, far, d, everywhere, (lat.x0, lat.y0)))
        d += spacing
    return out
