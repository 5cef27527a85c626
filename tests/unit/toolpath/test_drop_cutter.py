"""The stable names outside checks call, with heights that can be worked out by hand."""

import math

import numpy as np
import pytest

from geometry.errors import GeometryError, SetupError
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import blocked_many, drop_grid, drop_tips
from geometry.tool_body import ToolBody
from toolpath.cutter.cutter import Cutter
from toolpath.drop_cutter import drop_cutter

RAMP = TriangleMesh(np.array([[-50.0, -50, -50], [50, -50, 50], [0, 90, 0]]), np.array([[0, 1, 2]]))  # z = x
POST = TriangleMesh(np.array([[0.0, 0, 5], [0, 0, 0], [0, 1e-3, 0]]), np.array([[0, 1, 2]]))


def test_ramp_of_45_degrees():
    xy = np.array([[1.0, 2.0]])
    ball = drop_cutter(RAMP, Cutter.ball(diameter=4, length=20), xy)
    assert ball == pytest.approx(1.0 + 2.0 * math.sqrt(2) - 2.0, abs=1e-12)
    assert drop_cutter(RAMP, Cutter.flat(diameter=4, length=20), xy) == pytest.approx(3.0, abs=1e-12)
    bull = drop_cutter(RAMP, Cutter.bull(diameter=4, length=20, corner_radius=0.5), xy)
    assert bull == pytest.approx(1.0 + 1.5 + 0.5 * math.sqrt(2) - 0.5, abs=1e-12)


def test_post_under_the_cutter():
    for rho in (0.0, 0.5, 1.2, 1.9):
        tip = drop_cutter(POST, Cutter.ball(diameter=4, length=20), [[rho, 0.0]])
        assert tip == pytest.approx(5.0 - 2.0 + math.sqrt(4.0 - rho * rho), abs=1e-12)
    assert drop_cutter(POST, Cutter.ball(diameter=4, length=20), [[2.0 + 1e-9, 0.0]]) == -np.inf


def test_nothing_below_and_nothing_at_all():
    cutter = Cutter.flat(diameter=1, length=5)
    assert drop_cutter(RAMP, cutter, [[500.0, 0.0]]) == -np.inf
    empty = TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    assert drop_cutter(empty, cutter, [[0.0, 0.0]]) == -np.inf
    assert not blocked_many(TriangleTree(empty), [[0.0, 0.0, 0.0]], 1.0, 0.0).any()
    assert drop_cutter(RAMP, cutter, []).shape == (0,)


def test_tree_is_taken_as_well_as_mesh():
    cutter = Cutter.ball(diameter=3, length=9)
    xy = np.random.default_rng(0).random((50, 2))
    np.testing.assert_array_equal(drop_cutter(TriangleTree(RAMP), cutter, xy), drop_cutter(RAMP, cutter, xy))


def test_cutter_of_a_tool_body():
    tool = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0)
    assert Cutter.of(tool) == Cutter.ball(diameter=3.0, length=9.0)


@pytest.mark.parametrize("xy", [[[1.0]], [1.0, 2.0], [[1.0, 2.0, 3.0]], [[np.nan, 0.0]], [["a", "b"]]])
def test_points_of_the_wrong_kind(xy):
    with pytest.raises(GeometryError, match="xy"):
        drop_cutter(RAMP, Cutter.ball(diameter=3, length=9), xy)


def test_other_wrong_arguments():
    with pytest.raises(TypeError, match="mesh"):
        drop_cutter("part.step", Cutter.ball(diameter=3, length=9), [[0.0, 0.0]])
    with pytest.raises(TypeError, match="cutter"):
        drop_cutter(RAMP, 3.0, [[0.0, 0.0]])
    for kind in ({"diameter": 0.0, "length": 1.0}, {"diameter": 1.0, "length": -1.0},
                 {"diameter": math.nan, "length": 1.0}):
        with pytest.raises(SetupError):
            Cutter.ball(**kind)
    with pytest.raises(SetupError, match="corner"):
        Cutter.bull(diameter=2.0, length=5.0, corner_radius=1.5)
    tree = TriangleTree(RAMP)
    with pytest.raises(GeometryError, match="corner"):
        drop_tips(tree, [[0.0, 0.0]], 1.0, 2.0)
    with pytest.raises(GeometryError, match="grid"):
        drop_grid(tree, 0.0, 0.0, 0.0, 5, 5, 1.0, 0.0)
    with pytest.raises(GeometryError, match="out"):
        drop_tips(tree, [[0.0, 0.0]], 1.0, 0.0, out=np.empty(3))
    with pytest.raises(GeometryError, match="vertex 1"):
        TriangleTree(TriangleMesh(np.array([[0.0, 0, 0], [np.inf, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])))
