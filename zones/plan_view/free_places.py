"""Places of the plan view: where a tool may go at a level without being lifted over what stands there.

What stands above a level, connections left out, covers part of the plan. The rest falls into the cells of a plan map
(``zones.plan_view.plan_map``), trapezoids joined across the edges they share: these are the places of the level. Two that touch
in a point are two. A connection does not part a place, for what it stops below goes on above it.
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

MATERIAL = -1  # number of what lies under something that stands above the level
OPEN = 0  # number of the place outside all that stands
NARROW = 0.05  # mm: half the diameter of the thinnest tool that is ever asked for; narrower is no place
STEP = 1e-3  # mm, levels nearer than this are one
NOTHING = shapely.Polygon()


@dataclass(frozen=True, eq=False)
class LevelPlaces:
    """The places of one level.

    plan   : PlanMap of what stands above it
    number : (cells,) int64, place of each cell, ``OPEN``, 1, 2 ... from left to right, or ``MATERIAL``
    sides  : of places asked for by ``nearest``, the lines round them and whose they are
    """

    plan: PlanMap
    number: NDArray[np.int64]
    sides: dict[tuple[int, ...], tuple[shapely.STRtree, NDArray[np.int64]]] = field(default_factory=dict)

    @staticmethod
    def of(border: F64, spans: shapely.Geometry = NOTHING) -> LevelPlaces:
        """The places left by what stands in ``border`` (k, 2, 2), directed, mm; what lies all under ``spans`` is none.
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
        """(n,) number of the place at each of xy (n, 2) mm, or ``MATERIAL``."""
        cell = self.plan.cell_at(xy)
        return np.where(cell >= 0, self.number[cell], OPEN)

    @cached_property
    def outlines(self) -> dict[int, shapely.Geometry]:
        """Polygons of the places by number, mm."""
        cells = np.flatnonzero(self.number != MATERIAL)
        return {int(self.number[k]): self.plan.map.outline(self.plan.faces, int(k)) for k in cells.tolist()}

    def nearest(self, xy: F64, of: tuple[int, ...]) -> NDArray[np.int64]:
        """(n,) which of the places named is nearest to each of xy (n, 2) mm."""
        if of not in self.sides:
            rings = [shapely.get_parts(self.outlines[k].boundary) for k in of]
            owner = np.repeat(of, [len(own) for own in rings])
            corners, ring = shapely.get_coordinates(np.concatenate(rings), return_index=True)
            on = ring[1:] == ring[:-1]
            lines = shapely.linestrings(np.stack([corners[:-1][on], corners[1:][on]], axis=1))
            self.sides[of] = shapely.STRtree(lines), owner[ring[:-1][on]]
        tree, owner = self.sides[of]
        inside = self.at(xy)
        out = owner[tree.nearest(shapely.points(xy))]
        return np.where(np.isin(inside, of), inside, out)


@dataclass(frozen=True, eq=False)
class FreePlaces:
    """The places of a part at any level.

    vertices : (n, 3) float64, mm; faces : (m, 3), indices of what faces up, without connections
    spans    : what connections cover in plan, mm; where they end at a leaning wall there is a hole in what it covers
    """

    vertices: F64
    faces: I32
    spans: shapely.Geometry
    known: dict[int, LevelPlaces] = field(default_factory=dict)

    @staticmethod
    def of(part: Part, spans: Iterable[int]) -> FreePlaces:
        """Of a part, mm, the access along +Z; ``spans`` are the faces of its connections with their fillets."""
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
