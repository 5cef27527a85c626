"""Where ends of cutters press deepest into the part: rays there see pits and lenses that lie between the guard points.

A cut that is narrow to all sides mostly ends where the path turns: down and up, in and out. So the end of a tool is
looked at wherever a feed move ends at a corner of the path, and at even distances along all feed moves. So is the rim
where the flutes end, if the tool is thinner over it. Of a circle segment mill the end is balls inside it that touch the
outline at several heights, and its rim. The points of drills and pointed chamfer mills have findings of their own.
Coordinates are float64, mm, in the setup frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.findings import Source, gouge_findings
from verify.kernels.stock import CUTTER
from verify.model import Finding, ProofSetup
from verify.moves import Moves
from verify.surface.guard_points import CLOSER_SHARE, GUARD_SPACING, PATH_BATCH, inside_part, path_places
from verify.tool_axes import square_to

CORNER = math.cos(math.radians(45.0))  # of the angle by which a path turns at a corner
STEP = 0.1  # mm between places along the ways
MAX_RINGS, MAX_BALLS = 50_000, 400_000  # places along the ways of a tool; more get a wider step
ENDS_AROUND = 8  # places of each ring of ``end_depths``
TILTS = (0.0, 0.25 * math.pi, 0.5 * math.pi)  # of rings on a corner, from its lowest place to its side
AROUND = 16  # places round the rim of an end
ROUNDS = 4  # of the search round the deepest of them
RELIEF = 1e-6  # mm by which a neck is thinner than the rim below it, in radius
OVERHANG = -0.02  # normal along the axis: the side of a cylinder meets a steeper surface before its upper rim does
LIFT, LIFT_SHARE = 0.05, 0.25  # mm, and of the radius: a second rim over the sharp one, for walls
PER_ARC = 3  # rings on each arc of a circle segment mill, beside the middle
TOLD = 0.5  # mm: a wider step along the ways is a note
THIN = 0.05  # mm
BATCH = 4096  # poses
SPARE = 1e-6  # mm
CLOSE = 0.5  # mm: places of a rim that are farther from the surface are told apart by whether they are in the part
INT = NDArray[np.int64]


@dataclass(frozen=True)
class _Ring:
    """A circle round the axis of a tool that grows to a part of its shape, mm: to a corner, or not at all to a rim.

    radius, high : of the circle, and its height over the tip; grown : by how much it grows
    """

    radius: float
    high: float
    grown: float

    @property
    def reach(self) -> float:
        """Distance of its farthest place from the middle of the circle, mm."""
        return self.radius + self.grown


@dataclass(frozen=True, eq=False)
class Feet:
    """Places of the surface over the deepest points of ends, with the normals that lead to these.

    points, normals : (n, 3) float64, mm and unit, setup frame; triangle : (n,) int64, index
    depth           : (n,) float64, mm, how far the end presses in there
    """

    points: F64
    normals: F64
    triangle: INT
    depth: F64

    def thinned(self) -> Feet:
        """The deepest of each cell of ``THIN``, the deepest first."""
        order = np.lexsort((*self.points.T, -self.depth))
        cell = np.floor(self.points[order] / THIN).astype(np.int64)
        rows = order[np.sort(np.unique(cell, axis=0, return_index=True)[1])] if len(order) else order
        return Feet(self.points[rows], self.normals[rows], self.triangle[rows], self.depth[rows])


def turning_feet(tree: TriangleTree, moves: Moves, tools: Sequence[ToolBody],
                 tolerance: float) -> tuple[Feet, list[Assumed]]:
    """Places of the surface into which ends of cutters press where paths turn.

    tree      : TriangleTree of the part
    tools     : those that ``Moves.tool`` refers to
    tolerance : mm, gouge tolerance; ends that press in by less than 0.4 of it give nothing

    Returns Feet, the deepest first, and what is taken for granted of tools whose ways are so long that few of their
    places are looked at.

    Notes
    -----
    The deepest place on a rim of radius R is searched from 16 places round it, to R / 300. A ball has one sphere.
    """
    found, notes = list[Feet](), list[Assumed]()
    least = CLOSER_SHARE * tolerance
    hanging = _overhangs(tree.mesh) if moves.axes is None else None
    for k, tool in enumerate(tools):
        upper, cone = _upper_rims(tool), max(tool.taper, tool.cone_height) > 0.0
        over = hanging if not cone else None  # an upright side meets all else before the rim over it does
        at = _placed(moves, *_corners(moves, k), tool, tree.mesh.bounds)
        found += [_pressed(tree, *at, ring, least) for ring in (*_ends(tool), *_rims(tool))]
        found += [_pressed(tree, *_beside(over, at, ring), ring, least) for ring in upper]
        along = [*([] if _seen(tool, least, tolerance) else _ends(tool)), *(_rims(tool) if cone else [])]
        if along or upper and (over is None or len(over)):
            rows, share, step = _ways(moves, k, tool, tree.mesh.bounds)
            if step > TOLD:
                notes.append(Assumed(AssumedKind.BETWEEN_SAMPLES, round(step, 2), f"the paths of {tool.id} are long: a "
                                     f"smooth dip shorter than {step:.1f} mm may be missed aside of the middle of its "
                                     "end", "verify a part of the program at a time"))
            at = _placed(moves, rows, share, tool, tree.mesh.bounds)
            found += [_pressed(tree, *at, ring, least) for ring in along]
            found += [_pressed(tree, *_beside(over, at, ring), ring, least) for ring in upper]
    return _joined(found).thinned(), notes


def _joined(parts: Sequence[Feet]) -> Feet:
    none = np.zeros((0, 3))
    return Feet(np.concatenate([none, *(f.points for f in parts)]), np.concatenate([none, *(f.normals for f in parts)]),
                np.concatenate([np.zeros(0, np.int64), *(f.triangle for f in parts)]),
                np.concatenate([np.zeros(0), *(f.depth for f in parts)]))


def _seen(tool: ToolBody, least: float, tolerance: float) -> bool:
    """Whether every cut of a ball that is too deep covers a guard point by more than ``least`` mm."""
    return tool.end == "ball" and 0.5 * (0.87 * GUARD_SPACING) ** 2 / tool.radius + least < tolerance


def _corners(moves: Moves, k: int) -> tuple[INT, F64]:
    """Moves of a tool that end, or begin, at a corner of the path, and the share of the move that is: 1 or 0.

    A corner is where the way of the tip turns, or the turn of the axis begins, ends or changes.
    """
    way = moves.end - moves.start
    length = np.linalg.norm(way, axis=1)
    way = way / np.maximum(length, 1e-12)[:, None]
    feed = moves.feed & (moves.tool == k) & (length > 0.0)
    joined = np.einsum("ij,ij->i", way[:-1], way[1:]) > CORNER
    if moves.axes is not None:
        # a rim goes where the axis turns it, too: a path that goes straight on has a corner where the axis turns back
        turn = moves.axes.angle[:, None] * moves.axes.about
        size = np.linalg.norm(turn, axis=1)
        feed |= moves.feed & (moves.tool == k) & (size > 0.0)
        still = (size[:-1] == 0.0) & (size[1:] == 0.0)
        joined = (joined | (length[:-1] == 0.0) & (length[1:] == 0.0)) & (
            still | (np.einsum("ij,ij->i", turn[:-1], turn[1:]) > CORNER * size[:-1] * size[1:]))
    joined = feed[:-1] & feed[1:] & joined
    ends = np.flatnonzero(feed & ~np.append(joined, False))
    starts = np.flatnonzero(feed & ~np.append(False, feed[:-1]))
    return np.concatenate([ends, starts]), np.concatenate([np.ones(len(ends)), np.zeros(len(starts))])


def _ways(moves: Moves, k: int, tool: ToolBody, bounds: F64) -> tuple[INT, F64, float]:
    """Even places along the feed moves of a tool that come near the part: moves, shares of them, and mm between two."""
    low, high = np.minimum(moves.start, moves.end), np.maximum(moves.start, moves.end)
    far = _far(tool)
    near = ((low < bounds[1] + far) & (high > bounds[0] - far)).all(axis=1)
    rows = np.flatnonzero(moves.feed & (moves.tool == k) & near)
    length = np.linalg.norm(moves.end[rows] - moves.start[rows], axis=1)
    if moves.axes is not None:
        length = length + far * moves.axes.angle[rows]  # the way of a rim that the axis swings
    past = np.cumsum(length)
    most = MAX_BALLS if tool.kind == "ball" else MAX_RINGS
    if not len(rows) or past[-1] <= 0.0:
        return np.zeros(0, np.int64), np.zeros(0), STEP
    step = max(STEP, float(past[-1]) / most)
    at = np.arange(0.0, past[-1], step)
    own = np.minimum(np.searchsorted(past, at, side="right"), len(rows) - 1)
    return rows[own], 1.0 - (past[own] - at) / np.maximum(length[own], 1e-12), step


def _placed(moves: Moves, row: INT, share: F64, tool: ToolBody, bounds: F64) -> tuple[F64, F64]:
    """Tips and axes, (n, 3) mm and unit, at shares of moves, where the end of the tool can reach the part."""
    tip, axis = _posed(moves, row, share)
    far = 2.0 * _far(tool)
    near = ((tip > bounds[0] - far) & (tip < bounds[1] + far)).all(axis=1)
    both = np.round(np.column_stack([tip, axis])[near], 7)
    both = both[np.lexsort(both.T[::-1] if moves.axes is not None else both.T[2::-1])]
    both = both[np.append(True, (both[1:] != both[:-1]).any(axis=1))] if len(both) else both
    return both[:, :3], both[:, 3:]


def _posed(moves: Moves, row: INT, share: F64) -> tuple[F64, F64]:
    """Tips and axes, (n, 3) mm and unit, at shares of moves."""
    tip = moves.start[row] + share[:, None] * (moves.end - moves.start)[row]
    axis = np.tile([0.0, 0.0, 1.0], (len(row), 1))
    if moves.axes is not None:
        turn = (share * moves.axes.angle[row])[:, None]
        axis = np.cos(turn) * moves.axes.axis[row] + np.sin(turn) * np.cross(moves.axes.about[row],
                                                                              moves.axes.axis[row])
    return tip, axis


def _far(tool: ToolBody) -> float:
    """How far from its tip a tool is looked at, mm."""
    whole = max(tool.taper, tool.cone_height) > 0.0 or len(_upper_rims(tool)) > 0
    if tool.arcs is not None and not whole:
        return math.hypot(tool.radius, tool.end_height)
    return math.hypot(tool.widest_radius, tool.flute_length) if whole else tool.radius


def _pressed(tree: TriangleTree, tip: F64, axis: F64, ring: _Ring, least: float) -> Feet:
    """As ``_pressed_poses``, without the poses."""
    return _pressed_poses(tree, tip, axis, ring, least)[0]


def _pressed_poses(tree: TriangleTree, tip: F64, axis: F64, ring: _Ring, least: float) -> tuple[Feet, INT]:
    """The deepest place of each pose (n, 3) that presses in by more than ``least`` mm, on a ring, and the poses.

    An end presses in nowhere by ``least`` where its middle is in air and no surface comes nearer to it than its rim is
    by as much: the way from the middle to a place so deep in the part goes through the surface before.
    """
    middle, reach = tip + ring.high * axis, ring.reach - least + SPARE
    alone = np.flatnonzero(nearest(tree, middle, reach)[1] < 0) if reach > 0.0 else np.arange(len(tip))
    may = np.ones(len(tip), np.bool_)
    may[alone] = _inside_alone(tree, middle[alone], max(reach, SPARE))
    poses = np.flatnonzero(may)
    found = [_deepest(tree, tip[poses[i:i + BATCH]], axis[poses[i:i + BATCH]], ring, least)
             for i in range(0, len(poses), BATCH)]
    rows = [poses[i * BATCH + row] for i, (_, row) in enumerate(found)]
    return _joined([feet for feet, _ in found]), np.concatenate([np.zeros(0, np.int64), *rows])


def _inside_alone(tree: TriangleTree, points: F64, radius: float) -> NDArray[np.bool_]:
    """Whether points (n, 3), mm, are in the part, where no surface comes as near to any of them as ``radius``, mm.

    No surface passes between two of them that are nearer to each other. So only two of a cell of that diagonal are
    asked, and where either is in the part, all of the cell are.
    """
    if not len(points):
        return np.zeros(0, np.bool_)
    cell = np.floor((points - points.min(axis=0)) * (math.sqrt(3.0) / radius)).astype(np.int64)
    span = cell.max(axis=0) + 1
    key = (cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    begins = np.flatnonzero(np.diff(key[order], prepend=-1))
    ends = np.append(begins[1:], len(order)) - 1
    asked = inside_part(tree, points[order[np.concatenate([begins, ends])]])
    out = np.empty(len(points), np.bool_)
    out[order] = np.repeat(asked[:len(begins)] | asked[len(begins):], ends - begins + 1)
    return out


def _ends(tool: ToolBody) -> list[_Ring]:
    """Rings of the end: its corner, of a circle segment mill balls inside it that touch each of its arcs, and of a cone
    the rim of the flat at its tip."""
    if tool.arcs is not None:
        return [_Ring(*ring) for ring in tool.arcs.inner_balls(PER_ARC, tool.flute_length)]
    if tool.cone_height > 0.0:
        return [_Ring(0.5 * tool.tip_diameter, 0.0, 0.0)] if tool.tip_diameter > 0.0 else []
    return [_Ring(tool.radius - tool.corner_radius, tool.corner_radius, tool.corner_radius)]


def _rims(tool: ToolBody) -> list[_Ring]:
    """Of a sharp end a rim over it, and of a cone the edge where its side begins."""
    high = min(LIFT, LIFT_SHARE * tool.radius)
    if tool.arcs is not None:
        sharp = tool.arcs.bow <= 0.0 or tool.profile_taper > 0.0
        return [_Ring(tool.radius, tool.end_height + high, 0.0)] if sharp else []
    if tool.along_axis_only or tool.corner_radius > 0.0:
        return []
    return [_Ring(tool.radius, max(tool.cone_height, high), 0.0)]


def _upper_rims(tool: ToolBody) -> list[_Ring]:
    """The upper end of the flutes, where the tool over them is thinner."""
    if tool.along_axis_only or tool.taper <= 0.0 and 0.5 * tool.neck_diameter > tool.widest_radius - RELIEF:
        return []
    return [_Ring(tool.widest_radius, tool.flute_length, 0.0)]


def _overhangs(mesh: TriangleMesh) -> TriangleTree:
    """The triangles of a mesh that face down."""
    rows = mesh.normals[:, 2] < OVERHANG
    return TriangleTree(TriangleMesh(mesh.vertices, mesh.faces[rows]))


def _beside(over: TriangleTree | None, at: tuple[F64, F64], ring: _Ring) -> tuple[F64, F64]:
    """Those of tips and axes, (n, 3) mm and unit, whose ring comes near to triangles; all where None."""
    if over is None or not len(over):
        return at if over is None else (at[0][:0], at[1][:0])
    near = nearest(over, at[0] + ring.high * at[1], ring.reach + SPARE)[1] >= 0
    return at[0][near], at[1][near]


def _deepest(tree: TriangleTree, tip: F64, axis: F64, on: _Ring, least: float) -> tuple[Feet, INT]:
    x = square_to(axis)
    y = np.cross(axis, x)
    ring, ball = on.radius, on.grown
    middle = tip + on.high * axis
    around = 1 if ring <= 0.0 else AROUND
    rough = ring * (1.0 - math.cos(math.pi / around))  # by which the rim may be deeper between two places
    close = max(rough - least, CLOSE)

    def depth(rows: INT, angle: F64) -> tuple[F64, F64, F64, INT]:
        """How deep the end presses in at angles (k,) rad of poses; feet, ways out, triangles."""
        at = middle[rows] + ring * (np.cos(angle)[:, None] * x[rows] + np.sin(angle)[:, None] * y[rows])
        far, triangle, foot = nearest(tree, at, ball if ball > 0.0 else close)
        if ball <= 0.0:  # of places that are farther, those in the air do not count
            alone = np.flatnonzero(triangle < 0)
            alone = alone[_inside_alone(tree, at[alone], close)]
            far[alone], triangle[alone], foot[alone] = nearest(tree, at[alone])
        met = triangle >= 0
        inside = met & (np.einsum("ij,ij->i", at - foot, tree.mesh.normals[triangle]) < 0.0)
        doubtful = np.flatnonzero(inside & (far > least))
        inside[doubtful] = inside_part(tree, at[doubtful])
        deep = np.where(met, ball + np.where(inside, far, -far), -np.inf)
        way = np.where(inside[:, None], foot - at, at - foot) / np.maximum(far, 1e-12)[:, None]
        flat = far < 1e-9
        way[flat] = tree.mesh.normals[triangle[flat]]
        return deep, foot, way, triangle

    n = len(tip)
    every = np.repeat(np.arange(n), around)
    angle = np.tile(2.0 * math.pi * np.arange(around) / around, n)
    deep, foot, way, triangle = depth(every, angle)
    best = np.arange(n) * around + deep.reshape(n, around).argmax(axis=1)
    rows = np.flatnonzero(deep[best] > least - rough)
    deep, foot, way, triangle, angle = deep[best], foot[best], way[best], triangle[best], angle[best]
    span = math.pi / around
    for _ in range(ROUNDS if around > 1 else 0):
        for side in (-span, span):
            turned = angle[rows] + side
            found = depth(rows, turned)
            better = found[0] > deep[rows]
            at = rows[better]
            deep[at], foot[at], way[at], triangle[at] = (f[better] for f in found)
            angle[at] = turned[better]
        span *= 0.5
    rows = rows[deep[rows] > least]
    return Feet(foot[rows], way[rows], triangle[rows], deep[rows]), rows


def tip_gouges(tree: TriangleTree, moves: Moves, tools: Sequence[ToolBody], source: Source,
               tolerance: float) -> list[Finding]:
    """Findings where feed moves take the tip of a pointed tool more than ``tolerance`` mm into the part.

    The surface below a point is the farthest from it where a hole ends in a cone: no normal of the cone leads there. So
    the depth of a tip is its own distance from the part.
    """
    pointed = np.array([t.cone_height > 0.0 and t.tip_diameter <= 0.0 for t in tools], np.bool_)
    if not len(moves) or not pointed[moves.tool].any():
        return []
    tips, row, depth, triangle = _sunk_tips(tree, moves, moves.feed & pointed[moves.tool], tolerance)
    return gouge_findings(tips, tree.mesh.face_ids[triangle], depth, np.zeros(len(tips)), row.astype(np.int32), source,
                          tolerance)


def _sunk_tips(tree: TriangleTree, moves: Moves, chosen: NDArray[np.bool_],
               tolerance: float) -> tuple[F64, INT, F64, INT]:
    """Tips of moves, at both ends and along them, that are more than ``tolerance`` mm in the part.

    chosen : (m,) bool, the moves

    Returns tips (n, 3) mm, moves (n,), depths (n,) mm, and nearest triangles (n,).
    """
    rows = np.flatnonzero(chosen)
    low, high = np.minimum(moves.start, moves.end)[rows], np.maximum(moves.start, moves.end)[rows]
    rows = rows[((low < tree.mesh.bounds[1]) & (high > tree.mesh.bounds[0])).all(axis=1)]
    length = np.linalg.norm((moves.end - moves.start)[rows], axis=1)
    step = max(STEP, float(length.sum()) / MAX_BALLS)
    count = np.ceil(length / step).astype(np.int64) + 1
    of = np.repeat(np.arange(len(rows)), count)
    nth = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    share = np.clip(nth / np.maximum(count - 1, 1)[of], 0.0, 1.0)[:, None]
    tips = np.round(moves.start[rows[of]] + share * (moves.end - moves.start)[rows[of]], 6)
    tips, which = np.unique(tips, axis=0, return_index=True)
    depth, triangle, _ = nearest(tree, tips)
    deep = np.flatnonzero(depth > tolerance)
    deep = deep[inside_part(tree, tips[deep])]
    return tips[deep], rows[of[which[deep]]], depth[deep], triangle[deep]


def rapid_presses(tree: TriangleTree, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup) -> F64:
    """Contacts of ends of cutters with the part in rapids, where the rapid clearance is below ``GUARD_SPACING``.

    With more clearance the points of the part tell of every rapid that comes as near.

    Returns (e, 7) float64, mm, setup frame, rows of events as in ``verify.kernels.stock``.
    """
    out = [np.zeros((0, 7))]
    if setup.clearance_rapid >= GUARD_SPACING or moves.feed.all():
        return out[0]
    clear, tolerance = setup.clearance_rapid, setup.gouge_tolerance
    for k, tool in enumerate(tools):
        mine = ~moves.feed & (moves.tool == k)
        if tool.cone_height > 0.0 and tool.tip_diameter <= 0.0:
            tips, row, depth, _ = _sunk_tips(tree, moves, mine, tolerance)
            out.append(_contacts(row, depth, clear, tips))
        fed = replace(moves, feed=mine)
        rows, share, _ = _ways(fed, k, tool, tree.mesh.bounds)
        row = np.concatenate([rows, np.flatnonzero(mine)])
        share = np.concatenate([share, np.ones(int(mine.sum()))])
        tip, axis = _posed(moves, row, share)
        for ring in (*_ends(tool), *_rims(tool), *_upper_rims(tool)):
            feet, pose = _pressed_poses(tree, tip, axis, ring, tolerance)
            out.append(_contacts(row[pose], feet.depth, clear, feet.points))
    return np.concatenate(out)


def _contacts(row: INT, depth: F64, clear: float, at: F64) -> F64:
    """Events of the cutting part in moves, (n, 7), the deepest of each move."""
    order = np.lexsort((-depth, row))
    order = order[np.unique(row[order], return_index=True)[1]]
    return np.column_stack([row[order], np.full(len(order), float(CUTTER)), clear + depth[order],
                            np.full(len(order), clear), at[order]])


def end_depths(tree: TriangleTree, moves: Moves, rows: INT, tools: Sequence[ToolBody],
               tolerance: float) -> tuple[F64, F64, INT]:
    """How deep the ends of mills go into the part on some moves.

    rows      : (k,) int64, index, the moves; tools : those that ``Moves.tool`` refers to
    tolerance : mm; what is less deep counts 0

    Returns
    -------
    depth    : (k,) float64, mm, largest distance of a place of the end, inside the part, from the surface
    place    : (k, 3) float64, mm, setup frame, the place of the surface nearest to it
    triangle : (k,) int64, index of its triangle, -1 where the depth is 0

    Notes
    -----
    Places are the middle of the end and eight on its rim, of a corner eight at each of three heights, in steps of half
    a radius along the move and at both ends of it. Too small by 8 % of the radius at most on a move straight down.
    """
    depth, place, triangle = np.zeros(len(rows)), np.zeros((len(rows), 3)), np.full(len(rows), -1, np.int64)
    radius = np.array([t.radius for t in tools])[moves.tool[rows]]
    count = np.ceil(np.linalg.norm((moves.end - moves.start)[rows], axis=1) / (0.5 * radius)).astype(np.int64) + 1
    ends = np.cumsum(count)
    first = 0
    while first < len(rows):
        last = max(int(np.searchsorted(ends, ends[first] - count[first] + PATH_BATCH, side="right")), first + 1)
        chosen = rows[first:last]
        tip, z, of = path_places(moves.only(chosen), count[first:last])
        near = _near_surface(tree, tip, z, of, moves.tool[chosen], tools)
        tip, z, of = tip[near], z[near], of[near]
        tool = moves.tool[chosen][of]
        for k in np.unique(tool).tolist():
            mine = np.flatnonzero(tool == k)
            for at in _end_places(tip[mine], z[mine], tools[k]):
                away, row, foot = nearest(tree, at)
                deep = np.flatnonzero(away > np.maximum(depth[first:last][of[mine]], tolerance))
                deep = deep[inside_part(tree, at[deep])]
                deep = deep[np.lexsort((deep, -away[deep], of[mine[deep]]))]
                move, one = np.unique(of[mine[deep]], return_index=True)
                best = deep[one]
                depth[first + move], place[first + move], triangle[first + move] = away[best], foot[best], row[best]
        first = last
    return depth, place, triangle


def _near_surface(tree: TriangleTree, tip: F64, z: F64, of: INT, tool: NDArray[np.int32],
                  tools: Sequence[ToolBody]) -> NDArray[np.bool_]:
    """(n,) bool: places of moves that come so near to the surface somewhere that their end may go through it.

    tip, z : (n, 3) float64, mm and unit; of : (n,) int64, index, the move of each; tool : (m,) int32, index, of moves
    """
    corner, radius = (np.array(v)[tool][of] for v in (
        [t.corner_radius if t.arcs is None else 0.5 * t.end_height for t in tools],
        [t.radius if t.arcs is None else math.hypot(t.radius, 0.5 * t.end_height) for t in tools]))
    away, _, _ = nearest(tree, tip + corner[:, None] * z, float(radius.max(initial=0.0)))
    ball = corner >= radius - 1e-9
    through = np.zeros(len(tool), np.bool_)
    through[of[away < np.where(ball, radius - 1e-4, radius)]] = True
    return through[of]


def _end_places(tip: F64, z: F64, tool: ToolBody) -> list[F64]:
    """Places of the end of a tool with its tip on (n, 3), mm, and its axis along (n, 3): each an (n, 3) array."""
    out = [tip]
    if tool.cone_height > 0.0:
        return out
    x = square_to(z)
    y = np.cross(z, x)
    corner, arcs = tool.corner_radius, tool.arcs
    tilts = TILTS if corner > 0.0 else TILTS[:1]
    places = [(tool.radius - corner * (1.0 - math.sin(t)), corner * (1.0 - math.cos(t))) for t in tilts] \
        if arcs is None else [arcs.at_sine(s) for s in (0.5 * arcs.join_sine, arcs.join_sine,
                                                        0.5 * (arcs.join_sine + arcs.end_sine), arcs.end_sine)]
    for wide, high in places:
        if wide > 0.0:
            out += [tip + wide * (math.cos(t) * x + math.sin(t) * y) + high * z
                    for t in (2.0 * math.pi * np.arange(ENDS_AROUND) / ENDS_AROUND).tolist()]
    return out
