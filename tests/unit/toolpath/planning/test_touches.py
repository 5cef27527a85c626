"""Touches, the last passes of a zone, are tried where the whole tool can go."""

import numpy as np

from tests.hand_parts import ball, corner, plan_part
from tests.unit.toolpath.test_plan_checkpoint import Job
from toolpath.planning.zone_finishing import REFINEMENTS, Finish


def test_no_touch_is_tried_where_stock_is_in_the_way_of_the_shank(monkeypatch):
    """Such touches went down from the top of the stock in hundreds of rounds, and cut nothing that was asked."""
    groups, touched, waiting = Finish._groups, [], []

    def watched(self, k, failing):
        out = groups(self, k, failing)
        if k > REFINEMENTS:
            met = self.stock.meets_bodies(self.checks.tips[failing], self.field.discs)
            waiting.append(int(met.sum()))
            touched.extend(float(np.linalg.norm(self.checks.tips[failing[met]] - line.points[-1], axis=1).min())
                           for line in out[0] if met.any())
        return out

    monkeypatch.setattr(Finish, "_groups", watched)
    case = plan_part(corner(), [ball(3.0, neck=4.5, shank=8.0)], near_net=False, spare=6.0, density=4.0, scallop=0.05)
    plan, _ = Job(case, roughing=False).run(Keeps())
    assert sum(waiting) > 0 and min(touched, default=1.0) > 1e-9 and plan.steps


class Keeps:
    """Keeps nothing of a plan."""

    def taken(self, _use):
        return None

    def done(self, _now):
        """Nothing is kept."""
