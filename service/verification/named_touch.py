"""What drills, taps, chamfer mills and thread mills can touch.

Such a tool does one kind of work, so each touch has a witness: a place of the whole tool that is free.

- A drill or tap is asked on the axes that the program gives it, as low as the part lets it go there.
- A chamfer mill is asked on faces as steep as its cone, along the cone, and a thread mill on upright walls.

No other contact counts. Coordinates are float64, mm, in the frame of the tree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.outline_drop import drop_turned
from geometry.mesh_queries.revolved_outline import Outline, OutlineLine
from geometry.mesh_queries.tilted_collision import axis_frames
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from verify.program.move_kinds import FEED
from verify.program.program import Program
from zones.reach.assembly import Clearances, discs_of

SAME_AXIS = math.cos(math.radians(0.01))
SAME_SLOPE = math.radians(0.5)  # between a face and the side or cone that touches it
ROUND = 1e-4  # mm, axes of holes nearer than that are one
SHARES = (0.02, 0.25, 0.5, 0.75, 0.98)  # of the way along a cone or side, from the tip up: places that touch
BOOL = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class AxisLines:
    """Lines along which a program feeds a tool: a place of the tip (k, 3) and the axis (k, 3), unit."""

    tips: F64
    axes: F64


def axis_lines(program: Program, tools: Sequence[ToolBody]) -> dict[int, AxisLines]:
    """Lines of the drills and taps of a program, by T number."""
    out = {}
    for tool in tools:
        rows = np.flatnonzero((program.tool == tool.number) & (program.kind == FEED))
        if tool.along_axis_only and len(rows):
            up = np.tile([0.0, 0.0, 1.0], (len(rows), 1)) if program.poses is None else program.poses.end_axis[rows]
            out[tool.number] = AxisLines(program.end[rows], up)
    return out


class NamedTouch:
    """Touches of tools that have a name (``ToolBody.named``) on part and fixtures.

    tree  : TriangleTree
    clear : Clearances
    lines : by T number, as ``axis_lines``
    """

    def __init__(self, tree: TriangleTree, clear: Clearances, lines: Mapping[int, AxisLines]) -> None:
        self.tree, self.clear, self.lines = tree, clear, lines

    def reaches(self, samples: SurfaceSamples, tool: ToolBody, axes: F64, lift: float, grow: float) -> BOOL:
        """Samples that a tool touches along some axis.

        axes : (k, 3) float64, unit, tip to spindle, frame of the tree
        lift : mm, distance within which a touch counts
        grow : mm, distance that the whole tool keeps from everything

        Returns (n,) bool.
        """
        out = np.zeros(len(samples), np.bool_)
        for axis in axes:
            rows = np.flatnonzero(~out)
            if not len(rows):
                break
            frame = axis_frames(axis[None])[0]
            turn = np.eye(4)
            turn[:3, :3] = frame
            tree = self.tree if np.array_equal(frame, np.eye(3)) else TriangleTree(self.tree.mesh.transformed(turn))
            points, normals = samples.points[rows] @ frame.T, samples.normals[rows] @ frame.T
            if tool.along_axis_only:
                out[rows] = self._along(tree, points, tool, axis, frame, lift, grow)
            else:
                out[rows] = self._beside(tree, points, normals, tool, lift, grow)
        return out

    def _along(self, tree: TriangleTree, points: F64, tool: ToolBody, axis: F64, frame: F64, lift: float,
               grow: float) -> BOOL:
        """Places that a drill or tap touches on its own axes."""
        own = self.lines.get(tool.number, AxisLines(np.zeros((0, 3)), np.zeros((0, 3))))
        mine = np.flatnonzero(own.axes @ axis >= SAME_AXIS)
        if not len(mine):
            return np.zeros(len(points), np.bool_)
        xy = np.unique(np.round((own.tips[mine] @ frame.T)[:, :2] / ROUND) * ROUND, axis=0)
        tips = lowest_tips(tree, xy, tool, self.clear, lift, grow)
        rho, of = cKDTree(xy).query(points[:, :2])
        return np.asarray(distance(tool, rho, points[:, 2] - tips[of]) <= lift + grow)

    def _beside(self, tree: TriangleTree, points: F64, normals: F64, tool: ToolBody, lift: float, grow: float) -> BOOL:
        """Places that a cone or side touches on faces as steep as it is."""
        out, low, high = np.zeros(len(points), np.bool_), tool.cone_height, tool.flute_length
        # (slope of the normal, contact nearest to the tip, contact farthest from it), each contact (radius, height)
        sides = [(0.0, (tool.radius, low), (tool.radius, high))] if high > low else []
        if low > 0.0:
            slope = math.atan2(tool.corner_width, low)
            sides.append((slope, (tool.radius - tool.corner_width, 0.0), (tool.radius, low)))
        level = np.hypot(normals[:, 0], normals[:, 1])
        steep = np.arctan2(normals[:, 2], level)
        for slope, first, last in sides:
            for share in SHARES:
                rows = np.flatnonzero(~out & (np.abs(steep - slope) <= SAME_SLOPE))
                if not len(rows):
                    break
                radius, height = (a + share * (b - a) for a, b in zip(first, last, strict=True))
                off = normals[rows, :2] / level[rows, None]
                free = lowest_tips(tree, points[rows, :2] + (radius + grow) * off, tool, self.clear, lift, grow)
                out[rows] = free <= points[rows, 2] - height + lift + grow
        return out


def lowest_tips(tree: TriangleTree, xy: F64, tool: ToolBody, clear: Clearances, slack: float, grow: float) -> F64:
    """Lowest tips from above: the whole tool ``grow`` mm from everything.

    xy    : (n, 2) float64, mm, places of the axis in plan, frame of the tree
    slack : mm by which a tool without ``grow`` may enter: a drill in its own hole touches the facets all round

    Returns (n,) float64, mm; -inf where nothing is below.
    """
    g = grow if grow > slack else -min(slack, 0.25 * tool.radius)
    tip, side = 0.5 * tool.tip_diameter if tool.cone_height > 0.0 else tool.radius, tool.radius + g
    # how much higher than the tip a narrower body begins; a wider one is moved down as a whole
    rise = max(-(tip + g), 0.0) * tool.cone_height / max(tool.corner_width, 1e-9)
    pieces = [OutlineLine(tip + g, 0.0)] if tip + g > 0.0 else []
    if tool.cone_height > 0.0:
        pieces.append(OutlineLine(side, tool.cone_height - rise))
    z = max(pieces[-1].z, tool.flute_length - rise)
    pieces.append(OutlineLine(side, z))
    for disc in sorted(discs_of(tool, clear), key=lambda d: (d.height, -d.radius)):
        if disc.radius + g > pieces[-1].rho:
            z = max(z, disc.height - rise)
            pieces += [OutlineLine(pieces[-1].rho, z), OutlineLine(disc.radius + g, z)]
    return drop_turned(tree, xy, Outline(tuple(pieces))) - rise + max(g, 0.0)


def distance(tool: ToolBody, rho: F64, height: F64) -> F64:
    """Distance of places from a tool without upper end.

    rho, height : (n,) float64, mm, tool frame, distance from the axis and height over the tip

    Returns (n,) float64, mm, 0 inside.
    """
    tip = tool.radius - tool.corner_width
    x, cone, width = rho - tip, tool.cone_height, tool.corner_width
    side = np.hypot(x - width, np.minimum(height - cone, 0.0))
    size = math.hypot(width, cone)
    if size <= 0.0:
        return np.where((x <= 0.0) & (height >= 0.0), 0.0, np.where(x > 0.0, side, -height))
    along, aside = (x * width + height * cone) / size, (x * cone - height * width) / size
    out = np.hypot(aside, np.maximum(np.maximum(-along, along - size), 0.0))
    out = np.minimum(np.minimum(out, side), np.hypot(np.maximum(x, 0.0), height))
    return np.where((aside <= 0.0) & (x <= width) & (height >= 0.0), 0.0, out)


__all__ = ["AxisLines", "NamedTouch", "axis_lines", "distance", "lowest_tips"]
