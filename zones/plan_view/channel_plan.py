"""The plan view of a part: wall traces, channels with their centre lines and ends, footprints of connections.

1. Every side of a wall is cut at mid height (``zones.plan_view.wall_sections``): its trace.
2. Level rays from the traces sweep strips (``zones.plan_view.channel_strips``).
3. The strips between a pair of walls form one area, the channel.
4. A footprint is the area that the faces of a connection and its fillets cover, seen along the access.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.part import Part
from zones.features.connection_faces import connection_faces, face_bases
from zones.model import Decomposition
from zones.plan_view.channel_strips import CLEAR, RayIndex, side_rays
from zones.plan_view.plan_cover import FACES_UP, cover_border, upward
from zones.plan_view.plan_map import PlanArea, PlanMap
from zones.plan_view.region_splitting import Parting
from zones.plan_view.wall_sections import SideCurve, wall_sections

FAR = 0.3  # of the least gap: distance of the next trial, where a leaning wall hides its channel from above
UPRIGHT = 0.3  # |n_xy| below: no side to slide along
CLOSE = 1e-6  # mm, gaps that the union leaves between strips


@dataclass(frozen=True, eq=False)
class ChannelPlan:
    """The plan view of the first access, cut into cells.

    plan     : PlanMap over channels, walls and footprints
    names    : ids of the channels
    curves   : sides of the walls at mid height
    of_wall  : channels of each wall, as a mask over ``names``
    wall     : (faces + 1,) int64, index in ``of_wall`` of the wall that a face is a side of, -1 for other faces
    height   : (walls,) float64, mm, height of the cut through each wall
    gap      : (walls,) float64, mm, least gap of the channels of each wall
    faced    : for each curve the share of its length that faces each channel
    rays     : starts of the rays of all curves, with wall and channel
    shadows  : footprints of the connections by id
    parting  : Parting, gives the place of a point of a region
    """

    plan: PlanMap
    names: tuple[str, ...]
    curves: tuple[SideCurve, ...]
    of_wall: NDArray[np.bool_]
    wall: NDArray[np.int64]
    height: F64
    gap: F64
    faced: tuple[dict[str, float], ...]
    rays: RayIndex
    shadows: dict[str, shapely.Geometry]
    parting: Parting

    @staticmethod
    def of(part: Part, decomposition: Decomposition) -> ChannelPlan:
        """Draw and cut the plan view.

        part, decomposition : in the frame of the first access, mm
        """
        d = decomposition
        curves = wall_sections(part, d)
        shadows = footprints(part, d)
        found = side_rays(part, d, curves, [a.shape for a in shadows])
        strips = [s for f in found for s in f.strips]
        names = tuple(c.id for c in d.channels)
        areas = [PlanArea(n, shapely.union_all([s.area for s in strips if s.channel == n]).buffer(CLOSE))
                 for n in names]
        areas += _traces(d, curves) + shadows
        plan = PlanMap.of([a for a in areas if not a.shape.is_empty], [s.centre_line for s in strips])
        of_wall = np.array([[w.id in c.walls for c in d.channels] for w in d.walls], bool)
        of_wall = of_wall.reshape(len(d.walls), len(names))
        wall = np.full(len(part.faces) + 1, -1, np.int64)
        for k, w in enumerate(d.walls):
            wall[list(w.sides)] = k
        height = np.array([_cut_height(w.id, curves, 0.5 * (w.z_bottom + w.z_top)) for w in d.walls])
        gap = np.array([min((c.gap_min for c in d.channels if w.id in c.walls), default=np.inf) for w in d.walls])
        drawn = {a.name: a.shape for a in areas}
        heights = dict(zip([w.id for w in d.walls], height.tolist(), strict=True))
        parting = Parting.of(part, d, face_bases(part, d), heights, {n: drawn[n] for n in names}, curves)
        return ChannelPlan(plan, names, curves, of_wall, wall, height, gap, tuple(f.faced for f in found),
                           RayIndex.of(d, curves, found, names), {a.name: a.shape for a in shadows}, parting)

    def channel_of(self, points: F64, normals: F64, face: NDArray[np.int32]) -> NDArray[np.int64]:
        """Channel that each point of a wall side faces, (n,) int64, index in ``names``, -1 for none.

        points, normals : (n, 3) float64 in the frame of the first access, mm and dimensionless
        face            : (n,) int32, index, face numbers

        A point slides along its tangent plane to the height at which its wall was cut. The look-up is just off the
        wall, and farther off where it finds no channel. Where a side faces a channel over most of its length, its
        stretches that pass the other wall go to the channel next to them along the side. So a zone does not end in the
        middle of a wall.
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
        todo = np.flatnonzero(out[rows] < 0)
        out[rows[todo]] = self.rays.nearest(foot[todo], side[todo], wall[rows[todo]])
        return out

    @cached_property
    def by_size(self) -> NDArray[np.int64]:
        """(k,) int64, index of the drawn channels, the largest in plan first, which owns the cells of an overlap."""
        size = {n: float(self.plan.faces.areas[self.plan.over[:, k]].sum()) for k, n in enumerate(self.plan.names)}
        drawn = [k for k, n in enumerate(self.names) if n in size]
        return np.array(sorted(drawn, key=lambda k: (-round(size[self.names[k]], 3), k)), dtype=np.int64)


def footprints(part: Part, decomposition: Decomposition) -> list[PlanArea]:
    """Area that each connection covers in plan with its fillets, seen along +Z of the frame of the part."""
    return [PlanArea(c, _shadow(part, faces)) for c, faces in connection_faces(part, decomposition).items()]


def _shadow(part: Part, faces: Sequence[int]) -> shapely.Geometry:
    mesh = part.mesh
    own, slope = np.isin(mesh.face_ids, faces), upward(mesh)
    sides = mesh.faces[own & (slope > FACES_UP)], mesh.faces[own & (slope < -FACES_UP)][:, ::-1]
    covers = [PlanMap.of_cover("side", cover_border(mesh.vertices, f)).shape("side") for f in sides]
    return shapely.union_all(covers).buffer(0.0)


def _traces(decomposition: Decomposition, curves: Sequence[SideCurve]) -> list[PlanArea]:
    """Outline of each wall at the height of its cut: its sides in turn, or a ring between two closed sides."""
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
        out.append(PlanArea(w.id, shape))
    return out


def _cut_height(wall: str, curves: Sequence[SideCurve], middle: float) -> float:
    return next((c.z for c in curves if c.wall == wall), middle)
