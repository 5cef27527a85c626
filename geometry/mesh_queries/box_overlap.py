"""Overlap of an axis-parallel box with a closed mesh."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64, TriangleMesh

_NEXT = np.array([1, 2, 0])


def point_of_mesh_in_box(mesh: TriangleMesh, lower: F64, upper: F64) -> F64 | None:
    """A point of the solid inside a box, or None where solid and box do not meet [Ericson2005].

    A closed mesh bounds the solid. All points are in the frame of the mesh.

    mesh         : TriangleMesh, closed, normals outwards, mm
    lower, upper : (3,) float64, mm, corners of the box in the frame of the mesh

    Returns (3,) float64, mm, frame of the mesh: on the surface where the surface enters the box, else the middle of a
    box that lies wholly inside the solid. Exact for the mesh, however thin the box is.
    """
    triangles = mesh.triangles
    near = np.flatnonzero(((triangles.min(axis=1) <= upper) & (triangles.max(axis=1) >= lower)).all(axis=1))
    hits = near[_overlaps(triangles[near], 0.5 * (lower + upper), 0.5 * (upper - lower))]
    for hit in hits:
        if len(clipped := _clip(triangles[hit], lower, upper)):
            return clipped.mean(axis=0)
    middle = 0.5 * (lower + upper)
    return middle if is_inside(mesh, middle) else None


def is_inside(mesh: TriangleMesh, point: F64) -> bool:
    """Whether a point lies inside a closed mesh: the solid angle of the surface around it is a whole sphere.

    The formula of the solid angle of a triangle is that of [VanOosterom1983].

    mesh  : TriangleMesh, closed, normals outwards, mm
    point : (3,) float64, mm, frame of the mesh, not on the surface

    Source: A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30 (1983).
    """
    if ((point < mesh.vertices.min(axis=0)) | (point > mesh.vertices.max(axis=0))).any():
        return False
    a, b, c = np.moveaxis(mesh.triangles - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = (la * lb * lc + np.einsum("ij,ij->i", a, b) * lc + np.einsum("ij,ij->i", b, c) * la
             + np.einsum("ij,ij->i", c, a) * lb)
    return bool(abs(2.0 * np.arctan2(volume, below).sum()) > 2.0 * np.pi)


def _overlaps(triangles: F64, centre: F64, half: F64) -> np.ndarray:
    """(n,) bool: triangles (n, 3, 3), whose bounding boxes meet the box, that the box meets: no axis parts them."""
    v = triangles - centre
    edges = v[:, _NEXT] - v
    axes = [np.cross(edges[:, 0], edges[:, 1])]
    axes += [np.cross(np.eye(3)[k], edges[:, e]) for k in range(3) for e in range(3)]
    meets = np.ones(len(v), dtype=bool)
    for axis in axes:
        shadow = np.einsum("nij,nj->ni", v, axis)
        reach = np.abs(axis) @ half
        meets &= (shadow.min(axis=1) <= reach) & (shadow.max(axis=1) >= -reach)
    return meets


def _clip(triangle: F64, lower: F64, upper: F64) -> F64:
    """(k, 3) corners of what a box leaves of a triangle; k is 0 where it leaves nothing (Sutherland and Hodgman)."""
    corners = list(triangle)
    for k in range(3):
        for sign, bound in ((1.0, lower[k]), (-1.0, upper[k])):
            kept: list[F64] = []
            for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
                da, db = sign * (a[k] - bound), sign * (b[k] - bound)
                if da >= 0:
                    kept.append(a)
                if (da < 0) != (db < 0):
                    kept.append(a + (b - a) * (da / (da - db)))
            corners = kept
    return np.array(corners).reshape(-1, 3)
