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
