"""B-spline curves in the convention of [Arivazhagan2020], equations 1 to 3: order k, control points P_0 .. P_n.

All points lie in one plane, in mm.

Notation
    k        order, degree k - 1 (the text under equation 1 says degree, its numbers are those of the order)
    n + 1    control points; the sum of equation 1 starts at i = 0, as equation 3 writes it
    u_j      n + k + 1 knots, open uniform: k zeros, equal steps, k ones (fifteen for k = 5 and ten control points)
    N_i,k    basis functions of equation 2, 0/0 taken as 0
A closed curve has uniform knots that go on beyond both ends and control points that repeat (P_n+1 = P_0 and so on), so
it is k - 2 times differentiable everywhere. The basis and its derivatives are scipy's.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline

from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.mesh import F64

ORDER = 5
CONTROL_POINTS = 10


class Ends(StrEnum):
    """Treatment of the ends of an open curve in a fit."""

    HELD = "held"
    """The first and last control point are the first and last data point."""
    FREE = "free"
    """The fit treats ends like all other points, so that noise on one point cannot bend them."""


@dataclass(frozen=True, eq=False)
class SplineCurve:
    """A plane B-spline curve over the parameters 0..1.

    control : (n, 2) float64, mm; each point once, also where the curve is closed
    order   : k, degree plus one
    closed  : periodic
    """

    control: F64
    order: int = ORDER
    closed: bool = False

    @property
    def knots(self) -> F64:
        """(n + order,) float64 knots, dimensionless; (n + 2 order - 1,) when closed, from below 0 to above 1."""
        return knot_vector(len(self.control), self.order, self.closed)

    def at(self, u: ArrayLike, derivative: int = 0) -> F64:
        """Points, or derivatives by u [Arivazhagan2020, equation 1; DeBoor1978].

        u          : (m,) float64, dimensionless, parameters in 0..1
        derivative : 0 for points, r for the r-th derivative
        Returns (m, 2) float64, mm, frame of the control points.
        """
        u = np.asarray(u, dtype=np.float64)
        spline = BSpline(self.knots, self._wrapped, self.order - 1)
        return np.asarray(spline(u, nu=derivative))

    def curvature(self, u: ArrayLike) -> F64:
        """Signed curvature, positive where the curve turns left [DoCarmo1976].

        u : (m,) float64, dimensionless, parameters in 0..1
        Returns (m,) float64, 1/mm; zero where the first derivative vanishes.
        """
        d, dd = self.at(u, 1), self.at(u, 2)
        speed = np.linalg.norm(d, axis=1)
        cross = d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]
        return np.asarray(cross / np.where(speed > 0, speed, np.inf) ** 3)

    @property
    def _wrapped(self) -> F64:
        return np.vstack([self.control, self.control[:self.order - 1]]) if self.closed else self.control


def knot_vector(count: int = CONTROL_POINTS, order: int = ORDER, closed: bool = False) -> F64:
    """Knots for a number of control points [Arivazhagan2020, equation 3].

    count, order : control points (at least ``order``), order
    closed       : uniform beyond both ends instead of open uniform

    Returns
    -------
    (count + order,) float64, or (count + 2 order - 1,) when closed; dimensionless.

    Raises
    ------
    GeometryError
        Fewer control points than the order, or an order below 2.
    """
    if order < 2 or count < order:
        raise GeometryError(f"a B-spline of order {order} (at least 2) needs as many control points, got {count}",
                            code="too_few_control_points", measured=count, limit=max(order, 2))
    if closed:
        return np.arange(-(order - 1), count + order) / count
    inner = np.linspace(0.0, 1.0, count - order + 2)
    return np.concatenate([np.zeros(order - 1), inner, np.ones(order - 1)])


def basis(u: ArrayLike, count: int = CONTROL_POINTS, order: int = ORDER, closed: bool = False) -> F64:
    """Values of the basis functions [Arivazhagan2020, equation 2; DeBoor1978].

    u            : (m,) float64, dimensionless, parameters in 0..1
    count, order : control points, order
    closed       : periodic basis; column i then holds the sum of the functions of control point i
    Returns (m, count) float64, dimensionless; rows sum to 1. Raises GeometryError as ``knot_vector`` does.
    """
    u = np.asarray(u, dtype=np.float64)
    knots = knot_vector(count, order, closed)
    full = BSpline.design_matrix(u, knots, order - 1).toarray()
    if closed:
        full[:, :order - 1] += full[:, count:]
    return np.ascontiguousarray(full[:, :count])


def arc_length(points: ArrayLike, closed: bool = False) -> F64:
    """Length along a polyline from its first point.

    points : (n, 2) float64, mm, in the plane of the curve
    closed : count the way back to the first point as well
    Returns (n,) float64, mm, or (n + 1,) when closed.
    """
    p = np.asarray(points, dtype=np.float64)
    p = np.vstack([p, p[:1]]) if closed else p
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])


def resample(points: ArrayLike, count: int, closed: bool = False) -> F64:
    """Points at equal steps of length along a polyline.

    points : (n, 2) float64, mm, in the plane of the curve
    count  : number of points; an open polyline keeps both ends, a closed one its first point
    Returns (count, 2) float64, mm, same plane. Raises GeometryError for a polyline without length.
    """
    p, s = _measured(points, closed)
    at = np.linspace(0.0, s[-1], count, endpoint=not closed)
    return np.column_stack([np.interp(at, s, p[:, k]) for k in range(2)])


def fit(points: ArrayLike, count: int = CONTROL_POINTS, order: int = ORDER, closed: bool = False,
        ends: Ends = Ends.HELD) -> SplineCurve:
    """The B-spline nearest to the points of a polyline, by least squares at parameters in proportion to arc length.

    The curve is that of [Arivazhagan2020, equations 1 to 3], the least squares fit that of [DeBoor1978].

    points       : (n, 2) float64, mm, in the plane of the curve; the last not repeated when closed
    count, order : control points, order
    closed       : fit a periodic curve
    ends         : Ends, for open curves

    Returns
    -------
    SplineCurve
        Smallest sum of squared distances between points and curve at the same parameter; with fewer points than
        control points the solution of least norm.

    Raises
    ------
    GeometryError
        Points of another shape, not finite, or without length; fewer control points than the order.
    """
    p, s = _measured(points, closed)
    p, u = (p[:-1], s[:-1] / s[-1]) if closed else (p, s / s[-1])
    design = basis(u, count, order, closed)
    if closed or ends == Ends.FREE:
        return SplineCurve(np.asarray(np.linalg.lstsq(design, p, rcond=None)[0]), order, closed)
    held = p - np.outer(design[:, 0], p[0]) - np.outer(design[:, -1], p[-1])
    inner = np.linalg.lstsq(design[:, 1:-1], held, rcond=None)[0]
    return SplineCurve(np.vstack([p[:1], inner, p[-1:]]), order)


def fit_even(points: ArrayLike, count: int = CONTROL_POINTS, closed: bool = False) -> tuple[SplineCurve, float]:
    """``fit`` with free ends for points at equal steps (as from ``resample``), many times faster.

    points : (n, 2) float64, mm, in the plane of the curve
    count  : control points, of order 5
    closed : fit a periodic curve
    Returns the curve and the root of the mean squared residual distance, mm.
    """
    p = finite_points(points, 2, "points")
    design, inverse = _even(len(p), count, closed)
    control = inverse @ p
    left = p - design @ control
    return SplineCurve(control, ORDER, closed), float(np.sqrt((left**2).sum() / len(p)))


@lru_cache(maxsize=64)
def _even(samples: int, count: int, closed: bool) -> tuple[F64, F64]:
    design = basis(np.linspace(0.0, 1.0, samples, endpoint=not closed), count, ORDER, closed)
    return design, np.asarray(np.linalg.pinv(design), dtype=np.float64)


@lru_cache(maxsize=64)
def even_errors(samples: int, count: int, closed: bool, steps: int) -> F64:
    """Effect of noise on the points of ``fit_even``: a row for every ``u`` of ``steps`` equal steps in 0..1.

    samples, count : points, control points
    closed         : of a periodic curve
    steps          : equal steps from 0 to 1, both with a row

    Returns
    -------
    (steps + 1, count) float64, dimensionless. For independent noise of standard deviation 1 on every coordinate, the
    length of a row is the standard error of the curve there, along each axis. The length of a weighted sum of rows is
    the standard error of the same sum of places.

    Notes
    -----
    The covariance of the control points is (D' D)^-1 with the design D = Q R, so that of the curve is B (R' R)^-1 B'
    and the rows are B R^-1.
    """
    design, _ = _even(samples, count, closed)
    _, triangle = np.linalg.qr(design)
    rows = basis(np.linspace(0.0, 1.0, steps + 1), count, ORDER, closed)
    return np.asarray(np.linalg.solve(triangle.T, rows.T).T)


def _measured(points: ArrayLike, closed: bool) -> tuple[F64, F64]:
    """A polyline, its first point repeated when closed, and the length up to every point."""
    p = finite_points(points, 2, "points")
    s = arc_length(p, closed)
    if len(p) < 2 or not s[-1] > 0:
        raise GeometryError("a curve needs two points that differ", code="no_length", subjects=("points",))
    return (np.vstack([p, p[:1]]) if closed else p), s
