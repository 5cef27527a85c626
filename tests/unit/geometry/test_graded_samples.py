"""Samples of flat faces: coarse inside, fine near borders, and their areas."""

import numpy as np
import pytest
import shapely
from scipy.spatial import Delaunay, cKDTree

from geometry.mesh import TriangleMesh
from geometry.sampling import graded_samples, joined, lattice_axes, sample_surface, split_cells

SPACING, PARTS, MARGIN = 0.5, 5, 1.0


def frame_with_hole(normal=(0.0, 0.0, 1.0)):
    """A square of 20 mm with a square hole of 6 mm, in a plane with a normal, cut into triangles at random."""
    rng = np.random.default_rng(3)
    ring = np.array([[-3, -3], [3, -3], [3, 3], [-3, 3]], float)
    outside = np.array([[-10, -10], [10, -10], [10, 10], [-10, 10]], float)
    inner = rng.uniform(-9.5, 9.5, (60, 2))
    inner = inner[np.abs(inner).max(axis=1) > 3.5]
    edge = np.concatenate([np.linspace(ring[k], ring[(k + 1) % 4], 40, endpoint=False) for k in range(4)])
    flat = np.concatenate([outside, edge, inner])
    triangles = Delaunay(flat).simplices
    triangles = triangles[np.abs(flat[triangles].mean(axis=1)).max(axis=1) > 3.0]
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    u = np.cross([0.3, -0.5, 0.8], n)
    u /= np.linalg.norm(u)
    vertices = flat[:, :1] * u + flat[:, 1:] * np.cross(n, u) + [1.0, 2.0, 3.0]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    turned = np.einsum("ij,j->i", np.cross(b - a, c - a), n) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return TriangleMesh(vertices, triangles.astype(np.int32), np.full(len(triangles), 7, np.int32))


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (0.6, -0.8, 0)])
def test_areas_fill_the_face_and_coarse_cells_keep_off_its_borders(normal):
    mesh = frame_with_hole(normal)
    samples = graded_samples(mesh, np.arange(len(mesh.faces)), SPACING, PARTS, MARGIN)
    wide = samples.covers > 0
    assert samples.area.sum() == pytest.approx(400 - 36, rel=1e-9)
    assert samples.area[wide] == pytest.approx(SPACING**2) and samples.covers[wide] == pytest.approx(0.5**1.5)
    # without the correction fine samples stand for a fifth of a cell each way; the lattice misses little at borders
    assert samples.area[~wide] == pytest.approx((SPACING / PARTS) ** 2, rel=0.01)
    sides = np.array([[-10, -10], [10, -10], [10, 10], [-10, 10], [-10, -10], [-3, -3], [3, -3], [3, 3], [-3, 3],
                      [-3, -3]], float)
    border = np.concatenate([np.linspace(sides[k], sides[k + 1], 500) for k in (0, 1, 2, 3, 5, 6, 7, 8)])
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    u = np.cross([0.3, -0.5, 0.8], n)
    u /= np.linalg.norm(u)
    off = cKDTree(border).query(np.column_stack([(samples.points - [1, 2, 3]) @ u,
                                                 (samples.points - [1, 2, 3]) @ np.cross(n, u)]))[0]
    assert off[wide].min() > MARGIN and off[~wide].max() < MARGIN + 2.5 * SPACING
    assert 300 < wide.sum() < 1000
    assert set(samples.face.tolist()) == {7} and samples.normals == pytest.approx(np.broadcast_to(n, (len(off), 3)))


@pytest.mark.parametrize("margin", [0.0, 0.125, 0.5])
def test_exactly_the_cells_that_come_near_a_border_are_split(margin):
    mesh = frame_with_hole()
    samples = graded_samples(mesh, np.arange(len(mesh.faces)), SPACING, PARTS, margin)
    wide = samples.covers > 0
    n = np.array([0.0, 0.0, 1.0])
    u = np.cross([0.3, -0.5, 0.8], n)
    u /= np.linalg.norm(u)
    middles = np.column_stack([(samples.points - [1, 2, 3]) @ u, (samples.points - [1, 2, 3]) @ np.cross(n, u)])[wide]
    first, second = (np.array([axis[0] @ u, axis[0] @ np.cross(n, u)]) for axis in lattice_axes(n[None]))
    outline = shapely.Polygon(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 10.0,
                              [np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 3.0])

    def off(at):
        """Distance of the cells round some places from the border; 0 where they meet it."""
        corners = [at + SPACING / 2 * (a * first + b * second) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return shapely.distance(shapely.polygons(np.stack(corners, axis=1)), outline.boundary)

    assert off(middles).min() > margin
    # cells beside them that are split come as near to the border as the places along it tell
    beside = np.concatenate([middles + SPACING * step for step in (first, second, -first, -second)])
    beside = beside[cKDTree(middles).query(beside)[0] > 1e-6]
    inside = shapely.contains_xy(outline, beside)
    assert inside.sum() > 100 and off(beside[inside]).max() <= margin + SPACING / 8


def test_no_place_is_farther_from_a_sample_than_half_a_diagonal():
    mesh = frame_with_hole()
    samples = graded_samples(mesh, np.arange(len(mesh.faces)), SPACING, PARTS, MARGIN)
    places = sample_surface(mesh, 50.0, seed=9).points
    far, row = cKDTree(samples.points).query(places)
    assert far.max() < SPACING * np.sqrt(0.5)
    near_border = samples.covers[row] == 0
    # some places of a coarse cell are nearest to a fine sample beside it
    assert np.quantile(far[near_border], 0.9) < 1.05 * SPACING / PARTS * np.sqrt(0.5)


def test_split_cells_are_those_of_the_lattice():
    mesh = frame_with_hole((0.6, -0.8, 0))
    rows = np.arange(len(mesh.faces))
    samples = graded_samples(mesh, rows, SPACING, PARTS, MARGIN)
    finest = graded_samples(mesh, rows, SPACING, PARTS, 100.0)
    cells = samples.subset(samples.covers > 0)
    fine, of = split_cells(cells, PARTS)
    assert len(fine) == PARTS**2 * len(cells) and (np.bincount(of) == PARTS**2).all()
    assert fine.area.sum() == pytest.approx(cells.area.sum()) and not fine.covers.any()
    assert cKDTree(finest.points).query(fine.points)[0].max() < 1e-9
    assert len(np.unique(np.round(fine.points, 6), axis=0)) == len(fine)
    both = joined([samples.subset(samples.covers == 0), fine])
    assert len(both) == len(finest)


def test_samples_without_coarse_ones_say_nothing_about_places():
    mesh = frame_with_hole()
    assert sample_surface(mesh, 5.0).covers is None
    assert joined([sample_surface(mesh, 5.0), sample_surface(mesh, 5.0, seed=1)]).covers is None
