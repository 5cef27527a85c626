"""Bends the cuts between labels towards a curved border."""

from __future__ import annotations

import numpy as np

from geometry.kernels.trim import COLUMNS
from geometry.mesh import F64
from geometry.trimming.facet_sheet import BOOL, I64, FacetSheet
from geometry.trimming.label_query import LabelQuery, bisect

# Rounds of bending; each removes about three quarters of the remaining error.
BEND_ROUNDS = 10
# Largest number of new nodes for each cut. Without it the bending follows a ragged border into every tooth.
BUDGET = 8
# A node keeps at least this fraction of the way from the far corner of the facet it moves in.
REACH = 0.9


def bend(sheet: FacetSheet, query: LabelQuery, tolerance: float) -> None:
    """Put a node on every cut whose middle is farther than the tolerance from the change of label.

    sheet     : FacetSheet, every facet with one label; changed in place
    query       : LabelQuery
    tolerance : float, mm

    The node goes along the line to the far corner of the facet on its wrong side, so no facet turns over.
    """
    settled = np.zeros(0, np.int64)
    key, facets, places = _borders(sheet)
    most = len(sheet.nodes) + BUDGET * len(key)
    for _ in range(BEND_ROUNDS):
        open_ = ~np.isin(key, settled)
        key, facets, places = key[open_], facets[open_], places[open_]
        if not len(key):
            return
        p, q = sheet.nodes[key >> 32], sheet.nodes[key & 0xFFFFFFFF]
        face = sheet.face[key >> 32]
        middle = 0.5 * (p + q)
        far = sheet.nodes[np.take_along_axis(sheet.corners[facets], ((places + 2) % 3)[..., None], 2)[..., 0]]
        chord = np.linalg.norm((q - p)[:, :3], axis=1)
        height = (np.linalg.norm(np.cross((q - p)[:, None, :3], far[..., :3] - p[:, None, :3]), axis=2)
                  / np.where(chord > 0, chord, 1.0)[:, None])
        share = np.minimum(tolerance / np.where(height > 0, height, tolerance), 0.5)
        own = sheet.label[facets]
        probe = middle[:, None] + share[..., None] * (far - middle[:, None])
        right = query(probe.reshape(-1, COLUMNS), np.repeat(face, 2)).reshape(-1, 2) == own
        fine = right.all(axis=1) | (chord <= tolerance)
        settled = np.concatenate([settled, key[fine]])
        rows = np.flatnonzero(~fine)
        rows = rows[_independent(facets[rows], len(sheet.corners))]
        if not len(rows):
            return
        side = np.where(right[rows, 0], 1, 0)
        reach = _reach(p[rows], q[rows], far[rows, side], far[rows, 1 - side])
        end = middle[rows] + reach[:, None] * (far[rows, side] - middle[rows])
        here = own[rows, side]
        way, _, _ = bisect(query, end, middle[rows], face[rows], here, here, tolerance, False)
        node = sheet.add(end + way[:, None] * (middle[rows] - end), face[rows])
        _insert(sheet, facets[rows], places[rows], node)
        if len(sheet.nodes) > most:
            return
        key, facets, places = _borders(sheet)


def _reach(p: F64, q: F64, far: F64, back: F64) -> F64:
    """Fraction of the way from the middle of p q to the far corner at which the node is still visible from the back.

    p, q, far, back : (k, 8) node rows of the two facets beside the side p q
    """
    p, q, far, back = (x[:, :3] for x in (p, q, far, back))
    normal = np.cross(q - p, far - p) + np.cross(p - q, back - q)
    out = np.full(len(p), REACH)
    for a, b in ((p, 1.0), (q, -1.0)):
        at_start, at_end = (b * np.einsum("ij,ij->i", np.cross(a - back, x - back), normal)
                            for x in (0.5 * (p + q), far))
        # visible while the signed area is positive; it changes linearly along the way
        beyond = at_end * np.sign(at_start) < 0
        out[beyond] = np.minimum(out, REACH * at_start / np.where(beyond, at_start - at_end, 1.0))[beyond]
    return out


def _borders(sheet: FacetSheet) -> tuple[I64, I64, I64]:
    """Sides between two labels: key (e,) of the nodes, the two facets (e, 2), and its place (e, 2) in them."""
    near = np.flatnonzero((sheet.corners >= sheet.first_cut).sum(axis=1) >= 2)
    a, b = sheet.corners[near], sheet.corners[near][:, [1, 2, 0]]
    key = (np.minimum(a, b) << 32 | np.maximum(a, b)).ravel()
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    one, two = order[pair], order[pair + 1]
    facets = np.stack([near[one // 3], near[two // 3]], axis=1)
    differ = sheet.label[facets[:, 0]] != sheet.label[facets[:, 1]]
    return key[one][differ], facets[differ], np.stack([one % 3, two % 3], axis=1)[differ]


def _independent(facets: I64, count: int) -> BOOL:
    """Rows (e,) of facet pairs (e, 2) of which no two share a facet; the earlier one wins."""
    rank = np.arange(len(facets))
    best = np.full(count, len(facets))
    np.minimum.at(best, facets.ravel(), np.repeat(rank, 2))
    return np.asarray((best[facets] == rank[:, None]).all(axis=1))


def _insert(sheet: FacetSheet, facets: I64, places: I64, node: I64) -> None:
    """Split the two facets beside each side at a node in its stead."""
    more, labels = [], []
    for k in (0, 1):
        rows = sheet.corners[facets[:, k]]
        turned = np.take_along_axis(rows, (places[:, k, None] + np.arange(3)) % 3, 1)
        sheet.corners[facets[:, k]] = np.stack([turned[:, 0], node, turned[:, 2]], axis=1)
        more.append(np.stack([node, turned[:, 1], turned[:, 2]], axis=1))
        labels.append(sheet.label[facets[:, k]])
    sheet.corners = np.concatenate([sheet.corners, *more])
    sheet.label = np.concatenate([sheet.label, *labels])
