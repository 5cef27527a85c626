"""Rings computed by another thread: the lines of the layer are the same, also where the stock has changed since."""

import numba
import numpy as np
import pytest

from tests.hand_parts import field_of, tool, walls
from toolpath.roughing import rings_ahead
from toolpath.roughing.rings_ahead import RingsAhead
from toolpath.stock.stock_map import StockMap
from toolpath.strategies import depth_layers
from zones.reach import tip_field

ALLOWANCE, SIDE, LOW, HIGH = 0.3, 2.4, 3.0, 4.0


@pytest.fixture
def begun():
    """A field, stock around its part, and the area of its layers: everywhere."""
    mesh = walls()
    field = field_of(mesh, tool(3.0, 0.0))
    stock = StockMap.box(field.tree, mesh.bounds[0] - 1.0, mesh.bounds[1] + 1.0, 0.1)
    stock.top[:] = np.minimum(stock.top, HIGH + 0.8)
    return field, stock, depth_layers.LayerArea(np.ones((field.lattice.ny, field.lattice.nx), bool))


def lines_of(field, stock, place, z, laid=None):
    return [[line.points.tobytes() for line in lines]
            for lines in depth_layers.layer(field, stock, z, place, ALLOWANCE, SIDE, laid=laid)]


def cut(field, stock, place, z):
    for lines in depth_layers.layer(field, stock, z, place, ALLOWANCE, SIDE):
        for line in lines:
            stock.cut(line.points, field.tool)


def known(*_):
    raise AssertionError("the rings are known, and were computed again")


def test_rings_begun_before_the_layer_above_is_cut_are_those_of_the_layer(begun, two_threads, monkeypatch):
    field, stock, place = begun
    with RingsAhead(field, ALLOWANCE, SIDE) as ahead:
        ahead.begin(LOW, place, stock)
        cut(field, stock, place, HIGH)
        laid = ahead.of(LOW)
        assert laid is not None and ahead.of(HIGH) is None
    expected = lines_of(field, stock, place, LOW)
    assert sum(map(len, expected)) > 2
    monkeypatch.setattr(depth_layers, "layer_rings", known)
    assert lines_of(field, stock, place, LOW, laid) == expected


def test_rings_are_computed_anew_where_something_cut_deeper_meanwhile(begun, two_threads):
    field, stock, place = begun
    with RingsAhead(field, ALLOWANCE, SIDE) as ahead:
        ahead.begin(LOW, place, stock)
        laid = ahead.of(LOW)
    assert laid is not None
    whole = lines_of(field, stock, place, LOW)
    stock.top[:, :stock.lattice.nx // 2] = LOW - 1.0
    half = lines_of(field, stock, place, LOW)
    assert half != whole and lines_of(field, stock, place, LOW, laid) == half


def test_nothing_begins_where_numba_has_one_thread(begun):
    field, stock, place = begun
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        with RingsAhead(field, ALLOWANCE, SIDE) as ahead:
            ahead.begin(LOW, place, stock)
            assert ahead.of(LOW) is None
    finally:
        numba.set_num_threads(before)


def test_an_error_is_met_by_whoever_asks_for_the_rings(begun, two_threads, monkeypatch):
    field, stock, place = begun

    def fails(*_):
        raise ValueError("no rings")

    monkeypatch.setattr(rings_ahead, "layer_rings", fails)
    with RingsAhead(field, ALLOWANCE, SIDE) as ahead:
        ahead.begin(LOW, place, stock)
        with pytest.raises(ValueError, match="no rings"):
            ahead.of(LOW)


def test_two_heights_of_a_field_are_kept(begun, monkeypatch):
    field, asked = begun[0], []
    first = {z: field.nearest_blocked(z)[0].copy() for z in (HIGH, LOW)}
    monkeypatch.setattr(tip_field, "blocked_beside", lambda *a: asked.append(a))
    for z in (LOW, HIGH, LOW):
        assert (field.nearest_blocked(z)[0] == first[z]).all()
    assert asked == []
    field.nearest_blocked(LOW - 1.0)
    field.nearest_blocked(LOW)
    assert len(asked) == 1
