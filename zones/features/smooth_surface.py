"""The surface of selected faces, reconstructed from mesh nodes and their surface parameters.

The nodes of the mesh lie on the exact surface. Around every node a cubic patch X(u, v) is fitted to the nodes of the
same B-rep face within two rings, or up to four until there are sixteen. A point of a triangle gets the blend of the
patches of its three corners. Facet normals are right only in the middle of a facet; these normals are right up to the
borders of a face.

Error: fourth order in the size h of a facet for places, third order for normals, one order less where a face has too
few rows of nodes for a cubic. Measured in tests/oracle/test_gaps.py. With too few rows along v the patch is ruled
along v.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64, TriangleMesh
from zones.kernels.cubic import blend_patches, fit_patches, local_nodes, rings

# A patch is rejected where it turns this far from its facet (cosine) or lies this many mesh tolerances off it.
TURN_DOT = 0.7
FAR = 4.0
# Parameters of one node agree within this share of their range.
SAME = 1e-9


class SmoothSurface:
    """Places and normals of the exact surface on chosen triangles of a mesh, in the frame of the mesh.

    mesh      : TriangleMesh
    uv        : (m, 3, 2) float64, rad, mm or dimensionless, surface parameters of the corners of its triangles; None:
                facets as they are
    triangles : (k,) int64, index of triangles of whole faces
    tolerance : mm, largest distance of the facets from the surface
    """

    def __init__(self, mesh: TriangleMesh, uv: F64 | None, triangles: np.ndarray, tolerance: float) -> None:
        self.mesh = mesh
        self.tolerance = tolerance
        self.row = np.full(len(mesh.faces), -1)
        if uv is None or len(triangles) == 0:
            return
        self.row[triangles] = np.arange(len(triangles))
        par = np.ascontiguousarray(uv[triangles])
        same = SAME * max(float(np.ptp(par.reshape(-1, 2), axis=0).max()), 1e-30)
        faces = mesh.faces[triangles]
        self.corner, first = local_nodes(faces, mesh.face_ids[triangles], par, len(mesh.vertices), same)
        self.place = np.ascontiguousarray(mesh.vertices[faces.reshape(-1)[first]])
        self.par = np.ascontiguousarray(par.reshape(-1, 2)[first])
        self.coef = fit_patches(self.place, self.par, *rings(self.corner, len(first)))

    def at(self, points: F64, triangles: np.ndarray) -> tuple[F64, F64]:
        """Places on the exact surface next to points of triangles, and outward unit normals there.

        points    : (n, 3) float64, mm, on the triangles, frame of the mesh
        triangles : (n,) int64, index
        Returns places, (n, 3) float64, mm, and normals, (n, 3) float64, dimensionless, frame of the mesh: the points
        and facet normals where no patch exists or it is rejected.
        """
        place, normal = points.copy(), self.mesh.normals[triangles].copy()
        known = np.flatnonzero(self.row[triangles] >= 0)
        if len(known) == 0:
            return place, normal
        corner = self.corner[self.row[triangles[known]]]
        x, n = blend_patches(corner, points[known], self.place, self.par, self.coef)
        dot = np.einsum("ij,ij->i", n, normal[known])
        n = n * np.sign(dot)[:, None]
        off = np.linalg.norm(x - points[known], axis=1)
        turned = np.abs(dot) > TURN_DOT
        near = turned & (off <= FAR * self.tolerance)
        normal[known[turned]] = n[turned]
        place[known[near]] = x[near]
        return place, normal
