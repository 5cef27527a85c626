"""Passes over places that no other pass has finished although the tool reaches them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64
from toolpath.lines import Line, dense
from toolpath.passes.contours import moves_free
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

MAX_PLACES = 400  # a zone with more is not just missing a few spots
APART = 0.1  # mm, places nearer than this are one
SHORT = 0.02  # mm, length of a single touch
JOINED = 0.25  # diameters, three times ``APART`` at least: places this near follow one another in a pass
TURN = 3.0  # how much dearer a place is straight back than straight on
CHECKED = 0.1  # lattice steps between places that are checked: a tool of 1 mm enters 0.00003 mm between them at most


def touches(field: TipField, tips: F64) -> list[Line]:
    """Passes through tips that touch the residual, and short level moves that end on single ones.

    field : TipField
    tips  : (n, 3) float64, mm, access frame, admissible

    Returns
    -------
    list of Line
        They come to every place, at most ``MAX_PLACES``; a single place with no free direction is left out.
    """
    _, first = np.unique(np.round(tips / APART).astype(np.int64), axis=0, return_index=True)
    places = tips[np.sort(first)[:MAX_PLACES]]
    out: list[Line] = []
    for chain in _chains(field, places):
        line = Line(places[chain], False) if len(chain) > 1 else _touch(field, places[chain[0]])
        if line is not None:
            out.append(line)
    return out


def _chains(field: TipField, places: F64) -> Iterator[list[int]]:
    """Places (n, 3), mm, by index, in the order of passes: each goes on to a near place, straight on if it can."""
    reach = max(JOINED * field.tool.diameter, 3.0 * APART)
    near = cKDTree(places).query_ball_point(places, reach) if len(places) else []
    left = np.ones(len(places), np.bool_)
    for start in range(len(places)):
        if not left[start]:
            continue
        left[start] = False
        chain = [start]
        for _ in range(2):  # on from one end, then from the other
            while (k := _next(field, places, chain, near[chain[-1]], left)) is not None:
                left[k] = False
                chain.append(k)
            chain.reverse()
        yield chain


def _next(field: TipField, places: F64, chain: list[int], near: list[int], left: NDArray[np.bool_]) -> int | None:
    """The place that comes after a chain; None where no free one is near."""
    here = places[chain[-1]]
    ahead = here - places[chain[-2]] if len(chain) > 1 else np.zeros(3)
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-12)
    candidates = [k for k in near if left[k]]
    away = places[candidates] - here
    far = np.linalg.norm(away, axis=1)
    cost = far * (1.0 + 0.5 * (TURN - 1.0) * (1.0 - away @ ahead / np.maximum(far, 1e-12)))
    for k in np.argsort(cost, kind="stable").tolist():
        if _free(field, np.vstack([here, places[candidates[k]]])):
            return candidates[k]
    return None


def _free(field: TipField, move: F64) -> bool:
    """Whether a straight move (2, 3), mm, level or not, is free."""
    at = dense(move, CHECKED * field.lattice.step) + np.array([0.0, 0.0, LEVEL_TOLERANCE])
    return not bool((field.blocked_by_cutter(at) | field.blocked_by_body(at)).any())


def _touch(field: TipField, tip: F64) -> Line | None:
    """A short level move that ends on a tip (3,), mm; None where it is free from no side."""
    starts = tip + np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(12) * np.pi / 6]) * SHORT
    at = starts + np.array([0.0, 0.0, LEVEL_TOLERANCE])
    for k in np.flatnonzero(~(field.blocked_by_cutter(at) | field.blocked_by_body(at))):
        line = np.vstack([starts[k], tip])
        if moves_free(field, line).all():
            return Line(line, False)
    return None
