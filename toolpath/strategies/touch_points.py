"""Passes through places that no other pass has finished although the tool reaches them, and single touches.

Places beside each other on one wall or floor are joined to a pass. Such are the places of a slot as wide as the tool,
which is narrower than the lattice of contours. A place without another beside it gets a touch.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from geometry.mesh import F64
from toolpath.lines import Line
from toolpath.passes.contours import moves_free
from toolpath.strategies.zigzag import STEEP
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

MAX_PLACES = 400  # a zone with more is not just missing a few spots
APART = 0.1  # mm, places nearer than this are one
SHORT = 0.02  # mm, length of a touch
BESIDE = 0.5  # mm, places farther apart are not joined
GRADE = 0.9 * STEEP  # height over length of a move: a steeper one would need raised copies of the pass
ALIKE = 0.5  # cosine between normals: places with less are on two walls


def touches(field: TipField, tips: F64, normals: F64) -> list[Line]:
    """Lines through tips that touch the residual, and short level moves that end on those left alone.

    field   : TipField
    tips    : (n, 3) float64, mm, access frame, admissible
    normals : (n, 3) float64, unit, access frame, of the surface each tip touches, out of the material

    Returns
    -------
    list of Line
        Every place is on one of them, at most ``MAX_PLACES``. They run in climb order. A place alone with no free
        direction is left out.
    """
    near = np.column_stack([np.round(tips / APART), np.round(normals)]).astype(np.int64)  # walls of a slot stay apart
    _, first = np.unique(near, axis=0, return_index=True)
    first = np.sort(first)[:MAX_PLACES]
    places, sides = tips[first], normals[first]
    out: list[Line] = []
    for row in _joined(_neighbours(field, places, sides)):
        line = _in_climb_order(places[row], sides[row]) if len(row) > 1 else _touch(field, places[row[0]])
        out.extend([] if line is None else [line])
    return out


def _touch(field: TipField, tip: F64) -> Line | None:
    """A short level move that ends on a tip; None without a free direction."""
    around = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(12) * np.pi / 6]) * SHORT
    starts = tip + around
    at = starts + np.array([0.0, 0.0, LEVEL_TOLERANCE])
    for k in np.flatnonzero(~(field.blocked_by_cutter(at) | field.blocked_by_body(at))):
        line = np.vstack([starts[k], tip])
        if moves_free(field, line).all():
            return Line(line, False)
    return None


def _neighbours(field: TipField, places: F64, normals: F64) -> csr_matrix:
    """(n, n) float64, mm: distances of the places between which a straight move is free and can be part of a pass."""
    a, b = cKDTree(places).query_pairs(BESIDE, output_type="ndarray").reshape(-1, 2).T
    way = places[b] - places[a]
    along = np.linalg.norm(way[:, :2], axis=1)
    keep = (np.abs(way[:, 2]) <= GRADE * along) & (np.einsum("ij,ij->i", normals[a], normals[b]) >= ALIKE)
    a, b = a[keep], b[keep]
    # between two free places a step apart a tool enters no more than ``moves_free`` allows
    count = np.ceil(np.linalg.norm(places[b] - places[a], axis=1) / field.lattice.step).astype(np.int64) + 1
    row = np.repeat(np.arange(len(a)), count)
    share = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)) / (count[row] - 1)
    at = places[a[row]] + share[:, None] * (places[b[row]] - places[a[row]]) + [0.0, 0.0, LEVEL_TOLERANCE]
    blocked = field.blocked_by_cutter(at) | field.blocked_by_body(at)
    free = np.bincount(row[blocked], minlength=len(a)) == 0
    a, b = a[free], b[free]
    length = np.linalg.norm(places[b] - places[a], axis=1)
    return csr_matrix((np.tile(length, 2), (np.r_[a, b], np.r_[b, a])), shape=(len(places), len(places)))


def _joined(beside: csr_matrix) -> Iterator[NDArray[np.int64]]:
    """Rows of index, each place in one: ways from place to place, from an end of what hangs together to the other.

    The next place is, of those beside the last one, that which lies nearest to the end where the ways began. So none is
    left behind on a strip, and an area is swept.
    """
    count, group = connected_components(beside, directed=False)
    for k in range(count):
        mine = np.flatnonzero(group == k)
        inside = beside[mine][:, mine]
        end = int(np.argmax(dijkstra(inside, directed=False, indices=0)))
        far = dijkstra(inside, directed=False, indices=end)
        left = np.ones(len(mine), np.bool_)
        while left.any():
            at = int(np.argmin(np.where(left, far, np.inf)))
            way = [at]
            left[at] = False
            while True:
                near = inside.indices[inside.indptr[at]:inside.indptr[at + 1]]
                near = near[left[near]]
                if not len(near):
                    break
                at = int(near[np.argmin(far[near])])
                way.append(at)
                left[at] = False
            yield mine[np.array(way)]


def _in_climb_order(points: F64, normals: F64) -> Line:
    """A line with the material on its right, where it is beside the tool."""
    way = np.diff(points[:, :2], axis=0)
    out = normals[:-1, :2] + normals[1:, :2]
    turns = float((way[:, 0] * out[:, 1] - way[:, 1] * out[:, 0]).sum())
    return Line(np.ascontiguousarray(points if turns >= 0.0 else points[::-1]), False)


__all__ = ["touches"]
