"""What must hold for any labelling of any part."""

from __future__ import annotations

import numpy as np
import pytest

import geometry.trimming.border_bending
import geometry.trimming.label_cuts
from geometry.part import Part
from geometry.trimming.trim import trim_faces
from tests.step_files import write_step
from tests.trim_parts import assert_partition, by_face, plane, saddle, tube, voronoi, wave, wrong_points

TOLERANCE = 1e-3
SHAPES = {"plane": plane, "tube": tube, "inner tube": lambda: tube(turned=True), "wave": wave, "saddle": saddle}


def solid(folder, name: str) -> Part:
    """A part read from STEP: poles, seams, holes, fillets."""
    cq = pytest.importorskip("cadquery")
    from geometry.step_import.occ.loading import load_part

    shapes = {
        "ball": lambda: cq.Solid.makeSphere(4, angleDegrees1=-90, angleDegrees2=90),
        "cone": lambda: cq.Solid.makeCone(4, 0, 6),
        "torus": lambda: cq.Solid.makeTorus(8, 2),
        "box": lambda: (cq.Workplane().box(16, 16, 6).edges("|Z").fillet(2).faces(">Z").workplane().hole(5)
                        .faces(">Z").shell(-1.2)),
    }
    return load_part(write_step(shapes[name](), folder / "part.step"), chord=0.01)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", SHAPES)
def test_random_cells_partition_a_surface(name, seed):
    part = SHAPES[name]()
    label = voronoi(part, 9, seed)
    found = trim_faces(part, None, label, 0.4, TOLERANCE)
    assert_partition(part, found)
    wrong = wrong_points(part, found, label, 4000)
    assert len(wrong) <= 8 and wrong.max(initial=0.0) <= 5 * TOLERANCE


@pytest.mark.parametrize("name", ["ball", "cone", "torus", "box"])
def test_random_cells_partition_a_solid(tmp_path, name):
    part = solid(tmp_path, name)
    label = voronoi(part, 12, 3)
    found = trim_faces(part, None, label, 0.4, TOLERANCE)
    assert_partition(part, found)
    assert sorted(by_face(found)) == [f.number for f in part.faces]
    wrong = wrong_points(part, found, label, 4000)
    assert len(wrong) <= 8 and wrong.max(initial=0.0) <= 5 * TOLERANCE
    directions = {f.number: f.surface for f in part.faces}
    for face, pieces in by_face(found).items():
        assert len({p.forward for _, p in pieces}) == 1
        assert all(p.whole == (len(pieces) == 1) for _, p in pieces) and face in directions


@pytest.mark.parametrize("name", ["tube", "saddle"])
def test_a_moved_part_gives_the_same_patches(name):
    part = SHAPES[name]()
    label = voronoi(part, 6, 1)
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn * np.linalg.det(turn), (30.0, -7.0, 4.0)
    moved = Part(part.mesh.transformed(matrix), part.faces, (), 0.0, part.bounds, "mm", 0.01, 0.2, 0.0, (), "", part.uv)

    def same(points, normals, face):
        return label((points - matrix[:3, 3]) @ matrix[:3, :3], normals @ matrix[:3, :3], face)

    one, two = trim_faces(part, None, label, 0.4), trim_faces(moved, None, same, 0.4)
    assert list(one) == list(two)
    for key in one:
        assert [p.area for p in one[key]] == pytest.approx([p.area for p in two[key]], abs=10 * TOLERANCE)


def disc_errors(pitches, tolerances):
    """Error of the area of a disc of 3 mm on a plane, mean over five places."""
    out = []
    for pitch, tolerance in zip(pitches, tolerances, strict=True):
        miss = []
        for x in (4.7, 4.81, 4.93, 5.07, 5.2):
            found = trim_faces(plane(), None, lambda p, n, f, x=x: (np.hypot(p[:, 0] - x, p[:, 1] - 5) < 3).astype(int),
                               pitch, tolerance)
            miss.append(abs(found[1][0].area - 9 * np.pi))
        out.append(np.mean(miss))
    return np.array(out)


def test_area_error_falls_with_the_square_of_the_pitch_while_cuts_are_straight(monkeypatch):
    monkeypatch.setattr(geometry.trimming.border_bending, "BEND_ROUNDS", 0)
    monkeypatch.setattr(geometry.trimming.label_cuts, "CURVE_ROUNDS", 0)
    pitches = np.array([1.0, 0.5, 0.25, 0.125])
    error = disc_errors(pitches, [1e-6] * 4)
    assert np.polyfit(np.log(pitches), np.log(error), 1)[0] == pytest.approx(2.0, abs=0.3)


def test_bent_cuts_keep_the_tolerance_whatever_the_pitch():
    tolerances = np.array([0.03, 0.01, 0.003, 0.001])
    for pitch in (0.25, 1.0):
        assert (disc_errors([pitch] * 4, tolerances) <= 6 * np.pi * tolerances).all()


def test_an_answer_does_not_depend_on_how_often_it_was_asked():
    part = saddle()
    label = voronoi(part, 8, 7)
    one, two = (trim_faces(part, None, label, 0.5) for _ in range(2))
    for a, b in zip(one.values(), two.values(), strict=True):
        for p, q in zip(a, b, strict=True):
            assert p.area == q.area and all((x == y).all() for x, y in zip(p.loops, q.loops, strict=True))
