"""STEP file -> Part, in this process. Call it inside a child."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry.frames import Placement
from geometry.occ.curvature import face_info
from geometry.occ.edges import edge_infos
from geometry.occ.healing import one_solid
from geometry.occ.meshing import SolidMesh, mesh_solid
from geometry.occ.reading import StepShape, read_shape
from geometry.occ.sizes import check_size, doubts
from geometry.occ.topology import Shape, box_of, faces_of, volume_of
from geometry.part import EdgeInfo, FaceInfo, Part
from geometry.step import check_tolerances

# Modelling tolerance (mm) taken when the file names none, and the range in which a named one is believed.
USUAL_TOLERANCE, TOLERANCE_RANGE = 1e-3, (1e-5, 0.05)
# Mesh and exact volume further apart than this share mean that one of them is wrong.
VOLUME_SHARE = 1e-3


def load_solid(path: str | Path, solid: int | None = None) -> tuple[StepShape, Shape, list[str]]:
    """Read and heal: the file, its one solid (kernel shape, STEP coordinates in mm) and what was done to it."""
    step = read_shape(path)
    warnings = list(step.warnings)
    check_size(box_of(step.shape), step.unit, step.factor)
    body = one_solid(step.shape, solid, warnings)
    check_size(box_of(body), step.unit, step.factor)
    return step, body, warnings


def load_part(path: str | Path, *, placement: Placement | None = None, solid: int | None = None,
              chord: float = 0.002, angle: float = 0.2) -> Part:
    """The work behind ``geometry.step.read_part``, in this process; arguments and errors are those of ``read_part``
    except that nothing limits time or memory here."""
    check_tolerances(chord, angle)
    step, body, warnings = load_solid(path, solid)
    mesh = mesh_solid(body, chord, angle)
    warnings += mesh.warnings
    tolerance = _tolerance(step)
    faces = tuple(face_info(i + 1, f, mesh.faces[i], tolerance) for i, f in enumerate(faces_of(body)))
    edges = edge_infos(body, mesh, warnings)
    volume = _volume(body, mesh, warnings)
    warnings += _slivers(faces, tolerance)
    warnings += doubts(mesh.mesh.bounds, volume, sum(f.area for f in faces), step.unit, step.factor,
                       step.text.products)
    matrix = (placement or Placement()).matrix
    moved = mesh.mesh.transformed(matrix)
    return Part(mesh=moved, faces=faces, edges=tuple(_moved(e, matrix) for e in edges), volume=volume,
                bounds=moved.bounds, unit=step.unit, chord=chord, angle=angle, deviation=mesh.deviation,
                warnings=tuple(dict.fromkeys(warnings)), sha256=step.text.sha256)


def _tolerance(step: StepShape) -> float:
    named = step.text.uncertainty
    return USUAL_TOLERANCE if named is None else float(np.clip(named * step.factor, *TOLERANCE_RANGE))


def _volume(body: Shape, mesh: SolidMesh, warnings: list[str]) -> float:
    exact, meshed = volume_of(body), mesh.mesh.volume
    if abs(exact - meshed) > VOLUME_SHARE * abs(meshed):
        warnings.append(f"the exact solid claims {exact:.6g} mm³ and its mesh encloses {meshed:.6g} mm³; "
                        "the mesh is believed")
        return meshed
    return exact


def _slivers(faces: tuple[FaceInfo, ...], tolerance: float) -> list[str]:
    ids = [f.id for f in faces if f.sliver]
    if not ids:
        return []
    more = f" and {len(ids) - 20} more" if len(ids) > 20 else ""
    return [f"{len(ids)} faces are slivers, narrower than {10 * tolerance:.3g} mm: {', '.join(ids[:20])}{more}"]


def _moved(edge: EdgeInfo, matrix: np.ndarray) -> EdgeInfo:
    return EdgeInfo(edge.faces, edge.kind, edge.length, edge.angle, edge.points @ matrix[:3, :3].T + matrix[:3, 3])
