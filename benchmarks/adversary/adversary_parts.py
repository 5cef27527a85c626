"""The ten parts of the adversary, known in closed form, with right programs.

Eight are a profile pulled along Y: the solid is 0 <= z <= height(x), 0 <= x <= width, |y| <= HALF. The other two are a
round boss on a plate and a pocket. The blank is the box round the part with ``OVER`` on top of it. Every level is
roughed and finished by rows along Y that begin and end beside the part, so nothing comes down into stock.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.adversary.adversary_case import SAFE, Script

F64 = NDArray[np.float64]
HALF = 10.0  # mm, half of the length along Y
OVER = 0.6  # mm of stock on top
R = 3.0  # mm, of both tools
OUT = HALF + R + 2.0  # mm, where rows begin and end
LAYER = 1.5  # mm
HOLDER = [{"diameter_mm": 30, "length_mm": 40}]
FLAT: dict[str, Any] = {"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 2 * R, "flutes": 3,
                        "flute_length_mm": 15, "stickout_mm": 40, "holder": HOLDER}
BALL: dict[str, Any] = {**FLAT, "id": "T2", "number": 2, "kind": "ball", "flutes": 2}
FEED, DOWN = 500.0, 200.0  # mm/min


@dataclass(frozen=True)
class Line:
    """A straight piece of a profile, mm."""

    a: tuple[float, float]
    b: tuple[float, float]


@dataclass(frozen=True)
class Bow:
    """The top of a cylinder along Y: x from a to b over the middle, mm."""

    middle: tuple[float, float]
    radius: float
    a: float
    b: float


@dataclass(frozen=True, eq=False)
class ExactPart:
    """A part in closed form.

    size    : (x0, y0, x1, y1, top) mm, its box from z = 0
    outline : pieces of the profile, of z over x, or of z over the distance from Z for a round part
    round   : whether the profile turns about Z
    levels  : (x0, x1, z, wall at x0, wall at x1), level parts of the profile
    faces   : the level and sloping places where a fault may be planted: (name, x, y)
    """

    name: str
    size: tuple[float, float, float, float, float]
    outline: tuple[Line | Bow, ...]
    height: Callable[[F64], F64]
    build: Callable[[], Any]
    program: Callable[[], Script]
    round: bool = False
    levels: tuple[tuple[float, float, float, bool, bool], ...] = ()
    ball: bool = False

    def across(self, p: F64) -> F64:
        """(n,) mm, the place of points (n, 3) along the profile."""
        return np.hypot(p[:, 0], p[:, 1]) if self.round else p[:, 0]

    def inside(self, p: F64) -> NDArray[np.bool_]:
        """(n,) bool: which points (n, 3), mm, lie in the part."""
        x0, y0, x1, y1, _ = self.size
        box = (p[:, 0] > x0) & (p[:, 0] < x1) & (p[:, 1] > y0) & (p[:, 1] < y1) & (p[:, 2] > 0)
        return np.asarray(box & (p[:, 2] < self.height(self.across(p))))

    def depth(self, p: F64) -> F64:
        """(n,) mm, how far points (n, 3), mm, are from the surface; 0 outside the part."""
        x0, y0, x1, y1, _ = self.size
        far = np.minimum.reduce([p[:, 0] - x0, x1 - p[:, 0], p[:, 1] - y0, y1 - p[:, 1], p[:, 2]])
        q = np.column_stack([self.across(p), p[:, 2]])
        for piece in self.outline:
            far = np.minimum(far, _to_bow(q, piece) if isinstance(piece, Bow) else _to_line(q, piece))
        return np.where(self.inside(p), far, 0.0)

    @property
    def top(self) -> float:
        """Height of the part, mm."""
        return self.size[4]


def _to_line(q: F64, line: Line) -> F64:
    a, d = np.array(line.a), np.subtract(line.b, line.a)
    t = np.clip((q - a) @ d / (d @ d), 0.0, 1.0)
    return np.linalg.norm(q - a - t[:, None] * d, axis=1)


def _to_bow(q: F64, bow: Bow) -> F64:
    v = q - np.array(bow.middle)
    own = (q[:, 0] >= bow.a) & (q[:, 0] <= bow.b)  # the ends are vertical cuts, so this is near enough inside the part
    return np.where(own, np.abs(np.linalg.norm(v, axis=1) - bow.radius), np.inf)


def _chain(*points: tuple[float, float]) -> tuple[Line, ...]:
    return tuple(Line(a, b) for a, b in zip(points, points[1:], strict=False))


def _over(points: tuple[tuple[float, float], ...]) -> Callable[[F64], F64]:
    """Height over x of a chain; at an upright piece the higher one."""
    def height(x: F64) -> F64:
        out = np.full(len(x), -np.inf)
        for (xa, za), (xb, zb) in zip(points, points[1:], strict=False):
            if xb > xa:
                on = (x >= xa) & (x <= xb)
                out[on] = np.maximum(out[on], za + (zb - za) * (x[on] - xa) / (xb - xa))
        return out

    return height


def _pulled(*points: tuple[float, float]) -> Any:
    import cadquery as cq
    closed = [(points[0][0], 0.0), *points, (points[-1][0], 0.0)]
    closed = [p for k, p in enumerate(closed) if k == 0 or math.dist(p, closed[k - 1]) > 1e-9]
    return cq.Workplane("XZ").polyline(closed).close().extrude(HALF, both=True)


def rows(s: Script, xs: list[float], z: float) -> None:
    """Rows along Y, to and fro; the tool stands beside the part at its end."""
    side = -1.0
    for x in xs:
        s.feed(x, side * OUT, z)
        side = -side
        s.feed(x, side * OUT, z)
    if side > 0:
        s.feed(xs[-1], -OUT, SAFE if z > SAFE else z)


def begun(s: Script, number: int, x: float, z: float) -> None:
    """Load a tool and bring it down beside the part."""
    s.tool(number)
    s.rapid(x, -OUT - 1.0)
    s.rapid(z=SAFE)
    s.rapid(z=z)
    s.feed(x, -OUT, z, FEED)


def spread(a: float, b: float, wide: float) -> list[float]:
    """Places from a to b, at most ``wide`` apart."""
    return np.linspace(a, b, max(1, math.ceil(abs(b - a) / wide)) + 1).tolist() if abs(b - a) > 1e-9 else [a]


def _level_rows(level: tuple[float, float, float, bool, bool], wide: float = 4.0) -> list[float]:
    x0, x1, _, left, right = level
    return spread(x0 + (R if left else 1.0), x1 - (R if right else 1.0), wide)


def _stepped(levels: tuple[tuple[float, float, float, bool, bool], ...], top: float) -> Callable[[], Script]:
    """The program of level faces: the highest first, each in layers down to it."""
    def program() -> Script:
        s = Script(group="base")
        width = max(v[1] for v in levels)
        begun(s, 1, 1.0, top + OVER + 1.0)
        rows(s, spread(1.0, width - 1.0, 4.0), top)
        for level in sorted((v for v in levels if v[2] < top), key=lambda v: -v[2]):
            xs = _level_rows(level)
            s.rapid(z=SAFE)
            s.rapid(xs[0], -OUT)
            count = math.ceil((top - level[2]) / LAYER)
            for k in range(1, count + 1):
                z = top + (level[2] - top) * k / count
                s.rapid(z=z) if k == 1 else s.feed(z=z)
                rows(s, xs, z)
                s.feed(xs[0], -OUT, z)
        s.rapid(z=SAFE)
        return s

    return program


def flat_tip(height: Callable[[F64], F64], x: F64) -> F64:
    """Lowest height of a flat of radius R over a profile for rows at x (n,), mm."""
    t = np.linspace(-R, R, 601)
    return np.array([height(v + t).max() for v in x])


def _sloping(height: Callable[[F64], F64], tips: Callable[[], list[tuple[float, float]]], width: float,
             top: float) -> Callable[[], Script]:
    """The program of sloping faces: layers with the flat 0.3 mm over them, then rows of the ball at ``tips`` (x, z)."""
    def program() -> Script:
        s = Script(group="rough")
        begun(s, 1, 1.0, top + OVER + 1.0)
        x = np.arange(-1.0, width + 1.01, 0.1)
        least = flat_tip(height, x) + 0.3
        z = top + 0.3
        while True:
            free = np.flatnonzero(least <= z)
            if len(free) == 0:
                break
            for run in np.split(free, np.flatnonzero(np.diff(free) > 1) + 1):
                xs = spread(float(x[run[0]]), float(x[run[-1]]), 4.0)
                s.rapid(z=SAFE)
                s.rapid(xs[0], -OUT)
                s.rapid(z=z)
                rows(s, xs, z)
            z -= LAYER
        s.rapid(z=SAFE)
        s.group = "ball"
        path = tips()
        begun(s, 2, path[0][0], path[0][1] + 2.0)
        side = -1.0
        for px, pz in path:
            s.feed(px, side * OUT, pz)
            side = -side
            s.feed(px, side * OUT, pz)
        s.rapid(z=SAFE)
        return s

    return program


SLOPE_DEG, WEDGE_DEG, BOW_RADIUS = 20.0, 15.0, 18.0


def _slope() -> ExactPart:
    t = math.tan(math.radians(SLOPE_DEG))
    width, flat, top = 26.0, 0.0, 12.0
    points = ((0.0, top), (width, top - width * t))

    def tips() -> list[tuple[float, float]]:
        sin, cos = math.sin(math.radians(SLOPE_DEG)), math.cos(math.radians(SLOPE_DEG))
        return [(x + R * sin, top - x * t + R * cos - R) for x in spread(-R * sin - 0.3, width + 0.1, 0.5)]

    height = _over(points)
    return ExactPart("slope", (0.0, -HALF, width, HALF, top), _chain((0.0, flat), *points, (width, 0.0)), height,
                     lambda: _pulled(*points), _sloping(height, tips, width, top), ball=True)


def _wedge() -> ExactPart:
    """A knife edge: the underside level, the top falling to nothing at x = width."""
    t = math.tan(math.radians(WEDGE_DEG))
    width = 26.0
    top = width * t
    points = ((0.0, top), (width, 0.0))

    def tips() -> list[tuple[float, float]]:
        sin, cos = math.sin(math.radians(WEDGE_DEG)), math.cos(math.radians(WEDGE_DEG))
        return [(x + R * sin, top - x * t + R * cos - R) for x in spread(-R * sin - 0.3, width + 0.3, 0.5)]

    height = _over(points)
    return ExactPart("wedge", (0.0, -HALF, width, HALF, top), _chain((0.0, 0.0), *points, (0.0, 0.0)), height,
                     lambda: _pulled(*points), _sloping(height, tips, width, top), ball=True)


def _bow() -> ExactPart:
    """The upper part of a lying cylinder on a block."""
    width, mid, radius = 24.0, 12.0, BOW_RADIUS
    low = 11.0 - radius
    edge = low + math.sqrt(radius**2 - mid**2)

    def height(x: F64) -> F64:
        return np.where((x >= 0) & (x <= width), low + np.sqrt(np.maximum(radius**2 - (x - mid) ** 2, 0.0)), -np.inf)

    def tips() -> list[tuple[float, float]]:
        most = math.asin(mid / radius) + 0.03
        return [(mid + (radius + R) * math.sin(a), low + (radius + R) * math.cos(a) - R)
                for a in spread(-most, most, 0.45 / radius)]

    def build() -> Any:
        import cadquery as cq
        return (cq.Workplane("XZ").moveTo(0, 0).lineTo(0, edge).threePointArc((mid, low + radius), (width, edge))
                .lineTo(width, 0).close().extrude(HALF, both=True))

    outline = (*_chain((0.0, 0.0), (0.0, edge)), Bow((mid, low), radius, 0.0, width),
               *_chain((width, edge), (width, 0.0)))
    return ExactPart("cylinder", (0.0, -HALF, width, HALF, low + radius), outline, height, build,
                     _sloping(height, tips, width, low + radius), ball=True)


def _levelled(name: str, *levels: tuple[float, float, float]) -> ExactPart:
    """A part of level faces (x0, x1, z), from left to right."""
    points: list[tuple[float, float]] = []
    for x0, x1, z in levels:
        points += [(x0, z), (x1, z)]
    top = max(v[2] for v in levels)
    both = tuple((x0, x1, z, k > 0 and levels[k - 1][2] > z, k + 1 < len(levels) and levels[k + 1][2] > z)
                 for k, (x0, x1, z) in enumerate(levels))
    corners = tuple(points)
    width = levels[-1][1]
    return ExactPart(name, (0.0, -HALF, width, HALF, top), _chain((0.0, 0.0), *corners, (width, 0.0)), _over(corners),
                     lambda: _pulled(*corners), _stepped(both, top), levels=both)


BOSS, BOSS_TOP, BOSS_FOOT, BOSS_HALF = 7.0, 11.0, 6.0, 14.0  # mm


def _boss() -> ExactPart:
    """A round boss on a square plate; its axis is Z."""
    def program() -> Script:
        s = Script(group="base")
        out = BOSS_HALF + R + 2.0
        s.tool(1)
        s.rapid(-BOSS_HALF + 1.0, -out)
        s.rapid(z=SAFE)
        s.rapid(z=BOSS_TOP + OVER + 1.0)
        s.feed(z=BOSS_TOP, feed=FEED)
        side = -1.0
        for x in spread(-BOSS_HALF + 1.0, BOSS_HALF - 1.0, 4.0):
            s.feed(x, side * out)
            side = -side
            s.feed(x, side * out)
        s.rapid(z=SAFE)
        count = math.ceil((BOSS_TOP - BOSS_FOOT) / LAYER)
        far = BOSS_HALF * math.sqrt(2.0) + R
        for k in range(1, count + 1):
            z = BOSS_TOP + (BOSS_FOOT - BOSS_TOP) * k / count
            s.rapid(far + 1.0, 0.0)
            s.rapid(z=z)
            for radius in spread(BOSS_HALF * math.sqrt(2.0) - 1.0, BOSS + R, 4.0):
                s.feed(radius, 0.0)
                s.arc(-radius, 0.0, (0.0, 0.0), True)
                s.arc(radius, 0.0, (0.0, 0.0), True)
            s.rapid(z=SAFE)
        return s

    def build() -> Any:
        import cadquery as cq
        plate = cq.Workplane().box(2 * BOSS_HALF, 2 * BOSS_HALF, BOSS_FOOT, centered=(True, True, False))
        return plate.union(cq.Workplane().circle(BOSS).extrude(BOSS_TOP))

    def height(r: F64) -> F64:
        return np.where(r <= BOSS, BOSS_TOP, BOSS_FOOT)

    h = BOSS_HALF
    return ExactPart("boss", (-h, -h, h, h, BOSS_TOP), _chain((0.0, BOSS_TOP), (BOSS, BOSS_TOP), (BOSS, BOSS_FOOT),
                     (2 * h, BOSS_FOOT)), height, build, program, round=True)


POCKET, POCKET_CORNER, POCKET_FLOOR, POCKET_TOP, POCKET_HALF = (9.0, 7.0), 4.0, 5.0, 10.0, (15.0, 12.0)  # mm


class PocketPart(ExactPart):
    """A plate with a pocket of rounded corners; its own distances."""

    def gap(self, p: F64) -> F64:
        """(n,) mm in plan from points (n, 3) to the wall of the pocket, above 0 in the material beside it."""
        q = np.abs(p[:, :2]) - np.array(POCKET) + POCKET_CORNER
        return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0) - POCKET_CORNER

    def inside(self, p: F64) -> NDArray[np.bool_]:
        """(n,) bool: which points (n, 3), mm, lie in the part."""
        x0, y0, x1, y1, top = self.size
        box = (p[:, 0] > x0) & (p[:, 0] < x1) & (p[:, 1] > y0) & (p[:, 1] < y1) & (p[:, 2] > 0) & (p[:, 2] < top)
        return np.asarray(box & ((self.gap(p) > 0) | (p[:, 2] < POCKET_FLOOR)))

    def depth(self, p: F64) -> F64:
        """(n,) mm, how far points (n, 3), mm, are from the surface; 0 outside the part."""
        x0, y0, x1, y1, top = self.size
        far = np.minimum.reduce([p[:, 0] - x0, x1 - p[:, 0], p[:, 1] - y0, y1 - p[:, 1], p[:, 2]])
        gap, under = self.gap(p), POCKET_FLOOR - p[:, 2]
        beside = np.hypot(np.maximum(gap, 0.0), np.maximum(under, 0.0))
        open_above = np.where(gap > 0, top - p[:, 2], np.inf)
        return np.where(self.inside(p), np.minimum.reduce([far, beside, open_above]), 0.0)


def ring(s: Script, a: float, b: float, r: float) -> None:
    """Once round a rectangle -a..a, -b..b with corners r, counter-clockwise from (a, 0), mm."""
    s.feed(a, 0.0)
    for sx, sy, first in ((1, 1, True), (-1, 1, False), (-1, -1, True), (1, -1, False)):
        cx, cy = sx * (a - r), sy * (b - r)
        if first:
            s.feed(sx * a, cy)
            s.arc(cx, sy * b, (cx, cy))
        else:
            s.feed(cx, sy * b)
            s.arc(sx * a, cy, (cx, cy))
    s.feed(a, 0.0)


def _pocket() -> PocketPart:
    hx, hy = POCKET_HALF

    def program() -> Script:
        s = Script(group="base")
        out = hy + R + 2.0
        s.tool(1)
        s.rapid(-hx + 1.0, -out)
        s.rapid(z=SAFE)
        s.rapid(z=POCKET_TOP + OVER + 1.0)
        s.feed(z=POCKET_TOP, feed=FEED)
        side = -1.0
        for x in spread(-hx + 1.0, hx - 1.0, 4.0):
            s.feed(x, side * out)
            side = -side
            s.feed(x, side * out)
        s.rapid(z=SAFE)
        s.rapid(-4.0, 0.0)
        s.rapid(z=POCKET_TOP + 1.5)
        s.feed(z=POCKET_TOP, feed=DOWN)
        z, layer = POCKET_TOP, (POCKET_TOP - POCKET_FLOOR) / 5
        for _ in range(5):
            for k in range(4):
                z -= layer / 4
                s.feed(4.0 if k % 2 == 0 else -4.0, 0.0, z, DOWN)
            s.feed(4.0, 0.0, feed=FEED)
            for o in (2.2, 0.0):
                ring(s, POCKET[0] - R - o, POCKET[1] - R - o, max(POCKET_CORNER - R - o, 0.3) if o else 1.0)
            s.feed(4.0, 0.0)
            s.feed(-4.0, 0.0)
        s.rapid(z=SAFE)
        return s

    def build() -> Any:
        import cadquery as cq
        plate = cq.Workplane().box(2 * hx, 2 * hy, POCKET_TOP, centered=(True, True, False))
        tool = cq.Workplane().box(2 * POCKET[0], 2 * POCKET[1], POCKET_TOP, centered=(True, True, False))
        return plate.cut(tool.edges("|Z").fillet(POCKET_CORNER).translate((0, 0, POCKET_FLOOR)))

    return PocketPart("pocket", (-hx, -hy, hx, hy, POCKET_TOP), (), lambda x: np.full(len(x), POCKET_TOP), build,
                      program)


RIB, RIB_HEIGHT, FLOOR = 0.5, 4.0, 0.4  # mm: thickness and height of the rib, thickness of the floor

PARTS: dict[str, ExactPart] = {p.name: p for p in (
    _levelled("plate", (0.0, 28.0, 10.0)),
    _levelled("rib", (0.0, 12.0, 6.0), (12.0, 12.0 + RIB, 6.0 + RIB_HEIGHT), (12.0 + RIB, 24.5, 6.0)),
    _levelled("step", (0.0, 14.0, 4.0), (14.0, 26.0, 12.0)),
    _levelled("slot", (0.0, 8.0, 10.0), (8.0, 18.0, 5.0), (18.0, 26.0, 10.0)),
    _levelled("floor", (0.0, 7.0, 6.0), (7.0, 19.0, FLOOR), (19.0, 26.0, 6.0)),
    _slope(), _bow(), _wedge(), _boss(), _pocket())}


def setup_of(part: str, changes: dict[str, Any] | None = None) -> dict[str, Any]:
    """SETUP.json of a part, with sections changed."""
    p, own = PARTS[part], dict(changes or {})
    x0, y0, x1, y1, top = p.size
    base: dict[str, Any] = {
        "tools": [FLAT, BALL], "material": "AlMgSi1 6082", "quality": {"scallop_height_mm": 0.02},
        "stock": {"kind": "box", "margin_mm": 0.0, "uncertainty_mm": 0.0, "box_mm": [[x0, y0, 0.0],
                                                                                      [x1, y1, top + OVER]]},
        "machine": {"dialects": ["linuxcnc"], "travel_mm": [800.0, 800.0, 800.0]}}
    for key, value in own.items():
        base[key] = {**base[key], **value} if isinstance(value, dict) and isinstance(base.get(key), dict) else value
    return base
