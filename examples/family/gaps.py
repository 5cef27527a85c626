"""True channels and gaps, by dense rays between the generating surfaces of the walls.

Rays leave a grid of points on each side of each wall along the normal (``examples.family.casting``). The first other
wall that a ray meets, inside the sides of that wall, decides the channel. The shortest such ray is the gap. Connections
are left out, as in the definition of the gap. The shortest ray may begin or end on a border of a side
(``examples.family.rims``). Where a wall is one face all round, its round ends belong to its sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from examples.family.casting import Blocked, cast
from examples.family.rims import on_borders
from examples.family.splines import F64
from examples.family.walls import LEFT, RIGHT, WallSpec

ZOOMS = 3
"""Number of refinements of the grid around the shortest ray, each eight times finer."""
ROUNDS = 40
"""Most windows in the search for the shortest ray of a free wall."""
STARTS = 4
"""Start points on a free wall of the search for the shortest ray; one at each height, as it may end at a hub."""


@dataclass(frozen=True)
class Gap:
    """A channel between two walls of a layout.

    walls   : places in the layout, first < second
    gap_min : least outward ray distance, mm
    at      : point on the side where the shortest ray starts, mm
    border  : whether the ray begins or ends on the border of a side (end, floor or top)
    area    : mm² of side area that faces the other wall
    """

    walls: tuple[int, int]
    gap_min: float
    at: tuple[float, float, float]
    border: bool
    area: float


def channels(
    walls: Sequence[WallSpec], blocked: Blocked | None = None, *, n_u: int = 161, n_v: int = 5, foot: float = 0.0,
    exact: bool = True,
) -> list[Gap]:
    """All channels between the walls of a layout.

    walls    : the walls
    blocked  : says which rays end in material other than a wall (a hub)
    n_u, n_v : samples along and up each side, for the areas and as the start of the search for the shortest ray. The
               gap is
               refined to 1/512 of that pitch, also where it ends at a border or a hub
    foot     : mm above the floor where sides begin, the height of a fillet
    exact    : whether the shortest ray is refined between the samples

    Returns one Gap for each pair with at least 1 % of a side facing, in order of the pair.
    """
    walls = [w.with_ends() for w in walls]
    found: dict[tuple[int, int], Gap] = {}
    for i in range(len(walls)):
        for side in (LEFT, RIGHT):
            for gap in _facing(walls, i, side, blocked, n_u, n_v, foot, exact):
                old = found.get(gap.walls)
                if old is None or gap.gap_min < old.gap_min:
                    area = gap.area + (old.area if old else 0.0)
                    found[gap.walls] = Gap(gap.walls, gap.gap_min, gap.at, gap.border, area)
                else:
                    found[gap.walls] = Gap(old.walls, old.gap_min, old.at, old.border, old.area + gap.area)
    floor = {k: 0.02 * min(walls[m].length * walls[m].height for m in k) for k in found}
    return [found[k] for k in sorted(found) if found[k].area >= floor[k]]


def _facing(
    walls: Sequence[WallSpec], i: int, side: int, blocked: Blocked | None, n_u: int, n_v: int, foot: float, exact: bool
) -> list[Gap]:
    low = foot / walls[i].height
    grid = np.meshgrid(np.linspace(0, 1, n_u), np.linspace(low, 1, n_v), indexing="ij")
    u, v = (g.ravel() for g in grid)
    origin, first, reach = cast(walls, i, side, u, v, blocked)
    du, dv = walls[i].side_derivatives(side, u, v)
    share = np.outer(*(np.where(np.isin(np.arange(n), (0, n - 1)), 0.5, 1.0) / (n - 1) for n in (n_u, n_v)))
    weight = (1.0 - low) * np.linalg.norm(np.cross(du, dv), axis=1) * share.ravel()
    out = []
    near = {i, *np.unique(first[np.isfinite(reach)]).tolist()} if walls[i].sees_itself else None
    for j in np.unique(first[np.isfinite(reach)]):
        mine = np.flatnonzero(np.isfinite(reach) & (first == j))
        gap, at, border = np.inf, origin[0], False
        for best in _starts(walls[i], reach, mine, n_v):
            found = _zoom(walls, i, side, blocked, int(j), (u[best], v[best]), (n_u, n_v), low, float(reach[best]),
                          near, ZOOMS if exact else 0)
            if found[0] < gap:
                gap, at, border = found
        if exact and walls[i].sees_itself:
            on_border = on_borders(walls, i, side, blocked, int(j), (u[mine], v[mine]), reach[mine], low, gap, near)
            if on_border[0] < gap:
                gap, at, border = *on_border, True
        x, y, z = (float(c) for c in at)
        pair = (min(i, int(j)), max(i, int(j)))
        out.append(Gap(pair, gap, (x, y, z), border, float(weight[mine].sum())))
    return out


def _starts(wall: WallSpec, reach: F64, mine: np.ndarray, n_v: int) -> list[int]:
    """Samples at which the search begins: the shortest ray, and on a free wall other short rays along it."""
    order = mine[np.argsort(reach[mine], kind="stable")]
    if not wall.sees_itself:
        return [int(order[0])]
    chosen: list[int] = []
    for k in order[reach[order] <= 1.15 * reach[order[0]] + 0.1].tolist():
        if len(chosen) < STARTS and all(abs(k // n_v - c // n_v) > 3 or k % n_v != c % n_v for c in chosen):
            chosen.append(k)
    return chosen


def _zoom(
    walls: Sequence[WallSpec], i: int, side: int, blocked: Blocked | None, j: int, start: tuple[float, float],
    counts: tuple[int, int], low: float, gap: float, near: set[int] | None, zooms: int,
) -> tuple[float, F64, bool]:
    """Shortest ray from a side of wall i to wall j around a sample: its length, its start, whether it is on the border.
    """
    centre, pitch = np.array(start), np.array([1.0, 1.0]) / (np.array(counts) - 1)
    at = walls[i].side_point(side, centre[:1], centre[1:])[0]
    border = _on_border(walls[i], start[0], start[1], low)
    if walls[i].sees_itself and zooms:
        return _search(walls, i, side, blocked, j, centre, pitch, low, gap, near)
    for _ in range(zooms):
        fine = [np.unique(np.clip(c + np.linspace(-h, h, 17), b, 1))
                for c, h, b in zip(centre, pitch, (0.0, low), strict=True)]
        fu, fv = (g.ravel() for g in np.meshgrid(*fine, indexing="ij"))
        points, seen, far = cast(walls, i, side, fu, fv, blocked, 1.2 * gap + 1.0, near)
        far = np.where(seen == j, far, np.inf)
        k = int(np.argmin(far))
        if far[k] <= gap:
            gap, at, border = float(far[k]), points[k], _on_border(walls[i], fu[k], fv[k], low)
            centre = np.array([fu[k], fv[k]])
        pitch = pitch / 8.0
    return gap, at, border


def _search(
    walls: Sequence[WallSpec], i: int, side: int, blocked: Blocked | None, j: int, centre: F64, pitch: F64, low: float,
    gap: float, near: set[int] | None,
) -> tuple[float, F64, bool]:
    """As ``_zoom``, but the window follows the shortest ray along a slanting border before it shrinks."""
    at = walls[i].side_point(side, centre[:1], centre[1:])[0]
    border, scale = _on_border(walls[i], centre[0], centre[1], low), 1.0
    for _ in range(ROUNDS):
        spread = np.linspace(-scale, scale, 9)
        u, v = centre[0] + pitch[0] * spread, np.clip(centre[1] + pitch[1] * spread, low, 1.0)
        u = np.mod(u, 1.0) if walls[i].closed else np.clip(u, 0.0, 1.0)
        fu, fv = (g.ravel() for g in np.meshgrid(u, v, indexing="ij"))
        points, seen, far = cast(walls, i, side, fu, fv, blocked, 1.2 * gap + 1.0, near)
        far = np.where(seen == j, far, np.inf)
        k = int(np.argmin(far))
        better = far[k] < gap - 1e-9
        if far[k] <= gap:
            gap, at, border = float(far[k]), points[k], _on_border(walls[i], fu[k], fv[k], low)
            centre = np.array([fu[k], fv[k]])
        if not better or {k // 9, k % 9}.isdisjoint({0, 8}):
            scale *= 0.25
        if scale < 1e-3:
            break
    return gap, at, border


def _on_border(wall: WallSpec, u: float, v: float, low: float) -> bool:
    return bool(v <= low or v >= 1.0 or (not wall.closed and (u <= 0.0 or u >= 1.0)))
