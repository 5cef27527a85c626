"""Figures of the report that are added up."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from service.report import report
from tests.synthetic_plan import BALL, step
from toolpath.planning.zone_finishing import ZonePlan
from toolpath.workingsteps import Trajectory, TrajectoryKind


def cut(length: float, feed: float) -> tuple[Trajectory, ...]:
    return (Trajectory(TrajectoryKind.CUT, np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]), feed),)


@pytest.fixture
def planned():
    """What the report says of zone Z1 whose workingsteps are given."""
    zone = SimpleNamespace(id="Z1")
    ready = SimpleNamespace(inputs=SimpleNamespace(quality=SimpleNamespace(scallop_height_mm=0.01)))

    def ask(*steps):
        first = next((s.id for s in steps if s.zone == "Z1"), None)
        plan = ZonePlan(zone, first, "zigzag", 0.3, 5, np.zeros(0, np.int64))
        entry = {"id": "Z1", "rejected": []}
        return report._planned(ready, zone, entry, plan, {s.id: s for s in steps}, SimpleNamespace(zones={}))

    return ask


def test_a_zone_counts_all_its_workingsteps(planned):
    got = planned(step(2, BALL, "zigzag", zone="Z1", trajectories=cut(30.0, 600.0)),
                  step(3, BALL, "waterline", zone="Z2", trajectories=cut(500.0, 600.0)),
                  step(4, BALL, "zigzag", zone="Z1", trajectories=cut(20.0, 300.0)))
    assert (got["step"], got["steps"], got["passes"]) == ("S02", ["S02", "S04"], 5)
    assert (got["cutting_length_mm"], got["machining_time_s"]) == (50.0, 7.1)  # 7 s at the feeds


def test_a_zone_nothing_was_planned_for_has_none(planned):
    got = planned(step(3, BALL, "waterline", zone="Z2", trajectories=cut(500.0, 600.0)))
    assert got["steps"] == [] and "step" not in got and got["machining_time_s"] == 0.0
