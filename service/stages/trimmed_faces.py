"""The exact faces that zones are parts of, trimmed, in the frames their passes are laid in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from geometry.mesh import F64, I32
from geometry.part import EdgeKind
from geometry.step_import.face_surfaces import read_patches
from geometry.trimming.trim import trim_faces
from service.part_reading import PartReading
from service.stages.preparation import Prepared
from toolpath.passes.trimmed_faces import Faces, TangentFaces, TrimmedFace
from toolpath.strategies.isoparametric import suits
from zones.machinable_area import AreaForm

TURN = 1e-3  # rad between normals at a joint; beyond it two faces are not one sheet
WIDE = 1e3  # mm between the places where a face is searched for a change of label; there is none


def trimmed_faces(path: Path, ready: Prepared, reading: PartReading | None = None) -> dict[str, tuple[Faces, ...]]:
    """The exact faces of every steep or shallow zone, by id of the zone, in the frame of its access.

    Faces of a zone that join smoothly form one sheet. Planes are left out, except on steep zones where tools may tilt;
    there each plane is a sheet of its own. Tools without a corner radius get passes only there, by their flank.

    path    : the STEP file that ``ready`` was read from
    reading : its reading, which may have read the exact faces
    """
    curved = {f.number for f in ready.part.faces if f.surface != "plane"}
    leans = ready.inputs.turns and ready.inputs.machine.simultaneous
    wanted = [z for z in ready.zones
              if z.form is not AreaForm.LEVEL and suits(z.tool) or leans and z.form is AreaForm.STEEP]
    flat = {f for z in wanted if leans and z.form is AreaForm.STEEP for f in z.faces} - curved
    numbers = sorted({f for z in wanted for f in z.faces} & curved | flat)
    if not numbers:
        return {}
    exact = None if reading is None else reading.faces()
    if exact is None or not exact.keys() >= set(numbers):
        exact = read_patches(path, numbers, placement=ready.inputs.placement, solid=ready.inputs.solid,
                             fuse=ready.inputs.fuse)
    pieces = trim_faces(ready.part, numbers, _whole, WIDE)[0]
    uv = np.array(ready.part.uv)
    for f in numbers:
        patch = exact[f]
        rows = ready.part.mesh.face_ids == f
        uv[rows] = patch.parameters(uv[rows].reshape(-1, 2)).reshape(-1, 3, 2)
    smooth = [e.faces for e in ready.part.edges if e.kind is EdgeKind.SMOOTH and abs(e.angle) < TURN]
    there: dict[str, dict[int, list[TrimmedFace]]] = {}
    joined: dict[tuple[str, tuple[int, ...]], TangentFaces] = {}
    out: dict[str, tuple[Faces, ...]] = {}
    for access in {z.access for z in wanted}:
        turn = np.eye(4)
        turn[:3, :3] = ready.view(access).rotation
        own = there[access] = {}
        for p in pieces:
            patch = exact[p.face]
            loops = tuple(patch.parameters(loop) for loop in p.loops)
            own.setdefault(p.face, []).append(TrimmedFace(p.face, patch.surface.moved(turn), loops, p.area,
                                                              p.face in flat))
    for z in wanted:
        mine: list[Faces] = []
        for group in _together([f for f in z.faces if f in there[z.access] and f in curved], smooth):
            alone = tuple(face for f in group for face in there[z.access][f])
            if len(group) == 1 or len(alone) > len(group):  # a face in pieces is not one sheet with others
                mine += alone
                continue
            key = z.access, group
            if key not in joined:
                joined[key] = TangentFaces(alone, ready.view(z.access).part.mesh, uv)
            mine.append(joined[key])
        if z.form is AreaForm.STEEP:
            mine += [face for f in z.faces if f in flat for face in there[z.access].get(f, ())]
        out[z.id] = tuple(mine)
    return out


def exact_faces(faces: Faces) -> tuple[TrimmedFace, ...]:
    """The single faces of a sheet."""
    return faces.alone if isinstance(faces, TangentFaces) else (faces,) if isinstance(faces, TrimmedFace) else ()


def _together(faces: list[int], smooth: list[tuple[int, int]]) -> list[tuple[int, ...]]:
    """Groups of faces that smooth edges join, in the order of the faces."""
    place = {f: k for k, f in enumerate(faces)}
    pairs = np.array([(place[a], place[b]) for a, b in smooth if a in place and b in place and a != b]).reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(faces), len(faces)))
    group = connected_components(graph, directed=False)[1].tolist()
    return [tuple(f for f, g in zip(faces, group, strict=True) if g == k) for k in dict.fromkeys(group)]


def _whole(points: F64, _normals: F64, _face: I32) -> np.ndarray:
    return np.zeros(len(points), np.int64)
