"""Poses of a program's own tools, moved on to places that it left below an overhang.

No axis looks at such a place, so what tools can touch there is not known from the part alone: a slot cutter with a
thin neck comes in from the side. The program shows the way. The move that left the stock carried its tool past the
place; moved on by the height of the stock, the same point of the tool touches the part. Or a move finished another
place of the same face, and its tool slides on from there. Where the whole tool stands free, and on its way, the place
could have been cut.

Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from geometry.tool_body import ToolBody
from verify.moves import Moves
from verify.tool_axes import LEVEL, UPRIGHT

CHORDS = 32  # of a round corner
PLACES = 24  # parts of a move in which the place of the tool is looked for, and again of two of them
ON_TOOL = 0.02  # mm: a point farther from the cutting part was left by another move
UPRIGHT_TOOL = math.cos(math.radians(0.5))  # part of Z in an axis that leans for no wall
SIDE = 0.1  # share of the axis in the normal of a side
EDGE = math.cos(math.radians(6.0))  # between a face and the tool where it touches: chords of a corner turn by 3
MAX_LEAN = math.radians(20.0)  # by which the axis may turn towards the face
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of tools, k of them.

    row   : (k,) int64, index, place that the pose touches
    tool  : (k,) int64, index, place in the sequence of tools
    tips  : (k, 3) float64, mm; axes : (k, 3) float64, unit, tip to spindle
    shift : (k, 3) float64, mm, from where the program had the tool
    edge  : (k,) bool, whether it touches a slope with an edge, which finishes slopes in steps alone
    turned : (k,) bool, whether it has another axis than the program gave the tool
    """

    row: INT
    tool: INT
    tips: F64
    axes: F64
    shift: F64
    edge: NDArray[np.bool_]
    turned: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.row)

    def only(self, chosen: NDArray[np.bool_] | INT) -> Poses:
        """The poses that are chosen: (k,) bool, or their rows, (r,) int64, index."""
        return Poses(self.row[chosen], self.tool[chosen], self.tips[chosen], self.axes[chosen], self.shift[chosen],
                     self.edge[chosen], self.turned[chosen])


def joined(parts: Sequence[Poses]) -> Poses:
    """Poses of several parts, in order."""
    names = ("row", "tool", "tips", "axes", "shift", "edge", "turned")
    return Poses(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


def poses_at(points: F64, normals: F64, ways: F64, left: F64, mover: I32, moves: Moves, tools: Sequence[ToolBody],
             allowance: float) -> Poses:
    """The tool of a move, carried on to the places where the move left stock.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the part
    ways   : (n, 3) float64, unit, setup frame, from the places to where the move has cut
    left   : (n,) float64, mm of stock on them; places where it is inf, or longer than the tool is wide, have no pose
    mover  : (n,) int32, index, the move; -1 for none
    allowance : mm that may stay

    Returns Poses. Where the tool leans in the program, a place has a second one, with the tool turned about the point
    that touches until its side lies against the way, by 20 degrees at most: a side that leans too little has left a
    wedge. It has a third one a little farther up, since the end swings.
    """
    widest = np.array([t.widest_radius for t in tools])
    named = np.array([t.named for t in tools], np.bool_)
    tool = np.where(mover >= 0, moves.tool[mover], 0).astype(np.int64)
    rows = np.flatnonzero((mover >= 0) & np.isfinite(left) & ~named[tool])
    rows = rows[left[rows] <= 2.0 * widest[tool[rows]]]
    touch = points[rows] + left[rows, None] * ways[rows]
    tips, axes, side = (np.zeros((len(rows), 3)) for _ in range(3))
    for k in np.unique(tool[rows]):
        mine = np.flatnonzero(tool[rows] == k)
        tips[mine], axes[mine], side[mine] = _at(touch[mine], mover[rows[mine]], moves, tools[k])
    met = np.isfinite(side[:, 0])
    rows, touch, tips, axes, side = rows[met], touch[met], tips[met], axes[met], side[met]
    on = -np.maximum(left[rows] - allowance, 0.0)[:, None] * ways[rows]
    up = np.abs(np.einsum("ij,ij->i", normals[rows], axes))
    edge = (up > UPRIGHT) & (up < LEVEL) & (-np.einsum("ij,ij->i", side, normals[rows]) < EDGE)
    parts = [Poses(rows, tool[rows], tips + on, axes, on, edge, np.zeros(len(rows), np.bool_))]
    for n in np.flatnonzero(axes[:, 2] < UPRIGHT_TOOL).tolist():
        turn = _turn(side[n], -ways[rows[n]])
        if turn is None:
            continue
        leaning, body = turn @ axes[n], tools[tool[rows[n]]]
        turned = [touch[n] + turn @ (tips[n] - touch[n]) + on[n]]
        # the end has swung towards a floor below: a side touches as well farther up
        lift = 2.0 * body.widest_radius * float(np.linalg.norm(leaning - axes[n]))
        if abs(side[n] @ axes[n]) < SIDE and (touch[n] - tips[n]) @ axes[n] > body.end_height + lift:
            turned.append(turned[0] + lift * leaning)
        same, on_edge = np.full(len(turned), n), float((turn @ side[n]) @ -normals[rows[n]]) < EDGE
        parts.append(Poses(rows[same], tool[rows[same]], np.array(turned), np.tile(leaning, (len(turned), 1)), on[same],
                           np.full(len(turned), on_edge), np.ones(len(turned), np.bool_)))
    return joined(parts)


def slid_poses(points: F64, normals: F64, touched: Poses, places: F64, place_normals: F64,
               tools: Sequence[ToolBody]) -> Poses:
    """Poses of ``touched``, each slid from the place that it touches to another place of the same face.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the part: where to, one for each pose
    touched : Poses, n of them; row is the place in ``places``
    places, place_normals : (g, 3) float64, mm and unit, setup frame, on the part

    Returns Poses, n of them, whose row is that of the point.

    The tool keeps its axis. Where both normals lean from it, the tool goes round its axis as the normal does, so the
    same circle of it touches. A straight side touches as high as it is: it keeps its height as far as the flutes reach.
    """
    from_, axes = places[touched.row], touched.axes
    arm = touched.tips - from_
    one, other = (v - np.einsum("ij,ij->i", v, axes)[:, None] * axes for v in (place_normals[touched.row], normals))
    long = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    leans = long > SIDE**2
    long = np.where(leans, long, 1.0)
    cosine = np.where(leans, np.einsum("ij,ij->i", one, other) / long, 1.0)[:, None]
    sine = np.where(leans, np.einsum("ij,ij->i", np.cross(one, other), axes) / long, 0.0)[:, None]
    up = np.einsum("ij,ij->i", arm, axes)[:, None] * axes
    aside = arm - up
    tips = points + up + cosine * aside + sine * np.cross(axes, aside)
    lowest, highest = np.array([(t.corner_end[1], t.flute_length if t.taper <= 0.0 and t.arcs is None else -1.0)
                                for t in tools])[touched.tool].T
    rise = np.einsum("ij,ij->i", tips - touched.tips, axes)
    at = rise - np.einsum("ij,ij->i", arm, axes)  # height of the touch over the tip, once that does not rise
    level = (np.abs(np.einsum("ij,ij->i", normals, axes)) < SIDE) & (at >= lowest) & (at <= highest)
    tips = tips - np.where(level, rise, 0.0)[:, None] * axes
    return Poses(np.arange(len(points)), touched.tool, tips, axes, tips - touched.tips, touched.edge, touched.turned)


def _at(points: F64, mover: I32, moves: Moves, tool: ToolBody) -> tuple[F64, F64, F64]:
    """Tips, axes and outward normals of a tool where its moves brought its cutting part nearest to points.

    points : (n, 3) float64, mm; mover : (n,) int32, index, the move of each

    Returns three (n, 3) float64; a normal is NaN where that is farther than ``ON_TOOL``.
    """
    row, outline = np.arange(len(points)), np.array(tool.cutting_profile(CHORDS))
    low, high = np.zeros(len(points)), np.ones(len(points))
    for _ in range(2):
        step = (high - low) / PLACES
        share = low[:, None] + step[:, None] * np.arange(PLACES + 1)
        tips = moves.start[mover][:, None] + share[:, :, None] * (moves.end[mover] - moves.start[mover])[:, None]
        axes = _axes(moves, mover, share)
        d = points[:, None] - tips
        height = np.einsum("nij,nij->ni", d, axes)
        aside = d - height[:, :, None] * axes
        rho = np.linalg.norm(aside, axis=2)
        away, slope = (a.reshape(*rho.shape, -1) for a in _off_outline(outline, rho.ravel(), height.ravel()))
        best = away[:, :, 0].argmin(axis=1)
        low, high = np.maximum(share[row, best] - step, 0.0), np.minimum(share[row, best] + step, 1.0)
    away, slope, aside, axes, rho = (a[row, best] for a in (away, slope, aside, axes, rho))
    side = slope[:, :1] * aside / np.maximum(rho, 1e-12)[:, None] + slope[:, 1:] * axes
    return tips[row, best], axes, np.where(away <= ON_TOOL, side, np.nan)


def _axes(moves: Moves, mover: I32, share: F64) -> F64:
    """Unit axes (n, k, 3) at shares (n, k) of moves (n,)."""
    if moves.axes is None:
        return np.broadcast_to(np.array([0.0, 0.0, 1.0]), (*share.shape, 3))
    own = moves.axes.only(mover.astype(np.int64))
    angle, about = (share * own.angle[:, None])[:, :, None], np.cross(own.about, own.axis)
    return np.asarray(np.cos(angle) * own.axis[:, None] + np.sin(angle) * about[:, None])


def _off_outline(outline: F64, rho: F64, height: F64) -> tuple[F64, F64]:
    """Distance of places from an outline, (n,) mm, and the outward normal of its nearest line, (n, 2): aside and up."""
    lines = np.concatenate([outline, [[0.0, outline[-1, 1]]]])  # closed by the upper end of the flutes
    ends = np.diff(lines, axis=0)
    long = np.hypot(ends[:, 0], ends[:, 1])
    kept = long > 1e-12
    starts, ends, long = lines[:-1][kept], ends[kept], long[kept]
    best, away = np.zeros(len(rho), np.int64), np.full(len(rho), np.inf)
    for k, (a, d, size) in enumerate(zip(starts, ends / long[:, None], long, strict=True)):
        x, y = rho - a[0], height - a[1]
        along = np.clip(x * d[0] + y * d[1], 0.0, size)
        off = np.square(x - along * d[0]) + np.square(y - along * d[1])
        nearer = off < away
        best[nearer], away[nearer] = k, off[nearer]
    return np.sqrt(away), np.column_stack([ends[best, 1], -ends[best, 0]]) / long[best, None]


def _turn(side: F64, wanted: F64) -> F64 | None:
    """Rotation (3, 3) that takes a unit vector to another by the least turn; None where that is no or too much turn."""
    axis = np.cross(side, wanted)
    sine, cosine = float(np.linalg.norm(axis)), float(side @ wanted)
    if sine < 1e-6 or cosine < math.cos(MAX_LEAN):
        return None
    x, y, z = axis / sine
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + sine * k + (1.0 - cosine) * (k @ k))


__all__ = ["Poses", "joined", "poses_at", "slid_poses"]
