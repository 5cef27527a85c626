"""A plan that continues from a state of the last one ends with the same bytes as a plan from the beginning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from service.serialization import pack
from tests.hand_parts import ball
from tests.unit.toolpath.test_plan_checkpoint import Each, Job, angle, angle_of_a_block, seen_from_aside
from toolpath.counterexamples import NONE, Asked, Counterexamples, HighWall, WatchedExamples
from toolpath.plan_checkpoint import PlanSnapshot, StockSnapshot
from toolpath.planning import plan_history
from toolpath.planning.job_plan import plan_job
from toolpath.planning.plan_history import PlanHistory
from toolpath.workingsteps import TrajectoryKind, Workingstep

JOBS: dict[str, Callable[[], Job]] = {
    "in bands": lambda: Job(angle(), planes=(4.5, 3.2), semi_finishing=True),
    "hollows": lambda: Job(angle_of_a_block(), seen_from_aside, planes=(4.5,)),
}
T1, T2 = ball(3.0), ball(1.0, "T2")


def made(job: Job, found: Counterexamples, history: PlanHistory | None = None) -> tuple[list[Workingstep], Any, int]:
    """Steps, all bytes of plan and stock, and the number of acts that a plan took."""
    c, stock, keeper = job.case, job.stock(job.case), Each(job.known)
    plan = plan_job(c.zones, job.checks, c.fields, job.cut, stock, replace(job.settings, found=found), keeper=keeper,
                    history=history)
    stock.settle(last=True)
    ends = bytes(pack(plan, job.known)), stock.top.tobytes(), stock.cover.tobytes()
    return list(plan.steps), ends, len(keeper.kept)


def amid(step: Workingstep) -> np.ndarray:
    """A place in the middle of the cuts of a step, (1, 3)."""
    cuts = [t.points for t in step.trajectories if t.motion is TrajectoryKind.CUT]
    line = cuts[len(cuts) // 2]
    return line[len(line) // 2][None]


@pytest.mark.slow
@pytest.mark.parametrize("name, kinds", [("in bands", ("dug", "left")), ("hollows", ("packed", "barred"))])
def test_a_plan_goes_on_from_the_last_state_without_anything_new(name, kinds):
    job, counts = JOBS[name](), []
    for kind in kinds:
        history = PlanHistory()
        steps, first, acts = made(job, NONE, history)
        last, early = steps[-1], steps[0]
        found = Counterexamples(**{kind: {last.zone: np.arange(40)} if kind == "left" else {last.tool.id: amid(last)}})
        _, again, count = made(job, found, history)
        assert again == made(job, found)[1]
        counts.append(count)
    places = found.barred.get(early.tool.id, np.zeros((0, 3)))
    more = replace(found, barred={**found.barred, early.tool.id: np.vstack([places, amid(early)])})
    assert made(job, more, history)[1] == made(job, more)[1] != first
    assert min(counts) < acts, counts
    assert made(job, replace(more, unheld=(HighWall(5.0, 0.0, 0.5),)), history)[2] == acts


def questions(seed: int) -> tuple[Asked, WatchedExamples, Counterexamples, bool]:
    """Questions at random, and whether a new counterexample at random changes an answer."""
    rng = np.random.default_rng(seed)
    asked = [rng.uniform(-6, 6, (rng.integers(1, 5), 3)) for _ in range(4)]
    new = {str(rng.choice(["T1", "T2"])): rng.uniform(-6, 6, (1, 3)) for _ in range(2)}
    kind = str(rng.choice(["dug", "barred", "packed"]))
    before = WatchedExamples.of(Counterexamples(barred={"T1": np.array([[9.0, 9.0, 0.0]])}))
    now = replace(Counterexamples(barred=before.barred), **{
        kind: {**getattr(before, kind), **{t: np.vstack([getattr(before, kind).get(t, np.zeros((0, 3))), p])
                                           for t, p in new.items()}}})
    changed = False
    for tool in (T1, T2):
        for points in asked:
            answers = [(e.care(tool, points), e.bars(tool, points).tolist(), e.crowds(tool, points).tolist())
                       for e in (before, now)]
            changed |= answers[0] != answers[1]
    return before.questions.taken(), before, now, changed


def test_whatever_changes_an_answer_meets_what_was_asked():
    met, changes = [], []
    for seed in range(300):
        asked, before, now, changed = questions(seed)
        meets = asked.meets(now.since(before))
        assert meets or not changed, seed
        met.append(meets)
        changes.append(changed)
    assert 30 < sum(changes) <= sum(met) < 290


def test_zones_and_walls_that_are_new():
    before = Counterexamples(left={"Z1": np.array([3, 4])}, lost={"Z1": np.array([3])})
    watched = WatchedExamples.of(before)
    watched.aims("Z1", 0.02, 6)
    asked = watched.questions.taken()
    assert not asked.meets(before.since(before))
    assert asked.meets(replace(before, left={"Z1": np.array([3, 4, 5])}).since(before))
    assert asked.meets(replace(before, lost={"Z1": np.array([3, 4])}).since(before))
    assert not asked.meets(replace(before, left={**before.left, "Z2": np.array([0])}).since(before))
    assert replace(before, unheld=(HighWall(5.0, 0.0, 0.5),)).since(before).unheld
    assert not watched.questions.taken().zones  # each question counts once


def state(acts: int) -> PlanSnapshot:
    return PlanSnapshot(acts, (), StockSnapshot(np.zeros(1000), np.zeros(1000), None, None), ())


def kept_acts(history: PlanHistory, found: Counterexamples = NONE) -> int | None:
    return history.taken(found, lambda s: s.acts)


def test_states_stay_within_their_bytes_and_spread_out(monkeypatch):
    clock = iter(range(1000))
    monkeypatch.setattr(plan_history.time, "monotonic", lambda: float(next(clock)))
    history, nothing = PlanHistory(5 * 16_000), WatchedExamples.of(NONE)
    history.begin(NONE, 0)
    for k in range(64):
        history.done(nothing.questions.taken(), lambda k=k: state(k + 1))
    acts = [s.snapshot.acts for s in history._states]
    assert len(acts) == 5 and acts[-1] == 64 and np.diff([0, *acts]).max() <= 32
    assert kept_acts(history) == 64
    small = PlanHistory(3 * 16_000)  # of which a state may take a quarter
    small.begin(NONE, 0)
    small.done(nothing.questions.taken(), lambda: state(1))
    assert kept_acts(small) is None


def test_what_is_not_known_from_the_first_act_on_is_not_gone_on_from():
    history, nothing = PlanHistory(), WatchedExamples.of(NONE)
    history.begin(NONE, 3)  # an earlier attempt at the job did three acts
    history.done(nothing.questions.taken(), lambda: state(4))
    assert kept_acts(history) is None
    history.begin(NONE, 0)
    history.done(nothing.questions.taken(), lambda: state(1))
    assert kept_acts(history) == 1
    assert kept_acts(PlanHistory(max_bytes=0)) is None
