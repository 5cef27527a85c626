"""What mills touch on the ways of their own program.

A slot as wide as its mill leaves the mill no room, so no place of the mill near a sample is free that is not on the
middle line of the slot. The program knows that line: the mill stands where its feed moves take it, as low as part and
fixtures let it go there.

Coordinates are float64, mm, in the frame of the tree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.outline_drop import drop_turned
from geometry.mesh_queries.revolved_outline import Outline, OutlineLine
from geometry.mesh_queries.tilted_collision import axis_frames
from geometry.tool_body import ToolBody
from verify.program.move_kinds import FEED
from verify.program.program import Program
from zones.reach.assembly import Clearances, discs_of

CHORDS = 32  # of a round corner
SAME_AXIS = np.cos(np.radians(0.01))
STEP = 0.25  # radii between places along the ways
MAX_PLACES = 400_000  # of a tool; more get a wider step
PLACES = 3  # along the ways at which each sample is tried
BOOL = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MillWays:
    """Feed moves of a mill over which its axis stands still: tips at both ends and axis, each (k, 3), mm and unit."""

    start: F64
    end: F64
    axis: F64


def mill_ways(program: Program, tools: Sequence[ToolBody]) -> dict[int, MillWays]:
    """The ways of the mills of a program, by T number."""
    out = {}
    for tool in (t for t in tools if not t.named):
        rows = np.flatnonzero((program.tool == tool.number) & (program.kind == FEED))
        axis = np.tile([0.0, 0.0, 1.0], (len(rows), 1))
        if program.poses is not None:
            axis = program.poses.end_axis[rows]
            still = np.einsum("ij,ij->i", program.poses.start_axis[rows], axis) >= SAME_AXIS
            rows, axis = rows[still], axis[still]
        if len(rows):
            out[tool.number] = MillWays(program.start[rows], program.end[rows], axis)
    return out


def touched_on_ways(tree: TriangleTree, points: F64, tool: ToolBody, ways: MillWays, axis: F64, clear: Clearances,
                    lift: float, grow: float) -> BOOL:
    """Places that a mill touches where its own feed moves take it, as low as the tree lets it go.

    points : (n, 3) float64, mm, frame of the tree
    axis   : (3,) float64, unit, frame of the tree, tip to spindle; ways along others do not count
    lift   : mm, distance within which a touch counts, and by which the mill may enter walls, at most a quarter of its
             radius: facets of a slot of its own width stand in, and its ways are rounded
    grow   : mm, allowance that stays on the part

    Returns (n,) bool.
    """
    out, mine = np.zeros(len(points), np.bool_), np.flatnonzero(ways.axis @ axis >= SAME_AXIS)
    if not len(points) or not len(mine):
        return out
    frame = axis_frames(axis[None])[0]
    turn = np.eye(4)
    turn[:3, :3] = frame
    there = tree if np.array_equal(frame, np.eye(3)) else TriangleTree(tree.mesh.transformed(turn))
    at, a, b = points @ frame.T, (ways.start[mine] @ frame.T)[:, :2], (ways.end[mine] @ frame.T)[:, :2]
    xy, row = _near_places(at[:, :2], a, b, tool.radius)
    aside = np.linalg.norm(at[row, :2] - xy, axis=1)
    beside = aside <= tool.widest_radius + lift + grow
    xy, row, aside = xy[beside], row[beside], aside[beside]
    narrow = _narrower(tool, clear, min(lift, 0.25 * tool.radius))
    tips = drop_turned(there, xy, narrow) + grow
    on = np.flatnonzero(np.isfinite(tips))
    near = _distance(tool, aside[on], at[row[on], 2] - tips[on]) <= lift + grow
    out[row[on[near]]] = True
    return out


def _near_places(points: F64, start: F64, end: F64, radius: float) -> tuple[F64, NDArray[np.int64]]:
    """Places of ways that are near to points in plan, (c, 2), and the point of each, (c,), index.

    points : (n, 2); start, end : (m, 2) ends of the ways
    """
    length = np.linalg.norm(end - start, axis=1)
    step = max(STEP * radius, float(length.sum()) / MAX_PLACES)
    count = np.ceil(length / step).astype(np.int64) + 1
    of = np.repeat(np.arange(len(start)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)) / np.maximum(count - 1, 1)[of]
    places = start[of] + share[:, None] * (end - start)[of]
    some = min(PLACES, len(places))
    away, k = cKDTree(places).query(points, k=[*range(1, some + 1)], distance_upper_bound=radius + step)
    row, column = np.nonzero(np.isfinite(away))
    way = of[k[row, column]]
    d = (end - start)[way]
    along = np.einsum("ij,ij->i", points[row] - start[way], d) / np.maximum(length[way] ** 2, 1e-18)
    return start[way] + np.clip(along, 0.0, 1.0)[:, None] * d, row


def _narrower(tool: ToolBody, clear: Clearances, by: float) -> Outline:
    """The whole tool with a cutting part that is narrower in radius, mm."""
    outline = [(max(rho - by, 0.0), z) for rho, z in tool.cutting_profile(CHORDS)]
    pieces = [OutlineLine(*b) for a, b in pairwise(outline) if a != b]
    for disc in sorted(discs_of(tool, clear), key=lambda d: (d.height, -d.radius)):
        if disc.radius > pieces[-1].rho:
            z = max(pieces[-1].z, disc.height)
            pieces += [OutlineLine(pieces[-1].rho, z), OutlineLine(disc.radius, z)]
    return Outline(tuple(pieces))


def _distance(tool: ToolBody, rho: F64, height: F64) -> F64:
    """Distance of places from a cutting part, (n,) mm; 0 inside and over its end.

    rho, height : (n,) float64, mm, tool frame, distance from the axis and height over the tip
    """
    outline = np.array(tool.cutting_profile(CHORDS))
    place, out = np.column_stack([rho, height]), np.full(len(rho), np.inf)
    for a, b in zip(outline[:-1], outline[1:], strict=True):
        d = b - a
        along = np.clip((place - a) @ d / max(float(d @ d), 1e-18), 0.0, 1.0)
        out = np.minimum(out, np.linalg.norm(place - a - along[:, None] * d, axis=1))
    inside = rho <= np.interp(height, outline[1:, 1], outline[1:, 0], left=-1.0, right=-1.0)
    return np.where(inside & (height >= 0.0), 0.0, out)


__all__ = ["MillWays", "mill_ways", "touched_on_ways"]
