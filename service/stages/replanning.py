"""What the next plan of a job learns from the findings of a proof.

A plan rests on estimates (``toolpath.counterexamples``), so a proof may find places where an estimate was wrong. The
planner gets these places and plans the job again. A gouge or a collision in a rapid points to a fault of the planner,
and so do many findings at once. Such a job is not planned again: it stays unproved, and the report gives the findings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from service.delivery.written_program import WrittenProgram
from service.stages.access_plan import AccessPlan, ProofFrame
from toolpath.counterexamples import CLOSER, NONE, Counterexamples, HighWall
from toolpath.workingsteps import Workingstep
from verify.model import Finding, FindingKind, Proof
from zones.zoning.zones import ZoneArea

MAX_PLANS = 3  # of a job while proofs have findings
MAX_FURTHER_PLANS = 3  # beyond these, while each proof has at most half the findings of the one before it
MAX_OTHER_FINDINGS = 24  # of other kinds than engagement; more point to a fault, not to an estimate
MAX_ENGAGEMENT_FINDINGS = 96  # the lattice of the stock may cause many along one pass
CONTACTS = (FindingKind.COLLISION, FindingKind.RUBBING)
STEP = re.compile(r"^[\d ]*[(;] ?(S\d+[a-z]*)\b", re.IGNORECASE)  # the comment before a step, in any dialect


@dataclass(frozen=True, eq=False)
class ProofFeedback:
    """What the proofs of a job found so far, for its next plan.

    found : Counterexamples by access id, in the frame of the access
    notes : sentences for the report
    """

    found: Mapping[str, Counterexamples] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def along(self, access: str) -> Counterexamples:
        """The counterexamples of one access."""
        return self.found.get(access, NONE)


@dataclass(frozen=True, eq=False)
class Attempt:
    """A plan and its proof.

    access_plans : plans of the accesses; programs : written from them
    zones        : of the job
    owner        : (n,) int32, index: zone of each sample of the proof, from 1, before the plan gave up any
    answered     : (n,) int32, index: the same without the samples that the plan gave up
    frame        : frame of the proof; proof : in it
    """

    access_plans: Sequence[AccessPlan]
    programs: Sequence[WrittenProgram]
    zones: Sequence[ZoneArea]
    owner: NDArray[np.int32]
    answered: NDArray[np.int32]
    frame: ProofFrame
    proof: Proof


def learned(before: ProofFeedback, tried: Attempt) -> ProofFeedback | None:
    """The feedback for the next plan; None where the proof found nothing, or where another plan would not help.

    - A place where the tool plunged, or cut more than it bears, is cut with care, one with too large an engaged angle
      in skims.
    - A place where that happens again, or on a flank pass, or where the tool met something, is barred to the tool.
    - Where a wall lacked support, all tools go down in lower bands.
    - Samples that stayed uncut although a zone answers for them get finer passes, and are given up the second time.
    """
    findings = tried.proof.findings
    engagement_count = sum(f.kind is FindingKind.ENGAGEMENT for f in findings)
    other_count = len(findings) - engagement_count
    if not findings or other_count > MAX_OTHER_FINDINGS or engagement_count > MAX_ENGAGEMENT_FINDINGS:
        return None
    if len(findings) < sum(tried.proof.counts.values()):
        return None
    out, notes = dict(before.found), list(before.notes)
    for f in findings:
        if f.kind is FindingKind.RESIDUAL and f.depth > 0.0:
            continue  # handled below, sample by sample
        step = _step_of(f, tried.programs)
        planned = None if step is None else _access_plan_of(step, tried.access_plans)
        if step is not None and planned is not None and f.kind is FindingKind.SUPPORT and f.point is not None:
            old = out.get(planned.view.id, NONE)
            out[planned.view.id] = _held(before.along(planned.view.id), old, f, tried, planned)
            notes.append(f"planned again, in lower bands ({step.id}): {f.message}")
            continue
        if step is None or planned is None or f.tip is None or f.kind not in (
                FindingKind.PLUNGE, FindingKind.LOAD, FindingKind.ENGAGEMENT, *CONTACTS):
            return None
        tip = np.array(f.tip) @ tried.frame.rotation @ planned.view.rotation.T
        old = out.get(planned.view.id, NONE)
        deep = f.kind in (FindingKind.PLUNGE, FindingKind.LOAD)
        careful = deep and step.strategy != "flank" and old.care(step.tool, tip[None]) == 1.0
        thin = f.kind is FindingKind.ENGAGEMENT and step.strategy != "flank" and not old.crowds(step.tool, tip[None])[0]
        how = "with care" if careful else "in skims" if thin else "with the tool kept away"
        if careful:
            old = replace(old, dug=_with(old.dug, step.tool.id, tip))
        elif thin:
            old = replace(old, packed=_with(old.packed, step.tool.id, tip))
        else:
            old = replace(old, barred=_with(old.barred, step.tool.id, tip))
        out[planned.view.id] = old
        x, y, z = f.point or f.tip
        notes.append(f"planned again, {how} near X{x:.2f} Y{y:.2f} Z{z:.2f} "
                     f"({step.id}): {f.message}")
    left = np.flatnonzero((tried.answered > 0) & ~tried.proof.proved)
    for k in np.unique(tried.answered[left]).tolist():
        zone = tried.zones[k - 1]
        rows = np.flatnonzero(np.isin(np.flatnonzero(tried.owner == k), left))
        old = out.get(zone.access, NONE)
        none = np.zeros(0, np.int64)
        known, lost = old.left.get(zone.id, none), old.lost.get(zone.id, none)
        again = np.intersect1d(known, rows)
        out[zone.access] = replace(old, left={**old.left, zone.id: np.union1d(known, rows)},
                                   lost={**old.lost, zone.id: np.union1d(lost, again)})
        if len(again) < len(rows):
            notes.append(f"planned again, {zone.id} finer at {len(rows) - len(again)} places: more material stayed "
                         "than planned")
        if len(again):
            notes.append(f"planned again, {len(again)} places of {zone.id} given up: too much material stayed there "
                         "again")
    return ProofFeedback(out, tuple(notes))


def worth_another(found: Sequence[int], plans: int = MAX_PLANS) -> bool:
    """Whether a job is planned once more.

    found : number of findings of each proof so far, the last one above 0
    plans : how many plans are made in any case

    >>> [worth_another(n) for n in ([9], [9, 9], [9, 9, 9], [53, 3, 1], [53, 3, 1, 1])]
    [True, True, False, True, False]
    """
    made = len(found)
    return made < plans or (1 < made < plans + MAX_FURTHER_PLANS and 2 * found[-1] <= found[-2])


def _held(before: Counterexamples, old: Counterexamples, f: Finding, tried: Attempt,
          planned: AccessPlan) -> Counterexamples:
    """Counterexamples with a wall that was finished without support added; it counts as thinner the second time."""
    top = float((np.array(f.point) @ tried.frame.rotation @ planned.view.rotation.T)[2])
    thin = f.limit / tried.proof.support.limit * CLOSER ** (2 if before.unheld else 1)
    return replace(old, unheld=(*old.unheld, HighWall(top, top - f.depth, thin)))


def _access_plan_of(step: Workingstep, access_plans: Sequence[AccessPlan]) -> AccessPlan | None:
    """The plan that holds a step of a program, found by its id: arcs and longer lines make another object of it."""
    return next((a for a in access_plans if any(t.id == step.id for t in a.plan.steps)), None)


def _with(places: Mapping[str, F64], tool: str, tip: F64) -> Mapping[str, F64]:
    return {**places, tool: np.vstack([places.get(tool, np.zeros((0, 3))), tip])}


def _step_of(f: Finding, programs: Sequence[WrittenProgram]) -> Workingstep | None:
    """The workingstep a finding's line belongs to."""
    program = next((p for p in programs if p.name == f.program), None)
    if program is None or f.line <= 0:
        return None
    for text in reversed(program.text.splitlines()[:f.line]):
        named = STEP.match(text)
        if named is not None:
            return next((s for s in program.work.steps if s.id.upper() == named[1].upper()), None)
    return None


__all__ = ["MAX_PLANS", "Attempt", "ProofFeedback", "learned", "worth_another"]
