"""Cubic B-splines that are the same curve for numpy and for the CAD kernel.

The truth of a family part is computed on the curves of its faces, so both sides share one set of poles and knots.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

F64 = NDArray[np.float64]


def interpolate(parameters: F64, points: F64) -> BSpline:
    """Cubic B-spline through points at given parameters [DeBoor1978].

    parameters : (n,) float64, dimensionless, increasing, n >= 4 (fewer: the degree drops to n - 1)
    points     : (n, d) float64, mm

    Returns scipy BSpline of degree min(3, n - 1), not-a-knot end conditions.
    """
    return make_interp_spline(parameters, points, k=min(3, len(parameters) - 1))


def interpolate_closed(parameters: F64, points: F64) -> BSpline:
    """Closed cubic B-spline through points [DeBoor1978], with the clamped knots that the CAD kernel needs.

    parameters : (n,) float64, dimensionless, increasing
    points     : (n, d) float64, mm, the last equal to the first

    Returns scipy BSpline, twice differentiable across the seam.
    """
    slope = CubicSpline(parameters, points, bc_type="periodic")(parameters[0], 1)
    return make_interp_spline(parameters, points, k=3, bc_type=([(1, slope)], [(1, slope)]))


def to_edge(spline: BSpline, between: tuple[float, float] | None = None) -> Any:
    """The spline as a cadquery Edge with identical poles and knots.

    spline  : scipy BSpline with (m, 3) coefficients in mm and a clamped knot vector
    between : parameters the edge runs between, all of the curve when None
    Returns cadquery.Edge from parameter t[k] to t[-k-1].
    """
    import cadquery as cq
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.Geom import Geom_BSplineCurve
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array1OfPnt
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    knots, counts = np.unique(spline.t, return_counts=True)
    poles = TColgp_Array1OfPnt(1, len(spline.c))
    for i, (x, y, z) in enumerate(spline.c, start=1):
        poles.SetValue(i, gp_Pnt(float(x), float(y), float(z)))
    values = TColStd_Array1OfReal(1, len(knots))
    multiplicities = TColStd_Array1OfInteger(1, len(knots))
    for i, (knot, count) in enumerate(zip(knots, counts, strict=True), start=1):
        values.SetValue(i, float(knot))
        multiplicities.SetValue(i, int(count))
    curve = Geom_BSplineCurve(poles, values, multiplicities, int(spline.k))
    maker = BRepBuilderAPI_MakeEdge(curve, *between) if between else BRepBuilderAPI_MakeEdge(curve)
    return cq.Edge(maker.Edge())
