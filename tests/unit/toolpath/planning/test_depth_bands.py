"""Heights that all tools finish down to before any goes below."""

from __future__ import annotations

import numpy as np
import pytest

from toolpath.counterexamples import HighWall
from toolpath.planning.depth_bands import MIN_DEPTH, planes


def test_without_high_walls_there_is_no_plane():
    assert planes([], 1.0, 8.0) == ()
    assert planes([HighWall(10.0, 2.0, 1.0)], 0.0, 8.0) == ()  # just as high as it may be free


@pytest.mark.parametrize("corner", [0.0, 0.5, 1.5, 3.0])
@pytest.mark.parametrize("thickness", [0.3, 0.6, 1.0])
def test_bands_are_even_and_no_wall_is_free_for_more_than_asked(corner, thickness):
    wall = HighWall(30.0, 6.0, thickness)
    heights = planes([wall], corner, 8.0)
    depths = -np.diff([wall.top, *heights, wall.bottom])
    assert np.allclose(depths, depths[0])
    deepest = max(8.0 * thickness - corner, MIN_DEPTH * thickness)
    assert depths[0] <= deepest * (1.0 + 1e-9) < depths[0] * (1.0 + 1.0 / len(heights))


def test_the_thinnest_wall_sets_the_depth_and_all_of_them_the_span():
    heights = planes([HighWall(20.0, 10.0, 1.0), HighWall(15.0, 5.0, 0.5)], 0.0, 8.0)
    assert heights == pytest.approx((16.25, 12.5, 8.75))
