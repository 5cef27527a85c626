"""Foot points on a NURBS surface: the nearest points within its domain to given points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.surfaces.nurbs import NurbsSurface

# Starts to every span of knots and order. With fewer starts the nearest one may lie in another valley.
STARTS = 3
ROUNDS = 50
# Largest step as a share of the domain. A step that gains nothing is cut to a quarter, at most this often.
REACH, CUTS = 0.25, 12
# A step shorter than this share of the domain ends the search. The error of the distance is then of its square.
ENOUGH = 1e-10


@dataclass(frozen=True, eq=False)
class FootPoints:
    """Nearest points of a surface, in its frame.

    uv       : (p, 2) float64, parameters
    points   : (p, 3) float64, mm
    distance : (p,) float64, mm, never negative
    """

    uv: F64
    points: F64
    distance: F64


def foot_points(surface: NurbsSurface, points: ArrayLike, start: ArrayLike | None = None) -> FootPoints:
    """Nearest points of a surface, its borders included, by Newton's method [Piegl1997].

    surface : NurbsSurface
    points  : (p, 3) float64, mm, frame of the surface
    start   : (p, 2) float64, dimensionless, parameters to begin from; the nearest of an even set of points where None

    Returns
    -------
    FootPoints
        The nearest point in the valley of the start. It is exact to rounding where the point is nearer to the surface
        than the least radius of curvature and its start lies in the same valley; otherwise it is a local nearest point.

    Raises
    ------
    GeometryError
        ``bad_array``; ``outside_domain`` for a start outside the domain.
    """
    given = finite_points(points, 3, "points")
    uv = _starts(surface, given) if start is None else finite_points(start, 2, "start")
    if len(uv) != len(given):
        raise GeometryError(f"{len(given)} points need as many starts, got {len(uv)}", code="bad_array",
                            subjects=("start",), measured=len(uv), limit=len(given))
    found = _search(surface, given, np.clip(uv, *surface.domain) if start is None else uv)
    # at a pole no step along the collapsed side changes the point, so the search restarts beside it
    stuck = np.flatnonzero(np.isnan(surface.normals(found.uv)[:, 0]))
    again = _search(surface, given[stuck], _starts(surface, given[stuck]))
    better = again.distance < found.distance[stuck]
    rows = stuck[better]
    found.uv[rows], found.points[rows] = again.uv[better], again.points[better]
    found.distance[rows] = again.distance[better]
    return found


def _search(surface: NurbsSurface, points: F64, start: F64) -> FootPoints:
    low, high = surface.domain
    uv = start.copy()
    foot = surface.points(uv)
    left = np.einsum("pi,pi->p", foot - points, foot - points)
    rows = np.arange(len(points))
    for _ in range(ROUNDS):
        step = _newton(surface, points[rows], uv[rows])
        step /= np.maximum(np.abs(step / (REACH * (high - low))).max(axis=1, keepdims=True), 1.0)
        far = (np.abs(step) > ENOUGH * (high - low)).any(axis=1)
        rows, step = rows[far], step[far]
        gained = np.zeros(len(rows), bool)
        for _ in range(CUTS):
            todo = np.flatnonzero(~gained)
            if not len(todo):
                break
            trial = np.clip(uv[rows[todo]] + step[todo], low, high)
            at = surface.points(trial)
            gap = np.einsum("pi,pi->p", at - points[rows[todo]], at - points[rows[todo]])
            better = gap < left[rows[todo]]
            gained[todo[better]] = True
            done = rows[todo[better]]
            uv[done], foot[done], left[done] = trial[better], at[better], gap[better]
            step[todo[~better]] *= 0.25
        rows = rows[gained]
        if not len(rows):
            break
    return FootPoints(uv, foot, np.sqrt(left))


def _starts(surface: NurbsSurface, points: F64) -> F64:
    ways = []
    for axis, knots in enumerate((surface.knots_u, surface.knots_v)):
        low, high = surface.domain[:, axis]
        ends = np.unique(np.clip(knots, low, high))
        count = STARTS * surface.orders[axis]
        share = np.arange(count) / count
        ways.append(np.append((ends[:-1, None] + np.diff(ends)[:, None] * share).ravel(), high))
    uv = np.stack(np.meshgrid(*ways, indexing="ij"), axis=-1).reshape(-1, 2)
    regular = np.isfinite(surface.normals(uv)[:, 0])
    uv = uv[regular] if regular.any() else uv
    return uv[cKDTree(surface.points(uv)).query(points)[1]] if len(points) else np.zeros((0, 2))


def _newton(surface: NurbsSurface, points: F64, uv: F64) -> F64:
    """Steps of Newton's method, or of Gauss-Newton where Newton's does not descend; no step crosses a border."""
    d = surface.derivatives(uv)
    off = d.point - points
    slope = np.stack([(off * d.u).sum(axis=1), (off * d.v).sum(axis=1)], axis=1)
    low, high = surface.domain
    held = ((uv <= low) & (slope > 0.0)) | ((uv >= high) & (slope < 0.0))
    slope[held] = 0.0
    metric = np.empty((len(uv), 2, 2))
    metric[:, 0, 0], metric[:, 1, 1] = (d.u * d.u).sum(axis=1), (d.v * d.v).sum(axis=1)
    metric[:, 0, 1] = metric[:, 1, 0] = (d.u * d.v).sum(axis=1)
    bend = np.empty_like(metric)
    bend[:, 0, 0], bend[:, 1, 1] = (off * d.uu).sum(axis=1), (off * d.vv).sum(axis=1)
    bend[:, 0, 1] = bend[:, 1, 0] = (off * d.uv).sum(axis=1)
    hessian = metric + bend
    good = (np.linalg.det(hessian) > 1e-3 * np.linalg.det(metric)) & (hessian[:, 0, 0] > 0.0)
    hessian = np.where(good[:, None, None], hessian, metric)
    hessian[:, [0, 1], [0, 1]] *= 1.0 + 1e-12
    hessian[:, [0, 1], [0, 1]] += 1e-300
    # a coordinate fixed at a border leaves the system of equations
    free = (~held).astype(np.float64)
    hessian *= free[:, :, None] * free[:, None, :]
    hessian[:, [0, 1], [0, 1]] += held
    with np.errstate(invalid="ignore", divide="ignore"):
        det = np.linalg.det(hessian)
        step = -np.stack([hessian[:, 1, 1] * slope[:, 0] - hessian[:, 0, 1] * slope[:, 1],
                          hessian[:, 0, 0] * slope[:, 1] - hessian[:, 1, 0] * slope[:, 0]], axis=1) / det[:, None]
    return np.where(np.isfinite(step), step, 0.0)
