"""Connections: material that bridges a channel and leaves void below some part of its span.

A *body* is a thin sheet (see ``zones.features.walls``) or a component of the remaining faces across convex and smooth
edges. A body *ends* at a wall where their common concave edges (or fillets) run around it: its normals along that
border point to different sides. A wall that another body ends at shows one normal there. So a long wall with a window
or a gate does not count as a bridge between the ribs that meet it.
A body with two ends and void below is a connection [Arivazhagan2020]; with floor below its whole span it is a wall.

Arrays of faces are (n,), in the order of the faces; normals and places lie in the frame of the part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64
from geometry.part import EdgeKind
from zones.features.face_graph import STEEP_NZ, FaceGraph, UnionFind, cast, connected_runs
from zones.features.walls import NO_WALL, SEAT, Sheets

# Where a body ends at a wall, its normals along the common border differ by more than 60 degrees.
END_DOT = 0.5
# A bar over the corner of a wall shows two normals of the wall, but normals all around its own. The body with the wider
# spread of normals (the lesser cosine, up to this) ends at the other.
CORNER_SLACK = 0.25
# Void: the next material below lies deeper than this share of the part's height.
VOID_SHARE = 0.01
# The underside of a body faces down by more than this. Leaning ribs do so too, but have floor contact.
DOWN_NZ = -0.1
# A span is covered by its floor contact up to gaps of this share.
SPAN_SLACK = 0.05


@dataclass(frozen=True, eq=False)
class ConcaveBorder:
    """A concave border between two bodies, of one edge or one fillet.

    a, b     : bodies
    na, nb   : (k, 3) float64, outward normals of each body along it
    nodes    : mesh vertices on it
    """

    a: int
    b: int
    na: F64
    nb: F64
    nodes: np.ndarray


@dataclass(frozen=True, eq=False)
class End:
    """One place where a body ends at another.

    at     : the other body
    nodes  : mesh vertices along the border
    """

    at: int
    nodes: np.ndarray


@dataclass(frozen=True, eq=False)
class Bridges:
    """Bodies of a part, and the connections among them.

    body        : (n,) int, label of every face; thin bodies keep their label, fillets and slivers have ``NO_WALL``
    connections : per connection the labels of its bodies
    ends        : per connection its ends at walls
    base        : labels of bodies that walls stand on
    borders     : between the bodies
    """

    body: np.ndarray
    connections: list[list[int]]
    ends: list[list[End]]
    base: set[int]
    borders: list[ConcaveBorder]


def find_bridges(graph: FaceGraph, sheets: Sheets) -> Bridges:
    """Find the connections among the bodies of a part.

    graph, sheets : FaceGraph and Sheets of the part
    Returns Bridges.
    """
    body = all_bodies(graph, sheets.body)
    borders = find_borders(graph, body)
    thin = set(sheets.labels)
    base = {SEAT} | _supports(graph, sheets, body)
    floating = {x for x in np.unique(body).tolist() if x != NO_WALL and x not in base}
    void = {x: _void_points(graph, body, x) for x in floating}
    floors = {x for x in floating - thin if len(void[x]) == 0 and _looks_up(graph, body == x)}
    floors |= {x for x in floating - thin if _carries(borders, x, thin) and not _ends(graph, [x], borders, thin)}
    base, floating = base | floors, floating - floors
    bridging = set()
    for x in sorted(floating):
        ends = _ends(graph, [x], borders, thin - {x})
        if len(ends) >= 2 and _open_below(graph, {x}, ends, borders, void[x], floating - thin):
            bridging.add(x)
    loose = {x for x in floating - thin if len(void[x])} | _hanging(graph, sheets, body, borders, base, floating & thin)
    groups = _groups(bridging | loose, borders)
    out, out_ends = [], []
    walls = thin - bridging
    for group in groups:
        ends = _ends(graph, group, borders, walls)
        below = np.concatenate([void[x] for x in group])
        proved = not bridging.isdisjoint(group)
        if len(ends) >= 2 and (proved or _open_below(graph, set(group), ends, borders, below, floating - thin)):
            out.append(group)
            out_ends.append(ends)
    return Bridges(body, out, out_ends, base, borders)


def all_bodies(graph: FaceGraph, label: np.ndarray) -> np.ndarray:
    """Bodies of the faces that belong to no sheet, added to the labels of the sheets.

    label : (n,) int64, index, from Sheets.body
    Returns (n,) int64, index of the body of every face; numbers of new bodies begin at n.
    """
    loose = (label == NO_WALL) & ~graph.fillet & ~graph.sliver
    sets = UnionFind(graph.n)
    for link in graph.links:
        if link.joins and loose[link.a] and loose[link.b]:
            sets.union(link.a, link.b)
    return np.asarray(np.where(loose, sets.labels() + graph.n, label))


def find_borders(graph: FaceGraph, body: np.ndarray) -> list[ConcaveBorder]:
    """Concave borders between different bodies, by edges and by fillets.

    body : (n,) int64, index of the body of every face
    """
    out = []
    for link in graph.links:
        a, b = int(body[link.a]), int(body[link.b])
        if link.kind == EdgeKind.CONCAVE and a != b and NO_WALL not in (a, b):
            nodes = link.nodes
            out.append(ConcaveBorder(a, b, graph.normals_at(link.a, nodes), graph.normals_at(link.b, nodes), nodes))
    for fillet in np.flatnonzero(graph.fillet):
        links = [k for k in graph.at[fillet] if body[k.other(int(fillet))] != NO_WALL]
        for i, first in enumerate(links):
            f = first.other(int(fillet))
            for second in links[i + 1:]:
                g = second.other(int(fillet))
                if body[f] != body[g]:
                    nodes = np.concatenate([first.nodes, second.nodes])
                    out.append(ConcaveBorder(int(body[f]), int(body[g]), graph.normals_at(f, first.nodes),
                                      graph.normals_at(g, second.nodes), nodes))
    return out


def _ends(graph: FaceGraph, group: list[int], borders: list[ConcaveBorder], walls: set[int]) -> list[End]:
    """Places where a group of bodies ends at walls, each a connected run of borders."""
    mine = set(group)
    out = []
    touching: dict[int, list[tuple[F64, F64, np.ndarray]]] = {}
    for border in borders:
        sides = (border.a, border.na), (border.b, border.nb)
        for (x, own), (w, other) in (sides, sides[::-1]):
            if x in mine and w in walls and w not in mine:
                touching.setdefault(w, []).append((own, other, border.nodes))
    for wall in sorted(touching):
        runs = touching[wall]
        for cluster in connected_runs([nodes for _, _, nodes in runs]):
            spread, foreign = (_least_dot(np.concatenate([runs[i][k] for i in cluster])) for k in (0, 1))
            if spread < min(END_DOT, foreign + CORNER_SLACK):
                out.append(End(wall, np.concatenate([runs[i][2] for i in cluster])))
    return out


def _least_dot(normals: F64) -> float:
    """Least cosine between any two unit normals, (k, 3) float64; 1 where none is finite."""
    normals = normals[np.isfinite(normals).all(axis=1)]
    return float((normals @ normals.T).min()) if len(normals) else 1.0


def _supports(graph: FaceGraph, sheets: Sheets, body: np.ndarray) -> set[int]:
    """Bodies that walls stand on: a ray straight down through a wall leaves by their underside."""
    out = set()
    rows = np.flatnonzero(sheets.thin[graph.face] & np.isfinite(graph.inward))
    s = graph.samples
    middle = s.points[rows] - 0.5 * graph.inward[rows, None] * s.normals[rows]
    down = np.broadcast_to([0.0, 0.0, -1.0], middle.shape)
    _, hit = cast(graph.tree, middle, down, graph.skin)
    below = np.where(hit >= 0, body[graph.face_of[hit]], NO_WALL)
    mine = body[graph.face[rows]]
    for wall in sheets.labels:
        foreign = below[(mine == wall) & (below != wall) & (below != NO_WALL)]
        labels, counts = np.unique(foreign, return_counts=True)
        if counts.sum() >= 0.1 * (mine == wall).sum():
            out |= {int(x) for x, c in zip(labels, counts, strict=True) if c >= 0.5 * counts.sum()}
    return out - set(sheets.labels)


def _carries(borders: list[ConcaveBorder], x: int, thin: set[int]) -> bool:
    """Whether a thin body stands on a body: their border shows the upper side of that body."""
    sides = [own for b in borders for own, mine, other in ((b.na, b.a, b.b), (b.nb, b.b, b.a))
             if mine == x and other in thin]
    return any(_rises(own) for own in sides)


def _rises(normals: F64) -> bool:
    """Whether a border shows an upper side: the mean of its (k, 3) normals, some of them NaN, points up."""
    up = normals[np.isfinite(normals[:, 2]), 2]
    return bool(len(up)) and float(up.mean()) > STEEP_NZ


def _void_rows(graph: FaceGraph, body: np.ndarray, x: int) -> np.ndarray:
    """Samples of the downward faces of a body with void below them, (k,) int."""
    s = graph.samples
    low = graph.part.bounds[0, 2] + VOID_SHARE * graph.height
    rows = np.flatnonzero((body[graph.face] == x) & (s.normals[:, 2] < DOWN_NZ) & (s.points[:, 2] > low))
    down = np.broadcast_to([0.0, 0.0, -1.0], (len(rows), 3))
    distance, hit = cast(graph.tree, s.points[rows], down, graph.skin)
    own = (hit >= 0) & (body[graph.face_of[hit]] == x)
    return np.asarray(rows[(distance > VOID_SHARE * graph.height) & ~own])


def _void_points(graph: FaceGraph, body: np.ndarray, x: int) -> F64:
    """The places of ``_void_rows``, (k, 3) float64, mm."""
    return np.asarray(graph.samples.points[_void_rows(graph, body, x)])


def _looks_up(graph: FaceGraph, faces: np.ndarray) -> bool:
    """Whether the area-weighted mean normal of faces ((n,) bool) is within 60 degrees of +Z."""
    mean = (graph.normal[faces] * graph.area[faces, None]).sum(axis=0)
    return bool(mean[2] > STEEP_NZ * np.linalg.norm(mean))


def _open_below(graph: FaceGraph, group: set[int], ends: list[End], borders: list[ConcaveBorder], void: F64,
                unsupported: set[int]) -> bool:
    """Whether a group of bodies leaves void below some part of its span, where no floor or rib carries it.

    unsupported : bodies that carry nothing, such as bars; bodies that only stand on top carry nothing either
    """
    if len(void) == 0:
        return False
    v = graph.mesh.vertices
    a, b = (v[e.nodes].mean(axis=0)[:2] for e in ends[:2])
    span = float(np.linalg.norm(b - a))
    if span < 1e-9:
        return True
    along = (b - a) / span
    frame = np.column_stack([along, [-along[1], along[0]]])
    tops: list[F64] = []
    unders: list[F64] = []
    for border in borders:
        if (border.a in group) != (border.b in group):
            other, own = (border.b, border.na) if border.a in group else (border.a, border.nb)
            if other not in unsupported and all(other != e.at for e in ends):
                (tops if _rises(own) else unders).append(v[border.nodes][:, :2] @ frame)
    where = void[:, :2] @ frame
    covered = [(float(q[:, 0].min()), float(q[:, 0].max())) for q in unders if not _beside(q, tops, where)]
    u = where[:, 0]
    slack = SPAN_SLACK * span
    under = np.zeros(len(u), bool)
    for low, high in covered:
        under |= (u >= low - slack) & (u <= high + slack)
    return bool((~under).sum() >= max(1, 0.02 * len(u)))


def _beside(under: F64, tops: list[F64], void: F64) -> bool:
    """Whether a body that meets an underside passes at its side, as a hub does, and carries nothing.

    It meets the top over the same stretch too, and all void below lies on one side of it. A rib under the middle has
    void on both sides.

    under, tops : (k, 2) float64, mm, borders at the underside and at the top, along and across the span
    void        : (n, 2) float64, mm, places with void below
    """
    low, high = float(under[:, 0].min()), float(under[:, 0].max())
    shared = sum(max(min(high, float(q[:, 0].max())) - max(low, float(q[:, 0].min())), 0.0) for q in tops)
    here = void[(void[:, 0] >= low) & (void[:, 0] <= high)]
    if shared < 0.5 * (high - low) or len(here) == 0:
        return False
    order = np.argsort(under[:, 0], kind="stable")
    left = here[:, 1] > np.interp(here[:, 0], under[order, 0], under[order, 1])
    return bool(left.all() or not left.any())


def _hanging(graph: FaceGraph, sheets: Sheets, body: np.ndarray, borders: list[ConcaveBorder], base: set[int],
             among: set[int]) -> set[int]:
    """Sheets that stand on no base along any edge or fillet and have void below.

    A base that a sheet meets sideways, as the end of a bar meets a hub, does not carry it. The arms of a slender fork
    are three such sheets, none of which bridges alone. Their common underside has the label of one of them. So a sheet
    that continues around an edge into an underside of another counts as well.
    """
    standing = {int(body[f]) for k in graph.links for f, g in ((k.a, k.b), (k.b, k.a))
                if k.kind != EdgeKind.CONCAVE and int(body[g]) in base}
    for border in borders:
        for x, y, normals in ((border.a, border.b, border.nb), (border.b, border.a, border.na)):
            if y in base and _rises(normals):
                standing.add(x)
    free = among - standing
    under = np.zeros(graph.n, bool)
    for x in free:
        under[graph.face[_void_rows(graph, body, x)]] = True
    out = {int(x) for x in np.unique(body[under])}
    for k in graph.links:
        for f, g in ((k.a, k.b), (k.b, k.a)):
            if k.joins and under[g] and sheets.thin[f]:
                out.add(int(body[f]))
    return out & free


def _groups(piece: set[int], borders: list[ConcaveBorder]) -> list[list[int]]:
    """Groups of bodies that may be one connection: pieces that meet each other (forks)."""
    order = sorted(piece)
    place = {x: i for i, x in enumerate(order)}
    sets = UnionFind(len(order))
    for border in borders:
        if border.a in piece and border.b in piece:
            sets.union(place[border.a], place[border.b])
    label = sets.labels()
    return [[order[i] for i in np.flatnonzero(label == k)] for k in np.unique(label)]


__all__ = ["ConcaveBorder", "Bridges", "End", "all_bodies", "find_borders", "find_bridges"]
