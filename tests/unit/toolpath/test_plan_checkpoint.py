"""A plan that is cut off after an act, and gone on with by who knows no more than was kept, ends as if it were not.

``broken`` cuts one off after every act, each time with new objects that are told the bytes of the time before: what it
comes to is compared after each act and at the end, to the byte.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from service.serialization import Known, pack, unpack
from tests.hand_parts import Case, ball, corner, plan_part, tool
from tests.unit.toolpath.strategies.test_isoparametric import bowl
from toolpath.passes.pass_family import FinishTarget
from toolpath.plan_checkpoint import CheckpointKeeper, PackedLines, PlanSnapshot
from toolpath.plan_settings import CutData
from toolpath.planning.job_plan import Plan, plan_job
from toolpath.stock.stock_map import StockMap
from zones.reach.access_view import access_rotation

Stock = Callable[[Case], StockMap]


class Cut(Exception):
    """The plan ends here."""


class Each(CheckpointKeeper):
    """Keeps a plan after each of its acts.

    data : as it is kept, to begin with
    most : acts after which the plan is cut off
    """

    def __init__(self, known: Known, data: bytes | bytearray | None = None, most: int = 999) -> None:
        self.known, self.data, self.most = known, data, most
        self.kept: list[bytearray] = []

    def taken(self, use: Callable[[PlanSnapshot], Any]) -> Any:
        return None if self.data is None else use(unpack(self.data, self.known))

    def done(self, now: Callable[[], PlanSnapshot]) -> None:
        self.kept.append(pack(now(), self.known))
        if len(self.kept) == self.most:
            raise Cut


class Job:
    """A plan of a part with other settings, that can be made as often as one likes."""

    def __init__(self, case: Case, stock: Stock | None = None, cut: dict[str, CutData] | None = None,
                 trimmed: Any = None, **changes: Any) -> None:
        self.case, self.settings, self.trimmed = case, replace(case.settings, **changes), trimmed
        self.stock = stock or (lambda c: StockMap(c.stock_before.lattice, c.stock_before.top.copy(),
                                                  c.stock_before.cover.copy(), c.stock_before.part))
        self.cut = cut or {t: CutData(10_000, 800, 200, 3000, 0.3 * f.tool.diameter) for t, f in case.fields.items()}
        self.checks = [FinishTarget(case.samples.points[z.samples], case.samples.normals[z.samples], z.tips, 0.2)
                       for z in case.zones]
        self.known = Known({"ToolBody": {t: f.tool for t, f in case.fields.items()},
                            "ZoneArea": {z.id: z for z in case.zones}})

    def run(self, keeper: CheckpointKeeper) -> tuple[Plan, bytearray]:
        """A plan, and all there is of it and of the stock it leaves."""
        c, stock = self.case, self.stock(self.case)
        plan = plan_job(c.zones, self.checks, c.fields, self.cut, stock, self.settings, None, 4, self.trimmed, keeper)
        stock.settle(last=True)
        return plan, pack((plan, stock.top, stock.cover), self.known)

    def whole(self) -> tuple[list[PlanSnapshot], list[bytearray], Plan, bytearray]:
        """What is kept after each act of a plan that nothing happens to, and what it comes to."""
        keeper = Each(self.known)
        plan, end = self.run(keeper)
        return [unpack(k, self.known) for k in keeper.kept], keeper.kept, plan, end

    def broken(self, kept: list[bytearray], end: bytearray) -> None:
        """The same cut off after every act."""
        last = None
        for k in range(len(kept)):
            keeper = Each(self.known, last, 1)
            with pytest.raises(Cut):
                self.run(keeper)
            (last,) = keeper.kept
            assert last == kept[k], f"after {k + 1} acts"
        keeper = Each(self.known, last)
        assert self.run(keeper)[1] == end and not keeper.kept


@cache
def angle() -> Case:
    return plan_part(corner(), [ball(3.0), tool(4.0, 0.0, "T2")], scallop=0.05)


@cache
def angle_of_a_block() -> Case:
    return plan_part(corner(), [ball(3.0), tool(4.0, 0.0, "T2")], scallop=0.05, near_net=False)


@cache
def beside_a_block() -> Case:
    """The shank of the tool meets stock that other zones have to take off first."""
    return plan_part(corner(), [ball(3.0, neck=4.5, shank=8.0)], near_net=False, spare=6.0, density=8.0, scallop=0.05)


def bounded(case: Case) -> dict[str, CutData]:
    fine = {t: CutData(10_000, 500, 200, 3000, 0.3 * f.tool.diameter, 1.2) for t, f in case.fields.items()}
    return {t: replace(c, feed=800, finish=c) for t, c in fine.items()}


def seen_from_aside(case: Case) -> StockMap:
    """The stock of a case after another access has cut a slot into it, along an axis that leans."""
    turn = access_rotation(np.array([0.6, 0.0, 0.8]))
    lo, hi = case.part.mesh.bounds[0] - 1.0, case.part.mesh.bounds[1] + 1.0
    before = StockMap.block(TriangleTree(replace(case.part.mesh, vertices=case.part.mesh.vertices @ turn.T)),
                            np.array([lo, hi]), turn, 0.12)
    slot = np.array([[12.0, -3.0, 4.5], [12.0, 17.0, 4.5]]) @ turn.T
    before.cut(slot, tool(4.0, 0.0))
    stock = StockMap.box(case.tree, lo, hi, 0.12)
    stock.left_by([(before, turn)], float(lo[2]))
    return stock


def along_borders() -> Job:
    """A bowl whose passes follow the borders of its face, in both bands."""
    mesh, face = bowl(0.08, 0.05)
    case = plan_part(mesh, [ball(3.0)], scallop=0.05, chord=0.004, faces={2}, trimmed=(face,))
    return Job(case, trimmed={z.id: [face] for z in case.zones}, planes=(1.0,), roughing=False)


JOBS: dict[str, Callable[[], Job]] = {
    "in bands": lambda: Job(angle(), planes=(4.5, 3.2), semi_finishing=True),
    "layers alone": lambda: Job(angle(), planes=(4.5,), finishing=False),
    "finish alone": lambda: Job(angle(), planes=(4.5,), roughing=False),
    "hollows": lambda: Job(angle_of_a_block(), seen_from_aside, planes=(4.5,)),
    "short neck": lambda: Job(beside_a_block(), roughing=False),
    "along borders": along_borders,
    "engaged limit": lambda: Job(angle(), cut=bounded(angle()), planes=(4.5,)),
}
LONG = ("engaged limit", "short neck")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in JOBS])
@pytest.mark.slow
def test_a_plan_cut_off_after_every_act_ends_as_one_that_was_not(name):
    job = JOBS[name]()
    states, kept, plan, end = job.whole()
    made = [len(s.steps) for s in states]
    assert [s.acts for s in states] == list(range(1, len(states) + 1)) and made == sorted(made)
    assert plan.steps[0].id == "S04" and made[-1] == len(plan.steps) > 1
    hollows = [s.stock.cut is not None and len(s.stock.cut) > 0 for s in states]
    assert any(hollows) if name == "hollows" else not any(hollows)
    met = any(f.met.any() for s in states for t in s.tools for f in t.finishes)
    assert met or name != "short neck"
    along = [s.zone for s in plan.steps if s.strategy == "isoparametric"]
    assert along.count("Z1") == (2 if name == "along borders" else 0)  # once in each band
    job.broken(kept, end)


def test_a_plan_cut_off_once_goes_on_to_its_end():
    """And what is kept on the way there is what would have been kept without."""
    job = JOBS["hollows"]()
    states, kept, _, end = job.whole()
    for k in (1, len(states) // 2):
        keeper = Each(job.known, kept[k])
        assert job.run(keeper)[1] == end and keeper.kept == kept[k + 1:]


def test_lines_come_back_in_their_order():
    lines = [np.arange(6.0).reshape(2, 3), np.zeros((0, 3)), np.ones((1, 3))]
    assert [a.tobytes() for a in PackedLines.of(lines).lines()] == [a.tobytes() for a in lines]
    assert PackedLines.of([]).lines() == [] and PackedLines.of([]).points.shape == (0, 3)


@pytest.mark.parametrize("other", [
    lambda now: replace(now, tools=now.tools[:1]),
    lambda now: replace(now, stock=replace(now.stock, top=now.stock.top[1:])),
    lambda now: replace(now, stock=replace(now.stock, cut=np.zeros(0, np.int64), settled=np.zeros(0))),
    lambda now: replace(now, stock=None),
    lambda now: replace(now, tools=tuple(replace(t, layered=("S99",)) for t in now.tools)),
    lambda now: replace(now, tools=tuple(replace(t, finishes=tuple(
        replace(f, met=f.met[1:], residual=f.residual[1:]) for f in t.finishes)) for t in now.tools))],
    ids=["tools", "lattice", "hollows", "no stock", "layers", "checks"])
def test_what_does_not_fit_is_refused_before_any_stock_is_touched(other):
    job = JOBS["finish alone"]()
    states, *_ = job.whole()
    stock = job.stock(job.case)
    before = stock.top.tobytes(), stock.cover.tobytes()

    class Foreign(CheckpointKeeper):
        def taken(self, use: Callable[[PlanSnapshot], Any]) -> Any:
            with pytest.raises((ValueError, KeyError, TypeError, IndexError, AttributeError)):
                use(other(states[4]))
            raise Cut

    job.stock = lambda _: stock
    with pytest.raises(Cut):
        job.run(Foreign())
    assert (stock.top.tobytes(), stock.cover.tobytes()) == before
