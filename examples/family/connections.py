"""Connections of the family: bars, webs and bent struts that bridge one channel.

Every kind but the round bar is a ruled solid between a left and a right profile. The profiles lie half a width to
either
side of the axis. They run from the middle of one wall to the middle of the other and have a lower and an upper curve.
The ends follow the direction of each wall, so they stay buried when the axis is skew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from shapely.geometry import LineString, Point, Polygon

from examples.family.splines import F64
from examples.family.walls import WallSpec

KINDS = ("round_bar", "bar", "web", "arch", "bow")
"""round bar; square bar; flat web; strut bent in the vertical plane; strut bent in plan."""

TRUTH_KIND = {
    "round_bar": "bar", "bar": "bar", "web": "web", "arch": "bent strut", "bow": "bent strut", "fork": "fork",
}


@dataclass(frozen=True, eq=False)
class ConnectionSpec:
    """One connection between walls ``i`` and ``j`` of a layout.

    kind           : one of KINDS
    walls          : the two walls
    indices        : their places in the layout
    start, end     : (3,) float64, mm, ends of the axis, on the centre surface of each wall
    tangents       : (2, 2) float64, unit plan direction of each wall at the end there
    width          : mm along the walls; for a round bar its diameter
    depth          : mm in height
    bend           : mm by which the middle is lifted (arch) or moved sideways (bow)
    """

    kind: str
    walls: tuple[WallSpec, WallSpec]
    indices: tuple[int, int]
    start: F64
    end: F64
    tangents: F64
    width: float
    depth: float
    bend: float = 0.0

    @cached_property
    def direction(self) -> F64:
        """Direction of the axis in plan, (2,) float64, unit."""
        d = (self.end - self.start)[:2]
        return np.asarray(d / np.linalg.norm(d))

    @cached_property
    def lateral(self) -> F64:
        """Direction to the left of the axis in plan, (2,) float64, unit."""
        return np.array([-self.direction[1], self.direction[0]])

    def plan_corners(self, side: int) -> tuple[F64, F64]:
        """Plan ends of the profile on one side (+1 left, -1 right), two (2,) float64, mm, in plan."""
        out = []
        for point, tangent in ((self.start, self.tangents[0]), (self.end, self.tangents[1])):
            t = tangent * np.sign(tangent @ self.lateral)
            out.append(point[:2] + side * 0.5 * self.width * t / abs(t @ self.lateral))
        return out[0], out[1]

    def axis_height(self, s: F64) -> F64:
        """Height of the axis.

        s : (n,) float64, dimensionless, 0 at the start and 1 at the end
        Returns (n,) float64, mm.  An arch follows the circle through its ends and its lifted middle.
        """
        z = self.start[2] + (self.end[2] - self.start[2]) * s
        if self.kind != "arch":
            return np.asarray(z)
        span = float(np.linalg.norm((self.end - self.start)[:2]))
        radius = (0.25 * span**2 + self.bend**2) / (2.0 * self.bend)
        x = (s - 0.5) * span
        return np.asarray(z + np.sqrt(np.maximum(radius**2 - x**2, 0.0)) - (radius - self.bend))

    def footprint(self, samples: int = 41) -> Polygon:
        """Plan outline as a shapely polygon, mm."""
        sides = []
        for side in (1, -1):
            a, b = self.plan_corners(side)
            s = np.linspace(0.0, 1.0, samples)[:, None]
            line = a + (b - a) * s
            if self.kind == "bow":
                line = _arc(a, 0.5 * (a + b) + self.bend * self.lateral, b, samples)
            sides.append(line)
        return Polygon(np.vstack([sides[0], sides[1][::-1]]))

    def caps(self) -> F64:
        """(k, 3) float64, mm, part frame: points on the rims of both end faces, which must all lie inside the walls."""
        out = []
        for end, point in enumerate((self.start, self.end)):
            a, b = self.plan_corners(1)[end], self.plan_corners(-1)[end]
            for f in np.linspace(0.0, 1.0, 7):
                for z in (point[2] - 0.5 * self.depth, point[2], point[2] + 0.5 * self.depth):
                    out.append([*(a + (b - a) * f), z])
        return np.array(out)

    @cached_property
    def span(self) -> tuple[float, float]:
        """The part of the axis outside both walls, as fractions of its length."""
        a, b = self.start[:2], self.end[:2]
        line = LineString([a, b])
        if self.kind == "bow":
            line = LineString(_arc(a, 0.5 * (a + b) + self.bend * self.lateral, b, 81))
        out = []
        for wall, point in zip(self.walls, (self.start, self.end), strict=True):
            z = min(max(float(point[2]), wall.z_floor), wall.z_top)
            cut = line.intersection(wall.section(z).boundary)
            points = list(getattr(cut, "geoms", [cut]))
            out += [line.project(Point(p.coords[0])) / line.length for p in points if not p.is_empty]
        if not out:
            return 0.0, 0.0
        return min(out), max(out)

    @cached_property
    def z_range(self) -> tuple[float, float]:
        """Lowest and highest point outside the walls, mm (not below the floor)."""
        s = np.linspace(*self.span, 201)
        z = self.axis_height(s)
        floor = self.walls[0].z_floor
        return max(float(z.min()) - 0.5 * self.depth, floor), float(z.max()) + 0.5 * self.depth

    @cached_property
    def void_share(self) -> float:
        """Share of the span with at least 0.5 mm of free space between underside and floor."""
        s = np.linspace(*self.span, 201)
        return float((self.axis_height(s) - 0.5 * self.depth > self.walls[0].z_floor + 0.5).mean())

    @property
    def point(self) -> F64:
        """A point inside, in the middle of the span, (3,) float64, mm, part frame."""
        s = np.array([0.5 * (self.span[0] + self.span[1])])
        xy = self.start[:2] + (self.end - self.start)[:2] * s[0]
        if self.kind == "bow":
            xy = 0.5 * (self.start + self.end)[:2] + self.bend * self.lateral
        return np.array([*xy, self.axis_height(s)[0]])

    @cached_property
    def floor_contact(self) -> bool:
        """Whether the underside meets the floor somewhere in the channel."""
        s = np.linspace(*self.span, 201)
        return bool((self.axis_height(s) - 0.5 * self.depth < self.walls[0].z_floor).any())

    def buried(self, margin: float) -> bool:
        """Whether both end faces lie inside their walls, at least ``margin`` mm below the sides."""
        caps = self.caps()
        half = len(caps) // 2
        for wall, rim in zip(self.walls, (caps[:half], caps[half:]), strict=True):
            for z in np.unique(rim[:, 2]):
                inside = wall.section(float(z)).buffer(-margin)
                if z > wall.z_top - 0.3 or not all(inside.contains(Point(p[:2])) for p in rim[rim[:, 2] == z]):
                    return False
        return True

    def narrowed(self, factor: float) -> ConnectionSpec:
        """The same connection with its width scaled."""
        depth = self.depth * (factor if self.kind == "round_bar" else 1.0)
        return replace(self, width=self.width * factor, depth=depth)

    def solid(self) -> Any:
        """The connection as a cadquery Solid, ends inside the walls."""
        import cadquery as cq

        if self.kind == "round_bar":
            axis = self.end - self.start
            return cq.Solid.makeCylinder(
                0.5 * self.width, float(np.linalg.norm(axis)), cq.Vector(*self.start), cq.Vector(*axis)
            )
        from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections

        loft = BRepOffsetAPI_ThruSections(True, True, 1e-6)
        loft.CheckCompatibility(False)
        for wire in self._wires():
            loft.AddWire(wire.wrapped)
        loft.Build()
        return cq.Solid(loft.Shape())

    def _wires(self) -> list[Any]:
        if self.kind == "bow":
            return [self._plan_wire(-0.5 * self.depth), self._plan_wire(0.5 * self.depth)]
        return [self._upright_wire(-1), self._upright_wire(1)]

    def _upright_wire(self, side: int) -> Any:
        a, b = self.plan_corners(side)
        span = float(np.linalg.norm((self.end - self.start)[:2]))
        s = np.array([(a - self.start[:2]) @ self.direction, 0.0, (b - self.start[:2]) @ self.direction]) / span
        s[1] = 0.5 * (s[0] + s[2])
        xy = np.array([a, 0.5 * (a + b), b])
        z = self.axis_height(s)
        # An arch keeps its ends at the axis heights on both profiles, whatever the skew.
        if self.kind == "arch":
            z[[0, 2]] = self.start[2], self.end[2]
        below = np.column_stack([xy, z - 0.5 * self.depth])
        above = np.column_stack([xy, z + 0.5 * self.depth])
        return _ring(below, above, curved=self.kind == "arch")

    def _plan_wire(self, dz: float) -> Any:
        rails = []
        for side in (1, -1):
            a, b = self.plan_corners(side)
            m = 0.5 * (a + b) + self.bend * self.lateral
            z = np.array([self.start[2], 0.5 * (self.start[2] + self.end[2]), self.end[2]]) + dz
            rails.append(np.column_stack([np.array([a, m, b]), z]))
        return _ring(rails[0], rails[1], curved=True)


def _ring(first: F64, second: F64, *, curved: bool) -> Any:
    import cadquery as cq

    def rail(p: F64) -> Any:
        a, m, b = (cq.Vector(*q) for q in p)
        return cq.Edge.makeThreePointArc(a, m, b) if curved else cq.Edge.makeLine(a, b)

    def line(p: F64, q: F64) -> Any:
        return cq.Edge.makeLine(cq.Vector(*p), cq.Vector(*q))

    there, back = line(first[2], second[2]), line(second[0], first[0])
    return cq.Wire.assembleEdges([rail(first), there, rail(second[::-1]), back])


def _arc(a: F64, m: F64, b: F64, n: int) -> F64:
    """Points on the circle through a, m, b: (n, 2) float64, mm, a and b equally far from m."""
    chord = b - a
    length = float(np.linalg.norm(chord))
    e = chord / length
    side = np.array([-e[1], e[0]])
    sagitta = float((m - 0.5 * (a + b)) @ side)
    x = np.linspace(-0.5 * length, 0.5 * length, n)
    radius = (0.25 * length**2 + sagitta**2) / (2.0 * abs(sagitta))
    y = np.sqrt(np.maximum(radius**2 - x**2, 0.0)) - (radius - abs(sagitta))
    return np.asarray(0.5 * (a + b) + x[:, None] * e + np.sign(sagitta) * y[:, None] * side)
