"""Facets cut where the label changes.

Every facet of the result has one label. All cuts lie in the planes of the mesh facets, so areas are kept exactly.
Theory: docs/theory/trim.md.
"""

from __future__ import annotations

import numpy as np

from geometry.asker import Asker, Label, bisect
from geometry.bend import bend
from geometry.kernels.trim import COLUMNS
from geometry.mesh import F64, I32
from geometry.sheet import I64, Sheet, sides_of

# Rounds of cutting sides that hold a third label; then the change nearest to one end is taken.
SPLIT_ROUNDS = 4


def label_sheet(sheet: Sheet, label: Label, tolerance: float) -> Sheet:
    """Cut a refined sheet where the label changes.

    sheet     : Sheet as ``refined`` returns it
    label     : Label
    tolerance : float, mm, distance within which a change of label is located

    Returns a Sheet with one label a facet.
    """
    ask = Asker(label)
    at = ask(sheet.nodes, sheet.face)
    at = _probe(sheet, at, ask)
    sheet.first_cut = len(sheet.nodes)
    pure = (at[sheet.corners] == at[sheet.corners[:, :1]]).all(axis=1)
    whole = sheet.corners[pure]
    sheet.corners = sheet.corners[~pure]
    crossing = _crossings(sheet, at, ask, tolerance)
    _cut(sheet, *crossing, ask, tolerance)
    bend(sheet, ask, tolerance)
    sheet.label = np.concatenate([at[whole[:, 0]], sheet.label])
    sheet.corners = np.concatenate([whole, sheet.corners])
    return sheet


def _probe(sheet: Sheet, at: I64, ask: Asker) -> I64:
    """Ask the centre of every facet; where none of the corners has that label, the centre becomes a node."""
    centre = sheet.nodes[sheet.corners].mean(axis=1)
    here = ask(centre, sheet.face[sheet.corners[:, 0]])
    new = (here[:, None] != at[sheet.corners]).all(axis=1)
    number = sheet.add(centre[new], sheet.face[sheet.corners[new, 0]])
    c = sheet.corners[new]
    fans = [np.stack([c[:, k], c[:, (k + 1) % 3], number], axis=1) for k in range(3)]
    sheet.corners = np.concatenate([sheet.corners[~new], *fans])
    return np.concatenate([at, here[new]])


def _crossings(sheet: Sheet, at: I64, ask: Asker, tolerance: float) -> tuple[I64, I64, I64]:
    """A node on every edge whose ends differ, at the change of label.

    Returns the labels (n,) of the nodes (of no meaning for crossings); (t, 3) edge numbers; (e,) crossing nodes or
    -1. An edge that holds a third label is split there, with the facets beside it, and asked again.
    """
    done_key, done_node = np.zeros(0, np.int64), np.zeros(0, np.int64)
    for round_ in range(SPLIT_ROUNDS + 1):
        low, high, sides = sides_of(sheet.corners)
        key = low << 32 | high
        open_ = np.flatnonzero((at[low] != at[high]) & ~np.isin(key, done_key))
        a, b = low[open_], high[open_]
        share, third, label = bisect(ask, sheet.nodes[a], sheet.nodes[b], sheet.face[a], at[a], at[b], tolerance,
                                     round_ < SPLIT_ROUNDS)
        node = sheet.add(sheet.nodes[a] + share[:, None] * (sheet.nodes[b] - sheet.nodes[a]), sheet.face[a])
        at = np.concatenate([at, np.where(third, label, at[a])])
        done_key = np.concatenate([done_key, key[open_[~third]]])
        done_node = np.concatenate([done_node, node[~third]])
        if not third.any():
            break
        middle = np.full(len(low), -1)
        middle[open_[third]] = node[third]
        sheet.corners = split(sheet.corners, sides, middle)
    order = np.argsort(done_key)
    found = np.minimum(np.searchsorted(done_key[order], key), max(len(order) - 1, 0))
    crossing = np.full(len(key), -1)
    if len(order):
        hit = done_key[order][found] == key
        crossing[hit] = done_node[order][found[hit]]
    return at, sides, crossing


def split(corners: I64, sides: I64, middle: I64) -> I64:
    """Divide facets at nodes on their sides.

    corners : (t, 3) int64 node numbers; sides : (t, 3) edge numbers; middle : (e,) int64 node on each edge or -1

    Returns (q, 3) node numbers, one to four facets for each.
    """
    m = middle[sides]
    count = (m >= 0).sum(axis=1)
    out = [corners[count == 0]]
    # turned so that the only split side, or the first of two adjoining ones, runs from corner 0 to corner 1
    turn = np.where(count == 1, (m >= 0).argmax(axis=1), ((m < 0).argmax(axis=1) + 1) % 3)
    turned = (turn[:, None] + np.arange(3)) % 3
    c, m = np.take_along_axis(corners, turned, 1), np.take_along_axis(m, turned, 1)
    for number, facets in ((1, "0m2 m12"), (2, "m1k 0mk 0k2"), (3, "0mn m1k nk2 mkn")):
        some = count == number
        names = {"0": c[some, 0], "1": c[some, 1], "2": c[some, 2], "m": m[some, 0], "k": m[some, 1], "n": m[some, 2]}
        out += [np.stack([names[x] for x in facet], axis=1) for facet in facets.split()]
    return np.concatenate(out)


def _cut(sheet: Sheet, at: I64, sides: I64, crossing: I64, ask: Asker, tolerance: float) -> None:
    """Facets with two labels are cut by a segment, with three by a star from the point where the labels meet."""
    at = at[sheet.corners]
    m = crossing[sides]
    count = (m >= 0).sum(axis=1)
    pieces, labels = [sheet.corners[count == 0]], [at[count == 0, 0]]
    turned = ((m < 0).argmax(axis=1)[:, None] + 2 + np.arange(3)) % 3
    two = count == 2
    c, x, t = (np.take_along_axis(v, turned, 1)[two] for v in (sheet.corners, m, at))
    # corner 0 is alone: sides 0 and 2 are crossed
    for facet, owner in ((c[:, 0], x[:, 0], x[:, 2]), 0), ((x[:, 0], c[:, 1], c[:, 2]), 1), \
            ((x[:, 0], c[:, 2], x[:, 2]), 1):
        pieces.append(np.stack(facet, axis=1))
        labels.append(t[:, owner])
    three = count == 3
    c, x, t = sheet.corners[three], m[three], at[three]
    face = sheet.face[c[:, 0]]
    star = sheet.add(_meeting_points(ask, sheet.nodes[c], face, t, tolerance), face)
    for k in range(3):
        after = (k + 1) % 3
        pieces += [np.stack([c[:, k], x[:, k], star], axis=1), np.stack([x[:, k], c[:, after], star], axis=1)]
        labels += [t[:, k], t[:, after]]
    sheet.corners, sheet.label = np.concatenate(pieces), np.concatenate(labels)


def _meeting_points(ask: Asker, corners: F64, face: I32, at: I64, tolerance: float) -> F64:
    """Where three labels meet in facets whose corners have three: by halving, one of four parts has three again.

    corners : (k, 3, 8) node rows; face : (k,); at : (k, 3) labels

    Returns (k, 8) node rows, inside the facets. By Sperner's lemma a part with three labels exists while no side holds
    a label that its ends do not have; where none is found the halving ends.
    """
    outer, live = corners.mean(axis=1), np.arange(len(corners))
    corners, at = corners.copy(), at.copy()
    while True:
        p = corners[live, :, :3]
        live = live[np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1) > tolerance]
        if not len(live):
            return 0.999 * corners.mean(axis=1) + 0.001 * outer
        c, t = corners[live], at[live]
        m = 0.5 * (c + np.roll(c, -1, axis=1))
        a = ask(m.reshape(-1, COLUMNS), np.repeat(face[live], 3)).reshape(-1, 3)
        parts = [(c[:, 0], m[:, 0], m[:, 2]), (m[:, 0], c[:, 1], m[:, 1]), (m[:, 2], m[:, 1], c[:, 2]),
                 (m[:, 0], m[:, 1], m[:, 2])]
        names = [(t[:, 0], a[:, 0], a[:, 2]), (a[:, 0], t[:, 1], a[:, 1]), (a[:, 2], a[:, 1], t[:, 2]),
                 (a[:, 0], a[:, 1], a[:, 2])]
        part, name = np.stack([np.stack(q, 1) for q in parts], 1), np.stack([np.stack(q, 1) for q in names], 1)
        good = (name[..., 0] != name[..., 1]) & (name[..., 1] != name[..., 2]) & (name[..., 2] != name[..., 0])
        has, pick, row = good.any(axis=1), good.argmax(axis=1), np.arange(len(live))
        corners[live[has]], at[live[has]] = part[row, pick][has], name[row, pick][has]
        live = live[has]
