"""What every plan must keep, asked the slow way: tips every few hundredths of a millimetre, no planner code."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_tips
from geometry.tool_body import ToolBody
from tests.hand_parts import RAMP, Case
from toolpath.workingsteps import TrajectoryKind, Workingstep
from zones.reach.assembly import Clearances, discs_of

PLUNGE_SHARE = 0.1  # of the diameter: what a descent steeper than the ramp may take off


def dense(points: F64, spacing: float) -> F64:
    """A polyline (n, 3) with points at most ``spacing`` mm apart."""
    out = [points[:1]]
    for a, b in zip(points[:-1], points[1:], strict=True):
        n = max(1, int(np.ceil(np.linalg.norm(b - a) / spacing)))
        out.append(a + np.arange(1, n + 1)[:, None] / n * (b - a))
    return np.vstack(out)


def deepest_gouge(case: Case, within: float, allowance: float = 0.0, spacing: float = 0.05) -> float:
    """How far a cutter that is thinner by ``within`` mm all round still goes below its exact limit, mm.

    allowance : mm, material the cutter must leave
    Returns mm along z, <= 0 where no feed move enters part and allowance by more than ``within``.
    """
    worst = -np.inf
    for body, points in case.moves():
        p = dense(points, spacing)
        more = allowance - within
        radius, corner = body.radius + more, max(body.corner_radius + more, 0.0)
        limit = drop_tips(case.tree, p[:, :2], radius, corner) + more
        worst = max(worst, float((limit - p[:, 2]).max()))
    return worst


def body_intrusion(tree: TriangleTree, body: ToolBody, points: F64, shank: float, holder: float) -> float:
    """How far shank or holder, made wider by these clearances, go below the top of the obstacles, mm."""
    p = dense(points, 0.3)
    p = p[p[:, 2] < tree.mesh.bounds[1, 2]]
    if not len(p):
        return -np.inf
    discs = [(body.shank_diameter / 2 + shank, body.neck_length)] if body.shank_diameter > body.diameter else []
    z = body.stickout
    for seg in body.holder:
        for k in range(8):
            wide = max(np.interp([k / 8, (k + 1) / 8], [0, 1], [seg.diameter, seg.diameter_top]))
            discs.append((wide / 2 + holder, z + seg.length * k / 8))
        z += seg.length
    worst = -np.inf
    for radius, height in discs:
        worst = max(worst, float((drop_tips(tree, p[:, :2], radius, 0.0) - height - p[:, 2]).max()))
    return worst


def rapid_faults(step: Workingstep, clearance: float, floor: float) -> list[str]:
    """Rapids that move Z with XY, or XY below the clearance height, or below the rapid floor."""
    out = []
    for t in step.trajectories:
        if t.motion is not TrajectoryKind.RAPID:
            continue
        move = np.diff(t.points, axis=0)
        across, along = np.hypot(move[:, 0], move[:, 1]) > 1e-9, np.abs(move[:, 2]) > 1e-9
        if (across & along).any():
            out.append(f"{step.id}: Z and XY together")
        if (t.points[:-1, 2][across] < clearance - 1e-9).any():
            out.append(f"{step.id}: across below the clearance height")
        if t.points[:, 2].min() < floor - 1e-9:
            out.append(f"{step.id}: below the rapid floor")
    return out


def gaps_between(step: Workingstep) -> float:
    """Largest distance between the end of a trajectory and the start of the next, mm."""
    ends = [np.linalg.norm(b.points[0] - a.points[-1])
            for a, b in zip(step.trajectories[:-1], step.trajectories[1:], strict=True)]
    return float(max(ends, default=0.0))


class SlowStock:
    """Top of the stock on a lattice, lowered by whole discs in plain numpy."""

    def __init__(self, case: Case) -> None:
        lat = case.stock_before.lattice
        self.top = case.stock_before.top.copy()
        self.x, self.y = lat.x0 + lat.step * np.arange(lat.nx), lat.y0 + lat.step * np.arange(lat.ny)
        self.step = lat.step

    def sink(self, tip: F64, body: ToolBody, seen: float) -> float:
        """Cut at a tip; returns the most that was taken off within ``seen`` mm of the axis."""
        j0, j1 = np.searchsorted(self.x, [tip[0] - body.radius, tip[0] + body.radius])
        i0, i1 = np.searchsorted(self.y, [tip[1] - body.radius, tip[1] + body.radius])
        rho = np.hypot(self.x[None, j0:j1] - tip[0], self.y[i0:i1, None] - tip[1])
        u = np.clip(rho - (body.radius - body.corner_radius), 0.0, body.corner_radius)
        bottom = tip[2] + body.corner_radius - np.sqrt(body.corner_radius**2 - u**2)
        view = self.top[i0:i1, j0:j1]
        off = np.where((rho <= body.radius) & (view > bottom), view - bottom, 0.0)
        view -= off
        near = off[rho <= seen]
        return float(near.max()) if near.size else 0.0

    def highest(self, tip: F64, radius: float) -> float:
        """Top of the stock within a radius of an axis, mm."""
        j0, j1 = np.searchsorted(self.x, [tip[0] - radius, tip[0] + radius])
        i0, i1 = np.searchsorted(self.y, [tip[1] - radius, tip[1] + radius])
        rho = np.hypot(self.x[None, j0:j1] - tip[0], self.y[i0:i1, None] - tip[1])
        return float(self.top[i0:i1, j0:j1][rho <= radius].max(initial=-np.inf))


def worst_plunge(case: Case) -> tuple[float, str]:
    """The most one descent steeper than the ramp takes off under the middle of the tool, in its diameters; where.

    Moves that follow each other and all descend too steeply are one descent.
    """
    stock = SlowStock(case)
    worst, where = 0.0, ""
    for step in case.plan.steps:
        body = step.tool
        seen = 0.5 * body.radius if body.corner_radius > 0 else body.radius - stock.step
        total = np.zeros_like(stock.top)
        for n, t in enumerate(step.trajectories):
            if t.motion is TrajectoryKind.RAPID:
                continue
            for a, b in zip(t.points[:-1], t.points[1:], strict=True):
                move = b - a
                steep = -move[2] > np.tan(RAMP) * 1.001 * np.hypot(move[0], move[1]) + 1e-6
                if not steep:
                    total = np.zeros_like(stock.top)
                p = dense(np.vstack([a, b]), stock.step)[1:]
                for tip in p:
                    if steep:
                        off = stock.sink(tip, body, seen)
                        if off > 0:
                            i, j = np.argmin(np.abs(stock.y - tip[1])), np.argmin(np.abs(stock.x - tip[0]))
                            total[i, j] += off
                            if total[i, j] / body.diameter > worst:
                                worst = float(total[i, j] / body.diameter)
                                where = f"{step.id} trajectory {n} {t.motion} {np.round(a, 3)} to {np.round(b, 3)}"
                    else:
                        stock.sink(tip, body, seen)
    return worst, where


def worst_meeting(case: Case) -> tuple[float, str]:
    """How deep shank or holder go into the stock as it stands at each moment, mm; where."""
    stock = SlowStock(case)
    worst, where = 0.0, ""
    for step in case.plan.steps:
        body, bodies = step.tool, discs_of(step.tool, Clearances(0.0, 0.0))
        for t in step.trajectories:
            for tip in dense(t.points, stock.step)[1:]:
                stock.sink(tip, body, 0.0)
                for part in bodies:
                    deep = stock.highest(tip, part.radius) - (tip[2] + part.height)
                    if deep > worst:
                        worst, where = deep, f"{step.id} {part.name} at {np.round(tip, 3)}, {t.motion}"
    return worst, where


def brute_residual(points: F64, paths: list[tuple[ToolBody, F64]], spacing: float = 0.04) -> F64:
    """Distance (n,) mm from samples to the nearest ball cutter among tips every ``spacing`` mm, flank included."""
    from scipy.spatial import cKDTree

    best = np.full(len(points), np.inf)
    for body in {b.id: b for b, _ in paths}.values():
        r = body.radius
        assert body.corner_radius == r
        tips = np.vstack([dense(p, spacing) for b, p in paths if b.id == body.id])
        near = cKDTree(tips[:, :2]).query_ball_point(points[:, :2], r + 0.3)
        for k, members in enumerate(near):
            c = tips[members]
            u = np.hypot(c[:, 0] - points[k, 0], c[:, 1] - points[k, 1])
            w = np.maximum(c[:, 2] + r - points[k, 2], 0.0)
            flank = c[:, 2] + body.flute_length >= points[k, 2]
            if flank.any():
                best[k] = min(best[k], float(np.sqrt(u**2 + w**2)[flank].min()) - r)
    return best
