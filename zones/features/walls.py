"""Walls: thin steep faces joined across edges and through their material.

1. A face is *thin* where an inward ray leaves the material again, through an opposing face, within half the
   height of the wall. Floors, hubs and thick bodies are not thin.
2. Thin faces join across convex and smooth edges (strips, ends, corners), never across concave ones or fillets.
3. Thin faces whose inward rays end on each other are two sides of one wall, also where no edge links them
   (a top cut away, a wall across the whole part).
4. Tops, ends and roundings are added last: they go to the wall they share most border with. They must not be used
   to join: the flat top over a T of two walls is one face and would make one wall of both.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64
from geometry.part import EdgeKind
from zones.features.face_graph import FaceGraph, Link, UnionFind, connected_runs

THIN_SHARE = 0.5
OPPOSED_DOT = -0.5
# Sides join through their material when this share of one of them faces the other ...
BACKED_SHARE = 0.15
# ... with rays no longer than this multiple of its median thickness; longer ones run along another wall.
BACKED_REACH = 2.5
# Freestanding pillars and hubs: round in plan, and shorter than this multiple of their thickness.
PILLAR_LENGTH = 1.5
PILLAR_ROUNDNESS = 0.25

NO_WALL = -1
SEAT = -2


@dataclass(frozen=True, eq=False)
class Sheets:
    """Thin bodies of a part (walls, and webs that may prove to be connections).

    thin  : (n,) bool, faces that are sides of thin material
    body  : (n,) int64, index of the thin body of a face, ``NO_WALL`` or ``SEAT`` where there is none;
            after ``grow`` tops and ends have the label of their body too
    """

    thin: np.ndarray
    body: np.ndarray

    @property
    def labels(self) -> list[int]:
        """Labels of the bodies, ascending."""
        return [int(k) for k in np.unique(self.body[self.thin]) if k >= 0]

    def sides(self, label: int) -> np.ndarray:
        """(k,) int64, index of the thin faces of a body, 0-based."""
        return np.flatnonzero(self.thin & (self.body == label))


def find_sheets(graph: FaceGraph) -> Sheets:
    """Thin bodies of a part, tops and ends included.

    graph : FaceGraph
    Returns Sheets.
    """
    thin = thin_faces(graph)
    body = _join_through_material(graph, thin, _join_across_edges(graph, thin))
    body = _continue_across_junctions(graph, thin, body)
    for label in np.unique(body[thin]):
        faces = thin & (body == label)
        if _is_pillar(graph, np.flatnonzero(faces)) or not _has_two_sides(graph, faces):
            thin = thin & (body != label)
    body = np.where(thin, body, NO_WALL)
    return Sheets(thin, grow(graph, thin, body))


def thin_faces(graph: FaceGraph) -> np.ndarray:
    """(n,) bool: faces that are, over most of their area, a side of material thinner than half its height."""
    candidate = graph.side_like & ~graph.fillet & ~graph.sliver & ~graph.seat
    height = _side_heights(graph)
    bore = _bores(graph)
    backed = (graph.back >= 0) & (graph.back_dot < OPPOSED_DOT) & ~bore[graph.back]
    backed &= graph.inward <= 0.5 * height[graph.face]
    return np.asarray(candidate & ~bore & (graph.strip_share(backed) >= THIN_SHARE))


def _has_two_sides(graph: FaceGraph, faces: np.ndarray) -> bool:
    """Whether inward rays from faces ((n,) bool) end on another side, not on a floor (as from a bore)."""
    rows = graph.face_rows(faces)
    back = graph.back[rows]
    two = (back >= 0) & graph.side_like[back] & ~graph.seat[back]
    return float(graph.samples.area[rows][two].sum()) >= 0.5 * float(graph.samples.area[rows].sum())


def _side_heights(graph: FaceGraph) -> F64:
    """(n,) float64, mm: height of the smoothly joined steep region that each face belongs to."""
    sets = UnionFind(graph.n)
    for link in graph.links:
        if link.kind == EdgeKind.SMOOTH and all(graph.steep[f] and not graph.fillet[f] for f in (link.a, link.b)):
            sets.union(link.a, link.b)
    label = sets.labels()
    low, high = np.full(graph.n, np.inf), np.full(graph.n, -np.inf)
    np.minimum.at(low, label, graph.z_range[:, 0])
    np.maximum.at(high, label, graph.z_range[:, 1])
    return np.asarray((high - low)[label])


def _bores(graph: FaceGraph) -> np.ndarray:
    """Hollow round faces that open into the seat while the outside of the same material stands on a floor.

    They are the bore of a hub. Without this rule a bored hub counts as a ring-shaped wall.
    """
    reaches_seat = np.zeros(graph.n, bool)
    for link in graph.links:
        if link.joins and (graph.seat[link.a] or graph.seat[link.b]):
            reaches_seat[[link.a, link.b]] = True
    reaches_seat = np.isin(graph.strip, graph.strip[reaches_seat])
    hollow = np.array([f.surface in ("cylinder", "cone") and f.curvature_min < -1e-9 for f in graph.part.faces])
    outside_reaches = graph.strip_share((graph.back >= 0) & reaches_seat[graph.back])
    return np.asarray(hollow & reaches_seat & (outside_reaches < 0.5))


def _join_across_edges(graph: FaceGraph, thin: np.ndarray) -> np.ndarray:
    sets = UnionFind(graph.n)
    for link in graph.links:
        if link.joins and thin[link.a] and thin[link.b]:
            sets.union(link.a, link.b)
    return sets.labels()


def _spans(graph: FaceGraph, thin: np.ndarray) -> np.ndarray:
    """(n,) int: label of the span that each face belongs to, ``NO_WALL`` for all other faces.

    A span is material that touches only sides of thin bodies, in two places or more. Its faces join across convex and
    smooth edges, and its concave edges and fillets lead to thin faces only. Behind a span lies the far side of the wall
    it ends at, however steep or short the span is.
    """
    sets = UnionFind(graph.n)
    for link in graph.links:
        if link.joins and not (graph.fillet[link.a] or graph.fillet[link.b]):
            sets.union(link.a, link.b)
    lump = sets.labels()
    contacts: dict[int, list[tuple[bool, np.ndarray]]] = {}
    for link in graph.links:
        for f, g in ((link.a, link.b), (link.b, link.a)):
            if graph.fillet[f] or lump[f] == lump[g]:
                continue
            beyond = [k.other(g) for k in graph.at[g]] if graph.fillet[g] else [g]
            beyond = [h for h in beyond if not graph.fillet[h] and lump[h] != lump[f]]
            contacts.setdefault(int(lump[f]), []).append((bool(thin[beyond].all()), link.nodes))
    spans = [k for k, at in contacts.items() if all(thin_there for thin_there, _ in at)
             and len(connected_runs([nodes for _, nodes in at])) >= 2]
    return np.where(np.isin(lump, spans) & ~graph.fillet, lump, NO_WALL)


def _join_through_material(graph: FaceGraph, thin: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Join bodies whose inward rays end on each other; only parts of a span join a span."""
    rows = np.flatnonzero(thin[graph.face])
    rows = rows[(graph.back[rows] >= 0) & (graph.back_dot[rows] < OPPOSED_DOT)]
    rows = rows[graph.side_like[graph.back[rows]]]
    span = _spans(graph, thin)
    sets = UnionFind(graph.n)
    for label in np.unique(body[graph.face[rows]]):
        faces = thin & (body == label)
        of = rows[faces[graph.face[rows]]]
        near = of[graph.inward[of] <= BACKED_REACH * np.median(graph.inward[of])]
        near = near[thin[graph.back[near]] & (span[graph.back[near]] == span[faces].max())]
        seen = np.bincount(body[graph.back[near]], weights=graph.samples.area[near], minlength=graph.n)
        total = graph.samples.area[graph.face_rows(faces)].sum()
        for facing in np.flatnonzero(seen >= BACKED_SHARE * total):
            sets.union(int(label), int(facing))
    return sets.labels()[body]


def _continue_across_junctions(graph: FaceGraph, thin: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Join the two halves of a wall that a crossing wall cuts over its full height.

    Two sides with concave edges are one interrupted surface when they lie in each other's tangent plane, a short way
    apart. The wall between must be cut itself (another body on the front than on the back). A wall that is whole
    separates the ribs that meet it from both sides.
    """
    ends = [(f, k) for k in graph.links if k.kind == EdgeKind.CONCAVE and thin[k.a] and thin[k.b]
            and body[k.a] != body[k.b] for f in (k.a, k.b)]
    between: dict[tuple[int, int], set[int]] = {}
    for i, j in _interrupted(graph, ends, body):
        (f, first), (g, second) = ends[i], ends[j]
        pair = (int(min(body[f], body[g])), int(max(body[f], body[g])))
        others = {int(body[first.other(f)]), int(body[second.other(g)])}
        between[pair] = between.get(pair, set()) | (others - set(pair))
    sets = UnionFind(graph.n)
    for (a, b), others in between.items():
        if len(others) >= 2:
            sets.union(a, b)
    return sets.labels()[body]


def _interrupted(graph: FaceGraph, ends: Sequence[tuple[int, Link]], body: np.ndarray) -> list[tuple[int, int]]:
    """Pairs i < j of ends of sides, of two bodies, that are one interrupted surface.

    ends : (face, edge) each
    """
    if not ends:
        return []
    corners = [graph.mesh.vertices[k.nodes] for _, k in ends]
    middle = np.array([p.mean(axis=0) for p in corners])
    normal = np.array([graph.normals_at(f, k.nodes).mean(axis=0) for f, k in ends])
    low, high = (np.array([m(p[:, 2]) for p in corners]) for m in (np.min, np.max))
    face = np.array([f for f, _ in ends])
    back = graph.centroid[face] - middle  # from the edge into its face
    out = []
    for i in range(len(ends) - 1):
        step = middle[i + 1:] - middle[i]
        far = np.linalg.norm(step, axis=1)
        overlap = np.minimum(high[i], high[i + 1:]) - np.maximum(low[i], low[i + 1:])
        n1, n2 = normal[i], normal[i + 1:]
        off_plane = np.maximum(np.abs(step @ n1), np.abs((n2 * step).sum(axis=1)))
        away = (step @ back[i] < 0.0) & ((back[i + 1:] * step).sum(axis=1) > 0.0)
        near = (far > 0.0) & (far < overlap) & (n2 @ n1 > 0.9) & (off_plane < 0.2 * far) & away
        out += [(i, i + 1 + int(k)) for k in np.flatnonzero(near & (body[face[i + 1:]] != body[face[i]]))]
    return out


def _is_pillar(graph: FaceGraph, faces: np.ndarray) -> bool:
    """Whether faces are round in plan and hardly longer than thick: a post or a hub."""
    rows = graph.face_rows(np.isin(np.arange(graph.n), faces))
    area = graph.samples.area[rows]
    thickness = float(np.median(graph.inward[rows]))
    height = float(graph.z_range[faces, 1].max() - graph.z_range[faces, 0].min())
    length = 0.5 * float(area.sum()) / max(height, 1e-9) - thickness
    plan = graph.samples.normals[rows, :2] * np.sqrt(area)[:, None]
    low, high = np.linalg.eigvalsh(plan.T @ plan)
    return bool(length < PILLAR_LENGTH * thickness and low > PILLAR_ROUNDNESS * high)


def grow(graph: FaceGraph, thin: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Give tops, ends and roundings to the body they share most border with.

    thin, body : (n,) bool and (n,) int64, index, as in Sheets, before growing
    Returns (n,) int64, index: a body, ``SEAT`` for faces that belong to the underside, ``NO_WALL`` otherwise.

    A face with a concave edge to a side of a body is not a top of that body. It is a floor, or a bar that ends there.
    """
    label = np.where(thin, body, NO_WALL)
    label[graph.seat] = SEAT
    touching = _concave_neighbours(graph, thin, body)
    for face in _flush_ends(graph, thin, label, touching):
        label[face] = SEAT
    waiting = (label == NO_WALL) & ~graph.fillet & ~graph.sliver
    queue: list[tuple[float, int, int]] = []

    def offer(face: int) -> None:
        share, wanted = _best_label(graph, face, label, touching)
        if share > 0:
            heapq.heappush(queue, (-share, face, wanted))

    for face in np.flatnonzero(waiting).tolist():
        offer(face)
    while queue:
        share, face, wanted = heapq.heappop(queue)
        if not waiting[face] or _best_label(graph, face, label, touching) != (-share, wanted):
            continue
        label[face], waiting[face] = wanted, False
        for link in graph.at[face]:
            if waiting[link.other(face)]:
                offer(link.other(face))
    return label


def _best_label(graph: FaceGraph, face: int, label: np.ndarray, touching: list[set[int]]) -> tuple[float, int]:
    """Largest share of the border of a face with one label, and that label; (0, NO_WALL) when there is none."""
    shared: dict[int, float] = {}
    around = 0.0
    for link in graph.at[face]:
        around += link.length
        other = int(label[link.other(face)])
        if link.joins and other != NO_WALL and other not in touching[face]:
            shared[other] = shared.get(other, 0.0) + link.length
    if not shared or around <= 0:
        return 0.0, NO_WALL
    wanted = max(shared, key=lambda k: (shared[k], -k))
    return shared[wanted] / around, wanted


def _concave_neighbours(graph: FaceGraph, thin: np.ndarray, body: np.ndarray) -> list[set[int]]:
    """Bodies that each face meets at a concave edge or through a fillet."""
    out: list[set[int]] = [set() for _ in range(graph.n)]
    for link in graph.links:
        if link.kind == EdgeKind.CONCAVE and not (graph.fillet[link.a] or graph.fillet[link.b]):
            for f, g in ((link.a, link.b), (link.b, link.a)):
                if thin[g] and not (thin[f] and body[f] == body[g]):
                    out[f].add(int(body[g]))
    for fillet in np.flatnonzero(graph.fillet):
        around = {k.other(int(fillet)) for k in graph.at[fillet]}
        bodies = {int(body[g]) for g in around if thin[g]}
        for f in around:
            if not thin[f] and not graph.fillet[f]:
                out[f] |= bodies
    return out


def _flush_ends(graph: FaceGraph, thin: np.ndarray, label: np.ndarray, touching: list[set[int]]) -> list[int]:
    """Outer faces of a base that walls end flush with: they border the seat, a wall, and the floor at its foot."""
    out = []
    for face in np.flatnonzero(~thin & graph.steep & ~graph.seat & ~graph.fillet):
        joined = [k.other(int(face)) for k in graph.at[face] if k.joins]
        bodies = {int(label[g]) for g in joined if label[g] >= 0}
        if any(graph.normal[g, 2] > 0.5 and touching[g] & bodies for g in joined):
            out.append(int(face))
    return out
