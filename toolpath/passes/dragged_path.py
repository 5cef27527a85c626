"""The tip path of a tool that is dragged over a part along a line in plan.

The line is sampled evenly. A piece is cut in four while the tip limit at its quarters leaves its chord by more than the
tolerance. Two kinks can cancel in the middle, but not there and at both quarters. So only the chord on the true path
bounds the forward step. Where the limit jumps (the edge of a wall) cutting ends at ``SMALLEST`` and the path breaks: no
move may join the two sides. All points lie on the tip limit, so they are free. Places are in mm, access frame.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.kernels.drag import TipLimit, followed
from toolpath.lines import thinned, true_runs
from toolpath.scallop_budget import TIPS_SHARE
from zones.reach.tip_field import TipField

SMALLEST = 0.004  # mm: a tip path that still rises steeper than STEEPEST over this is broken
STEEPEST = 4.0
KINK = 0.75  # a kink may leave a chord by a third more than is seen at the quarters

Limit = Callable[[F64], F64]
"""Tip limit (n,) mm over places (n, 2) mm; inf where the tool may not be, -inf where nothing is below."""

_QUARTERS = np.array([0.25, 0.5, 0.75])


def follow(limit: Limit | TipLimit, way: F64, step: float, tolerance: float) -> tuple[F64, NDArray[np.bool_]]:
    """Tip path along a way.

    limit     : Limit, or TipLimit for a compiled loop
    way       : (m, 2) float64, mm, access frame, polyline in plan
    step      : mm, longest piece
    tolerance : mm, largest distance in height between the limit and the path

    Returns
    -------
    points : (n, 3) float64, mm, access frame, on the limit, the corners of the way among them
    broken : (n - 1,) bool: no move from point k to k + 1
    """
    if isinstance(limit, TipLimit):
        return followed(limit, np.ascontiguousarray(way), step, tolerance, SMALLEST, STEEPEST)
    corners = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    more = max(1, int(np.ceil(corners[-1] / step)))
    at = np.unique(np.concatenate([corners, np.linspace(0.0, corners[-1], more + 1)]))
    at, z = _cut(limit, way, corners, at, tolerance)
    with np.errstate(invalid="ignore"):
        broken = ~(np.abs(np.diff(z)) <= STEEPEST * np.diff(at))
    return np.column_stack([_places(way, corners, at), z]), broken


def limit_of(field: TipField) -> TipLimit:
    """The tip limit of a field, as ``TipField.tips``, for compiled loops."""
    return TipLimit(field.tree.arrays, field.shape, field.allowance, field.noncut, field.coarse.frame)


def _cut(limit: Limit, way: F64, corners: F64, at: F64, tolerance: float) -> tuple[F64, F64]:
    """``toolpath.kernels.drag.dragged`` for a limit of any kind: all pieces of a round at once.

    way : (m, 2) float64, mm; corners : (m,) and at : (k,) float64, mm along it

    Returns places along the way and the limit there, (n,) float64, mm.
    """
    def tips(s: F64) -> F64:
        return limit(_places(way, corners, s))

    z = tips(at)
    todo = np.arange(len(at) - 1)
    while True:
        todo = todo[np.diff(at)[todo] > SMALLEST]
        if not len(todo):
            break
        run = np.diff(at)[todo]
        inner = at[todo, None] + run[:, None] * _QUARTERS
        high = tips(inner.ravel()).reshape(inner.shape)
        with np.errstate(invalid="ignore"):
            rise = z[todo + 1] - z[todo]
            off = np.abs(high - (z[todo, None] + rise[:, None] * _QUARTERS)).max(axis=1)
            cut = ~((off <= tolerance) & (np.abs(rise) <= STEEPEST * run))
        # a stretch with nothing below, or no place for the tool, is one break and needs no finer pieces
        cut &= np.isfinite(z[todo]) | np.isfinite(z[todo + 1]) | np.isfinite(high).any(axis=1)
        where = todo[cut]
        at = np.insert(at, np.repeat(where + 1, 3), inner[cut].ravel())
        z = np.insert(z, np.repeat(where + 1, 3), high[cut].ravel())
        todo = ((where + 3 * np.arange(len(where)))[:, None] + np.arange(4)).ravel()
    return at, z


def pieces(limit: Limit | TipLimit, way: F64, step: float, tolerance: float) -> list[F64]:
    """``follow`` in unbroken pieces, each (n, 3) float64, mm, access frame, thinned, within the tolerance in all.

    way : (m, 2) float64, mm, access frame, polyline in plan

    Half of the tolerance goes to thinning. Of the other half a part is reserved for a kink between two sampled places.
    """
    points, broken = follow(limit, way, step, KINK * TIPS_SHARE * tolerance)
    return [thinned(points[i:j + 1], TIPS_SHARE * tolerance) for i, j in true_runs(~broken)]


def _places(way: F64, corners: F64, s: F64) -> F64:
    """Places in plan at lengths s along a way whose corners lie at the lengths ``corners``; exact on it."""
    k = np.clip(np.searchsorted(corners, s, side="right") - 1, 0, max(len(corners) - 2, 0))
    length = corners[k + 1] - corners[k] if len(corners) > 1 else np.ones(len(s))
    share = ((s - corners[k]) / np.where(length > 0.0, length, 1.0))[:, None]
    return np.asarray(way[k] + share * (way[np.minimum(k + 1, len(way) - 1)] - way[k]))
