"""What layers leave over floors: no more than their allowance, however the rings fall."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hand_parts import plan_part, terraces, tool
from tests.plan_checks import SlowStock, dense
from toolpath.roughing.layers_over_floors import LEFT
from toolpath.workingsteps import TrajectoryKind

STEP_DOWN = 1.2  # mm, as ``plan_part`` has it for the tool
HIGH = 0.9  # mm, of the wall: two layers that are thinner than an island that stays for the next one


@pytest.mark.parametrize("beside", [1.0, 2.2])
def test_no_strip_at_the_border_of_a_floor_is_left_to_its_finish(beside):
    """A floor as wide as the tool and a bit more beside a wall: rings along the wall leave the strip at the border.

    On the demo part a strip of 1.2 mm stood 1.3 mm high there, and flank passes found no way in.
    """
    body = tool(4.0, 0.0)
    c = plan_part(terraces([0, 16], [0, 2, 2 + body.diameter + beside], [[HIGH], [0.0]], base=-1.0), [body],
                  near_net=False, density=8.0)
    stock = SlowStock(c)
    layers = [s for s in c.plan.steps if s.operation == "roughing"]
    for s in layers:
        for t in s.trajectories:
            if t.motion is not TrajectoryKind.RAPID:
                for tip in dense(t.points, 0.25):
                    stock.sink(tip, s.tool, 0.0)
    inside = (stock.x > 1.0) & (stock.x < 15.0)
    floor = stock.top[np.ix_((stock.y > 2.5) & (stock.y < 1.9 + body.diameter + beside), inside)]
    assert floor.max() <= LEFT * STEP_DOWN, floor.max()
