"""Waterlines: steep area finished by level lines that touch it, from the top down."""

from __future__ import annotations

import math

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import Line
from toolpath.passes.contours import contour_pieces, dilated
from zones.reach.tip_field import TipField

MIN_STEP = 0.02  # mm, least distance of levels
SHARP_DIP = 1.5e-4  # mm that a sharp-cornered end goes below its level, so that rounding in the program cannot lift it


def level_step(tool: ToolBody, normals: F64, cusp: float, step_down: float) -> float:
    """Height between waterlines that leaves a given cusp on a steep area, mm [Lin1996].

    tool      : ToolBody
    normals   : (n, 3) float64, dimensionless, unit normals of the area, access frame
    cusp      : mm, along the normal
    step_down : mm, upper limit

    Notes
    -----
    On a wall inclined by n_z a corner r leaves s^2/(8 r) between lines s apart along the wall, s = dz/sin. The flank
    above the corner leaves no more than dz n_z; n_z counts from the side of the tool where that leans. The greater dz
    of the two holds for each sample. The 5 % quantile over the area is taken; the measurement finds the rest. Second
    order in the cusp. Of a circle segment mill lines lie a chord of its outline apart, which counts arcs and flank.
    """
    nz = np.abs(normals[:, 2])
    if tool.arcs is not None and len(nz):
        sine = np.sqrt(np.maximum(1.0 - nz * nz, 0.0))
        wanted = float(np.quantile(tool.arcs.passes_apart(sine, cusp) * sine, 0.05))
        return max(MIN_STEP, min(wanted, step_down))
    by_corner = math.sqrt(8.0 * cusp * tool.corner_radius) * np.sqrt(np.maximum(1.0 - nz * nz, 0.0))
    long = math.hypot(1.0, tool.taper)
    off_flank = nz / long - np.sqrt(np.maximum(1.0 - nz * nz, 0.0)) * tool.taper / long
    by_flank = cusp / np.maximum(off_flank, 1e-6)
    wanted = float(np.quantile(np.maximum(by_corner, by_flank), 0.05)) if len(nz) else step_down
    return max(MIN_STEP, min(wanted, step_down))


def heights(top: float, bottom: float, step: float) -> F64:
    """Levels from top to bottom, both included, at most ``step`` mm apart, descending, (n,) float64, mm."""
    n = max(1, math.ceil((top - bottom) / step - 1e-9)) if top > bottom else 0
    return np.linspace(top, bottom, n + 1)


def lowest_of_groups(z: F64, window: float) -> F64:
    """Levels that serve heights: the lowest of each group no higher than ``window`` mm, descending, (m,) float64, mm.

    z : (n,) float64, mm
    """
    out: list[float] = []
    for v in np.unique(z).tolist():
        if not out or v > out[-1] + window:
            out.append(v)
    return np.array(out[::-1])


def waterlines(field: TipField, tips: F64, levels: F64, window: float, tolerance: float) -> list[list[Line]]:
    """Level lines that touch an area, level by level.

    field     : TipField
    tips      : (n, 3) float64, mm, access frame, tips that touch the samples of the area
    levels    : (m,) float64, mm, descending
    window    : mm, a level serves the samples whose tip lies within this of it
    tolerance : mm, of the lines against the true boundary

    Returns
    -------
    list of lists of Line, one list a level
    """
    lat = field.lattice
    out: list[list[Line]] = []
    reach = max(2.5, 0.5 * field.tool.radius / lat.step)
    for z in levels.tolist():
        near = np.abs(tips[:, 2] - z) <= window
        if not near.any():
            out.append([])
            continue
        wanted = dilated(lat.mask(tips[near, :2]), reach)
        active = dilated(wanted, 2.0 * field.tool.radius / lat.step + 3)
        dip = SHARP_DIP if field.tool.tip_curvature == 0 else 0.0
        out.append(contour_pieces(field, z, active, wanted, 0.5 * field.tool.radius, 2.0 * field.tool.radius,
                                  tolerance, dip))
    return out
