"""Feeds along walls that layers take to size."""

from __future__ import annotations

import math

import pytest

from geometry.cutting_mechanics import compliance
from tests.hand_parts import box_mesh, field_of, tool
from toolpath.plan_settings import CutData
from toolpath.planning.tool_layers import ToolLayers
from toolpath.tool_deflection import DeflectionModel

DEEPEST = 6.0
QUARTER = math.pi / 2


def pace(limit: float):
    body = tool(4.0, 0.0, neck=10.0, stickout=16.0)
    finish = CutData(4000.0, 400.0, 100.0, 3000.0, 1.0,
                     bending=DeflectionModel(body, compliance(body), 1700.0, 0.23, limit, 4, 4000.0, True))
    layers = ToolLayers.__new__(ToolLayers)
    layers.field, layers.allowance = field_of(box_mesh([0, 0, 0], [8, 5, 4]), body), 0.15
    layers.cut = CutData(4000.0, 400.0, 100.0, 3000.0, 1.0, finish=finish)
    return layers._rim_pace(DEEPEST)


@pytest.mark.parametrize("limit", [0.005, 0.01])
def test_a_low_wall_lets_the_rim_go_faster_than_a_high_one(limit):
    made = pace(limit)
    feeds = [made.under(deep, QUARTER) for deep in (0.5, 1.0, 2.0, 4.0, DEEPEST)]
    assert feeds == sorted(feeds, reverse=True) and feeds[0] > 1.2 * feeds[-1]
    assert feeds[-1] == pytest.approx(made.feed)


@pytest.mark.parametrize("limit", [0.005, 0.01])
def test_no_rim_goes_faster_than_what_the_map_may_hide_allows(limit):
    made = pace(limit)
    assert made.hidden is not None
    assert all(made.feed <= made.under(deep, angle) <= made.hidden
               for deep in (0.0, 0.1, 1.0, 9.0) for angle in (0.0, 0.3, QUARTER, math.pi))
