"""The compiled loops of passes against twins that take all samples at once, byte for byte."""

import numpy as np
import pytest

from geometry.kernels.drop import bull_of
from geometry.kernels.outline import Stack
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from tests.oracle import pass_twins
from toolpath.cutter.cutter import Cutter
from toolpath.cutter.swept_envelope import Envelope
from toolpath.drop_cutter import drop_cutter
from toolpath.kernels.drag import TipLimit
from toolpath.passes.dragged_path import follow
from zones.kernels.lattice import LatticeFrame, noncut_lookup

CUTTERS = [Cutter.ball(diameter=4, length=9), Cutter.flat(diameter=4, length=9),
           Cutter.bull(diameter=6, corner_radius=1, length=9),
           pytest.param(Cutter.tapered(diameter=6, tip_diameter=2, angle_deg=8, length=15), marks=pytest.mark.slow),
           pytest.param(Cutter.barrel(diameter=8, tip_diameter=2, side_radius=40, length=15), marks=pytest.mark.slow)]


def bumpy(rng, n=24):
    """A surface of n x n nodes with steps, bumps and a hole, over 20 mm."""
    x, y = np.meshgrid(np.linspace(-10, 10, n), np.linspace(-10, 10, n))
    z = np.sin(x / 2) + np.cos(y / 3) + rng.normal(0, 0.05, x.shape) + np.where(x > 4, 3.0, 0.0)
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = (q.ravel() for q in (k[:-1, :-1], k[:-1, 1:], k[1:, :-1], k[1:, 1:]))
    faces = np.vstack([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    gone = rng.random(len(faces)) < 0.03
    return TriangleTree(TriangleMesh(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces[~gone]))


def path_over(rng, tree, cutter, y):
    x = np.linspace(-9, 9, 60)
    xy = np.column_stack([x, y + 0.2 * np.sin(x)])
    tips = drop_cutter(tree, cutter, xy)
    return [np.column_stack([xy, tips])[np.isfinite(tips)]]


def samples(rng, tree, n=400):
    xy = rng.uniform(-9, 9, (n, 2))
    z = drop_cutter(tree, Cutter.ball(diameter=1e-6, length=1), xy)
    lean = rng.normal(0, 0.4, (n, 2))
    normals = np.column_stack([lean, np.ones(n)])
    keep = np.isfinite(z)
    return np.column_stack([xy, z])[keep], (normals / np.linalg.norm(normals, axis=1, keepdims=True))[keep]


@pytest.mark.parametrize("cutter", CUTTERS, ids=str)
@pytest.mark.parametrize("seed", range(3))
def test_envelopes_and_crests_are_those_of_the_twin(cutter, seed):
    rng = np.random.default_rng(seed)
    tree = bumpy(rng)
    assert isinstance(cutter.shape, Stack) == (cutter.outline is not None)
    a, b = (Envelope(path_over(rng, tree, cutter, y), cutter) for y in (0.0, 1.1))
    points, normals = samples(rng, tree)
    left = a.along(points, normals)
    assert np.array_equal(left, pass_twins.along(a, points, normals))
    assert np.isfinite(left).sum() > 50 and np.isinf(left).any()
    across = np.tile([0.0, 1.0], (len(points), 1))
    crests = a.crests(b, tree, points, normals, across, 0.8)
    assert np.array_equal(crests, pass_twins.crests(a, b, tree, points, normals, across, 0.8))
    assert np.isfinite(crests).sum() > 5


@pytest.mark.parametrize("radius, corner", [(2.0, 2.0), (2.0, 0.0), (3.0, 0.5)])
def test_dragged_paths_are_those_of_the_twin(radius, corner):
    rng = np.random.default_rng(7)
    tree, frame = bumpy(rng), LatticeFrame(-12.0, -12.0, 0.5)
    noncut = np.where(rng.random((49, 49)) < 0.02, 2.0, -np.inf)
    compiled = TipLimit(tree.arrays, bull_of(radius, corner), 0.1, noncut, frame)

    def limit(xy):
        xy = np.ascontiguousarray(xy)
        return np.maximum(drop_cutter(tree, Cutter(2 * radius, corner, 9.0), xy) + 0.1,
                          noncut_lookup(noncut, frame, xy))

    points = broken = 0
    for way in ([[-9.5, -3.0], [9.5, 2.0]], [[-13.0, 0.0], [0.0, 0.1], [0.0, 9.0], [0.0, 13.0]], [[1.0, 1.0]]):
        got, expected = follow(compiled, np.array(way), 0.7, 0.001), follow(limit, np.array(way), 0.7, 0.001)
        assert np.array_equal(got[0], expected[0]) and np.array_equal(got[1], expected[1])
        points, broken = points + len(got[0]), broken + int(got[1].sum())
    assert points > 200 and broken
