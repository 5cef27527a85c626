"""A job that was cut off does not do again what it had done, and ends with the bytes of one that was left alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from examples.demo import write_small
from schemas.setup import Setup
from service import pipeline
from service.checkpoint_store import Kept
from service.stages import plan_prove_loop, resume
from service.stages.access_plan import AccessPlan
from service.stages.preparation import prepare
from service.stages.proof_samples import score
from service.stages.replanning import Attempt, ProofFeedback
from service.stages.resume import Resumed
from tests.synthetic_plan import step
from toolpath.counterexamples import NONE, Counterexamples
from toolpath.plan_checkpoint import NOTHING, CheckpointKeeper, PlanSnapshot
from toolpath.planning.job_plan import Plan, plan_job
from toolpath.stock.stock_map import StockMap, StockSnapshot
from verify.model import NcProgram, Proof, Spent
from zones.lattice import Lattice

TWO_WAYS = {"access": [{"id": "A1"}, {"id": "A2", "direction": [1.0, 0.0, 0.0], "work_offset": "G55"}]}
TURNED = {"machine": {"kind": "5-axis", "kinematics": "table-table-AC", "orientations": "given"},
          "access": [{"id": "A1", "direction": [0.6, 0.0, 0.8]}, {"id": "A2"}]}
PROVE: Callable[..., Proof] = plan_prove_loop.prove


class Cut(Exception):
    """The attempt ends here."""


class Job:
    """A job of the small part: its attempts, and what the last of them planned and proved."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, **fields: Any) -> None:
        self.folder, self.patch = folder, monkeypatch
        self.part, path = write_small(folder)
        self.setup = Setup.model_validate({**json.loads(path.read_text()), **fields})
        self.planned: list[str] = []
        self.proved = 0

    def run(self, name: str, kept: Kept | None, plans: int = 99, proofs: int = 99, acts: int = 999) -> dict[str, bytes]:
        """An attempt that ends before it plans or proves more than so often or after so many acts; its files."""
        self.planned, self.proved, self.acts = [], 0, 0

        class Watched(CheckpointKeeper):
            def __init__(self, keeper: CheckpointKeeper) -> None:
                self.taken = keeper.taken  # type: ignore[method-assign]
                self.keep = keeper.done

            def done(_self, now: Callable[[], PlanSnapshot]) -> None:
                self.acts += 1
                _self.keep(now)
                if self.acts == acts:
                    raise Cut

        def planner(zones: Any, *args: Any, keeper: CheckpointKeeper, **more: Any) -> Plan:
            if len(self.planned) == plans:
                raise Cut
            self.planned.append(zones[0].access)
            return plan_job(zones, *args, keeper=Watched(keeper), **more)

        def prove(*args: Any, **more: Any) -> Proof:
            if self.proved == proofs:
                raise Cut
            self.proved += 1
            return PROVE(*args, **more)

        self.patch.setattr(plan_prove_loop, "prove", prove)
        out = self.folder / name
        pipeline.plan(self.part, self.setup, out, lambda *_: None, planner=planner, kept=kept)
        return {p.name: p.read_bytes() for p in out.iterdir()}

    def cut(self, kept: Kept, **where: int) -> None:
        with pytest.raises(Cut):
            self.run("cut", kept, **where)


def kinds(kept: Kept) -> list[str]:
    assert kept.folder is not None
    return sorted(p.name.split("-")[0] for p in kept.folder.iterdir())


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("fields", [TWO_WAYS, TURNED], ids=["two ways up", "turned"])
def test_an_attempt_goes_on_where_the_one_before_was_cut_off(tmp_path, monkeypatch, fields):
    told: list[dict[str, int]] = []
    job, kept = Job(tmp_path, monkeypatch, **fields), Kept(tmp_path / "kept")
    job.cut(kept, plans=1)
    assert job.planned == ["A1"] and kinds(kept) == ["plan"]
    job.cut(kept, proofs=0)
    assert job.planned == ["A2"] and kinds(kept) == ["plan", "plan"]  # from the stock that the other left, if turned
    files = job.run("out", Kept(kept.folder, told.append))
    assert job.planned == [] and job.proved == 1 and told == [{"plan": 1}, {"plan": 2}]
    last = job.run("last", Kept(kept.folder, told.append))  # as one that was cut off while it wrote its files
    assert job.planned == [] and job.proved == 0 and told[-1] == {"plan": 2, "proof": 1}
    plain = job.run("plain", None)
    assert job.planned == ["A1", "A2"] and job.proved == 1
    assert len(plain) > 8 and files == plain and last == plain


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_an_attempt_goes_on_in_the_middle_of_a_plan(tmp_path, monkeypatch):
    """On five axes: the first access leans and is cut off once, the second is cut off twice and has its stock."""
    monkeypatch.setattr(resume, "ACTS_EVERY_S", 0.0)
    monkeypatch.setattr(resume, "ACTS_PAUSE", 0.0)
    told: list[dict[str, int]] = []
    job, kept = Job(tmp_path, monkeypatch, **TURNED), Kept(tmp_path / "kept")
    plain = job.run("plain", None)
    whole = job.acts
    job.cut(kept, acts=3)
    assert kinds(kept) == ["acts"] and job.planned == ["A1"]
    done = 3
    for acts, planned, left in ((whole // 2, ["A1", "A2"], ["acts", "plan"]), (2, ["A2"], ["acts", "plan"])):
        job.cut(Kept(kept.folder, told.append), acts=acts)
        done += acts
        assert job.planned == planned and kinds(kept) == left
    files = job.run("out", Kept(kept.folder, told.append))
    assert files == plain and job.planned == ["A2"] and job.acts == whole - done > 2
    assert kinds(kept) == ["plan", "plan", "proof"] and told[-1]["acts"] > 0 and told[-1]["plan"] == 1


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_rounds_are_gone_through_again_without_planning_or_proving(tmp_path, monkeypatch):
    """A job that is planned twice, for its first proof has something to say of the second access."""
    asked: list[int] = []

    def once(feedback: ProofFeedback, attempt: Attempt) -> ProofFeedback | None:
        asked.append(1)
        zone = next(z for z in attempt.zones if z.access == "A2")
        left = Counterexamples(left={zone.id: np.arange(len(zone.tips) // 2)})
        return ProofFeedback({"A2": left}, ("planned again",)) if len(asked) == 1 else None

    monkeypatch.setattr(plan_prove_loop, "learned", once)
    job, kept = Job(tmp_path, monkeypatch, **TWO_WAYS), Kept(tmp_path / "kept")
    plain = job.run("plain", None)
    assert job.planned == ["A1", "A2", "A2"] and job.proved == 2
    asked.clear()
    job.cut(kept, proofs=1)
    assert job.planned == ["A1", "A2", "A2"] and kinds(kept) == ["plan"] * 3 + ["proof"]
    asked.clear()
    told: list[dict[str, int]] = []
    assert job.run("out", Kept(kept.folder, told.append)) == plain
    assert job.planned == [] and job.proved == 1 and told[-1] == {"plan": 3, "proof": 1}


class Prepared:
    """The small part up to zones, and plans and proofs that cost nothing."""

    def __init__(self, folder: Path) -> None:
        part, path = write_small(folder)
        self.ready = prepare(part, Setup.model_validate(json.loads(path.read_text())), lambda *_: None)
        scored = score(self.ready)
        self.checks, self.samples = scored.checks(self.ready), scored.samples
        self.view = self.ready.views[0]
        self.tool = next(iter(self.view.fields.values())).tool
        self.made = 0

    def resumed(self, kept: Kept, **changes: Any) -> Resumed:
        return Resumed(kept, replace(self.ready, **changes), self.checks, self.samples)

    def side(self, keeper: CheckpointKeeper = NOTHING) -> AccessPlan:
        """A plan, with the stock as it leaves it."""
        self.made += 1
        left = StockMap(Lattice(0.0, 0.0, 0.5, 3, 2), np.arange(6.0).reshape(2, 3))
        return AccessPlan(self.view, Plan((step(1, self.tool, "waterline"),), ()), 12.5, left)

    def proof(self) -> Proof:
        """A proof that found nothing."""
        self.made += 1
        n = len(self.samples)
        none = np.zeros(n, np.int32)
        return Proof((), {}, np.zeros(n), none, none, np.ones(n, np.bool_), {}, {}, 0.0, Spent(1.0, 1.0, 0.0, 1, 1),
                     2.0, {1: 0.5}, {}, 0.001, 0.2, 0.15)

    def asked(self, kept: Kept, found: Counterexamples = NONE, before: tuple[AccessPlan, ...] = (),
              **changes: Any) -> int:
        """How many plans are made where one is asked for: none where it is kept."""
        self.made = 0
        self.resumed(kept, **changes).access_plan(self.view, before, found, self.side)
        return self.made


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    return Prepared(tmp_path_factory.mktemp("small"))


def test_a_plan_comes_back_with_the_stock_it_left(prepared, tmp_path):
    kept = Kept(tmp_path / "kept")
    first = prepared.resumed(kept).access_plan(prepared.view, (), NONE, prepared.side)
    again = prepared.resumed(kept).access_plan(prepared.view, (), NONE, pytest.fail)
    assert again.name == first.name and again.clearance == 12.5 and again.view is prepared.view
    assert again.plan.steps[0].tool is prepared.tool
    assert first.left is not None and again.left is not None and again.left.lattice == first.left.lattice
    assert again.left.top.tobytes() == first.left.top.tobytes()
    assert again.left.cover.tobytes() == first.left.cover.tobytes()


@pytest.mark.parametrize("harm", [lambda data: data[:-7], lambda data: data[:100] + b"\0" + data[101:], lambda _: b""])
def test_what_is_torn_is_made_again(prepared, tmp_path, harm):
    kept = Kept(tmp_path / "kept")
    assert prepared.asked(kept) == 1 and prepared.asked(kept) == 0
    (path,) = kept.folder.iterdir()
    path.write_bytes(harm(path.read_bytes()))
    assert prepared.asked(kept) == 1 and prepared.asked(kept) == 0


@pytest.mark.parametrize("words", [b"{}", b'{"c":["Popen","l"]}', b"[1,2]", b"null", b'[{"c":["Plan",[],[]]},1.0,[7]]'])
def test_what_is_whole_but_no_plan_is_made_again(prepared, tmp_path, words):
    kept = Kept(tmp_path / "kept")
    assert prepared.asked(kept) == 1
    (path,) = kept.folder.iterdir()
    kept.put(*path.name.split("-"), len(words).to_bytes(8, "little") + words)
    assert prepared.asked(kept) == 1 and prepared.asked(kept) == 0


UNDER_WAY = PlanSnapshot(3, (), StockSnapshot(np.zeros((2, 3)), np.ones((2, 3)), None, None), ())


def test_a_plan_under_way_is_there_until_the_plan_is(prepared, tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "ACTS_EVERY_S", 0.0)
    told: list[dict[str, int]] = []
    kept = Kept(tmp_path / "kept", told.append)
    found: list[PlanSnapshot | None] = []

    def make(keeper: CheckpointKeeper, change: Callable[[], object] = lambda: None) -> AccessPlan:
        found.append(keeper.taken(lambda now: now))
        keeper.done(lambda: replace(UNDER_WAY, acts=len(found), steps=prepared.side().plan.steps))
        assert kinds(kept) == ["acts"]
        change()
        if len(found) < 4:
            raise Cut
        return prepared.side()

    def harm() -> None:
        (path,) = (tmp_path / "kept").iterdir()
        path.write_bytes(path.read_bytes()[:-5])

    for change in (lambda: None, harm, lambda: None):
        with pytest.raises(Cut):
            prepared.resumed(kept).access_plan(prepared.view, (), NONE, partial(make, change=change))
    prepared.resumed(kept).access_plan(prepared.view, (), NONE, make)
    assert [now and now.acts for now in found] == [None, 1, None, 3] and kinds(kept) == ["plan"]
    assert told == [{"acts": 1}, {"acts": 2}]
    prepared.resumed(kept).access_plan(prepared.view, (), NONE, pytest.fail)


def test_a_plan_under_way_is_written_down_now_and_then(prepared, tmp_path, monkeypatch):
    """A quarter of a minute apart; farther where writing takes long, so that it takes next to nothing of the time."""
    clock = [0.0]
    monkeypatch.setattr(resume, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    written: list[float] = []

    def now(seconds: float) -> PlanSnapshot:
        written.append(clock[0])
        clock[0] += seconds
        return UNDER_WAY

    def make(keeper: CheckpointKeeper) -> AccessPlan:
        for k in range(4000):
            clock[0] = max(clock[0], 0.1 * k)
            keeper.done(partial(now, 0.0 if k < 500 else 2.0))
        return prepared.side()

    prepared.resumed(Kept(tmp_path / "kept")).access_plan(prepared.view, (), NONE, make)
    assert written == pytest.approx([15.0, 30.0, 45.0, 60.0, 182.0, 304.0], abs=0.2)


@pytest.mark.parametrize("words", [b"null", b"[1,2]", b'{"c":["Plan",[],[]]}'])
def test_what_is_no_plan_under_way_is_thrown_away(prepared, tmp_path, monkeypatch, words):
    monkeypatch.setattr(resume, "ACTS_EVERY_S", 0.0)
    kept = Kept(tmp_path / "kept")

    def make(keeper: CheckpointKeeper) -> AccessPlan:
        keeper.done(lambda: UNDER_WAY)
        (path,) = (tmp_path / "kept").iterdir()
        kept.put(*path.name.split("-"), len(words).to_bytes(8, "little") + words)
        assert keeper.taken(lambda now: now) is None and not path.exists()
        return prepared.side()

    prepared.resumed(kept).access_plan(prepared.view, (), NONE, make)


def test_what_came_from_anything_else_is_not_taken_over(prepared, tmp_path, monkeypatch):
    kept = Kept(tmp_path / "kept")
    assert prepared.asked(kept) == 1
    barred = Counterexamples(barred={"T1": np.zeros((1, 3))})
    before = replace(prepared.side(), name="b" * 64)
    assert prepared.asked(kept, barred) == 1 and prepared.asked(kept, barred) == 0
    assert prepared.asked(kept, before=(before,)) == 1
    mesh = replace(prepared.ready.part.mesh, vertices=np.nextafter(prepared.ready.part.mesh.vertices, 99.0))
    assert prepared.asked(kept, part=replace(prepared.ready.part, mesh=mesh)) == 1
    monkeypatch.setattr(resume, "COMPUTING", (*resume.COMPUTING, "pytest"))
    assert prepared.asked(kept) == 1 and len(kinds(kept)) == 5


def test_a_proof_is_of_the_very_text_it_was_made_of(prepared, tmp_path):
    kept, zone = Kept(tmp_path / "kept"), np.ones(len(prepared.samples), np.int32)
    text = [NcProgram("program", "G0 X1\n")]
    first = prepared.resumed(kept).proof(text, zone, prepared.proof)
    again = prepared.resumed(kept).proof(text, zone, pytest.fail)
    assert again.proved.tobytes() == first.proved.tobytes() and again.spent == first.spent and again.minutes == {1: 0.5}
    less = zone.copy()
    less[0] = 0
    for other, owner in (([NcProgram("program", "G0 X2\n")], zone), (text, less), (text * 2, zone),
                         ([replace(text[0], work_offset="G55")], zone), ([replace(text[0], turn=np.eye(3))], zone)):
        prepared.made = 0
        prepared.resumed(kept).proof(other, owner, prepared.proof)
        assert prepared.made == 1


def test_what_cannot_be_packed_or_written_does_not_stop_a_job(prepared, tmp_path):
    (tmp_path / "file").write_text("")
    assert prepared.asked(Kept(tmp_path / "file" / "kept")) == 1
    odd = AccessPlan(prepared.view, Plan((object(),), ()), 12.5, None)  # type: ignore[arg-type]
    kept = Kept(tmp_path / "kept")
    assert prepared.resumed(kept).access_plan(prepared.view, (), NONE, lambda _: odd).plan is odd.plan
    assert not (tmp_path / "kept").exists()


def test_nothing_is_kept_where_nobody_asks_for_it(prepared):
    assert prepared.asked(Kept()) == 1
