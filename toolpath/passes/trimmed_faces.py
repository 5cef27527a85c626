"""Trimmed faces and the families of passes that can be laid on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from dataclasses import field as fresh
from functools import cached_property
from typing import ClassVar

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.parameterization.joined_faces import Joined
from geometry.parameterization.square_patches import Squared, squared
from geometry.surfaces.nurbs import NurbsSurface
from toolpath.passes.isoparametric_passes import Flank, IsoSurface, JoinedSurface, Laid, lay_out

LATTICE = 9  # places each way at which the rise of both families of passes is measured
LEVEL_GAIN = 0.5  # of the rise along the longer sides: passes along the shorter sides must rise less
LayoutKey = tuple[float, float, Flank | None]
Passes = tuple[Laid, F64]


@dataclass(frozen=True, eq=False)
class TrimmedFace:
    """A face on its exact surface.

    face    : number of the face
    surface : NurbsSurface, mm, access frame, its normal out of the material
    loops   : (k, 2) float64 each, parameters of the surface, closed, the outer one first
    area    : mm²
    flat    : it is a plane, which has other passes
    """

    face: int
    surface: NurbsSurface
    loops: tuple[F64, ...]
    area: float
    flat: bool = False
    _laid: dict[LayoutKey, list[Passes]] = fresh(default_factory=dict, repr=False)

    @cached_property
    def pieces(self) -> list[Squared]:
        """Its pieces over the unit square; a GeometryError where one folds in every trial."""
        d = self.surface.derivatives(self.loops[0])
        scale = float(np.linalg.norm(d.u, axis=1).mean()), float(np.linalg.norm(d.v, axis=1).mean())
        return squared(self.loops, scale)

    @property
    def over_square(self) -> list[Laid]:
        """The pieces with their surface."""
        return [IsoSurface(self.surface, p.map) for p in self.pieces]

    @property
    def name(self) -> str:
        """Its name in reports: F12."""
        return f"F{self.face}"

    @property
    def alone(self) -> tuple[TrimmedFace, ...]:
        """Substitutes where the face cannot be laid out: none."""
        return ()

    def passes(self, radius: float, scallop: float, flank: Flank | None) -> list[Passes]:
        """Each piece with the eta of its passes.

        radius, scallop : mm, of the tool's corner, and the allowed residual
        flank           : of the upright tool, on walls, where passes run along the more level sides; None: the longer
                          sides
        """
        key = radius, scallop, flank
        if key not in self._laid:
            self._laid[key] = _passes(self.over_square, *key)
        return self._laid[key]


@dataclass(frozen=True, eq=False)
class TangentFaces:
    """Faces that join smoothly and get common passes.

    alone : the faces, each for passes of its own
    mesh  : TriangleMesh of the part, access frame
    uv    : (m, 3, 2) float64, parameters on the surfaces of the corners of the facets of these faces, undefined
            elsewhere
    """

    alone: tuple[TrimmedFace, ...]
    mesh: TriangleMesh
    uv: F64
    flat: ClassVar[bool] = False
    _laid: dict[LayoutKey, list[Passes]] = fresh(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        """Their names in reports: F12 F13."""
        return " ".join(face.name for face in self.alone)

    @property
    def area(self) -> float:
        """mm²."""
        return sum(face.area for face in self.alone)

    @cached_property
    def pieces(self) -> list[JoinedSurface]:
        """Their pieces over the unit square; a GeometryError where they are no sheet, or fold."""
        joined = Joined.of(self.mesh, self.uv, {face.face: face.surface for face in self.alone})
        return [JoinedSurface.of(joined, p.map) for p in squared((joined.border,), (1.0, 1.0))]

    @property
    def over_square(self) -> list[Laid]:
        """The same."""
        return list(self.pieces)

    def passes(self, radius: float, scallop: float, flank: Flank | None) -> list[Passes]:
        """As for one face."""
        key = radius, scallop, flank
        if key not in self._laid:
            self._laid[key] = _passes(self.pieces, *key)
        return self._laid[key]


Faces = TrimmedFace | TangentFaces


def _passes(pieces: Sequence[Laid], radius: float, scallop: float, flank: Flank | None) -> list[Passes]:
    ways = [leveller(p) for p in pieces] if flank is not None else pieces
    return [(iso, lay_out(iso, radius, scallop, flank)) for iso in ways]


def leveller(iso: Laid) -> Laid:
    """A surface with passes along the longer sides, or along the others where those are far more level."""
    other = replace(iso, turned=True)
    return other if _rise(other) < LEVEL_GAIN * _rise(iso) else iso


def _rise(iso: Laid) -> float:
    """How steeply the passes go up or down: mm a mm, on average."""
    at = np.linspace(0.0, 1.0, LATTICE)
    xi, eta = np.meshgrid(at, at)
    place = iso.contact(xi.ravel(), eta.ravel())[0].reshape(LATTICE, LATTICE, 3)
    step = np.diff(place, axis=1)
    return float(np.abs(step[..., 2]).sum() / max(np.linalg.norm(step, axis=2).sum(), 1e-12))
