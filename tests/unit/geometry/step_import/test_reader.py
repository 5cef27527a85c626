"""The STEP reader on shapes whose truth is known in closed form."""

import re
from collections import Counter

import numpy as np
import pytest
import trimesh

from benchmarks.reach.exact_faces import ExactFaces
from geometry.errors import PartError
from geometry.mesh import TriangleMesh
from geometry.part import EdgeKind
from geometry.setup_frame import SetupFrame
from geometry.step_import.occ.holes import fill_slivers
from geometry.step_import.occ.loading import load_part, load_solid
from geometry.step_import.occ.meshing import count_open_edges
from geometry.step_import.reader import read_part
from tests.child_processes import running, started_since
from tests.step_files import real_part, write_step

cq = pytest.importorskip("cadquery")


def kinds(part):
    return Counter(str(e.kind) for e in part.edges)


def bracket():
    return cq.Workplane().box(20, 20, 5, centered=False).union(cq.Workplane().box(5, 20, 20, centered=False))


def test_box_through_the_child(tmp_path):
    path, before = write_step(cq.Workplane().box(10, 20, 30), tmp_path / "box.step"), running()
    part = read_part(path)
    assert part.volume == pytest.approx(6000.0, rel=1e-12)
    assert part.mesh.volume == pytest.approx(6000.0, rel=1e-12)
    assert np.allclose(part.bounds, [[-5, -10, -15], [5, 10, 15]], atol=1e-9)
    assert len(part.mesh.faces) == 12 and len(part.mesh.vertices) == 8
    assert (part.unit, part.warnings, part.deviation) == ("mm", (), pytest.approx(0.0, abs=1e-12))
    assert kinds(part) == {"convex": 12}
    assert all(e.angle == pytest.approx(np.pi / 2) for e in part.edges)
    assert started_since(before) == []


def test_child_and_own_process_agree(tmp_path):
    path = write_step(bracket().edges("|Y").fillet(1), tmp_path / "l.step")
    assert read_part(path).to_bytes() == load_part(path).to_bytes()


def test_face_ids_follow_the_faces(tmp_path):
    part = load_part(write_step(cq.Workplane().box(10, 20, 30), tmp_path / "box.step"))
    assert [f.number for f in part.faces] == [1, 2, 3, 4, 5, 6]
    for face in part.faces:
        rows = part.mesh.face_ids == face.number
        assert part.mesh.areas[rows].sum() == pytest.approx(face.area, rel=1e-12)
        assert np.ptp(part.mesh.normals[rows], axis=0) == pytest.approx(0, abs=1e-12)
        assert face.surface == "plane" and not face.sliver


@pytest.mark.parametrize(("unit", "word"), [("MM", "mm"), ("CM", "cm"), ("M", "m"), ("INCH", "inch")])
def test_units_give_the_same_part(tmp_path, unit, word):
    part = load_part(write_step(bracket(), tmp_path / "l.step", unit))
    assert part.unit == word
    assert part.volume == pytest.approx(3500.0, rel=1e-9)
    assert np.allclose(part.bounds, [[0, 0, 0], [20, 20, 20]], atol=1e-6)


def test_placement_moves_mesh_edges_and_bounds(tmp_path):
    path = write_step(bracket(), tmp_path / "l.step")
    frame = SetupFrame(origin=(1, 2, 3), z_axis=(0, 1, 0), x_axis=(0, 0, 1))
    here, there = load_part(path), load_part(path, placement=frame)
    assert np.allclose(there.bounds, [[-3, -1, -2], [17, 19, 18]], atol=1e-9)
    assert there.mesh.volume == pytest.approx(here.mesh.volume)
    back = there.mesh.transformed(frame.inverse)
    assert np.allclose(back.vertices, here.mesh.vertices, atol=1e-12)
    edge = there.edges[0].points @ frame.inverse[:3, :3].T + frame.inverse[:3, 3]
    assert np.allclose(edge, here.edges[0].points, atol=1e-12)


def test_bracket_has_one_concave_edge(tmp_path):
    part = load_part(write_step(bracket(), tmp_path / "l.step"))
    concave = [e for e in part.edges if e.kind is EdgeKind.CONCAVE]
    assert kinds(part) == {"convex": 17, "concave": 1}
    assert concave[0].angle == pytest.approx(-np.pi / 2) and concave[0].length == pytest.approx(20)
    assert np.allclose(concave[0].points[:, [0, 2]], 5.0, atol=1e-9)


def test_fillet_edges_are_smooth_and_bend_the_right_way(tmp_path):
    inner = load_part(write_step(bracket().edges("|Y").edges(cq.selectors.NearestToPointSelector((5, 10, 5))).fillet(2),
                                 tmp_path / "in.step"))
    outer = load_part(write_step(cq.Workplane().box(10, 10, 10).edges("|Z and >X and >Y").fillet(2),
                                 tmp_path / "out.step"))
    for part, low, high in ((inner, -0.5, 0.0), (outer, 0.0, 0.5)):
        assert kinds(part)["smooth"] == 2
        round_face = next(f for f in part.faces if f.surface == "cylinder")
        assert round_face.radius == pytest.approx(2.0)
        assert (round_face.curvature_min, round_face.curvature_max) == (pytest.approx(low), pytest.approx(high))


def test_hollow_sphere_bends_out_and_in(tmp_path):
    part = load_part(write_step(cq.Workplane().sphere(7).cut(cq.Workplane().sphere(3)), tmp_path / "s.step"),
                     chord=0.02)
    outside, inside = part.faces
    assert outside.curvature_min == pytest.approx(1 / 7) and outside.curvature_max == pytest.approx(1 / 7)
    assert inside.curvature_min == pytest.approx(-1 / 3) and inside.curvature_max == pytest.approx(-1 / 3)
    assert (outside.radius, inside.radius) == (pytest.approx(7), pytest.approx(3))
    assert part.volume == pytest.approx(4 / 3 * np.pi * (343 - 27), rel=1e-9)
    assert count_open_edges(part.mesh) == 0
    assert kinds(part) == {"smooth": 2}  # the seams


@pytest.mark.parametrize("shape", ["wall", "torus", "cone", "loft"])
@pytest.mark.parametrize("chord", [0.02, 0.005])
def test_mesh_keeps_its_chord_and_is_watertight(tmp_path, shape, chord):
    body = {"wall": lambda: cq.Workplane().spline([(0, 0), (15, 4), (30, -3), (45, 5), (60, 0)]).lineTo(60, 9)
            .lineTo(0, 9).close().extrude(20),
            "torus": lambda: cq.Solid.makeTorus(10, 3), "cone": lambda: cq.Solid.makeCone(8, 0, 12),
            "loft": lambda: cq.Workplane().circle(10).workplane(offset=15).ellipse(4, 7).loft()}[shape]()
    part = load_part(write_step(body, tmp_path / "p.step"), chord=chord)
    assert count_open_edges(part.mesh) == 0
    assert part.deviation <= 1.5 * chord
    assert part.mesh.volume == pytest.approx(part.volume, abs=1.5 * chord * sum(f.area for f in part.faces))
    assert not [w for w in part.warnings if "mesh" in w]


def test_measured_deviation_is_the_true_one(tmp_path):
    part = load_part(write_step(cq.Workplane().circle(10).extrude(5), tmp_path / "c.step"), chord=0.05, angle=1.5)
    side = part.mesh.triangles[part.mesh.face_ids == next(f.number for f in part.faces if f.surface == "cylinder")]
    centres = side.mean(axis=1)
    assert part.deviation == pytest.approx(np.abs(np.hypot(centres[:, 0], centres[:, 1]) - 10).max(), rel=1e-9)


def test_swept_wall_keeps_its_kind_and_few_triangles(tmp_path):
    wall = cq.Workplane().spline([(0, 0), (15, 4), (30, -3), (45, 5), (60, 0)]).lineTo(60, 9).lineTo(0, 9).close()
    part = load_part(write_step(wall.extrude(20), tmp_path / "w.step"), chord=0.005)
    assert [f.surface for f in part.faces].count("extrusion") == 1
    assert len(part.mesh.faces) < 2000 and part.deviation <= 0.0075
    line = cq.Workplane().spline([(0, 0), (15, 4), (30, -3), (45, 5), (60, 0)]).val()
    x, y, _ = np.array([p.toTuple() for p in line.positions(np.linspace(0, 1, 5001))]).T
    assert part.volume == pytest.approx(20 * (540 - np.trapezoid(y, x)), rel=1e-6)


def test_sliver_hole_is_closed_and_a_wide_one_is_not():
    box = trimesh.creation.box((10, 10, 0.01))
    narrow = int(np.argmin(box.area_faces))
    for k, closed in ((narrow, 1), (int(np.argmax(box.area_faces)), 0)):
        rest = np.delete(np.arange(12), k)
        mesh = TriangleMesh(box.vertices, box.faces[rest], rest + 1)
        filled, count = fill_slivers(mesh, chord=0.01)
        assert count == closed and count_open_edges(mesh) == 3
        if closed:
            assert count_open_edges(filled) == 0
            assert filled.volume == pytest.approx(1.0)


def test_overlapping_solids_become_one(tmp_path):
    two = cq.Compound.makeCompound([cq.Solid.makeBox(10, 10, 10),
                                    cq.Solid.makeBox(10, 4, 4, cq.Vector(5, 3, 3))])
    part = load_part(write_step(two, tmp_path / "two.step"))
    assert part.volume == pytest.approx(1000 + 5 * 16)
    assert any("fused" in w for w in part.warnings) and count_open_edges(part.mesh) == 0


def test_stray_sliver_is_dropped_by_name(tmp_path):
    two = cq.Compound.makeCompound([cq.Solid.makeBox(50, 50, 50), cq.Solid.makeBox(0.1, 0.1, 0.1, cq.Vector(70, 0, 0))])
    part = load_part(write_step(two, tmp_path / "two.step"))
    assert part.volume == pytest.approx(125_000)
    assert any("solid 2" in w and "stray" in w for w in part.warnings)


def test_named_solid_is_taken(tmp_path):
    two = cq.Compound.makeCompound([cq.Solid.makeBox(10, 10, 10), cq.Solid.makeBox(5, 5, 5, cq.Vector(30, 0, 0))])
    path = write_step(two, tmp_path / "two.step")
    first = load_part(path, solid=1)
    assert first.volume == pytest.approx(1000)
    assert any("solid 1 of 2 is the part" in w and "fixture" in w for w in first.warnings)
    assert load_part(path, solid=2).volume == pytest.approx(125)


def test_loose_faces_are_sewn(tmp_path):
    faces = cq.Compound.makeCompound(cq.Workplane().box(10, 20, 30).faces().vals())
    part = load_part(write_step(faces, tmp_path / "faces.step"))
    assert part.volume == pytest.approx(6000) and kinds(part) == {"convex": 12}
    assert any("sewn" in w for w in part.warnings)


def test_exact_normals_and_curvature(tmp_path):
    path = write_step(cq.Solid.makeTorus(10, 3), tmp_path / "t.step")
    frame = SetupFrame(origin=(0, 0, 5), z_axis=(0, 1, 0), x_axis=(1, 0, 0))
    points = np.array([[13.5, 0, 0], [6.5, 0, 0], [10, 0, 3.2]])  # STEP: outside, hole, top
    there = points @ frame.matrix[:3, :3].T + frame.matrix[:3, 3]
    exact = ExactFaces(path, placement=frame)
    found = exact.evaluate(1, there)
    expected = np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 1]]) @ frame.matrix[:3, :3].T
    assert np.allclose(found.normals, expected, atol=1e-9)
    assert np.allclose(found.curvature, [[1 / 13, 1 / 3], [-1 / 7, 1 / 3], [0, 1 / 3]], atol=1e-9)
    assert np.allclose(found.distance, [0.5, 0.5, 0.2], atol=1e-9)
    ring = np.array([[0, 1, 0], [0, 1, 0], [0, 1, 0]]) @ frame.matrix[:3, :3].T
    assert np.allclose(np.abs(np.einsum("ij,ij->i", found.directions[:, 0], ring)), 1.0, atol=1e-9)
    faces = np.ones(3, np.int32)
    assert np.array_equal(exact.normals(faces, there), found.normals)
    assert np.array_equal(exact.curvature(faces, there), found.curvature)


def test_small_part_is_warned_about_with_a_factor(tmp_path):
    part = load_part(write_step(cq.Workplane().box(1.5, 1, 1), tmp_path / "p.step"))
    assert any("unit" in w and "factor" in w for w in part.warnings)


def test_inch_propeller():
    part = load_part(real_part("blade_seed_propeller.stp"), chord=0.02)
    assert part.unit == "inch"
    assert np.allclose(part.bounds[1] - part.bounds[0], [19.76, 7.36, 218.76], atol=0.03)
    assert count_open_edges(part.mesh) == 0 and part.deviation <= 0.03


def damaged(tmp_path, pattern, by):
    """A plate of 20 x 20 x 5 mm with a hole of 6 mm; ``by`` replaces what the group of the pattern finds."""
    path = write_step(cq.Workplane().box(20, 20, 5).faces(">Z").workplane().hole(6), tmp_path / "plate.step")
    text = path.read_text()
    assert load_part(path).warnings == () and re.search(pattern, text)
    path.write_text(re.sub(pattern, lambda m: m[0].replace(m[1], by), text))
    return path


@pytest.mark.parametrize(("pattern", "by", "off", "subject"), [
    (r"CYLINDRICAL_SURFACE\('',#\d+,(3\.)\)", "30.", 27.0, "F7"),
    (r"CYLINDRICAL_SURFACE\('',#\d+,(3\.)\)", "3.2", 0.2, "F7"),
    # a corner, with whatever else stands there: 11 and 12 mm off the upright edge through it
    (r"CARTESIAN_POINT\('',\((-10\.,-10\.,2\.5)\)\)", "1.,2.,2.", np.hypot(11, 12), "F1")])
def test_faces_that_do_not_meet_are_refused_with_their_place(tmp_path, pattern, by, off, subject):
    with pytest.raises(PartError) as caught:
        load_solid(damaged(tmp_path, pattern, by))
    error = caught.value
    assert error.code == "inconsistent_faces" and subject in error.subjects and error.limit == 0.1
    assert error.measured == pytest.approx(off, abs=1e-3)
    assert re.search(r" by [\d.]+ mm at \([-\d., ]+\) in STEP coordinates", error.message) and error.remedy


def test_faces_that_nearly_meet_are_told(tmp_path):
    def told(path):
        return [w for w in load_solid(path).warnings if "meet" in w]

    radius = r"CYLINDRICAL_SURFACE\('',#\d+,(3\.)\)"
    (warning,) = told(damaged(tmp_path, radius, "3.05"))
    assert "an edge lies off F7 by 0.05 mm at (" in warning
    assert not told(damaged(tmp_path, radius, "3.005"))
    # a file may state that its lengths are no better
    loose = damaged(tmp_path, radius, "3.15")
    loose.write_text(re.sub(r"(UNCERTAINTY_MEASURE_WITH_UNIT\(LENGTH_MEASURE\()[^)]*", r"\g<1>0.02", loose.read_text()))
    assert not told(loose)


@pytest.mark.slow
def test_compressor_wheel_is_fused_and_its_stray_dropped():
    before = running()
    part = read_part(real_part("imp_kj66_compressor_wheel.step"), chord=0.05,
                     placement=SetupFrame(z_axis=(0, 1, 0), x_axis=(1, 0, 0)))
    assert part.deviation <= 0.075 and count_open_edges(part.mesh) == 0
    assert any("stray" in w for w in part.warnings) and any("fused into 1" in w for w in part.warnings)
    assert 65_534 < part.volume < 78_553
    assert started_since(before) == []
