"""Connections between free walls: straight across to the next wall, which may be another stretch of the same wall.

A fork leaves one wall, divides over the channel, and ends at two places of the walls beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from shapely.geometry import LineString, MultiPolygon, Point, Polygon
from shapely.ops import unary_union

from examples.family.connections import ConnectionSpec
from examples.family.freewall import FreeWall
from examples.family.gaps import Gap
from examples.family.layout import HubDisc, LayoutError, Plate, clear_of, settled
from examples.family.splines import F64
from examples.family.walls import WallSpec

LONGEST = 12.5
"""mm, longest span of a connection."""
BURIED_BY = 0.1
KEEP_OFF = 1.0
"""mm, least distance between a connection and the narrowest place of a gap."""


@dataclass(frozen=True, eq=False)
class ForkSpec:
    """A connection with three ends, Y in plan, level underneath.

    indices : places of the walls in the layout, one for each different wall (two equal ones where all is one wall)
    ends    : (3, 2) float64, mm, on the centre lines of the walls; the stem first
    node    : (2,) float64, mm, where it divides
    width, depth, z : mm, of each arm; z of the axis
    """

    indices: tuple[int, ...]
    ends: F64
    node: F64
    width: float
    depth: float
    z: float
    visible: Polygon

    kind = "fork"
    floor_contact = False
    void_share = 1.0

    def footprint(self) -> Polygon:
        """Plan outline, mm."""
        return _fork_outline(self.ends, self.node, self.width)

    @property
    def z_range(self) -> tuple[float, float]:
        """Lowest and highest point, mm."""
        return self.z - 0.5 * self.depth, self.z + 0.5 * self.depth

    @property
    def point(self) -> F64:
        """A point inside, (3,) float64, mm, part frame."""
        return np.array([*self.node, self.z])

    def solid(self) -> Any:
        """The fork as a cadquery Solid, ends inside the walls."""
        import cadquery as cq

        outline = self.footprint().simplify(1e-9).exterior.coords[:-1]
        wire = cq.Wire.makePolygon([cq.Vector(x, y, self.z_range[0]) for x, y in outline], close=True)
        return cq.Solid.extrudeLinear(wire, [], cq.Vector(0, 0, self.depth))


def _fork_outline(ends: F64, node: F64, width: float) -> Polygon:
    stem = LineString([ends[0], node]).buffer(0.5 * width, cap_style="flat")
    arms = LineString([ends[1], node, ends[2]]).buffer(0.5 * width, cap_style="flat", join_style="mitre")
    return unary_union([stem, arms])


@dataclass(frozen=True, eq=False)
class Across:
    """Where a plan ray from the middle of a wall ends: on the centre line of wall ``other``, across ``void`` mm."""

    other: int
    end: F64
    void: float


def look_across(walls: Sequence[WallSpec], i: int, start: F64, way: F64, z: float) -> Across:
    """The first wall that a plan ray from the centre line of a wall meets.

    walls : of the layout
    i     : wall where it starts
    start : (2,) float64, mm, plan coordinates
    way   : (2,) float64, unit, plan coordinates, direction
    z     : mm, height of the section

    Raises
    ------
    LayoutError
        There is no wall within 30 mm, or its centre line is missed.
    """
    ray = LineString([start, start + 30.0 * way])
    entries: list[tuple[float, int]] = []
    leave = 0.0
    for k, wall in enumerate(walls):
        if _apart(ray, wall):
            continue
        cut = ray.intersection(wall.section(z))
        for piece in getattr(cut, "geoms", [cut]):
            if piece.is_empty:
                continue
            at = [float(np.hypot(*(np.array(c[:2]) - start))) for c in piece.coords]
            if k == i and min(at) < 1e-6:
                leave = max(at)
            else:
                entries.append((min(at), k))
    if not entries or leave == 0.0:
        raise LayoutError("nothing stands opposite")
    enter, other = min(entries)
    middle = ray.intersection(LineString(_middle(walls[other], z)))
    hits = [p for p in getattr(middle, "geoms", [middle]) if not p.is_empty and p.geom_type == "Point"]
    points = [np.array(p.coords[0]) for p in hits]
    beyond = [p for p in points if float((p - start) @ way) > enter]
    if not beyond:
        raise LayoutError("the opposite wall is missed")
    end = min(beyond, key=lambda p: float((p - start) @ way))
    if float((end - start) @ way) - enter > 2.0 * max(walls[other].thickness):
        raise LayoutError("met too obliquely")
    return Across(other, end, enter - leave)


def _apart(shape: LineString | Polygon, wall: WallSpec) -> bool:
    """Whether the boxes of a plan shape and of a wall lie more than 1 mm apart."""
    a, b = shape.bounds, wall.bounds
    return bool(a[0] > b[2] + 1 or b[0] > a[2] + 1 or a[1] > b[3] + 1 or b[1] > a[3] + 1)


def _middle(wall: WallSpec, z: float) -> F64:
    u = np.linspace(0.0, 1.0, 241) if wall.closed else np.linspace(0.02, 0.98, 241)
    v = np.full(len(u), (z - wall.z_floor) / wall.height)
    return np.asarray(0.5 * (wall.side_point(1, u, v) + wall.side_point(-1, u, v))[:, :2])


def _tangent_at(wall: WallSpec, point: F64, z: float) -> F64:
    line = _middle(wall, z)
    k = int(np.clip(np.argmin(np.hypot(*(line - point).T)), 1, len(line) - 2))
    d = line[k + 1] - line[k - 1]
    return np.asarray(d / np.hypot(*d))


def join(
    walls: Sequence[WallSpec], i: int, side: int, u: float, kind: str, z: tuple[float, float], *, width: float,
    depth: float, bend: float = 0.0,
) -> ConnectionSpec:
    """Connection from the side of a wall, perpendicular across the channel.

    walls : of the layout; the connection leaves wall ``i`` on ``side`` (LEFT or RIGHT) at parameter ``u``
    z, width, depth, bend : mm, see ``examples.family.layout.connect``

    Raises
    ------
    LayoutError
        There is no opposite wall, the ends cannot be buried, or other material is in the way.
    """
    first = walls[i]
    start = first.axis_point(u, z[0])
    way = side * first.plan_normal(np.array([u]))[0]
    found = look_across(walls, i, start, way, z[0])
    if not 0.2 <= found.void <= LONGEST or abs(bend) > 0.3 * (found.void + 2.0):
        raise LayoutError("too far, too near, or bent too far")
    second = walls[found.other]
    tangents = np.array([_tangent_at(first, start, z[0]), _tangent_at(second, found.end, z[1])])
    if min(abs(t[0] * way[1] - t[1] * way[0]) for t in tangents) < 0.75:
        raise LayoutError("met too obliquely")
    ends = np.array([*start, z[0]]), np.array([*found.end, z[1]])
    spec = ConnectionSpec(kind, (first, second), (i, found.other), *ends, tangents, width, depth, bend)
    spec = settled(spec, BURIED_BY, 6)
    _ends_only_there(walls, spec.footprint(), {i, found.other}, spec.z_range, 2)
    return spec


def _ends_only_there(
    walls: Sequence[WallSpec], outline: Polygon, wanted: set[int], z: tuple[float, float], ends: int
) -> None:
    """Check that a footprint meets only the wanted walls, in as many places as it has ends."""
    for level in z:
        pieces = 0
        for k, wall in enumerate(walls):
            if _apart(outline, wall):
                continue
            around = outline if k in wanted else outline.buffer(0.5)
            cut = wall.section(min(max(level, wall.z_floor), wall.z_top)).intersection(around)
            parts = [g for g in getattr(cut, "geoms", [cut]) if g.area > 1e-6]
            if parts and k not in wanted:
                raise LayoutError("meets a third wall")
            pieces += len(parts)
        if pieces != ends:
            raise LayoutError("meets a wall twice")


def fork(
    walls: Sequence[WallSpec], i: int, side: int, u: float, z: float, *, spread: float, width: float, depth: float
) -> ForkSpec:
    """Forked connection from the side of a wall.

    walls, i, side, u : as in ``join``
    z      : mm, of its level axis
    spread : rad, of each arm off the stem

    Raises
    ------
    LayoutError
        As ``join``.
    """
    start = walls[i].axis_point(u, z)
    way = side * walls[i].plan_normal(np.array([u]))[0]
    found = look_across(walls, i, start, way, z)
    if not 3.0 <= found.void <= LONGEST:
        raise LayoutError("no room to divide")
    node = start + way * (float((found.end - start) @ way) * 0.42)
    ends, others = [start], []
    for turn in (spread, -spread):
        c, s = np.cos(turn), np.sin(turn)
        arm = np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])
        hit = _first_middle(walls, node, arm, z)
        ends.append(hit[1])
        others.append(hit[0])
    indices = tuple(sorted({i, *others}))
    outline = _fork_outline(np.array(ends), node, width)
    levels = (z - 0.5 * depth, z + 0.5 * depth)
    _ends_only_there(walls, outline, set(indices), levels, 3)
    visible = outline.difference(unary_union([walls[k].section(z) for k in indices]))
    if isinstance(visible, MultiPolygon) or not _fork_buried(walls, (i, *others), np.array(ends), node, width, levels):
        raise LayoutError("the fork is not one piece with buried ends")
    return ForkSpec(indices if len(indices) > 1 else indices * 2, np.array(ends), node, width, depth, z, visible)


def _first_middle(walls: Sequence[WallSpec], start: F64, way: F64, z: float) -> tuple[int, F64]:
    ray = LineString([start, start + 25.0 * way])
    found: list[tuple[float, int, F64]] = []
    for k, wall in enumerate(walls):
        if _apart(ray, wall):
            continue
        cut = ray.intersection(LineString(_middle(wall, z)))
        for p in getattr(cut, "geoms", [cut]):
            if not p.is_empty and p.geom_type == "Point":
                at = np.array(p.coords[0])
                found.append((float((at - start) @ way), k, at))
    if not found:
        raise LayoutError("an arm of the fork ends nowhere")
    _, k, at = min(found, key=lambda f: f[0])
    return k, at


def _fork_buried(
    walls: Sequence[WallSpec], at: tuple[int, ...], ends: F64, node: F64, width: float, levels: tuple[float, float]
) -> bool:
    for k, end in zip(at, ends, strict=True):
        d = (end - node) / np.hypot(*(end - node))
        across = np.array([-d[1], d[0]]) * 0.5 * width
        for z in levels:
            inside = walls[k].section(z).buffer(-BURIED_BY)
            if not all(inside.contains(Point(end + s * across)) for s in (-1, 0, 1)):
                return False
    return True


def within_hub(base: Plate | HubDisc, walls: Sequence[WallSpec], spec: Any) -> bool:
    """Whether the hub swallows a connection.

    That is the case where outside the hub it does not reach the wall at its end, or where more than half of its visible
    part lies within the hub.

    base, walls : of the layout
    spec        : ConnectionSpec or ForkSpec
    """
    outline = spec.footprint()
    for level in spec.z_range:
        hub = base.above_floor(level)
        if not outline.intersects(hub):
            continue
        sections = [w.section(min(max(level, w.z_floor), w.z_top)) for w in (walls[k] for k in set(spec.indices))]
        cuts = [s.intersection(outline) for s in sections]
        ends = [g for c in cuts for g in getattr(c, "geoms", [c]) if g.area > 1e-6]
        between = outline.difference(unary_union(sections))
        free = between.difference(hub)
        if free.area < 0.5 * between.area:
            return True
        pieces = getattr(free, "geoms", [free])
        if not any(all(piece.distance(end) < 1e-6 for end in ends) for piece in pieces):
            return True
    return False


def draw_joins(
    rng: Generator, base: Plate | HubDisc, walls: Sequence[WallSpec], gaps: list[Gap], count: int,
    kinds: tuple[str, ...],
) -> list[Any]:
    """Draw up to ``count`` connections anywhere between the walls, some above each other.

    base : its hub swallows no connection and no end of one
    gaps : true channels; no connection covers the narrowest place of one

    Returns ConnectionSpec and ForkSpec; fewer than ``count`` only where 30 draws for each found no room.
    """
    out: list[Any] = []
    starts: list[tuple[int, int, float]] = []
    weight = np.array([w.length for w in walls])
    for _ in range(30 * count):
        if len(out) == count:
            break
        i = int(rng.choice(len(walls), p=weight / weight.sum()))
        start = (i, int(rng.choice([-1, 1])), float(rng.uniform(0.06, 0.94)))
        if starts and rng.random() < 0.2:
            start = starts[int(rng.integers(len(starts)))]
        try:
            spec = _draw(rng, walls, start, str(rng.choice(kinds)))
        except LayoutError:
            continue
        if clear_of(spec, out) and not _covers(spec, gaps) and not within_hub(base, walls, spec):
            out.append(spec)
            starts.append(start)
    return out


def takes_fillets(c: Any) -> bool:
    """Whether a connection may have fillets; the kernel cannot make them on bent walls."""
    return c.kind in ("bar", "web", "round_bar") and all(
        isinstance(w, FreeWall) and w.profile.type is None and w.lean[0] == w.lean[1] for w in c.walls
    )


def _covers(spec: Any, gaps: list[Gap]) -> bool:
    low, high = spec.z_range
    outline = spec.footprint().buffer(KEEP_OFF)
    return any(set(g.walls) <= set(spec.indices) and low - KEEP_OFF < g.at[2] < high + KEEP_OFF
               and outline.contains(Point(g.at[:2])) for g in gaps)


def _draw(rng: Generator, walls: Sequence[WallSpec], start: tuple[int, int, float], kind: str) -> Any:
    i, side, u = start
    wall = walls[i]
    depth = float(rng.uniform(0.8, 1.5) if kind == "web" else rng.uniform(1.0, 2.2))
    width = depth if kind == "round_bar" else float(rng.uniform(3, 7) if kind == "web" else rng.uniform(1.0, 2.4))
    low, high = wall.z_floor + 1.5 + 0.5 * depth, wall.z_top - 1.2 - 0.5 * depth
    draw = rng.uniform(0, 1, 4)
    bend = {"arch": 0.8 + draw[3], "bow": (0.8 + 0.8 * draw[3]) * np.sign(draw[0] - 0.5)}.get(kind, 0.0)
    high -= bend if kind == "arch" else 0.0
    if high <= low:
        raise LayoutError("too low for it")
    z0 = z1 = low + (high - low) * float(draw[0])
    if kind == "fork":
        return fork(walls, i, side, u, z0, spread=float(0.45 + 0.3 * draw[1]),
                    width=0.8 * min(width, 1.9), depth=depth)
    if kind in ("bar", "round_bar", "arch") and draw[1] < 0.4:
        z1 = low + (high - low) * float(draw[2])
    if kind == "bar" and draw[1] > 0.75:
        z0 = wall.z_floor
    return join(walls, i, side, u, kind, (z0, z1), width=width, depth=depth, bend=float(bend))
