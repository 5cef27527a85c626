"""The blank as heights for the page: shapes known by hand, and where it is offered at all."""

import numpy as np
import pytest

from service.stock import Bar, Blank
from service.viewstock import LOW, _grown, stock_chunks
from tests.hand_parts import as_part, box_mesh
from verify.model import NcProgram

UP = np.array([0.0, 0.0, 1.0])


class Ready:
    """What of a prepared job is asked here: a blank and views of a block of 10 x 6 x 4 mm."""

    def __init__(self, blank, rotation=None):
        from geometry.bvh import TriangleTree

        part = as_part(box_mesh((0, 0, 0), (10, 6, 4)))
        self.blank = blank
        self.views = [type("V", (), {"id": "A1", "rotation": np.eye(3) if rotation is None else rotation,
                                     "part": part, "tree": TriangleTree(part.mesh)})()]


class Frame:
    rotation = np.eye(3)


BOUNDS = np.array([[0.0, 0, 0], [10, 6, 4]])


def grid(blank):
    """Heights (ny, nx) of blank and part, mm, and the places of the nodes."""
    (chunk,), of = stock_chunks(Ready(blank), Frame(), [NcProgram("p", "")], [UP])
    assert of == [0]
    a = chunk.about
    x, y = np.meshgrid(a["x0_mm"] + a["step_mm"] * np.arange(a["nx"]), a["y0_mm"] + a["step_mm"] * np.arange(a["ny"]))
    out = []
    for name in ("blank", "part"):
        v = chunk.columns[name].rows()[:, 0].reshape(a["ny"], a["nx"])
        out.append(np.where(v > 0, a["foot_mm"] + a["unit_mm"] * (v - 1), np.nan))
    return x, y, *out


def test_a_box_and_a_bar_stand_as_high_as_they_may():
    box = Blank(BOUNDS, 1.0, 0.5, box=np.array([[-2.0, -2, 0], [12, 8, 5]]))
    x, y, top, part = grid(box)
    inside = (abs(x - 5) < 7.4) & (abs(y - 3) < 5.4)
    assert np.allclose(top[inside], 5.5, atol=0.011) and np.isnan(top[(abs(x - 5) > 7.6)]).all()
    assert np.allclose(part[(abs(x - 5) < 4.9) & (abs(y - 3) < 2.9)], 4.0, atol=0.011)
    x, y, top, _ = grid(Blank(BOUNDS, 1.0, 0.5, bar=Bar(5.0, 3.0, 0.0, 7.0, 6.0)))
    r = np.hypot(x - 5, y - 3)
    assert np.allclose(top[r < 7.4], 6.5, atol=0.011) and np.isnan(top[r > 7.6]).all()


def test_a_blank_grown_from_the_part_is_round_at_its_edges():
    x, y, top, _ = grid(Blank(BOUNDS, 1.0, 0.5))
    assert np.allclose(top[(abs(x - 5) < 4.5) & (abs(y - 3) < 2.5)], 5.5, atol=0.011)
    beside = (x > 10.2) & (x < 11.3) & (abs(y - 3) < 2.0)
    ball = 4.0 + np.sqrt(np.maximum(1.5**2 - (x - 10.0) ** 2, 0.0))
    assert np.abs(top - ball)[beside].max() < 0.3  # the part's edge lies between nodes


@pytest.mark.parametrize(("axis", "offered"), [(UP, True), (None, False), (np.array([0.0, 0.6, 0.8]), False)])
def test_it_is_offered_where_the_program_keeps_the_axis_of_an_access(axis, offered):
    chunks, of = stock_chunks(Ready(Blank(BOUNDS, 1.0, 0.5)), Frame(), [NcProgram("p", "")], [axis])
    assert (len(chunks), of) == ((1, [0]) if offered else (0, [None]))


def test_balls_over_single_heights():
    heights = np.full((9, 9), LOW)
    heights[4, 4] = 2.0
    out = _grown(heights, 1.0, 0.5)
    assert out[4, 4] == pytest.approx(3.0) and out[4, 6] == pytest.approx(2.0) and out[4, 7] < LOW / 2
    assert out[4, 5] == pytest.approx(2.0 + np.sqrt(0.75))
