"""What tools leave of simple blanks, in closed form: volume, distance from the surface, heights along normals.

A blank is the box BOX or a cylinder. ``seg(R, d)`` is the area of a circular segment of height d: the section of a
level slot that a ball of radius R cuts d deep. Volumes of ends and rings are those of bodies of revolution (Pappus:
area of the section times the way of its centroid). Distances are exact in the stock; outside it they are that of the
nearer surface, which beside a sharp edge is less than the way to the edge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from tests.hand_parts import box_mesh
from verify.material.material import machined
from verify.material.stock_field import DistanceField
from verify.model import ProofSetup
from verify.moves import BOW, Moves
from verify.tool_axes import ToolAxes

BOX = np.array([[-6.0, -5.0, -6.0], [6.0, 5.0, 0.0]])
SIDES = 4.0 * (12.0 + 10.0 + 6.0)
UP = np.array([0.0, 0.0, 1.0])
ROUND = 720
"""Moves that a full turn is made of."""


@dataclass(frozen=True, eq=False)
class Machined:
    """A blank, the moves through it, and what is left, exactly.

    volume : mm³ left; cut : (n, 3) mm to (n,) mm, how far points are from what the tool takes, exact outside it
    curved : mm, the sum of both curvatures integrated over what is cut
    sloping : mm² of planes that do not lie along the grid; edges : mm of edges of what is left
    strays : mm, how far the path itself is from the one that the formula is about
    whole  : (n, 3) mm to (n,) mm, distance into the blank
    """

    name: str
    tool: ToolBody
    moves: Moves
    setup: ProofSetup
    volume: float
    cut: Callable[[F64], F64]
    curved: float
    edges: float
    sloping: float = 0.0
    strays: float = 0.0
    whole: Callable[[F64], F64] = lambda p: np.minimum(p - BOX[0], BOX[1] - p).min(axis=1)

    def distance(self, points: F64) -> F64:
        """(n,) mm into what is left, for points (n, 3) mm."""
        return np.minimum(self.whole(points), self.cut(points))

    def volume_bound(self, step: float) -> float:
        """mm³ that the volume of a field may be off at a step, mm, between nodes (docs/theory/proof.md)."""
        swept = 2.0 * self.curved * self.tool.radius + self.sloping
        return (step**2 * (self.curved / 8.0 + self.edges / 2.0) + step * self.sloping / 16.0
                + swept * self.residual_bound)

    @property
    def residual_bound(self) -> float:
        """mm that a residual may be off."""
        turning = self.moves.axes is not None and bool((self.moves.axes.angle > 0).any())
        return (BOW if turning else 1e-6) + self.strays

    def field(self, step: float, shift: F64 | float = 0.0, threads: int = 2) -> DistanceField:
        """The field of this case, its lattice moved by ``shift`` (3,) steps."""
        room = np.array([BOX[0] - 2.0, BOX[1] + 2.0]) + step * np.asarray(shift)
        return machined(box_mesh(*BOX), self.moves, (self.tool,), self.setup, step, box=room, threads=threads)


def path(points, axes=None) -> Moves:
    """Feed moves from point to point, (m + 1, 3) mm, with a tool axis at every point; upright without any."""
    p = np.asarray(points, float)
    m = len(p) - 1
    poses = None
    if axes is not None:
        u = np.broadcast_to(np.asarray(axes, float), p.shape)
        poses = ToolAxes.between(u[:-1], u[1:])
    return Moves(p[:-1], p[1:], np.ones(m, bool), np.zeros(m, np.int32), poses)


def mill(diameter: float, corner: float, flutes: float = 14.0) -> ToolBody:
    """A cutting part; the rest of the tool is far up."""
    return ToolBody("T1", 1, diameter, corner, flutes, 0.9 * diameter, 40.0, diameter, 60.0)


def block(bounds: F64 = BOX) -> ProofSetup:
    """Setup with a box as blank."""
    return ProofSetup(stock_kind="box", stock_box=bounds)


def seg(radius: float, depth: float) -> float:
    """Area of a circular segment."""
    return radius**2 * math.acos(1.0 - depth / radius) - (radius - depth) * math.sqrt(depth * (2.0 * radius - depth))


def beside(p: F64, half: float, y: float = 0.0) -> F64:
    """(n,) mm in plan from a segment along x, ``half`` mm either way."""
    return np.hypot(p[:, 0] - np.clip(p[:, 0], -half, half), p[:, 1] - y)


def rounded(x: F64, y: F64) -> F64:
    """Distance from the quadrant x <= 0, y <= 0; negative inside."""
    return np.where((x > 0) | (y > 0), np.hypot(np.maximum(x, 0), np.maximum(y, 0)), np.maximum(x, y))


LEFT = float(np.prod(BOX[1] - BOX[0]))


def ball_slot() -> Machined:
    """Right through the box, 2 mm deep with a ball of 6: seg(R, d) times the length."""
    r, d, y = 3.0, 2.0, 0.13
    arc = 2.0 * math.acos(1.0 - d / r)
    return Machined("ball slot", mill(2 * r, r), path([[-12, y, -d], [12, y, -d]]), block(), LEFT - 12 * seg(r, d),
                    lambda p: np.hypot(p[:, 1] - y, p[:, 2] - r + d) - r, 12 * arc, SIDES + 24 + 2 * r * arc)


def closed_slot() -> Machined:
    """A ball of 4, 3 mm deep along 6 mm: half a disc and a rectangle times 6; the ends make a half ball and a round."""
    r, d, half = 2.0, 3.0, 3.0
    gone = 2 * half * (0.5 * math.pi * r**2 + 2 * r * (d - r)) + math.pi * r**2 * (2 * r / 3 + d - r)
    return Machined("slot with round ends", mill(2 * r, r), path([[-half, 0, 4], [-half, 0, -d], [half, 0, -d]]),
                    block(), LEFT - gone, lambda p: rounded_bottom(beside(p, half), p[:, 2] + d, 0.0, r),
                    2 * math.pi * (half + d + r), SIDES + 4 * half + 2 * math.pi * r)


def rounded_bottom(rho: F64, h: F64, flat: float, corner: float) -> F64:
    """Distance to a cutting profile that goes up without end, at distance rho from its axis and height h, mm."""
    return rounded(rho - flat, corner - h) - corner


def pocket() -> Machined:
    """A flat of 3 over 5 x 4 mm: the Minkowski sum of rectangle and disc (4ab + 2R(2a + 2b) + pi R²), 2 mm deep."""
    r, a, b, d = 1.5, 2.5, 2.0, 2.0
    rows = [[x, y, -d] for k, y in enumerate(np.linspace(-b, b, 5)) for x in ((-a, a) if k % 2 == 0 else (a, -a))]
    round_ = [[a, b, -d], [-a, b, -d], [-a, -b, -d], [a, -b, -d], [a, b, -d]]
    rim = 4 * a + 4 * b + 2 * math.pi * r

    def cut(p: F64) -> F64:
        x, y = np.abs(p[:, 0]) - a, np.abs(p[:, 1]) - b
        return rounded(rounded(x, y) - r, -d - p[:, 2])
    return Machined("flat pocket", mill(2 * r, 0.0), path([[-a, -b, 3], *rows, *round_]), block(),
                    LEFT - d * (4 * a * b + 4 * r * (a + b) + math.pi * r**2), cut, 2 * math.pi * d, SIDES + 2 * rim)


def wedge(lean: float = 0.5) -> Machined:
    """A flat of 6 that leans aside cuts a right-angled groove: its two sides are d / sin and d / cos of the lean."""
    r, d, y = 3.0, 1.5, 0.7
    s, c = math.sin(lean), math.cos(lean)
    tip = np.array([0.0, y - r * c, r * s - d])

    def cut(p: F64) -> F64:
        w = p[:, 1:] - [y, -d]
        return rounded(-w @ [s, c], w @ [c, -s])
    return Machined(f"flat leaning aside {math.degrees(lean):.0f}°", mill(2 * r, 0.0),
                    path([tip - [12, 0, 0], tip + [12, 0, 0]], [0, s, c]), block(), LEFT - 12 * d**2 / (2 * s * c), cut,
                    0.0, SIDES + 36 + 2 * (d / s + d / c), sloping=12 * (d / s + d / c))


def trough() -> Machined:
    """A flat of 6 that leans forward: the disc of its end is seen as an ellipse, so the section is that of a circle of
    its radius, d / sin deep, pressed flat by sin."""
    r, d, lean = 3.0, 0.8, 0.35
    s, c = math.sin(lean), math.cos(lean)
    z = r * s - d
    y0 = math.sqrt(r**2 - (z / s) ** 2)
    return Machined("flat leaning forward", mill(2 * r, 0.0), path([[-20, 0, z], [20, 0, z]], [s, 0, c]), block(),
                    LEFT - 12 * s * seg(r, d / s), lambda p: ellipse(p[:, 1], p[:, 2] - z, r, r * s),
                    12 * 2 * math.atan(y0 * s * s / abs(z)), SIDES + 24 + 4 * y0)


def ellipse(x: F64, y: F64, a: float, b: float) -> F64:
    """Signed distance to an ellipse of half axes a > b: the root of its Lagrange multiplier, by halving."""
    low, high = np.full(len(x), -b * b), np.hypot(a * x, b * y)
    for _ in range(90):
        t = 0.5 * (low + high)
        outside = (a * x / (t + a * a)) ** 2 + (b * y / (t + b * b)) ** 2 > 1.0
        low, high = np.where(outside, t, low), np.where(outside, high, t)
    fx, fy = a * a * x / (t + a * a), b * b * y / (t + b * b)
    return np.sign((x / a) ** 2 + (y / b) ** 2 - 1.0) * np.hypot(x - fx, y - fy)


def bull_slot() -> Machined:
    """A bull nose of 4 with a corner of 0.75, 1.5 mm deep: rectangles and quarters of a disc along the slot, and the
    same turned about its ends: pi a² r for the flat, pi² r² a / 2 + 2 pi r³ / 3 for the ring of the corner."""
    r, q, d, half = 2.0, 0.75, 1.5, 3.0
    a = r - q
    gone = (2 * half * (2 * r * (d - q) + 2 * a * q + 0.5 * math.pi * q**2) + math.pi * r**2 * (d - q)
            + math.pi * a**2 * q + 0.5 * math.pi**2 * q**2 * a + 2 * math.pi * q**3 / 3)
    curved = 2 * math.pi * (half + d - q) + math.pi**2 * r + 2 * math.pi * q
    return Machined("bull-nose slot", mill(2 * r, q), path([[-half, 0, 4], [-half, 0, -d], [half, 0, -d]]), block(),
                    LEFT - gone, lambda p: rounded_bottom(beside(p, half), p[:, 2] + d, a, q), curved,
                    SIDES + 4 * half + 2 * math.pi * r)


def plunge() -> Machined:
    """A ball of 4 straight down 3 mm: half a ball and a round above it."""
    r, d, at = 2.0, 3.0, np.array([0.6, -0.4])
    return Machined("ball plunge", mill(2 * r, r), path([[*at, 5], [*at, -d]]), block(),
                    LEFT - math.pi * r**2 * (2 * r / 3 + d - r),
                    lambda p: rounded_bottom(np.hypot(*(p[:, :2] - at).T), p[:, 2] + d, 0.0, r),
                    2 * math.pi * (d + r), SIDES + 2 * math.pi * r)


def pivot() -> Machined:
    """A ball of 6 that turns about its standing centre, 1.7 mm deep, leans by 20° at most: it cuts a cap,
    pi d² (3R - d) / 3, and turning takes nothing more, as what is above its equator stays over the top."""
    r, lift = 3.0, 1.3
    d, centre = r - lift, np.array([0.2, 0.1, lift])
    lean = np.radians(np.linspace(-20, 20, 81))
    axes = np.stack([np.sin(lean) * 0.6, np.sin(lean) * 0.8, np.cos(lean)], 1)
    rim = math.sqrt(r * r - lift * lift)
    return Machined("turning about a ball", mill(2 * r, r), path(centre - r * axes, axes), block(),
                    LEFT - math.pi * d**2 * (3 * r - d) / 3, lambda p: np.linalg.norm(p - centre, axis=1) - r,
                    4 * math.pi * d, SIDES + 2 * math.pi * rim, strays=r * (1 - math.cos(math.radians(0.25))))


def cone() -> Machined:
    """The flank of a flat of 6 goes round with C: a frustum is left, pi h (r² + r R + R²) / 3, of a bar of 9 mm."""
    radius, lean, top, high, bar, deep = 3.0, 0.3, 2.0, 4.0, 4.5, -6.2
    s, c, t = math.sin(lean), math.cos(lean), math.tan(lean)
    turn = np.linspace(0, 2 * math.pi, ROUND + 1)
    out = np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1)
    tip = out * (top - deep * t + radius * c) + UP * (deep + radius * s)
    low = top + high * t

    def whole(p: F64) -> F64:
        return np.minimum(np.minimum(-p[:, 2], p[:, 2] + high), bar - np.hypot(p[:, 0], p[:, 1]))
    return Machined("cone by flank and C", mill(2 * radius, 0.0), path(tip, c * UP - s * out),
                    ProofSetup(stock_kind="cylinder", stock_cylinder=(0.0, 0.0, -high, bar, high)),
                    math.pi * high * (top**2 + top * low + low**2) / 3,
                    lambda p: c * (top - p[:, 2] * t - np.hypot(p[:, 0], p[:, 1])), 2 * math.pi * high,
                    2 * math.pi * (top + low), whole=whole,
                    strays=float(np.hypot(*tip[0, :2])) * (1 - math.cos(math.pi / ROUND)))


def torus() -> Machined:
    """A ball of 3 carried round a circle of 3 mm, 1 mm deep: seg(R, d) times the way of its centroid."""
    r, d, big = 1.5, 1.0, 3.0
    turn = np.linspace(0, 2 * math.pi, ROUND + 1)
    ring = np.stack([big * np.cos(turn), big * np.sin(turn), np.full(len(turn), -d)], 1)
    arc = 2 * math.acos(1 - d / r)
    return Machined("torus groove", mill(2 * r, r), path([[big, 0, 3], *ring]), block(),
                    LEFT - 2 * math.pi * big * seg(r, d),
                    lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - big, p[:, 2] - r + d) - r,
                    2 * math.pi * big * arc, SIDES + 4 * math.pi * big, strays=big * (1 - math.cos(math.pi / ROUND)))


CASES = {build.__name__: build for build in (ball_slot, closed_slot, pocket, wedge, trough, bull_slot, plunge, pivot,
                                             cone, torus)}
