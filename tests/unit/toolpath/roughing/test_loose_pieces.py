"""Pieces that layers would cut loose in an opening, against what they are by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from toolpath.roughing.loose_pieces import loose_pieces
from toolpath.stock.stock_map import StockMap
from zones.lattice import Lattice

TOP, RADIUS = 10.0, 3.0
LAT = Lattice.over(np.array([[-40.0, -40.0], [40.0, 40.0]]), 0.0, 0.5)
X, Y = np.meshgrid(LAT.x0 + LAT.step * np.arange(LAT.nx), LAT.y0 + LAT.step * np.arange(LAT.ny))
AWAY = np.hypot(X, Y)


def found(opening, area, floor=None):
    """Loose places in an opening of a plate, (ny, nx) bool; floor: places of the opening over a floor of the part."""
    tool = ToolBody("T1", 1, 2.0 * RADIUS, 0.0, 24.0, 6.0, 24.0, 6.0, 30.0)
    part = np.where(opening if floor is None else opening & ~floor, -np.inf, 0.0)
    free = opening & ~_grown(~opening)
    field = SimpleNamespace(lattice=LAT, tool=tool, height=np.where(free, -np.inf, TOP))
    return loose_pieces(field, StockMap(LAT, np.full(X.shape, TOP), part=part), 0.0, free & area)


def _grown(mask):
    """A mask and what is within the radius of the tool round it."""
    from scipy import ndimage
    return ndimage.distance_transform_edt(~mask) * LAT.step <= RADIUS


def test_the_middle_of_a_hole_is_cut_away():
    out = found(AWAY <= 13.0, AWAY >= 9.0)
    assert out[AWAY <= 5.0].all() and not out[AWAY >= 9.0].any()


def test_a_piece_larger_than_what_is_cut_round_it_stays():
    assert not found(AWAY <= 36.0, AWAY >= 31.0).any()


@pytest.mark.parametrize("opening, area, floor", [
    (AWAY <= 13.0, (AWAY >= 9.0) & (X < 0.0), None),  # one half of the wall is not cut: the piece hangs on it
    ((np.abs(X) <= 13.0) & (Y < 13.0), np.abs(X) >= 9.0, None),  # a slot that is open at its end
    (AWAY <= 13.0, AWAY >= 9.0, AWAY <= 5.0),  # it stands on the part
], ids=["at a wall", "open", "on a floor"])
def test_what_is_held_or_lies_outside_stays(opening, area, floor):
    assert not found(opening, area, floor).any()
