"""The blank before the first cut: its box, cylinder or mesh, and the stock on normals of the part.

Coordinates are float64, mm, in the setup frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import VerificationError
from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from verify.blank.mesh_blank_exit import way_out_of_mesh
from verify.model import ProofSetup, StockKind

UPRIGHT = 1e-9  # of a unit axis: smaller components count as 0
WITHIN = 1e-3  # mm along a direction that a place in the blank has before it


def stock_bounds(bounds: F64, setup: ProofSetup) -> F64:
    """Bounding box of the blank round a part.

    bounds : (2, 3) float64, mm, setup frame, of the part

    Returns (2, 3) float64, mm, setup frame.
    """
    grow = setup.margin + setup.uncertainty
    if setup.stock_kind == StockKind.BOX and setup.stock_box is not None:
        return np.asarray(setup.stock_box, dtype=np.float64)
    if setup.stock_kind == StockKind.CYLINDER:
        return blank_cylinder(bounds, setup).bounds
    if setup.stock_kind == StockKind.STEP:
        return blank_mesh(setup).bounds + np.array([[-setup.uncertainty], [setup.uncertainty]])
    lower = bounds[0] - grow
    if setup.stock_kind == StockKind.BOX:
        lower[2] = bounds[0, 2]
    return np.array([lower, bounds[1] + grow])


def stands_over_air(setup: ProofSetup) -> bool:
    """Whether the uncut blank has overhangs that a tool may go under."""
    if setup.stock_kind == StockKind.CYLINDER:
        return bool(np.hypot(*setup.stock_axis[:2]) > UPRIGHT)
    return setup.stock_kind in (StockKind.PART_OFFSET, StockKind.STEP)


@dataclass(frozen=True, eq=False)
class BlankCylinder:
    """A cylinder blank in any orientation.

    foot : (3,) float64, mm, middle of its lower end; axis : (3,) float64, unit, from there, Z not below 0
    radius, height : mm

    Notes
    -----
    A place p is inside where 0 <= t <= height and |q| <= radius, with t = (p - foot) a and q = p - foot - t a.
    """

    foot: F64
    axis: F64
    radius: float
    height: float

    @property
    def upright(self) -> bool:
        """Whether it stands along Z."""
        return bool(np.hypot(self.axis[0], self.axis[1]) <= UPRIGHT)

    @property
    def bounds(self) -> F64:
        """(2, 3) float64, mm, setup frame: the smallest box along the axes that holds the cylinder."""
        ends = np.array([self.foot, self.foot + self.height * self.axis])
        aside = self.radius * np.sqrt(np.maximum(1.0 - self.axis**2, 0.0))
        return np.array([ends.min(axis=0) - aside, ends.max(axis=0) + aside])

    def tops(self, x: F64, y: F64) -> F64:
        """Heights at which vertical lines leave the cylinder upwards.

        x, y : (i, j) float64, mm, or any one shape

        Returns (i, j) float64, mm, -inf where a line misses the cylinder.
        """
        wx, wy = x - self.foot[0], y - self.foot[1]
        if self.upright:
            return np.where(np.hypot(wx, wy) <= self.radius, self.foot[2] + self.height, -np.inf)
        ax, ay, az = self.axis.tolist()
        along = wx * ax + wy * ay  # t at the height of the foot
        aside2 = ax * ax + ay * ay  # |q|² = c + 2 b z + aside2 z²
        b, c = -along * az, wx * wx + wy * wy - along * along
        root = b * b - aside2 * (c - self.radius**2)
        half = np.sqrt(np.maximum(root, 0.0)) / aside2
        low, high = -b / aside2 - half, -b / aside2 + half
        inside = root >= 0.0
        if az > UPRIGHT:
            low, high = np.maximum(low, -along / az), np.minimum(high, (self.height - along) / az)
        else:
            inside &= (along >= 0.0) & (along <= self.height)
        return np.where(inside & (low <= high), self.foot[2] + high, -np.inf)

    def depth(self, x: F64, y: F64, z: F64) -> F64:
        """Depth of places below the surface of the cylinder.

        x, y, z : (i, j, k) float64, mm, or any shapes that broadcast together

        Returns (i, j, k) float64, mm, negative outside; its size is never more than the distance to the surface.
        """
        wx, wy, wz = x - self.foot[0], y - self.foot[1], z - self.foot[2]
        if self.upright:
            return np.asarray(np.minimum(self.radius - np.hypot(wx, wy), np.minimum(wz, self.height - wz)))
        ax, ay, az = self.axis.tolist()
        along = wx * ax + wy * ay + wz * az
        off = np.sqrt((wx - along * ax) ** 2 + (wy - along * ay) ** 2 + (wz - along * az) ** 2)
        return np.asarray(np.minimum(self.radius - off, np.minimum(along, self.height - along)))

    def way_out(self, points: F64, directions: F64) -> F64:
        """Distance from points inside to the surface along directions.

        points     : (n, 3) float64, mm, setup frame
        directions : (n, 3) float64, unit, setup frame

        Returns (n,) float64, mm.
        """
        w = points - self.foot
        along, slope = w @ self.axis, directions @ self.axis
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.where(slope > 0.0, (self.height - along) / slope, np.where(slope < 0.0, -along / slope, np.inf))
        q, n = w - along[:, None] * self.axis, directions - slope[:, None] * self.axis
        a, b, c = (n * n).sum(axis=1), (q * n).sum(axis=1), (q * q).sum(axis=1) - self.radius**2
        side = np.where(a > 1e-12, (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / np.maximum(a, 1e-12), np.inf)
        return np.asarray(np.minimum(ends, side))


def blank_cylinder(bounds: F64, setup: ProofSetup) -> BlankCylinder:
    """The cylinder blank of a setup; an upright one round the part where the setup gives none.

    bounds : (2, 3) float64, mm, setup frame, of the part
    """
    if setup.stock_cylinder is not None:
        x, y, z, radius, height = setup.stock_cylinder
        return BlankCylinder(np.array([x, y, z]), np.array(setup.stock_axis), radius, height)
    grow = setup.margin + setup.uncertainty
    centre = 0.5 * (bounds[0] + bounds[1])
    radius = 0.5 * float(np.hypot(*(bounds[1, :2] - bounds[0, :2]))) + grow
    return BlankCylinder(np.array([centre[0], centre[1], bounds[0, 2]]), np.array([0.0, 0.0, 1.0]), radius,
                         float(bounds[1, 2] - bounds[0, 2]) + grow)


def blank_mesh(setup: ProofSetup) -> TriangleMesh:
    """The mesh of a blank of kind step, mm.

    Raises
    ------
    VerificationError
        Code no_stock_mesh: the setup has none.
    """
    if setup.stock_mesh is None:
        raise VerificationError("a blank of kind step has no mesh", code="no_stock_mesh", subjects=("stock_mesh",),
                                remedy="give the surface of the blank as a closed mesh")
    return setup.stock_mesh


def blank_holds(points: F64, up: F64, part: TriangleTree, setup: ProofSetup) -> NDArray[np.bool_]:
    """Whether places are in the blank, and for ``WITHIN`` along directions too.

    points, up : (n, 3) float64, mm and unit, setup frame
    part       : TriangleTree, of the part

    Returns (n,) bool.
    """
    if setup.stock_kind in (StockKind.PART_OFFSET, StockKind.STEP):
        own = setup.stock_kind == StockKind.STEP
        tree, beyond = (TriangleTree(blank_mesh(setup)), setup.uncertainty) if own else \
            (part, setup.margin + setup.uncertainty)
        return np.asarray(way_out_of_mesh(tree, points, up, beyond, WITHIN) >= WITHIN)
    ends = points, points + WITHIN * up
    if setup.stock_kind == StockKind.CYLINDER:
        blank = blank_cylinder(part.mesh.bounds, setup)
        return np.asarray(np.all([blank.depth(*p.T) >= 0.0 for p in ends], axis=0))
    low, high = stock_bounds(part.mesh.bounds, setup)
    return np.asarray(np.all([((p >= low) & (p <= high)).all(axis=1) for p in ends], axis=0))


def stock_on_normals(points: F64, normals: F64, bounds: F64, setup: ProofSetup, reach: float) -> F64:
    """Stock on each outward normal before the first cut, not above ``reach``.

    points, normals : (n, 3) float64, mm and unit, setup frame
    bounds          : (2, 3) float64, mm, setup frame, of the part

    Returns (n,) float64, mm: margin + uncertainty for an offset blank, else the distance out of the box, cylinder or
    mesh.
    """
    if setup.stock_kind == StockKind.PART_OFFSET:
        return np.full(len(points), min(setup.margin + setup.uncertainty, reach))
    if setup.stock_kind == StockKind.CYLINDER:
        return np.clip(blank_cylinder(bounds, setup).way_out(points, normals), 0.0, reach)
    if setup.stock_kind == StockKind.STEP:
        return way_out_of_mesh(TriangleTree(blank_mesh(setup)), points, normals, setup.uncertainty, reach)
    box = stock_bounds(bounds, setup)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.where(normals > 0, (box[1] - points) / normals, np.where(normals < 0, (box[0] - points) / normals,
                                                                        np.inf))
    return np.clip(out.min(axis=1), 0.0, reach)
