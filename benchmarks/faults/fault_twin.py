"""The brute-force twin of the fault table: what a program does, by dense poses and the exact solid.

It runs no code of the proof.

Depths, mm. Gouge: the largest depth in the part of any place the cutting part takes. Body: how deep a point of part,
fixture or stock that still stands is in a shank or holder, the shorter of the way out aside and the way down out of its
lower end (aside alone for a neck). Cutter against a fixture: the way out of the cutting part. Cutter against stock in a
rapid: for tools along Z the shorter of the ways aside and down out of its end, else the way out. Residual: what is left
on a normal.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.fault_case import Case, Mode
from benchmarks.faults.fault_reading import Poses, Way
from benchmarks.faults.fault_solids import box_mesh
from benchmarks.faults.fault_touch import REACH, remain, swept, taken_at, taken_in, touch, touch_standing
from geometry.mesh import F64, TriangleMesh
from geometry.tool_body import ToolBody
from verify.model import ProofSetup, StockKind

CLOSE = 0.45  # mm within which the coarse look may be wrong
BODIES = ("neck", "shank", "holder")


@dataclass(frozen=True)
class Found:
    """The worst of something: depth mm, lines (of nearly that depth), and where (3,) mm."""

    depth: float
    lines: frozenset[int]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)


def worst(depth: dict[int, float], point: F64) -> Found:
    """The deepest of depths by line, mm, with the lines that come within 10 % or 5 µm; point (3,) mm."""
    most = max(depth.values(), default=-1.0)
    near = most - max(0.1 * most, 0.005)
    return Found(most, frozenset(n for n, d in depth.items() if d >= near), tuple(np.round(point, 3).tolist()))


@dataclass(frozen=True, eq=False)
class Twin:
    """The twin of one case and program."""

    case: Case
    way: Way

    def gouge(self, lines: Collection[int] | None = None, tool: int | None = None) -> Found:
        """The deepest gouge of the feed moves on some lines, of one tool."""
        depth, point = {}, np.zeros(3)
        most = -1.0
        for body in self.case.tools:
            if tool not in (None, body.number):
                continue
            rows = self.way.rows(lines, feed=True, tool=body.number)
            if len(rows) == 0:
                continue
            own, at = _deepest(self.case, self.way, rows, body)
            for line, d in own.items():
                depth[line] = max(d, depth.get(line, -1.0))
            if max(own.values()) > most:
                most, point = max(own.values()), at
        return worst(depth, point)

    def body(self, part: str, number: int, lines: Collection[int] | None = None) -> Found:
        """How deep part or fixtures come into the necks, shanks or holders of a tool in feed moves."""
        meshes = [self.case.part.mesh, *(box_mesh(f[0], f[1]) for f in self.case.setup.fixtures)]
        body = next(t for t in self.case.tools if t.number == number)
        rows = self.way.rows(lines, feed=True, tool=number)
        radial = part == "neck"
        shapes = np.array([[*row, radial] for name, *row in frusta(body) if name == part], float).reshape(-1, 5)
        depth, point = self._touch(meshes, rows, shapes, np.zeros(3))
        stock, place = self._stock(rows, shapes)
        if max(stock.values(), default=0.0) > max(depth.values(), default=0.0):
            point = place
        return worst({k: max(depth.get(k, 0.0), stock.get(k, 0.0)) for k in depth.keys() | stock.keys()}, point)

    def _stock(self, rows: NDArray[np.int64], shapes: F64) -> tuple[dict[int, float], F64]:
        """Depths by line of stock that still stands when shapes (k, 5) come there, mm, and the deepest place."""
        low, high = blank_box(self.case.setup)
        points, depth, where = _grid(low + 1e-6, high - 1e-6, 0.7), {}, np.zeros(3)
        for step, near in ((0.8, 0.9), (0.2, 0.15), (0.05, 0.02), (0.02, 0.0)):
            poses = self.way.poses(rows, step)
            points = points[in_blank(points, self.case.setup)]
            points = points[taken_in(points, poses.tip, poses.axis, shapes)]
            best, which = touch_standing(poses.tip, poses.axis, poses.move, points, self._gone(points), shapes,
                                         np.zeros(3), False)
            if best.max(initial=0.0) <= 0.0:
                return depth, where
            per_move, where = self._by_line(depth, poses.move, best), points[which[np.argmax(best)]]
            if near == 0.0:
                break
            rough = 1.2 * near
            rows = rows[per_move[rows] > best.max() - max(0.12 * best.max(), rough)]
            seeds = thinned(points[which[best > best.max() - rough]], near)
            seeds = seeds[np.linalg.norm(seeds - where, axis=1).argsort()[:12]]
            points = np.vstack([_grid(p - near, p + near, near / 7.0) for p in seeds])
            points = np.clip(points, low + 1e-6, high - 1e-6)
        return depth, where

    def _by_line(self, depth: dict[int, float], moves: NDArray[np.int64], best: F64) -> F64:
        """Raise depths by line, mm, to the best (n,) of poses of moves (n,); the best by move, 0 for others, mm."""
        out = np.zeros(len(self.way.line))
        np.maximum.at(out, moves, best)
        for move in np.unique(moves).tolist():
            line = int(self.way.line[move])
            depth[line] = max(depth.get(line, 0.0), float(out[move]))
        return out

    def _gone(self, points: F64) -> NDArray[np.int64]:
        """(n,) the move that takes each place (n, 3), mm; after the last where none does."""
        out = np.full(len(points), len(self.way.line), np.int64)
        if len(points) == 0:
            return out
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        far = np.linalg.norm(points - middle, axis=1).max()
        for body in self.case.tools:
            poses = self.way.poses(self.way.rows(feed=True, tool=body.number), 0.1)
            cutter = np.array([body.radius, body.corner_radius, body.flute_length])
            close = np.linalg.norm(poses.tip - middle, axis=1) < far + np.hypot(body.radius, body.flute_length)
            taken_at(points, poses.tip[close], poses.axis[close], poses.move[close], cutter, out)
        return out

    def cutter_on_fixtures(self, number: int) -> Found:
        """How deep fixtures come into the cutting part of a tool in feed moves."""
        body = next(t for t in self.case.tools if t.number == number)
        rows = self.way.rows(feed=True, tool=number)
        meshes = [box_mesh(f[0], f[1]) for f in self.case.setup.fixtures]
        cutter = np.array([body.radius, body.corner_radius, body.flute_length])
        depth, point = self._touch(meshes, rows, np.zeros((0, 5)), cutter)
        return worst(depth, point)

    def _touch(self, meshes: list[TriangleMesh], rows: NDArray[np.int64], shapes: F64,
               cutter: F64) -> tuple[dict[int, float], F64]:
        """Depths by line of points of meshes in shapes (k, 5), or in a cutter (3,) where there are none; mm."""
        points = np.vstack([coarse_cloud(m) for m in meshes])
        step, depth, where = 0.6, {}, np.zeros(3)
        for near in (0.9, 0.15, 0.0):
            poses = self.way.poses(rows, step)
            best, which = touch(poses.tip, poses.axis, points, shapes, cutter, False)
            if best.max(initial=0.0) <= 0.0:
                return {}, where
            per_move, where = self._by_line(depth, poses.move, best), points[which[np.argmax(best)]]
            rough = 0.5 if near > 0.5 else 0.065
            rows = rows[per_move[rows] > best.max() - max(0.12 * best.max(), rough)]
            seeds = thinned(points[which[best > best.max() - rough]], max(near, 0.1))
            worst_first = np.linalg.norm(seeds - where, axis=1).argsort()[:20]
            if near == 0.0:
                break
            points = np.vstack([cloud(m, near / 9.0, seeds[worst_first], near) for m in meshes])
            step = 0.1 if near > 0.5 else 0.02
        return depth, where

    def standing(self, points: F64, before: int) -> NDArray[np.bool_]:
        """(n,) bool: which places (n, 3), mm, are stock when line ``before`` begins."""
        left = in_blank(points, self.case.setup)
        for body in self.case.tools:
            rows = self.way.rows(range(before), feed=True, tool=body.number)
            if len(rows) and left.any():
                poses = self.way.poses(rows, 0.1)
                cutter = np.array([body.radius, body.corner_radius, body.flute_length])
                left &= ~swept(points, left, poses.tip, poses.axis, cutter)
        return left

    def rapid(self, line: int) -> Found:
        """How deep the cutting part goes into stock in the rapid on a line."""
        rows = self.way.rows([line], feed=False)
        body = next(t for t in self.case.tools if t.number == self.way.tool[rows[0]])
        cutter = np.array([body.radius, body.corner_radius, body.flute_length])
        poses, upright = self.way.poses(rows, 0.1), self.case.mode == Mode.UPRIGHT
        margin = body.radius + 0.3
        low, high = poses.tip.min(axis=0) - margin, poses.tip.max(axis=0) + margin + body.flute_length
        if upright:  # whatever stands over the end of the tool is in its way
            low, high = np.append(low[:2] + 0.3, low[2] + margin), np.append(high[:2] - body.flute_length, high[2])
            high[2] = self.case.blank_top
        points = _grid(low, high, max(0.25, float(np.cbrt(np.prod(high - low) / 400_000))))
        skin = points[in_blank(points - [0.0, 0.0, 0.3], self.case.setup) & ~in_blank(points, self.case.setup)]
        points = np.vstack([points, np.column_stack([skin[:, :2], np.full(len(skin), self.case.blank_top - 1e-6)])])
        most, where, apart = -1.0, np.zeros(3), 0.25
        for fine in (0.08, 0.02, 0.0):
            points = points[self.standing(points, line)]
            best, which = touch(poses.tip, poses.axis, points, np.zeros((0, 5)), cutter, upright)
            if best.max(initial=0.0) <= 0.0:
                break
            deep = np.argsort(-best, kind="stable")
            deep = deep[best[deep] > best.max() - 1.2 * apart]
            most, where, step = float(best[deep[0]]), points[which[deep[0]]], 3.5 * fine
            if fine:
                seeds = thinned(points[which[deep]], max(apart, 0.05))[:60]
                points = np.vstack([_grid(p - step, p + step, fine / 2) for p in seeds])
                poses, apart = self.way.poses(rows, 0.03), fine / 2
        return Found(most, frozenset([line]), tuple(np.round(where, 3).tolist()))

    def left(self, points: F64, normals: F64) -> F64:
        """(n,) mm left after all feed moves on normals (n, 3) of places (n, 3), mm, cut off at ``REACH``."""
        out = _way_out(points, normals, self.case.setup)
        for body in self.case.tools:
            rows = self.way.rows(feed=True, tool=body.number)
            if len(rows):
                poses = self.way.poses(rows, 0.06)
                cutter = np.array([body.radius, body.corner_radius, body.flute_length])
                remain(points, normals, out, poses.tip, poses.axis, cutter)
        return out


def frusta(tool: ToolBody) -> list[tuple[str, float, float, float, float]]:
    """Name, lower and upper height over the tip and both radii of what is above the flutes, mm."""
    neck, shank = 0.5 * tool.neck_diameter, 0.5 * tool.shank_diameter
    out = [("neck", tool.flute_length, max(tool.neck_length, tool.flute_length), neck, neck),
           ("shank", tool.neck_length, tool.stickout, shank, shank)]
    z = tool.stickout
    for part in tool.holder:
        out.append(("holder", z, z + part.length, 0.5 * part.diameter, 0.5 * part.diameter_top))
        z += part.length
    return [row for row in out if row[2] > row[1]]


def cloud(mesh: TriangleMesh, spacing: float, near: F64 | None = None, reach: float = 0.0) -> F64:
    """(n, 3) mm, points of the facets with corners and edges, ``spacing`` apart; only within ``reach`` of (k, 3)."""
    tri = mesh.triangles
    if near is not None:
        low, high = tri.min(axis=1) - reach, tri.max(axis=1) + reach
        tri = tri[((near[:, None] >= low) & (near[:, None] <= high)).all(axis=2).any(axis=0)]
    out = [np.zeros((0, 3))]
    for a, b, c in tri:
        n, m = (max(1, int(np.ceil(np.linalg.norm(e) / spacing))) for e in (b - a, c - a))
        u, v = np.meshgrid(np.arange(n + 1) / n, np.arange(m + 1) / m)
        keep = u + v <= 1.0 + 1e-9
        p = a + u[keep][:, None] * (b - a) + v[keep][:, None] * (c - a)
        k = max(1, int(np.ceil(np.linalg.norm(c - b) / spacing)))
        p = np.vstack([p, b + (np.arange(k + 1) / k)[:, None] * (c - b)])
        if near is not None:
            p = p[(np.linalg.norm(p[:, None] - near, axis=2) <= reach).any(axis=1)]
        out.append(p)
    return np.vstack(out)


@lru_cache(maxsize=16)
def coarse_cloud(mesh: TriangleMesh) -> F64:
    """(n, 3) mm, points of the facets about 0.4 mm apart."""
    return thinned(cloud(mesh, 0.3), 0.4)


def thinned(points: F64, size: float) -> F64:
    """The first of the points (n, 3), mm, of each cell of ``size`` mm, in their order."""
    _, first = np.unique(np.floor(points / size).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]


def blank_box(setup: ProofSetup) -> F64:
    """(2, 3) mm, corners of the box round the blank."""
    if setup.stock_kind == StockKind.CYLINDER and setup.stock_cylinder is not None:
        x, y, z, radius, height = setup.stock_cylinder
        return np.array([[x - radius, y - radius, z], [x + radius, y + radius, z + height]])
    return np.asarray(setup.stock_box, float)


def in_blank(points: F64, setup: ProofSetup) -> NDArray[np.bool_]:
    """(n,) bool: which places (n, 3), mm, lie in the blank."""
    if setup.stock_kind == StockKind.CYLINDER and setup.stock_cylinder is not None:
        x, y, z, radius, height = setup.stock_cylinder
        return (np.hypot(points[:, 0] - x, points[:, 1] - y) < radius) & (points[:, 2] > z) & (
            points[:, 2] < z + height)
    box = np.asarray(setup.stock_box)
    return np.asarray(((points > box[0]) & (points < box[1])).all(axis=1))


def _way_out(points: F64, normals: F64, setup: ProofSetup) -> F64:
    """(n,) mm along normals (n, 3) to the outside of the blank, by halving; not above ``REACH``."""
    low, high = np.zeros(len(points)), np.full(len(points), REACH)
    inside = in_blank(points + REACH * normals, setup)
    for _ in range(40):
        mid = 0.5 * (low + high)
        still = in_blank(points + mid[:, None] * normals, setup)
        low, high = np.where(still, mid, low), np.where(still, high, mid)
    return np.where(inside, REACH, low)


def _grid(low: F64, high: F64, step: float) -> F64:
    """(n, 3) mm, a lattice with both ends."""
    sides = [np.linspace(a, b, max(2, int(np.ceil((b - a) / step)) + 1))
             for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    return np.stack(np.meshgrid(*sides, indexing="ij"), -1).reshape(-1, 3)


def _profile(u: F64, body: ToolBody) -> tuple[F64, F64]:
    """Distance from the axis and height of a place 0..1 along the outline of a cutting part, even in its length, mm."""
    a, r = body.radius - body.corner_radius, body.corner_radius
    s = u * (a + 0.5 * np.pi * r + body.flute_length - r)
    bend = np.clip((s - a) / max(r, 1e-12), 0.0, 0.5 * np.pi)
    rho = np.minimum(s, a) + r * np.sin(bend)
    return rho, r * (1 - np.cos(bend)) + np.maximum(s - a - 0.5 * np.pi * r, 0.0)


def _places(poses: Poses, q: F64, body: ToolBody) -> F64:
    """(n, 3) mm, places of cutting parts by q (n, 3): along the outline, round the axis in rad, inwards 0..1."""
    rho, h = _profile(q[:, 0], body)
    least = np.where(np.abs(poses.axis[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    e1 = np.cross(poses.axis, least)
    e1 /= np.linalg.norm(e1, axis=1)[:, None]
    e2 = np.cross(poses.axis, e1)
    rho = (rho * q[:, 2])[:, None]
    return poses.tip + rho * (np.cos(q[:, 1:2]) * e1 + np.sin(q[:, 1:2]) * e2) + h[:, None] * poses.axis


def _deepest(case: Case, way: Way, rows: NDArray[np.int64], body: ToolBody) -> tuple[dict[int, float], F64]:
    """Deepest place in the part by line for moves (k,) indices: a coarse look at all, then a random climb, mm."""
    rng = np.random.default_rng(7)
    look = np.array([[u, f, s] for u in np.linspace(0, 1, 19) for f in np.linspace(0, 2 * np.pi, 13)[:-1]
                     for s in (1.0, 0.4)])
    row, t = way.spread(rows, 0.6)
    score, pick = np.empty(len(row)), np.empty(len(row), int)
    for k in range(0, len(row), 2000):
        many = way.at(np.repeat(row[k:k + 2000], len(look)), np.repeat(t[k:k + 2000], len(look)))
        d = case.solid.depth(_places(many, np.tile(look, (len(many.move) // len(look), 1)), body))
        d = d.reshape(-1, len(look))
        score[k:k + 2000], pick[k:k + 2000] = d.max(axis=1), d.argmax(axis=1)
    chosen = np.flatnonzero(score > score.max() - CLOSE)
    if len(chosen) > 6000:  # as deep as any stand closest; the rest are only as deep as their neighbours
        chosen = np.sort(chosen[np.argsort(-score[chosen], kind="stable")[:6000]])
    x = np.column_stack([t[chosen], look[pick[chosen]]])
    value = score[chosen]
    for wide, turns, most in ((0.2, 40, 6000), (0.03, 60, 1500), (0.004, 60, 400), (0.0008, 40, 400)):
        keep = np.sort(np.argsort(-value, kind="stable")[:most])
        chosen, x, value = chosen[keep], x[keep], value[keep]
        for _ in range(turns):
            y = x + rng.normal(size=x.shape) * wide * [1.0, 0.5, 3.0, 0.5] * (rng.random(x.shape) < 0.6)
            y[:, [0, 1, 3]] = np.clip(y[:, [0, 1, 3]], 0.0, 1.0)
            d = case.solid.depth(_places(way.at(row[chosen], y[:, 0]), y[:, 1:], body))
            better = d > value
            x[better], value[better] = y[better], d[better]
    depth: dict[int, float] = {}
    for line, d in zip(way.line[row[chosen]].tolist(), value.tolist(), strict=True):
        depth[line] = max(d, depth.get(line, -1.0))
    k = int(np.argmax(value))
    return depth, _places(way.at(row[chosen[k:k + 1]], x[k:k + 1, 0]), x[k:k + 1, 1:], body)[0]
