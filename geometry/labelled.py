"""A sheet of labelled facets: mesh facets of some faces, refined, asked, and cut where the label changes.

Every facet of the result has one label. All cuts lie in the planes of the mesh facets, so areas are kept exactly.
Theory: docs/theory/trim.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import GeometryError
from geometry.kernels.trim import COLUMNS, count_division, divide
from geometry.mesh import F64, I32
from geometry.part import Part

I64 = NDArray[np.int64]
BOOL = NDArray[np.bool_]
# points (k, 3) mm, unit normals (k, 3), face numbers (k,) -> labels (k,)
Label = Callable[[F64, F64, I32], I64]
# Rounds of cutting sides that hold a third label; then the change nearest to one end is taken.
SPLIT_ROUNDS = 4
# Rounds of bending the cuts towards a curved border; each takes three quarters off the error that is left.
BEND_ROUNDS = 8
# A node never comes nearer to the far corner of the facet it is moved in than this fraction of the way.
REACH = 0.9


@dataclass(eq=False)
class Sheet:
    """Facets of some faces of a part.

    nodes    : (n, 8) float64: x, y, z mm, u, v, normal (not unit); a point has one node per face and side of a seam
    face     : (n,) int32, face number of each node
    corners  : (t, 3) int64, node numbers, counter-clockwise seen from outside the material
    label    : (t,) int64 of each facet; before the cut, of no meaning
    original : int, the first so many nodes are corners of the part's own mesh
    first_cut: int, nodes from this one on lie where the label changes
    """

    nodes: F64
    face: I32
    corners: I64
    label: I64
    original: int
    first_cut: int = 0

    def areas(self) -> F64:
        """(t,) float64, mm²."""
        p = self.nodes[self.corners, :3]
        return np.asarray(0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1))

    def uv_areas(self) -> F64:
        """(t,) float64, signed, in units of the parameters."""
        q = self.nodes[self.corners, 3:5]
        a, b = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
        return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))

    def add(self, rows: F64, face: I32) -> I64:
        """Append nodes; returns their numbers."""
        first = len(self.nodes)
        self.nodes = np.concatenate([self.nodes, rows])
        self.face = np.concatenate([self.face, face])
        return np.arange(first, first + len(rows))


def sheet_of(part: Part, faces: Sequence[int] | None) -> Sheet:
    """The mesh facets of the wanted faces as a sheet.

    part  : Part with ``uv``
    faces : face numbers, all when None

    Returns Sheet. Where the surface has a pole, the facets without area that the mesh leaves out there are put back:
    they have area in (u, v).
    Raises GeometryError (``no_parameters``, ``no_such_face``).
    """
    if part.uv is None:
        raise GeometryError("the part carries no surface parameters", code="no_parameters",
                            remedy="read the part from a STEP file")
    wanted = np.arange(1, len(part.faces) + 1) if faces is None else np.unique(np.asarray(faces, dtype=np.int64))
    absent = [f"F{f}" for f in wanted if not 1 <= f <= len(part.faces)]
    if absent:
        raise GeometryError(f"no such face: {', '.join(absent)}; the solid has {len(part.faces)}",
                            code="no_such_face", subjects=tuple(absent), limit=len(part.faces))
    rows = np.flatnonzero(np.isin(part.mesh.face_ids, wanted))
    ids, vertex = np.repeat(part.mesh.face_ids[rows], 3), part.mesh.faces[rows].ravel()
    uv = part.uv[rows].reshape(-1, 2)
    order = np.lexsort((uv[:, 1], uv[:, 0], vertex, ids))
    new_point = np.ones(len(order), bool)
    new_point[1:] = (np.diff(ids[order]) != 0) | (np.diff(vertex[order]) != 0)
    new_node = new_point.copy()
    new_node[1:] |= (np.diff(uv[order], axis=0) != 0).any(axis=1)
    point, node = np.empty(len(order), np.int64), np.empty(len(order), np.int64)
    point[order], node[order] = np.cumsum(new_point) - 1, np.cumsum(new_node) - 1
    first = order[new_node]
    t = part.mesh.triangles[rows]
    cross = np.repeat(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), 3, axis=0)
    normal = np.stack([np.bincount(point, weights=cross[:, k]) for k in range(3)], axis=1)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0, length, 1.0)[:, None]
    nodes = np.concatenate([part.mesh.vertices[vertex[first]], uv[first], normal[point[first]]], axis=1)
    corners = _with_poles(node.reshape(-1, 3), vertex[first])
    return Sheet(nodes, ids[first].astype(np.int32), corners, np.zeros(len(corners), np.int64), len(nodes))


def _with_poles(corners: I64, vertex: I64) -> I64:
    """Where the rim runs from a pole to a node and straight back to the same pole at another u, close the notch."""
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    size = int(corners.max(initial=0)) + 1
    bare = ~np.isin(end * size + start, start * size + end)
    start, end = start[bare], end[bare]
    before = np.full(size, -1)
    before[end] = start
    a, p, b = before[start], start, end
    spike = (a >= 0) & (a != b) & (vertex[a] == vertex[b])
    return np.concatenate([corners, np.stack([p, a, b], axis=1)[spike]])


def sides_of(corners: I64) -> tuple[I64, I64, I64]:
    """Undirected sides of facets.

    corners : (t, 3) int64 node numbers

    Returns (e,) lower and (e,) higher node number of each edge, and (t, 3) the edge number of the side from corner k to
    corner k + 1.
    """
    a, b = corners, corners[:, [1, 2, 0]]
    keys, index = np.unique((np.minimum(a, b) << 32 | np.maximum(a, b)).ravel(), return_inverse=True)
    return keys >> 32, keys & 0xFFFFFFFF, index.reshape(-1, 3)


def refined(sheet: Sheet, pitch: float) -> Sheet:
    """The sheet with every facet divided so that no side and no row is longer than the pitch.

    sheet : Sheet
    pitch : float, mm

    Returns a new Sheet; nodes on a side depend on the side alone, so neighbours share them.
    """
    low, high, sides = sides_of(sheet.corners)
    length = np.linalg.norm(sheet.nodes[high, :3] - sheet.nodes[low, :3], axis=1)
    parts = np.maximum(1, np.ceil(length / pitch)).astype(np.int64)
    edge = np.repeat(np.arange(len(parts)), parts - 1)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1) + 1
    share = (step / parts[edge])[:, None]
    a, b = sheet.nodes[low[edge]], sheet.nodes[high[edge]]
    first = len(sheet.nodes) + np.cumsum(parts - 1) - (parts - 1)
    data = np.concatenate([sheet.nodes, a + share * (b - a)])
    inner, small = count_division(sheet.corners, sides, parts, length, first, data, pitch)
    node_at, facet_at = len(data) + np.cumsum(inner) - inner, np.cumsum(small) - small
    nodes = np.concatenate([data, np.empty((int(inner.sum()), COLUMNS))])
    corners = np.empty((int(small.sum()), 3), np.int64)
    divide(sheet.corners, sides, parts, length, first, nodes, pitch, node_at, facet_at, corners)
    face = np.concatenate([sheet.face, sheet.face[low[edge]], np.repeat(sheet.face[sheet.corners[:, 0]], inner)])
    return Sheet(nodes, face, corners, np.zeros(len(corners), np.int64), sheet.original)


class Asker:
    """The label as a function of node rows; ``calls`` and ``asked`` count what it cost."""

    def __init__(self, label: Label) -> None:
        self.label, self.calls, self.asked = label, 0, 0

    def __call__(self, rows: F64, face: I32) -> I64:
        """Labels (k,) of node rows (k, 8) on faces (k,) int32 numbers."""
        if not len(rows):
            return np.zeros(0, np.int64)
        self.calls, self.asked = self.calls + 1, self.asked + len(rows)
        normal = rows[:, 5:]
        length = np.linalg.norm(normal, axis=1)
        unit = normal / np.where(length > 0, length, 1.0)[:, None]
        out = np.asarray(self.label(np.ascontiguousarray(rows[:, :3]), unit, face))
        if out.shape != (len(rows),):
            raise ValueError(f"a label function must return one label a point, ({len(rows)},), not {out.shape}")
        return out.astype(np.int64, copy=False)


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
    crossing = _crossings(sheet, at, ask, tolerance)
    _cut(sheet, *crossing, ask, tolerance)
    _bend(sheet, ask, tolerance)
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


def bisect(ask: Asker, start: F64, end: F64, face: I32, at_start: I64, at_end: I64, tolerance: float,
           stop_at_third: bool) -> tuple[F64, BOOL, I64]:
    """Where along straight lines the label changes.

    start, end       : (k, 8) float64 node rows
    face             : (k,) int32 numbers
    at_start, at_end : (k,) int64 labels at the ends
    tolerance        : float, mm, length of the interval that is left
    stop_at_third    : stop where a label that neither end has is met; else it counts as that of the end

    Returns (k,) fraction of the way, (k,) bool where a third label was met, (k,) that label.
    """
    low, high = np.zeros(len(start)), np.ones(len(start))
    length = np.linalg.norm(end[:, :3] - start[:, :3], axis=1)
    third, label = np.zeros(len(start), bool), np.zeros(len(start), np.int64)
    while True:
        live = np.flatnonzero(~third & ((high - low) * length > tolerance))
        if not len(live):
            return 0.5 * (low + high), third, label
        middle = 0.5 * (low[live] + high[live])
        here = ask(start[live] + middle[:, None] * (end[live] - start[live]), face[live])
        same = here == at_start[live]
        low[live[same]], high[live[~same]] = middle[same], middle[~same]
        if stop_at_third:
            other = ~same & (here != at_end[live])
            rows = live[other]
            third[rows], label[rows], low[rows] = True, here[other], middle[other]


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


def _bend(sheet: Sheet, ask: Asker, tolerance: float) -> None:
    """Where the middle of a cut is farther than the tolerance from the change of label, move it there.

    The node goes along the line to the far corner of the facet on its wrong side, so no facet turns over.
    """
    settled = np.zeros(0, np.int64)
    for _ in range(BEND_ROUNDS):
        key, facets, places = _borders(sheet)
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
        right = ask(probe.reshape(-1, COLUMNS), np.repeat(face, 2)).reshape(-1, 2) == own
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
        way, _, _ = bisect(ask, end, middle[rows], face[rows], here, here, tolerance, False)
        node = sheet.add(end + way[:, None] * (middle[rows] - end), face[rows])
        _insert(sheet, facets[rows], places[rows], node)


def _reach(p: F64, q: F64, far: F64, back: F64) -> F64:
    """Fraction of the way from the middle of p q to the far corner that a node may go and still be seen from the back.

    p, q, far, back : (k, 8) node rows of the two facets beside the side p q
    """
    p, q, far, back = (x[:, :3] for x in (p, q, far, back))
    normal = np.cross(q - p, far - p) + np.cross(p - q, back - q)
    out = np.full(len(p), REACH)
    for a, b in ((p, 1.0), (q, -1.0)):
        at_start, at_end = (b * np.einsum("ij,ij->i", np.cross(a - back, x - back), normal)
                            for x in (0.5 * (p + q), far))
        # seen while the signed area is positive; it changes linearly along the way
        beyond = at_end * np.sign(at_start) < 0
        out[beyond] = np.minimum(out, REACH * at_start / np.where(beyond, at_start - at_end, 1.0))[beyond]
    return out


def _borders(sheet: Sheet) -> tuple[I64, I64, I64]:
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


def _insert(sheet: Sheet, facets: I64, places: I64, node: I64) -> None:
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
