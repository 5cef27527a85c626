"""The exact faces that zones are parts of, trimmed, in the frames their passes are laid in."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry.facepatches import read_patches
from geometry.mesh import F64, I32
from geometry.trim import trim_faces
from service.prepare import Prepared, placement_of
from toolpath.strategies.isoparametric import TrimmedFace
from zones.machinable import Form

WIDE = 1e3  # mm between places a face is looked at for a change of label, of which there is none


def trimmed_faces(path: Path, ready: Prepared) -> dict[str, tuple[TrimmedFace, ...]]:
    """The faces, planes left out, that every steep or shallow zone is part of, by its id, in the frame of its access.

    path : the STEP file ``ready`` was read from
    """
    curved = {f.number for f in ready.part.faces if f.surface != "plane"}
    wanted = [z for z in ready.zones if z.form is not Form.LEVEL and z.tool.corner_radius > 0.0]
    numbers = sorted({f for z in wanted for f in z.faces} & curved)
    if not numbers:
        return {}
    setup = ready.setup
    exact = read_patches(path, numbers, placement=placement_of(setup), solid=setup.part.solid)
    pieces = trim_faces(ready.part, numbers, _whole, WIDE)[0]
    there: dict[str, dict[int, list[TrimmedFace]]] = {}
    for access in {z.access for z in wanted}:
        turn = np.eye(4)
        turn[:3, :3] = ready.view(access).rotation
        own = there[access] = {}
        for p in pieces:
            patch = exact[p.face]
            loops = tuple(patch.parameters(loop) for loop in p.loops)
            own.setdefault(p.face, []).append(TrimmedFace(p.face, patch.surface.moved(turn), loops, p.area))
    return {z.id: tuple(face for f in z.faces for face in there[z.access].get(f, ())) for z in wanted}


def _whole(points: F64, _normals: F64, _face: I32) -> np.ndarray:
    return np.zeros(len(points), np.int64)
