"""Pieces of B-rep faces: trimmed faces made from labels of the surface.

A label function gives the label of each point of the surface (a zone, the remainder). ``trim_faces`` finds where the
label changes and returns the pieces with their borders in the parameters of the face. Theory: docs/theory/trim.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from geometry.kernels.trim import thin, trace
from geometry.mesh import F64
from geometry.part import Part
from geometry.trimming.facet_sheet import BOOL, I64, FacetSheet, refined, sheet_of
from geometry.trimming.label_cuts import label_sheet
from geometry.trimming.label_query import Label

# Pieces narrower than the tolerance are noise of the label along a border. They go to the neighbour, in rounds.
ABSORB_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class FacePatch:
    """A connected piece of one B-rep face.

    face      : face number
    area      : mm², of the mesh facets and parts of facets in it
    whole     : the piece is the whole face
    forward   : the outward normal of the face is that of its surface, X_u x X_v
    loops     : (k, 2) float64 parameters (u, v) each: closed polylines, the first point not repeated; the outer one
                first, then the holes
    loops_xyz : (k, 3) float64, mm, the same points on the mesh, setup frame

    The piece lies on the left of its loops as seen from outside the material. So in (u, v) outer loops run
    counter-clockwise on a forward face and clockwise on any other; holes the other way. Every loop is a closed polygon
    in (u, v): a piece that runs round a period is cut at the seam of the face, and runs along it twice.
    """

    face: int
    area: float
    whole: bool
    forward: bool
    loops: tuple[F64, ...]
    loops_xyz: tuple[F64, ...]


def trim_faces(part: Part, faces: Sequence[int] | None, label: Label, pitch: float,
               tolerance: float = 1e-3) -> dict[int, tuple[FacePatch, ...]]:
    """Cut faces into pieces of one label each.

    part      : Part with ``uv``
    faces     : face numbers, all when None
    label     : points (k, 3) float64 mm, unit normals (k, 3) float64 out of the material, face numbers (k,) int32 ->
                labels (k,) integers. It is called some tens of times with many points. One point must always get the
                same label
    pitch     : float, mm, spacing of the first points: the search may miss narrower islands and necks
    tolerance : float, mm, largest distance of a border from the change of label

    Returns for each label, in ascending order, its pieces by face number; the pieces of a face partition it.
    Raises GeometryError (``no_parameters``, ``no_such_face``), ValueError for a pitch or tolerance not above 0.
    Notes   Borders are thinned as in [Douglas1973]. docs/theory/trim.md: error bound, decisions at seams and poles.
    """
    if not (pitch > 0 and tolerance > 0):
        raise ValueError(f"pitch and tolerance must be positive, got {pitch} and {tolerance}")
    sheet = sheet_of(part, faces)
    if not len(sheet.corners):
        return {}
    scale = _scales(sheet)
    # half for finding the border, half for thinning it
    sheet = label_sheet(refined(sheet, pitch), label, 0.5 * tolerance)
    twin, areas = _twins(sheet.corners), sheet.areas()
    group = _absorb(sheet, twin, areas, tolerance)
    return _patches(sheet, twin, group, areas, scale, 0.5 * tolerance)


def _twins(corners: I64) -> I64:
    """(3 t,) the opposite side of each side, -1 at the rim; side 3 t + k runs from corner k to corner k + 1."""
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    forth, back = start << 32 | end, end << 32 | start
    order = np.argsort(forth)
    place = np.minimum(np.searchsorted(forth[order], back), len(order) - 1)
    other = order[place]
    return np.where(forth[other] == back, other, -1)


def _components(twin: I64, label: I64) -> I64:
    """(t,) group number of each facet: connected facets of one label."""
    side = np.flatnonzero(twin >= 0)
    a, b = side // 3, twin[side] // 3
    same = label[a] == label[b]
    graph = coo_matrix((np.ones(same.sum(), np.int8), (a[same], b[same])), shape=(len(label), len(label)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _absorb(sheet: FacetSheet, twin: I64, areas: F64, tolerance: float) -> I64:
    """Give pieces narrower than the tolerance (twice area over border) to the neighbour with the longest border.

    Returns (t,) group numbers; ``sheet.label`` is changed with them.
    """
    start, end = sheet.corners.ravel(), sheet.corners[:, [1, 2, 0]].ravel()
    group = _components(twin, sheet.label)
    for _ in range(ABSORB_ROUNDS):
        border = np.flatnonzero((twin >= 0) & (group[twin // 3] != np.repeat(group, 3)))
        mine, theirs = group[border // 3], group[twin[border] // 3]
        length = np.linalg.norm(sheet.nodes[end[border], :3] - sheet.nodes[start[border], :3], axis=1)
        around = np.bincount(mine, weights=length, minlength=group.max() + 1)
        area = np.bincount(group, weights=areas)
        narrow = (around > 0) & (2.0 * area < tolerance * around)
        # the lesser of two narrow neighbours waits; otherwise they swap
        rank = np.where(narrow, area, np.inf)
        lesser = narrow[mine] & ((rank[theirs] > rank[mine]) | ((rank[theirs] == rank[mine]) & (theirs > mine)))
        if not lesser.any():
            break
        pair, which = np.unique(mine[lesser] * len(area) + theirs[lesser], return_inverse=True)
        total = np.bincount(which, weights=length[lesser])
        order = np.lexsort((pair, total))
        label_of = np.zeros(len(area), np.int64)
        label_of[group] = sheet.label
        heir = np.arange(len(area))
        heir[pair[order] // len(area)] = pair[order] % len(area)
        sheet.label = label_of[heir][group]
        group = _components(twin, sheet.label)
    return group


def _patches(sheet: FacetSheet, twin: I64, group: I64, areas: F64, scale: F64,
             tolerance: float) -> dict[int, tuple[FacePatch, ...]]:
    sides = 3 * len(sheet.corners)
    nodes, walked, at = np.empty(sides, np.int64), np.empty(sides, np.int64), np.empty(sides + 1, np.int64)
    count = trace(sheet.corners, twin, group, nodes, walked, at)
    at, nodes, walked = at[:count + 1], nodes[:at[count]], walked[:at[count]]
    other = np.where(twin[walked] >= 0, group[twin[walked] // 3], -1)
    owner = group[walked // 3]
    face_of = np.zeros(group.max() + 1, np.int64)
    face_of[group] = sheet.face[sheet.corners[:, 0]]
    keep = _kept(sheet, nodes, at, owner, other, scale, tolerance)
    _restore(sheet, nodes, at, owner, face_of, keep)
    label_of = np.zeros(len(face_of), np.int64)
    label_of[group] = sheet.label
    area = np.bincount(group, weights=areas)
    turn = np.bincount(face_of[group], weights=sheet.uv_areas(), minlength=face_of.max() + 1) >= 0
    pieces = np.bincount(face_of)
    loops: list[list[I64]] = [[] for _ in face_of]
    for k in range(count):
        loop = nodes[at[k]:at[k + 1]]
        loops[owner[at[k]]].append(loop[keep[loop]])
    out: dict[int, list[FacePatch]] = {}
    for g in np.lexsort((np.arange(len(face_of)), face_of, label_of)):
        rings = sorted(loops[g], key=lambda loop: -abs(_shoelace(sheet.nodes[loop, 3:5])))
        face = int(face_of[g])
        out.setdefault(int(label_of[g]), []).append(FacePatch(
            face, float(area[g]), bool(pieces[face] == 1), bool(turn[face]),
            tuple(sheet.nodes[loop, 3:5] for loop in rings), tuple(sheet.nodes[loop, :3] for loop in rings)))
    return {k: tuple(v) for k, v in out.items()}


def _shoelace(polygon: F64) -> float:
    p = polygon - polygon[0]
    q = np.roll(p, -1, axis=0)
    return float(0.5 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum())


def _scales(sheet: FacetSheet) -> F64:
    """(f, 2) float64 by face number, mm a unit of u and of v: the 99 % quantile by area over the facets of the face."""
    p, q = sheet.nodes[sheet.corners, :3], sheet.nodes[sheet.corners, 3:5]
    e, f = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    a, b = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    double = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area, face = sheet.areas(), sheet.face[sheet.corners[:, 0]]
    out = np.zeros((int(face.max()) + 1, 2))
    for k, (x, y) in enumerate(((b[:, 1], -a[:, 1]), (-b[:, 0], a[:, 0]))):
        along = (x[:, None] * e + y[:, None] * f) / np.where(double != 0, double, np.inf)[:, None]
        size = np.linalg.norm(along, axis=1)
        order = np.lexsort((size, face))
        total = np.cumsum(area[order])
        ends = np.flatnonzero(np.append(np.diff(face[order]) != 0, True))
        before = np.concatenate([[0.0], total[ends[:-1]]])
        pick = np.minimum(np.searchsorted(total, before + 0.99 * (total[ends] - before)), ends)
        out[face[order][ends], k] = size[order][pick]
    return out


def _kept(sheet: FacetSheet, nodes: I64, at: I64, owner: I64, other: I64, scale: F64, tolerance: float) -> BOOL:
    """(n,) nodes that stay in the loops.

    On the rim of a face these are its own nodes and the ends of borders. On a border between two pieces they are the
    nodes that [Douglas1973] keeps, computed once for both sides.
    """
    keep = np.zeros(len(sheet.nodes), bool)
    keep[:sheet.original] = True
    points = np.concatenate([sheet.nodes[:, :3], sheet.nodes[:, 3:5] * scale[sheet.face]], axis=1)
    for k in range(len(at) - 1):
        loop, beyond = nodes[at[k]:at[k + 1]], other[at[k]:at[k + 1]]
        ends = np.flatnonzero(beyond != np.roll(beyond, 1))
        keep[loop[ends]] = True
        mine = owner[at[k]]
        if len(ends) == 0:
            if beyond[0] > mine:
                _thin_ring(loop, points, tolerance, keep)
            continue
        loop = np.append(np.roll(loop, -ends[0]), loop[ends[0]])
        stops = np.append(ends - ends[0], len(loop) - 1)
        for s, e in zip(stops[:-1], stops[1:], strict=True):
            if beyond[(s + ends[0]) % len(beyond)] > mine:
                _thin_chain(loop[s:e + 1], points, tolerance, keep)
    return keep


def _thin_chain(chain: I64, points: F64, tolerance: float, keep: BOOL) -> None:
    mask = np.zeros(len(chain), bool)
    thin(points[chain], tolerance, mask)
    keep[chain[mask]] = True


def _thin_ring(ring: I64, points: F64, tolerance: float, keep: BOOL) -> None:
    """A closed border, split at its first node, the node farthest from it, and the node farthest from both."""
    far = int(np.linalg.norm(points[ring, :3] - points[ring[0], :3], axis=1).argmax())
    chord = points[ring[far], :3] - points[ring[0], :3]
    aside = np.linalg.norm(np.cross(points[ring, :3] - points[ring[0], :3], chord), axis=1)
    cuts = np.unique([0, far, int(aside.argmax()), len(ring)])
    closed = np.append(ring, ring[0])
    for s, e in zip(cuts[:-1], cuts[1:], strict=True):
        _thin_chain(closed[s:e + 1], points, tolerance, keep)


def _restore(sheet: FacetSheet, nodes: I64, at: I64, owner: I64, face_of: I64, keep: BOOL) -> None:
    """Keep all nodes on the borders of a face where thinning made the loops of a piece cross or collapse."""
    rings: dict[int, list[F64]] = {}
    bad = set()
    for k in range(len(at) - 1):
        loop = nodes[at[k]:at[k + 1]]
        ring = sheet.nodes[loop[keep[loop]], 3:5]
        if len(ring) < 3:
            bad.add(int(face_of[owner[at[k]]]))
        else:
            rings.setdefault(int(owner[at[k]]), []).append(ring)
    pieces = []
    for some in rings.values():
        some.sort(key=lambda ring: -abs(_shoelace(ring)))
        pieces.append(shapely.Polygon(some[0], some[1:]))
    valid = shapely.is_valid(np.array(pieces, dtype=object))
    bad |= {int(face_of[g]) for g, fine in zip(rings, valid, strict=True) if not fine}
    for k in range(len(at) - 1):
        if int(face_of[owner[at[k]]]) in bad:
            keep[nodes[at[k]:at[k + 1]]] = True
