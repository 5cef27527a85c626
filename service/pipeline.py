"""The life of one STEP file: read, zones, tool paths, programs, proof, report.

``plan`` runs the whole chain and writes its files, ``zones_only`` stops before the first pass, and ``verify_program``
proves a program of any origin, without zones. No program is written before the proof has read it and found nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numba

from geometry.child_process import give_back_memory
from geometry.errors import CamError
from schemas.setup import Setup
from service.checkpoint_store import Kept
from service.delivery.job_delivery import cautions_before_planning, deliver_job, deviation_map, warned
from service.delivery.machined_mesh import MESH_NAME, MeshWish, machined_part
from service.delivery.result_files import Files, clear_results, deliver
from service.delivery.stepnc_files import StepncUnderWay
from service.delivery.written_program import WrittenProgram
from service.estimate.estimate import Estimate
from service.estimate.job_estimate import estimate_of
from service.from_wire import check_plannable
from service.part_reading import PartReading
from service.pictures.proof_picture import MAP_NAME
from service.report import report as reporting
from service.report.computed_ahead import ComputedAhead
from service.stages.access_settings import FirstAccess, planning_stock, proof_setup
from service.stages.cautions import sentences
from service.stages.job_part import JobPart, read_job_part
from service.stages.plan_prove_loop import Planner, Progress, ProvedPlan, plan_and_prove
from service.stages.preparation import Prepared, prepare
from service.stages.programs import proof_frame
from service.stages.proof_samples import Score, score
from service.stages.resume import Resumed
from service.stages.trimmed_faces import trimmed_faces
from service.verification.program_first import ProgramFirst, read_first
from service.verification.program_proof import proved_program
from service.viewer.view_data import verification_view
from toolpath.passes.trimmed_faces import Faces
from toolpath.planning.job_plan import plan_job
from toolpath.stock.stock_map import StockMap
from verify.model import Proof
from zones.reach.access_view import View

Admit = Callable[[Estimate], None]
"""Lets a job begin: it waits for room, or raises where the machine is too small."""


def plan(part_path: Path, setup: Setup, out: Path, progress: Progress, mesh: MeshWish | None = None,
         planner: Planner = plan_job, blank_path: Path | None = None, kept: Kept | None = None,
         reading: PartReading | None = None, admit: Admit | None = None) -> dict[str, Any]:
    """Plan and prove a job and write its files into ``out``, from which those of an earlier job are removed.

    mesh       : also write the machined part as a mesh, in the frame of the proof
                 (``service.stages.programs.proof_frame``)
    planner    : what makes workingsteps of the zones of an access, with the arguments of ``plan_job``
    blank_path : STEP file of the blank where ``stock.kind`` is 'step'; ``stock.step_file`` is not read
    kept       : plans and proofs that an earlier attempt at this job kept, and where this attempt keeps its own
                 (``service.stages.resume``); None: nothing is kept
    reading    : the reading of this part, where it has begun already
    admit      : called with the estimate of the job once the part is read; it returns when the job may begin

    Returns
    -------
    dict
        The report; ``report["state"]`` is 'proved' or 'unproved'. Programs and STEP-NC are written only where it
        is 'proved'.

    Raises
    ------
    CamError
        Wrong input, limits exceeded, or a bug; or what ``admit`` raises.
    """
    check_plannable(setup)
    out.mkdir(parents=True, exist_ok=True)
    clear_results(out)
    with PartReading(part_path, setup, planned=True) if reading is None else nullcontext(reading) as read:
        ready = prepare(part_path, setup, progress, blank_path=blank_path, reading=read,
                        begin=_admission(admit, "plan"))
        cautions = cautions_before_planning(ready)
        with StepncUnderWay(out) as stepnc, reporting.known_before_planning(ready) as known:
            job = _proved_plan(part_path, warned(ready, sentences(cautions)), kept or Kept(), planner, progress,
                               stepnc, known, read)
            give_back_memory()
            report = deliver_job(job, cautions, out, mesh, progress, stepnc, known)
    progress("done", 1.0)
    return report


def _admission(admit: Admit | None, kind: str) -> Callable[[JobPart], None] | None:
    """What is called with a part that is read: it estimates the job of a kind and asks ``admit`` to let it begin."""
    return None if admit is None else lambda job: admit(estimate_of(job, kind))


def prove_plan(part_path: Path, setup: Setup, progress: Progress) -> Proof:
    """Plan and prove a job as ``plan`` does, but write no files; returns the proof of its last plan.

    Raises
    ------
    CamError
        As ``plan``.
    """
    check_plannable(setup)
    job = _proved_plan(part_path, prepare(part_path, setup, progress), Kept(), plan_job, progress)
    progress("done", 1.0)
    return job.proof


def _proved_plan(part_path: Path, ready: Prepared, kept: Kept, planner: Planner, progress: Progress,
                 stepnc: StepncUnderWay | None = None,
                 known: ComputedAhead[dict[str, Any]] | None = None, reading: PartReading | None = None) -> ProvedPlan:
    """The last plan of a prepared job, with its proof; ``known`` is computed beside it, ``stepnc`` beside the proof.

    reading : of the part, which may have read its exact faces
    """
    ready, trimmed, scored, first = _begun(part_path, ready, reading)
    frame = proof_frame(ready)
    samples = frame.into(scored.samples, ready.views[0])
    resumed = Resumed(kept, ready, scored.checks(ready), samples)
    conditions = proof_setup(ready, frame)
    if stepnc is not None:
        stepnc.expect()

    def told(stage: str, share: float) -> None:
        progress(stage, share)
        if known is not None and stage == "plan":  # an act of the plan is done: its other threads need no core now
            known.begin()

    def begin(written: Sequence[WrittenProgram]) -> None:
        if stepnc is not None:
            stepnc.begin(written, frame.part, ready.inputs.bodies, conditions)

    def blank(view: View) -> StockMap:
        return first.stock if view is first.view else planning_stock(ready, view)

    return plan_and_prove(resumed, scored, trimmed, frame, conditions, planner, told, begin, blank)


def _begun(part_path: Path, ready: Prepared, reading: PartReading | None,
           ) -> tuple[Prepared, Mapping[str, Sequence[Faces]], Score, FirstAccess]:
    """The exact faces by zone, which another process reads meanwhile, the samples of the proof, and the stock."""
    # one thread of numba there: no two threads may enter its threading layer at once
    with ThreadPoolExecutor(2, initializer=numba.set_num_threads, initargs=(1,)) as pool:
        faces = pool.submit(trimmed_faces, part_path, ready, reading) if ready.inputs.operations.finishing else None
        first = pool.submit(FirstAccess.of, ready)
        scored = score(ready)
    first.result().settle()
    try:
        return ready, faces.result() if faces is not None else {}, scored, first.result()
    except CamError as refusal:  # the part itself is read, and other strategies need no exact faces
        return (warned(ready, [f"no passes along the borders of faces: {refusal.message}"]), {}, scored,
                first.result())


def zones_only(part_path: Path, setup: Setup, progress: Progress, blank_path: Path | None = None,
               reading: PartReading | None = None, admit: Admit | None = None) -> dict[str, Any]:
    """The dry check: walls, connections, channels, zones with their tools, and the remainder.

    blank_path, reading, admit : as in ``plan``

    Raises
    ------
    CamError
        As ``plan``.
    """
    check_plannable(setup)
    ready = prepare(part_path, setup, progress, blank_path=blank_path, reading=reading,
                    begin=_admission(admit, "zones"))
    ready = warned(ready, sentences(cautions_before_planning(ready)))
    out = reporting.dry_report(ready)
    progress("done", 1.0)
    return out


def verify_program(part_path: Path, setup: Setup, program_text: str, progress: Progress,
                   access: str | None = None, out: Path | None = None, mesh: MeshWish | None = None,
                   spindle_tool: int = 0, blank_path: Path | None = None, dialect: str | None = None,
                   ending: str = "", program: ProgramFirst | None = None,
                   reading: PartReading | None = None, admit: Admit | None = None) -> dict[str, Any]:
    """Prove any program, NC code or STEP-NC, against the part: harm that it does, and work that it leaves undone.

    The program is read before the part. The part is not decomposed: no zone answers for a sample here. Stock that is
    left is a finding where the tools of the program can touch the part, on the faces that the setup names or that the
    program works on (``verify.work.work_done``).

    access       : in whose frame the program is read; None: the first access, or the setup frame on a machine with
                   rotary axes
    out          : folder for the deviation map, the mesh and the report; None: no file is written
    mesh         : also write the machined part as a mesh into ``out``
    spindle_tool : T number of the tool in the spindle before the first line, its length offset active; 0: none
    blank_path   : as in ``plan``
    dialect      : of the program; None: found by marks in its text, by ``ending`` of its file name, or by the dialects
                   of the machine (``verify.gcode.dialects.dialect_of``)
    program      : the same program, already read by ``service.verification.program_first.read_first``
    reading      : as in ``plan``
    admit        : as in ``plan``

    Returns
    -------
    dict
        The report; ``report["state"]`` is 'proved', 'clean' or 'unproved'.

    Raises
    ------
    CamError
        As ``plan``; ``ProgramError`` where the program cannot be read, ``SetupError`` (``no_such_access``,
        ``no_such_tool``).
    """
    first = program or read_first(setup, program_text, access=access, spindle_tool=spindle_tool, dialect=dialect,
                                  ending=ending)
    job = read_job_part(part_path, setup, progress, blank_path, reading)
    if admit is not None:
        admit(estimate_of(job, "verify"))
    made = proved_program(job, first, lambda f: progress("prove", 0.2 + 0.6 * f))
    frame, report, conditions, tools = made.frame, made.report, made.conditions, job.inputs.bodies
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        files: Files = {MAP_NAME: ("deviation", "", frame.id, deviation_map(job, frame, made.samples, made.proof,
                                                                            conditions, report, out / MAP_NAME))}
        if mesh is not None:
            figures, data = machined_part(mesh, [first.nc], frame.part, tools, conditions,
                                          lambda f: progress("mesh", 0.8 + 0.2 * f), spindle_tool=first.spindle_tool)
            report["machined"] = {"file": MESH_NAME, "access": frame.id, **figures}
            files[MESH_NAME] = ("machined", "", frame.id, data)
        files.update(verification_view(job, frame, made.samples, made.proof, [first.nc], conditions, report, made.entry,
                                       first.read))
        deliver(out, report, files)
    progress("done", 1.0)
    return report
