"""The slow twin of tools that lean or turn: many standing tools along each move, each asked in its own frame."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.moves import Moves
from verify.tool_axes import ToolAxes

FAR = 12.0
"""mm along a ray that is looked at, either way."""


def random_moves(rng, count: int, *, length: float = 3.0, turn: float = 0.6, still: bool = False) -> Moves:
    """Feed moves that lean by up to ``turn`` rad and turn while they go; the first stands or only turns."""
    def axes() -> F64:
        v = rng.normal(size=(count, 3)) * [np.tan(turn), np.tan(turn), 0.0] * 0.5 + [0, 0, 1.0]
        return v / np.linalg.norm(v, axis=1)[:, None]
    start, end = rng.uniform(-length, length, (2, count, 3)) * [1, 1, 0.4]
    end[0] = start[0]
    first = axes()
    return Moves(start, end, np.ones(count, bool), np.zeros(count, np.int32),
                 ToolAxes.between(first, first if still else axes()))


def seen(points: F64, moves: Moves, m: int, s: F64) -> tuple[F64, F64]:
    """Distance from the axis and height over the tip, mm, of points (..., 3) seen from move m at shares s (k,).

    Both come as (..., k), or as (n, k) where points are (n, k, 3).
    """
    axes = moves.axes or ToolAxes.upright(len(moves))
    phi = (s * axes.angle[m])[..., None]
    z = np.cos(phi) * axes.axis[m] + np.sin(phi) * np.cross(axes.about[m], axes.axis[m])
    w = points - (moves.start[m] + s[..., None] * (moves.end[m] - moves.start[m]))
    h = (w * z).sum(axis=-1)
    return np.linalg.norm(w - h[..., None] * z, axis=-1), h


def signed(rho: F64, h: F64, tool: ToolBody) -> F64:
    """Signed distance to a standing cutting part; over the flutes the larger of the two ways."""
    flat, corner = tool.radius - tool.corner_radius, tool.corner_radius
    x, y = rho - flat, corner - h
    below = np.where((x > 0) & (y > 0), np.hypot(x, y), np.maximum(x, y)) - corner
    return np.maximum(below, h - tool.flute_length)


def least_distance(points: F64, moves: Moves, m: int, tool: ToolBody, steps: int = 201) -> F64:
    """(n,) least signed distance of points (n, 3) to the cutting part on move m, refined round the best place."""
    low, high = np.zeros(len(points)), np.ones(len(points))
    best = np.full(len(points), np.inf)
    for _ in range(3):
        s = low[:, None] + np.linspace(0, 1, steps) * (high - low)[:, None]
        value = signed(*seen(points[:, None, :], moves, m, s), tool)
        k = value.argmin(axis=1)
        best = np.minimum(best, value.min(axis=1))
        apart = (high - low) / (steps - 1)
        low, high = np.maximum(low + (k - 1) * apart, 0.0), np.minimum(low + (k + 1) * apart, 1.0)
    return best


def _starts(points: F64, normals: F64, moves: Moves, m: int, s: F64, tool: ToolBody, level: float) -> F64:
    """(n, k) least t at which rays come within ``level`` of tools that stand at shares s (n, k); inf where they do not,
    or where they are out of them again before the surface. The distance is convex along a ray."""
    def value(t: F64) -> F64:
        p = points[:, None, :] + t[..., None] * normals[:, None, :]
        return signed(*seen(p, moves, m, s), tool) - level

    low, high = np.full(s.shape, -FAR), np.full(s.shape, FAR)
    for _ in range(60):
        a, b = low + 0.381966 * (high - low), high - 0.381966 * (high - low)
        right = value(a) > value(b)
        low, high = np.where(right, a, low), np.where(right, high, b)
    deepest = 0.5 * (low + high)
    met = value(deepest) <= 0.0
    ends = []
    for outside in (-FAR, FAR):
        out, inside = np.full(s.shape, outside), deepest.copy()
        for _ in range(50):
            mid = 0.5 * (out + inside)
            within = value(mid) <= 0.0
            out, inside = np.where(within, out, mid), np.where(within, mid, inside)
        ends.append(inside)
    return np.where(met & (ends[1] >= -1e-6), ends[0], np.inf)


def least_left(points: F64, normals: F64, moves: Moves, tool: ToolBody, initial: float, level: float = 0.0,
               steps: int = 61) -> F64:
    """(n,) what is left on rays, mm, by cutting parts grown by ``level`` mm that stand close along every move."""
    left = np.full(len(points), initial)
    for m in range(len(moves)):
        low, high = np.zeros(len(points)), np.ones(len(points))
        for _ in range(3):
            s = low[:, None] + np.linspace(0, 1, steps) * (high - low)[:, None]
            t = _starts(points, normals, moves, m, s, tool, level)
            k = t.argmin(axis=1)
            left = np.minimum(left, t.min(axis=1))
            apart = (high - low) / (steps - 1)
            low, high = np.maximum(low + (k - 1) * apart, 0.0), np.minimum(low + (k + 1) * apart, 1.0)
    return left


def random_rays(moves: Moves, tool: ToolBody, count: int, rng) -> tuple[F64, F64]:
    """Points a little off what the moves sweep, and directions in which they are nearest to it."""
    points = rng.uniform(moves.start.min(axis=0) - 6, moves.start.max(axis=0) + 6, (60 * count, 3))

    def off(p: F64) -> F64:
        return np.min([least_distance(p, moves, m, tool, 81) for m in range(len(moves))], axis=0)
    away = off(points)
    points = points[(away > 0.02) & (away < 1.0)][:count]
    slope = np.stack([off(points + d) - off(points - d) for d in 1e-4 * np.eye(3)], 1)
    return points, -slope / np.linalg.norm(slope, axis=1)[:, None]
