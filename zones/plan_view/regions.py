"""Region of each point of the surface: SCZ and SCZI of [Arivazhagan2020].

A region is a channel, the outside of a wall, a connection, wall tops, floor or free surface. The cells of the plan
view (``zones.plan_view.plan_map``) decide which channel a point of a wall side faces. They also decide whether the
point lies under or over the footprint of a connection: then it is SCZI, else SCZ. A region in several places with walls
between them becomes one region for each place (``zones.plan_view.region_splitting``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.part import Part
from zones.features.connection_faces import connection_faces, face_bases
from zones.model import Decomposition
from zones.plan_view.channel_plan import ChannelPlan, footprints
from zones.plan_view.channel_strips import CLEAR
from zones.plan_view.plan_map import PlanMap


@dataclass(frozen=True)
class Region:
    """A cell of the split: the base region of a point, and the connections above and below it.

    base  : 'H1' a channel, 'W1' the outside of a wall, 'C1' a connection, 'top', 'floor' or 'free'
    over  : connections below the point, along the access
    under : connections above the point
    place : number of the place of the base (``zones.plan_view.region_splitting``), 1, 2 ...; 0 is the open or only one
    """

    base: str
    over: tuple[str, ...] = ()
    under: tuple[str, ...] = ()
    place: int = 0

    @property
    def ground(self) -> str:
        """The base with its place: 'H1', or 'H1.2' where it has several."""
        return f"{self.base}.{self.place}" if self.place else self.base

    @property
    def name(self) -> str:
        """'H1', or 'H1.2 over C1', or 'floor under C1 C2'."""
        words = [self.ground]
        for word, ids in (("over", self.over), ("under", self.under)):
            if ids:
                words += [word, *ids]
        return " ".join(words)

    @property
    def connections(self) -> tuple[str, ...]:
        """The connections that make it SCZI."""
        own = (self.base,) if self.base.startswith("C") else ()
        return tuple(sorted({*own, *self.over, *self.under}, key=lambda c: int(c[1:])))

    @property
    def kind(self) -> str:
        """'SCZI' on, under or over a connection, else 'SCZ'."""
        return "SCZI" if self.connections else "SCZ"


def base_of(name: str) -> str:
    """The base in the name of a region: 'H1' of 'H1.2 over C1'."""
    return name.split()[0].split(".")[0]


def place_of(name: str) -> int:
    """The place in the name of a region: 2 of 'H1.2 over C1', 0 where it names none."""
    return int(name.split()[0].partition(".")[2] or 0)


def connections_of(name: str) -> list[str]:
    """The connections in the name of a region: C1 and C2 of 'H1 over C1 C2', C1 of 'C1'."""
    return [w for w in name.split() if w.startswith("C")]


@dataclass(frozen=True, eq=False)
class Labels:
    """Regions of n points: ``regions[code[i]]`` is that of point i. code : (n,) int64, index."""

    regions: tuple[Region, ...]
    code: NDArray[np.int64]

    def subset(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Labels:
        """The labels of some points. rows : (k,) int64, index, or (n,) bool."""
        return Labels(self.regions, self.code[rows])

    @property
    def names(self) -> NDArray[np.object_]:
        """(n,) object, str: name of the region of each point."""
        return np.array([r.name for r in self.regions], dtype=object)[self.code] if len(self.code) else \
            np.zeros(0, dtype=object)


class RegionLocator:
    """Labels points of a part along one access direction.

    part, decomposition : in the access frame, +Z towards the spindle (the ids of the decomposition count, its heights
                          do not)
    channels            : ChannelPlan of the first access, which owns the split into channels
    first               : whether this is the first access; otherwise footprints are drawn along this access
    """

    def __init__(self, part: Part, decomposition: Decomposition, channels: ChannelPlan, first: bool = True) -> None:
        self.base = face_bases(part, decomposition)
        self.channels = channels
        self.connections = decomposition.connections
        self.plan = channels.plan if first else PlanMap.of(footprints(part, decomposition))
        self.column = [self.plan.names.index(c.id) if c.id in self.plan.names else -1 for c in self.connections]
        self.bases = sorted({*self.base.values(), *channels.names})
        place = {b: k for k, b in enumerate(self.bases)}
        self.table = np.full(max(self.base, default=0) + 1, -1, np.int64)
        self.table[list(self.base)] = [place[b] for b in self.base.values()]
        self.of_channel = np.array([place[c] for c in channels.names], dtype=np.int64)
        self.trees = {c: TriangleTree(_only(part, own)) for c, own in connection_faces(part, decomposition).items()}

    def of(self, points: F64, normals: F64, face: NDArray[np.int32], first: tuple[F64, F64] | None = None) -> Labels:
        """Labels of points of the surface [Arivazhagan2020].

        points, normals : (n, 3) float64 in the access frame, mm and dimensionless
        face            : (n,) int32, index, face numbers
        first           : the same points and normals, both (n, 3) float64, mm and dimensionless, in the frame of the
                          first access; None where that is this one
        """
        there = (points, normals) if first is None else first
        bases, base = self.bases, self.table[face]
        channel = self.channels.channel_of(*there, face)
        base = np.where(channel >= 0, self.of_channel[channel] if len(self.of_channel) else base, base)
        over, under = self._stack(points, normals, base, bases)
        place = self.channels.parting.of_points(*there, base, bases)
        code, example = _distinct(base, place, over, under)
        ids = [c.id for c in self.connections]
        regions = tuple(Region(bases[base[k]], tuple(c for c, on in zip(ids, over[k], strict=True) if on),
                               tuple(c for c, on in zip(ids, under[k], strict=True) if on), int(place[k]))
                        for k in example.tolist())
        return Labels(regions, code)

    def _stack(self, points: F64, normals: F64, base: NDArray[np.int64],
               bases: list[str]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(n, connections) bool twice: the connection lies below, above the point, within its footprint."""
        covered = self.plan.over_at(points[:, :2] + CLEAR * normals[:, :2])[:, self.column]
        covered &= np.array(self.column, dtype=np.int64) >= 0
        under = np.zeros_like(covered)
        for k, c in enumerate(self.connections):
            if c.id in bases:  # a connection does not lie over itself
                covered[base == bases.index(c.id), k] = False
            rows = np.flatnonzero(covered[:, k])
            if len(rows):
                start = points[rows] + CLEAR * normals[rows]
                _, hit = first_hits(self.trees[c.id], start, (0.0, 0.0, 1.0))
                under[rows, k] = np.asarray(hit) >= 0
        return covered & ~under, under


def _distinct(base: NDArray[np.int64], place: NDArray[np.int64], over: NDArray[np.bool_],
              under: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number of each distinct combination (n,), in order of base, place and connections, and a row with it."""
    key = base * (int(place.max(initial=0)) + 1) + place
    for k in range(over.shape[1]):
        key = 3 * key + over[:, k] + 2 * under[:, k]
        if k % 16 == 15:  # before the numbers overflow
            key = np.unique(key, return_inverse=True)[1].reshape(-1)
    _, first, code = np.unique(key, return_index=True, return_inverse=True)
    return np.asarray(code, np.int64).reshape(-1), first


def _only(part: Part, faces: tuple[int, ...]) -> TriangleMesh:
    keep = np.isin(part.mesh.face_ids, faces)
    return TriangleMesh(part.mesh.vertices, part.mesh.faces[keep], part.mesh.face_ids[keep])
