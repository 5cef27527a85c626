"""Shortest rays that begin or end on the border of a side: its foot, its top, its ends.

Rays that begin there are searched along the border. Rays that end there are searched backwards, from the border point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from examples.family.casting import SKIN, Blocked, cast, met, stopped
from examples.family.splines import F64
from examples.family.walls import LEFT, RIGHT, WallSpec

BORDER_PLACES = 161
"""Start points on each border of a side, for rays from it and to it."""
BACKWARDS = 1e-6
"""mm; a ray found backwards may meet a side that much before its border point."""


def on_borders(
    walls: Sequence[WallSpec], i: int, side: int, blocked: Blocked | None, j: int, uv: tuple[F64, F64], reach: F64,
    low: float, gap: float, near: set[int] | None,
) -> tuple[float, F64]:
    """Shortest ray from a side of wall i to wall j that begins or ends on the border of a side.

    uv, reach : (n,) float64 each, dimensionless 0..1 and mm, start parameters and lengths of rays to j; the start
                values
                for rays found backwards

    Returns its length, inf where none is found, and the parameters of its start, (2,) float64, dimensionless.
    """
    wall, other = walls[i], walls[j]

    def along(border: tuple[F64, F64]) -> tuple[F64, F64]:
        points, seen, far = cast(walls, i, side, *border, blocked, 1.2 * gap + 1.0, near)
        return np.where(seen == j, far, np.inf), points

    best: tuple[float, F64] = (np.inf, np.zeros(3))
    for border in _borders(wall, low):
        best = min(best, _least_along(border, along), key=lambda b: b[0])
    begin = np.column_stack([wall.side_point(side, *uv), wall.side_normal(side, *uv)])
    feet, starts = cKDTree(begin[:, :3] + reach[:, None] * begin[:, 3:]), cKDTree(begin[:, :3])
    apart = wall.length / 100 + wall.height / 4  # no visible place of the side is farther from a start
    for facing in (LEFT, RIGHT):
        def backwards(border: tuple[F64, F64], facing: int = facing) -> tuple[F64, F64]:
            length, every = np.full(len(border[0]), np.inf), other.side_point(facing, *border)
            near_enough = np.flatnonzero(starts.query(every)[0] <= gap + apart)
            if len(near_enough) == 0:
                return length, every
            q, back = every[near_enough], other.side_normal(facing, *border)[near_enough]
            k = feet.query(q)[1]
            s, u, v = _ray_through(wall, side, q, uv[0][k], uv[1][k], reach[k])
            start, normal = wall.side_point(side, u, v), wall.side_normal(side, u, v)
            good = np.isfinite(s) & (s > SKIN) & (v >= low) & ((normal * back).sum(axis=1) < wall.facing_dot)
            good &= s < gap
            rows = np.flatnonzero(good)
            if len(rows):
                _, far, _ = met(walls, i, start[rows], normal[rows], 1.2 * gap + 1.0, near)
                good[rows] = far >= s[rows] - BACKWARDS
                good[rows] &= ~stopped(walls, i, start[rows], normal[rows], s[rows], 1.2 * gap + 1.0, near)
                if blocked is not None:
                    good[rows] &= ~blocked(start[rows], start[rows] + 0.999 * s[rows, None] * normal[rows])
            length[near_enough] = np.where(good, s, np.inf)
            every[near_enough] = start
            return length, every

        for border in _borders(other, low * wall.height / other.height):
            best = min(best, _least_along(border, backwards), key=lambda b: b[0])
    return best


def _borders(wall: WallSpec, low: float) -> list[Callable[[F64], tuple[F64, F64]]]:
    """Foot, top and ends of a side, as curves of a parameter 0..1 in (u, v)."""
    out: list[Callable[[F64], tuple[F64, F64]]] = [
        lambda t: (t, np.full(len(t), low)), lambda t: (t, np.ones(len(t)))]
    if not wall.closed:
        out += [lambda t: (np.zeros(len(t)), low + (1 - low) * t), lambda t: (np.ones(len(t)), low + (1 - low) * t)]
    return out


def _least_along(border: Callable[[F64], tuple[F64, F64]],
                 rays: Callable[[tuple[F64, F64]], tuple[F64, F64]]) -> tuple[float, F64]:
    """Least length along a border, refined around the best few places: the length and its start."""
    t, pitch = np.linspace(0.0, 1.0, BORDER_PLACES), 1.0 / (BORDER_PLACES - 1)
    best: tuple[float, F64] = (np.inf, np.zeros(3))
    for _ in range(6):
        length, start = rays(border(t))
        order = np.argsort(length, kind="stable")
        order = order[np.isfinite(length[order])][:4]
        if len(order) == 0:
            break
        if length[order[0]] < best[0]:
            best = float(length[order[0]]), start[order[0]]
        t = np.unique(np.clip(t[order, None] + pitch * np.linspace(-1.0, 1.0, 17), 0.0, 1.0))
        pitch /= 8.0
    return best


def _ray_through(wall: WallSpec, side: int, q: F64, u: F64, v: F64, s: F64) -> tuple[F64, F64, F64]:
    """Rays from a side that go through points q (n, 3), by Newton from (u, v, s): length (inf: none), u and v."""
    h = 1e-6
    u, v, s = u.copy(), v.copy(), s.copy()

    def end(u: F64, v: F64) -> F64:
        uc, vc = (np.mod(u, 1.0) if wall.closed else np.clip(u, 0.0, 1.0)), np.clip(v, 0.0, 1.0)
        du, dv = wall.side_derivatives(side, uc, vc)
        off = np.zeros_like(u) if wall.closed else u - uc
        return np.asarray(wall.side_point(side, uc, vc) + du * off[:, None] + dv * (v - vc)[:, None]
                          + s[:, None] * wall.side_normal(side, uc, vc))

    for _ in range(15):
        uc, vc = (np.mod(u, 1.0) if wall.closed else np.clip(u, h, 1.0 - h)), np.clip(v, h, 1.0 - h)
        du = (end(uc + h, vc) - end(uc - h, vc)) / (2 * h)
        dv = (end(uc, vc + h) - end(uc, vc - h)) / (2 * h)
        jacobian = np.stack([du, dv, wall.side_normal(side, uc, vc)], axis=-1)
        r = q - end(u, v)
        bad = np.abs(np.linalg.det(jacobian)) < 1e-12
        jacobian[bad] = np.eye(3)
        step = np.linalg.solve(jacobian, r[..., None])[..., 0]
        step = np.nan_to_num(np.clip(step, [-0.1, -0.3, -np.inf], [0.1, 0.3, np.inf]))
        u, v, s = u + step[:, 0], v + step[:, 1], s + step[:, 2]
        if float(np.abs(step).max()) < 1e-11:
            break
    missed = (np.linalg.norm(q - end(u, v), axis=1) > 1e-6) | (v < -1e-9) | (v > 1.0 + 1e-9)
    missed |= ~np.isfinite(u) if wall.closed else (u < -1e-9) | (u > 1.0 + 1e-9)
    u = np.mod(u, 1.0) if wall.closed else np.clip(u, 0.0, 1.0)
    return np.where(missed, np.inf, s), u, np.clip(v, 0.0, 1.0)
