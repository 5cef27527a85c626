"""Walls of the family: a centre line in plan, thickened, tapered and leaned.

A point of a side is ``centre(u) + n(u) * (lean(u) * dz ± thickness(z) / 2)``. Here n is the plan normal to the left of
the centre line, and dz the height above the floor. Both sides are ruled surfaces between two cubic B-splines (floor and
top), so a section at any height is again a B-spline with linearly mixed poles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from shapely.geometry import Polygon

from examples.family.splines import F64, interpolate, to_edge

BURIED = 0.5
"""Depth, mm, by which a wall reaches into the plate so that the union is clean."""

LEFT, RIGHT = 1, -1


@dataclass(frozen=True, eq=False)
class WallSpec:
    """One wall, before it becomes a solid.

    kind          : 'straight', 'curved', 'leaning', 'blade' or 'splitter'
    centre        : (n, 2) float64, mm, points of the centre line on the floor, n >= 4 unless straight (2)
    z_floor       : mm, height of the floor the wall stands on
    height        : mm, floor to top
    thickness     : mm at the floor and at the top
    lean          : mm sideways (to the left of the centre line) per mm of height, at the start and at the end
    """

    kind: str
    centre: F64
    z_floor: float
    height: float
    thickness: tuple[float, float]
    lean: tuple[float, float] = (0.0, 0.0)

    closed = False
    """Whether the wall is a ring; the left side is then the inner one."""
    facing_dot = 0.0
    """Two sides face each other where the product of their normals is below this."""
    segments = 80
    """Chords of the plan section that rays start from."""
    sees_itself = False
    """Whether a side may face another stretch of the same wall."""

    @property
    def z_top(self) -> float:
        """Height of the top face, mm."""
        return self.z_floor + self.height

    @cached_property
    def parameters(self) -> F64:
        """(n,) float64, dimensionless, chord-length parameters of the centre points, 0 to 1."""
        steps = np.linalg.norm(np.diff(self.centre, axis=0), axis=1)
        s = np.concatenate([[0.0], np.cumsum(steps)])
        return np.asarray(s / s[-1])

    @cached_property
    def centre_line(self) -> BSpline:
        """Plan centre line on the floor, parameter 0 to 1."""
        return interpolate(self.parameters, self.centre)

    @cached_property
    def length(self) -> float:
        """Length of the centre line on the floor, mm (polyline of 400 chords)."""
        p = self.centre_line(np.linspace(0.0, 1.0, 401))
        return float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum())

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Box of floor and top in plan: x0, y0, x1, y1, mm."""
        boxes = np.array([self.section(z).bounds for z in (self.z_floor, self.z_top)])
        return (*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0))

    def plan_normal(self, u: F64) -> F64:
        """Unit plan normals to the left of the centre line.

        u : (n,) float64, dimensionless, parameters in 0..1

        Returns (n, 2) float64, dimensionless, plan coordinates.
        """
        d = np.atleast_2d(self.centre_line.derivative()(u))
        n = np.column_stack([-d[:, 1], d[:, 0]])
        return np.asarray(n / np.linalg.norm(n, axis=1)[:, None])

    def _nodes(self) -> F64:
        # The rails define the truth, so they have no more knots than the shape needs; every knot costs triangles later.
        return np.array([0.0, 1.0]) if self.kind == "straight" else np.linspace(0.0, 1.0, 13)

    def _rail(self, side: int, v: float) -> BSpline:
        u = self._nodes()
        dz = v * self.height
        lean = self.lean[0] + (self.lean[1] - self.lean[0]) * u
        half = 0.5 * (self.thickness[0] + (self.thickness[1] - self.thickness[0]) * v)
        xy = self.centre_line(u) + self.plan_normal(u) * (lean * dz + side * half)[:, None]
        return interpolate(u, np.column_stack([xy, np.full(len(u), self.z_floor + dz)]))

    @cached_property
    def _rails(self) -> dict[tuple[int, int], BSpline]:
        return {(side, end): self._rail(side, float(end)) for side in (LEFT, RIGHT) for end in (0, 1)}

    @cached_property
    def _slopes(self) -> dict[tuple[int, int], BSpline]:
        return {key: rail.derivative() for key, rail in self._rails.items()}

    def with_ends(self) -> WallSpec:
        """The wall whose sides bound the gaps."""
        return self

    def side_point(self, side: int, u: F64, v: F64) -> F64:
        """Points of a side surface.

        side : LEFT (+1) or RIGHT (-1) of the centre line
        u, v : (n,) float64, dimensionless, parameters along the wall and from floor (0) to top (1)

        Returns (n, 3) float64, mm, part frame.
        """
        lo, hi = self._rails[side, 0](u), self._rails[side, 1](u)
        w = np.asarray(v)[..., None]
        return np.asarray(lo + (hi - lo) * w)

    def side_derivatives(self, side: int, u: F64, v: F64) -> tuple[F64, F64]:
        """Partial derivatives of a side surface by u and by v.

        side : as in ``side_point``
        u, v : (n,) float64, dimensionless, as in ``side_point``

        Returns two (n, 3) float64, mm, part frame.
        """
        lo, hi = self._rails[side, 0], self._rails[side, 1]
        w = np.asarray(v)[..., None]
        dlo, dhi = self._slopes[side, 0](u), self._slopes[side, 1](u)
        return np.asarray(dlo + (dhi - dlo) * w), np.asarray(hi(u) - lo(u))

    def side_normal(self, side: int, u: F64, v: F64) -> F64:
        """Unit normals of a side, out of the material.

        side : as in ``side_point``
        u, v : (n,) float64, dimensionless, as in ``side_point``

        Returns (n, 3) float64, dimensionless, part frame.
        """
        du, dv = self.side_derivatives(side, u, v)
        n = -side * np.cross(du, dv)
        return np.asarray(n / np.linalg.norm(n, axis=-1)[..., None])

    @cached_property
    def _coarse(self) -> dict[int, tuple[F64, F64]]:
        u = np.linspace(0.0, 1.0, self.segments + 1)
        low, high = np.zeros(len(u)), np.ones(len(u))
        return {s: (self.side_point(s, u, low)[:, :2], self.side_point(s, u, high)[:, :2]) for s in (LEFT, RIGHT)}

    def trace(self, side: int, v: float) -> F64:
        """A side cut at share v of the height by ``segments`` chords: (segments + 1, 2) float64, mm, plan coordinates.
        """
        low, high = self._coarse[side]
        return np.asarray(low + (high - low) * v)

    def section(self, z: float, samples: int = 121) -> Polygon:
        """The wall cut at height z, as a shapely polygon (mm); ``samples`` points a side."""
        u = np.linspace(0.0, 1.0, samples)
        v = np.full(samples, (z - self.z_floor) / self.height)
        left, right = self.side_point(LEFT, u, v), self.side_point(RIGHT, u, v)
        return Polygon(np.vstack([left, right[::-1]])[:, :2])

    def axis_point(self, u: float, z: float) -> F64:
        """Centre of the wall at parameter u and height z, (2,) float64, mm."""
        uu, vv = np.array([u]), np.array([(z - self.z_floor) / self.height])
        return np.asarray(0.5 * (self.side_point(LEFT, uu, vv) + self.side_point(RIGHT, uu, vv))[0, :2])

    @property
    def thickness_mid(self) -> float:
        """Thickness along the side normal at mid height, mm, mean along the wall."""
        slope = np.arctan(0.5 * (self.lean[0] + self.lean[1]))
        return float(0.5 * (self.thickness[0] + self.thickness[1]) * np.cos(slope))

    @property
    def steepest_turn(self) -> float:
        """Largest angle, rad, between the centre line and its own chord; below 45° no side sees itself."""
        d = self.centre_line.derivative()(np.linspace(0.0, 1.0, 201))
        chord = self.centre[-1] - self.centre[0]
        cross = chord[0] * d[:, 1] - chord[1] * d[:, 0]
        return float(np.abs(np.arctan2(cross, d @ chord)).max())

    def solid(self) -> Any:
        """The wall as a cadquery Solid, reaching ``BURIED`` mm below its floor."""
        import cadquery as cq
        from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections

        loft = BRepOffsetAPI_ThruSections(True, True, 1e-6)
        loft.CheckCompatibility(False)
        for v in (-BURIED / self.height, 1.0):
            loft.AddWire(self._outline(v).wrapped)
        loft.Build()
        return cq.Solid(loft.Shape())

    def _outline(self, v: float) -> Any:
        import cadquery as cq

        left, right = to_edge(self._rail(LEFT, v)), to_edge(self._rail(RIGHT, v))
        ends = [
            cq.Edge.makeLine(cq.Vector(*a), cq.Vector(*b))
            for a, b in (
                (self._rail(RIGHT, v)(1.0), self._rail(LEFT, v)(1.0)),
                (self._rail(LEFT, v)(0.0), self._rail(RIGHT, v)(0.0)),
            )
        ]
        reverse = cq.Edge(left.wrapped.Reversed())
        return cq.Wire.assembleEdges([right, ends[0], reverse, ends[1]])
