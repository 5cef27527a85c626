"""What a flat end leaves at the top of a wall, where the last digit of a program decides."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hand_parts import tool
from toolpath.stock.residual_map import UNTOUCHED, ResidualMap

TOP = 26.49999  # mm, of a sample just below a wall that ends at 26.5


@pytest.mark.parametrize(("z", "left"), [(26.5, UNTOUCHED), (26.499996, UNTOUCHED), (26.49996, UNTOUCHED),
                                         (26.49994, 0.0), (26.49985, 0.0), (20.0, 0.0)])
def test_a_sharp_end_counts_on_a_wall_only_where_the_program_brings_it_down_to_the_place(z, left):
    wall = ResidualMap(np.array([[0.0, 2.0, TOP]]), np.array([[0.0, -1.0, 0.0]]))
    wall.cut(np.array([[-3.0, 0.0, z], [3.0, 0.0, z]]), tool(4.0, 0.0))
    assert wall.residual[0] == pytest.approx(left, abs=1e-9)


def test_a_level_place_is_measured_from_the_rounded_height():
    floor = ResidualMap(np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, 1.0]]))
    floor.cut(np.array([[-3.0, 0.0, 1.00004], [3.0, 0.0, 1.00004]]), tool(4.0, 0.0))
    assert floor.residual[0] == pytest.approx(0.0, abs=1e-9)
