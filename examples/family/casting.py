"""Rays from points on the sides of walls to the first other wall.

A plan section gives the start of the search, and Newton's method on the ruled surface the exact foot. A free wall may
be
closed and may face itself. Its rays count where they meet the other side within 72 degrees of perpendicular
(``facing_dot``); tops and ends of walls stop them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numba import njit

import geometry.kernel_cache.cache  # noqa: F401  names the folders of compiled kernels
from examples.family.splines import F64
from examples.family.walls import LEFT, RIGHT, WallSpec

Blocked = Callable[[F64, F64], np.ndarray]
"""(n, 3) start and (n, 3) end of rays, mm -> (n,) bool, whether material other than a wall lies between."""

FARTHEST = 40.0
"""mm, longest ray from or to a free wall."""
EDGE = 1e-9
LID_SKIN = 0.01
"""mm; tops and ends stop a ray only at that distance before its end, or for its own wall after its start."""
SKIN = 1e-3
"""mm, least distance at which a ray can meet its own wall."""


def cast(
    walls: Sequence[WallSpec], i: int, side: int, u: F64, v: F64, blocked: Blocked | None, farthest: float = FARTHEST,
    among: set[int] | None = None,
) -> tuple[F64, np.ndarray, F64]:
    """Rays from points of one side: start points, number of the first wall, and distance to it (inf: none).

    u, v     : (n,) float64, dimensionless, 0..1, parameters of the side
    farthest : mm; free walls beyond are ignored
    among    : walls that are considered, all when None

    Returns (n, 3) float64, mm, part frame, (n,) int64, index, and (n,) float64, mm.
    """
    origin, normal = walls[i].side_point(side, u, v), walls[i].side_normal(side, u, v)
    first, reach, facing = met(walls, i, origin, normal, farthest, among)
    reach = np.where(facing, reach, np.inf)
    hit = np.flatnonzero(np.isfinite(reach))
    if walls[i].sees_itself and len(hit):
        short = stopped(walls, i, origin[hit], normal[hit], reach[hit], farthest, among)
        reach[hit[short]] = np.inf
        hit = hit[~short]
    if blocked is not None and len(hit):
        reach[hit[blocked(origin[hit], origin[hit] + normal[hit] * reach[hit, None])]] = np.inf
    return origin, first, reach


def met(walls: Sequence[WallSpec], i: int, origin: F64, normal: F64, farthest: float, among: set[int] | None,
        ) -> tuple[np.ndarray, F64, np.ndarray]:
    """The wall whose side rays meet first, the distance (inf: none), and whether that side faces them.

    origin, normal : (n, 3) float64, coordinates in mm, and unit vectors

    Returns (n,) int64, index, (n,) float64, mm, and (n,) bool.
    """
    distance = np.full((len(walls), len(origin)), np.inf)
    faces = np.zeros((len(walls), len(origin)), bool)
    for j, other in enumerate(walls):
        if (j != i or other.sees_itself) and (among is None or j in among):
            if other.sees_itself and _apart(origin, other) > farthest:
                continue
            for side in (LEFT, RIGHT):
                s, facing = _ray_to_side(origin, normal, other, side)
                faces[j] = np.where(s < distance[j], facing, faces[j])
                distance[j] = np.minimum(distance[j], s)
    first, column = np.argmin(distance, axis=0), np.arange(len(origin))
    return first, distance[first, column], faces[first, column]


def stopped(walls: Sequence[WallSpec], i: int, origin: F64, normal: F64, reach: F64, farthest: float,
            among: set[int] | None) -> np.ndarray:
    """(n,) bool: whether rays from a side of wall i meet the top or an end of a wall before their end.

    origin, normal, reach : (n, 3), (n, 3) and (n,) float64, coordinates in mm, unit vectors, and mm
    """
    out = np.zeros(len(origin), bool)
    for k, wall in enumerate(walls):
        rows = np.flatnonzero(~out)
        if len(rows) and (among is None or k in among or _apart(origin[rows], wall) <= farthest):
            out[rows] = _first_triangle(origin[rows], normal[rows], _lid(wall), LID_SKIN if k == i else 1e-9,
                                        reach[rows] - LID_SKIN)
    return out


@lru_cache(maxsize=256)
def _lid(wall: WallSpec) -> F64:
    """(m, 3, 3) float64, mm: triangles over the top and the ends of a wall; rays do not go through these."""
    u = np.linspace(0.0, 1.0, wall.segments + 1)
    left, right = (wall.side_point(s, u, np.ones(len(u))) for s in (LEFT, RIGHT))
    strips = [(left[:-1], right[:-1], left[1:]), (right[:-1], right[1:], left[1:])]
    if not wall.closed:
        for at in (0.0, 1.0):
            e, v = np.full(9, at), np.linspace(0.0, 1.0, 9)
            a, b = wall.side_point(LEFT, e, v), wall.side_point(RIGHT, e, v)
            strips += [(a[:-1], b[:-1], a[1:]), (b[:-1], b[1:], a[1:])]
    return np.ascontiguousarray(np.concatenate([np.stack(s, axis=1) for s in strips]))


@njit(cache=True, nogil=True)
def _first_triangle(p: F64, d: F64, triangles: F64, least: float, most: F64) -> np.ndarray:
    """(n,) bool: whether rays (n, 3) meet a triangle (m, 3, 3) farther than ``least`` and nearer than ``most``, mm."""
    out = np.zeros(len(p), np.bool_)
    low, high = np.empty(len(triangles)), np.empty(len(triangles))
    for k in range(len(triangles)):
        low[k], high[k] = triangles[k, :, 2].min(), triangles[k, :, 2].max()
    for i in range(len(p)):
        z0, z1 = p[i, 2], p[i, 2] + most[i] * d[i, 2]
        z0, z1 = min(z0, z1) - 1e-9, max(z0, z1) + 1e-9
        for k in range(len(triangles)):
            if low[k] > z1 or high[k] < z0:
                continue
            a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
            e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            hx, hy, hz = d[i, 1] * e2z - d[i, 2] * e2y, d[i, 2] * e2x - d[i, 0] * e2z, d[i, 0] * e2y - d[i, 1] * e2x
            det = e1x * hx + e1y * hy + e1z * hz
            if abs(det) < 1e-14:
                continue
            wx, wy, wz = p[i, 0] - a[0], p[i, 1] - a[1], p[i, 2] - a[2]
            f = (wx * hx + wy * hy + wz * hz) / det
            if f < -EDGE or f > 1.0 + EDGE:  # a ray along the floor can meet the lower edge of an end
                continue
            qx, qy, qz = wy * e1z - wz * e1y, wz * e1x - wx * e1z, wx * e1y - wy * e1x
            g = (d[i, 0] * qx + d[i, 1] * qy + d[i, 2] * qz) / det
            if g < -EDGE or f + g > 1.0 + EDGE:
                continue
            s = (e2x * qx + e2y * qy + e2z * qz) / det
            if least < s < most[i]:
                out[i] = True
                break
    return out


def _apart(origin: F64, wall: WallSpec) -> float:
    """Distance in plan between the boxes of points and of a wall, mm."""
    x0, y0, x1, y1 = wall.bounds
    low, high = origin[:, :2].min(axis=0), origin[:, :2].max(axis=0)
    return float(np.hypot(*np.maximum(0.0, np.maximum([x0, y0] - high, low - [x1, y1]))))


def _ray_to_side(origin: F64, normal: F64, wall: WallSpec, side: int) -> tuple[F64, np.ndarray]:
    """Distance along rays to one side of a wall, inf where the ray misses it, and whether the side faces the ray.

    A ray that grazes a side ends there too.
    """
    grid = np.linspace(0.0, 1.0, wall.segments + 1)
    s, u = np.full(len(origin), np.inf), np.zeros(len(origin))
    levels = np.round(origin[:, 2], 6)
    for z in np.unique(levels):
        rows = np.flatnonzero(levels == z)
        share = float(np.clip((z - wall.z_floor) / wall.height, 0.0, 1.0))
        if wall.sees_itself:
            s[rows], u[rows] = _first_crossing(origin[rows, :2].copy(), normal[rows, :2].copy(),
                                               wall.trace(side, share), side, SKIN)
        else:
            trace = wall.side_point(side, grid, np.full(len(grid), share))[:, :2]
            s[rows], u[rows] = _plan_hit(origin[rows, :2], normal[rows, :2], trace)
    rows = np.flatnonzero(np.isfinite(s))
    out, facing = np.full(len(origin), np.inf), np.zeros(len(origin), bool)
    if len(rows):
        out[rows], facing[rows] = _refine(origin[rows], normal[rows], wall, side, s[rows], u[rows])
    return out, facing


def _plan_hit(p: F64, d: F64, line: F64) -> tuple[F64, F64]:
    """First crossing of plan rays with a polyline: distances and polyline parameter (inf, 0 where none)."""
    a, e = line[:-1], np.diff(line, axis=0)
    cross = d[:, None, 0] * e[None, :, 1] - d[:, None, 1] * e[None, :, 0]
    w = a[None] - p[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (w[..., 0] * e[None, :, 1] - w[..., 1] * e[None, :, 0]) / cross
        t = (w[..., 0] * d[:, None, 1] - w[..., 1] * d[:, None, 0]) / cross
    # A border ray may miss the end segment of the plan section because the wall leans, so Newton decides.
    slack = np.zeros((2, len(e)))
    slack[0, 0] = slack[1, -1] = 0.5
    good = (s > 1e-9) & (t >= -1e-9 - slack[0]) & (t <= 1 + 1e-9 + slack[1])
    s = np.where(good, s, np.inf)
    k = np.argmin(s, axis=1)
    rows = np.arange(len(p))
    return s[rows, k], np.where(np.isfinite(s[rows, k]), (k + np.nan_to_num(t[rows, k])) / len(e), 0.0)


@njit(cache=True, nogil=True)
def _first_crossing(p: F64, d: F64, line: F64, side: int, skin: float) -> tuple[F64, F64]:
    """As ``_plan_hit`` for crossings of one side (LEFT or RIGHT) of the polyline from its void, beyond ``skin`` mm."""
    n, m = len(p), len(line) - 1
    far, at = np.full(n, np.inf), np.zeros(n)
    for i in range(n):
        for k in range(m):
            ex, ey = line[k + 1, 0] - line[k, 0], line[k + 1, 1] - line[k, 1]
            cross = d[i, 0] * ey - d[i, 1] * ex
            if side * cross <= 0.0:
                continue
            wx, wy = line[k, 0] - p[i, 0], line[k, 1] - p[i, 1]
            s, t = (wx * ey - wy * ex) / cross, (wx * d[i, 1] - wy * d[i, 0]) / cross
            low, high = -0.5 if k == 0 else -1e-9, 1.5 if k == m - 1 else 1.0 + 1e-9
            if skin < s < far[i] and low <= t <= high:
                far[i], at[i] = s, (k + t) / m
    return far, at


def _refine(origin: F64, normal: F64, wall: WallSpec, side: int, s: F64, u: F64) -> tuple[F64, np.ndarray]:
    v = (origin[:, 2] - wall.z_floor) / wall.height
    for _ in range(12):
        u = np.mod(u, 1.0) if wall.closed else u
        uc = np.clip(u, 0.0, 1.0)
        du, dv = wall.side_derivatives(side, uc, v)
        r = wall.side_point(side, uc, v) + du * (u - uc)[:, None] - origin - normal * s[:, None]
        step = np.linalg.solve(np.stack([normal, -du, -dv], axis=-1), r[..., None])[..., 0]
        s, u, v = s + step[:, 0], u + step[:, 1], v + step[:, 2]
        if wall.sees_itself and float(np.abs(step).max()) < 1e-12:
            break
    missed = np.linalg.norm(r, axis=1) > 1e-7
    outside = (u < -1e-9) | (u > 1 + 1e-9) | (v < -1e-9) | (v > 1 + 1e-9)
    dot = (wall.side_normal(side, np.clip(u, 0, 1), v) * normal).sum(axis=1)
    missed |= outside | (dot >= 0.0) | (s <= (SKIN if wall.sees_itself else 0))
    return np.where(missed, np.inf, s), dot < wall.facing_dot
