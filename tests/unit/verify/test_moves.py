"""Moves in pieces: the same path, with the same tool axes."""

import numpy as np
import pytest

from geometry.errors import SetupError
from geometry.tool_body import ToolBody
from verify.moves import Moves, cutter_table
from verify.tool_axes import ToolAxes


def test_pieces_of_moves_keep_path_and_turn():
    start, end = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 1.0]]), np.array([[3.0, 0.0, 1.0], [3.0, 5.0, 1.0]])
    first, last = np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]), np.array([[0.0, 0.6, 0.8], [0.6, 0.0, 0.8]])
    moves = Moves(start, end, np.array([True, False]), np.array([0, 1], np.int32), ToolAxes.between(first, last))
    pieces, of = moves.parted(np.array([3, 2]))
    assert of.tolist() == [0, 0, 0, 1, 1] and pieces.feed.tolist() == [True] * 3 + [False] * 2
    assert pieces.tool.tolist() == [0, 0, 0, 1, 1]
    assert (pieces.start[[0, 3]] == start).all() and (pieces.end[[2, 4]] == end).all()
    assert pieces.start[1:3] == pytest.approx(pieces.end[:2]) and pieces.start[4] == pytest.approx(pieces.end[3])
    assert pieces.axes.angle == pytest.approx(moves.axes.angle[of] / np.array([3, 3, 3, 2, 2]))
    assert pieces.axes.axis[4] == pytest.approx(moves.axes.middle[1])


def cone(flutes):
    """A pointed chamfer mill of 90 degrees, 8 mm wide: the tangent of 45 degrees is 1 less 1e-16."""
    return ToolBody("T4", 4, 8.0, 0.0, flutes, 7.76, 10.0, 8.0, 30.0, named="chamfer",
                    cone_height=4.0 / np.tan(np.radians(45.0)))


def test_flutes_that_end_at_the_cone_reach_to_it():
    tool = cone(4.0)
    assert tool.cone_height > 4.0
    assert cutter_table([tool])[0].tolist() == [4.0, 4.0, tool.cone_height, tool.cone_height, *[0.0] * 5]
    with pytest.raises(SetupError) as short:
        cutter_table([cone(3.99)])
    assert short.value.code == "flute_too_short" and short.value.subjects == ("T4",) and short.value.measured == 3.99
