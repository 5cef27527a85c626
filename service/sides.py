"""What was planned along each access direction, and the names of its files."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from output.model import Workplan
from toolpath.motion import Workingstep
from toolpath.plan import Plan
from verify.model import NcProgram, Proof
from zones.view import View


@dataclass(frozen=True, eq=False)
class Side:
    """What was planned along one access direction, in its frame."""

    view: View
    made: Plan
    work: Workplan
    program: str

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
    if np.array_equal(view.rotation, np.eye(3)):
        return proof
    return replace(proof, findings=tuple(
        f if f.point is None else replace(f, point=tuple((np.array(f.point) @ view.rotation).tolist()))
        for f in proof.findings))


def nc_program(side: Side, work_offset: str) -> NcProgram:
    """The program of a side for a proof in the frame of the first access."""
    turn = None if side.view.is_first else side.view.rotation @ side.view.first.T
    return NcProgram(side.program_name, side.program, turn, work_offset)


def in_first_frame(side: Side) -> list[Workingstep]:
    """The steps of a side with their points in the frame of the first access, for a picture."""
    turn = side.view.rotation.T @ side.view.first.T
    if np.array_equal(turn, np.eye(3)):
        return list(side.made.steps)
    return [replace(s, trajectories=tuple(replace(t, points=t.points @ turn) for t in s.trajectories))
            for s in side.made.steps]


__all__ = ["Side", "file_name", "in_first_frame", "in_setup_frame", "nc_program", "program_name"]
