"""The blank of a setup as planner and proof take it.

Shapes are those of the nominal blank where nothing else is stated. The real blank may stand ``uncertainty`` beyond it
on all sides. A blank grown from the part has no shape of its own: box, bar and solid are None.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.part import Part
from schemas.setup import Setup
from service.from_wire import no_stock_file
from toolpath.stock.stock_map import StockMap
from zones.reach.access_view import View, turned


@dataclass(frozen=True)
class Bar:
    """A round bar along Z of the setup frame, mm: where its axis stands, its lower end, radius and height."""

    x: float
    y: float
    bottom: float
    radius: float
    height: float

    def grown(self, by: float) -> Bar:
        """The bar with ``by`` mm more on all sides."""
        return Bar(self.x, self.y, self.bottom - by, self.radius + by, self.height + 2.0 * by)

    @property
    def volume(self) -> float:
        """mm³."""
        return float(np.pi * self.radius**2 * self.height)

    def ends(self, rotation: F64) -> F64:
        """(2, 3) float64, mm: middles of lower and upper end in a turned frame.

        rotation : (3, 3) float64, dimensionless, from the setup frame to the turned frame
        """
        return np.array([[self.x, self.y, self.bottom], [self.x, self.y, self.bottom + self.height]]) @ rotation.T


@dataclass(frozen=True, eq=False)
class Blank:
    """The stock before the first cut, in the setup frame.

    part        : (2, 3) float64, mm, bounds of the part
    margin      : mm, how far a blank grown from the part stands off it
    uncertainty : mm, how far the real blank may stand beyond the nominal one
    box         : (2, 3) float64, mm, corners of a box blank, or None
    bar         : of a cylinder blank, or None
    solid       : Part, the blank that was read from a STEP file, or None
    """

    part: F64
    margin: float
    uncertainty: float
    box: F64 | None = None
    bar: Bar | None = None
    solid: Part | None = None

    @property
    def bounds(self) -> F64:
        """(2, 3) float64, mm, setup frame: a box around the blank; a grown blank ends at the underside of the part."""
        if self.box is not None:
            return self.box
        if self.bar is not None:
            b = self.bar
            return np.array([[b.x - b.radius, b.y - b.radius, b.bottom],
                             [b.x + b.radius, b.y + b.radius, b.bottom + b.height]])
        if self.solid is not None:
            return self.solid.bounds
        grown = np.array([self.part[0] - self.margin, self.part[1] + self.margin])
        grown[0, 2] = self.part[0, 2]
        return grown

    @property
    def seat(self) -> float:
        """Lowest height of the blank, mm, setup frame."""
        return float(self.bounds[0, 2])

    @property
    def stands_alone(self) -> bool:
        """Whether the blank has a shape of its own, so that more than the margin may stand beside the part."""
        return self.box is not None or self.bar is not None or self.solid is not None

    @property
    def beyond(self) -> float:
        """How far the real blank may stand beyond these shapes, mm, with the deviation of a mesh from its solid."""
        return self.uncertainty + (0.0 if self.solid is None else max(self.solid.chord, self.solid.deviation))

    def corners(self, rotation: F64) -> F64:
        """(2, 3) float64, mm: the smallest box around box, cylinder, solid, or part with its margin, in a turned frame.

        rotation : (3, 3) float64, dimensionless, from the setup frame to the turned frame
        """
        if self.solid is not None:
            return turned(self.solid, rotation).bounds
        if self.bar is None:
            return turned_box(self.bounds, rotation)
        ends = self.bar.ends(rotation)
        aside = self.bar.radius * np.sqrt(np.maximum(1.0 - rotation[:, 2] ** 2, 0.0))
        return np.array([ends.min(axis=0) - aside, ends.max(axis=0) + aside])

    def planned(self, view: View, step: float) -> StockMap:
        """The stock that the planner of an access starts from: the largest possible one, at nodes ``step`` mm apart."""
        u = self.uncertainty
        if self.box is not None:
            return StockMap.block(view.tree, np.array([self.box[0] - u, self.box[1] + u]), view.rotation, step)
        if self.bar is not None:
            bar = self.bar.grown(u)
            return StockMap.cylinder(view.tree, bar.radius, bar.ends(view.rotation), step)
        if self.solid is not None:
            mesh = turned(self.solid, view.rotation).mesh
            return StockMap.around(TriangleTree(mesh), mesh.bounds, self.beyond, step, view.tree)
        return StockMap.around(view.tree, view.part.bounds, self.margin + u, step)

    def proof_box(self, rotation: F64) -> F64 | None:
        """(2, 3) float64, mm: a box around the largest box blank in a turned frame, or None.

        rotation : (3, 3) float64, dimensionless, from the setup frame to the turned frame
        """
        if self.box is None:
            return None
        box = turned_box(self.box, rotation)
        return np.array([box[0] - self.uncertainty, box[1] + self.uncertainty])

    def proof_cylinder(self, rotation: F64) -> tuple[tuple[float, float, float, float, float] | None,
                                                     tuple[float, float, float]]:
        """The largest cylinder blank in a turned frame, and the direction of its axis there.

        rotation : (3, 3) float64, dimensionless, from the setup frame to the turned frame

        Returns x, y, z of the middle of the lower end, radius and height, mm, or None where the blank is no cylinder,
        and the unit vector from the lower to the upper end.
        """
        if self.bar is None:
            return None, (0.0, 0.0, 1.0)
        bar = self.bar.grown(self.uncertainty)
        low, high = sorted(bar.ends(rotation).tolist(), key=lambda end: end[2])
        ax, ay, az = (((np.array(high) - low) / bar.height).round(15) + 0.0).tolist()
        return (low[0], low[1], low[2], bar.radius, bar.height), (ax, ay, az)

    def proof_mesh(self, rotation: F64) -> TriangleMesh | None:
        """The mesh of a solid blank in a turned frame; None where the blank is no solid.

        rotation : (3, 3) float64, dimensionless, from the setup frame to the turned frame
        """
        return None if self.solid is None else turned(self.solid, rotation).mesh


def blank_of(setup: Setup, part: Part, solid: Part | None = None) -> Blank:
    """The blank of a setup for a part in the setup frame.

    solid : the part read from the STEP file of the blank, setup frame

    Raises
    ------
    SetupError
        Code 'no_stock_file': the blank is of kind 'step' and ``solid`` is None.
    """
    stock, bounds = setup.stock, part.bounds
    if stock.kind == "step":
        if solid is None:
            raise no_stock_file()
        return Blank(bounds, stock.margin_mm, stock.uncertainty_mm, solid=solid)
    blank = Blank(bounds, stock.margin_mm, stock.uncertainty_mm)
    if stock.kind == "box":
        box = np.array(stock.box_mm, dtype=np.float64) if stock.box_mm is not None else blank.bounds
        return Blank(bounds, stock.margin_mm, stock.uncertainty_mm, box=box)
    if stock.kind == "cylinder":
        return Blank(bounds, stock.margin_mm, stock.uncertainty_mm, bar=_bar(setup, part))
    return blank


def _bar(setup: Setup, part: Part) -> Bar:
    """The cylinder of a setup: as given, or around the part with the margin at its side and on top."""
    stock, (lower, upper) = setup.stock, part.bounds
    if (given := stock.cylinder_mm) is not None:
        return Bar(given.x, given.y, given.bottom, 0.5 * given.diameter, given.height)
    x, y = (0.5 * (lower + upper)[:2]).tolist()
    return Bar(x, y, float(lower[2]), 0.5 * float(np.hypot(*(upper - lower)[:2])) + stock.margin_mm,
               float(upper[2]) + stock.margin_mm - float(lower[2]))


def turned_box(box: F64, rotation: F64) -> F64:
    """The smallest box along turned axes that holds a box, (2, 3) float64, mm, turned frame.

    box      : (2, 3) float64, mm, setup frame, lower and upper corner
    rotation : (3, 3) float64, dimensionless, from the setup frame to the turned frame
    """
    corners = np.array([[box[i >> k & 1][k] for k in range(3)] for i in range(8)]) @ rotation.T
    return np.array([corners.min(axis=0), corners.max(axis=0)])
