"""Tool axes along a pass: near the wanted axes, free of obstacles, and turning evenly.

Notation
    w_k : axis wanted at station k;  u_k : axis chosen;  b_k : axis of the neighbouring pass beside it; all unit
    h   : mm between stations;  l : mm, over which a turn is spread

Without obstacles the chosen axes minimise

    sum h |u_k - w_k|² + h g |u_k - b_k|² + (l² / h) |u_k+1 - u_k|²

This is a tridiagonal system; its solution is made unit afterwards. A sudden turn by an angle t is spread as
t exp(-s / l) / 2 on both sides, so axes turn by t / (2 l) a millimetre at most. l grows until they keep to the limit.

Where the tool would hit something with its smoothed axis, a fan of axes round it is tried. Dynamic programming takes
the chain through all stations with the fewest blocked places, then the least sum. The fan is coarse. So the chain is
relaxed towards the least sum station by station, as far as the tool stays free. Where axes still turn too fast this
repeats with a longer l; the result with the fewest blocked stations wins, then the one that turns slowest.

Arrays are float64. Places are in mm, axes and normals dimensionless unit vectors, both in the access frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.ndimage import maximum_filter1d
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.tilted_collision import axis_frames
from geometry.tool_body import ToolBody
from toolpath.five_axis.oriented_pass import wanted_axes
from toolpath.lines import true_runs
from toolpath.passes.cutter_locations import sides, tips
from toolpath.passes.forward_step import PassProfile
from toolpath.poses import Axes, Blocked, angles_between

SPACING = 0.5  # mm between stations at most
FAN = np.radians(4.0)  # between neighbouring axes of a fan
BESIDE = 0.5  # weight of the axes of the pass before
BLOCKED = 1e3  # cost of a blocked station: more than any turn
STIFFER = 4  # trials, l twice as long each time, where axes turn too fast round an obstacle
WIDER = 1.5  # factor on l where axes turn too fast
SWEEPS = 120  # of relaxation at most
SETTLED = 1e-3  # rad: a sweep that moves axes less ends the relaxation
SHORTER = (1.0, 0.5, 0.25)  # shares of a step that are tried until one is free
HOLD = 1e-3  # weight of the wanted axis at a blocked station: its axis lies between its neighbours

Met = Callable[[NDArray[np.int64], F64], NDArray[np.bool_]]
"""(k,) bool: whether the tool is in something at stations (k,) with axes (k, 3)."""


@dataclass(frozen=True)
class AxisLimits:
    """Limits of the axes along a pass.

    cone   : rad, largest angle between an axis and the one wanted
    per_mm : rad/mm, fastest turn along the contacts of a pass
    spread : mm, least length over which a turn is spread
    """

    cone: float
    per_mm: float
    spread: float = 2.0


@dataclass(frozen=True, eq=False)
class Steered:
    """Field of axes of one pass, called like any other (``toolpath.poses.Axes``).

    contact : (m, 3) float64, mm, its stations, evenly spaced, access frame
    axis    : (m, 3) float64, unit, tip to spindle
    free    : (m,) bool; False where no axis of the fan frees the tool, so that the axis lies between its neighbours
    per_mm  : rad/mm, the fastest turn where the tool is free
    """

    contact: F64
    axis: F64
    free: NDArray[np.bool_]
    per_mm: float

    def __call__(self, contact: F64, _normal: F64, _way: F64) -> F64:
        """Axes (k, 3), unit, at contacts (k, 3) mm of this pass or beside it: straight between the stations."""
        near = self._tree.query(contact)[1]
        best, axis = np.full(len(contact), np.inf), np.empty((len(contact), 3))
        for first in (near - 1, near):
            a = np.clip(first, 0, len(self.contact) - 2)
            begin, step = self.contact[a], self.contact[a + 1] - self.contact[a]
            share = ((contact - begin) * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-300)
            share = np.clip(share, 0.0, 1.0)[:, None]
            far = np.linalg.norm(contact - begin - share * step, axis=1)
            closer = far < best
            best[closer] = far[closer]
            axis[closer] = ((1.0 - share) * self.axis[a] + share * self.axis[a + 1])[closer]
        return np.asarray(axis / np.linalg.norm(axis, axis=1)[:, None])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.contact)


def steered(profile: PassProfile, tool: ToolBody, wanted: Axes, blocked: Blocked, limits: AxisLimits,
            before: Steered | None = None, off: float = 0.0) -> Steered:
    """The axes of a pass.

    profile : PassProfile of the pass
    tool    : ToolBody, a ball, a bull nose or a flat
    wanted  : field of the wanted axes
    blocked : whether the tool enters something, or the machine cannot take the axis
    limits  : AxisLimits
    before  : axes of the neighbouring pass, which these stay near
    off     : mm, that the tool may stand off along the normal (``toolpath.five_axis.oriented_pass.posed``)

    Raises
    ------
    GeometryError
        Code 'bad_axis': the wanted field gives no axis somewhere.
    """
    count = max(int(np.ceil(profile.length / SPACING)) + 1, 2)
    way = np.linspace(0.0, profile.length, count)
    contact, normal, axis = wanted_axes(profile, way, wanted)
    step = profile.length / (count - 1)

    def met(rows: NDArray[np.int64], axes: F64) -> NDArray[np.bool_]:
        side = sides(profile, way[rows], axes) if tool.radius > tool.corner_radius else None
        return blocked(tips(contact[rows], normal[rows], tool, axes, side) + off * normal[rows], axes)

    beside = None if before is None else before(contact, normal, normal)
    goal, weight = _goal(axis, beside)
    rows = np.arange(count)
    spread = limits.spread
    out = _spread(goal, np.full(count, weight), step, spread)
    while angles_between(out).max() > limits.per_mm * step and spread < profile.length:
        spread *= WIDER
        out = _spread(goal, np.full(count, weight), step, spread)
    bad = met(rows, out)
    if bad.any():
        out, bad = _round(out, axis, goal, weight, bad, met, limits, step, spread)
    return Steered(contact, out, ~bad, _fastest(out, bad) / step)


def _fastest(axis: F64, bad: NDArray[np.bool_]) -> float:
    """The most, rad, that axes turn between neighbouring stations neither of which is blocked."""
    turn = angles_between(axis)[~(bad[1:] | bad[:-1])]
    return float(turn.max()) if len(turn) else 0.0


def fan(axis: F64, half: float) -> F64:
    """Axes spread evenly round others, each of these first.

    axis : (n, 3) float64, dimensionless, unit, access frame
    half : rad, half the opening of the fan

    Returns (n, d, 3) float64, dimensionless, unit, access frame.
    """
    rows = [np.array([[0.0, 0.0, 1.0]])]
    for k in range(1, int(half / FAN + 1e-9) + 1):
        count = int(np.ceil(2.0 * np.pi * np.sin(k * FAN) / FAN))
        at = 2.0 * np.pi * np.arange(count) / count
        rows.append(np.column_stack([np.sin(k * FAN) * np.cos(at), np.sin(k * FAN) * np.sin(at),
                                     np.full(count, np.cos(k * FAN))]))
    return np.asarray(np.einsum("nji,dj->ndi", axis_frames(axis), np.vstack(rows)))


def _goal(axis: F64, neighbour: F64 | None) -> tuple[F64, float]:
    """Target of the axes and its weight."""
    if neighbour is None:
        return axis, 1.0
    return (axis + BESIDE * neighbour) / (1.0 + BESIDE), 1.0 + BESIDE


def _spread(goal: F64, weight: F64, step: float, spread: float) -> F64:
    """Axes (m, 3), unit, with the least sum where nothing is in the way."""
    stiff = (spread / step) ** 2
    bands = np.zeros((2, len(goal)))
    bands[0, 1:] = -stiff
    bands[1] = weight + 2.0 * stiff
    bands[1, [0, -1]] -= stiff
    out = solveh_banded(bands, weight[:, None] * goal)
    return np.asarray(out / np.linalg.norm(out, axis=1)[:, None])


def _round(smooth: F64, wanted: F64, goal: F64, weight: float, bad: NDArray[np.bool_], met: Met, limits: AxisLimits,
           step: float, spread: float) -> tuple[F64, NDArray[np.bool_]]:
    """Axes steered round obstacles, (m, 3), and (m,) bool where the tool is blocked all the same."""
    reach = int(np.ceil(limits.cone / limits.per_mm / step)) + 1  # stations that a detour takes
    near = maximum_filter1d(bad, 2 * reach + 1, mode="constant")
    rows = np.flatnonzero(near)
    tries = fan(smooth[rows], limits.cone)
    inside = (tries * wanted[rows, None]).sum(axis=2) >= np.cos(limits.cone)
    inside[:, 0] = True
    hit = ~inside
    hit[inside] = met(np.broadcast_to(rows[:, None], inside.shape)[inside], tries[inside])
    cost = weight * step * ((tries - goal[rows, None]) ** 2).sum(axis=2) + BLOCKED * hit
    best: tuple[tuple[int, float], F64, NDArray[np.bool_]] | None = None
    for _ in range(STIFFER):
        stiff = spread**2 / step
        out, blocked = smooth.copy(), bad.copy()
        for i, j in true_runs(near):
            at = slice(int(np.searchsorted(rows, i)), int(np.searchsorted(rows, j)))
            ends = smooth[i - 1] if i else None, smooth[j] if j < len(smooth) else None
            taken = _chain(tries[at], cost[at], stiff, ends)
            out[i:j] = tries[at][np.arange(j - i), taken]
            blocked[i:j] = hit[at][np.arange(j - i), taken]
        out, blocked = _drawn(out, blocked, rows, wanted, goal, weight * step, met, float(np.cos(limits.cone)), stiff)
        rank = int(blocked.sum()), max(_fastest(out, blocked), limits.per_mm * step)
        if best is None or rank < best[0]:
            best = rank, out, blocked
        if rank[1] <= limits.per_mm * step:
            break
        spread *= 2.0
    assert best is not None
    return best[1], best[2]


def _chain(tries: F64, cost: F64, stiff: float, ends: tuple[F64 | None, F64 | None]) -> NDArray[np.int64]:
    """(q,) which of the axes (q, d, 3) at each station make the chain of least cost (q, d) and turning.

    ends : (3,) axes before the first and after the last station, or None
    """
    # Another axis at one station changes two turns, each by 4 stiff at most: an axis dearer than that is on no chain.
    kept = [np.flatnonzero(c <= c.min() + 8.0 * stiff) for c in cost]
    best, back = cost[0, kept[0]], []
    if ends[0] is not None:
        best = best + 2.0 * stiff * (1.0 - tries[0, kept[0]] @ ends[0])
    for k in range(1, len(cost)):
        # of 2 stiff (1 - a b) + best the part that counts, in one product
        here, there = tries[k, kept[k]], tries[k - 1, kept[k - 1]]
        through = np.column_stack([-2.0 * stiff * here, np.ones(len(here))]) @ np.column_stack([there, best]).T
        back.append(through.argmin(axis=1))
        best = cost[k, kept[k]] + 2.0 * stiff + through[np.arange(len(here)), back[-1]]
    if ends[1] is not None:
        best = best + 2.0 * stiff * (1.0 - tries[-1, kept[-1]] @ ends[1])
    at = int(best.argmin())
    out = [int(kept[-1][at])]
    for k in range(len(cost) - 1, 0, -1):
        at = int(back[k - 1][at])
        out.append(int(kept[k - 1][at]))
    return np.array(out[::-1], np.int64)


def _drawn(axis: F64, blocked: NDArray[np.bool_], rows: NDArray[np.int64], wanted: F64, goal: F64, weight: float,
           met: Met, min_cosine: float, stiff: float) -> tuple[F64, NDArray[np.bool_]]:
    """Axes of ``rows`` relaxed towards the least sum, as far as each stays free.

    min_cosine : cosine of the largest angle between an axis and the one wanted
    """
    out, blocked, last = axis.copy(), blocked.copy(), len(axis) - 1
    for _ in range(SWEEPS):
        moved = 0.0
        for odd in (0, 1):
            k = rows[rows % 2 == odd]
            own = np.where(blocked[k], HOLD, 1.0) * weight
            left, right = (k > 0).astype(float), (k < last).astype(float)
            pull = left[:, None] * out[np.maximum(k - 1, 0)] + right[:, None] * out[np.minimum(k + 1, last)]
            target = (own[:, None] * goal[k] + stiff * pull) / (own + stiff * (left + right))[:, None]
            todo = np.arange(len(k))
            for share in SHORTER:
                if not len(todo):
                    break
                at = k[todo]
                trial = out[at] + share * (target[todo] - out[at])
                trial /= np.linalg.norm(trial, axis=1)[:, None]
                off = (trial * wanted[at]).sum(axis=1)
                hit = (off < min_cosine) & (off < (out[at] * wanted[at]).sum(axis=1))
                hit[~hit] = met(at[~hit], trial[~hit])
                done = ~hit | blocked[at]  # a blocked axis may lie anywhere, so it turns evenly
                if done.any():
                    moved = max(moved, float(np.linalg.norm(trial[done] - out[at[done]], axis=1).max()))
                out[at[done]] = trial[done]
                blocked[at[done]] = hit[done]
                todo = todo[~done]
        if moved < SETTLED:
            break
    return out, blocked
