"""Heights of layers over floors, against all choices of floors priced cell by cell."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from toolpath.plan_settings import CutData
from toolpath.roughing.layers_over_floors import (
    LAYER,
    LEFT,
    RAISED,
    SLOWER,
    Columns,
    Floors,
    even_between,
    left_to_floors,
)
from toolpath.strategies.depth_layers import STOCK_WORTH, layer_heights
from toolpath.tool_deflection import DeflectionModel

TOP, BOTTOM = 10.0, 0.0


def floors_at(heights, cells, top=TOP, apart=0.3):
    tips = tuple((z, np.array([[0.0, 0.0, z]])) for z in heights)
    return Floors(tips, np.full(len(heights), top), np.array(cells), apart)


def seconds(ends, columns, floors):
    """Price of all layers between some ends, cell by cell and floor by floor."""
    heights = [TOP, *(z for a, b in pairwise(ends) for z in layer_heights(a, b, columns.step))]
    out = LAYER * len(columns.low) * (len(heights) - 1)
    for above, z in pairwise(heights):
        for low, high in zip(columns.low, columns.high, strict=True):
            thick = min(high, above) - z
            if low <= z and thick > STOCK_WORTH:
                out += max(columns.share, thick / columns.step)
    for (z, _), top, cells in zip(floors.by_height, floors.top, floors.cells, strict=True):
        left = max(min(min(h for h in heights if h >= z - 1e-9), top) - z, 0.0)
        own = max(columns.share, left / columns.step)
        out += cells * (own if left > floors.apart else SLOWER * left / floors.apart)
    return out


@pytest.mark.parametrize("seed", range(6))
def test_the_ends_are_the_best_of_all_choices(seed):
    rng = np.random.default_rng(seed)
    floors = floors_at(np.sort(rng.uniform(0.5, 9.5, 3))[::-1].tolist(), rng.integers(1, 60, 3), rng.uniform(9.6, 10.0))
    low = rng.uniform(0.0, 9.0, 40)
    columns = Columns(low, np.minimum(low + rng.uniform(0.5, 10.0, 40), TOP), 1.6, rng.choice([0.4, 1.0]))
    at = [z + floors.apart * more for z in floors.heights for more in RAISED if BOTTOM < z + floors.apart * more < TOP]
    best = min(seconds([TOP, *sorted(some, reverse=True), BOTTOM], columns, floors)
               for n in range(5) for some in combinations(at, n))
    found = even_between(TOP, BOTTOM, columns, floors)
    assert found[0] == TOP and found[-1] == BOTTOM and found == sorted(found, reverse=True)
    assert seconds(found, columns, floors) <= best * (1.0 + 1e-9)


def test_layers_end_on_a_wide_floor_where_that_takes_no_more_of_them():
    columns = Columns(np.array([4.0] * 60 + [0.0] * 40), np.full(100, TOP), 3.0, 1.0)
    assert even_between(TOP, BOTTOM, columns, floors_at([4.0], [60])) == [TOP, 4.0, BOTTOM]


def test_a_small_floor_has_a_layer_of_its_own():
    columns, floors = Columns(np.array([0.0] * 100), np.full(100, TOP), 2.0, 1.0), floors_at([5.0], [2])
    assert even_between(TOP, BOTTOM, columns, floors) == [TOP, BOTTOM]
    assert [z for z, _ in floors.left_by([TOP, 8.0, 6.0, 4.0, 2.0, BOTTOM])] == [5.0]


def test_a_floor_with_little_stock_on_it_needs_no_layer():
    floors = floors_at([5.0], [50], top=5.2)
    assert floors.left([TOP, 6.0, 4.0, BOTTOM])[0] == pytest.approx(0.2)
    assert floors.left_by([TOP, 6.0, 4.0, BOTTOM]) == []
    assert floors.left([TOP, 5.0, BOTTOM])[0] == 0.0


BODY = ToolBody("T1", 1, 4.0, 0.0, 8.0, 4.0, 8.0, 4.0, 20.0)


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("factor", [1e-3, 0.6, 10.0])
def test_a_floor_keeps_what_its_finish_bears(factor, fixed):
    """Also where the setup gives the feed, which is not reduced."""
    bar = DeflectionModel(BODY, 1e-4, 1500.0, 0.25, 1.0, 2, 5000.0, fixed=fixed)
    fine = CutData(5000.0, 100.0, 50.0, 500.0, 1.0)
    bar = replace(bar, limit=factor * bar.deflection(100.0, 1.0, 4.0))
    left = left_to_floors(replace(fine, bending=bar), BODY, 1e-3, 1.0)
    feed = replace(fine, bending=bar).under(1e-3, 3.2).feed
    depths = np.linspace(0.0, 1.0, 1001)
    borne = max(d for d in depths if d == 0.0 or bar.deflection(feed, d, 4.0) <= bar.limit)
    assert left == pytest.approx(min(max(borne, LEFT), 1.0), abs=0.011)


def test_a_floor_keeps_little_where_nothing_tells_how_far_the_tool_bends():
    assert left_to_floors(CutData(5000.0, 100.0, 50.0, 500.0, 1.0), BODY, 0.05, 2.0) == 2.0 * LEFT
