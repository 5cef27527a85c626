"""The work that a program of any origin has to do: the samples that are judged, the faces, and what tools can touch."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples, joined
from service.from_wire import face_numbers
from service.stages.access_plan import ProofFrame
from service.stages.job_part import JobPart
from service.stages.preparation import machinable_triangles, table_height
from service.stages.proof_samples import proof_samples
from service.stages.sample_spacing import coarse_spacing
from service.verification.named_touch import axis_lines
from service.verification.own_ways import mill_ways
from service.verification.tool_touch import ToolTouch
from verify.model import Asked
from verify.program.move_kinds import FEED
from verify.program.program import Program
from zones.features.seat import seat_of
from zones.reach.access_view import access_rotation, turned, turned_samples

AXES = 200  # tool axes of a program that count as directions it sees the part from


def asked_work(job: JobPart, frame: ProofFrame, program: Program,
               whole: Program | None = None) -> tuple[SurfaceSamples, Asked]:
    """Samples of the machinable area in the frame of the proof, and the work that is asked there.

    frame   : of the proof; program : as it was read
    whole   : the same program read on through an end before its last lines, or None

    The machinable area is what the accesses of the setup see, and what the tool axes of the program see. Faces that
    none of them sees are hidden.

    Raises
    ------
    SetupError
        The setup names faces the part does not have.
    """
    inputs, ops = job.inputs, job.inputs.operations
    program = whole or program
    given = [access_rotation(a.direction) for a in job.accesses]
    directions = np.vstack([[r[2] for r in given], _axes(program) @ frame.rotation])
    first = turned(job.part, given[0])
    seat = (np.flatnonzero(seat_of(first)) + 1).tolist()
    triangles = machinable_triangles(first, seat, inputs, directions @ given[0].T)
    wide = coarse_spacing(frame.part, inputs, directions @ frame.rotation.T) if program.poses is None else {}
    fine = triangles[~np.isin(first.mesh.face_ids[triangles], list(wide))]
    samples = turned_samples(proof_samples(first, fine, {}), frame.rotation @ given[0].T)
    if wide:
        samples = joined([samples, proof_samples(frame.part, triangles[~np.isin(triangles, fine)], wide)])
    table = table_height(inputs, job.blank) if inputs.turns else None
    asked = frozenset[int]() if not ops.finishing else None if ops.faces is None else frozenset(face_numbers(ops.faces))
    touch = ToolTouch(job.part, inputs, frame.rotation, table, axis_lines(program, inputs.bodies),
                      mill_ways(program, inputs.bodies))
    hidden = frozenset[int]()
    if ops.faces is None and asked is None:
        seen = np.unique(first.mesh.face_ids[triangles])
        hidden = frozenset(np.setdiff1d(first.mesh.face_ids, [*seen, *seat, *face_numbers(ops.exclude_faces)]).tolist())
    return samples, Asked(asked, touch, max(job.part.chord, job.part.deviation), whole, hidden,
                          lambda of: proof_samples(frame.part, of, {}))


def _axes(program: Program) -> F64:
    """(k, 3) float64, unit, frame of the program: tool axes at the ends of feed moves that do not stand along Z."""
    if program.poses is None:
        return np.zeros((0, 3))
    axes = np.unique(np.round(program.poses.end_axis[program.kind == FEED], 3), axis=0)
    if len(axes) > AXES:
        axes = axes[np.linspace(0, len(axes) - 1, AXES).astype(np.int64)]
    return np.asarray(axes / np.linalg.norm(axes, axis=1)[:, None])


__all__ = ["asked_work"]
