"""Faces on which the kernel's triangles leave the exact surface."""

from __future__ import annotations

import numpy as np
import pytest

cq = pytest.importorskip("cadquery")

from OCP.BRepAdaptor import BRepAdaptor_Surface  # noqa: E402
from OCP.gp import gp_Pnt, gp_Vec  # noqa: E402

from geometry.step_import.occ import meshing  # noqa: E402
from geometry.step_import.occ.curvature import surface_name  # noqa: E402
from geometry.step_import.occ.deviation import distance_near, face_deviations  # noqa: E402
from geometry.step_import.occ.meshing import count_open_edges, mesh_solid  # noqa: E402
from geometry.step_import.occ.refining import Net, refine_net  # noqa: E402
from geometry.step_import.occ.topology import faces_of  # noqa: E402
from geometry.step_import.occ.triangulating import edge_sides, triangulate  # noqa: E402

CHORD = 0.004
LENGTH, HEIGHT = 50.0, 10.0


def ruled_wall(points: int, bend: float, twist: float):
    """A thin wavy wall, ruled between splines on the floor and at the top, one face per side."""
    x = np.linspace(0, LENGTH, points)
    wires = []
    for z, thickness, turn, lean in ((0.0, 2.0, 0.0, 0.0), (HEIGHT, 1.2, twist, 1.0)):
        y = bend * np.sin(2 * np.pi * x / LENGTH) + lean + turn * (x / LENGTH - 0.5) * HEIGHT
        centre = np.stack([x, y], axis=1)
        along = np.gradient(centre, axis=0)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
        left = [cq.Vector(*p, z) for p in centre + 0.5 * thickness * across]
        right = [cq.Vector(*p, z) for p in (centre - 0.5 * thickness * across)[::-1]]
        wires.append(cq.Wire.assembleEdges([cq.Edge.makeSpline(left), cq.Edge.makeLine(left[-1], right[0]),
                                            cq.Edge.makeSpline(right), cq.Edge.makeLine(right[-1], left[0])]))
    return cq.Solid.makeLoft(wires, True).wrapped


def leaning_normals(solid, mesh, uv):
    """Angle (deg) between triangles of free-form faces and the surface at their middle, and their areas."""
    out = []
    for number, face in enumerate(faces_of(solid), 1):
        if surface_name(face) != "bspline":
            continue
        surface = BRepAdaptor_Surface(face, True)
        rows = np.flatnonzero(mesh.face_ids == number)
        for row, (u, v) in zip(rows, uv[rows].mean(axis=1), strict=True):
            a, b = gp_Vec(), gp_Vec()
            surface.D1(u, v, gp_Pnt(), a, b)
            n = np.array(a.Crossed(b).Coord())
            out.append((abs(mesh.normals[row] @ n) / np.linalg.norm(n), mesh.areas[row]))
    cosine, area = np.array(out).T
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))), area


@pytest.mark.parametrize(("points", "bend", "twist"), [(7, 10.0, 0.0), (9, 6.0, 0.5)])
def test_ruled_side_that_the_kernel_meshes_badly(monkeypatch, points, bend, twist):
    solid = ruled_wall(points, bend, twist)
    alone = triangulate(solid, CHORD, 0.2)
    assert face_deviations(faces_of(solid), alone, CHORD).max() > 1.5 * CHORD, "the kernel meshes this well by now"
    runs = []
    monkeypatch.setattr(meshing, "triangulate", lambda *a: runs.append(a) or triangulate(*a))
    found = mesh_solid(solid, CHORD, 0.2)
    assert len(runs) == 1, "meshed as a whole once more"
    assert found.deviation <= 1.5 * CHORD and not found.warnings
    assert count_open_edges(found.mesh) == 0
    assert len(found.mesh.faces) < 3000 < sum(len(f.triangles) for f in alone)
    angle, area = leaning_normals(solid, found.mesh, found.uv)
    assert np.average(angle, weights=area) < 1.0 and area[angle > 5.0].sum() < 1e-3 * area.sum()


def test_every_triangle_keeps_the_chord_and_nodes_lie_at_their_parameters():
    """All triangles, not the sample that the product measures, at the middle of their sides too."""
    solid = ruled_wall(7, 10.0, 0.0)
    found = mesh_solid(solid, CHORD, 0.2)
    for number, face in enumerate(faces_of(solid), 1):
        surface, rows = BRepAdaptor_Surface(face, True), found.mesh.face_ids == number
        points, uv = found.mesh.triangles[rows], found.uv[rows]
        exact = np.array([surface.Value(u, v).Coord() for u, v in uv.reshape(-1, 2)])
        assert np.linalg.norm(exact - points.reshape(-1, 3), axis=1).max() < 1e-6
        for corners in ([0, 1, 2], [0, 1], [1, 2], [2, 0]):
            middle, at = points[:, corners].mean(axis=1).tolist(), uv[:, corners].mean(axis=1)
            assert max(distance_near(surface, p, q) for p, q in zip(middle, at, strict=True)) <= 1.5 * CHORD


def test_mending_leaves_other_faces_and_all_edges_alone():
    solid = ruled_wall(7, 10.0, 0.0)
    before = triangulate(solid, CHORD, 0.2)
    off = face_deviations(faces_of(solid), before, CHORD) > 1.5 * CHORD
    after = meshing.mend_faces(solid, before, np.flatnonzero(off), CHORD, CHORD, 0.2)
    for face, old, new, bad in zip(faces_of(solid), before, after, off, strict=True):
        assert (new is not old) == bad
        kept = np.unique(edge_sides(face))
        assert (new.nodes[kept] == old.nodes[kept]).all() and (new.uv[kept] == old.uv[kept]).all()
        ends = [np.sort(np.stack([f.triangles, np.roll(f.triangles, -1, axis=1)], 2).reshape(-1, 2), axis=1)
                for f in (old, new)]
        single = [{tuple(row) for row in pairs[counts == 1].tolist()}
                  for pairs, counts in (np.unique(e, axis=0, return_counts=True) for e in ends)]
        assert single[0] == single[1]


def half_pipe():
    """A cylinder face R 5 as four strips between its straight sides, with nodes at both ends only."""
    angle, height = np.linspace(0, np.pi, 5), np.array([0.0, 20.0])
    uv = np.stack(np.meshgrid(angle, height, indexing="ij"), axis=-1).reshape(-1, 2)
    nodes = np.stack([5 * np.cos(uv[:, 0]), 5 * np.sin(uv[:, 0]), uv[:, 1]], axis=1)
    strips = [[[i, i + 2, i + 3], [i, i + 3, i + 1]] for i in range(0, 8, 2)]
    surface = next(BRepAdaptor_Surface(f, True) for f in faces_of(cq.Solid.makeCylinder(5, 20).wrapped)
                   if surface_name(f) == "cylinder")
    return surface, Net(nodes, uv, np.array(strips).reshape(-1, 3), np.zeros((0, 2), np.int64))


def test_refined_net_covers_the_same_parameters():
    surface, net = half_pipe()
    out = refine_net(surface, net, 0.1, 10_000)
    corners = out.uv[out.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert (area > 0).all() and area.sum() == pytest.approx(20 * np.pi, rel=1e-12)
    assert len(out.triangles) > len(net.triangles) and (out.nodes[:10] == net.nodes).all()
    assert np.hypot(out.nodes[:, 0], out.nodes[:, 1]) == pytest.approx(5.0, abs=1e-12)


def test_kept_sides_are_neither_split_nor_flipped():
    surface, net = half_pipe()
    kept = np.array([[0, 3], [2, 5], [4, 7], [6, 9]])
    out = refine_net(surface, Net(net.nodes, net.uv, net.triangles, kept), 0.05, 10_000)
    sides = np.sort(np.stack([out.triangles, np.roll(out.triangles, -1, axis=1)], 2).reshape(-1, 2), axis=1)
    assert {tuple(k) for k in kept.tolist()} <= {tuple(s) for s in sides.tolist()}


def test_refining_ends_at_its_limit():
    surface, net = half_pipe()
    assert 20 < len(refine_net(surface, net, 1e-3, 20).triangles) <= 80
