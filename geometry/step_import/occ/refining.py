"""Finer triangles inside one face, where those of the kernel leave the exact surface; its border does not change.

The kernel checks its triangles against the surface and inserts nodes for a fixed number of rounds. Its triangles are
Delaunay in the plane of the parameters, stretched to a square. On long ruled faces this turns triangles along the
rulings into wide fans across the bend, and some remain after the rounds. Here a flip must reduce the distance to the
surface, and splitting goes on until every triangle keeps the chord.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRepAdaptor import BRepAdaptor_Surface

from geometry.mesh import F64
from geometry.step_import.occ.deviation import distance_near, node_gaps

I64 = NDArray[np.int64]

ROUNDS = 40
FLIP_ROUNDS = 12
# A flip must bring the distance of the shared side below this share of its old value, so that flips end.
FLIP_GAIN = 0.8
# Least double area in (u, v) of a flipped triangle, as a share of that of both triangles.
FLIP_ROOM = 1e-3
# A triangle with an angle above this (rad) is a cap.
CAP = np.radians(165.0)
# Least length of a split side, in chords and in gaps between its ends and the surface. A shorter side deviates because
# its ends do, not because of its length.
SHORTEST, SHORTEST_GAPS = 2.0, 8.0


@dataclass
class Net:
    """Triangles of one face while they are refined.

    nodes     : (n, 3) float64, mm
    uv        : (n, 2) float64, surface parameters of the nodes
    triangles : (m, 3) int64, indices into ``nodes``
    kept      : (k, 2) int64, pairs of nodes whose sides stay; sides of a single triangle stay anyway
    """

    nodes: F64
    uv: F64
    triangles: I64
    kept: I64


@dataclass(frozen=True)
class _Sides:
    """Undirected sides of all triangles.

    ends   : (k, 2) indices of nodes, the smaller first
    of     : (m, 3) side number of the corners 0-1, 1-2, 2-0 of each triangle
    uses   : (k, 2) rows 3 * triangle + place of the two triangles; -1 where there is only one, or the side is kept
    """

    ends: I64
    of: I64
    uses: I64

    @property
    def inner(self) -> np.ndarray:
        """Numbers of the sides between two triangles."""
        return np.flatnonzero(self.uses[:, 1] >= 0)


class _Distances:
    """Distance of the middle of sides and triangles to the surface, each computed once."""

    def __init__(self, surface: BRepAdaptor_Surface, chord: float) -> None:
        self.surface, self.chord = surface, chord
        self.known: dict[tuple[int, ...], float] = {}

    def __call__(self, net: Net, corners: I64) -> F64:
        """Upper bound for each row of ``corners`` (k, 2 or 3); below the chord it is not refined."""
        keys = [tuple(row) for row in np.sort(corners, axis=1).tolist()]
        fresh = [i for i, key in enumerate(keys) if key not in self.known]
        points, uv = net.nodes[corners[fresh]].mean(axis=1).tolist(), net.uv[corners[fresh]].mean(axis=1)
        for i, point, place in zip(fresh, points, uv, strict=True):
            self.known[keys[i]] = distance_near(self.surface, point, place, enough=self.chord)
        return np.array([self.known[key] for key in keys])


def refine_net(surface: BRepAdaptor_Surface, net: Net, chord: float, max_triangles: int) -> Net:
    """Flip and split inner sides until the middle of every inner side and triangle keeps the chord.

    surface : kernel surface of the face, in the frame of the nodes
    net     : Net of the face; its parameters do not jump inside a triangle
    chord   : float, mm
    max_triangles : int, number of triangles above which no further round begins

    Returns Net: the nodes of ``net`` in their order, new ones on the surface behind them; the border is that of
    ``net``, side by side.
    Notes   A split puts the new node at the mean (u, v) of the ends of a side and splits both triangles of the side, so
            no gap can open. The rounds end early at ``max_triangles``, or where the only sides that deviate are short
            against the chord or against the gaps of border nodes. Measure the deviation afterwards.
    """
    distances = _Distances(surface, chord)
    gaps = node_gaps(surface, net.nodes, net.uv)
    for _ in range(ROUNDS):
        net = _flipped(net, distances)
        sides = _sides(net)
        gaps = np.concatenate([gaps, np.zeros(len(net.nodes) - len(gaps))])
        marked = _marked(net, sides, gaps, distances)
        if not marked.any() or len(net.triangles) > max_triangles:
            break
        net = _split(surface, net, sides, marked)
    return net


def _sides(net: Net) -> _Sides:
    triangles = net.triangles
    pairs = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    size = int(triangles.max()) + 1
    keys, of, counts = np.unique(pairs[:, 0] * size + pairs[:, 1], return_inverse=True, return_counts=True)
    order = np.argsort(of, kind="stable")
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    uses = np.full((len(keys), 2), -1, np.int64)
    uses[:, 0] = order[first]
    # a side of three triangles has no two neighbours to split or flip; it stays like a border
    uses[counts == 2, 1] = order[first[counts == 2] + 1]
    ends = np.stack([keys // size, keys % size], axis=1)
    uses[present(net.kept, ends), 1] = -1
    return _Sides(ends, of.reshape(-1, 3), uses)


def _marked(net: Net, sides: _Sides, gaps: F64, distances: _Distances) -> np.ndarray:
    """(k,) bool, sides to split: inner sides that deviate, and the longest inner side of a triangle that does."""
    inner = sides.inner
    length = np.linalg.norm(net.nodes[sides.ends[:, 0]] - net.nodes[sides.ends[:, 1]], axis=1)
    marked = np.zeros(len(sides.ends), bool)
    able = np.zeros(len(sides.ends), bool)
    shortest = SHORTEST * distances.chord + SHORTEST_GAPS * gaps[sides.ends].mean(axis=1)
    able[inner] = length[inner] > shortest[inner]
    marked[inner] = able[inner] & (distances(net, sides.ends[inner]) > distances.chord)
    rest = np.flatnonzero(~marked[sides.of].any(axis=1) & able[sides.of].any(axis=1))
    off = rest[distances(net, net.triangles[rest]) > distances.chord]
    choice = sides.of[off]
    longest = np.argmax(np.where(able[choice], length[choice], -1.0), axis=1)
    marked[choice[np.arange(len(off)), longest]] = True
    return marked


def _split(surface: BRepAdaptor_Surface, net: Net, sides: _Sides, marked: np.ndarray) -> Net:
    """Every marked side halved, every triangle cut by its one, two or three new nodes."""
    numbers = np.flatnonzero(marked)
    middle = np.full(len(marked), -1, np.int64)
    middle[numbers] = len(net.nodes) + np.arange(len(numbers))
    uv = net.uv[sides.ends[numbers]].mean(axis=1)
    points = np.array([surface.Value(u, v).Coord() for u, v in uv.tolist()])
    nodes = np.concatenate([net.nodes, points])
    count = marked[sides.of].sum(axis=1)
    out = [net.triangles[count == 0]]
    for cuts in (1, 2, 3):
        rows = np.flatnonzero(count == cuts)
        cut = marked[sides.of[rows]]
        # rotated so that the cut sides come first: one cut 0-1, two cuts 0-1 and 1-2
        start = np.argmax(cut & ~np.roll(cut, 1, axis=1), axis=1) if cuts < 3 else np.zeros(len(rows), np.int64)
        turn = (start[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(net.triangles[rows], turn, axis=1).T
        p, q, r = middle[np.take_along_axis(sides.of[rows], turn, axis=1)].T
        out += _pieces(nodes, cuts, (a, b, c), (p, q, r))
    return Net(nodes, np.concatenate([net.uv, uv]), np.concatenate(out), net.kept)


def _pieces(nodes: F64, cuts: int, corners: tuple[I64, I64, I64], middles: tuple[I64, I64, I64]) -> list[I64]:
    """Triangles a b c cut at p (between a and b), q (b and c), r (c and a), as far as there are cuts."""
    (a, b, c), (p, q, r) = corners, middles
    if cuts == 1:
        return [np.stack([a, p, c], axis=1), np.stack([p, b, c], axis=1)]
    if cuts == 3:
        return [np.stack(t, axis=1) for t in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))]
    # the quadrilateral left of a b c without its corner b is cut along its shorter diagonal
    through_a = (np.linalg.norm(nodes[a] - nodes[q], axis=1) <= np.linalg.norm(nodes[p] - nodes[c], axis=1))[:, None]
    return [np.stack([p, b, q], axis=1),
            np.where(through_a, np.stack([a, p, q], axis=1), np.stack([a, p, c], axis=1)),
            np.where(through_a, np.stack([a, q, c], axis=1), np.stack([p, q, c], axis=1))]


def _flipped(net: Net, distances: _Distances) -> Net:
    """Exchange sides that leave the surface for the other diagonal of their two triangles, where that is nearer."""
    triangles = net.triangles.copy()
    for _ in range(FLIP_ROUNDS):
        net = Net(net.nodes, net.uv, triangles, net.kept)
        sides = _sides(net)
        inner = sides.inner
        first, second = sides.uses[inner, 0], sides.uses[inner, 1]
        # in the first triangle the side runs from a to b, c lies on its left, d on its right
        a, b, c = (triangles[first // 3, (first + k) % 3] for k in (0, 1, 2))
        d = triangles[second // 3, (second + 2) % 3]
        now = distances(net, sides.ends[inner])
        flat = np.maximum(_angle(net.nodes, a, c, b), _angle(net.nodes, b, d, a))
        pick = np.flatnonzero(((now > distances.chord) | (flat > CAP)) & _convex(net.uv, a, b, c, d)
                              & ~present(sides.ends, np.stack([c, d], axis=1)))
        gain, better = _gain(net, (a[pick], b[pick], c[pick], d[pick]), now[pick], flat[pick], distances)
        pick = _apart(pick[better], gain[better], first // 3, second // 3, len(triangles))
        if not len(pick):
            break
        triangles[first[pick] // 3] = np.stack([c, a, d], axis=1)[pick]
        triangles[second[pick] // 3] = np.stack([c, d, b], axis=1)[pick]
    return Net(net.nodes, net.uv, triangles, net.kept)


def _gain(net: Net, corners: tuple[I64, ...], distance: F64, flat: F64,
          distances: _Distances) -> tuple[F64, np.ndarray]:
    """Gain of flips of side a b into c d, and whether each flip is allowed.

    A cap, three corners almost on a line, comes first: its normal has no meaning, and halving its long side only makes
    more caps.
    """
    a, b, c, d = corners
    other = distances(net, np.stack([c, d], axis=1))
    angles = [_angle(net.nodes, *k) for k in ((c, a, d), (a, d, c), (d, c, a), (d, b, c), (b, c, d), (c, d, b))]
    worst = np.max(angles, axis=0)
    cured = (flat > CAP) & (worst < CAP)
    better = cured | ((other < FLIP_GAIN * distance) & (worst < np.maximum(CAP, flat)))
    return np.where(cured, flat, 0.0) + distance - other, better


def _angle(nodes: F64, a: I64, b: I64, c: I64) -> F64:
    """Angle at b between a and c, rad."""
    p, q = nodes[a] - nodes[b], nodes[c] - nodes[b]
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(p, q), axis=1), np.einsum("ij,ij->i", p, q)))


def _convex(uv: F64, a: I64, b: I64, c: I64, d: I64) -> np.ndarray:
    """Whether triangles c a d and c d b have the same orientation in (u, v) as a b c and b a d."""
    old = _double(uv, a, b, c), _double(uv, b, a, d)
    new = _double(uv, c, a, d), _double(uv, c, d, b)
    whole = old[0] + old[1]
    room = FLIP_ROOM * np.abs(whole)
    sign = np.sign(whole)
    return (old[0] * sign > 0) & (old[1] * sign > 0) & (new[0] * sign > room) & (new[1] * sign > room)


def _double(uv: F64, a: I64, b: I64, c: I64) -> F64:
    p, q = uv[b] - uv[a], uv[c] - uv[a]
    return np.asarray(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])


def present(known: I64, pairs: I64) -> np.ndarray:
    """Which pairs are known, in either order, (k,) bool.

    known : (n, 2) int64, index; pairs : (k, 2) int64, index, nodes in the frame of the net
    """
    size = max(int(known.max(initial=0)), int(pairs.max(initial=0))) + 1
    keys = [p.min(axis=1) * size + p.max(axis=1) for p in (pairs, known)]
    return np.isin(keys[0], keys[1])


def _apart(pick: I64, gain: F64, first: I64, second: I64, count: int) -> I64:
    """The flips with the largest gain among those that share a triangle."""
    best = np.full(count, len(pick))
    rank = np.empty(len(pick), np.int64)
    rank[np.argsort(-gain, kind="stable")] = np.arange(len(pick))
    for triangle in (first[pick], second[pick]):
        np.minimum.at(best, triangle, rank)
    return pick[(best[first[pick]] == rank) & (best[second[pick]] == rank)]
