"""Several faces that join smoothly, as one region of a plane.

Least squares conformal maps [Levy2002] lay their facets into a plane so that angles change least. Two places are fixed.
Of all maps of the sheet of triangles into the plane, the one is taken for which

    sum over triangles of |W1 U1 + W2 U2 + W3 U3|² / 2 A      is least,

U the corners as complex numbers, W the opposite sides of the triangle in its own plane. The region there is mapped to
squares like the parameters of a face (``geometry.parameterization.square_patches``). Each place goes back through its
facet to the nearest place of the exact surface.

Notation
    k, t : corners and triangles of the facets
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from geometry.errors import GeometryError
from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.parameterization.planar_embedding import located
from geometry.surfaces.foot_points import foot_points
from geometry.surfaces.nurbs import NurbsSurface

MAX_STRETCH = 3.0  # ratio of greatest to least scale of lengths in the plane; above it passes are far from even
ROUGH = 1e-9  # of the largest area: smaller triangles do not count


@dataclass(frozen=True, eq=False)
class Joined:
    """Faces laid into one plane.

    surfaces : NurbsSurface of each face, by its number
    mesh     : TriangleMesh, (k,) corners and (t,) facets of the faces, mm
    uv       : (t, 3, 2) float64, parameters on ``surfaces`` of the corners of every facet
    plane    : (k, 2) float64, mm, of the corners; lengths are about those on the faces
    border   : (b, 2) float64, mm, in the plane, counterclockwise, closed, the first place not repeated
    """

    surfaces: Mapping[int, NurbsSurface]
    mesh: TriangleMesh
    uv: F64
    plane: F64
    border: F64

    @classmethod
    def of(cls, mesh: TriangleMesh, uv: F64, surfaces: Mapping[int, NurbsSurface]) -> Joined:
        """Faces of a part as one sheet in a plane, by least squares conformal maps [Levy2002].

        mesh     : TriangleMesh of a part, its corners shared between faces
        uv       : (m, 3, 2) float64, dimensionless, parameters on ``surfaces`` of the corners of every facet
        surfaces : NurbsSurface of each wanted face, by its number

        Raises
        ------
        GeometryError
            Code 'not_a_sheet': the faces are not connected, have a hole, or close up. Code 'not_flat': in the plane
            they fold, overlap, or stretch three times more in one place than in another.
        """
        rows = np.flatnonzero(np.isin(mesh.face_ids, list(surfaces)))
        used, corners = np.unique(mesh.faces[rows], return_inverse=True)
        faces = corners.reshape(-1, 3).astype(np.int32)
        own = TriangleMesh(mesh.vertices[used], faces, mesh.face_ids[rows])
        names = tuple(f"F{f}" for f in sorted(surfaces))
        loop = _border(faces, len(used), names)
        plane = _laid_flat(own.vertices, faces, loop, names)
        return cls(surfaces, own, uv[rows], plane, plane[loop])

    def places(self, at: F64) -> F64:
        """Places of the exact faces, (n, 3) float64, mm, frame of the mesh.

        at : (n, 2) float64, mm, places in the plane
        """
        row, share = located(self.plane, self.mesh.faces, at)
        return self._feet(np.einsum("nk,nkc->nc", share, self.mesh.vertices[self.mesh.faces[row]]), row,
                          np.einsum("nk,nkc->nc", share, self.uv[row]))[0]

    def feet(self, points: F64) -> tuple[F64, F64]:
        """Nearest places of the exact faces with their normals.

        points : (n, 3) float64, mm, frame of the mesh, close to the faces

        Returns places, (n, 3) float64, mm, and unit normals, (n, 3) float64, dimensionless, both in the frame of the
        mesh.
        """
        _, row, foot = nearest(self._tree, points)
        a, b, c = (self.mesh.vertices[self.mesh.faces[row, k]] for k in range(3))
        u, v, w = b - a, c - a, foot - a
        uu, uv, vv = (u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)
        wu, wv = (w * u).sum(axis=1), (w * v).sum(axis=1)
        size = np.maximum(uu * vv - uv * uv, 1e-300)
        along, across = (vv * wu - uv * wv) / size, (uu * wv - uv * wu) / size
        share = np.clip(np.column_stack([1.0 - along - across, along, across]), 0.0, 1.0)
        share /= share.sum(axis=1, keepdims=True)
        return self._feet(points, row, np.einsum("nk,nkc->nc", share, self.uv[row]))

    @cached_property
    def _tree(self) -> TriangleTree:
        return TriangleTree(self.mesh)

    def _feet(self, points: F64, row: NDArray[np.int64], start: F64) -> tuple[F64, F64]:
        """Feet and normals of points by the faces of facets (n,), from parameters (n, 2)."""
        out, normal = np.empty_like(points), np.empty_like(points)
        face = self.mesh.face_ids[row]
        for number in np.unique(face).tolist():
            k, surface = np.flatnonzero(face == number), self.surfaces[number]
            found = foot_points(surface, points[k], np.clip(start[k], *surface.domain))
            out[k], normal[k] = found.points, surface.normals(found.uv)
        return out, normal


def _border(faces: NDArray[np.int32], count: int, names: tuple[str, ...]) -> NDArray[np.int64]:
    """The corners along the one border of a sheet, its inside on the left."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    rim = ~np.isin(start * count + end, end * count + start)
    following = dict(zip(start[rim].tolist(), end[rim].tolist(), strict=True))
    edges = len(np.unique(np.minimum(start, end) * count + np.maximum(start, end)))
    loop = [min(following)] if following else []
    while loop and following.get(loop[-1], loop[0]) != loop[0] and len(loop) <= len(following):
        loop.append(following[loop[-1]])
    sheet = count - edges + len(faces) == 1 and len(loop) == len(following) == int(rim.sum())
    if not sheet:
        raise GeometryError(f"{' '.join(names)} are not one sheet with one border", code="not_a_sheet", subjects=names,
                            measured=count - edges + len(faces), limit=1, remedy="machine the faces one by one")
    return np.array(loop)


def _laid_flat(vertices: F64, faces: NDArray[np.int32], loop: NDArray[np.int64], names: tuple[str, ...]) -> F64:
    """(k, 2) mm, the corners in a plane, scaled so that the total area is that of the sheet."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    u, v = b - a, c - a
    long = np.linalg.norm(u, axis=1)
    x = (u * v).sum(axis=1) / np.maximum(long, 1e-300)
    y = np.linalg.norm(np.cross(u, v), axis=1) / np.maximum(long, 1e-300)
    own = np.column_stack([np.zeros(len(faces)), long.astype(np.complex128), x + 1j * y])
    area = 0.5 * long * y
    whole = area > ROUGH * area.max()
    side = (own[:, [2, 0, 1]] - own[:, [1, 2, 0]])[whole] / np.sqrt(2.0 * area[whole])[:, None]
    matrix = coo_matrix((side.ravel(), (np.repeat(np.arange(whole.sum()), 3), faces[whole].ravel())),
                        shape=(int(whole.sum()), len(vertices))).tocsc()
    one = loop[int(np.linalg.norm(vertices[loop] - vertices[loop[0]], axis=1).argmax())]
    two = loop[int(np.linalg.norm(vertices[loop] - vertices[one], axis=1).argmax())]
    held, free = np.array([one, two]), np.setdiff1d(np.arange(len(vertices)), [one, two])
    at = np.array([0.0, np.linalg.norm(vertices[two] - vertices[one])], dtype=np.complex128)
    left = matrix[:, free]
    out = np.empty(len(vertices), np.complex128)
    out[held], out[free] = at, spsolve((left.getH() @ left).tocsc(), -(left.getH() @ (matrix[:, held] @ at)))
    p, q, r = (out[faces[:, k]] for k in range(3))
    laid = 0.5 * ((q - p).conj() * (r - p)).imag
    ratio = laid[whole] / area[whole]
    if not (np.isfinite(ratio).all() and ratio.min() > 0.0 and ratio.max() < MAX_STRETCH**2 * ratio.min()):
        stretch = float(np.sqrt(ratio.max() / ratio.min())) if ratio.min() > 0.0 else float("inf")
        raise GeometryError(f"{' '.join(names)} cannot be laid into a plane without folds or large stretch",
                            code="not_flat", subjects=names, measured=stretch, limit=MAX_STRETCH,
                            remedy="machine the faces one by one")
    plane = np.column_stack([out.real, out.imag]) * np.sqrt(area.sum() / laid.sum())
    if not shapely.Polygon(plane[loop]).is_valid:
        raise GeometryError(f"{' '.join(names)} overlap themselves when laid into a plane", code="not_flat",
                            subjects=names, measured=1, limit=0, remedy="machine the faces one by one")
    return plane
