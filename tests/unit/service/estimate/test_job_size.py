"""The lengths of arrays that an estimate counts, against closed forms and against the arrays themselves."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.part import EdgeInfo, EdgeKind
from schemas.setup import Setup
from service.estimate.job_estimate import COSTS, estimate_of, estimated
from service.estimate.job_size import JobSize, planning_count, proof_count, rim_lengths, side_step
from service.pictures.clamping_picture import box_mesh, corners_of
from service.stages.blank_model import blank_of
from service.stages.job_inputs import JobInputs
from service.stages.preparation import planning_samples, tip_field
from service.stages.proof_samples import proof_samples
from service.stages.sample_spacing import coarse_spacing
from tests.hand_parts import as_part, tool
from zones.reach.tip_field import DiscHeights

UP = np.array([[0.0, 0.0, 1.0]])
TOOLS = [{"id": "T1", "kind": "flat", "diameter_mm": 6, "flute_length_mm": 20, "stickout_mm": 40},
         {"id": "T2", "kind": "ball", "diameter_mm": 3, "flute_length_mm": 20, "stickout_mm": 40}]


def block(x, y, z):
    """A block of six faces, its bottom at zero."""
    part = as_part(box_mesh(corners_of(np.array([[0.0, 0.0, 0.0], [x, y, z]]))))
    part = replace(part, mesh=replace(part.mesh, face_ids=(1 + np.arange(12) // 2).astype(np.int32)))
    return replace(part, faces=tuple(replace(part.faces[0], number=n) for n in range(1, 7)))


def job(part, **fields):
    setup = Setup.model_validate({"tools": TOOLS, **fields})
    return SimpleNamespace(inputs=JobInputs.of(setup), part=part, blank=blank_of(setup, part))


def test_samples_of_faces_by_their_area():
    by_face, rims = np.array([0.0, 100.0, 4.0]), np.array([0.0, 40.0, 8.0])
    # 25 a mm², or 1,200 a face with 150 a mm² at most; 0.2 mm between samples of a border
    assert planning_count(by_face, rims, {}) == 2500 + 600 + 48 / 0.2
    assert proof_count(by_face, rims, {}) == 100 * 104


def test_a_face_that_needs_few_samples_counts_by_its_cells():
    by_face, rims = np.array([0.0, 10_000.0]), np.array([0.0, 400.0])
    assert proof_count(by_face, rims, {1: 0.5}) == round((10_000 - 250) / 0.25 + 250 * 100)
    assert proof_count(by_face, 100 * rims, {1: 0.5}) == 10_000 * 100  # a border everywhere


def test_the_border_of_a_face_is_that_of_its_edges_and_no_shorter_than_round():
    part = block(10.0, 10.0, 10.0)
    by_face = np.array([0.0, 100.0, 100.0])
    assert rim_lengths(part, by_face).tolist() == [0.0, *2 * [pytest.approx(2 * math.sqrt(100 * math.pi))]]
    edge = EdgeInfo((1, 2), EdgeKind.CONVEX, 50.0, 1.5, np.zeros((2, 3)))
    assert rim_lengths(replace(part, edges=(edge,)), by_face).tolist() == [0.0, 50.0, 50.0]


@pytest.mark.parametrize("size", [(60.0, 40.0, 20.0), (15.0, 10.0, 8.0)])
def test_counts_are_near_the_arrays_themselves(size):
    made = job(block(*size))
    found = JobSize.of(made)
    spacing = coarse_spacing(made.part, made.inputs, UP)
    seen = np.flatnonzero(made.part.mesh.normals[:, 2] > -0.5)
    assert found.area == pytest.approx(float(made.part.mesh.areas[seen].sum()))
    dense = len(proof_samples(made.part, seen, spacing))
    assert found.proof_samples == pytest.approx(dense, rel=0.25)
    light = len(planning_samples(made.part, SimpleNamespace(seat=()), made.inputs, UP))
    assert found.planning_samples == pytest.approx(light, rel=0.25)


def test_the_nodes_of_lattices_are_those_that_are_allocated():
    made = job(block(30.0, 20.0, 10.0))
    standing = DiscHeights(TriangleTree(made.part.mesh))
    fields = [tip_field(made.inputs, made.blank, np.eye(3), standing, made.part.bounds, b) for b in made.inputs.bodies]
    sizes = [f.lattice.nx * f.lattice.ny for f in fields]
    found = JobSize.of(made)
    assert (found.tool_nodes, found.widest_nodes) == (sum(sizes), max(sizes))


def test_the_side_step_of_a_ball_and_of_an_end_without_corner():
    assert side_step(tool(4.0, 2.0), 0.02) == pytest.approx(2 * math.sqrt(0.02 * (4.0 - 0.02)))
    assert side_step(tool(4.0, 0.0), 0.02) == side_step(tool(4.0, 2.0), 0.02)


def test_a_larger_part_and_another_axis_take_more():
    small, large = job(block(30.0, 20.0, 10.0)), job(block(60.0, 40.0, 20.0))
    axes = [{"id": "A1", "direction": [0, 0, 1]}, {"id": "A2", "direction": [1, 0, 0]}]
    two = job(block(60.0, 40.0, 20.0), access=axes)
    for before, after in ((small, large), (large, two)):
        assert estimate_of(after).memory_mb > estimate_of(before).memory_mb
        assert estimate_of(after).seconds > estimate_of(before).seconds
    assert JobSize.of(two).accesses == 2


def test_an_estimate_is_the_sum_of_its_shares():
    size = JobSize.of(job(block(30.0, 20.0, 10.0)))
    for kind in ("plan", "zones", "verify"):
        found = estimated(size, kind)
        assert found.memory_mb == sum(s.memory_mb for s in found.basis)
        assert found.seconds == pytest.approx(sum(s.seconds for s in found.basis), abs=1.0)
    assert {s.what for s in estimated(size).basis} == {c.what for c in COSTS}
    assert estimated(size, "zones").memory_mb < estimated(size).memory_mb
    assert estimated(size, "zones").seconds < estimated(size).seconds
    assert estimated(size) == estimated(JobSize.of(job(block(30.0, 20.0, 10.0))))
