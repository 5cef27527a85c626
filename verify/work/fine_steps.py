"""Slopes that the edge of a flat end finishes in fine steps, against those on which it leaves the stairs of roughing.

Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64, I32
from geometry.sampling import SurfaceSamples
from verify.surface.sample_scores import proved_samples
from verify.tool_axes import LEVEL, UPRIGHT
from verify.work.asked_faces import Cutting, Measured, thinned

WITHIN = 0.5  # mm: stock is even to the scallop height within this where steps are fine
FIT_WITHIN = 0.3  # mm: the same, but for a slope of the stock, which an offset has on a round face
LEAST_NEAR, LEAST_FITTED = 4, 8  # samples that must lie there
FOLLOWED = 0.5  # of the height of a place along the axis, over which the moves that left the stock are spread
SOLID_SHARE = 0.01  # of a face: finished all round within ``FIT_WITHIN``
MAX_SOLID = 10_000  # samples of a face that are looked at for that
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


def in_fine_steps(few: SurfaceSamples, height: F64, mover: I32, rows: INT, uneven: float, measured: Measured,
                  cutting: Cutting) -> BOOL:
    """Whether fine steps left the stock on some samples, or would be what the program finishes their face with.

    few    : SurfaceSamples, n of them, setup frame
    height : (n,) float64, mm over the allowance; mover : (n,) int32, index, the move that left it, -1 for none
    rows   : (r,) int64, index, the samples that are asked about
    uneven : mm by which the stock may differ within ``WITHIN``

    Returns (r,) bool.

    Notes
    -----
    One of three things makes steps fine.

    - The stock is even round the sample.
    - What the same tool left is even but for a slope, as an offset is on a round face, and moves at many heights left
      it. A single stair of roughing is a slope, too, but one move leaves it.
    - Patches of the face are finished by edges all round, on a hundredth of it. Stairs of roughing finish lines alone.
    """
    out, tool = np.zeros(len(rows), np.bool_), cutting.moves.tool
    for face in np.unique(few.face[rows]).tolist():
        known = np.flatnonzero((few.face == face) & np.isfinite(height))
        mine = np.flatnonzero(few.face[rows] == face)
        if _finished_by_edges(face, measured, cutting):
            out[mine] = True
            continue
        if not len(known):
            continue
        tree, left = cKDTree(few.points[known]), mover[rows[mine]] >= 0
        for k, near in zip(mine[left], tree.query_ball_point(few.points[rows[mine[left]]], WITHIN), strict=True):
            beside = known[near]
            out[k] = len(beside) >= LEAST_NEAR and bool(np.ptp(height[beside]) <= uneven)
        for k in mine[left & ~out[mine]]:
            beside = known[tree.query_ball_point(few.points[rows[k]], FIT_WITHIN)]
            beside = beside[tool[mover[beside]] == tool[mover[rows[k]]]]
            out[k] = len(beside) >= LEAST_FITTED and _even_on_a_slope(few.points[beside], height[beside],
                                                                     mover[beside], uneven, cutting)
    return out


def _even_on_a_slope(points: F64, height: F64, mover: I32, uneven: float, cutting: Cutting) -> bool:
    """Whether stock at places is even but for a slope, and moves at as many heights left it as the places have."""
    if (mover < 0).any():
        return False
    at = np.column_stack([np.ones(len(points)), points - points.mean(axis=0)])
    off = height - at @ np.linalg.lstsq(at, height, rcond=1e-6)[0]
    if np.ptp(off) > uneven:
        return False
    axis = _axis(cutting, int(mover[0]))
    return bool(np.ptp(cutting.moves.end[mover] @ axis) >= FOLLOWED * np.ptp(points @ axis))


def _finished_by_edges(face: int, measured: Measured, cutting: Cutting) -> bool:
    """Whether edges of flat ends have finished patches of a sloping face."""
    s, sharp = measured.samples, np.array([t.tip_curvature <= 0.0 and not t.named for t in cutting.tools], np.bool_)
    rows = thinned(np.flatnonzero(s.face == face), MAX_SOLID)
    by = measured.mover[rows]
    good = proved_samples(measured.residual[rows], cutting.setup) & (by >= 0)
    good[good] = sharp[cutting.moves.tool[by[good]]]
    if good.sum() < SOLID_SHARE * len(rows):
        return False
    up = np.abs(np.einsum("ij,ij->i", s.normals[rows[good]], _axes(cutting, by[good])))
    good[good] = (up > UPRIGHT) & (up < LEVEL)
    around = cKDTree(s.points[rows]).query_ball_point(s.points[rows[good]], FIT_WITHIN)
    solid = sum(len(near) >= LEAST_NEAR and bool(good[near].all()) for near in around)
    return solid >= max(SOLID_SHARE * len(rows), 1.0)


def _axis(cutting: Cutting, move: int) -> F64:
    return np.asarray(_axes(cutting, np.array([move]))[0])


def _axes(cutting: Cutting, moves: INT | I32) -> F64:
    """(k, 3) float64, unit: tool axes in the middle of moves, (k,) index."""
    if cutting.moves.axes is None:
        return np.tile([0.0, 0.0, 1.0], (len(moves), 1))
    return cutting.moves.axes.only(np.asarray(moves, np.int64)).middle


__all__ = ["in_fine_steps"]
