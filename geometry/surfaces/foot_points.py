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
    return FootPoints(*surface.feet(points, start))


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
