"""The normals a part carries at the corners of its mesh, against closed forms; and what a pocket gains by them."""

from __future__ import annotations

import math

import numpy as np
import pytest

cq = pytest.importorskip("cadquery")

from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.part import Part  # noqa: E402
from geometry.setup_frame import SetupFrame  # noqa: E402
from geometry.step_import.occ.loading import load_part  # noqa: E402
from service.from_wire import parse_setup  # noqa: E402
from service.stages.job_inputs import JobInputs  # noqa: E402
from service.stages.preparation import planning_samples  # noqa: E402
from tests.hand_parts import ball, tool  # noqa: E402
from tests.step_files import write_step  # noqa: E402
from zones.features.decomposition import decompose  # noqa: E402
from zones.lattice import lattice_step  # noqa: E402
from zones.reach.assembly import Clearances  # noqa: E402
from zones.reach.tip_field import TipField, touchable  # noqa: E402


def from_axis(p, slope=0.0):
    """Outward of a cylinder or cone about Z, its radius growing by ``slope`` with z."""
    flat = p[:, :2] / np.linalg.norm(p[:, :2], axis=1, keepdims=True)
    return np.column_stack([flat, np.full(len(p), -slope)]) / math.hypot(1.0, slope)


def from_ring(p):
    ring = 8.0 * p * [1, 1, 0] / np.linalg.norm(p[:, :2], axis=1, keepdims=True)
    return (p - ring) / np.linalg.norm(p - ring, axis=1, keepdims=True)


SHAPES = {
    "cylinder": (lambda: cq.Solid.makeCylinder(4, 9), from_axis),
    "hole": (lambda: cq.Workplane().box(12, 12, 5).faces(">Z").workplane().hole(8), lambda p: -from_axis(p)),
    "cone to its tip": (lambda: cq.Solid.makeCone(4, 0, 6), lambda p: from_axis(p, -4 / 6)),
    "sphere": (lambda: cq.Solid.makeSphere(4, angleDegrees1=-90, angleDegrees2=90), lambda p: p / 4.0),
    "torus": (lambda: cq.Solid.makeTorus(8, 2), from_ring),
}


@pytest.mark.parametrize("name", SHAPES)
def test_corners_have_the_normals_of_the_surface(name, tmp_path):
    shape, true = SHAPES[name]
    part = load_part(write_step(shape(), tmp_path / "a.step"), chord=0.01)
    bent = np.isin(part.mesh.face_ids, [f.number for f in part.faces if f.surface != "plane"])
    corners, points = part.mesh.corner_normals[bent].reshape(-1, 3), part.mesh.triangles[bent].reshape(-1, 3)
    clear = np.hypot(points[:, 0], points[:, 1]) > 1e-6  # beside the tip of the cone
    assert np.isfinite(corners).all() and bent.any()
    assert np.linalg.norm(corners, axis=1) == pytest.approx(1.0)
    with np.errstate(invalid="ignore"):
        assert np.abs(corners - true(points))[clear].max() < 1e-6
    dots = np.einsum("ijk,ik->ij", part.mesh.corner_normals, part.mesh.normals)
    assert dots.min() > math.cos(0.3)  # also at poles and tips, and on planes


def test_they_are_placed_and_kept(tmp_path):
    path = write_step(SHAPES["hole"][0](), tmp_path / "a.step")
    part = load_part(path, placement=SetupFrame((1, 2, 3), (1, 0, 0), (0, 1, 0)), chord=0.01)
    dots = np.einsum("ijk,ik->ij", part.mesh.corner_normals, part.mesh.normals)
    assert dots.min() > math.cos(0.2)
    assert (Part.from_bytes(part.to_bytes()).mesh.corner_normals == part.mesh.corner_normals).all()


RADIUS, DEEP = 5.0, 20.0
TOOLS = [{"id": "T1", "kind": "flat", "diameter_mm": 8, "corner_radius_mm": 0, "flutes": 2, "flute_length_mm": 24,
          "neck_diameter_mm": 7.6, "neck_length_mm": 30, "shank_diameter_mm": 8, "stickout_mm": 60,
          "holder": [{"diameter_mm": 30, "diameter_top_mm": 30, "length_mm": 30}]}]


@pytest.fixture(scope="module")
def pocket(tmp_path_factory):
    """A pocket 44 x 24 x 20 mm with upright corners of 5 mm, its planning samples, and which lie on the corners."""
    hollow = cq.Workplane().box(44, 24, DEEP, centered=(True, True, False)).edges("|Z").fillet(RADIUS)
    block = cq.Workplane().box(64, 44, 30, centered=(True, True, False)).cut(hollow.translate((0, 0, 10)))
    part = load_part(write_step(block, tmp_path_factory.mktemp("pocket") / "a.step"), chord=0.0015)
    inputs = JobInputs.of(parse_setup({"tools": TOOLS}))
    samples = planning_samples(part, decompose(part), inputs, np.array([[0.0, 0.0, 1.0]]))
    rounds = np.isin(samples.face, [f.number for f in part.faces if f.surface == "cylinder"])
    assert samples.area[rounds].sum() == pytest.approx(2 * math.pi * RADIUS * DEEP, rel=1e-3)
    return part, samples.subset(rounds)


@pytest.mark.parametrize("body,height", [(tool(8.0, 0.0), DEEP), (tool(9.0, 0.0), DEEP), (tool(9.6, 1.0), DEEP - 1.0),
                                         (ball(6.0), DEEP - 3.0), (ball(8.0), DEEP - 4.0), (ball(9.0), DEEP - 4.5)],
                         ids=["flat 8", "flat 9", "bull 9.6", "ball 6", "ball 8", "ball 9"])
def test_the_corners_of_a_pocket_are_reached_whole(pocket, body, height):
    part, samples = pocket
    field = TipField(TriangleTree(part.mesh), body, Clearances(), part.bounds, body.radius + 4.0, lattice_step(body))
    got = touchable(field, samples.points, samples.normals, 1.5 * part.chord)[1]
    high = samples.points[:, 2] > part.bounds[1, 2] - height
    assert samples.area[got].sum() == pytest.approx(samples.area[high].sum(), rel=0.005)
    # how many of the samples lie so high is left to chance, with a standard deviation of 0.4 %
    chance = 0.005 if height == DEEP else 0.02
    assert samples.area[got].sum() == pytest.approx(2 * math.pi * RADIUS * height, rel=chance)
