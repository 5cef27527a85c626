"""The cloud, the solid and the comparison of the sample-by-sample check of reach; and that it notices a lie."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.reach import brute_samples as brute
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from geometry.setup_frame import SetupFrame
from geometry.tool_body import HolderFrustum
from tests.hand_parts import as_part, ball, bent_strip, low_walls, slope_field, tool
from tests.step_files import write_step
from zones.reach.assembly import Clearances

CLEAR = Clearances()
LIFT = 0.004


def needles():
    rng = np.random.default_rng(4)
    a = rng.uniform(0, 5, (12, 3))
    b = a + rng.normal(size=(12, 3)) * [3, 3, 1]
    c = a + (b - a) * rng.random((12, 1)) + rng.normal(size=(12, 3)) * 0.02
    return TriangleMesh(np.stack([a, b, c], 1).reshape(-1, 3), np.arange(36).reshape(12, 3))


@pytest.mark.parametrize("mesh", [needles(), low_walls()], ids=["needles", "walls"])
def test_no_point_of_the_surface_is_far_from_the_cloud(mesh):
    spacing = 0.1
    tri = mesh.triangles
    out = np.empty((brute._fill(tri, spacing, brute.ROW * spacing, np.empty((0, 3))), 3))
    assert brute._fill(tri, spacing, brute.ROW * spacing, out) == len(out)
    probe = sample_surface(mesh, 60.0, seed=2).points
    far = cKDTree(out).query(probe)[0].max()
    assert far <= math.hypot(0.5, brute.ROW) * spacing
    kept = brute.highest_of(out)
    assert len(kept) < len(out) or not mesh.face_ids.any()  # nothing of the needles stands over itself
    for p in out[:: len(out) // 50]:
        over = kept[np.hypot(kept[:, 0] - p[0], kept[:, 1] - p[1]) <= brute.THIN * math.sqrt(2.0)]
        assert over[:, 2].max() >= p[2]


def test_sharp_edges_are_those_that_turn():
    """A block whose top is flat and meshed in squares: the rim, the upright edges and the rim below, nothing inside."""
    ends = brute.sharp_edges(slope_field(lambda x, y: 0.0 * x, size=6.0, n=3, base=-2.0))
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    assert length == pytest.approx(24.0 + 24.0 + 4 * 2.0)


@pytest.mark.parametrize("solid", [
    brute.Solid(1.0, 1.0, 3.0, np.zeros((0, 4))), brute.Solid(1.2, 0.0, 3.0, np.array([[2.0, 2.0, 1.5, 1.0]])),
    brute.Solid(1.0, 0.3, 3.0, np.array([[1.5, 1.5, 2.0, 1.0], [2.0, 4.0, 3.0, 2.0]]))],
    ids=["ball", "shank", "holder"])
def test_admissible_is_what_every_point_allows(solid):
    cloud = brute.cloud_of(low_walls(), 0.2)
    rng = np.random.default_rng(6)
    tips = np.array([-1.0, -1.0, 0.0]) + rng.random((300, 3)) * [16.0, 11.0, 8.0]
    expected = []
    for x, y, z in tips:
        rho = np.hypot(cloud.points[:, 0] - x, cloud.points[:, 1] - y)
        low = np.where(rho < solid.radius, solid.corner - np.sqrt(np.maximum(
            solid.corner**2 - np.maximum(rho - (solid.radius - solid.corner), 0.0) ** 2, 0.0)), np.inf)
        for a, b, h, length in solid.bodies:
            slope = h + length * np.maximum(rho - a, 0.0) / max(b - a, 1e-12)
            low = np.minimum(low, np.where(rho < max(a, b), slope, np.inf))
        expected.append(not (cloud.points[:, 2] - z - brute.DEPTH > low).any())
    got = brute.admissible(cloud, solid, tips)
    assert got.tolist() == expected and 0.1 < got.mean() < 0.9


HOLDER = (HolderFrustum(8, 12, 4), HolderFrustum(12, 12, 10))


@pytest.mark.parametrize("body", [ball(2.0, neck=2.5, shank=3.4, stickout=6.0, holder=HOLDER), tool(2.4, 0.4),
                                  tool(2.0, 0.0, neck=3.0, shank=4.0)], ids=["ball", "bull", "flat"])
def test_reach_is_right_on_two_walls_and_a_lie_is_seen(body, monkeypatch):
    monkeypatch.setattr(brute, "SPACING", 0.08)
    mesh = low_walls()
    points, triangles = brute.scattered(mesh, brute.machinable(mesh), 2500)
    normals = mesh.normals[triangles]  # facets are what these walls are
    cloud, solid = brute.cloud_of(mesh, 0.08), brute.solid_of(body, CLEAR)
    args, level = (points, normals, LIFT), normals[:, 2] > brute.LEVEL
    said = brute.said_by_reach(TriangleTree(mesh), as_part(mesh), body, CLEAR, *args, 0.0, 0.0)
    found = brute.compare(cloud, solid, said, *args, 0.0)
    for wrong in (found["wrong"], found["cutter wrong"]):
        # under a flat end reach tries a few places only, and misses some beside corners
        assert (wrong & ~level).mean() <= 0.001 and wrong.mean() <= (0.001 if body.corner_radius > 0 else 0.004)
    assert (found["wrong"] <= found["differs"]).all() and found["reached"].mean() > 0.3
    thick = replace(body, diameter=body.diameter + 0.6, corner_radius=body.corner_radius + 0.3)
    lie = brute.said_by_reach(TriangleTree(mesh), as_part(mesh), thick, CLEAR, *args, 0.0, 0.0)
    assert brute.compare(cloud, solid, lie, *args, 0.0)["cutter wrong"].mean() > 0.005


def test_normals_that_keep_a_tool_out_count_as_wrong():
    """A ball of 4 mm in a round of 2.5: right with the planner's normals; with those of facets not, and it shows."""
    mesh, body = bent_strip(2.5, 0.003, upright=False, length=4.0), ball(4.0)
    points, triangles = brute.scattered(mesh, np.arange(len(mesh.faces)), 1500)
    true = np.column_stack([np.zeros(len(points)), -points[:, 1:]])
    true /= np.linalg.norm(true, axis=1)[:, None]
    cloud, solid, lift = brute.cloud_of(mesh, 0.04), brute.solid_of(body, CLEAR), 0.0045
    wrong = []
    for normals in (brute.planned_normals(mesh, points, triangles), mesh.normals[triangles]):
        said = brute.said_by_reach(TriangleTree(mesh), as_part(mesh), body, CLEAR, points, normals, lift, 0.0, 0.0)
        wrong.append(brute.compare(cloud, solid, said, points, true, lift, 0.0)["cutter wrong"].mean())
    assert wrong[0] == 0.0 and wrong[1] > 0.1


def test_the_kernel_gives_the_normals_of_the_faces(tmp_path):
    cq = pytest.importorskip("cadquery")
    from geometry.step_import.occ.loading import load_part

    path = write_step(cq.Workplane().box(12, 12, 5).faces(">Z").workplane().hole(8), tmp_path / "a.step")
    setup = SimpleNamespace(placement=SimpleNamespace(origin_mm=(0, 0, 1), z_axis=(0, 0, 1), x_axis=(1, 0, 0)),
                            part=SimpleNamespace(solid=None))
    part = load_part(path, placement=SetupFrame((0, 0, 1), (0, 0, 1), (1, 0, 0)), chord=0.01)
    points, triangles = brute.scattered(part.mesh, np.arange(len(part.mesh.faces)), 2000)
    got = brute.kernel_normals(part, path, setup)(points, triangles)
    hole = np.hypot(points[:, 0], points[:, 1]) < 4.001
    hole &= np.abs(part.mesh.normals[triangles][:, 2]) < 0.5
    flat = points[hole, :2] / np.linalg.norm(points[hole, :2], axis=1)[:, None]
    assert hole.any() and np.abs(got[hole] + np.column_stack([flat, np.zeros(hole.sum())])).max() < 1e-9
    assert np.abs(got - part.mesh.normals[triangles])[~hole].max() < 1e-9
