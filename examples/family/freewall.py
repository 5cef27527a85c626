"""Walls along any profile: open or closed, tapered, leaning, twisted; faces whole, in strips or merged into one."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from shapely.geometry import Polygon

from examples.family.profiles import DrawnProfile
from examples.family.splines import F64, interpolate, interpolate_closed, to_edge
from examples.family.walls import BURIED, LEFT, RIGHT, WallSpec

SECTION_SAMPLES = 321
CAP_NODES = 7
NODES = {None: 5, "C1": 17, "C4": 17, "C2": 25, "C3": 33, "C7": 41, "C8": 41, "C9": 33, "C10": 45,
         "oval": 33, "C5": 61, "C6": 49}
"""Nodes of each rail, in step with the bends: every knot costs triangles later."""


@dataclass(frozen=True, eq=False)
class FreeWall(WallSpec):
    """A wall whose centre line is a drawn profile.

    profile : DrawnProfile in plan, mm; its curve is the middle of an open wall and the inner side of a closed one
    strips  : number of faces of each side along the wall; a closed side of one face has a seam
    merged  : whether both sides and both ends are one face (ends rounded)

    Thickness, lean and height are those of WallSpec; lean differs between start and end where the wall is twisted.
    """

    profile: DrawnProfile = None  # type: ignore[assignment]
    strips: int = 1
    merged: bool = False

    facing_dot = -0.3
    sees_itself = True

    @property
    def segments(self) -> int:  # type: ignore[override]
        """Six chords a node."""
        return 6 * NODES[self.profile.type]

    @property
    def closed(self) -> bool:  # type: ignore[override]
        return self.profile.closed

    @cached_property
    def centre_line(self) -> BSpline:
        return self.profile.curve

    @property
    def features(self) -> set[str]:
        """Words for the special features of the wall."""
        words = {"closed"} if self.closed else set()
        words |= {"seam"} if self.closed and self.strips == 1 else set()
        words |= {"strips"} if self.strips > (2 if self.closed else 1) else set()
        words |= {"merged_face"} if self.merged else set()
        words |= {"taper"} if self.thickness[0] != self.thickness[1] else set()
        if any(self.lean):
            words.add("leaning" if self.lean[0] == self.lean[1] else "twisted")
        return words

    @property
    def steepest_turn(self) -> float:
        """0: a free wall may face itself, and its gaps count that."""
        return 0.0

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Box of floor and top in plan: x0, y0, x1, y1, mm."""
        boxes = np.array([self.section(z).bounds for z in (self.z_floor, self.z_top)])
        return (*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0))

    def moved(self, dx: float, dy: float) -> FreeWall:
        """The wall shifted in plan, mm."""
        return replace(self, profile=self.profile.at((dx, dy)))

    def _nodes(self) -> F64:
        return np.linspace(0.0, 1.0, NODES[self.profile.type])

    def _offsets(self, u: F64, side: float, v: float) -> F64:
        dz = v * self.height
        lean = self.lean[0] + (self.lean[1] - self.lean[0]) * u
        half = 0.5 * (self.thickness[0] + (self.thickness[1] - self.thickness[0]) * v)
        middle = -0.25 * (self.thickness[0] + self.thickness[1]) if self.closed else 0.0
        xy = self.centre_line(u) + self.plan_normal(u) * (lean * dz + side * half + middle)[..., None]
        return np.column_stack([xy, np.full(len(u), self.z_floor + dz)])

    def _rail(self, side: int, v: float) -> BSpline:
        u = self._nodes()
        points = self._offsets(u, float(side), v)
        if not self.closed:
            return interpolate(u, points)
        points[-1] = points[0]
        return interpolate_closed(u, points)

    def loop(self, v: float) -> BSpline:
        """Both sides and both rounded ends as one closed curve: right side 0..1, end, left side back, other end.

        v : 0 at the floor, 1 at the top

        The ends have the parameter speed of the sides, and the nodes of a side come closer together towards an end. A
        step of
        either would make the curve oscillate.
        """
        u, half_turn = self._side_nodes, np.linspace(0, np.pi, CAP_NODES + 2)[1:-1]
        right, left = self._rail(RIGHT, v), self._rail(LEFT, v)
        caps = []
        for at, a, b in ((1.0, right, left), (0.0, left, right)):
            p, q = a(at), b(at)
            out = a.derivative()(at) * [1, 1, 0] * (1.0 if at else -1.0)
            out *= 0.5 * np.linalg.norm(q - p) / np.hypot(*out[:2])
            caps.append(0.5 * (p + q) + 0.5 * (p - q) * np.cos(half_turn)[:, None] + out * np.sin(half_turn)[:, None])
        share = np.arange(1, CAP_NODES + 1) / (CAP_NODES + 1)
        first, last = self._caps
        t = np.concatenate([u, 1 + last * share, 1 + last + u, 2 + last + first * share, [2 + last + first]])
        return interpolate_closed(t, np.vstack([right(u), caps[0], left(u[::-1]), caps[1], right(u[:1])]))

    @cached_property
    def _caps(self) -> tuple[float, float]:
        """Parameter widths of the rounded ends at u = 0 and 1, in the speed of the sides there at half height."""
        out = []
        for u in (0.0, 1.0):
            right, left = (self._rail(s, 0.5) for s in (RIGHT, LEFT))
            speed = 0.5 * sum(float(np.hypot(*k.derivative()(u)[:2])) for k in (right, left))
            out.append(0.5 * np.pi * float(np.linalg.norm((right(u) - left(u))[:2])) / speed)
        return out[0], out[1]

    @cached_property
    def _side_nodes(self) -> F64:
        """Nodes of a side of the loop: those of the rail, between them and the ends ever closer ones.

        They lie the same way round on both sides, or a ruled face between two loops would not be ruled.
        """
        u = self._nodes()
        step = min(self._caps) / (CAP_NODES + 1)
        near = np.cumsum(step * 2.0 ** np.arange(12))
        near = near[near < 0.5 * u[1]]
        return np.unique(np.concatenate([u, near, 1.0 - near]))

    @cached_property
    def _loops(self) -> tuple[BSpline, BSpline]:
        return self.loop(0.0), self.loop(1.0)

    def _along_loop(self, side: int, u: F64) -> tuple[F64, float]:
        """Parameter of the loop at u of a side, and the parameter speed there."""
        t = 2.0 + self._caps[1] - np.asarray(u) if side == LEFT else np.asarray(u)
        return t, -1.0 if side == LEFT else 1.0

    def with_ends(self) -> FreeWall:
        """The wall with sides that extend around its ends to their middle, where sides and ends are one face."""
        return self._whole if self.merged else self

    @cached_property
    def _whole(self) -> FreeWall:
        return _RoundEnded(**{f.name: getattr(self, f.name) for f in fields(self)})

    def side_point(self, side: int, u: F64, v: F64) -> F64:
        """Points of a side surface, as WallSpec.side_point.

        u, v : (n,) float64, dimensionless, parameters along the wall and up

        Returns (n, 3) float64, mm, part frame.
        """
        if not self.merged:
            return super().side_point(side, u, v)
        t, _ = self._along_loop(side, u)
        lo, hi = (k(t) for k in self._loops)
        return np.asarray(lo + (hi - lo) * np.asarray(v)[..., None])

    def side_derivatives(self, side: int, u: F64, v: F64) -> tuple[F64, F64]:
        """Partial derivatives of a side surface by u and by v, as WallSpec.side_derivatives.

        u, v : (n,) float64, dimensionless, parameters along the wall and up

        Returns two (n, 3) float64, mm, part frame.
        """
        if not self.merged:
            return super().side_derivatives(side, u, v)
        t, sign = self._along_loop(side, u)
        (lo, hi), (dlo, dhi) = (k(t) for k in self._loops), (sign * k.derivative()(t) for k in self._loops)
        return np.asarray(dlo + (dhi - dlo) * np.asarray(v)[..., None]), np.asarray(hi - lo)

    @cached_property
    def _sections(self) -> dict[float, Polygon]:
        return {}

    def section(self, z: float, samples: int = SECTION_SAMPLES) -> Polygon:
        """The wall cut at height z (mm), with a hole where it is closed."""
        key = round(z, 6)
        if key not in self._sections:
            self._sections[key] = self._cut(z, samples)
        return self._sections[key]

    def _cut(self, z: float, samples: int) -> Polygon:
        u = np.linspace(0.0, 1.0, samples)
        v = np.full(samples, (z - self.z_floor) / self.height)
        left, right = (self.with_ends().side_point(s, u, v)[:, :2] for s in (LEFT, RIGHT))
        return Polygon(right, [left]) if self.closed else Polygon(np.vstack([left, right[::-1]]))

    def side_curve(self, side: int, v: float = 0.5, samples: int = 1001) -> F64:
        """A side at one height, in the direction with the free space on the left.

        Returns (samples, 2) float64, mm, plan coordinates, evenly spaced. Closed sides have one point less, since the
        end point
        is not repeated.
        """
        u = np.linspace(0.0, 1.0, 4 * samples)
        p = self.side_point(side, u, np.full(len(u), v))[:, :2]
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
        even = np.interp(np.linspace(0.0, s[-1], samples), s, u)
        p = self.side_point(side, even, np.full(samples, v))[:, :2]
        p = p[:-1] if self.closed else p
        return p if side == LEFT else p[::-1]

    def solid(self) -> Any:
        """The wall as a cadquery Solid, reaching ``BURIED`` mm below its floor."""
        bottom = -BURIED / self.height
        if self.closed:
            outer, inner = ([self._edge(self._rail(s, v), self.strips) for v in (bottom, 1.0)] for s in (RIGHT, LEFT))
            return _loft(outer).cut(_loft(inner)).Solids()[0]
        if self.merged:
            return _loft([self._edge(self.loop(v)) for v in (bottom, 1.0)])
        return _loft([self._outline(v) for v in (bottom, 1.0)])

    @staticmethod
    def _edge(curve: BSpline, pieces: int = 1) -> Any:
        import cadquery as cq

        if pieces == 1:
            return cq.Wire.assembleEdges([to_edge(curve)])
        at = np.linspace(curve.t[0], curve.t[-1], pieces + 1)
        spans = zip(at[:-1], at[1:], strict=True)
        return cq.Wire.assembleEdges([to_edge(curve, (float(a), float(b))) for a, b in spans])

    def _outline(self, v: float) -> Any:
        if self.strips == 1:
            return super()._outline(v)
        import cadquery as cq

        left, right = self._rail(LEFT, v), self._rail(RIGHT, v)
        at = np.linspace(0.0, 1.0, self.strips + 1)
        pieces = list(zip(at[:-1], at[1:], strict=True))
        there = [to_edge(right, (float(a), float(b))) for a, b in pieces]
        back = [cq.Edge(to_edge(left, (float(a), float(b))).wrapped.Reversed()) for a, b in pieces[::-1]]
        ends = [cq.Edge.makeLine(cq.Vector(*right(u)), cq.Vector(*left(u))) for u in (1.0, 0.0)]
        ends[1] = cq.Edge.makeLine(cq.Vector(*left(0.0)), cq.Vector(*right(0.0)))
        return cq.Wire.assembleEdges([*there, ends[0], *back, ends[1]])


class _RoundEnded(FreeWall):
    """See ``FreeWall.with_ends``."""

    def with_ends(self) -> FreeWall:
        return self

    def _along_loop(self, side: int, u: F64) -> tuple[F64, float]:
        first, last = self._caps
        speed = 1.0 + 0.5 * (first + last)
        if side == LEFT:
            return 2.0 + last + 0.5 * first - speed * np.asarray(u), -speed
        return np.mod(-0.5 * first + speed * np.asarray(u), 2.0 + first + last), speed


def _loft(wires: list[Any]) -> Any:
    """Ruled solid between a lower and an upper cadquery Wire of equally many edges."""
    import cadquery as cq
    from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections

    loft = BRepOffsetAPI_ThruSections(True, True, 1e-6)
    loft.CheckCompatibility(False)
    for wire in wires:
        loft.AddWire(wire.wrapped)
    loft.Build()
    return cq.Solid(loft.Shape())
