"""Plan all accesses of a job, prove the programs, and plan again where the proof corrects an estimate.

An access is planned again where a proof found something along it, and so are the accesses after it, for they begin
with the stock that it leaves. ``service.stages.replanning`` decides what the next plan avoids and whether there is one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from geometry.child_process import give_back_memory
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from service.delivery.written_program import WrittenProgram
from service.stages.access_plan import AccessPlan, ProofFrame
from service.stages.access_settings import plan_settings, planning_stock
from service.stages.preparation import Prepared
from service.stages.programs import programs_of
from service.stages.proof_samples import Score
from service.stages.replanning import MAX_PLANS, Attempt, ProofFeedback, learned, worth_another
from service.stages.resume import Resumed
from service.stages.wall_support import band_planes
from toolpath.feeds.tool_life import with_fresh_cutters, worn
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_checkpoint import CheckpointKeeper
from toolpath.planning.job_plan import Plan
from toolpath.planning.plan_history import PlanHistory
from toolpath.planning.zone_layout import ZoneLayout, layouts_of
from toolpath.stock.stock_map import StockMap
from verify.checks.program_sequence import read_each
from verify.model import NcProgram, Proof, ProofSetup, ScoredSamples
from verify.program.program import Program
from verify.progress import Report, StageProgress, silent
from verify.prove import READ, prove
from zones.reach.access_view import View

Progress = Callable[[str, float], None]
Planner = Callable[..., Plan]
PREPARED, PROVED = 0.28, 0.96  # shares of the work done
FIRST_SHARE, PLAN_SHARE = 0.9, 0.7  # of what is left to a proof: of a plan and its proof; of these: of the plan


class Reading:
    """Programs that are read when they are first asked for; ``make`` reads them and reports the share done."""

    def __init__(self, make: Callable[[Report], list[Program]]) -> None:
        self._make, self._read = make, list[Program]()

    def __call__(self, report: Report = silent) -> list[Program]:
        """The programs; report : called with the share read, 0 to 1."""
        if not self._read:
            self._read = self._make(report)
        return self._read


@dataclass(frozen=True, eq=False)
class ProvedPlan:
    """The last plan of a job, its programs and their proof.

    ready      : Prepared, what was planned
    scored     : Score, the samples of the proof in the frame of the first view, and the zones that answer for them
    frame      : frame of the proof
    samples    : the samples in that frame
    conditions : ProofSetup, what the proof holds the programs to
    plan       : of all accesses together
    written    : the programs, as they were proved
    read       : the same as the proof has read them
    zone       : (n,) int32, index: zone that answers for each sample, from 1; 0 where none does or the plan gave up
    given_up   : (n,) bool, samples that the plan gave up
    proof      : in the frame of the proof
    notes      : what was planned again, for the report
    """

    ready: Prepared
    scored: Score
    frame: ProofFrame
    samples: SurfaceSamples
    conditions: ProofSetup
    plan: Plan
    written: tuple[WrittenProgram, ...]
    read: Reading
    zone: NDArray[np.int32]
    given_up: NDArray[np.bool_]
    proof: Proof
    notes: tuple[str, ...]

    @property
    def programs(self) -> list[NcProgram]:
        """The programs as the proof took them."""
        return [p.given() for p in self.written]


def plan_and_prove(resumed: Resumed, scored: Score, trimmed: Mapping[str, Sequence[Faces]], frame: ProofFrame,
                   conditions: ProofSetup, planner: Planner, progress: Progress,
                   beside: Callable[[Sequence[WrittenProgram]], None] | None = None,
                   blanks: Callable[[View], StockMap] | None = None) -> ProvedPlan:
    """Plan and prove a job until nothing is found, or until another plan would not help.

    resumed    : the job as prepared, with what an earlier attempt at it kept
    trimmed    : exact faces by zone, in the frame of its access
    conditions : what the proof holds the programs to, in ``frame``
    planner    : what makes workingsteps of the zones of an access, with the arguments of ``plan_job``
    beside     : called with the programs of each plan before their proof, which runs while it works
    blanks     : the stock that the planner of an access starts from; None: computed here

    Raises
    ------
    CamError
        As planner, writers and proof.
    """
    ready, samples = resumed.ready, resumed.samples
    accesses = _Accesses(ready, resumed.checks, trimmed, planner, blanks or partial(planning_stock, ready))
    feedback, begun = ProofFeedback(), PREPARED
    access_plans: list[AccessPlan] = []
    finding_counts: list[int] = []
    while True:
        # how many plans there will be is not known: each takes most of what is left
        ended = begun + FIRST_SHARE * (PROVED - begun)
        span = _Span(progress, begun, begun + PLAN_SHARE * (ended - begun), ended)
        for k, view in list(enumerate(ready.views))[len(access_plans):]:
            make = partial(accesses.planned, view, access_plans, feedback, span.of(k, len(ready.views)))
            access_plans.append(resumed.access_plan(view, access_plans, feedback.along(view.id), make))
        plan = Plan(tuple(t for a in access_plans for t in a.plan.steps),
                    tuple(z for a in access_plans for z in a.plan.zones))
        give_back_memory()
        zone, given_up = scored.without(plan, ready.zones)
        written = programs_of(ready, access_plans, trimmed)
        programs = [p.given() for p in written]
        if beside is not None:
            beside(written)
        read = Reading(partial(read_each, programs, frame.part, ready.inputs.bodies, conditions, 0))
        proof = resumed.proof(programs, zone, partial(
            _proof, read, programs, frame.part, ready.inputs.bodies, conditions, ScoredSamples(samples, zone),
            [z.id for z in ready.zones], span.proving))
        next_feedback = learned(feedback, Attempt(access_plans, written, ready.zones, scored.zone, zone, frame, proof))
        finding_counts.append(sum(proof.counts.values()))
        if next_feedback is None or not worth_another(finding_counts, MAX_PLANS):
            return ProvedPlan(ready, scored, frame, samples, conditions, plan, tuple(written), read, zone, given_up,
                              proof, feedback.notes)
        # an access begins with what those before it leave: plans stay up to the first access with new feedback
        access_plans = list(takewhile(partial(_unchanged, feedback, next_feedback), access_plans))
        feedback, begun = next_feedback, ended


def _proof(read: Reading, programs: Sequence[NcProgram], part: Part, tools: Sequence[ToolBody], conditions: ProofSetup,
           scored: ScoredSamples, zones: Sequence[str], report: Report) -> Proof:
    """The proof of programs that are read first, as ``verify.prove.prove``."""
    known = read(StageProgress(report).span(0.0, READ))
    return prove(programs, part, tools, conditions, scored, zones, report, read=known)


def _unchanged(feedback: ProofFeedback, next_feedback: ProofFeedback, access_plan: AccessPlan) -> bool:
    """Whether a proof found nothing along an access."""
    return next_feedback.along(access_plan.view.id) is feedback.along(access_plan.view.id)


@dataclass(frozen=True)
class _Span:
    """Progress of one plan and its proof: where it begins, where the plan ends, and where the proof ends."""

    progress: Progress
    begun: float
    planned: float
    proved: float

    def of(self, k: int, count: int) -> Callable[[float], None]:
        """What one of several accesses reports its own share, 0 to 1, to."""
        width = (self.planned - self.begun) / count
        return lambda share: self.progress("plan", self.begun + width * (k + share))

    def proving(self, share: float) -> None:
        """Report a share, 0 to 1, of the proof."""
        self.progress("prove", self.planned + (self.proved - self.planned) * share)


class _Accesses:
    """Plans single accesses of a job. Keeps the blank along each, layouts of zones and states for the next plan.

    checks  : what the passes of each zone are measured at, in the order of the zones
    trimmed : exact faces by zone, in the frame of its access
    blank   : the stock that the planner of an access starts from
    """

    def __init__(self, ready: Prepared, checks: Sequence[FinishTarget], trimmed: Mapping[str, Sequence[Faces]],
                 planner: Planner, blank: Callable[[View], StockMap]) -> None:
        self.ready, self.checks, self.trimmed, self.planner, self.blank = ready, checks, trimmed, planner, blank
        self.blanks: dict[str, StockMap] = {}
        self.layouts: dict[str, dict[str, ZoneLayout]] = {}
        self.histories: dict[str, tuple[tuple[AccessPlan, ...], PlanHistory]] = {}  # with the plans before

    def planned(self, view: View, before: Sequence[AccessPlan], feedback: ProofFeedback,
                report: Callable[[float], None], keeper: CheckpointKeeper) -> AccessPlan:
        """Plan the zones of one access after the accesses ``before`` it.

        On a machine with rotary axes all accesses are one program, so an access begins with what those before it leave.
        On three axes it begins with the whole blank, because the operator may run the programs in any order. Heights
        are those of the whole blank in any case.
        """
        ready = self.ready
        turned, step_count = ready.inputs.turns, sum(len(a.plan.steps) for a in before)
        if view.id not in self.blanks:
            self.blanks[view.id] = self.blank(view)
        stock = self.blanks[view.id].copied()
        found = feedback.along(view.id)
        settings = replace(plan_settings(ready, view, stock), found=found,
                           planes=band_planes(ready, view, found.unheld))
        if turned:
            corners = ready.blank.corners(view.rotation)
            lowest = float(corners[0, 2]) - math.sqrt(3.0) * ready.blank.beyond  # of a box
            stock.left_by([(a.left, a.view.rotation @ view.rotation.T) for a in before if a.left is not None], lowest)
        mine = [k for k, z in enumerate(ready.zones) if z.access == view.id]
        zones, checks, cut_data = [ready.zones[k] for k in mine], [self.checks[k] for k in mine], ready.inputs.cut_table
        if view.id not in self.layouts:
            self.layouts[view.id] = layouts_of(zones, checks, view.fields, cut_data, settings, self.trimmed)
        plan = self.planner(zones, checks, view.fields, cut_data, stock, settings, lambda share: report(0.98 * share),
                            first_step=step_count + 1, trimmed=self.trimmed, keeper=keeper,
                            layouts=self.layouts[view.id], history=self._history(view, before))
        stock.settle(last=True)
        used = worn(t for a in before for t in a.plan.steps)
        steps = with_fresh_cutters(plan.steps, ready.inputs.tool_lives, settings.clearance, used)
        if turned:
            steps = [replace(s, access=view.id) for s in steps]
        return AccessPlan(view, Plan(tuple(steps), plan.zones), settings.clearance, stock if turned else None)

    def _history(self, view: View, before: Sequence[AccessPlan]) -> PlanHistory:
        """States of the last plan of an access; none where other plans stand before it: they leave other stock."""
        known, history = self.histories.get(view.id, ((), PlanHistory()))
        if len(known) != len(before) or any(a is not b for a, b in zip(known, before, strict=True)):
            history = PlanHistory()
        self.histories[view.id] = tuple(before), history
        return history


__all__ = ["PROVED", "Planner", "Progress", "ProvedPlan", "plan_and_prove"]
