"""What the next plan of a job is told of what a proof found."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from examples.demo import write_small
from schemas.setup import Setup
from service import pipeline
from service.stages import plan_prove_loop
from service.stages.access_plan import ProofFrame
from service.stages.replanning import MAX_ENGAGEMENT_FINDINGS, MAX_OTHER_FINDINGS, Attempt, ProofFeedback, learned
from tests.hand_parts import SHORT_TOOLS
from toolpath.counterexamples import BARRED, CARE, CLOSER, STRICTER, Counterexamples
from toolpath.lines import Line
from toolpath.planning.job_plan import plan_job
from verify.model import Finding, FindingKind

TOOL = SHORT_TOOLS["flat"]
TILT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # setup frame -> access
TEXT = "%\n(S01 several zones roughing depth_layers T1: F1)\nG1 X1\n(S02 Z1 finishing flank T1: F1)\nG1 X2\nX3\n"


def found(kind, line=3, tip=(1.0, 2.0, 3.0), depth=0.3, near=False):
    return Finding(kind, "p.ngc" if line else "", line, None, None, (9.0, 9.0, 9.0), depth, 0.1, "too much", near=near,
                   tip=tip)


def attempt(*findings, counts=None, proved=(True,) * 6, answered=(1, 1, 0, 2, 2, 2)):
    steps = [SimpleNamespace(id="S01", tool=TOOL, strategy="depth_layers"),
             SimpleNamespace(id="S02", tool=TOOL, strategy="flank")]
    side = SimpleNamespace(view=SimpleNamespace(id="A1", rotation=TILT), plan=SimpleNamespace(steps=steps))
    program = SimpleNamespace(name="p.ngc", text=TEXT, work=SimpleNamespace(steps=steps))
    zones = [SimpleNamespace(id="Z1", access="A1"), SimpleNamespace(id="Z2", access="A1")]
    proof = SimpleNamespace(findings=findings, counts={"any": len(findings)} if counts is None else counts,
                            proved=np.array(proved))
    owner = np.array([1, 1, 1, 2, 2, 2])
    return Attempt([side], [program], zones, owner, np.array(answered), ProofFrame("A1", np.eye(3), None), proof)


@pytest.mark.parametrize("kind", [FindingKind.PLUNGE, FindingKind.LOAD])
def test_a_place_that_was_dug_is_gone_to_with_care_and_then_not_at_all(kind):
    once = learned(ProofFeedback(), attempt(found(kind)))
    there = np.array([[1.0, 3.0, -2.0]])  # in the frame of the access
    assert np.allclose(once.along("A1").dug[TOOL.id], there) and not once.along("A1").barred
    assert "S01" in once.notes[0] and "with care" in once.notes[0] and "X9.00 Y9.00 Z9.00" in once.notes[0]
    twice = learned(once, attempt(found(kind, tip=(1.1, 2.0, 3.0))))
    assert np.allclose(twice.along("A1").barred[TOOL.id], [[1.1, 3.0, -2.0]])
    assert len(twice.notes) == 2 and "kept away" in twice.notes[1]
    assert not once.along("A2").dug


def test_a_step_written_with_arcs_is_another_one_and_still_known():
    """Programs hold steps made anew by fitted arcs and longer lines; the job died of it."""
    tried = attempt(found(FindingKind.PLUNGE))
    program = tried.programs[0]
    program.work.steps = [SimpleNamespace(**vars(s)) for s in program.work.steps]
    told = learned(ProofFeedback(), tried)
    assert told is not None and len(told.along("A1").dug[TOOL.id]) == 1
    program.work.steps[0].id, program.text = "S09", TEXT.replace("S01", "S09")
    assert learned(ProofFeedback(), tried) is None  # of no side: nothing that another plan would be told


def test_where_too_much_was_in_stock_is_gone_in_skims_and_then_not_at_all():
    once = learned(ProofFeedback(), attempt(found(FindingKind.ENGAGEMENT)))
    assert np.allclose(once.along("A1").packed[TOOL.id], [[1.0, 3.0, -2.0]]) and "in skims" in once.notes[0]
    assert once.along("A1").crowds(TOOL, np.array([[1.0, 3.0, -2.0], [9.0, 3.0, -2.0]])).tolist() == [True, False]
    twice = learned(once, attempt(found(FindingKind.ENGAGEMENT)))
    assert len(twice.along("A1").barred[TOOL.id]) == 1 and "kept away" in twice.notes[1]
    many = [found(FindingKind.ENGAGEMENT, tip=(9.0 * k, 2.0, 3.0)) for k in range(MAX_ENGAGEMENT_FINDINGS + 1)]
    places = learned(ProofFeedback(), attempt(*many[1:])).along("A1").packed[TOOL.id]
    assert len(places) == MAX_ENGAGEMENT_FINDINGS > MAX_OTHER_FINDINGS
    assert learned(ProofFeedback(), attempt(*many)) is None
    leaning = learned(ProofFeedback(), attempt(found(FindingKind.ENGAGEMENT, line=5)))
    assert len(leaning.along("A1").barred[TOOL.id]) == 1  # a flank has no skims


def test_a_wall_without_support_is_cut_in_bands_and_then_in_lower_ones():
    unheld = replace(found(FindingKind.SUPPORT, tip=None, depth=8.0), limit=6.0)
    tried = attempt(unheld)
    tried.proof.support = SimpleNamespace(limit=10.0)
    once = learned(ProofFeedback(), tried)
    (wall,) = once.along("A1").unheld
    top = float((np.array(unheld.point) @ TILT.T)[2])  # in the frame of the access
    assert (wall.top, wall.bottom) == pytest.approx((top, top - 8.0)) and wall.thickness == pytest.approx(0.6 * CLOSER)
    assert "in lower bands" in once.notes[0] and not once.along("A1").barred
    twice = learned(once, tried)
    assert twice.along("A1").unheld[1].thickness == pytest.approx(0.6 * CLOSER**2)
    assert learned(ProofFeedback(), attempt(replace(unheld, line=0))) is None


@pytest.mark.parametrize(("kind", "line"), [(FindingKind.COLLISION, 3), (FindingKind.RUBBING, 3),
                                            (FindingKind.PLUNGE, 5)])
def test_what_was_met_or_dug_beside_a_wall_bars_the_tool(kind, line):
    told = learned(ProofFeedback(), attempt(found(kind, line)))
    assert len(told.along("A1").barred[TOOL.id]) == 1 and not told.along("A1").dug


@pytest.mark.parametrize("tried", [
    attempt(), attempt(found(FindingKind.GOUGE)), attempt(found(FindingKind.RAPID)),
    attempt(found(FindingKind.PLUNGE), found(FindingKind.GOUGE)), attempt(found(FindingKind.PLUNGE, tip=None)),
    attempt(found(FindingKind.PLUNGE, line=1)), attempt(*[found(FindingKind.PLUNGE)] * (MAX_OTHER_FINDINGS + 1)),
    attempt(found(FindingKind.PLUNGE), counts={"plunge": 300}), attempt(found(FindingKind.RESIDUAL, 0, None, -0.1)),
    attempt(found(FindingKind.PROGRAM))])
def test_a_fault_of_the_planner_is_not_planned_away(tried):
    assert learned(ProofFeedback(), tried) is None


def test_samples_with_more_than_was_planned_are_told_zone_by_zone():
    residual = found(FindingKind.RESIDUAL, 0, None)
    told = learned(ProofFeedback(), attempt(residual, proved=(True, False, False, True, True, False)))
    left = told.along("A1").left  # the third is one that the plan gave up itself
    assert {k: v.tolist() for k, v in left.items()} == {"Z1": [1], "Z2": [2]}
    assert told.along("A1").aims("Z2", 0.02, 4).tolist() == [0.02, 0.02, 0.02 * STRICTER, 0.02]
    again = learned(told, attempt(residual, proved=(True, True, True, False, True, True)))
    assert again.along("A1").left["Z2"].tolist() == [0, 2] and again.along("A1").left["Z1"].tolist() == [1]
    assert not len(again.along("A1").lost["Z2"])
    lost = learned(again, attempt(residual, proved=(True, True, True, False, True, True)))
    assert lost.along("A1").lost["Z2"].tolist() == [0] and "given up" in lost.notes[-1]
    assert lost.along("A1").aims("Z2", 0.02, 3).tolist() == [-np.inf, 0.02, 0.02 * STRICTER]


def test_care_and_bars_are_round_the_place_and_of_the_tool():
    r = TOOL.radius
    told = Counterexamples({TOOL.id: np.array([[0.0, 0.0, 5.0]])}, {TOOL.id: np.array([[0.0, 0.0, 5.0]])})
    assert told.care(TOOL, np.array([[3.0 * r, 0.0, 0.0], [0.9 * r, 0.0, 0.0]])) == CARE
    assert told.care(TOOL, np.array([[1.1 * r, 0.0, 0.0]])) == 1.0
    assert told.care(TOOL, np.array([[-9.0 * r, 0.5 * r, 0.0], [9.0 * r, 0.5 * r, 0.0]])) == CARE
    line = Line(np.linspace([-r, 0.0, 5.0], [r, 0.0, 5.0], 201), False)
    away = np.abs(line.points[:, 0])
    assert (told.bars(TOOL, line.points) == (away <= BARRED * r)).all()
    other = replace(TOOL, id="T77")
    assert told.care(other, np.zeros((1, 3))) == 1.0 and not told.bars(other, line.points).any()


@pytest.mark.slow
def test_accesses_before_the_first_that_is_told_something_are_planned_once(tmp_path, monkeypatch):
    """Two sides of a small part; of a proof that has something to say of the second only that is planned again."""
    part, setup_file = write_small(tmp_path)
    given = json.loads(setup_file.read_text())
    given["access"] = [{"id": "A1"}, {"id": "A2", "direction": [1.0, 0.0, 0.0], "work_offset": "G55"}]
    along, asked = [], []

    def planner(zones, *args, **kwargs):
        along.append(zones[0].access if zones else "")
        return plan_job(zones, *args, **kwargs)

    def once(told, attempt):
        asked.append([s.view.id for s in attempt.access_plans])
        far = Counterexamples(barred={"T1": np.array([[0.0, 0.0, 90.0]])})
        return ProofFeedback({"A2": far}) if len(asked) == 1 else None

    monkeypatch.setattr(plan_prove_loop, "learned", once)
    report = pipeline.plan(part, Setup.model_validate(given), tmp_path / "out", lambda *_: None, planner=planner)
    assert along == ["A1", "A2", "A2"] and asked == [["A1", "A2"]] * 2
    assert report["state"] == "proved" and {z["access"] for z in report["zones"]} == {"A1", "A2"}
    assert report["time"]["in_cut_s"] + report["time"]["in_air_s"] == pytest.approx(report["machining_time_s"], abs=0.2)
    assert report["time"]["retracts"] > 0 and report["time"]["tool_changes"] > 0
