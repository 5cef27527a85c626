"""The exact surface of selected faces, as near as mesh nodes and their surface parameters tell it.

The nodes of the mesh lie on the exact surface. Round every node a cubic patch X(u, v) is fitted to the nodes of the
same B-rep face within two rings, or up to four until there are sixteen; a point of a triangle gets the blend of the
patches of its three corners. Facet normals are right in the middle of a facet only; these hold up to the borders of a
face as well.

Error: fourth order in the size h of a facet for places, third order for normals, one order less where a face has too
few rows of nodes for a cubic. Measured in tests/oracle/test_gaps.py. Rows that cannot tell v from v^2 make the patch
ruled along v.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64, TriangleMesh
from zones.kernels.cubic import blend_patches, fit_patches

# A patch that turns this far from its facet (cosine) or lies this many mesh tolerances off it is not believed.
TURN_DOT = 0.7
FAR = 4.0


class SmoothFaces:
    """Places and normals of the exact surface on chosen triangles of a mesh.

    mesh      : TriangleMesh
    uv        : (m, 3, 2) float64, surface parameters of the corners of its triangles; None: facets as they are
    triangles : (k,) int, triangles of whole faces
    tolerance : mm, what the facets may be off the surface
    """

    def __init__(self, mesh: TriangleMesh, uv: F64 | None, triangles: np.ndarray, tolerance: float) -> None:
        self.mesh = mesh
        self.tolerance = tolerance
        self.row = np.full(len(mesh.faces), -1)
        if uv is None or len(triangles) == 0:
            return
        self.row[triangles] = np.arange(len(triangles))
        self.corner, first = _local_nodes(mesh, uv, triangles)
        corner_vertex = mesh.faces[triangles].reshape(-1)[first]
        self.place = np.ascontiguousarray(mesh.vertices[corner_vertex])
        self.par = np.ascontiguousarray(uv[triangles].reshape(-1, 2)[first])
        self.coef = fit_patches(self.place, self.par, *_rings(self.corner, len(first)))

    def at(self, points: F64, triangles: np.ndarray) -> tuple[F64, F64]:
        """Places on the exact surface next to points of triangles, and outward unit normals there.

        points    : (n, 3) float64, mm, on the triangles
        triangles : (n,) int
        Returns (n, 3) and (n, 3) float64; the points and facet normals where no patch is known or believed.
        """
        place, normal = points.copy(), self.mesh.normals[triangles].copy()
        known = np.flatnonzero(self.row[triangles] >= 0)
        if len(known) == 0:
            return place, normal
        share = _shares(self.mesh.triangles[triangles[known]], points[known])
        corner = self.corner[self.row[triangles[known]]]
        x, n = blend_patches(corner, share, self.place, self.par, self.coef)
        dot = np.einsum("ij,ij->i", n, normal[known])
        n = n * np.sign(dot)[:, None]
        off = np.linalg.norm(x - points[known], axis=1)
        turned = np.abs(dot) > TURN_DOT
        near = turned & (off <= FAR * self.tolerance)
        normal[known[turned]] = n[turned]
        place[known[near]] = x[near]
        return place, normal


def _local_nodes(mesh: TriangleMesh, uv: F64, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes that are one per face, vertex and parameters, so both sides of a seam have their own.

    Returns (k, 3) int nodes of the triangles, and (n,) int, for every node its first corner (3 t + c).
    """
    vertex = mesh.faces[triangles].astype(np.int64)
    key = (vertex * (int(mesh.face_ids.max()) + 1) + mesh.face_ids[triangles][:, None]).reshape(-1)
    _, first, node = np.unique(key, return_index=True, return_inverse=True)
    node = node.reshape(-1)
    par = uv[triangles].reshape(-1, 2)
    spread = max(float(np.ptp(par, axis=0).max()), 1e-30) if len(par) else 1.0
    split = np.flatnonzero((np.abs(par - par[first[node]]) > 1e-9 * spread).any(axis=1))
    if len(split):
        rows = np.column_stack([node[split], np.round(par[split] / (1e-9 * spread)).astype(np.int64)])
        _, more, place = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        node[split] = len(first) + place.reshape(-1)
        first = np.concatenate([first, split[more]])
    return node.reshape(-1, 3), first


def _rings(corner: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours of every node: (n + 1,) int starts and the nodes in one row."""
    a = np.concatenate([corner[:, [0, 1, 2]].reshape(-1), corner[:, [1, 2, 0]].reshape(-1)])
    b = np.concatenate([corner[:, [1, 2, 0]].reshape(-1), corner[:, [0, 1, 2]].reshape(-1)])
    key = np.unique(a * count + b)
    start = np.searchsorted(key, np.arange(count + 1) * count)
    return start, key % count


def _shares(t: F64, points: F64) -> F64:
    """Barycentric coordinates of points (n, 3) in their triangles (n, 3, 3), clipped to the triangle."""
    e1, e2, w = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0], points - t[:, 0]
    n = np.cross(e1, e2)
    square = np.maximum(np.einsum("ij,ij->i", n, n), 1e-300)
    b1 = np.clip(np.einsum("ij,ij->i", np.cross(w, e2), n) / square, 0.0, 1.0)
    b2 = np.clip(np.einsum("ij,ij->i", np.cross(e1, w), n) / square, 0.0, 1.0 - b1)
    return np.column_stack([1.0 - b1 - b2, b1, b2])
