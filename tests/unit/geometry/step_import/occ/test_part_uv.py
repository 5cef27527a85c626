"""The surface parameters a part carries, against the exact surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

cq = pytest.importorskip("cadquery")

from OCP.BRep import BRep_Tool  # noqa: E402
from OCP.BRepAdaptor import BRepAdaptor_Surface  # noqa: E402
from OCP.TopAbs import TopAbs_VERTEX  # noqa: E402
from OCP.TopoDS import TopoDS  # noqa: E402

from geometry.mesh import TriangleMesh  # noqa: E402
from geometry.part import Part  # noqa: E402
from geometry.setup_frame import SetupFrame  # noqa: E402
from geometry.step_import.occ.holes import extend_parameters  # noqa: E402
from geometry.step_import.occ.loading import load_part, load_solid  # noqa: E402
from geometry.step_import.occ.meshing import mesh_solid  # noqa: E402
from geometry.step_import.occ.topology import edges_of, faces_of, sub_shapes  # noqa: E402
from tests.step_files import real_part, write_step  # noqa: E402


def wavy():
    top = cq.Workplane().moveTo(0, 0).spline([(5, 2), (10, -1), (20, 3)], includeCurrent=True)
    return top.lineTo(20, -8).lineTo(0, -8).close().extrude(6)


def rounded():
    return cq.Workplane().box(8, 6, 4).edges("|Z").fillet(1).val()


SHAPES = {
    "cylinder": lambda: cq.Solid.makeCylinder(4, 9),
    "cone to its tip": lambda: cq.Solid.makeCone(4, 0, 6),
    "sphere": lambda: cq.Solid.makeSphere(4, angleDegrees1=-90, angleDegrees2=90),
    "torus": lambda: cq.Solid.makeTorus(8, 2),
    "spline wall": wavy,
    "moved": lambda: rounded().moved(cq.Location((3, 2, 1), (1, 1, 0), 40)),
}
REAL = ("imp_kj66_compressor_wheel.step", "wall_nist_ftc_10_wavy.stp", "blade_seed_propeller.stp")


def misses(mesh: TriangleMesh, uv: np.ndarray, body: Any) -> tuple[float, float, float]:
    """Largest distance of vertices to the surface at their parameters: inside faces, on borders, what borders may."""
    inside = border = 0.0
    pairs = np.unique(np.stack([mesh.faces.ravel(), np.repeat(mesh.face_ids, 3)], axis=1), axis=0)
    owners = np.bincount(pairs[:, 0], minlength=len(mesh.vertices))
    for number, face in enumerate(faces_of(body), 1):
        rows = mesh.face_ids == number
        surface = BRepAdaptor_Surface(face, False)
        known = np.unique(np.column_stack([mesh.faces[rows].ravel(), uv[rows].reshape(-1, 2)]), axis=0)
        vertex = known[:, 0].astype(int)
        exact = np.array([surface.Value(u, v).Coord() for _, u, v in known])
        miss = np.linalg.norm(exact - mesh.vertices[vertex], axis=1)
        inside = max(inside, miss[owners[vertex] == 1].max(initial=0.0))
        border = max(border, miss[owners[vertex] > 1].max(initial=0.0))
    vertices = (TopoDS.Vertex_s(v) for v in sub_shapes(body, TopAbs_VERTEX))
    room = max([BRep_Tool.Tolerance_s(v) for v in vertices] + [BRep_Tool.Tolerance_s(e) for e in edges_of(body)])
    return inside, border, 2.0 * room


@pytest.mark.parametrize("name", SHAPES)
def test_surface_at_the_parameters_is_the_vertex(tmp_path, name):
    path = write_step(SHAPES[name](), tmp_path / "part.step")
    part = load_part(path, chord=0.01)
    inside, border, _ = misses(part.mesh, part.uv, load_solid(path).body)
    assert part.uv.shape == (len(part.mesh.faces), 3, 2) and np.isfinite(part.uv).all()
    assert inside < 1e-9 and border < 1e-6


@pytest.mark.parametrize("name", REAL)
def test_real_parts_miss_only_where_the_file_itself_does(name):
    """Inside a face to 1e-6 mm; on a border, where the vertex is the other face's, by twice the file's tolerance."""
    body = load_solid(real_part(name)).body
    solid = mesh_solid(body, 0.02, 0.2)
    inside, border, room = misses(solid.mesh, solid.uv, body)
    assert solid.uv.shape == (len(solid.mesh.faces), 3, 2) and np.isfinite(solid.uv).all()
    assert inside < 1e-6 and border < 1e-6 + room


@pytest.mark.parametrize("name", ["cylinder", "cone to its tip", "sphere", "torus"])
def test_no_triangle_jumps_over_a_seam(tmp_path, name):
    """A jump turns a triangle over in (u, v), or makes it half a period wide (at a pole u says nothing)."""
    part = load_part(write_step(SHAPES[name](), tmp_path / "part.step"), chord=0.01)
    for face in part.faces:
        uv = part.uv[part.mesh.face_ids == face.number]
        a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        assert (area > 0).all() or (area < 0).all()
        if face.surface in ("cylinder", "torus"):
            assert np.ptp(uv[..., 0], axis=1).max() < np.pi


def test_cylinder_has_angle_and_height(tmp_path):
    part = load_part(write_step(SHAPES["cylinder"](), tmp_path / "part.step"), chord=0.01)
    side = next(f.number for f in part.faces if f.surface == "cylinder")
    uv, p = part.uv[part.mesh.face_ids == side], part.mesh.triangles[part.mesh.face_ids == side]
    assert np.abs(uv[..., 1] - p[..., 2]).max() < 1e-9
    assert np.abs(np.stack([4 * np.cos(uv[..., 0]), 4 * np.sin(uv[..., 0])], -1) - p[..., :2]).max() < 1e-9


def test_placement_leaves_the_parameters_alone(tmp_path):
    path = write_step(SHAPES["moved"](), tmp_path / "part.step")
    turned = load_part(path, placement=SetupFrame((1, 2, 3), (0, 1, 0), (1, 0, 0)))
    assert (turned.uv == load_part(path).uv).all()


def test_inch_file_has_the_parameters_of_the_part_in_mm(tmp_path):
    shape = cq.Solid.makeCylinder(4, 9)
    inch, mm = (load_part(write_step(shape, tmp_path / f"{unit}.step", unit)) for unit in ("INCH", "MM"))
    side = next(f.number for f in mm.faces if f.surface == "cylinder")
    for part in (inch, mm):
        height = part.uv[part.mesh.face_ids == side][..., 1]
        assert (height.min(), height.max()) == pytest.approx((0.0, 9.0), abs=1e-6)


def test_parameters_survive_the_trip_as_bytes(tmp_path):
    part = load_part(write_step(SHAPES["torus"](), tmp_path / "part.step"), chord=0.05)
    again = Part.from_bytes(part.to_bytes())
    assert (again.uv == part.uv).all()
    bare = Part(part.mesh, part.faces, part.edges, part.volume, part.bounds, part.unit, part.chord, part.angle,
                part.deviation, part.warnings, part.sha256)
    assert Part.from_bytes(bare.to_bytes()).uv is None


def test_filled_sliver_copies_known_corners_and_projects_the_others():
    """Triangle 2 fills a hole: two corners stand on the face with two values each side of a seam, one does not."""
    mesh = TriangleMesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0]], float),
                        np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]]), np.array([1, 1, 1], np.int32))
    uv = np.array([[[0, 0], [1, 0], [1, 1]], [[9, 0], [9, 1], [8, 1]]], float)
    out = extend_parameters(mesh, uv, lambda face, point, start: point[:2] + 0.01 * face)
    assert (out[:2] == uv).all()
    assert np.allclose(out[2], [[1, 0], [2.01, 0.51], [1, 1]])
