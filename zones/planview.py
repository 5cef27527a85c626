"""What is drawn in plan: wall traces, channels with their centre lines and ends, footprints of connections.

1. Every side of a wall is cut at mid height (``zones.sections``): its trace.
2. From points along a trace level rays go out; connections, fillets and slivers let them through. A run of
   neighbouring rays that meet one other wall is a strip of a channel; its first and last ray are its ends, the
   middles of its rays the centre line. Where a connection, or a hole no longer than the channel is wide, takes a wall
   away, the strip goes on straight.
3. The strips a pair of walls sends to each other are one area, the channel.
4. A footprint is what the faces of a connection cover, seen along the access.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry.bvh import TriangleTree
from geometry.mesh import F64, TriangleMesh
from geometry.part import Part
from geometry.rays import first_hits
from zones.model import Channel, Decomposition
from zones.planmap import Area, PlanMap
from zones.sections import SideCurve, wall_sections

CLEAR = 0.02  # mm off the surface where a look-up is made, so that it does not fall on the border itself
FAR = 0.3  # of the least gap: how far off the next trial is, where a leaning wall hides its channel from above
PITCH = 0.4  # mm between rays along a trace
FACING = -0.3  # n1·n2 below: two sides face each other
UPRIGHT = 0.3  # |n_xy| below: no side to slide along
CLOSE = 1e-6  # mm, what union leaves open between strips


@dataclass(frozen=True, eq=False)
class Strip:
    """A run of rays from one wall to another: starts and feet, (k, 2) float64, mm, k >= 2."""

    channel: str
    start: F64
    foot: F64

    @property
    def centre_line(self) -> F64:
        """(k, 2) float64, mm."""
        return np.asarray(0.5 * (self.start + self.foot))

    @property
    def area(self) -> shapely.Geometry:
        """What the rays sweep, as quadrilaterals between neighbours; crossed ones count as the two triangles."""
        a, b, c, d = self.start[:-1], self.start[1:], self.foot[1:], self.foot[:-1]
        ring = np.stack([a, b, c, d, a], axis=1)
        return shapely.union_all(shapely.make_valid(shapely.polygons(ring)))


@dataclass(frozen=True, eq=False)
class ChannelPlan:
    """The plan view of the first access, cut into cells.

    plan     : PlanMap over channels, walls and footprints
    names    : ids of the channels
    curves   : sides of the walls at mid height
    of_wall  : channels of each wall, as a mask over ``names``
    wall     : (faces + 1,) int, row in ``of_wall`` of the wall a face is a side of, -1 for other faces
    height   : (walls,) float64, mm, where each wall was cut
    gap      : (walls,) float64, mm, least gap of the channels of each wall
    faced    : per curve the share of its length that faces each channel
    shadows  : footprints of the connections by id
    """

    plan: PlanMap
    names: tuple[str, ...]
    curves: tuple[SideCurve, ...]
    of_wall: NDArray[np.bool_]
    wall: NDArray[np.int64]
    height: F64
    gap: F64
    faced: tuple[dict[str, float], ...]
    shadows: dict[str, shapely.Geometry]

    @staticmethod
    def of(part: Part, decomposition: Decomposition) -> ChannelPlan:
        """Draw and cut the plan view.

        part, decomposition : in the frame of the first access, mm
        """
        d = decomposition
        curves = wall_sections(part, d)
        shadows = footprints(part, d)
        strips, faced = _strips(part, d, curves, shadows)
        names = tuple(c.id for c in d.channels)
        areas = [Area(n, shapely.union_all([s.area for s in strips if s.channel == n]).buffer(CLOSE)) for n in names]
        areas += _traces(d, curves) + shadows
        plan = PlanMap.of([a for a in areas if not a.shape.is_empty], [s.centre_line for s in strips])
        of_wall = np.array([[w.id in c.walls for c in d.channels] for w in d.walls], bool)
        of_wall = of_wall.reshape(len(d.walls), len(names))
        wall = np.full(len(part.faces) + 1, -1, np.int64)
        for k, w in enumerate(d.walls):
            wall[list(w.sides)] = k
        height = np.array([_cut_height(w.id, curves, 0.5 * (w.z_bottom + w.z_top)) for w in d.walls])
        gap = np.array([min((c.gap_min for c in d.channels if w.id in c.walls), default=np.inf) for w in d.walls])
        return ChannelPlan(plan, names, curves, of_wall, wall, height, gap, faced, {a.name: a.shape for a in shadows})

    def channel_of(self, points: F64, normals: F64, face: NDArray[np.int32]) -> NDArray[np.int64]:
        """(n,) row in ``names`` of the channel that each point of a wall side faces, -1 for none.

        points, normals : (n, 3) float64 in the frame of the first access, mm and unit
        face            : (n,) face numbers

        A point is slid along its tangent plane to the height its wall was cut at, and looked up just off the wall;
        a point of a side that no channel cell answers for there is tried farther off.
        """
        out = np.full(len(points), -1, np.int64)
        wall = self.wall[face]
        level = np.linalg.norm(normals[:, :2], axis=1)
        rows = np.flatnonzero((wall >= 0) & (level > UPRIGHT))
        if not len(rows) or not len(self.by_size):
            return out
        side = normals[rows, :2] / level[rows, None]
        rise = self.height[wall[rows]] - points[rows, 2]
        foot = points[rows, :2] - (normals[rows, 2] * rise / level[rows])[:, None] * side
        order = self.by_size
        column = np.array([self.plan.names.index(self.names[k]) for k in order], dtype=np.int64)
        for share in (0.0, 0.5, 1.0):
            todo = np.flatnonzero(out[rows] < 0)
            if not len(todo):
                break
            k = rows[todo]
            reach = np.maximum(CLEAR, share * FAR * np.where(np.isfinite(self.gap), self.gap, 0.0)[wall[k]])
            over = self.plan.over_at(foot[todo] + reach[:, None] * side[todo])
            mine = over[:, column] & self.of_wall[wall[k]][:, order]
            out[k] = np.where(mine.any(axis=1), order[mine.argmax(axis=1)], -1)
        return out

    @property
    def by_size(self) -> NDArray[np.int64]:
        """Rows of the channels that are drawn, the largest in plan first: where two overlap, it has the cell."""
        size = {n: float(self.plan.faces.areas[self.plan.over[:, k]].sum()) for k, n in enumerate(self.plan.names)}
        drawn = [k for k, n in enumerate(self.names) if n in size]
        return np.array(sorted(drawn, key=lambda k: (-round(size[self.names[k]], 3), k)), dtype=np.int64)


def footprints(part: Part, decomposition: Decomposition) -> list[Area]:
    """What each connection covers in plan, seen along +Z of the frame of the part."""
    return [Area(c.id, _shadow(part, c.faces)) for c in decomposition.connections]


def _shadow(part: Part, faces: Sequence[int]) -> shapely.Geometry:
    t = part.mesh.triangles[np.isin(part.mesh.face_ids, faces)][:, :, :2]
    e, f = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    wide = np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]) > 1e-9
    ring = np.concatenate([t[wide], t[wide][:, :1]], axis=1)
    return shapely.union_all(shapely.polygons(ring)).buffer(0.0)


def _traces(decomposition: Decomposition, curves: Sequence[SideCurve]) -> list[Area]:
    """Outline of each wall at the height it was cut: its sides in turn, or a ring between two closed ones."""
    out = []
    for w in decomposition.walls:
        mine = [c.points for c in curves if c.wall == w.id]
        rings = [shapely.Polygon(c.points) for c in curves if c.wall == w.id and c.closed and len(c.points) > 2]
        if rings:
            shape = shapely.make_valid(max(rings, key=lambda r: r.area))
            for hole in sorted(rings, key=lambda r: -r.area)[1:]:
                shape = shape.difference(shapely.make_valid(hole))
        elif mine and sum(map(len, mine)) > 2:
            shape = shapely.make_valid(shapely.Polygon(np.concatenate(mine)))
        else:
            continue
        out.append(Area(w.id, shape))
    return out


def _cut_height(wall: str, curves: Sequence[SideCurve], middle: float) -> float:
    return next((c.z for c in curves if c.wall == wall), middle)


def _strips(part: Part, decomposition: Decomposition, curves: Sequence[SideCurve],
            shadows: Sequence[Area]) -> tuple[list[Strip], tuple[dict[str, float], ...]]:
    """Strips of all sides, and per side the share of its rays in each channel."""
    d = decomposition
    through = {f for c in d.connections for f in c.faces} | {f.number for f in part.faces if f.sliver}
    through |= {f for f, role in d.face_role.items() if role == "fillet"}
    keep = ~np.isin(part.mesh.face_ids, sorted(through))
    mesh = TriangleMesh(part.mesh.vertices, part.mesh.faces[keep], part.mesh.face_ids[keep])
    tree = TriangleTree(mesh)
    owner = {f: w.id for w in d.walls for f in w.sides}
    channel = {frozenset(c.walls): c for c in d.channels}
    skin = 1e-6 * float(np.linalg.norm(part.bounds[1] - part.bounds[0]))
    holes = shapely.union_all([a.shape for a in shadows]).buffer(CLEAR)
    out: list[Strip] = []
    faced = []
    for curve in curves:
        found, names = _strips_of(curve, mesh, tree, owner, channel, holes, skin)
        out += found
        faced.append({n: names.count(n) / len(names) for n in sorted({s.channel for s in found})})
    return out, tuple(faced)


def _strips_of(curve: SideCurve, mesh: TriangleMesh, tree: TriangleTree, owner: dict[int, str],
               channel: dict[frozenset[str], Channel], holes: shapely.Geometry,
               skin: float) -> tuple[list[Strip], list[str]]:
    """Strips of one side, and the channel of each of its rays ('' for none)."""
    start, normal = spread(curve.points, curve.closed, PITCH)
    if len(start) < 2:
        return [], []
    inset = start.copy()
    if not curve.closed:  # a ray from the very end of a side would graze the end of the one it meets
        inset[0] += CLEAR * np.array([normal[0, 1], -normal[0, 0]])
        inset[-1] -= CLEAR * np.array([normal[-1, 1], -normal[-1, 0]])
    origin = np.column_stack([inset, np.full(len(start), curve.z)])
    way = np.column_stack([normal, np.zeros(len(start))])
    far, hit = first_hits(tree, origin, way, max(skin, CLEAR))
    facing = np.einsum("ij,ij->i", mesh.normals[hit], way) < FACING
    met = ["" if h < 0 or not ok else owner.get(int(mesh.face_ids[h]), "")
           for h, ok in zip(np.asarray(hit).tolist(), facing.tolist(), strict=True)]
    named = [channel[pair].id if m and (pair := frozenset((curve.wall, m))) in channel else "" for m in met]
    length = np.where(np.isfinite(far), far, 0.0)
    _bridge(named, length, shapely.contains_xy(holes, start[:, 0], start[:, 1]), curve.closed)
    foot = start + length[:, None] * normal
    runs = [run for run in _runs(named, curve.closed) if len(run) > 1]
    return [Strip(named[run[0]], start[run], foot[run]) for run in runs], named


def _bridge(names: list[str], length: F64, hole: NDArray[np.bool_], closed: bool) -> None:
    """Name rays that no wall stopped after the strip on both sides of them, in place; lengths go on straight.

    names, length (mm) : of the rays in order; hole : (n,) bool, rays that leave a wall where a connection ends at it
    """
    n = len(names)
    hits = [k for k in range(n) if names[k]]
    pairs = list(pairwise(hits)) + ([(hits[-1], hits[0] + n)] if closed and len(hits) > 1 else [])
    for a, b in pairs:
        between = [k % n for k in range(a + 1, b)]
        ends = length[a], length[b % n]
        if between and names[a] == names[b % n] and (hole[between].all() or len(between) * PITCH <= max(ends)):
            for j, k in enumerate(between, start=1):
                names[k] = names[a]
                length[k] = ends[0] + (ends[1] - ends[0]) * j / (len(between) + 1)


def _runs(names: Sequence[str], closed: bool) -> list[list[int]]:
    """Runs of equal names that are not empty, in order; round the end where the curve is closed."""
    runs: list[list[int]] = []
    for k, name in enumerate(names):
        if name and runs and runs[-1][-1] == k - 1 and names[runs[-1][-1]] == name:
            runs[-1].append(k)
        elif name:
            runs.append([k])
    if closed and runs and names[0] and names[0] == names[-1]:
        if len(runs) == 1:
            runs[0] = [*runs[0], 0]
        else:
            runs[0] = [*runs.pop(), *runs[0]]
    return runs


def spread(points: F64, closed: bool, pitch: float) -> tuple[F64, F64]:
    """Evenly spaced points along a polyline and the unit normals to its left, (k, 2) float64 each.

    points : (n, 2) float64, mm; the last joins the first where ``closed``
    """
    line = np.vstack([points, points[:1]]) if closed else points
    step = np.diff(line, axis=0)
    length = np.linalg.norm(step, axis=1)
    keep = length > 0
    line, step, length = line[np.append(keep, True)], step[keep], length[keep]
    if not len(length):
        return np.zeros((0, 2)), np.zeros((0, 2))
    at = np.concatenate([[0.0], np.cumsum(length)])
    count = max(2, int(np.ceil(at[-1] / pitch)) + 1)
    s = np.linspace(0.0, at[-1], count, endpoint=not closed)
    k = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(length) - 1)
    tangent = step[k] / length[k, None]
    return (np.asarray(line[k] + (s - at[k])[:, None] * tangent),
            np.column_stack([-tangent[:, 1], tangent[:, 0]]))
