"""Boxes that hold a solid: exact where its faces are square to the axes, near it elsewhere, and never less than it."""

import numpy as np
import pytest

from geometry.part import Part
from geometry.step_import.box_cover import box_cover
from geometry.step_import.occ.loading import load_part

cq = pytest.importorskip("cadquery")


def box(x, y, z, at=(0, 0, 0)):
    return cq.Workplane().box(x, y, z, centered=False).translate(at)


def other(tmp_path, body):
    """How a file with a plate and a body apart from it gives the body."""
    assembly = cq.Assembly()
    assembly.add(box(5, 5, 5, (200, 0, 0)), name="plate").add(body, name="clamp")
    path = tmp_path / "two.step"
    assembly.export(str(path))
    part = Part.from_bytes(load_part(path, solid=1).to_bytes())
    (found,) = part.others
    assert found.name == "clamp" and found.number == 2
    return found


def volume(boxes):
    return float(np.prod(boxes[:, 1] - boxes[:, 0], axis=1).sum())


def held(points, boxes):
    return ((points[:, None] >= boxes[:, 0] - 1e-6) & (points[:, None] <= boxes[:, 1] + 1e-6)).all(axis=2).any(axis=1)


def test_a_box_is_one_box_and_an_l_is_two(tmp_path):
    assert other(tmp_path, box(10, 6, 4)).held_by.tolist() == [[[0, 0, 0], [10, 6, 4]]]
    found = other(tmp_path, box(40, 10, 10).union(box(10, 10, 30)))
    assert np.allclose(found.bounds, [[0, 0, 0], [40, 10, 30]])
    assert np.allclose(sorted(found.boxes.tolist()), [[[0, 0, 0], [10, 10, 30]], [[10, 0, 0], [40, 10, 10]]], atol=1e-6)


def test_a_frame_keeps_its_opening(tmp_path):
    found = other(tmp_path, box(60, 40, 10).cut(box(40, 20, 10, (10, 10, 0))))
    assert volume(found.boxes) == pytest.approx(24000 - 8000, rel=1e-6)
    assert not held(np.array([[30.0, 20.0, 5.0], [10.001, 10.001, 9.0]]), found.boxes).any()


@pytest.mark.parametrize(("turned", "most"), [((0, 0, 1), 1.2), ((1, 0, 0), 1.2), ((1, 1, 1), 2.3)])
def test_a_cylinder_is_held_whole_and_its_corners_are_free(tmp_path, turned, most):
    found = other(tmp_path, cq.Workplane(cq.Solid.makeCylinder(10, 30, dir=cq.Vector(*turned))))
    axis = np.array(turned) / np.linalg.norm(turned)
    points = np.random.default_rng(4).uniform(*found.bounds, (20000, 3))
    along = points @ axis
    inside = (along > 0) & (along < 30) & (np.linalg.norm(points - along[:, None] * axis, axis=1) < 10)
    assert held(points[inside], found.boxes).all() and 1 < len(found.boxes) <= 40
    assert volume(found.boxes) < most * np.pi * 3000
    assert (found.boxes[:, 0] >= found.bounds[0] - 1e-9).all() and (found.boxes[:, 1] <= found.bounds[1] + 1e-9).all()


def test_few_boxes_are_coarse_and_one_is_the_box_round_it():
    sphere = cq.Workplane().sphere(10).val()
    nodes, rows = sphere.tessellate(0.05, 0.2)
    triangles = np.array([[nodes[k].toTuple() for k in row] for row in rows])
    bounds, plane = np.array([[-10.0] * 3, [10.0] * 3]), np.zeros(len(triangles), bool)
    fine, few, one = (box_cover(triangles, plane, 0.1, bounds, most) for most in (60, 12, 1))
    assert volume(fine) < volume(few) <= 8000.0 and len(few) <= 12 < len(fine)
    assert one.tolist() == [bounds.tolist()]
    on = np.random.default_rng(2).normal(size=(5000, 3))
    on *= 10.0 / np.linalg.norm(on, axis=1)[:, None]
    assert held(on, fine).all() and held(on, few).all()


@pytest.mark.slow
def test_a_solid_beside_a_large_assembly_is_the_box_round_it(tmp_path):
    assembly = cq.Assembly()
    for k in range(62):
        assembly.add(box(4, 4, 4, (10 * k, 0, 0)).union(box(1, 1, 8, (10 * k, 0, 0))), name=f"p{k}")
    path = tmp_path / "many.step"
    assembly.export(str(path))
    assert all(len(o.boxes) == 0 and len(o.held_by) == 1 for o in load_part(path, solid=1).others)
