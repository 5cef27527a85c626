"""The proof of one program of any origin, without files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.sampling import SurfaceSamples
from service.report.verification_report import verification_report
from service.stages.access_plan import ProofFrame, in_setup_frame
from service.stages.access_settings import proof_setup
from service.stages.job_part import JobPart
from service.stages.programs import program_frame
from service.verification.asked_work import asked_work
from service.verification.program_first import ProgramFirst
from verify.model import Proof, ProofSetup, ScoredSamples
from verify.prove import prove
from zones.reach.access_view import turned_samples


@dataclass(frozen=True, eq=False)
class ProgramProof:
    """A proof with its frame, samples, conditions and report.

    frame   : of the proof
    samples : SurfaceSamples, n of them, in that frame
    report  : as ``service.pipeline.verify_program`` returns it, places in the setup frame
    entry   : (n,) int64, index: entry of the remainder of each sample, -1 for none
    """

    frame: ProofFrame
    samples: SurfaceSamples
    conditions: ProofSetup
    proof: Proof
    report: dict[str, Any]
    entry: NDArray[np.int64]


def proved_program(job: JobPart, first: ProgramFirst, progress: Callable[[float], None]) -> ProgramProof:
    """Prove a program that was read against the part of a job.

    progress : called with the share done, 0 to 1

    Raises
    ------
    CamError
        As ``verify.prove.prove``; the setup names faces the part does not have.
    """
    frame = program_frame(job, first.access)
    samples, asked = asked_work(job, frame, first.read, first.whole)
    conditions = proof_setup(job, frame, foreign=True)
    conditions = replace(conditions, kinematics=first.kinematics, assumed=(*conditions.assumed, *first.assumed))
    no_zone = ScoredSamples(samples, np.zeros(len(samples), np.int32))
    proof = prove([first.nc], frame.part, job.inputs.bodies, conditions, no_zone, [], progress,
                  spindle_tool=first.spindle_tool, read=[first.read], asked=asked)
    if proof.work is not None:
        samples = proof.work.samples
    report, entry = verification_report(job, in_setup_frame(frame, proof), turned_samples(samples, frame.rotation.T))
    return ProgramProof(frame, samples, conditions, proof, report, entry)


__all__ = ["ProgramProof", "proved_program"]
