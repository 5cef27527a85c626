"""Caps over the footprints of connections on hubs and floors.

Rays pass through connections, but not through the hub or floor that a connection stands on. The faces of the hub end at
the border of the footprint, and the mesh without the connection is open there. A fan from the mean of its border closes
every footprint. It is flat on a plane, and on a bent hub at most the sagitta of the footprint below the surface.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from zones.features.face_graph import FaceGraph, Link, UnionFind


def cap_footprints(graph: FaceGraph, left_out: np.ndarray, side: np.ndarray) -> F64:
    """Triangles that close the footprints of connections.

    graph    : FaceGraph
    left_out : (n,) bool, faces of connections, fillets and slivers
    side     : (n,) bool, faces that are sides of walls
    Returns (k, 3, 3) float64, mm, frame of the part.
    """
    at_side = np.zeros(graph.n, bool)
    for link in graph.links:
        at_side[link.a] |= side[link.b]
        at_side[link.b] |= side[link.a]
    bar = left_out & ~graph.fillet & ~graph.sliver
    foot = bar.copy()
    for link in graph.links:
        for f, g in ((link.a, link.b), (link.b, link.a)):
            foot[g] |= bool(bar[f] and graph.fillet[g] and not at_side[g])
    borders: dict[int, list[Link]] = {}
    for link in graph.links:
        for f, g in ((link.a, link.b), (link.b, link.a)):
            if foot[f] and not left_out[g] and not side[g]:
                borders.setdefault(g, []).append(link)
    fans = [_fan(graph, chain) for g in sorted(borders) for chain in _chains(borders[g])]
    return np.concatenate(fans) if fans else np.zeros((0, 3, 3))


def _chains(links: list[Link]) -> list[list[Link]]:
    """Links that share an end."""
    sets = UnionFind(len(links))
    owner: dict[int, int] = {}
    for i, link in enumerate(links):
        for node in (int(link.nodes[0]), int(link.nodes[-1])):
            sets.union(owner.setdefault(node, i), i)
    label = sets.labels()
    return [[links[i] for i in np.flatnonzero(label == k)] for k in np.unique(label)]


def _fan(graph: FaceGraph, chain: list[Link]) -> F64:
    """Triangles from the mean of a chain to each of its edges; an open chain is closed between its two ends."""
    pairs = [np.column_stack([k.nodes[:-1], k.nodes[1:]]) for k in chain if len(k.nodes) > 1]
    if not pairs:
        return np.zeros((0, 3, 3))
    ends, counts = np.unique([k.nodes[i] for k in chain for i in (0, -1)], return_counts=True)
    loose = ends[counts % 2 == 1]
    if len(loose) == 2:
        pairs.append(loose[None])
    v = graph.mesh.vertices[np.concatenate(pairs)]
    middle = np.broadcast_to(v.reshape(-1, 3).mean(axis=0), (len(v), 1, 3))
    fan = np.concatenate([middle, v], axis=1)
    area = np.linalg.norm(np.cross(fan[:, 1] - fan[:, 0], fan[:, 2] - fan[:, 0]), axis=1)
    return np.asarray(fan[area > 1e-12])
