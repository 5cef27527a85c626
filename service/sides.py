"""What was planned along each access direction, and the proofs of several taken as one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples
from output.model import Workplan
from toolpath.motion import Workingstep
from toolpath.plan import Plan
from verify.findings import ordered
from verify.model import Engagement, Proof, ProofSetup
from verify.scoring import face_proofs
from zones.view import View


@dataclass(frozen=True, eq=False)
class Side:
    """What was planned and proved along one access direction, in its frame."""

    view: View
    made: Plan
    work: Workplan
    program: str
    proof: Proof

    @property
    def program_name(self) -> str:
        """File name of the program."""
        return program_name(self.view)


def file_name(view: View, stem: str, end: str) -> str:
    """'job.stpnc' for the first access, 'job.A2.stpnc' for a further one."""
    return f"{stem}.{end}" if view.is_first else f"{stem}.{view.id}.{end}"


def program_name(view: View) -> str:
    """File name of the program of an access."""
    return file_name(view, "program", "linuxcnc.ngc")


def in_setup_frame(view: View, proof: Proof) -> Proof:
    """The proof with the places of its findings in the setup frame."""
    return _turned(proof, view.rotation)


def in_view_frame(view: View, proof: Proof) -> Proof:
    """A proof whose places are in the setup frame with them in the frame of the view."""
    return _turned(proof, view.rotation.T)


def _turned(proof: Proof, turn: F64) -> Proof:
    """The proof with the places of its findings times ``turn`` (3, 3)."""
    if np.array_equal(turn, np.eye(3)):
        return proof
    return replace(proof, findings=tuple(
        f if f.point is None else replace(f, point=tuple((np.array(f.point) @ turn).tolist())) for f in proof.findings))


def joined_proofs(sides: Sequence[Side], samples: SurfaceSamples, setup: ProofSetup) -> Proof:
    """One proof of a job of several programs; places of findings in the setup frame.

    A sample is proved when some program leaves it inside the budget and none gouges it: what stands on it after
    the others is for that program to take off. Residuals are those of the program that leaves least, and figures by
    face are made of them.

    samples : of the proofs, in any frame; setup : of any of the proofs, for the budget, which is the same in all
    """
    proofs = [in_setup_frame(s.view, s.proof) for s in sides]
    if len(sides) == 1:
        return proofs[0]
    residual = np.stack([p.residual for p in proofs])
    best = residual.argmin(axis=0)
    rows = np.arange(residual.shape[1])
    program = np.where(np.stack([p.program for p in proofs])[best, rows] >= 0, best, -1).astype(np.int32)
    proved = np.any([p.proved for p in proofs], axis=0) & (np.stack([p.proved for p in proofs])[best, rows])
    counts: Counter[str] = Counter()
    minutes: Counter[int] = Counter()
    zones, engaged = {}, dict(proofs[0].engaged)
    for p in proofs[1:]:
        for tool, e in p.engaged.items():
            was = engaged.get(tool, e)
            engaged[tool] = Engagement(max(was.most, e.most), max(was.p99, e.p99))
    for side in sides:
        counts.update(side.proof.counts)
        minutes.update(side.proof.minutes)
        own = {p.zone.id for p in side.made.zones}
        zones.update({k: z for k, z in side.proof.zones.items() if k in own or k not in zones})
    top, _ = ordered([f for p in proofs for f in p.findings])
    return replace(
        proofs[0], findings=top, counts=dict(sorted(counts.items())), residual=residual[best, rows],
        line=np.stack([p.line for p in proofs])[best, rows], program=program, proved=proved, zones=zones,
        faces=face_proofs(samples, residual[best, rows], program >= 0, proved, setup),
        gouge_max=max(p.gouge_max for p in proofs), machining_time=sum(p.machining_time for p in proofs),
        cutting_length=sum(p.cutting_length for p in proofs), minutes=dict(minutes), engaged=engaged,
        error_bound=max(p.error_bound for p in proofs), line_spacing=max(p.line_spacing for p in proofs),
        notes=tuple(f"{s.view.id}: {note}" for s in sides for note in s.proof.notes))


def in_first_frame(side: Side) -> list[Workingstep]:
    """The steps of a side with their points in the frame of the first access, for a picture."""
    turn = side.view.rotation.T @ side.view.first.T
    if np.array_equal(turn, np.eye(3)):
        return list(side.made.steps)
    return [replace(s, trajectories=tuple(replace(t, points=t.points @ turn) for t in s.trajectories))
            for s in side.made.steps]


__all__ = ["Side", "file_name", "in_first_frame", "in_setup_frame", "in_view_frame", "joined_proofs", "program_name"]
