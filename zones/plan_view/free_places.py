"""Places of the plan view: connected areas in which a tool moves at a level without lifting over material.

Material above a level, without connections, covers part of the plan. The rest falls into the cells of a plan map
(``zones.plan_view.plan_map``), trapezoids joined across the edges they share. These cells are the places of the level.
Two cells that touch in a point are two places. A connection does not split a place, since the tool passes above it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from geometry.part import Part
from zones.plan_view.plan_cover import FACES_UP, cover_border, upward
from zones.plan_view.plan_map import PlanMap

MATERIAL = -1  # number of cells under material above the level
OPEN = 0  # number of the place outside all material
NARROW = 0.05  # mm, half the diameter of the thinnest tool; a narrower cell is not a place
STEP = 1e-3  # mm, nearer levels count as one
NOTHING = shapely.Polygon()


@dataclass(frozen=True, eq=False)
class LevelPlaces:
    """The places of one level.

    plan   : PlanMap of the material above it, mm, in plan of the access frame
    number : (cells,) int64, place of each cell, ``OPEN``, 1, 2 ... from left to right, or ``MATERIAL``
    sides  : cache of ``nearest``: outlines of the places, and the place of each
    """

    plan: PlanMap
    number: NDArray[np.int64]
    sides: dict[tuple[int, ...], tuple[shapely.STRtree, NDArray[np.int64]]] = field(default_factory=dict)

    @staticmethod
    def of(border: F64, spans: shapely.Geometry = NOTHING) -> LevelPlaces:
        """The places that material leaves free; a place wholly under ``spans`` does not count.

        border : (k, 2, 2) float64, mm, directed borders of the material in plan of the access frame
        """
        plan = PlanMap.of_cover("material", border)
        number = np.full(len(plan.over), MATERIAL, np.int64)
        number[0] = OPEN
        count = 0
        for k in np.flatnonzero(~plan.over[:, 0]).tolist():
            if k and not plan.map.outline(plan.faces, k).difference(spans).buffer(-NARROW).is_empty:
                count += 1
                number[k] = count
        return LevelPlaces(plan, number)

    def at(self, xy: F64) -> NDArray[np.int64]:
        """(n,) int64, index of the place at each position, or ``MATERIAL``. xy : (n, 2) float64, mm, in plan."""
        cell = self.plan.cell_at(xy)
        return np.where(cell >= 0, self.number[cell], OPEN)

    @cached_property
    def outlines(self) -> dict[int, shapely.Geometry]:
        """Polygons of the places by number, mm."""
        cells = np.flatnonzero(self.number != MATERIAL)
        return {int(self.number[k]): self.plan.map.outline(self.plan.faces, int(k)) for k in cells.tolist()}

    def nearest(self, xy: F64, numbers: tuple[int, ...]) -> NDArray[np.int64]:
        """(n,) int64, index of the nearest of the places ``numbers``. xy : (n, 2) float64, mm, in plan."""
        if numbers not in self.sides:
            rings = [shapely.get_parts(self.outlines[k].boundary) for k in numbers]
            owner = np.repeat(numbers, [len(own) for own in rings])
            corners, ring = shapely.get_coordinates(np.concatenate(rings), return_index=True)
            on = ring[1:] == ring[:-1]
            lines = shapely.linestrings(np.stack([corners[:-1][on], corners[1:][on]], axis=1))
            self.sides[numbers] = shapely.STRtree(lines), owner[ring[:-1][on]]
        tree, owner = self.sides[numbers]
        inside = self.at(xy)
        out = owner[tree.nearest(shapely.points(xy))]
        return np.where(np.isin(inside, numbers), inside, out)


@dataclass(frozen=True, eq=False)
class FreePlaces:
    """The places of a part at any level.

    vertices : (n, 3) float64, mm
    faces    : (m, 3) int32, index, triangles that face up, without connections
    spans    : area of the connections in plan, mm; where they end at a leaning wall, the cover of the wall has a hole
    """

    vertices: F64
    faces: I32
    spans: shapely.Geometry
    known: dict[int, LevelPlaces] = field(default_factory=dict)

    @staticmethod
    def of(part: Part, spans: Iterable[int]) -> FreePlaces:
        """The places of a part, mm, access along +Z; ``spans`` are the faces of its connections with their fillets."""
        mesh = part.mesh
        up = upward(mesh) > FACES_UP
        span = np.isin(mesh.face_ids, list(spans))
        covered = PlanMap.of_cover("spans", cover_border(mesh.vertices, mesh.faces[up & span])).shape("spans")
        return FreePlaces(mesh.vertices, mesh.faces[up & ~span], covered.buffer(NARROW))

    def at_level(self, level: float) -> LevelPlaces:
        """The places at a level, mm."""
        key = round(level / STEP)
        if key not in self.known:
            self.known[key] = LevelPlaces.of(cover_border(self.vertices, self.faces, key * STEP), self.spans)
        return self.known[key]
