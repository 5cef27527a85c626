"""The fewest further tool axes that reach the remaining samples: 3+2 on a machine that can tilt its tool or its table.

An even set of axes covers the half of the sphere that the machine can turn to. For every axis the exact approach of
``zones.reach.approach_cones`` gives the remaining samples that some tool reaches along it. The choice of axes is a set
cover with a price, solved exactly: area won less ``worth`` for each axis. Each chosen axis is then turned by smaller
and smaller angles, as long as the area it wins grows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_matrix, hstack, identity

from geometry.errors import InternalError
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.tilted_collision import axis_frames
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from zones.reach.access_reach import able
from zones.reach.approach_cones import approach, directions_over_hemisphere, resolution_of
from zones.reach.assembly import Clearances

DIRECTIONS = 241  # over the half sphere: at most 5 degrees to the nearest
MAX_SAMPLES = 1500
SEED = 17
MAX_AXES = 6
SAME = np.radians(1.0)  # axes nearer than this to a known one are skipped
ROUND_ANGLES = (15.0, 5.0, 1.0)  # deg, tried in turn
AS_GOOD = 0.98  # of the area that an axis wins: least share won by its replacement
STEPS = 3  # halvings of the angle that turns a chosen axis


class AxisCoverage:
    """Samples that some tool reaches along axes, exactly, without the blank.

    tree      : TriangleTree of part and fixtures, setup frame
    tools     : those of the setup
    clear     : Clearances; scallop, lift, allowance : mm, as in ``zones.zoning.zones``
    """

    def __init__(self, tree: TriangleTree, tools: Sequence[ToolBody], clear: Clearances, scallop: float, lift: float,
                 allowance: float) -> None:
        self.tree, self.tools, self.clear = tree, tools, clear
        self.scallop, self.lift, self.allowance = scallop, lift, allowance

    def reached(self, samples: SurfaceSamples, axes: F64) -> NDArray[np.bool_]:
        """(n, d) bool: samples that a tool with a strategy for them reaches along axes.

        axes : (d, 3) float64, dimensionless, setup frame, tip to spindle
        """
        out = np.zeros((len(samples), len(axes)), np.bool_)
        frames = axis_frames(axes)
        for tool in self.tools:
            got = approach(self.tree, tool, self.clear, samples.points, samples.normals, axes, self.lift,
                           self.allowance)
            for k, frame in enumerate(frames):
                rows = np.flatnonzero(got[:, k] & ~out[:, k])
                out[rows, k] = able(tool, samples.normals[rows] @ frame.T, self.scallop)
        return out


def orientations(samples: SurfaceSamples, coverage: AxisCoverage, allowed: Callable[[F64], NDArray[np.bool_]],
                 even: Callable[[F64, float], F64], known: F64, worth: float) -> F64:
    """Tool axes that are worth turning to.

    samples : SurfaceSamples that remain, setup frame
    coverage : AxisCoverage of the tools
    allowed : takes axes, (d, 3) float64, dimensionless, setup frame; gives (d,) bool, those the machine can turn to
    even    : takes an axis, (3,) float64, dimensionless, setup frame, and some degrees; gives the axes near it, (d, 3)
              float64, dimensionless, setup frame, at which the rotary axes stand at whole multiples of them
    known   : (k, 3) float64, dimensionless, setup frame, axes in use, from which these samples remain
    worth   : mm², least area that an axis must win

    Returns
    -------
    (k, 3) float64, dimensionless, setup frame
        From the tip to the spindle, k at most 6; the axis that wins most first.

    Raises
    ------
    InternalError
        The choice among the axes has no solution.

    Notes
    -----
    Of more than 1500 samples, 1500 are drawn by area with a fixed seed and represent the rest. Axes that point down are
    skipped: a tool does not come from under the table.
    """
    inner = np.flatnonzero(samples.area > 0)
    total = float(samples.area.sum())
    if total < worth or not len(inner):
        return np.zeros((0, 3))
    if len(inner) > MAX_SAMPLES:
        share = samples.area[inner] / total
        inner = np.sort(np.random.default_rng(SEED).choice(inner, MAX_SAMPLES, replace=False, p=share / share.sum()))
        each = np.full(len(inner), total / len(inner))
    else:
        each = samples.area[inner]
    few = samples.subset(inner)
    axes = directions_over_hemisphere(DIRECTIONS)
    axes = axes[allowed(axes) & (axes @ known.T < np.cos(SAME)).all(axis=1)]
    if not len(axes):
        return np.zeros((0, 3))
    got = coverage.reached(few, axes)
    chosen = _chosen(got, each, worth)
    spacing = resolution_of(directions_over_hemisphere(DIRECTIONS))
    found: list[F64] = []
    rest = np.ones(len(few), np.bool_)
    order = sorted(chosen, key=lambda k: -float(each[got[:, k]].sum()))
    for k in order:
        mine = np.flatnonzero(rest & got[:, k])
        if float(each[mine].sum()) < worth:
            continue
        left = few.subset(np.flatnonzero(rest))
        axis = _turned(axes[k], left, each[rest], coverage, allowed, spacing)
        axis = _evened(axis, left, each[rest], coverage, allowed, even)
        rest &= ~coverage.reached(few, axis[None])[:, 0]
        found.append(axis)
    return np.array(found).reshape(-1, 3)


def _chosen(got: NDArray[np.bool_], area: F64, worth: float) -> list[int]:
    """Columns of (n, d) that win the most area less ``worth`` each, exactly; of equal columns the first."""
    n, d = got.shape
    gain = got.T.astype(np.float64) @ area
    if float(gain.max(initial=0.0)) < worth:
        return []
    # x: axes taken; y: samples won, each bounded by the axes that reach it
    price = worth * (1.0 + 1e-6 * np.arange(d) / d)
    cost = np.concatenate([price, -area])
    cover = hstack([csr_matrix(-got.astype(np.float64)), identity(n)])
    limits = [LinearConstraint(cover, -np.inf, 0.0),
              LinearConstraint(csr_matrix(np.concatenate([np.ones(d), np.zeros(n)])[None]), 0, MAX_AXES)]
    answer = milp(cost, integrality=np.concatenate([np.ones(d), np.zeros(n)]), bounds=Bounds(0, 1), constraints=limits,
                  options={"mip_rel_gap": 0.0})
    if answer.x is None:
        raise InternalError(f"the choice of tool axes has no solution: {answer.message}")
    return [int(k) for k in np.flatnonzero(answer.x[:d] > 0.5)]


def _turned(axis: F64, samples: SurfaceSamples, area: F64, coverage: AxisCoverage,
            allowed: Callable[[F64], NDArray[np.bool_]], spacing: float) -> F64:
    """The axis, turned to the direction that wins most of the samples nearby."""
    best, most = axis, float(area @ coverage.reached(samples, axis[None])[:, 0])
    step = 0.5 * spacing
    ring = np.arange(8) * np.pi / 4
    for _ in range(STEPS):
        frame = axis_frames(best[None])[0]
        around = np.stack([np.sin(step) * np.cos(ring), np.sin(step) * np.sin(ring), np.full(8, np.cos(step))],
                          axis=1) @ frame
        around = around[(around[:, 2] >= 0.0) & allowed(around)]
        if len(around):
            won = area @ coverage.reached(samples, around)
            k = int(np.argmax(won))
            if won[k] > most * (1.0 + 1e-9):
                best, most = around[k], float(won[k])
        step *= 0.5
    return np.asarray(best)


def _evened(axis: F64, samples: SurfaceSamples, area: F64, coverage: AxisCoverage,
            allowed: Callable[[F64], NDArray[np.bool_]], even: Callable[[F64, float], F64]) -> F64:
    """A nearby axis at which the rotary axes stand at round angles, where it wins about as much."""
    most = float(area @ coverage.reached(samples, axis[None])[:, 0])
    for degrees in ROUND_ANGLES:
        near = even(axis, degrees)
        near = near[(near[:, 2] >= -1e-12) & allowed(near)]
        if len(near):
            won = area @ coverage.reached(samples, near)
            if won.max() >= AS_GOOD * most:
                return np.asarray(near[int(np.argmax(won))])
    return axis


__all__ = ["AxisCoverage", "orientations"]
