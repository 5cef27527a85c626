"""True channels and gaps, by dense rays between the generating surfaces of the walls.

From a grid of points on each side of each wall a ray leaves along the normal; the
first other wall it meets inside that wall's sides decides the channel, and the
shortest such ray is the gap. Plan sections give the start, Newton on the ruled
surface the exact foot. Connections are left out, as in the definition of the gap.
A free wall may be closed and may face itself; its rays count where they meet the
other side within 72 degrees of square (``facing_dot``), and tops and ends of walls stop
them. The shortest of them may begin on a border of a side, or end on one; both are looked
for along the borders, the latter backwards from the border point. Where a wall is one face all
round, its round ends belong to its sides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

import geometry.kernels.cache  # noqa: F401  keys numba's cache before the first kernel is met
from examples.splines import F64
from examples.walls import LEFT, RIGHT, WallSpec

Blocked = Callable[[F64, F64], np.ndarray]
"""(n, 3) start and (n, 3) end of rays, mm -> (n,) bool, whether something that is no wall stands between."""


ZOOMS = 3
"""Times the grid is drawn again, eight times finer, round the shortest ray."""
FARTHEST = 40.0
"""mm; rays from and to free walls are not followed beyond."""
ROUNDS = 40
"""Windows that the search for the shortest ray of a free wall looks through at most."""
STARTS = 4
"""Places on a free wall where the search for the shortest ray begins; one at each height, for it may end at a hub."""
BORDER_PLACES = 161
"""Places on each border of a side from which, and to which, rays are looked for first."""
EDGE = 1e-9
BACKWARDS = 1e-6
"""mm; a ray found backwards may meet a side that much before the border it was found from."""
LID_SKIN = 0.01
"""mm; tops and ends stop a ray only when that far before its end, and its own wall's that far behind its beginning."""
SKIN = 1e-3
"""mm; a ray does not meet its own wall nearer than that."""


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
    blocked  : tells which rays end in material that is no wall (a hub)
    n_u, n_v : samples along and up each side, for the areas and as the start of the search for the shortest ray;
               the gap is refined to 1/512 of that pitch, also where it ends at a border or a hub
    foot     : mm above the floor where sides begin, the height of a fillet
    exact    : whether the shortest ray is refined between the samples
    Returns Gap per pair with at least 1 % of a side facing, in order of the pair.
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
    origin, first, reach = _cast(walls, i, side, u, v, blocked)
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
            on_border = _on_borders(walls, i, side, blocked, int(j), (u[mine], v[mine]), reach[mine], low, gap, near)
            if on_border[0] < gap:
                gap, at, border = *on_border, True
        x, y, z = (float(c) for c in at)
        pair = (min(i, int(j)), max(i, int(j)))
        out.append(Gap(pair, gap, (x, y, z), border, float(weight[mine].sum())))
    return out


def _starts(wall: WallSpec, reach: F64, mine: np.ndarray, n_v: int) -> list[int]:
    """Samples to search round: the shortest ray, on a free wall also other short ones elsewhere along it."""
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
    """Shortest ray from a side of wall i to wall j round a sample: its length, its start, whether on the border."""
    centre, pitch = np.array(start), np.array([1.0, 1.0]) / (np.array(counts) - 1)
    at = walls[i].side_point(side, centre[:1], centre[1:])[0]
    border = _on_border(walls[i], start[0], start[1], low)
    if walls[i].sees_itself and zooms:
        return _search(walls, i, side, blocked, j, centre, pitch, low, gap, near)
    for _ in range(zooms):
        fine = [np.unique(np.clip(c + np.linspace(-h, h, 17), b, 1))
                for c, h, b in zip(centre, pitch, (0.0, low), strict=True)]
        fu, fv = (g.ravel() for g in np.meshgrid(*fine, indexing="ij"))
        points, seen, far = _cast(walls, i, side, fu, fv, blocked, 1.2 * gap + 1.0, near)
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
        points, seen, far = _cast(walls, i, side, fu, fv, blocked, 1.2 * gap + 1.0, near)
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


def _on_borders(
    walls: Sequence[WallSpec], i: int, side: int, blocked: Blocked | None, j: int, uv: tuple[F64, F64], reach: F64,
    low: float, gap: float, near: set[int] | None,
) -> tuple[float, F64]:
    """Shortest ray from a side of wall i to wall j that begins on the border of the one side or ends on the other's.

    uv, reach : (n,) each, where rays to j begin and how long they are; the starts for rays found backwards
    Returns its length, inf where none is found, and its start.
    """
    wall, other = walls[i], walls[j]

    def along(border: tuple[F64, F64]) -> tuple[F64, F64]:
        points, seen, far = _cast(walls, i, side, *border, blocked, 1.2 * gap + 1.0, near)
        return np.where(seen == j, far, np.inf), points

    best: tuple[float, F64] = (np.inf, np.zeros(3))
    for border in _borders(wall, low):
        best = min(best, _least_along(border, along), key=lambda b: b[0])
    begin = np.column_stack([wall.side_point(side, *uv), wall.side_normal(side, *uv)])
    feet, starts = cKDTree(begin[:, :3] + reach[:, None] * begin[:, 3:]), cKDTree(begin[:, :3])
    apart = wall.length / 100 + wall.height / 4  # no place of the side that sees j is farther from a start
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
                _, far, _ = _met(walls, i, start[rows], normal[rows], 1.2 * gap + 1.0, near)
                good[rows] = far >= s[rows] - BACKWARDS
                good[rows] &= ~_stopped(walls, i, start[rows], normal[rows], s[rows], 1.2 * gap + 1.0, near)
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
    """Least length along a border, looked at ever closer round the best few places: the length and its start."""
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


def _on_border(wall: WallSpec, u: float, v: float, low: float) -> bool:
    return bool(v <= low or v >= 1.0 or (not wall.closed and (u <= 0.0 or u >= 1.0)))


def _cast(
    walls: Sequence[WallSpec], i: int, side: int, u: F64, v: F64, blocked: Blocked | None, farthest: float = FARTHEST,
    among: set[int] | None = None,
) -> tuple[F64, np.ndarray, F64]:
    """Rays from points of one side: where they start, which wall they meet first, how far that is (inf: none).

    farthest : mm; free walls beyond are not looked at
    among    : walls that are looked at, all when None
    """
    origin, normal = walls[i].side_point(side, u, v), walls[i].side_normal(side, u, v)
    first, reach, facing = _met(walls, i, origin, normal, farthest, among)
    reach = np.where(facing, reach, np.inf)
    hit = np.flatnonzero(np.isfinite(reach))
    if walls[i].sees_itself and len(hit):
        stopped = _stopped(walls, i, origin[hit], normal[hit], reach[hit], farthest, among)
        reach[hit[stopped]] = np.inf
        hit = hit[~stopped]
    if blocked is not None and len(hit):
        reach[hit[blocked(origin[hit], origin[hit] + normal[hit] * reach[hit, None])]] = np.inf
    return origin, first, reach


def _met(walls: Sequence[WallSpec], i: int, origin: F64, normal: F64, farthest: float, among: set[int] | None,
         ) -> tuple[np.ndarray, F64, np.ndarray]:
    """The wall whose side rays meet first, how far that is (inf: none) and whether that side faces them."""
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


def _stopped(walls: Sequence[WallSpec], i: int, origin: F64, normal: F64, reach: F64, farthest: float,
             among: set[int] | None) -> np.ndarray:
    """(n,) bool: whether rays from a side of wall i, ``reach`` mm long, meet the top or an end of a wall before."""
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
            if f < -EDGE or f > 1.0 + EDGE:  # a ray along the floor meets the lower edge of an end
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

    A ray that only grazes a side ends there all the same.
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
    # A border ray may miss the end segment of the plan section by the lean of the wall: let Newton decide.
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
