"""Facets cut where the label changes.

Every facet of the result has one label. All cuts lie in the planes of the mesh facets, so areas are kept exactly.
Theory: docs/theory/trim.md.
"""

from __future__ import annotations

import numpy as np

from geometry.kernels.trim import COLUMNS
from geometry.mesh import F64, I32
from geometry.trimming.border_bending import bend
from geometry.trimming.facet_sheet import BOOL, I64, FacetSheet, sides_of
from geometry.trimming.label_query import Label, LabelQuery, bisect

# Rounds of cutting sides that hold a third label. After them the change nearest to one end counts.
SPLIT_ROUNDS = 4
# Rounds of halving facets in which the border is far from straight: the middle of the cut misses it by more than this
# fraction of the cut's length. ``bend`` removes the rest. Corners need many rounds. On ragged borders the halving ends
# at this many new nodes for each crossing.
CURVE_ROUNDS, CURVED, BUDGET = 8, 0.05, 8


def label_sheet(sheet: FacetSheet, label: Label, tolerance: float) -> FacetSheet:
    """Cut a refined sheet where the label changes.

    sheet     : FacetSheet as ``refined`` returns it
    label     : Label
    tolerance : float, mm, distance within which a change of label is located

    Returns a FacetSheet with one label a facet.
    """
    query = LabelQuery(label)
    at = query(sheet.nodes, sheet.face)
    at = _probe(sheet, at, query)
    sheet.first_cut = len(sheet.nodes)
    beside = np.zeros(len(at), bool)
    beside[sheet.corners[(at[sheet.corners] != at[sheet.corners[:, :1]]).any(axis=1)]] = True
    work = beside[sheet.corners].any(axis=1)
    rest = sheet.corners[~work]
    sheet.corners = sheet.corners[work]
    crossing = _crossings(sheet, at, _shared_sides(sheet.corners, rest), query, tolerance)
    _cut(sheet, *crossing, query, tolerance)
    bend(sheet, query, tolerance)
    sheet.label = np.concatenate([at[rest[:, 0]], sheet.label])
    sheet.corners = np.concatenate([rest, sheet.corners])
    return sheet


def _probe(sheet: FacetSheet, at: I64, query: LabelQuery) -> I64:
    """Query the centre of every facet; where none of the corners has its label, the centre becomes a node."""
    centre = sheet.nodes[sheet.corners].mean(axis=1)
    here = query(centre, sheet.face[sheet.corners[:, 0]])
    new = (here[:, None] != at[sheet.corners]).all(axis=1)
    number = sheet.add(centre[new], sheet.face[sheet.corners[new, 0]])
    c = sheet.corners[new]
    fans = [np.stack([c[:, k], c[:, (k + 1) % 3], number], axis=1) for k in range(3)]
    sheet.corners = np.concatenate([sheet.corners[~new], *fans])
    return np.concatenate([at, here[new]])


def _shared_sides(one: I64, two: I64) -> I64:
    """Keys of the edges that belong to facets of both sets."""
    low, high, _ = sides_of(one)
    low_two, high_two, _ = sides_of(two)
    return np.intersect1d(low << 32 | high, low_two << 32 | high_two, assume_unique=True)


def _crossings(sheet: FacetSheet, at: I64, fixed: I64, query: LabelQuery, tolerance: float) -> tuple[I64, I64, I64]:
    """A node on every edge whose ends differ, at the change of label.

    Returns the labels (n,) of the nodes (without meaning for crossings), (t, 3) edge numbers, and (e,) crossing
    nodes or -1. An edge that holds a third label is split there, with the facets beside it. So are the sides of
    facets in which the border is far from straight. Edges whose keys are ``fixed`` are not split, since other
    facets share them.
    """
    known, settled = np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
    curves, most = 0, np.inf
    for round_ in range(SPLIT_ROUNDS + CURVE_ROUNDS + 1):
        low, high, sides = sides_of(sheet.corners)
        key = low << 32 | high
        open_ = np.flatnonzero((at[low] != at[high]) & ~np.isin(key, known[:, 0]))
        a, b = low[open_], high[open_]
        share, third, label = bisect(query, sheet.nodes[a], sheet.nodes[b], sheet.face[a], at[a], at[b], tolerance,
                                     round_ - curves < SPLIT_ROUNDS)
        node = sheet.add(sheet.nodes[a] + share[:, None] * (sheet.nodes[b] - sheet.nodes[a]), sheet.face[a])
        at = np.concatenate([at, np.where(third, label, at[a])])
        known = np.concatenate([known, np.stack([key[open_], node], axis=1)[~third]])
        crossing = _look_up(known, key)
        middle = np.full(len(low), -1)
        middle[open_[third]] = node[third]
        if not third.any():
            most = min(most, len(sheet.nodes) + BUDGET * len(known))
            if curves == CURVE_ROUNDS or len(sheet.nodes) > most:
                break
            halved, fine = _curved(sheet, at, sides, crossing, settled, query, tolerance)
            settled = np.concatenate([settled, fine])
            halved = np.setdiff1d(halved, np.flatnonzero(np.isin(key, fixed))).astype(np.int64)
            if not len(halved):
                break
            curves += 1
            a, b = low[halved], high[halved]
            middle[halved] = sheet.add(0.5 * (sheet.nodes[a] + sheet.nodes[b]), sheet.face[a])
            at = np.concatenate([at, query(sheet.nodes[middle[halved]], sheet.face[a])])
        sheet.corners = split(sheet.corners, sides, middle)
    return at, sides, crossing


def _look_up(known: I64, key: I64) -> I64:
    """(e,) the node of each key among the rows (key, node) of ``known``, -1 where there is none."""
    if not len(known):
        return np.full(len(key), -1)
    known = known[np.argsort(known[:, 0])]
    found = known[np.minimum(np.searchsorted(known[:, 0], key), len(known) - 1)]
    return np.where(found[:, 0] == key, found[:, 1], -1)


def _curved(sheet: FacetSheet, at: I64, sides: I64, crossing: I64, settled: I64, query: LabelQuery,
            tolerance: float) -> tuple[I64, I64]:
    """Edge numbers of the facets to halve, and keys of the facets that need no further look.

    To halve are facets with two labels whose border is far from the middle of the cut, and facets with three labels
    without a known place where these meet.
    """
    m = crossing[sides]
    m.sort(axis=1)
    name = m[:, 1] << 32 | m[:, 2]
    m = np.where(np.isin(name, settled)[:, None], -1, crossing[sides])
    two = np.flatnonzero((m >= 0).sum(axis=1) == 2)
    turned = ((m[two] < 0).argmax(axis=1)[:, None] + 2 + np.arange(3)) % 3
    c, x = (np.take_along_axis(v[two], turned, 1) for v in (sheet.corners, m))
    p, q = sheet.nodes[x[:, 0]], sheet.nodes[x[:, 2]]
    middle, corner = 0.5 * (p + q), sheet.nodes[c]
    chord = np.linalg.norm((p - q)[:, :3], axis=1)
    room = np.maximum(CURVED * chord, tolerance)
    wrong = np.zeros(len(two), bool)
    face = sheet.face[c[:, 0]]
    for far, label in ((corner[:, 0], at[c[:, 0]]), (0.5 * (corner[:, 1] + corner[:, 2]), at[c[:, 1]])):
        height = np.linalg.norm(np.cross((p - q)[:, :3], (far - q)[:, :3]), axis=1) / np.where(chord > 0, chord, 1.0)
        share = np.minimum(room / np.where(height > 0, height, np.inf), 1.0)
        wrong |= query(middle + share[:, None] * (far - middle), face) != label
    wrong &= chord > 4.0 * tolerance
    three = np.flatnonzero((m >= 0).sum(axis=1) == 3)
    c = sheet.corners[three]
    _, found = _meeting_points(query, sheet.nodes[c], sheet.face[c[:, 0]], at[c], tolerance)
    bad, good = np.concatenate([two[wrong], three[~found]]), np.concatenate([two[~wrong], three[found]])
    return np.unique(sides[bad]), name[good]


def split(corners: I64, sides: I64, middle: I64) -> I64:
    """Divide facets at nodes on their sides.

    corners : (t, 3) int64, index of the nodes in the frame of the sheet
    sides   : (t, 3) int64, index of the edges
    middle  : (e,) int64, index of the node on each edge, or -1

    Returns (q, 3) int64, index of the nodes, one to four facets for each.
    """
    m = middle[sides]
    count = (m >= 0).sum(axis=1)
    out = [corners[count == 0]]
    # rotated so that the only split side, or the first of two adjoining ones, runs from corner 0 to corner 1
    turn = np.where(count == 1, (m >= 0).argmax(axis=1), ((m < 0).argmax(axis=1) + 1) % 3)
    turned = (turn[:, None] + np.arange(3)) % 3
    c, m = np.take_along_axis(corners, turned, 1), np.take_along_axis(m, turned, 1)
    for number, facets in ((1, "0m2 m12"), (2, "m1k 0mk 0k2"), (3, "0mn m1k nk2 mkn")):
        some = count == number
        names = {"0": c[some, 0], "1": c[some, 1], "2": c[some, 2], "m": m[some, 0], "k": m[some, 1], "n": m[some, 2]}
        out += [np.stack([names[x] for x in facet], axis=1) for facet in facets.split()]
    return np.concatenate(out)


def _cut(sheet: FacetSheet, at: I64, sides: I64, crossing: I64, query: LabelQuery, tolerance: float) -> None:
    """Cut facets with two labels by a segment, facets with three by a star from the point where the labels meet."""
    at = at[sheet.corners]
    m = crossing[sides]
    count = (m >= 0).sum(axis=1)
    pieces, labels = [sheet.corners[count == 0]], [at[count == 0, 0]]
    turned = ((m < 0).argmax(axis=1)[:, None] + 2 + np.arange(3)) % 3
    two = count == 2
    c, x, t = (np.take_along_axis(v, turned, 1)[two] for v in (sheet.corners, m, at))
    # corner 0 is alone, so sides 0 and 2 are crossed; the diagonal at the wider angle to the cut is taken
    first = _cosine(sheet.nodes, x[:, 0], x[:, 2], c[:, 2]) < _cosine(sheet.nodes, x[:, 2], x[:, 0], c[:, 1])
    near = np.stack([x[:, 0], c[:, 1], np.where(first, c[:, 2], x[:, 2])], axis=1)
    other = np.stack([np.where(first, x[:, 0], c[:, 1]), c[:, 2], x[:, 2]], axis=1)
    pieces += [np.stack([c[:, 0], x[:, 0], x[:, 2]], axis=1), near, other]
    labels += [t[:, 0], t[:, 1], t[:, 1]]
    three = count == 3
    c, x, t = sheet.corners[three], m[three], at[three]
    face = sheet.face[c[:, 0]]
    star = sheet.add(_meeting_points(query, sheet.nodes[c], face, t, tolerance)[0], face)
    for k in range(3):
        after = (k + 1) % 3
        pieces += [np.stack([c[:, k], x[:, k], star], axis=1), np.stack([x[:, k], c[:, after], star], axis=1)]
        labels += [t[:, k], t[:, after]]
    sheet.corners, sheet.label = np.concatenate(pieces), np.concatenate(labels)


def _cosine(nodes: F64, at: I64, one: I64, two: I64) -> F64:
    """Cosine of the angle at a node between the directions to two others."""
    a, b = nodes[one, :3] - nodes[at, :3], nodes[two, :3] - nodes[at, :3]
    size = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return np.asarray(np.einsum("ij,ij->i", a, b) / np.where(size > 0, size, 1.0))


def _meeting_points(query: LabelQuery, corners: F64, face: I32, at: I64, tolerance: float) -> tuple[F64, BOOL]:
    """Where three labels meet in facets whose corners have three labels; halving finds the part with all three.

    corners : (k, 3, 8) node rows; face : (k,); at : (k, 3) labels

    Returns (k, 8) node rows, inside the facets, and (k,) whether the place was found. By Sperner's lemma a part with
    three labels exists while no side holds a label that its ends do not have. Without such a part the halving ends.
    """
    outer, live = corners.mean(axis=1), np.arange(len(corners))
    corners, at = corners.copy(), at.copy()
    found = np.ones(len(corners), bool)
    while True:
        p = corners[live, :, :3]
        live = live[np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1) > tolerance]
        if not len(live):
            return 0.999 * corners.mean(axis=1) + 0.001 * outer, found
        c, t = corners[live], at[live]
        m = 0.5 * (c + np.roll(c, -1, axis=1))
        a = query(m.reshape(-1, COLUMNS), np.repeat(face[live], 3)).reshape(-1, 3)
        parts = [(c[:, 0], m[:, 0], m[:, 2]), (m[:, 0], c[:, 1], m[:, 1]), (m[:, 2], m[:, 1], c[:, 2]),
                 (m[:, 0], m[:, 1], m[:, 2])]
        names = [(t[:, 0], a[:, 0], a[:, 2]), (a[:, 0], t[:, 1], a[:, 1]), (a[:, 2], a[:, 1], t[:, 2]),
                 (a[:, 0], a[:, 1], a[:, 2])]
        part, name = np.stack([np.stack(q, 1) for q in parts], 1), np.stack([np.stack(q, 1) for q in names], 1)
        good = (name[..., 0] != name[..., 1]) & (name[..., 1] != name[..., 2]) & (name[..., 2] != name[..., 0])
        has, pick, row = good.any(axis=1), good.argmax(axis=1), np.arange(len(live))
        corners[live[has]], at[live[has]] = part[row, pick][has], name[row, pick][has]
        found[live[~has]] = False
        live = live[has]
