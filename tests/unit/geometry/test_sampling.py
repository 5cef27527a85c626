"""Samples lie evenly inside a triangle, not only among triangles."""

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

from geometry.mesh import TriangleMesh
from geometry.sampling import joined, lattice_samples, sample_borders, sample_surface, with_surface_normals
from tests.hand_parts import bent_strip


@pytest.mark.parametrize("corner", [0, 1, 2])
def test_every_part_of_a_triangle_has_its_share(corner):
    vertices = np.array([[0.0, 0, 0], [12.0, 1.0, 0], [2.0, 9.0, 3.0]])
    mesh = TriangleMesh(vertices, np.array([[0, 1, 2]], np.int32), np.array([1], np.int32))
    samples = sample_surface(mesh, 200.0, seed=5)
    assert samples.area.sum() == pytest.approx(mesh.areas.sum(), rel=1e-9)
    # barycentric weight of the corner: above t lies the share (1 - t)^2 of the area
    frame = np.vstack([vertices.T, [1.0, 1.0, 1.0]])
    weight = np.linalg.lstsq(frame, np.vstack([samples.points.T, np.ones(len(samples))]), rcond=None)[0][corner]
    assert weight.min() > -1e-9
    for t in (0.2, 0.5, 0.8):
        share = (1.0 - t) ** 2
        assert (weight > t).mean() == pytest.approx(share, abs=4.0 * np.sqrt(share * (1 - share) / len(samples)))


def test_normals_are_those_of_the_surface():
    for hollow in (True, False):
        mesh = bent_strip(4.0, 0.004, hollow=hollow)
        s = sample_surface(mesh, 200.0, seed=1)
        true = (-1.0 if hollow else 1.0) * s.points / np.hypot(s.points[:, 0], s.points[:, 1])[:, None]
        true[:, 2] = 0.0
        got = with_surface_normals(s, mesh)
        assert np.abs(got.normals - true).max() < 1e-5 < 1e-2 < np.abs(s.normals - true).max()
        assert np.linalg.norm(got.normals, axis=1) == pytest.approx(1.0)
        assert (got.points == s.points).all() and (got.area == s.area).all() and (got.triangle == s.triangle).all()


def test_normals_turn_with_the_mesh():
    mesh = bent_strip(4.0, 0.01)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], [3, 2, 1]
    turned = mesh.transformed(matrix)
    a, b = (with_surface_normals(sample_surface(m, 20.0, seed=1), m) for m in (mesh, turned))
    assert b.normals == pytest.approx(a.normals @ matrix[:3, :3].T, abs=1e-9)


def test_the_normal_of_the_facet_stays_where_the_surface_has_none_or_another():
    mesh = bent_strip(4.0, 0.01)
    plain = TriangleMesh(mesh.vertices, mesh.faces, mesh.face_ids)
    s = sample_surface(mesh, 20.0, seed=1)
    assert with_surface_normals(s, plain) is s
    corners = mesh.corner_normals.copy()
    corners[0, 1], corners[1] = np.nan, -corners[1]
    corners[2] = [[1.0, 0, 0], [-0.5, 0.75**0.5, 0], [-0.5, -(0.75**0.5), 0]]
    got = with_surface_normals(s, TriangleMesh(mesh.vertices, mesh.faces, mesh.face_ids, corners))
    kept = (got.normals == s.normals).all(axis=1)
    assert set(s.triangle[kept].tolist()) == {0, 1, 2} and not np.isnan(got.normals).any()
    with pytest.raises(ValueError):
        TriangleMesh(mesh.vertices, mesh.faces, mesh.face_ids, corners[:-1])


def test_no_sets_of_samples_joined_are_no_samples():
    """A plate whose faces all have samples far apart has no set of close ones."""
    none = joined([])
    assert len(none) == 0 and none.points.shape == none.normals.shape == (0, 3) and none.covers is None
    assert len(joined([none, none])) == 0


def test_a_sample_on_a_border_has_the_normal_of_its_own_face():
    """Two strips of different radius that meet at a right angle: along the common border each keeps its own."""
    mesh = bent_strip(4.0, 0.01)
    k = len(mesh.vertices)
    other = bent_strip(2.0, 0.01)
    both = TriangleMesh(np.vstack([mesh.vertices, other.vertices]), np.vstack([mesh.faces, other.faces + k]),
                        np.repeat([1, 2], [len(mesh.faces), len(other.faces)]).astype(np.int32),
                        np.concatenate([mesh.corner_normals, other.corner_normals]))
    s = joined([sample_surface(both, 20.0, seed=1), sample_borders(both, 0.1, 0.0, np.arange(len(both.faces)))])
    got = with_surface_normals(s, both)
    radius = np.where(got.face == 1, 4.0, 2.0)
    assert got.normals[:, :2] == pytest.approx(-got.points[:, :2] / radius[:, None], abs=6e-3)


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0.2, -0.9, 0.3), (-1, 0.7, -1)])
def test_no_place_is_far_from_a_sample_of_the_lattice(normal):
    """A disc in any direction, cut into triangles at random: the farthest place inside it, against random places."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    u = np.linalg.svd(n[None])[2][1]
    v = np.cross(n, u)
    rng = np.random.default_rng(3)
    flat = np.vstack([rng.uniform(-4, 4, (60, 2)), 4 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])])
    faces = Delaunay(flat).simplices
    corners = flat[:, :1] * u + flat[:, 1:] * v + [0.3, -7.1, 2.0]
    wrong = np.einsum("ij,j->i", np.cross(corners[faces[:, 1]] - corners[faces[:, 0]],
                                          corners[faces[:, 2]] - corners[faces[:, 0]]), n) < 0
    faces[wrong] = faces[wrong][:, ::-1]
    mesh = TriangleMesh(corners, faces.astype(np.int32), np.zeros(len(faces), np.int32))
    s = lattice_samples(mesh, 0.2)
    assert np.abs((s.points - corners[0]) @ n).max() < 1e-9
    assert s.area.sum() == pytest.approx(mesh.areas.sum(), rel=0.01)
    inner = rng.uniform(-3.7, 3.7, (20_000, 2))
    gap = cKDTree(s.points).query(inner[:, :1] * u + inner[:, 1:] * v + [0.3, -7.1, 2.0])[0]
    assert gap.max() <= 0.8661 * 0.2 and len(np.unique(np.round(s.points, 6), axis=0)) == len(s)
