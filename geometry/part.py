"""The part for every later stage: plain arrays in the setup frame, mm.

A ``Part`` is made in a child process (``geometry.step_import.reader``) and travels as arrays;
nothing downstream touches OCP objects.
"""

from __future__ import annotations

import io
import json
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32, TriangleMesh


class EdgeKind(StrEnum):
    """How two faces meet along an edge, seen from outside the material."""

    CONVEX = "convex"
    CONCAVE = "concave"
    SMOOTH = "smooth"
    BOUNDARY = "boundary"


@dataclass(frozen=True)
class FaceInfo:
    """One B-rep face.

    number     : 1-based, the ``12`` of ``F12``; order of the STEP file
    surface    : 'plane', 'cylinder', 'cone', 'sphere', 'torus', 'bspline', 'bezier', 'revolution',
                 'extrusion', 'offset' or 'other'
    area       : mm²
    sliver     : narrower than ten times the modelling tolerance of the file
    curvature_min, curvature_max : least and greatest principal curvature over a sample grid of the
                 face, 1/mm, positive where the MATERIAL is convex (ball: 1/R outside, -1/R inside)
    radius     : mm for cylinder, sphere, cone (at mid), minor radius for torus; None otherwise
    """

    number: int
    surface: str
    area: float
    sliver: bool
    curvature_min: float
    curvature_max: float
    radius: float | None = None

    @property
    def id(self) -> str:
        return f"F{self.number}"


@dataclass(frozen=True)
class EdgeInfo:
    """One B-rep edge between two faces.

    faces     : numbers of the two faces (equal for a seam)
    kind      : convex, concave, smooth (normals within 5 degrees along most of it) or boundary
    length    : mm
    angle     : rad, mean angle between the outward normals; positive convex, negative concave
    points    : (k, 3) float64, mm, points along the edge, ends included
    """

    faces: tuple[int, int]
    kind: EdgeKind
    length: float
    angle: float
    points: F64


@dataclass(frozen=True, eq=False)
class OtherSolid:
    """A solid of the file that is not the part.

    number : 1-based, among the separate solids of the file
    name   : of its products, '' for none
    bounds : (2, 3) float64, mm, setup frame
    boxes  : (k, 2, 3) float64, mm, setup frame, boxes that together hold it; empty: the one box of ``bounds``
    """

    number: int
    name: str
    bounds: F64
    boxes: F64 = field(default_factory=lambda: np.zeros((0, 2, 3)))

    @property
    def held_by(self) -> F64:
        """(k, 2, 3) float64, mm, setup frame: boxes that together hold it, one at least."""
        return self.boxes if len(self.boxes) else self.bounds[None]

    def __str__(self) -> str:
        return f"solid {self.number}" + (f" ({self.name})" if self.name else "")


@dataclass(frozen=True, eq=False)
class Part:
    """A solid, ready to plan, in the setup frame (Z up, mm).

    mesh      : TriangleMesh, chord within ``chord`` and angle within ``angle`` of the exact surface, with the normals
                of that surface at the corners
    faces     : FaceInfo per face, numbers 1..n in order
    edges     : EdgeInfo
    volume    : mm³ of the exact solid
    bounds    : (2, 3) float64, mm
    unit      : length unit of the file, for example 'mm' or 'inch'
    chord, angle : mm and rad, requested tolerances of the mesh
    deviation : mm, largest measured distance from triangle centres to the exact surface
    warnings  : sentences for the report (slivers, healed edges, doubtful units, fused solids)
    sha256    : hex digest of the bytes of the STEP file
    uv        : (m, 3, 2) float64, surface parameters (u, v) of the corners of every triangle on its own face, never
                NaN. They belong to the solid after import: converted to mm, swept surfaces turned into splines. Both
                sides of a seam have their own values, so no triangle jumps by a period. None for a part without B-rep
    others    : the other solids of the file, where ``part.solid`` of the setup chose one of several
    """

    mesh: TriangleMesh
    faces: tuple[FaceInfo, ...]
    edges: tuple[EdgeInfo, ...]
    volume: float
    bounds: F64
    unit: str
    chord: float
    angle: float
    deviation: float
    warnings: tuple[str, ...]
    sha256: str
    uv: F64 | None = None
    others: tuple[OtherSolid, ...] = ()

    def to_bytes(self) -> bytes:
        """Serialise without pickle (an .npz in memory)."""
        meta = {
            "faces": [asdict(f) for f in self.faces],
            "edges": [{"faces": e.faces, "kind": str(e.kind), "length": e.length, "angle": e.angle}
                      for e in self.edges],
            "volume": self.volume, "unit": self.unit, "chord": self.chord, "angle": self.angle,
            "deviation": self.deviation, "warnings": list(self.warnings), "sha256": self.sha256,
            "others": [(o.number, o.name, o.bounds.tolist(), o.boxes.tolist()) for o in self.others],
        }
        sizes = np.array([len(e.points) for e in self.edges], dtype=np.int64)
        points: NDArray[np.float64] = np.concatenate([e.points for e in self.edges]) if self.edges else np.zeros((0, 3))
        optional: dict[str, Any] = {"uv": self.uv, "corner_normals": self.mesh.corner_normals}
        optional = {name: values for name, values in optional.items() if values is not None}
        out = io.BytesIO()
        np.savez(out, vertices=self.mesh.vertices, triangles=self.mesh.faces, face_ids=self.mesh.face_ids,
                 bounds=self.bounds, edge_sizes=sizes, edge_points=points,
                 meta=np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8), **optional)
        return out.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> Part:
        """The part that ``to_bytes`` wrote."""
        with np.load(io.BytesIO(data), allow_pickle=False) as z:
            meta = json.loads(z["meta"].tobytes())
            cuts = np.concatenate([[0], np.cumsum(z["edge_sizes"])])
            pts = z["edge_points"]
            edges = tuple(
                EdgeInfo(tuple(e["faces"]), EdgeKind(e["kind"]), e["length"], e["angle"], pts[cuts[i]:cuts[i + 1]])
                for i, e in enumerate(meta["edges"])
            )
            mesh = TriangleMesh(z["vertices"], z["triangles"], z["face_ids"],
                                z["corner_normals"] if "corner_normals" in z else None)
            bounds = z["bounds"]
            uv = z["uv"] if "uv" in z else None
        return cls(mesh, tuple(FaceInfo(**f) for f in meta["faces"]), edges, meta["volume"], bounds, meta["unit"],
                   meta["chord"], meta["angle"], meta["deviation"], tuple(meta["warnings"]), meta["sha256"], uv,
                   tuple(OtherSolid(n, name, np.array(box), np.array(boxes).reshape(-1, 2, 3))
                         for n, name, box, boxes in meta["others"]))


__all__ = ["F64", "I32", "EdgeInfo", "EdgeKind", "FaceInfo", "OtherSolid", "Part"]
