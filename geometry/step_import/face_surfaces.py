"""The faces of a part as NURBS surfaces, by number, in the setup frame.

    patches = read_patches("wheel.step", [12, 13])
    patches[12].surface.curvature(patches[12].parameters(part.uv[part.mesh.face_ids == 12].reshape(-1, 2)))

A patch covers the rectangle of parameters that its face lies in. The borders of the face trim the patch.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.setup_frame import SetupFrame
from geometry.step_import.reader import ask_reader
from geometry.surfaces.nurbs import NurbsSurface


@dataclass(frozen=True, eq=False)
class FaceSurface:
    """A face as a NURBS surface over the rectangle of parameters it lies in.

    number    : 1-based, the ``12`` of ``F12``, as in ``read_part`` of the same file and solid
    surface   : NurbsSurface, mm, setup frame, its normal out of the material
    box       : (2, 2) float64, least and greatest (u, v) of the face in the parameters of ``Part.uv``
    angular   : whether u, v are angles (rad) in ``Part.uv``; arcs written as splines have other parameters
    deviation : float, mm, largest distance measured between the patch and the surface of the file
    """

    number: int
    surface: NurbsSurface
    box: F64
    angular: tuple[bool, bool]
    deviation: float

    @property
    def id(self) -> str:
        return f"F{self.number}"

    def parameters(self, uv: ArrayLike) -> F64:
        """Parameters of the patch at parameters of the face.

        uv : (n, 2) float64, rad, mm or dimensionless, parameters of the face as in ``Part.uv``
        Returns (n, 2) float64, dimensionless, mm or rad, parameters for ``surface``.

        Notes
        -----
        An arc of half angle a between two knots runs over 0..1 as t = (1 + tan(b / 2) / tan(a / 2)) / 2, b its angle
        from the middle. Elsewhere the parameters are the same.
        """
        out = finite_points(uv, 2, "uv").copy()
        for axis, knots in enumerate((self.surface.knots_u, self.surface.knots_v)):
            if self.angular[axis]:
                ends = np.unique(knots)
                span = np.clip(np.searchsorted(ends, out[:, axis], side="right") - 1, 0, len(ends) - 2)
                low, wide = ends[span], ends[span + 1] - ends[span]
                turn = np.tan((out[:, axis] - low - 0.5 * wide) / 2.0) / np.tan(wide / 4.0)
                out[:, axis] = low + wide * 0.5 * (1.0 + turn)
        return np.clip(out, *self.surface.domain)


def read_patches(path: str | os.PathLike[str], faces: Iterable[int] | None = None, *,
                 placement: SetupFrame | None = None, solid: int | None = None, fuse: bool = False,
                 time_limit: float = 120.0, memory_limit: float = 6e9) -> dict[int, FaceSurface]:
    """Faces of one solid of a STEP file as NURBS surfaces.

    path         : STEP file
    faces        : 1-based numbers, as in ``read_part``; all when None
    placement    : Placement, the setup frame in STEP coordinates (mm); the file's own frame when None
    solid        : int, 1-based number of one of several separate solids
    fuse         : bool, as in ``read_part``
    time_limit   : float, s of wall time
    memory_limit : float, bytes of resident memory

    Returns
    -------
    dict of FacePatch by number, in order
        Planes, cylinders, cones, spheres, tori and splines are exact. No spline equals an offset surface; its error is
        ``deviation``.

    Raises
    ------
    CamError
        The errors of ``geometry.step_import.reader.read_part`` about the file, its solids and the limits;
        GeometryError (``no_such_face``).
    """
    request = {"wanted": "patches", "path": os.path.abspath(path), "solid": solid, "fuse": fuse,
               "faces": None if faces is None else [int(f) for f in faces],
               "placement": placement.as_dict() if placement else None}
    return patches_from_bytes(ask_reader(request, time_limit, memory_limit))


def patches_to_bytes(patches: Iterable[FaceSurface]) -> bytes:
    """Patches without pickle (an .npz in memory), for a pipe between processes."""
    about: list[dict[str, Any]] = []
    arrays: dict[str, Any] = {}
    for p in patches:
        s = p.surface
        about.append({"number": p.number, "angular": p.angular, "deviation": p.deviation, "orders": s.orders,
                      "side": s.side, "rational": s.weights is not None})
        arrays |= {f"control{p.number}": s.control, f"u{p.number}": s.knots_u, f"v{p.number}": s.knots_v,
                   f"box{p.number}": p.box}
        if s.weights is not None:
            arrays[f"weights{p.number}"] = s.weights
    out = io.BytesIO()
    np.savez(out, about=np.frombuffer(json.dumps(about).encode(), dtype=np.uint8), **arrays)
    return out.getvalue()


def patches_from_bytes(data: bytes) -> dict[int, FaceSurface]:
    """The patches that ``patches_to_bytes`` wrote, by number."""
    out = {}
    with np.load(io.BytesIO(data), allow_pickle=False) as z:
        for a in json.loads(z["about"].tobytes()):
            n = a["number"]
            surface = NurbsSurface(z[f"control{n}"], z[f"u{n}"], z[f"v{n}"], tuple(a["orders"]),
                                   z[f"weights{n}"] if a["rational"] else None, a["side"])
            out[n] = FaceSurface(n, surface, z[f"box{n}"], tuple(a["angular"]), a["deviation"])
    return out


def no_such_face(number: int, count: int) -> GeometryError:
    """The error for a face number out of range."""
    return GeometryError(f"face F{number} does not exist; the solid has {count} faces", code="no_such_face",
                         subjects=(f"F{number}",), measured=number, limit=count,
                         remedy=f"give a number from 1 to {count}")
