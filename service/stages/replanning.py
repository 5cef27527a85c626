"""When a proof finds something, what of it the next plan of the same job can do without.

A plan rests on estimates (``toolpath.counterexamples``), so a proof may find a place or two where one was wrong. These
are told to the planner and the job is planned again. What points to a fault of the planner and not to an estimate, as a
gouge or a rapid does, or many findings at once, is not planned again: the job stays unproved and says why.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from service.stages.access_plan import AccessPlan, ProofFrame, WrittenProgram
from toolpath.counterexamples import CLOSER, NONE, Counterexamples, HighWall
from toolpath.workingsteps import Workingstep
from verify.model import Finding, FindingKind, Proof
from zones.zoning.zones import ZoneArea

PLANS = 3  # of a job, where proofs go on finding something
FURTHER = 3  # of a job beyond these, while each proof finds no more than half of what the one before it found
MOST = 24  # findings: more are no wrong estimates
MOST_PACKED = 96  # those of the engaged angle, which hang on the lattice of the stock all along a pass
MET = (FindingKind.COLLISION, FindingKind.RUBBING)
STEP = re.compile(r"^[\d ]*[(;] ?(S\d+[a-z]*)\b", re.IGNORECASE)  # the comment before a step, in any dialect


@dataclass(frozen=True, eq=False)
class ProofFeedback:
    """What proofs found so far.

    found : Counterexamples by access id, in the frame of the access
    notes : in words, for the report
    """

    found: Mapping[str, Counterexamples] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def along(self, access: str) -> Counterexamples:
        """What was found along an access."""
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
    """What to plan with next; None where the proof found nothing, or something that planning again is no answer to.

    A place at which the tool dug is gone to with care next time, one at which too much of it was in stock in skims; one
    at which it does so again, or beside a wall, or at which it met something, is barred to it. Where a wall lacked
    support, all goes down in lower bands.
    """
    findings = tried.proof.findings
    packed = sum(f.kind is FindingKind.ENGAGEMENT for f in findings)
    if not findings or len(findings) - packed > MOST or packed > MOST_PACKED:
        return None
    if len(findings) < sum(tried.proof.counts.values()):
        return None
    out, notes = dict(before.found), list(before.notes)
    for f in findings:
        if f.kind is FindingKind.RESIDUAL and f.depth > 0.0:
            continue  # all of them are told below, sample by sample
        step = _step_of(f, tried.programs)
        planned = None if step is None else _access_plan_of(step, tried.access_plans)
        if step is not None and planned is not None and f.kind is FindingKind.SUPPORT and f.point is not None:
            old = out.get(planned.view.id, NONE)
            out[planned.view.id] = _held(before.along(planned.view.id), old, f, tried, planned)
            notes.append(f"planned again, in lower bands ({step.id}): {f.message}")
            continue
        if step is None or planned is None or f.tip is None or f.kind not in (
                FindingKind.PLUNGE, FindingKind.ENGAGEMENT, *MET):
            return None
        tip = np.array(f.tip) @ tried.frame.rotation @ planned.view.rotation.T
        old = out.get(planned.view.id, NONE)
        careful = f.kind is FindingKind.PLUNGE and step.strategy != "flank" and old.care(step.tool, tip[None]) == 1.0
        thin = f.kind is FindingKind.ENGAGEMENT and step.strategy != "flank" and not old.crowds(step.tool, tip[None])[0]
        how = "with care" if careful else "in skims" if thin else "and kept away"
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
            notes.append(f"planned again, {zone.id} finer at {len(rows) - len(again)} places: more stayed than was "
                         "planned")
        if len(again):
            notes.append(f"planned again, {len(again)} places of {zone.id} given up: more stayed there again")
    return ProofFeedback(out, tuple(notes))


def worth_another(found: Sequence[int], plans: int = PLANS) -> bool:
    """Whether a job is planned again after proofs that found so many findings each, the last one some.

    >>> [worth_another(n) for n in ([9], [9, 9], [9, 9, 9], [53, 3, 1], [53, 3, 1, 1])]
    [True, True, False, True, False]
    """
    made = len(found)
    return made < plans or (1 < made < plans + FURTHER and 2 * found[-1] <= found[-2])


def _held(before: Counterexamples, old: Counterexamples, f: Finding, tried: Attempt,
          planned: AccessPlan) -> Counterexamples:
    """With a wall that a finding says was finished without support; it counts as thinner the second time."""
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


__all__ = ["PLANS", "Attempt", "ProofFeedback", "learned", "worth_another"]
