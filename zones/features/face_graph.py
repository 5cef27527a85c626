"""Measured faces of a part for the search for walls: samples, material thickness, fillets, links.

Everything here is measured once on the mesh and the B-rep edges; the later stages only read arrays.
Faces are indexed from 0 here: face ``F12`` has index 11. There are n faces, m triangles and s samples. Places and
directions lie in the frame of the part.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.part import EdgeInfo, EdgeKind, Part
from geometry.sampling import SurfaceSamples, joined, sample_surface
from zones.features.seat import seat_of

STEEP_NZ = 0.5
"""A normal more than 60 degrees from +Z has n_z below this; below minus this it faces down."""

SAMPLES_PER_FACE = 24
SAMPLES_IN_ALL = 24_000

# A fillet turns by at least this angle (rad) between the two faces it joins. Its radius is at most this share of the
# height of the part. Larger concave faces are shape, not transition.
FILLET_TURN = 0.35
FILLET_RADIUS_SHARE = 0.35

# A concave face with parallel material behind it over this share is a bend of a wall, not a fillet.
PARALLEL_DOT = -0.94
PARALLEL_SHARE = 0.7


@dataclass(frozen=True, eq=False)
class Link:
    """A B-rep edge between two different faces.

    a, b   : 0-based faces
    kind   : EdgeKind
    length : mm
    nodes  : (k,) int, vertices of the mesh along the edge
    """

    a: int
    b: int
    kind: EdgeKind
    length: float
    nodes: np.ndarray

    @property
    def joins(self) -> bool:
        """Whether the surface continues across the edge: convex or smooth."""
        return self.kind in (EdgeKind.CONVEX, EdgeKind.SMOOTH)

    def other(self, face: int) -> int:
        """The face on the other side."""
        return self.b if face == self.a else self.a


class UnionFind:
    """Disjoint sets over 0..n-1; the representative is the least member, so labels do not depend on the order."""

    def __init__(self, n: int) -> None:
        self.parent = list(range(n))

    def find(self, i: int) -> int:
        """Least member of the set of i."""
        while self.parent[i] != i:
            self.parent[i] = self.parent[self.parent[i]]
            i = self.parent[i]
        return i

    def union(self, i: int, j: int) -> None:
        """Join the sets of i and j."""
        i, j = self.find(i), self.find(j)
        if i != j:
            self.parent[max(i, j)] = min(i, j)

    def labels(self) -> np.ndarray:
        """(n,) int64, index of the representative of each member."""
        return np.array([self.find(i) for i in range(len(self.parent))], dtype=np.int64)


def connected_runs(runs: list[np.ndarray]) -> list[list[int]]:
    """Groups of runs of mesh vertices that share a vertex, as lists of indices.

    runs : k arrays (m,) int64, index of vertices of the mesh
    """
    sets = UnionFind(len(runs))
    owner: dict[int, int] = {}
    for i, nodes in enumerate(runs):
        for node in nodes.tolist():
            sets.union(owner.setdefault(node, i), i)
    label = sets.labels()
    return [np.flatnonzero(label == k).tolist() for k in np.unique(label)]


class FaceGraph:
    """Measured faces of a part and the links between them.

    part : Part in the setup frame, +Z towards the spindle
    """

    def __init__(self, part: Part) -> None:
        self.part = part
        self.mesh: TriangleMesh = part.mesh
        self.n = len(part.faces)
        self.face_of = self.mesh.face_ids.astype(np.int64) - 1
        self.tree = TriangleTree(self.mesh)
        self.sliver = np.array([f.sliver for f in part.faces], dtype=bool) | (self.area <= 0)
        self.samples = _samples(self)
        self.face = self.samples.face.astype(np.int64) - 1
        self.inward, hit = cast(self.tree, self.samples.points, -self.samples.normals, self.skin)
        self.back = np.where(hit >= 0, self.face_of[hit], -1)
        self.back_dot = np.where(hit >= 0, _dot(self.mesh.normals[hit], self.samples.normals), 0.0)
        self.links = self._links()
        self.at: list[list[Link]] = [[] for _ in range(self.n)]
        for link in self.links:
            self.at[link.a].append(link)
            self.at[link.b].append(link)
        self.fillet = self._fillets()

    @cached_property
    def height(self) -> float:
        """Height of the part, mm."""
        return float(self.part.bounds[1, 2] - self.part.bounds[0, 2])

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, mm."""
        return float(np.linalg.norm(self.part.bounds[1] - self.part.bounds[0]))

    @cached_property
    def skin(self) -> float:
        """Distance below or above a surface at which rays start, mm."""
        return 1e-6 * self.size

    @cached_property
    def area(self) -> F64:
        """(n,) float64, mm²."""
        return np.asarray(np.bincount(self.face_of, weights=self.mesh.areas, minlength=self.n), dtype=np.float64)

    @cached_property
    def normal(self) -> F64:
        """(n, 3) float64, dimensionless, frame of the mesh: area-weighted mean outward normal."""
        w = self.mesh.normals * self.mesh.areas[:, None]
        total = np.column_stack([np.bincount(self.face_of, weights=w[:, k], minlength=self.n) for k in range(3)])
        return np.asarray(total / np.maximum(self.area, 1e-30)[:, None])

    @cached_property
    def centroid(self) -> F64:
        """(n, 3) float64, mm, frame of the mesh: centre of area of each face."""
        w = self.mesh.triangles.mean(axis=1) * self.mesh.areas[:, None]
        total = np.column_stack([np.bincount(self.face_of, weights=w[:, k], minlength=self.n) for k in range(3)])
        return np.asarray(total / np.maximum(self.area, 1e-30)[:, None])

    @cached_property
    def z_range(self) -> F64:
        """(n, 2) float64, mm, heights in the frame of the mesh: lowest and highest point of each face."""
        z = self.mesh.triangles[:, :, 2]
        out = np.column_stack([np.full(self.n, np.inf), np.full(self.n, -np.inf)])
        np.minimum.at(out[:, 0], self.face_of, z.min(axis=1))
        np.maximum.at(out[:, 1], self.face_of, z.max(axis=1))
        return out

    def share(self, of_triangles: np.ndarray) -> F64:
        """Share of the area of each face whose triangles fulfil a condition, (n,) float64, dimensionless.

        of_triangles : (m,) bool, the condition
        """
        part = np.bincount(self.face_of, weights=self.mesh.areas * of_triangles, minlength=self.n)
        return np.asarray(part / np.maximum(self.area, 1e-30))

    def sample_share(self, of_samples: np.ndarray) -> F64:
        """Share of the samples of each face that fulfil a condition, (n,) float64, dimensionless.

        of_samples : (s,) bool, the condition
        """
        count = np.bincount(self.face, minlength=self.n)
        return np.asarray(np.bincount(self.face, weights=of_samples.astype(float), minlength=self.n)
                          / np.maximum(count, 1))

    def strip_share(self, of_samples: np.ndarray) -> F64:
        """``sample_share`` by area over all faces of one surface (``strip``), (n,) float64, dimensionless.

        of_samples : (s,) bool, the condition
        """
        strip, weight = self.strip[self.face], self.samples.area
        total = np.bincount(strip, weights=weight, minlength=self.n)
        found = np.bincount(strip, weights=weight * of_samples, minlength=self.n)
        return np.asarray((found / np.maximum(total, 1e-30))[self.strip])

    def face_rows(self, of_faces: np.ndarray) -> np.ndarray:
        """(k,) int64, index of the samples on the selected faces. of_faces : (n,) bool, the selection."""
        return np.flatnonzero(of_faces[self.face])

    @cached_property
    def steep(self) -> np.ndarray:
        """(n,) bool: over half of the face the normal is more than 60 degrees from +Z and does not point down."""
        return self.share(np.abs(self.mesh.normals[:, 2]) <= STEEP_NZ) >= 0.5

    @cached_property
    def side_like(self) -> np.ndarray:
        """(n,) bool: at least 30 degrees off horizontal over half of the face."""
        return np.asarray(self.steep | (self.share(np.abs(self.mesh.normals[:, 2]) < 0.87) >= 0.5))

    @cached_property
    def seat(self) -> np.ndarray:
        """(n,) bool: faces of the lowest plane facing away from the spindle."""
        return seat_of(self.part)

    def normals_at(self, face: int, nodes: np.ndarray) -> F64:
        """Unit normals of a face at mesh vertices on its border.

        face  : 0-based
        nodes : (k,) int64, index of vertices of triangles of that face
        Returns (k, 3) float64, dimensionless, frame of the mesh; NaN where the face has no triangle at the vertex.
        """
        keys, total = self._corner_normals
        key = nodes.astype(np.int64) * self.n + face
        at = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        out = np.where((keys[at] == key)[:, None], total[at], np.nan)
        length = np.linalg.norm(out, axis=1)
        return np.asarray(out / np.where(length > 0, length, np.nan)[:, None])

    @cached_property
    def _corner_normals(self) -> tuple[np.ndarray, F64]:
        key = (self.mesh.faces.astype(np.int64) * self.n + self.face_of[:, None]).ravel()
        keys, inverse = np.unique(key, return_inverse=True)
        w = np.repeat(self.mesh.normals * self.mesh.areas[:, None], 3, axis=0)
        total = np.column_stack([np.bincount(inverse, weights=w[:, k], minlength=len(keys)) for k in range(3)])
        return keys, np.asarray(total, dtype=np.float64)

    def _links(self) -> list[Link]:
        from scipy.spatial import cKDTree

        edges = [e for e in self.part.edges if self._counts(e)]
        if not edges:
            return []
        nodes = cKDTree(self.mesh.vertices).query(np.concatenate([e.points for e in edges]))[1]
        cuts = np.cumsum([0, *[len(e.points) for e in edges]])
        return [Link(e.faces[0] - 1, e.faces[1] - 1, e.kind, float(e.length), nodes[cuts[i]:cuts[i + 1]])
                for i, e in enumerate(edges)]

    def _counts(self, edge: EdgeInfo) -> bool:
        a, b = edge.faces[0] - 1, edge.faces[1] - 1
        usable = a != b and edge.kind != EdgeKind.BOUNDARY and len(edge.points) > 0 and np.isfinite(edge.points).all()
        return bool(usable and not (self.sliver[a] or self.sliver[b]))

    @cached_property
    def strip(self) -> np.ndarray:
        """(n,) int64, index: faces that the CAD system cut from one surface have one label."""
        sets = UnionFind(self.n)
        for link in self.links:
            if link.kind == EdgeKind.SMOOTH and self._same_surface(link.a, link.b):
                sets.union(link.a, link.b)
        return sets.labels()

    def _same_surface(self, a: int, b: int) -> bool:
        fa, fb = self.part.faces[a], self.part.faces[b]
        if fa.surface != fb.surface or fa.surface not in ("plane", "cylinder", "sphere", "torus", "cone"):
            return False
        if fa.radius is None or fb.radius is None:
            return fa.surface == "plane"
        same_side = np.isclose(fa.curvature_max, fb.curvature_max, rtol=0.02, atol=1e-4)
        return bool(np.isclose(fa.radius, fb.radius, rtol=1e-3) and same_side)

    def _fillets(self) -> np.ndarray:
        parallel = self._parallel(np.full(self.n, 0.5 * self.height))
        out = np.zeros(self.n, bool)
        for face in range(self.n):
            if self.part.faces[face].curvature_min < -1e-6 and not self.sliver[face]:
                out[face] = parallel[face] < PARALLEL_SHARE and self._stands_for_concave(face)
        out |= self._corner_patches(out)
        return out | self._chamfers(out)

    def _parallel(self, thickness: F64) -> np.ndarray:
        """(n,) float64: share of each face with a parallel one behind less than ``thickness`` (n,) of material, mm."""
        return self.sample_share((self.back_dot < PARALLEL_DOT) & (self.inward < thickness[self.face]))

    def _stands_for_concave(self, face: int) -> bool:
        """Whether a face turns concavely, with a small radius, between its two longest tangent neighbours."""
        smooth = [k for k in self.at[face]
                  if k.kind == EdgeKind.SMOOTH and self.strip[k.other(face)] != self.strip[face]]
        smooth.sort(key=lambda k: -k.length)
        best = (0.0, False)
        for first, second in combinations(smooth[:12], 2):
            turn, radius, concave = self._turn(face, first, second)
            if turn >= FILLET_TURN:
                good = concave and radius <= FILLET_RADIUS_SHARE * self.height
                best = max(best, (first.length + second.length, good))
        return best[1]

    def _turn(self, face: int, first: Link, second: Link) -> tuple[float, float, bool]:
        """Median turn (rad), radius (mm) and concavity of a face between two of its edges."""
        if len(first.nodes) > len(second.nodes):
            first, second = second, first
        nodes = first.nodes[np.unique(np.linspace(0, len(first.nodes) - 1, 7).astype(int))]
        p, q = self.mesh.vertices[nodes], self.mesh.vertices[second.nodes]
        distance = np.linalg.norm(p[:, None] - q[None], axis=2)
        near = distance.argmin(axis=1)
        gap = distance[np.arange(len(p)), near]
        n1, n2 = self.normals_at(face, nodes), self.normals_at(face, second.nodes[near])
        with np.errstate(invalid="ignore"):
            turn = np.arccos(np.clip(_dot(n1, n2), -1.0, 1.0))
        good = np.isfinite(turn) & (gap > self.skin)
        if not good.any():
            return 0.0, np.inf, False
        sign = _dot(q[near] - p, n2 - n1)[good]
        middle = float(np.median(turn[good]))
        radius = float(np.median(gap[good])) / max(2.0 * np.sin(0.5 * middle), 1e-9)
        return middle, radius, bool(np.median(sign) < 0)

    def _corner_patches(self, fillet: np.ndarray) -> np.ndarray:
        """Small faces that only continue fillets: every tangent neighbour but at most one is a fillet."""
        out = np.zeros(self.n, bool)
        for face in np.flatnonzero(~fillet & ~self.sliver).tolist():
            smooth = {k.other(face) for k in self.at[face] if k.kind == EdgeKind.SMOOTH}
            near = [g for g in smooth if fillet[g]]
            if len(near) >= 2 and len(near) >= len(smooth) - 1 and self.area[face] < max(self.area[near]):
                out[face] = self.part.faces[face].curvature_min < -1e-6 and len(self.at[face]) <= 6
        return out

    def _chamfers(self, fillet: np.ndarray) -> np.ndarray:
        """Narrow faces between two concave edges, leaning half way between their neighbours (a weld, a chamfer).

        The flank of a short bar or of a leg of a fork is none: it is wider than the thickness of the material behind
        it.
        """
        out = np.zeros(self.n, bool)
        width = np.zeros(self.n)
        for face in np.flatnonzero(~fillet & ~self.sliver).tolist():
            links = sorted((k for k in self.at[face] if k.kind == EdgeKind.CONCAVE), key=lambda k: -k.length)[:2]
            if len(links) < 2 or self.area[face] > 0.15 * self.height * links[1].length:
                continue
            a, b = (self.normals_at(k.other(face), k.nodes).mean(axis=0) for k in links)
            mid = (a + b) / max(float(np.linalg.norm(a + b)), 1e-9)
            out[face] = -0.5 < a @ b < 0.9 and float(mid @ self.normal[face]) > 0.9
            width[face] = self.area[face] / links[1].length
        return out & (self._parallel(width) < PARALLEL_SHARE)


def cast(tree: TriangleTree, origins: F64, directions: F64, skin: float) -> tuple[F64, np.ndarray]:
    """First hits of rays that leave a surface.

    origins, directions : (n, 3) float64, mm and dimensionless, in the frame of the mesh
    skin                : mm, nearer hits are the surface itself

    Returns distances from the origins, (n,) float64, mm, inf where nothing is hit, and triangles, (n,) int64, index,
    -1 there.
    """
    if len(origins) == 0:
        return np.zeros(0), np.zeros(0, np.int64)
    distance, triangle = first_hits(tree, origins, directions, t_min=skin)
    return distance, triangle.astype(np.int64)


def _samples(graph: FaceGraph) -> SurfaceSamples:
    order = np.argsort(graph.face_of, kind="stable")
    cuts = np.searchsorted(graph.face_of[order], np.arange(graph.n + 1))
    total = max(float(graph.area.sum()), 1e-30)
    parts = []
    for face in range(graph.n):
        if graph.sliver[face]:
            continue
        wanted = SAMPLES_PER_FACE + SAMPLES_IN_ALL * graph.area[face] / total
        triangles = order[cuts[face]:cuts[face + 1]]
        parts.append(sample_surface(graph.mesh, wanted / graph.area[face], seed=17, triangles=triangles))
    return joined(parts)


def _dot(a: F64, b: F64) -> F64:
    return np.asarray(np.einsum("ij,ij->i", a, b))
