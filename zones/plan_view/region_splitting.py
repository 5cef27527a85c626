"""Splits regions by places: a zone is one connected place in plan.

A region belongs to a *level*. The level of a channel is the lower of the heights at which its two walls are cut, since
both stand there. The level of the outside of a wall is that of the wall. Floor and free surface have the lowest level
of the channels. A region owns the places of its level (``zones.plan_view.free_places``) that it overlaps. Wall tops and
connections are never split, since a tool passes over them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.part import Part
from zones.features.connection_faces import connection_faces
from zones.model import Decomposition
from zones.plan_view.free_places import MATERIAL, NARROW, OPEN, FreePlaces, LevelPlaces
from zones.plan_view.wall_sections import SideCurve

OFF = (0.02, 0.1, 0.3)  # mm off the surface: distances of the look-up; after them the nearest place of the region
LEANING = 0.3  # |n_xy| below: no side to slide along
BASES = ("floor", "free")


@dataclass(frozen=True, eq=False)
class Parted:
    """The places of one region.

    level  : mm, in the frame of the first access
    places : LevelPlaces of the level
    own    : numbers of the places that the region overlaps
    slides : its points lie on a side of a wall and slide along it to the level
    """

    level: float
    places: LevelPlaces
    own: tuple[int, ...]
    slides: bool

    def of(self, points: F64, normals: F64) -> NDArray[np.int64]:
        """(n,) int64, index of the place of points: 0 is the open place, or none; 1, 2 ... the others, left to right.

        points, normals : (n, 3) float64, mm and dimensionless, in the frame of the first access
        """
        wide = np.linalg.norm(normals[:, :2], axis=1)
        side = normals[:, :2] / np.maximum(wide, 1e-12)[:, None]
        foot = points[:, :2]
        if self.slides:
            rise = np.where(wide > LEANING, (self.level - points[:, 2]) / np.maximum(wide, LEANING), 0.0)
            foot = foot - (normals[:, 2] * rise)[:, None] * side
        found = np.full(len(points), MATERIAL, np.int64)
        for off in OFF:
            todo = np.flatnonzero(found == MATERIAL)
            there = self.places.at(foot[todo] + off * side[todo])
            found[todo] = np.where(np.isin(there, self.own), there, MATERIAL)
        # a point above the level lies in no place of the level; a point under an overhang does
        lost = np.flatnonzero((found == MATERIAL) & (self.slides | (points[:, 2] <= self.level)))
        if len(lost):
            found[lost] = self.places.nearest(foot[lost], self.own)
        rank = np.cumsum(np.array(self.own) != OPEN)
        return np.where(found > OPEN, rank[np.minimum(np.searchsorted(self.own, found), len(rank) - 1)], OPEN)


@dataclass(frozen=True, eq=False)
class Parting:
    """The places of channels, outsides of walls, floor and free surface, by base."""

    regions: Mapping[str, Parted]

    @staticmethod
    def of(part: Part, decomposition: Decomposition, bases: Mapping[int, str], heights: Mapping[str, float],
           channels: Mapping[str, shapely.Geometry], curves: Sequence[SideCurve]) -> Parting:
        """The places of a part, in the frame of its first access.

        bases    : base region of every face; heights : mm, height of the cut of each wall, by id
        channels : area of each channel in plan, mm; curves : sides of the walls
        """
        d = decomposition
        if not d.channels:
            return Parting({})
        places = FreePlaces.of(part, {f for own in connection_faces(part, d).values() for f in own})
        level = {c.id: min(heights[w] for w in c.walls) for c in d.channels}
        out: dict[str, Parted] = {}

        def add(name: str, z: float, own: Sequence[int], slides: bool) -> None:
            if len(own):
                out[name] = Parted(z, places.at_level(z), tuple(sorted(own)), slides)

        for name, shape in channels.items():
            add(name, level[name], _covered(places.at_level(level[name]), shape), True)
        for w in d.walls:
            traces = [shapely.LineString(c.points) for c in curves if c.wall == w.id and len(c.points) > 1]
            add(w.id, heights[w.id], _covered(places.at_level(heights[w.id]),
                                              shapely.union_all(traces).buffer(OFF[1] + NARROW)), True)
        lowest = min(level.values())
        for name in BASES:
            mine = np.isin(part.mesh.face_ids, [f for f, b in bases.items() if b == name])
            middle, normal = part.mesh.triangles[mine].mean(axis=1), part.mesh.normals[mine]
            there = places.at_level(lowest).at(middle[:, :2] + OFF[0] * normal[:, :2])
            add(name, lowest, np.unique(there[there != MATERIAL]).tolist(), False)
        return Parting(out)

    def of_points(self, points: F64, normals: F64, base: NDArray[np.int64], bases: Sequence[str]) -> NDArray[np.int64]:
        """(n,) int64, index of the place of each point in its region, 0 where the region has only one.

        points, normals : (n, 3) float64, mm and dimensionless, in the frame of the first access
        base            : (n,) int64, index in ``bases``
        """
        out = np.zeros(len(points), np.int64)
        for k, name in enumerate(bases):
            if name in self.regions and len(self.regions[name].own) > 1:
                rows = np.flatnonzero(base == k)
                out[rows] = self.regions[name].of(points[rows], normals[rows])
        return out

    def beside(self, base: str, place: int, xy: F64) -> NDArray[np.int64]:
        """(n,) int64, count: 1 where points off the sides of a region lie in the place, -1 in other places, else 0.

        xy : (n, 2) float64, mm, in plan, in the frame of the first access
        """
        if base not in self.regions:
            return np.ones(len(xy), np.int64)
        r = self.regions[base]
        here = r.own[0] if len(r.own) == 1 else OPEN if place == OPEN else [k for k in r.own if k != OPEN][place - 1]
        there = r.places.at(xy)
        return np.where(there == MATERIAL, 0, np.where(there == here, 1, -1))


def _covered(places: LevelPlaces, shape: shapely.Geometry) -> list[int]:
    """Numbers of the places that a shape overlaps."""
    return [k for k, outline in places.outlines.items()
            if not shapely.intersection(outline, shape).buffer(-NARROW).is_empty]
