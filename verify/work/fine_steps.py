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
FLAT = 1e-6  # mm: places that are spread no more in a direction have no slope along it
SOLID_SHARE = 0.01  # of a face: finished all round within ``FIT_WITHIN``
MAX_SOLID = 10_000  # samples of a face that are looked at for that
LEAST_STAIRS = 20  # samples of a face that edges left stock on
USUAL, HIGHER = 0.5, 4.0  # share of them that is no higher than stairs usually are; times as high are no stairs
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
    One of four things makes steps fine.

    - The stock is even round the sample.
    - What the same tool left is even but for a slope, as an offset is on a round face, and moves at many heights left
      it. A single stair of roughing is a slope, too, but one move leaves it.
    - Patches of the face are finished by edges all round, on a hundredth of it. Stairs of roughing finish lines alone.
    - The stock is much higher than the stairs that edges leave on the face, on the normal and along the axis: a part of
      the steps is left out, however coarse they are.
    """
    out, tool = np.zeros(len(rows), np.bool_), cutting.moves.tool
    for face in np.unique(few.face[rows]).tolist():
        known = np.flatnonzero((few.face == face) & np.isfinite(height))
        mine = np.flatnonzero(few.face[rows] == face)
        if _finished_by_edges(face, measured, cutting):
            out[mine] = True
            continue
        out[mine] = _over_stairs(few.normals[rows[mine]], height[rows[mine]], face, measured, uneven, cutting)
        mine = mine[~out[mine]]
        if not len(known):
            continue
        tree, left = cKDTree(few.points[known]), mine[mover[rows[mine]] >= 0]
        beside, of = _near(tree, few.points[rows[left]], WITHIN)
        beside = known[beside]
        ask, first, count = _starts(of)
        out[left[ask]] = (count >= LEAST_NEAR) & (_spread(height[beside], first) <= uneven)
        left = left[~out[left]]
        beside, of = _near(tree, few.points[rows[left]], FIT_WITHIN)
        beside = known[beside]
        same = tool[mover[beside]] == tool[mover[rows[left]]][of]
        beside, of = beside[same], of[same]
        ask, _, count = _starts(of)
        enough = np.isin(of, ask[count >= LEAST_FITTED])
        beside, of = beside[enough], of[enough]
        even = _even_on_slopes(few.points[beside], height[beside], mover[beside], of, uneven, cutting)
        out[left[np.unique(of)[even]]] = True
    return out


def _over_stairs(normals: F64, height: F64, face: int, measured: Measured, uneven: float, cutting: Cutting) -> BOOL:
    """Whether stock is much higher than the stairs that edges of flat ends leave on the same face.

    normals : (r, 3) float64, unit, setup frame; height : (r,) float64, mm over the allowance
    uneven  : mm by which stock may differ where it is even

    Returns (r,) bool. A stair of height s leaves up to s cos of the slope on the normal, so both are compared.
    """
    s = measured.samples
    stairs = thinned(np.flatnonzero((s.face == face) & (measured.mover >= 0)), MAX_SOLID)
    stairs = stairs[_sharp(cutting)[cutting.moves.tool[measured.mover[stairs]]]]
    axes = _axes(cutting, measured.mover[stairs])
    up = np.abs(np.einsum("ij,ij->i", s.normals[stairs], axes))
    sloping = (up > UPRIGHT) & (up < LEVEL)
    stairs, up, axes = stairs[sloping], up[sloping], axes[sloping]
    if len(stairs) < LEAST_STAIRS:
        return np.zeros(len(normals), np.bool_)
    stock = np.maximum(measured.residual[stairs] - cutting.setup.stock_allowance, 0.0)
    usual, step = (float(np.quantile(v, USUAL)) for v in (stock, stock / up))
    lean = np.maximum(np.abs(normals @ axes[len(axes) // 2]), UPRIGHT)
    return np.asarray((height > max(HIGHER * usual, uneven)) & (height / lean > HIGHER * step))


def _near(tree: cKDTree, points: F64, within: float) -> tuple[INT, INT]:
    """Places of a tree that are near to points: index of the place and of the point, (c,) each, point by point."""
    found = tree.query_ball_point(points, within)
    if not len(points):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    of = np.repeat(np.arange(len(points)), [len(f) for f in found])
    return np.concatenate([np.array(f, np.int64) for f in found]), of


def _starts(of: INT) -> tuple[INT, INT, INT]:
    """Numbers in an ascending array, where the run of each begins, and how long it is."""
    return np.unique(of, return_index=True, return_counts=True)


def _spread(values: F64, first: INT) -> F64:
    """Largest less smallest value of each run, (g,) float64."""
    if not len(first):
        return np.zeros(0)
    return np.asarray(np.maximum.reduceat(values, first) - np.minimum.reduceat(values, first))


def _even_on_slopes(points: F64, height: F64, mover: I32, of: INT, uneven: float, cutting: Cutting) -> BOOL:
    """Whether stock at places is even but for a slope, and moves at as many heights left it as the places have.

    points : (n, 3) float64, mm; height : (n,) float64, mm
    mover  : (n,) int32, index, the move that left it, -1 for none
    of     : (n,) int64, ascending, the group of each; a group has a slope of its own, by least squares

    Returns (g,) bool.
    """
    _, first, count = _starts(of)
    if not len(first):
        return np.zeros(0, np.bool_)
    group = np.repeat(np.arange(len(first)), count)
    at, over = points - _mean(points, first, count)[group], height - _mean(height, first, count)[group]
    squares, vectors = np.linalg.eigh(_mean(at[:, :, None] * at[:, None], first, count))
    inverse = np.where(squares > FLAT**2, 1.0 / np.maximum(squares, FLAT**2), 0.0)
    along = np.einsum("gji,gj->gi", vectors, _mean(at * over[:, None], first, count))
    slope = np.einsum("gij,gj->gi", vectors, inverse * along)
    even = _spread(over - np.einsum("ni,ni->n", at, slope[group]), first) <= uneven
    axis = _axes(cutting, np.maximum(mover[first], 0))[group]
    ways = _spread(np.einsum("ni,ni->n", cutting.moves.end[mover], axis), first)
    followed = ways >= FOLLOWED * _spread(np.einsum("ni,ni->n", points, axis), first)
    return np.asarray(even & followed & (np.minimum.reduceat(mover, first) >= 0))


def _mean(values: F64, first: INT, count: INT) -> F64:
    """Mean of each run of values, (n, ...), over the first axis."""
    return np.asarray(np.add.reduceat(values, first) / count.reshape(-1, *[1] * (values.ndim - 1)))


def _finished_by_edges(face: int, measured: Measured, cutting: Cutting) -> bool:
    """Whether edges of flat ends have finished patches of a sloping face."""
    s, sharp = measured.samples, _sharp(cutting)
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


def _sharp(cutting: Cutting) -> BOOL:
    """(k,) bool, which tools are mills with a sharp edge at the end."""
    return np.array([t.tip_curvature <= 0.0 and not t.named for t in cutting.tools], np.bool_)


def _axes(cutting: Cutting, moves: INT | I32) -> F64:
    """(k, 3) float64, unit: tool axes in the middle of moves, (k,) index."""
    if cutting.moves.axes is None:
        return np.tile([0.0, 0.0, 1.0], (len(moves), 1))
    return cutting.moves.axes.only(np.asarray(moves, np.int64)).middle


__all__ = ["in_fine_steps"]
