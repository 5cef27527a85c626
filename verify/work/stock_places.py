"""Findings of stock that was left: connected places of a face, with height, area and the lines that left them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from geometry.mesh import F64, I32
from geometry.sampling import SurfaceSamples
from verify.findings import Source
from verify.model import Finding, FindingKind, ProofSetup

LEAST_PLACE = 0.05  # mm²: a smaller place is five samples or fewer, which prove nothing
CONNECTED = 0.5  # mm, or three distances of samples: so near samples are one place
GAP = 6.0  # mm: smaller places this near are one if stock stands all the way between them
GAP_STEP = 0.1  # mm
MAX_GAPS = 2000
SAME_WAY = 0.05  # dimensionless: ways of which the parts along the face differ by less are the same
ROUND = 0.5  # mm, or 2.5 distances of samples: a height is the lower third so far around
HIGHEST = 300  # samples of a place whose surroundings are looked at
MAX_LINES = 50
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class StandingStock:
    """Stock on n samples.

    height : (n,) float64, mm over the allowance
    mover  : (n,) int32, index, the move that left it, -1 where none did
    aside  : (n, 3) float64, dimensionless, setup frame, the part along the face of the unit vector in which the height
             is measured; 0 for the normal
    """

    height: F64
    mover: I32
    aside: F64

    def subset(self, rows: INT) -> StandingStock:
        """The selected samples. rows : (k,) int64, index."""
        return StandingStock(self.height[rows], self.mover[rows], self.aside[rows])


def stock_findings(samples: SurfaceSamples, stock: StandingStock, each: float, source: Source, setup: ProofSetup,
                   stands: Callable[[F64, F64], BOOL] | None = None) -> tuple[list[Finding], BOOL]:
    """A finding for each connected place of a face.

    samples : SurfaceSamples with stock, n of them, frame of the proof
    each    : how many samples each of them stands for
    stands  : tells of points, (k, 3) float64, mm, and normals, (k, 3) float64, unit, in the frame of the proof whether
              stock stands there, (k,) bool; None: places are not joined

    Returns the findings, and (n,) bool, whether a sample is part of one: places under ``LEAST_PLACE`` are none.

    Notes
    -----
    The height of a place is the largest lower third of the heights within ``ROUND`` of a sample. So the scallop that a
    right pass leaves hardly counts: stock of height d under scallops of height c has the lower third d + c / 9. Where
    heights are measured along the face, as up a wall, each neighbour counts up to the same top.

    A fin is narrower than samples are apart: they fall on it here and there. Places under ``LEAST_PLACE`` are one where
    stock stands on the straight line between two samples.
    """
    found: list[Finding] = []
    told = np.zeros(len(samples), np.bool_)
    for face in np.unique(samples.face).tolist():
        mine = np.flatnonzero(samples.face == face)
        spacing = float(np.sqrt(each * samples.area[mine].max()))
        group = _connected(samples.points[mine], max(CONNECTED, 3.0 * spacing))
        if stands is not None:
            group = _joined(samples.subset(mine), group, each, stands)
        for number in range(int(group.max()) + 1):
            rows = mine[group == number]
            area = each * float(samples.area[rows].sum())
            if area >= LEAST_PLACE:
                told[rows] = True
                found.append(_finding(samples, stock, rows, area, max(ROUND, 2.5 * spacing), source, setup))
    return found, told


def _connected(points: F64, apart: float) -> INT:
    """Number of the place of each of (n, 3) points: neighbours at most ``apart`` mm apart share one."""
    cell = np.floor(points / (0.5 * apart)).astype(np.int64)
    cells, of = np.unique(cell, axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(2.0, output_type="ndarray")  # cells whose middles are one apart
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)[of.reshape(-1)]


def _joined(samples: SurfaceSamples, group: INT, each: float, stands: Callable[[F64, F64], BOOL]) -> INT:
    """(n,) numbers of places as ``group``, small ones that stock connects being one.

    samples : of one face; each, stands : as in ``stock_findings``
    """
    area = each * np.bincount(group, weights=samples.area)
    rows = np.flatnonzero(area[group] < LEAST_PLACE)
    if len(np.unique(group[rows])) < 2 or each * float(samples.area[rows].sum()) < LEAST_PLACE:
        return group
    points, of = samples.points[rows], group[rows]
    pairs = cKDTree(points).query_pairs(GAP, output_type="ndarray")
    pairs = pairs[of[pairs[:, 0]] != of[pairs[:, 1]]]
    gap = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    pairs = pairs[np.argsort(gap, kind="stable")]
    _, nearest = np.unique(np.sort(of[pairs], axis=1), axis=0, return_index=True)  # the first pair of two places
    pairs = pairs[np.sort(nearest)][:MAX_GAPS]
    if not len(pairs):
        return group
    gap = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    count = np.maximum(np.ceil(gap / GAP_STEP).astype(np.int64), 3)
    pair = np.repeat(np.arange(len(pairs)), count)
    share = ((np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[pair])[:, None]
    a, b = rows[pairs[pair, 0]], rows[pairs[pair, 1]]
    normal = (1.0 - share) * samples.normals[a] + share * samples.normals[b]
    stood = stands((1.0 - share) * samples.points[a] + share * samples.points[b],
                   normal / np.linalg.norm(normal, axis=1)[:, None])
    whole = of[pairs[np.bincount(pair, weights=~stood, minlength=len(pairs)) == 0]]
    places = len(area)
    graph = coo_matrix((np.ones(len(whole)), (whole[:, 0], whole[:, 1])), shape=(places, places))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)[group]


def _lower_third(of: int, near: INT, points: F64, aside: F64, height: F64) -> float:
    """Lower third of the heights of the samples ``near`` sample ``of``, (k,) index, each up to its top over ``of``."""
    same = np.abs(aside[near] - aside[of]).max(axis=1) < SAME_WAY
    tops = height[near] + np.where(same, np.einsum("ij,ij->i", aside[near], points[near] - points[of]), 0.0)
    return float(np.partition(tops, len(near) // 3)[len(near) // 3])


def _finding(samples: SurfaceSamples, stock: StandingStock, rows: INT, area: float, reach: float, source: Source,
             setup: ProofSetup) -> Finding:
    height, points = stock.height[rows], samples.points[rows]
    tree = cKDTree(points)
    highest = np.lexsort((np.arange(len(rows)), -height))[:HIGHEST]
    around = tree.query_ball_point(points[highest], reach)
    typical = np.array([_lower_third(k, np.asarray(near, np.int64), points, stock.aside[rows], height)
                        for k, near in zip(highest.tolist(), around, strict=True)])
    best = int(np.argmax(typical))
    k, tall = int(highest[best]), float(typical[best])
    movers = np.unique(stock.mover[rows][stock.mover[rows] >= 0])
    lines = np.unique(source.line[movers])
    m = int(stock.mover[rows[k]])
    m = m if m >= 0 or not len(movers) else int(movers[0])
    span = "" if len(lines) < 2 else f", lines {int(lines[0])} to {int(lines[-1])}"
    who = f"T{source.tool[m]} leaves {tall:.4f} mm of stock" if m >= 0 else f"{tall:.4f} mm of stock stays"
    text = f"{who} where {setup.scallop_height:g} mm is allowed ({area:.3g} mm² in this place){span}"
    x, y, z = (round(float(v), 6) for v in points[k])
    keep = lines if len(lines) <= MAX_LINES else lines[np.linspace(0, len(lines) - 1, MAX_LINES).astype(np.int64)]
    return Finding(FindingKind.STOCK_LEFT, source.names[source.program[m]] if m >= 0 else source.names[0],
                   int(source.line[m]) if m >= 0 else 0, None, f"F{samples.face[rows[0]]}", (x, y, z), tall,
                   setup.scallop_height, text, len(rows), area, lines=tuple(int(v) for v in keep))
