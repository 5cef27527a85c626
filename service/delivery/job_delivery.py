"""The report and the files of a planned job, from its last plan and the proof of it.

Programs and STEP-NC are among the files only where the proof found nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from geometry.sampling import SurfaceSamples
from service.delivery.machined_mesh import MESH_NAME, MeshWish, machined_part
from service.delivery.result_files import Files, deliver, json_bytes
from service.delivery.stepnc_files import StepncUnderWay
from service.delivery.written_program import WrittenProgram
from service.pictures.proof_picture import MAP_NAME, draw_proof
from service.report import report as reporting
from service.report.computed_ahead import ComputedAhead
from service.setup_sheet.setup_sheet import clamp_pictures, sheet_files
from service.stages.access_plan import ProofFrame, in_setup_frame
from service.stages.access_settings import leaned
from service.stages.cautions import (
    JobCaution,
    bent,
    cooled,
    dry,
    limited,
    lives_ended,
    sentences,
    thin_walls,
    uncut_centres,
    unheld,
    upright,
)
from service.stages.job_part import JobPart
from service.stages.plan_prove_loop import PROVED, Progress, ProvedPlan
from service.stages.preparation import Prepared
from service.stages.programs import with_figures
from service.viewer.preview_picture import draw_preview
from service.viewer.view_data import VIEW_NAME, plan_view
from verify.comparison.program_equivalence import carried
from verify.model import Proof, ProofSetup
from zones.remainder.remainder import RemainderEntry

PREVIEW_NAME = "preview.png"


def cautions_before_planning(ready: Prepared) -> list[JobCaution]:
    """The cautions of a job that are known before it is planned."""
    return [*limited(ready.inputs), *dry(ready.inputs), *cooled(ready.inputs), *thin_walls(ready)]


def warned(ready: Prepared, texts: Iterable[str]) -> Prepared:
    """The job with further sentences among its warnings."""
    return replace(ready, warnings=(*ready.warnings, *texts))


def deliver_job(job: ProvedPlan, cautions: Sequence[JobCaution], out: Path, mesh: MeshWish | None,
                progress: Progress, stepnc: StepncUnderWay, known: ComputedAhead[dict[str, Any]]) -> dict[str, Any]:
    """Write the files of a job into ``out``; returns its report.

    cautions : of the job before it was planned; those of the plan are added
    mesh     : also write the machined part as a mesh; None: no mesh
    stepnc   : with the STEP-NC that was begun during the proof
    known    : what the report says whatever the plan is, of ``service.report.report.known_before_planning``

    Raises
    ------
    CamError
        A file cannot be made, or a written file does not read back as the proved program.
    """
    reported = _report(job, cautions, known)
    report, ready, proved = reported.report, reported.ready, reported.report["state"] == "proved"
    first_access = ready.views[0].id
    tools, programs = ready.inputs.bodies, job.programs
    progress("report", PROVED)
    files: Files = {}
    if proved:
        files.update(_program_files(reported.written))
    files["zones.json"] = ("zones", "", None, json_bytes(reporting.zones_document(report)))
    # one thread of numba there: no two threads may enter its threading layer at once
    with ThreadPoolExecutor(1, initializer=numba.set_num_threads, initargs=(1,)) as pool:
        deviation = pool.submit(deviation_map, ready, job.frame, job.samples, job.proof, job.conditions, report,
                                out / MAP_NAME)
        clampings = pool.submit(clamp_pictures, ready, reported.written)
        page = plan_view(ready, job.frame, job.scored, job.zone, reported.uncut, reported.remainder, job.proof,
                         programs, job.read(), job.conditions, report)
        if page:
            files[PREVIEW_NAME] = ("preview", "", None, _preview(ready, page[VIEW_NAME][3], report, out / PREVIEW_NAME))
        files[MAP_NAME] = ("deviation", "", None, deviation.result())
    if mesh is not None and programs:
        figures, data = machined_part(mesh, programs, job.frame.part, tools, job.conditions, _mesh_share(progress))
        report["machined"] = {"file": MESH_NAME, "access": first_access, **figures}
        files[MESH_NAME] = ("machined", "", None, data)
    if proved:
        files.update(stepnc.files(job.written, reported.written, job.frame.part, tools, job.conditions))
    files.update(sheet_files(ready, reported.written, report, files, clampings.result()))
    files.update(page)
    deliver(out, report, files)
    return report


@dataclass(frozen=True, eq=False)
class _Reported:
    """A job with its report.

    ready     : Prepared, with all warnings
    written   : the programs, with the figures of the proof in their headers where the job is proved
    uncut     : (n,) bool, samples of the proof that stay uncut
    remainder : the same by region and reason
    """

    ready: Prepared
    report: dict[str, Any]
    written: Sequence[WrittenProgram]
    uncut: NDArray[np.bool_]
    remainder: Sequence[RemainderEntry]


def _report(job: ProvedPlan, cautions: Sequence[JobCaution], known: ComputedAhead[dict[str, Any]]) -> _Reported:
    """The report of a job; the programs of a proved one get the figures of their proof in the header."""
    inputs, steps = job.ready.inputs, job.plan.steps
    proof = in_setup_frame(job.frame, job.proof)
    plan_cautions = [*unheld(proof.support), *bent(steps), *lives_ended(inputs, steps), *uncut_centres(inputs, steps),
                     *upright(leaned(inputs.operations.lean), job.plan.zones, steps)]
    ready = warned(job.ready, (*job.notes, *sentences(plan_cautions)))
    report, uncut, remainder = reporting.job_report(ready, known, job.plan, proof, job.scored.samples,
                                                    job.scored.labels, job.zone, job.given_up,
                                                    [*cautions, *plan_cautions])
    written: Sequence[WrittenProgram] = job.written
    if report["state"] == "proved":
        # the proof simulated one dialect without figures, so the delivered texts of all dialects are compared with it
        written = with_figures(job.written, report)
        report["proof"]["notes"] += _differences(job, written)
    return _Reported(ready, report, written, uncut, remainder)


def _differences(job: ProvedPlan, delivered: Sequence[WrittenProgram]) -> list[str]:
    """Compare the programs as they are delivered, of all controls, with those that are proved; returns notes."""
    return [note for p, f, read in zip(job.written, delivered, job.read(), strict=True)
            for note in carried(p.given(), [f.given(), *f.twins()], job.frame.part, job.ready.inputs.bodies,
                                job.conditions, known=read)]


def _program_files(written: Sequence[WrittenProgram]) -> Files:
    return {name: ("program", dialect, p.access, text.encode())
            for p in written for dialect, name, text in p.files()}


def _mesh_share(progress: Progress) -> Callable[[float], None]:
    return lambda share: progress("mesh", PROVED + (1.0 - PROVED) * share)


def _preview(ready: Prepared, view: bytes | Path, report: dict[str, Any], path: Path) -> bytes:
    """Draw part and paths; returns the picture.

    view : the view file or its place
    """
    facts = {"state": report["state"], "coverage": f"{100 * report['coverage']:.1f} %",
             "of what is in reach": f"{100 * report['reach_coverage']:.1f} %",
             "machining time": f"{report['machining_time_s'] / 60:.0f} min"}
    data = view if isinstance(view, bytes) else view.read_bytes()
    draw_preview(data, path, ready.inputs.labels.get("order") or "zonemill", facts)
    return path.read_bytes()


def deviation_map(job: JobPart, frame: ProofFrame, samples: SurfaceSamples, proof: Proof, conditions: ProofSetup,
                  report: dict[str, Any], path: Path) -> bytes:
    """Draw the deviation map; returns the picture.

    samples, proof, conditions : of the proof, in ``frame``
    """
    order = job.inputs.labels.get("order")
    draw_proof(frame.part, samples, proof, conditions, report["state"], report["coverage"] or 0.0, path,
               f"Deviation from the part{f': {order}' if order else ''}")
    return path.read_bytes()


__all__ = ["cautions_before_planning", "deliver_job", "deviation_map", "warned"]
