"""Points spread evenly over a mesh, each standing for a known area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64, I32, TriangleMesh


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of a surface.

    points   : (n, 3) float64, mm
    normals  : (n, 3) float64, unit, out of the material
    area     : (n,) float64, mm² each sample stands for; sums to the area sampled
    face     : (n,) int32, number of the B-rep face
    triangle : (n,) int32, index of the triangle
    """

    points: F64
    normals: F64
    area: F64
    face: I32
    triangle: I32

    def __len__(self) -> int:
        return len(self.points)

    def subset(self, keep: np.ndarray) -> SurfaceSamples:
        """The samples selected by a boolean mask or an index array."""
        return SurfaceSamples(self.points[keep], self.normals[keep], self.area[keep], self.face[keep],
                              self.triangle[keep])


def sample_surface(mesh: TriangleMesh, density: float, *, seed: int = 0,
                   triangles: np.ndarray | None = None) -> SurfaceSamples:
    """Spread samples over the triangles of a mesh by stratified cumulative area.

    mesh      : TriangleMesh
    density   : float, samples per mm²
    seed      : int, two different seeds never share a sample
    triangles : (k,) int indices of the triangles to sample, all when None

    Returns
    -------
    SurfaceSamples
        Triangles are taken in the given order and the running area is cut into equal strata with one
        jittered sample each, so a triangle of area a gets a*density samples within one.
    """
    chosen = np.arange(len(mesh.faces)) if triangles is None else np.asarray(triangles)
    areas = mesh.areas[chosen]
    total = float(areas.sum())
    n = max(1, round(total * density)) if total > 0 else 0
    rng = np.random.default_rng(seed)
    ends = np.cumsum(areas)
    marks = (np.arange(n) + rng.random(n)) * (total / max(n, 1))
    pick = np.minimum(np.searchsorted(ends, marks, side="right"), max(len(chosen) - 1, 0))
    tri = chosen[pick].astype(np.int32)
    r1, r2 = np.sqrt(rng.random(n)), rng.random(n)
    t = mesh.triangles[tri]
    pts = (1 - r1)[:, None] * t[:, 0] + (r1 * (1 - r2))[:, None] * t[:, 1] + (r1 * r2)[:, None] * t[:, 2]
    return SurfaceSamples(np.ascontiguousarray(pts), np.ascontiguousarray(mesh.normals[tri]),
                          np.full(n, total / max(n, 1)), mesh.face_ids[tri], tri)


def sample_borders(mesh: TriangleMesh, spacing: float, inset: float, triangles: np.ndarray) -> SurfaceSamples:
    """Samples on or just inside the borders between faces; they stand for no area.

    mesh      : TriangleMesh
    spacing   : mm along a border
    inset     : mm, how far inside the triangle a sample lies at most
    triangles : (k,) int indices of the triangles looked at

    Returns
    -------
    SurfaceSamples
        Along every edge of the chosen triangles whose other triangle belongs to another face.
    """
    f = mesh.faces
    ends = np.sort(np.stack([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]], axis=1).reshape(-1, 2), axis=1)
    key = ends[:, 0].astype(np.int64) * len(mesh.vertices) + ends[:, 1]
    _, group = np.unique(key, return_inverse=True)
    face = np.repeat(mesh.face_ids, 3).astype(np.int64)
    least = np.full(group.max() + 1, np.iinfo(np.int64).max)
    most = np.full(group.max() + 1, np.iinfo(np.int64).min)
    np.minimum.at(least, group, face)
    np.maximum.at(most, group, face)
    border = (least != most)[group].reshape(-1, 3)
    chosen = np.zeros(len(f), np.bool_)
    chosen[triangles] = True
    tri, side = np.nonzero(border & chosen[:, None])
    a, b = mesh.vertices[f[tri, side]], mesh.vertices[f[tri, (side + 1) % 3]]
    apex = mesh.vertices[f[tri, (side + 2) % 3]]
    count = np.maximum(1, np.ceil(np.linalg.norm(b - a, axis=1) / spacing)).astype(np.int64)
    row = np.repeat(np.arange(len(tri)), count)
    place = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    t = ((place + 0.5) / count[row])[:, None]
    on = a[row] + t * (b[row] - a[row])
    inward = apex[row] - on
    length = np.linalg.norm(inward, axis=1, keepdims=True)
    points = on + inward * np.minimum(inset / np.maximum(length, 1e-12), 0.3)
    return SurfaceSamples(np.ascontiguousarray(points), np.ascontiguousarray(mesh.normals[tri[row]]),
                          np.zeros(len(row)), mesh.face_ids[tri[row]], tri[row].astype(np.int32))


def joined(parts: list[SurfaceSamples]) -> SurfaceSamples:
    """Several sets of samples as one, in order."""
    return SurfaceSamples(np.concatenate([p.points for p in parts]), np.concatenate([p.normals for p in parts]),
                          np.concatenate([p.area for p in parts]), np.concatenate([p.face for p in parts]),
                          np.concatenate([p.triangle for p in parts]))
