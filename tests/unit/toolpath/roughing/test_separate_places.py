"""Places of layers that are apart, against what they are by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.hand_parts import ball, plan_part, slope_field, tool
from toolpath.planning import tool_layers
from toolpath.roughing.separate_places import Place, SeparatePlaces, nearest_first
from toolpath.stock.stock_map import StockMap
from toolpath.strategies.depth_layers import LayerArea
from toolpath.workingsteps import TrajectoryKind
from zones.lattice import Lattice

LAT = Lattice.over(np.array([[-20.0, -6.0], [20.0, 6.0]]), 0.0, 0.25)
X, Y = np.meshgrid(LAT.x0 + LAT.step * np.arange(LAT.nx), LAT.y0 + LAT.step * np.arange(LAT.ny))
EVERYWHERE = LayerArea(np.ones(X.shape, bool))
CUTTER = tool(2.0, 0.0)


def standing(top, layers, discs=()):
    """Places of layers at some heights under a stock of a given top, (ny, nx) mm."""
    field = SimpleNamespace(lattice=LAT, tool=CUTTER, discs=discs, disc_radius=lambda disc, _: disc.radius)
    stock = StockMap(LAT, top.astype(float), part=np.full(X.shape, -np.inf))
    return SeparatePlaces(field, stock, [(z, EVERYWHERE) for z in layers])


def posts(*middles, size=1.0, top=10.0):
    """Square posts of stock round some places of the x axis."""
    return np.where(np.any([np.hypot(X - x, Y) <= size for x in middles], axis=0), top, 0.0)


def test_posts_far_apart_are_places_of_their_own():
    places = standing(posts(-12.0, 0.0, 12.0), [8.0, 6.0]).of(0, None)
    assert len(places) == 3
    assert (np.sum([p.mask for p in places], axis=0) == 1).all()  # every node belongs to one
    for p, x, low, high in zip(places, (-12.0, 0.0, 12.0), (-99.0, -6.0, 6.0), (-6.0, 6.0, 99.0), strict=True):
        assert p.mask[(X > low + 0.3) & (X < high - 0.3)].all() and not p.mask[(X < low - 0.3) | (X > high + 0.3)].any()
        assert np.abs(p.nodes[:, 0] - x).max() <= 1.0 + 2.0 * CUTTER.radius + 2.0 * LAT.step


@pytest.mark.parametrize(("gap", "count"), [(5.0, 1), (8.0, 2)])
def test_places_are_apart_by_more_than_the_cutter(gap, count):
    """Rings may be two radii from a post, and one radius more lies between the rings of two places."""
    assert len(standing(posts(-0.5 * gap - 1.0, 0.5 * gap + 1.0), [8.0]).of(0, None)) == (count if count > 1 else 0)


def test_a_shank_that_comes_below_the_top_joins_places():
    wide = SimpleNamespace(radius=12.0, height=3.0)
    for lowest, count in ((8.0, 2), (6.0, 0)):
        assert len(standing(posts(-7.0, 7.0), [9.0, lowest], [wide]).of(0, None)) == count


def test_a_bridge_joins_the_places_above_its_top():
    """A bar 8 mm high between posts: apart only in the layers that leave it standing in none of them."""
    top = np.maximum(posts(-10.0, 10.0), np.where(np.abs(Y) < 1.0, 8.0, 0.0))
    places = standing(top, [9.0, 8.5, 7.0])
    assert [len(places.of(k, None)) for k in range(3)] == [0, 0, 0]  # the layers below find the bar
    assert len(standing(top, [9.0, 8.5]).of(0, None)) == 2


def test_a_place_falls_apart_further_down():
    top = np.where(np.abs(X) < 14.0, 10.0, 0.0)
    top[(np.abs(X) < 8.0)] = 9.0
    places = standing(top, [8.0, 9.5])
    (lower,) = [len(places.of(1, None))]
    assert len(places.of(0, None)) == 0 and lower == 2
    left, right = places.of(1, None)
    assert places.of(1, left) == [] and places.of(1, right) == []


def test_the_nearest_place_comes_first():
    places = [Place(X > x, np.s_[:, :], np.array([[x, 0.0], [x + 1.0, 0.0]])) for x in (9.0, -15.0, 2.0, -4.0)]
    order = [p.nodes[0, 0] for p in nearest_first(places, np.array([3.5, 1.0, 8.0]))]
    assert order == [2.0, -4.0, -15.0, 9.0]
    assert [p.nodes[0, 0] for p in nearest_first(places[:2], None)] == [9.0, -15.0]


@pytest.mark.parametrize("flutes", [12.0, 1.0])  # mm: rims come after all layers, and after some of them
def test_two_hollows_are_cut_one_after_the_other(monkeypatch, flutes):
    """The same stock is left as level by level, and the tool changes from one hollow to the other once."""
    body = replace(ball(1.5), flute_length=flutes)

    def hollows(x, y):
        return -4.0 * (np.exp(-((x - 4.0)**2 + y**2) / 2.0) + np.exp(-((x + 4.0)**2 + y**2) / 2.0))

    def planned():
        c = plan_part(slope_field(hollows, size=14.0, n=40), [body], scallop=0.1, chord=0.02, near_net=False,
                      density=8.0)
        (layers,) = [s for s in c.plan.steps if s.operation == "roughing"]
        low = [t.points.mean(axis=0) for t in layers.trajectories if t.motion is TrajectoryKind.CUT]
        # in the hollows, below the layers in which one ring goes round both
        sides = [x > 0.0 for x, y, z in low if abs(abs(x) - 4.0) < 2.0 and abs(y) < 2.0 and z < -1.6]
        stock = c.stock_before.copied()
        for t in layers.trajectories:
            if t.motion is TrajectoryKind.CUT:
                stock.cut(t.points, layers.tool)
        lat = stock.lattice
        i, j = lat.cells(np.array([[-6.9, -6.9], [6.9, 6.9]]))  # off the sides, which rims only just touch
        return stock.top[i[0]:i[1], j[0]:j[1]], layers, int(np.diff(sides).sum())

    apart, its_layers, changes = planned()
    monkeypatch.setattr(tool_layers.SeparatePlaces, "of", lambda *_: [])
    together, layers, more = planned()
    assert changes == 1 < more
    np.testing.assert_allclose(apart, together, rtol=0.0, atol=0.1)  # a quarter of a layer: ways in differ
    assert its_layers.seconds < layers.seconds
