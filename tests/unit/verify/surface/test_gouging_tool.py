"""Which tool a gouge is told of, where another one takes the same place along its ray and leaves the part whole."""

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import box_mesh, tool
from verify.model import ProofSetup
from verify.moves import Moves
from verify.surface.surface_cuts import _by_own_tool, _Shooting, _Table

BOX = box_mesh([0, 0, 0], [10, 10, 10])
GRAZES = 0.001  # mm that the first tool goes into the wall at x = 10; the second goes 0.2 mm


@pytest.mark.parametrize(("first", "told"), [(GRAZES, [1, 1, 1]), (0.1, [0, 1, 1])])
def test_a_tool_that_leaves_the_part_whole_is_not_told(first, told):
    """Rays at the upper edge run down the wall, so the first tool takes a place as deep as the second does."""
    start = np.array([[13.0 - first, -5.0, -1.0], [12.8, -5.0, -1.0]])
    moves = Moves(start, start + [0.0, 20.0, 0.0], np.ones(2, bool), np.array([0, 1], np.int32))
    points = np.array([[9.9995, 5.0, 10.0], [9.9, 5.0, 10.0], [9.95, 2.0, 10.0]])
    table = _Table(points, np.tile([0.0, 0.0, 1.0], (3, 1)), np.full(3, 6, np.int32), np.zeros(3),
                   -np.array([0.2, 0.1, 0.15]), np.array([0, 1, 1], np.int32))
    tools, setup = (tool(6.0, 0.0), tool(6.0, 0.0, "T2")), ProofSetup(gouge_tolerance=0.01)
    shot = _Shooting(BOX.bounds, moves, tools, setup, 1, 1.0)
    assert _by_own_tool(table, np.arange(3), TriangleTree(BOX), shot).tolist() == told
