"""Faces that join smoothly as one: laid flat, brought back, and walked across where they join."""

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.mesh import TriangleMesh
from geometry.parameterization.joined_faces import Joined
from geometry.parameterization.square_patches import squared
from geometry.surfaces.nurbs import NurbsSurface
from tests.hand_parts import ball
from toolpath.passes.cutter_locations import lifted
from toolpath.passes.forward_step import PassProfile, steps
from toolpath.passes.isoparametric_passes import JoinedSurface, lay_out
from verify.moves import Moves
from verify.surface.removal import residual_on_normals

LINE = np.array([0.0, 0, 1, 1])
ARC = np.array([0.0, 0, 0, 1, 1, 1])
BEND, DEEP = 8.0, 20.0  # mm, radius of the fillet and length of all faces along y


def extruded(profile, knots, order, weights=None):
    """A profile of x and z, (n, 2) mm, swept along y; its normal up and to greater x."""
    net = np.stack([np.insert(profile, 1, y, axis=1) for y in (0.0, DEEP)], axis=1)
    h = None if weights is None else np.repeat(np.asarray(weights)[:, None], 2, axis=1)
    return NurbsSurface(net, knots, LINE, (order, 2), h)


def trough():
    """A wall of 15 mm, a hollow fillet of 8 mm and a floor of 12 mm, by number."""
    wall = extruded(np.array([[0.0, BEND + 15.0], [0.0, BEND]]), LINE, 2)
    fillet = extruded(np.array([[0.0, BEND], [0.0, 0.0], [BEND, 0.0]]), ARC, 3, [1.0, np.sqrt(0.5), 1.0])
    floor = extruded(np.array([[BEND, 0.0], [BEND + 12.0, 0.0]]), LINE, 2)
    return {4: wall, 5: fillet, 7: floor}


def as_one(surfaces, counts=(6, 24, 5), across=9):
    """The mesh of all faces, corners shared, and the parameters of the corners."""
    points, faces, ids, uv = [], [], [], []
    for (number, surface), n in zip(surfaces.items(), counts, strict=True):
        u, v = np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, across)
        at = np.stack(np.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
        i, j = (q.ravel() for q in np.meshgrid(np.arange(n), np.arange(across - 1), indexing="ij"))
        a, b, c, d = i * across + j, (i + 1) * across + j, (i + 1) * across + j + 1, i * across + j + 1
        own = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
        faces.append(own + sum(len(p) for p in points))
        points.append(surface.points(at))
        uv.append(at[own])
        ids.append(np.full(len(own), number))
    welded, back = np.unique(np.vstack(points).round(9), axis=0, return_inverse=True)
    mesh = TriangleMesh(welded, back.ravel()[np.vstack(faces)].astype(np.int32), np.concatenate(ids).astype(np.int32))
    return mesh, np.vstack(uv)


def nothing(xy):
    """No part stands in the way."""
    return np.full(len(xy), -np.inf)


def test_what_can_be_unrolled_keeps_its_lengths():
    surfaces = trough()
    found = Joined.of(*as_one(surfaces), surfaces)
    a, b = found.mesh.vertices[found.mesh.faces[:, 0]], found.mesh.vertices[found.mesh.faces[:, 1]]
    p, q = found.plane[found.mesh.faces[:, 0]], found.plane[found.mesh.faces[:, 1]]
    assert np.allclose(np.linalg.norm(q - p, axis=1), np.linalg.norm(b - a, axis=1), rtol=1e-9)
    size = np.sort(np.ptp(found.border @ np.linalg.svd(found.border - found.border.mean(axis=0))[2].T, axis=0))
    assert size == pytest.approx([DEEP, 15.0 + 12.0 + 0.5 * np.pi * BEND], rel=2e-3)


def test_places_come_back_to_the_exact_faces():
    surfaces = trough()
    found = Joined.of(*as_one(surfaces), surfaces)
    rng = np.random.default_rng(3)
    share = rng.dirichlet((1, 1, 1), 400)
    row = rng.integers(0, len(found.mesh.faces), 400)
    at = np.einsum("nk,nkc->nc", share, found.plane[found.mesh.faces[row]])
    place = found.places(at)
    x, z = place[:, 0], place[:, 2]
    off = np.where(z >= BEND, x, np.where(x >= BEND, z, BEND - np.hypot(x - BEND, z - BEND)))
    assert np.abs(off).max() < 1e-9
    near, normal = found.feet(place + 0.05 * rng.normal(size=(400, 3)))
    assert np.linalg.norm(near - place, axis=1).max() < 0.4
    assert np.abs(np.linalg.norm(normal, axis=1) - 1.0).max() < 1e-12


@pytest.mark.parametrize("turned", [False, True])
def test_passes_over_faces_as_one_leave_the_scallop(turned):
    """Along the faces and across where they join, by the verifier; the ball fits into the fillet."""
    surfaces, scallop, radius, chord = trough(), 0.02, 3.0, 0.004
    found = Joined.of(*as_one(surfaces), surfaces)
    (piece,) = squared((found.border,), (1.0, 1.0))
    iso = JoinedSurface.of(found, piece.map)
    iso = JoinedSurface(iso.faces, iso.splines, turned)
    lines, body = [], ball(2.0 * radius)
    for eta in lay_out(iso, radius, scallop - chord).tolist():
        profile = PassProfile.of(iso.curve(eta), chord, radius)
        lines += lifted(profile, steps(profile, radius, chord, scallop), body, nothing, chord)[0]
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    moves = Moves(start, end, np.ones(len(start), bool), np.zeros(len(start), np.int32))
    rng = np.random.default_rng(5)
    places = [s.points_and_normals(rng.uniform(0.0, 1.0, (4000, 2))) for s in surfaces.values()]
    points, normals = (np.vstack([p[k] for p in places]) for k in (0, 1))
    left = residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [body])[0]
    assert left.max() <= scallop and left.min() > -1.05 * chord
    assert left.max() > 0.7 * scallop


def test_what_is_no_sheet_is_refused_by_name():
    surfaces = trough()
    mesh, uv = as_one(surfaces)
    with pytest.raises(GeometryError, match="F4 F7") as error:
        Joined.of(mesh, uv, {4: surfaces[4], 7: surfaces[7]})
    assert error.value.code == "not_a_sheet"
    hole = np.arange(len(mesh.faces)) != 150
    pierced = TriangleMesh(mesh.vertices, mesh.faces[hole], mesh.face_ids[hole])
    with pytest.raises(GeometryError, match="not one sheet"):
        Joined.of(pierced, uv[hole], surfaces)


def test_what_cannot_lie_flat_is_refused():
    """Most of a ball: its rim would be stretched against its middle."""
    turn = np.radians(np.linspace(0.0, 300.0, 25))
    way = np.radians(np.linspace(-80.0, 80.0, 15))
    at = np.array([[np.cos(w) * np.cos(t), np.cos(w) * np.sin(t), np.sin(w)] for t in turn for w in way]) * 10.0
    i, j = (q.ravel() for q in np.meshgrid(np.arange(24), np.arange(14), indexing="ij"))
    a, b, c, d = i * 15 + j, (i + 1) * 15 + j, (i + 1) * 15 + j + 1, i * 15 + j + 1
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)
    mesh = TriangleMesh(at, faces, np.ones(len(faces), np.int32))
    with pytest.raises(GeometryError) as error:
        Joined.of(mesh, np.zeros((len(faces), 3, 2)), {1: trough()[4]})
    assert error.value.code == "not_flat" and error.value.measured > error.value.limit
