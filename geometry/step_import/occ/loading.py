"""STEP file -> Part, in this process. Call it inside a child."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from OCP.gp import gp_Trsf
from OCP.TopLoc import TopLoc_Location

from geometry.errors import PartError
from geometry.mesh import F64
from geometry.part import EdgeInfo, FaceInfo, OtherSolid, Part
from geometry.setup_frame import SetupFrame
from geometry.step_import.box_cover import box_cover
from geometry.step_import.occ.curvature import face_info, surface_name
from geometry.step_import.occ.edges import edge_infos
from geometry.step_import.occ.meshing import SolidMesh, mesh_solid
from geometry.step_import.occ.reading import StepShape, read_shape
from geometry.step_import.occ.sizes import REFUSE_ABOVE, REFUSE_BELOW, check_size, doubts
from geometry.step_import.occ.solid.healing import Body, one_solid, swept_as_splines
from geometry.step_import.occ.topology import Shape, box_of, exact_volume, faces_of, quick_box
from geometry.step_import.occ.triangulating import triangulate
from geometry.step_import.reader import check_tolerances

# Modelling tolerance (mm) of a file that names none, and the range in which a named one is accepted.
USUAL_TOLERANCE, TOLERANCE_RANGE = 1e-3, (1e-5, 0.05)
# A mesh off by d everywhere changes the volume by area * d. A change this many times larger has another cause.
VOLUME_ROOM = 2.0
# Boxes that hold the other solids of a file: of all, of each, and faces of a solid from which on it is one box. The
# mesh that they are found on: chord as a share of the diagonal, and angle (rad).
MAX_BOXES, BOXES_EACH, MAX_FACES = 120, 40, 500
COVER_CHORD, COVER_ANGLE = 2e-3, 0.3


@dataclass(frozen=True)
class LoadedSolid:
    """The one solid of a file.

    step     : StepShape, the file
    body     : kernel solid, STEP coordinates, mm
    surfaces : kind of surface of each face in the file
    warnings : doubts and changes, as sentences; later stages append
    others   : the other bodies of the file with their numbers
    """

    step: StepShape
    body: Shape
    surfaces: list[str]
    warnings: list[str]
    others: list[tuple[int, Body]]


def load_solid(path: str | Path, solid: int | None = None, fuse: bool = False) -> LoadedSolid:
    """Read a file and heal it into one solid; errors are those of ``geometry.step_import.reader.read_part``."""
    step = read_shape(path)
    warnings = list(step.warnings)
    _check_size(step.shape, step)
    body, others = one_solid(step.products, solid, warnings, fuse=fuse,
                             uncertainty=0.0 if step.text.uncertainty is None else _tolerance(step))
    _check_size(body, step)
    surfaces = [surface_name(f) for f in faces_of(body)]
    return LoadedSolid(step, swept_as_splines(body), surfaces, warnings, others)


def load_part(path: str | Path, *, placement: SetupFrame | None = None, solid: int | None = None,
              fuse: bool = False, chord: float = 0.002, angle: float = 0.2) -> Part:
    """The work of ``geometry.step_import.reader.read_part`` in this process, with its arguments and errors.

    Nothing limits time or memory here.
    """
    check_tolerances(chord, angle)
    return part_of(load_solid(path, solid, fuse), placement=placement, chord=chord, angle=angle)


def part_of(loaded: LoadedSolid, *, placement: SetupFrame | None, chord: float, angle: float) -> Part:
    """The part of a solid that is loaded; arguments and errors as of ``load_part``."""
    step, body, warnings = loaded.step, loaded.body, loaded.warnings
    mesh = mesh_solid(body, chord, angle)
    warnings += mesh.warnings
    tolerance = _tolerance(step)
    faces = tuple(face_info(i + 1, f, loaded.surfaces[i], mesh.faces[i], tolerance)
                  for i, f in enumerate(faces_of(body)))
    edges = edge_infos(body, mesh, warnings)
    area = sum(f.area for f in faces)
    volume = _volume(body, mesh, VOLUME_ROOM * area * max(chord, mesh.deviation), warnings)
    warnings += _slivers(faces, tolerance)
    warnings += doubts(mesh.mesh.bounds, volume, area, step.unit, step.factor, step.text.products)
    matrix = (placement or SetupFrame()).matrix
    check_size(mesh.mesh.bounds, step.unit, step.factor)
    moved = mesh.mesh.transformed(matrix)
    return Part(mesh=moved, faces=faces, edges=tuple(_moved(e, matrix) for e in edges), volume=volume,
                bounds=moved.bounds, unit=step.unit, chord=chord, angle=angle, deviation=mesh.deviation,
                warnings=tuple(dict.fromkeys(warnings)), sha256=step.text.sha256, uv=mesh.uv,
                others=tuple(_other(n, b.name, _placed(b.shape, matrix), MAX_BOXES // len(loaded.others))
                             for n, b in loaded.others))


def _other(number: int, name: str, shape: Shape, most: int) -> OtherSolid:
    """Another solid of the file, in the setup frame, held by at most ``most`` boxes."""
    bounds, faces = box_of(shape), faces_of(shape)
    if most < 2 or len(faces) > MAX_FACES:
        return OtherSolid(number, name, bounds)
    chord = COVER_CHORD * float(np.linalg.norm(bounds[1] - bounds[0]))
    try:
        meshes = triangulate(shape, chord, COVER_ANGLE)
    except PartError:  # a body that cannot be meshed is no part; the box round it holds it
        return OtherSolid(number, name, bounds)
    plane = [np.full(len(m.triangles), surface_name(f) == "plane") for m, f in zip(meshes, faces, strict=True)]
    triangles = np.concatenate([m.nodes[m.triangles] for m in meshes])
    boxes = box_cover(triangles, np.concatenate(plane), 2.0 * chord, bounds, min(most, BOXES_EACH))
    return OtherSolid(number, name, bounds, boxes if len(boxes) > 1 else np.zeros((0, 2, 3)))


def _placed(shape: Shape, matrix: F64) -> Shape:
    """The shape in the setup frame; matrix : (4, 4) float64, mm, from STEP coordinates to it."""
    turn = gp_Trsf()
    turn.SetValues(*matrix[:3].ravel().tolist())
    return shape.Moved(TopLoc_Location(turn))


def _check_size(shape: Shape, step: StepShape) -> None:
    """Check the size before healing, which takes long on a shape of absurd size, and after it."""
    rough = quick_box(shape)
    # the rough box is never too small; on free-form faces it is rarely more than twice too large
    if not 10.0 * REFUSE_BELOW <= (rough[1] - rough[0]).max() <= REFUSE_ABOVE:
        check_size(box_of(shape), step.unit, step.factor)


def _tolerance(step: StepShape) -> float:
    named = step.text.uncertainty
    return USUAL_TOLERANCE if named is None else float(np.clip(named * step.factor, *TOLERANCE_RANGE))


def _volume(body: Shape, mesh: SolidMesh, room: float, warnings: list[str]) -> float:
    exact, meshed = exact_volume(body), mesh.mesh.volume
    if abs(exact - meshed) > room + 1e-6 * abs(meshed):
        warnings.append(f"the exact solid has {exact:.6g} mm³, but its mesh encloses {meshed:.6g} mm³; "
                        "the volume of the mesh is used")
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
