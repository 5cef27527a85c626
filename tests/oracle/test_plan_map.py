"""Cells of the plan view against shapely, area by area."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from zones.plan_view.plan_map import OUTSIDE, PlanArea, PlanMap


def random_areas(seed: int) -> list[PlanArea]:
    rng = np.random.default_rng(seed)
    out = []
    for k in range(int(rng.integers(1, 7))):
        centre, n = rng.uniform(-10, 10, 2), int(rng.integers(3, 30))
        angle = np.sort(rng.uniform(0, 2 * np.pi, n))
        r = rng.uniform(1, 8, n)
        ring = centre + np.column_stack([r * np.cos(angle), r * np.sin(angle)])
        shape = shapely.Polygon(ring).buffer(0)
        if rng.random() < 0.3:
            shape = shape.difference(shapely.Point(centre).buffer(0.4))
        out.append(PlanArea(f"A{k}", shape))
    return out


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31))
def test_a_place_lies_in_the_areas_shapely_says(seed: int) -> None:
    areas = random_areas(seed)
    lines = [np.array([[-20.0, -3.0], [20.0, 4.0]])]
    made = PlanMap.of(areas, lines)
    xy = np.random.default_rng(seed + 1).uniform(-15, 15, (400, 2))
    clear = np.all([shapely.distance(a.shape.boundary, shapely.points(xy)) > 2e-3 for a in areas], axis=0)
    want = np.column_stack([shapely.contains_xy(a.shape, xy[:, 0], xy[:, 1]) for a in areas])
    np.testing.assert_array_equal(made.over_at(xy)[clear], want[clear])


def test_areas_of_the_cells_add_up_to_the_overlay() -> None:
    areas = random_areas(5)
    made = PlanMap.of(areas)
    for k, a in enumerate(areas):
        assert made.faces.areas[made.over[:, k]].sum() == pytest.approx(a.shape.area, abs=2e-3 * a.shape.length)


def test_a_line_cuts_without_naming() -> None:
    square = PlanArea("H1", shapely.box(0, 0, 4, 2))
    made = PlanMap.of([square], [np.array([[2.0, 0.0], [2.0, 2.0]])])
    left, right, out, far = made.cell_at([[1, 1], [3, 1], [4.5, 1], [50, 1]])
    assert len({left, right, out, far}) == 4 and far == OUTSIDE
    assert made.over_at([[1, 1], [3, 1], [4.5, 1], [50, 1]])[:, 0].tolist() == [True, True, False, False]


def test_no_area_is_one_cell() -> None:
    made = PlanMap.of([])
    assert made.cell_at([[0.0, 0.0]]).tolist() == [0] and made.over.shape == (1, 0)
