"""Categorised computable zones (CCZ): profile type and level of a region, from its walls in plan [Arivazhagan2020].

A channel has the profiles of the sides that face it. The outside of a wall has those of the sides that face no channel.
An SCZI cell or a connection has those of the stretches of sides that it touches. The most complex profile counts for
the zone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from geometry.mesh import F64
from zones.plan_view.channel_plan import ChannelPlan
from zones.plan_view.channel_strips import FACING_SHARE, PITCH, runs_of, spread
from zones.plan_view.profile_types import CurveProfile, Level, classify
from zones.plan_view.regions import base_of, connections_of, place_of
from zones.plan_view.wall_sections import SideCurve

RANK = {Level.SIMPLE: 0, Level.MEDIUM: 1, Level.HIGH: 2}
NEAR = 0.05  # mm around a footprint: a side within it counts as touched
MIN_POINTS = 4
LOOK = 0.1  # mm off a side: distance at which its place is looked up
ELSEWHERE = 0.02  # of a side: a smaller share in other places does not split it, since its ends stand at other walls


@dataclass(frozen=True, eq=False)
class WallSideProfile:
    """The profile of one side of a wall, or of a stretch of it."""

    wall: str
    curve: SideCurve
    profile: CurveProfile


@dataclass(frozen=True, eq=False)
class Category:
    """The sides that decide the type of a zone, the most complex first."""

    sides: tuple[WallSideProfile, ...] = ()

    @property
    def profile(self) -> CurveProfile | None:
        """Profile of the most complex side; None where the region has no side."""
        return self.sides[0].profile if self.sides else None

    @property
    def rank(self) -> int:
        """0 simple, 1 medium, 2 high; 0 for regions without a side."""
        return RANK[self.profile.level] if self.profile else 0


class Categories:
    """Profiles of regions by their names; each side is fitted once."""

    def __init__(self, plan: ChannelPlan) -> None:
        self.plan = plan
        self.known: dict[str, Category] = {}

    @cached_property
    def whole(self) -> tuple[WallSideProfile, ...]:
        """The profile of every side."""
        return tuple(WallSideProfile(c.wall, c, classify(c.points, c.closed)) for c in self.plan.curves)

    def of(self, region: str) -> Category:
        """Category of a region, by its name: 'H1', 'H1.2', 'W2', 'C1', 'H1 over C2', 'floor'."""
        if region not in self.known:
            base, place, connections = base_of(region), place_of(region), connections_of(region)
            sides = self._touched(base, connections) if connections else self._of_place(base, place)
            self.known[region] = Category(tuple(sorted(sides, key=lambda s: (
                -RANK[s.profile.level], -len(s.profile.bends), s.wall, s.profile.type or ""))))
        return self.known[region]

    def _of_place(self, base: str, place: int) -> list[WallSideProfile]:
        """The sides of a base; of a side that continues into other places, the longest stretch in this place."""
        out = []
        for s in self._of_base(base):
            points, normals = spread(s.curve.points, s.curve.closed, PITCH)
            here = self.plan.parting.beside(base, place, points + LOOK * normals)
            if (here < 0).mean() <= ELSEWHERE:
                out.append(s)
                continue
            runs = runs_of(["" if k < 0 else "in" for k in here.tolist()], s.curve.closed)
            stretch = max(runs, key=lambda run: int(here[run].sum()), default=[])
            if here[stretch].sum() >= MIN_POINTS:
                out.append(WallSideProfile(s.wall, s.curve, classify(points[stretch], False)))
        return out

    def _of_base(self, base: str) -> list[WallSideProfile]:
        return [s for k, s in enumerate(self.whole) if self._is_of(k, base)]

    def _is_of(self, curve: int, base: str) -> bool:
        faced = self.plan.faced[curve]
        if base in self.plan.names:
            return faced.get(base, 0.0) > 0.0
        return self.plan.curves[curve].wall == base and sum(faced.values()) < FACING_SHARE

    def _touched(self, base: str, connections: list[str]) -> list[WallSideProfile]:
        shape = shapely.union_all([self.plan.shadows[c] for c in connections if c in self.plan.shadows]).buffer(NEAR)
        out = []
        for k, s in enumerate(self.whole):
            if base.startswith("C") or self._is_of(k, base):
                stretch = _within(s.curve, shape)
                if stretch is not None:
                    out.append(WallSideProfile(s.wall, s.curve, classify(stretch, False)))
        return out


def _within(curve: SideCurve, shape: shapely.Geometry) -> F64 | None:
    """The longest stretch of a side inside a shape, (k, 2) float64, mm; None where it is too short."""
    line = np.vstack([curve.points, curve.points[:1]]) if curve.closed else curve.points
    cut = shapely.line_merge(shapely.intersection(shapely.LineString(line), shape))
    parts = [g for g in shapely.get_parts(cut) if g.geom_type == "LineString" and g.length > 0]
    if not parts:
        return None
    best = max(parts, key=lambda g: (round(g.length, 6), g.bounds))
    if len(best.coords) < MIN_POINTS:
        best = shapely.segmentize(best, best.length / MIN_POINTS)
    return np.asarray(best.coords)
