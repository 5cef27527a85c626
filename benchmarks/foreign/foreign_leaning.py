"""The twin of ``foreign_twin`` for tools that lean: stock as points of a grid, taken out where the cutter stands."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from benchmarks.foreign.foreign_twin import SIDE, _count, _interval, _pose, _span, _strip, _up
from geometry.kernels.options import KERNEL

FRESH = KERNEL | {"cache": False}  # numba would not notice a change of what is taken from ``foreign_twin``


@njit(**FRESH)
def _holds(s, r, row, ball, radius):
    """Whether a body holds what is s over the tip and r off the axis; a ball has its sphere below the radius."""
    if s < row[0] or s > row[1]:
        return False
    if ball and s < radius:
        return r * r + (s - radius) ** 2 <= radius * radius
    share = (s - row[0]) / max(row[1] - row[0], 1e-12)
    return r <= row[2] + share * (row[3] - row[2])


@njit(**FRESH)
def _visit(stock, origin, h, p, q, t0, t1, row, ball, grow, spacing, remove):
    """Points a body meets on one move. Cutting: how many went; else 2 in stock, 1 within ``grow`` of it."""
    radius, wide = max(row[2], row[3]), max(row[2], row[3]) + grow
    n = _count(p, q, t0, t1, row[1], spacing)
    gone = 0
    for k in range(n + 1):
        tip, u = _pose(p, q, t0, t1, k / n)
        i0, i1 = _span(0, tip[0], u[0], row[0], row[1], wide, origin, h, stock.shape[0])
        j0, j1 = _span(1, tip[1], u[1], row[0], row[1], wide, origin, h, stock.shape[1])
        for i in range(i0, i1 + 1):
            x = origin[0] + i * h - tip[0]
            first, last = _strip(x, tip[1], u, wide, origin, h, j0, j1)
            for j in range(first, last + 1):
                y = origin[1] + j * h - tip[1]
                low, high = _interval(x, y, u, wide, row[0], row[1])
                if low > high:
                    continue
                for c in range(max(0, math.ceil((tip[2] + low - origin[2]) / h)),
                               min(stock.shape[2] - 1, math.floor((tip[2] + high - origin[2]) / h)) + 1):
                    if not stock[i, j, c]:
                        continue
                    z = origin[2] + c * h - tip[2]
                    s = x * u[0] + y * u[1] + z * u[2]
                    r = math.sqrt(max(x * x + y * y + z * z - s * s, 0.0))
                    if _holds(s, r, row, ball, radius):
                        if not remove:
                            return 2
                        stock[i, j, c] = False
                        gone += 1
                    elif not remove and _holds(s, max(r - grow, 0.0), row, ball, radius):
                        gone = 1
    return gone


@njit(**FRESH)
def _along(p, q, t0, t1):
    """How far a move goes up the tool and aside from it, by its axis half way, and whether it turns."""
    u = _up(0.5 * (t0[0] + t1[0]), 0.5 * (t0[1] + t1[1]))
    d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    rise = d[0] * u[0] + d[1] * u[1] + d[2] * u[2]
    aside = math.sqrt(max(d[0] ** 2 + d[1] ** 2 + d[2] ** 2 - rise * rise, 0.0))
    return rise, aside, t0[0] != t1[0] or t0[1] != t1[1]


@njit(**FRESH)
def leaning(stock, origin, h, starts, ends, turns, feeds, tool, bodies, clearance, spacing, marks):
    """Run a tool of any axis through ``stock`` (nx, ny, nz) bool, points h mm apart, in place.

    turns : (m, 2, 2) rad, A and C at both ends of every move; the rest as in ``foreign_twin.upright``, mm

    Descents are not judged: points are further apart than the end of a tool is wide.
    """
    rapid, body, _, cut = marks
    row = np.array([0.0, tool[2], tool[0], tool[0], 0.0])
    ball = tool[1] > 0.0
    for m in range(len(starts)):
        p, q, t0, t1 = starts[m], ends[m], turns[m, 0], turns[m, 1]
        rise, aside, turning = _along(p, q, t0, t1)
        lift = not turning and rise > 0.0 and aside <= SIDE
        if feeds[m]:
            cut[m] = h**3 * _visit(stock, origin, h, p, q, t0, t1, row, ball, 0.0, spacing, True)
        else:
            rapid[m] = _visit(stock, origin, h, p, q, t0, t1, row, ball, 0.0 if lift else clearance, spacing, False)
        for b in range(len(bodies)):
            grow = bodies[b, 4] if feeds[m] else 0.0 if lift else clearance
            met = _visit(stock, origin, h, p, q, t0, t1, bodies[b], False, grow, spacing, False)
            if feeds[m]:
                body[m] = max(body[m], met)
            else:
                rapid[m] = max(rapid[m], met)
