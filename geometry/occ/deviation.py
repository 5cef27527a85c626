"""Distance from triangle centres to the exact surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Plane
from OCP.gp import gp_Pnt, gp_Vec

from geometry.mesh import F64
from geometry.occ.topology import Shape

if TYPE_CHECKING:
    from geometry.occ.meshing import FaceMesh

MAX_SAMPLES = 20_000
NEWTON_STEPS = 3


def largest_deviation(shapes: Sequence[Shape], faces: Sequence[FaceMesh]) -> float:
    """Largest distance from sampled triangle centres to their exact face.

    shapes : kernel faces
    faces  : FaceMesh of each

    Returns float, mm.
    Notes   at most some 20 000 triangles are measured, an even share of each face and always its largest ones. The
            distance to the surface point at the mean (u, v) of the corners bounds the true distance from above; a few
            Gauss-Newton steps towards the foot point bring the bound down, so the value is never too small for a
            sampled triangle. Centres are where a chord errs most on a smooth surface.
    """
    total = sum(len(f.triangles) for f in faces)
    worst = 0.0
    for shape, face in zip(shapes, faces, strict=True):
        surface = BRepAdaptor_Surface(shape, True)
        if surface.GetType() == GeomAbs_Plane:
            continue
        count = len(face.triangles)
        share = max(10, int(MAX_SAMPLES * count / max(total, 1)))
        worst = max(worst, _face_deviation(surface, face, _sample(face, min(share, count))))
    return worst


def _sample(face: FaceMesh, share: int) -> np.ndarray:
    t = face.nodes[face.triangles]
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    order = np.argsort(-area, kind="stable")
    spread = np.linspace(0, len(order) - 1, max(1, share // 2)).astype(int)
    return np.unique(np.concatenate([order[:share - share // 2], order[spread]]))


def _face_deviation(surface: BRepAdaptor_Surface, face: FaceMesh, rows: np.ndarray) -> float:
    corners = face.triangles[rows]
    centres, uv = face.nodes[corners].mean(axis=1), face.uv[corners].mean(axis=1)
    return max((_distance(surface, c, q) for c, q in zip(centres.tolist(), uv, strict=True)), default=0.0)


def _distance(surface: BRepAdaptor_Surface, centre: list[float], uv: F64) -> float:
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    u, v = float(uv[0]), float(uv[1])
    best = float("inf")
    for _ in range(NEWTON_STEPS):
        surface.D1(u, v, point, along_u, along_v)
        p, a, b = point.Coord(), along_u.Coord(), along_v.Coord()
        r = [centre[i] - p[i] for i in range(3)]
        here = (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) ** 0.5
        if here >= best:
            break
        better = best - here > 0.01 * here
        best = here
        aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
        determinant = aa * bb - ab * ab
        if not better or determinant <= 1e-18 * aa * bb:
            break
        ra, rb = _dot(r, a), _dot(r, b)
        u += (ra * bb - rb * ab) / determinant
        v += (rb * aa - ra * ab) / determinant
    return best


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
