"""A family part before it becomes a solid: base, walls, connections, and the checks between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.random import Generator
from shapely.geometry import LineString, Point, Polygon

from examples.family.connections import ConnectionSpec
from examples.family.gaps import Gap, channels
from examples.family.splines import F64
from examples.family.walls import WallSpec


class LayoutError(ValueError):
    """A drawn layout breaks a rule of the family; the recipe then draws again."""


@dataclass(frozen=True)
class Plate:
    """Rectangular base from z = 0 to ``thickness``: bounds x0, y0, x1, y1 in mm."""

    bounds: tuple[float, float, float, float]
    thickness: float

    def solid(self) -> Any:
        """The plate as a cadquery Solid."""
        import cadquery as cq

        x0, y0, x1, y1 = self.bounds
        return cq.Solid.makeBox(x1 - x0, y1 - y0, self.thickness, cq.Vector(x0, y0, 0))

    def holds(self, outline: Polygon) -> bool:
        """Whether a plan outline lies on the plate, 1 mm from its rim."""
        x0, y0, x1, y1 = outline.bounds
        b = self.bounds
        return x0 >= b[0] + 1 and y0 >= b[1] + 1 and x1 <= b[2] - 1 and y1 <= b[3] - 1

    def blocked(self, start: F64, end: F64) -> np.ndarray:
        """Whether the base is above its floor between two points; a plate never is.

        start, end : (n, 3) float64, mm, part frame

        Returns (n,) bool.
        """
        return np.zeros(len(start), bool)

    def above_floor(self, z: float) -> Polygon:
        """Plan outline at height z of material above the floor, mm; empty for a plate."""
        return Polygon()


@dataclass(frozen=True)
class HubDisc:
    """Round base with a conical hub about the Z axis.

    radius, thickness : mm, of the disc
    hub_radius        : mm, of the hub at the floor and at its top
    hub_height        : mm above the floor
    """

    radius: float
    thickness: float
    hub_radius: tuple[float, float]
    hub_height: float

    def solid(self) -> Any:
        """Disc and hub as one cadquery Solid, turned from one profile."""
        import cadquery as cq

        r0, r1 = self.hub_radius
        z0, z1 = self.thickness, self.thickness + self.hub_height
        profile = [(0, 0), (self.radius, 0), (self.radius, z0), (r0, z0), (r1, z1), (0, z1)]
        wire = cq.Wire.makePolygon([cq.Vector(r, 0, z) for r, z in profile], close=True)
        return cq.Solid.revolve(wire, [], 360.0, cq.Vector(0, 0, 0), cq.Vector(0, 0, 1))

    def holds(self, outline: Polygon) -> bool:
        """Whether a plan outline lies on the disc, 1 mm from its rim."""
        xy = np.array(outline.exterior.coords)
        return bool(np.hypot(xy[:, 0], xy[:, 1]).max() <= self.radius - 1)

    def blocked(self, start: F64, end: F64) -> np.ndarray:
        """Whether the hub touches the segment between two points.

        start, end : (n, 3) float64, mm, part frame

        Returns (n,) bool.
        """
        f = np.linspace(0.0, 1.0, 65)[:, None]
        p = start[:, None] + (end - start)[:, None] * f
        above = p[..., 2] > self.thickness + self.hub_height
        return np.asarray(((np.hypot(p[..., 0], p[..., 1]) <= self._radius_at(p[..., 2])) & ~above).any(axis=1))

    def above_floor(self, z: float) -> Polygon:
        """Plan outline of the hub at height z, mm; empty above its top."""
        if z > self.thickness + self.hub_height:
            return Polygon()
        return Point(0, 0).buffer(float(self._radius_at(z)), quad_segs=64)

    def _radius_at(self, z: float | F64) -> F64:
        """Radius of the hub at heights z, mm; that of its foot and top below and above."""
        r0, r1 = self.hub_radius
        return np.asarray(r0 + (r1 - r0) * np.clip((z - self.thickness) / self.hub_height, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class WindowSpec:
    """An opening straight through a wall.

    index, wall : the wall and its place in the layout
    u           : parameter of its middle along the wall
    width       : mm along the wall
    z           : mm, from and to
    """

    index: int
    wall: WallSpec
    u: float
    width: float
    z: tuple[float, float]

    def footprint(self) -> Polygon:
        """Plan outline of the opening, mm."""
        low, high = (self.wall.axis_point(self.u, z) for z in self.z)
        n = self.wall.plan_normal(np.array([self.u]))[0]
        t = np.array([n[1], -n[0]])
        reach = 0.5 * max(self.wall.thickness) + 0.5 + 0.5 * abs(float((high - low) @ n)) + self.width**2 / 40.0
        middle = 0.5 * (low + high)
        corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return Polygon([middle + 0.5 * self.width * a * t + reach * b * n for a, b in corners])

    def fits(self, layout: PartLayout, gaps: list[Gap]) -> bool:
        """Whether the opening passes the wall cleanly, without touching other material or the narrowest place of a gap.
        """
        outline = self.footprint()
        around = outline.buffer(1.0)
        corners = list(outline.exterior.coords)
        near, far = LineString(corners[:2]), LineString(corners[2:4])
        for z in self.z:
            section = self.wall.section(z)
            rest = section.difference(outline)
            pieces = 1 if self.wall.closed else 2
            if section.intersection(outline).geom_type != "Polygon" or len(getattr(rest, "geoms", [rest])) != pieces:
                return False
            if section.intersects(near) or section.intersects(far):
                return False
        others = [w for k, w in enumerate(layout.walls) if k != self.index]
        if any(w.section(z).intersects(outline.buffer(0.2)) for w in others for z in self.z):
            return False
        if any(c.footprint().intersects(around) for c in layout.connections):
            return False
        around = around.buffer(1.5)
        return not any(around.contains(Point(g.at[:2])) for g in gaps if self.index in g.walls)

    def solid(self) -> Any:
        """The opening as a cadquery Solid, to be cut away."""
        import cadquery as cq

        corners = list(self.footprint().exterior.coords)[:-1]
        wire = cq.Wire.makePolygon([cq.Vector(x, y, self.z[0]) for x, y in corners], close=True)
        return cq.Solid.extrudeLinear(wire, [], cq.Vector(0, 0, self.z[1] - self.z[0]))


@dataclass(frozen=True, eq=False)
class PartLayout:
    """All decisions of a recipe.

    name        : of the recipe
    base        : Plate or HubDisc
    walls       : WallSpec in order, the indices of the truth
    connections : ConnectionSpec or ForkSpec in order
    fillet      : mm, radius of the fillets between walls and floor, 0 for none
    windows     : openings through walls
    rounded     : mm, radius of the fillets where connections meet walls, 0 for none
    least       : mm, least distance between two walls in plan
    meets       : pairs of walls that meet on purpose (T, cross)
    features    : words for features that the recipe added on purpose
    """

    name: str
    base: Plate | HubDisc
    walls: Sequence[WallSpec]
    connections: Sequence[Any] = field(default_factory=list)
    fillet: float = 0.0
    windows: list[WindowSpec] = field(default_factory=list)
    rounded: float = 0.0
    least: float = 0.5
    meets: tuple[tuple[int, int], ...] = ()
    features: tuple[str, ...] = ()

    def gaps(self, **sampling: Any) -> list[Gap]:
        """True channels between the walls, see ``examples.family.gaps.channels``."""
        if any(w.sees_itself for w in self.walls):
            return channels(self.walls, self.base.blocked, foot=self.fillet, **{"n_u": 241, "n_v": 7, **sampling})
        return channels(self.walls, self.base.blocked, **sampling)


def connect(
    walls: Sequence[WallSpec],
    pair: tuple[int, int],
    kind: str,
    u: float,
    z: tuple[float, float],
    *,
    width: float,
    depth: float,
    bend: float = 0.0,
) -> ConnectionSpec:
    """Connection from wall ``pair[0]`` perpendicular across to wall ``pair[1]``.

    u     : parameter on the centre line of the first wall
    z     : mm, height of the axis on the first and on the second wall
    width, depth, bend : mm, see ConnectionSpec; the width is reduced until both ends are buried

    Raises
    ------
    LayoutError
        The second wall is missed, the ends cannot be buried, there is no free space below, the bend is over 0.3 of the
        length, or the connection would meet a third wall.
    """
    first, second = walls[pair[0]], walls[pair[1]]
    start = first.axis_point(u, z[0])
    target = _centre_polyline(second, z[1])
    normal = first.plan_normal(np.array([u]))[0]
    hit = LineString([start - 40 * normal, start + 40 * normal]).intersection(LineString(target))
    points = [np.array(g.coords[0]) for g in getattr(hit, "geoms", [hit]) if not g.is_empty]
    if not points:
        raise LayoutError("the second wall is not opposite")
    end = min(points, key=lambda p: float(np.linalg.norm(p - start)))
    u_end = LineString(target).project(Point(end), normalized=True)
    tangents = np.array([_tangent(first, u), _tangent(second, u_end)])
    spec = ConnectionSpec(kind, (first, second), pair, np.array([*start, z[0]]), np.array([*end, z[1]]),
                          tangents, width, depth, bend)
    if abs(bend) > 0.3 * float(np.linalg.norm(end - start)):
        raise LayoutError("bent too far for its length")
    spec = settled(spec, 0.12, 8)
    outline = spec.footprint()
    if any(w.section(0.5 * sum(spec.z_range)).intersects(outline) for k, w in enumerate(walls) if k not in pair):
        raise LayoutError("meets a third wall")
    return spec


def settled(spec: ConnectionSpec, depth: float, rounds: int) -> ConnectionSpec:
    """The connection, narrowed until both ends lie ``depth`` mm inside their walls.

    Raises
    ------
    LayoutError
        ``rounds`` steps are not enough, too little of it is left, or there is no free space below.
    """
    for _ in range(rounds):
        if spec.buried(depth):
            break
        spec = spec.narrowed(0.8)
    else:
        raise LayoutError("ends cannot be buried")
    if spec.width < 0.7 or spec.span[1] - spec.span[0] < 0.05 or spec.void_share < 0.25:
        raise LayoutError("too narrow, no span, or no void below")
    if not spec.footprint().is_valid:
        raise LayoutError("its outline crosses itself")
    return spec


def _centre_polyline(wall: WallSpec, z: float) -> F64:
    return np.array([wall.axis_point(t, z) for t in np.linspace(0.02, 0.98, 97)])


def _tangent(wall: WallSpec, u: float) -> F64:
    n = wall.plan_normal(np.array([u]))[0]
    return np.array([n[1], -n[0]])


def clear_of(spec: ConnectionSpec, others: list[ConnectionSpec], plan: float = 1.5, height: float = 1.5) -> bool:
    """Whether a connection keeps ``plan`` mm beside or ``height`` mm above or below every other one."""
    for other in others:
        stacked = spec.z_range[0] - other.z_range[1] >= height or other.z_range[0] - spec.z_range[1] >= height
        if stacked or not set(spec.indices) & set(other.indices):
            continue
        if spec.footprint().distance(other.footprint()) < plan:
            return False
    return True


def check(layout: PartLayout) -> None:
    """Check a layout against the rules of the family.

    Raises
    ------
    LayoutError
        A rule is broken; the message names it.
    """
    outlines = [[w.section(z) for z in (w.z_floor, 0.5 * (w.z_floor + w.z_top), w.z_top)] for w in layout.walls]
    for wall, cuts in zip(layout.walls, outlines, strict=True):
        if not all(c.is_valid and layout.base.holds(c) for c in cuts):
            raise LayoutError("a wall crosses itself or leaves the base")
        if wall.steepest_turn > np.radians(44):
            raise LayoutError("a wall could face itself")
        if max(wall.thickness) > 0.45 * wall.height:
            raise LayoutError("a wall is a block")
    pairs = {frozenset(p) for p in layout.meets}
    for i, a in enumerate(outlines):
        for j, b in enumerate(outlines[:i]):
            if frozenset((i, j)) not in pairs and any(p.distance(q) < layout.least for p, q in zip(a, b, strict=True)):
                raise LayoutError("two walls meet")


def try_connections(
    rng: Generator, layout: PartLayout, pairs: list[tuple[int, int]], count: int, kinds: tuple[str, ...]
) -> list[ConnectionSpec]:
    """Draw up to ``count`` connections between given pairs of walls.

    Returns the ConnectionSpec list; shorter than ``count`` only where 40 draws for each found no room.
    """
    out: list[ConnectionSpec] = []
    for k in range(count):
        for _ in range(40):
            pair = pairs[k % len(pairs)] if k < len(pairs) else pairs[int(rng.integers(len(pairs)))]
            spec = _draw(rng, layout, pair, str(rng.choice(kinds)))
            if spec is not None and clear_of(spec, out):
                out.append(spec)
                break
    return out


def _draw(rng: Generator, layout: PartLayout, pair: tuple[int, int], kind: str) -> ConnectionSpec | None:
    first, second = (layout.walls[k] for k in pair)
    floor, top = first.z_floor, min(first.z_top, second.z_top)
    depth = float({"web": rng.uniform(0.8, 1.5)}.get(kind, rng.uniform(1.2, 2.2)))
    width = depth if kind == "round_bar" else float(rng.uniform(3, 7) if kind == "web" else rng.uniform(1.0, 2.5))
    low, high = floor + 1.5 + 0.5 * depth, top - 1.2 - 0.5 * depth
    bend = 0.0
    if kind == "arch":
        bend = float(rng.uniform(0.8, 1.8))
        high -= bend
    if kind == "bow":
        bend = float(rng.uniform(0.8, 1.6) * rng.choice([-1, 1]))
    u = float(rng.uniform(0.18, 0.82))
    draw = rng.uniform(0, 1, 3)
    if high <= low:
        return None
    z0 = low + (high - low) * float(draw[0])
    z1 = z0
    if kind in ("bar", "round_bar", "arch") and draw[1] < 0.4:
        z1 = low + (high - low) * float(draw[2])
    if kind == "bar" and draw[1] > 0.85:
        z0 = floor
    try:
        return connect(layout.walls, pair, kind, u, (z0, z1), width=width, depth=depth, bend=bend)
    except LayoutError:
        return None
