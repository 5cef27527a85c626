"""The life of one STEP file: read, zones, tool paths, programs, proof, report.

``plan`` runs the whole chain and writes its files, ``zones_only`` stops before the first pass, ``verify_program``
proves a program that may come from anywhere. Nothing is written as a program before the proof has read it and
found nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from geometry.errors import CamError, SetupError
from geometry.sampling import SurfaceSamples
from output.arc_fitting import SHARE as ARCS
from schemas.setup import Lean, Setup
from service.checkpoint_store import Kept
from service.from_wire import check_plannable, check_spindle_tool
from service.pictures.proof_picture import MAP_NAME, draw_proof
from service.report import report as reporting
from service.setup_sheet.setup_sheet import sheet_files
from service.stages.access_plan import Look, Program, Side, in_setup_frame
from service.stages.cautions import (
    bent,
    dry,
    limited,
    lives_ended,
    sentences,
    thin_walls,
    uncut_centres,
    unheld,
    upright,
)
from service.stages.machined_mesh import MESH_NAME, MeshWish, machined_part
from service.stages.preparation import Prepared, prepare, table_height
from service.stages.programs import access_of, fixture_boxes, programs_of, proof_frame, turning_of, with_figures
from service.stages.proof_samples import Score, score
from service.stages.replanning import PLANS, Attempt, Learned, learned, worth_another
from service.stages.result_files import Files, clear_results, deliver, json_bytes
from service.stages.resume import Resumed
from service.stages.stepnc_files import stepnc_under_way
from service.stages.trimmed_faces import trimmed_faces
from service.stages.wall_support import FREE_RATIO, band_planes, in_turn
from service.viewer.preview_picture import draw_preview
from service.viewer.view_data import VIEW_NAME, plan_view, verification_view
from toolpath.feeds.tool_life import with_fresh_cutters, worn
from toolpath.passes.pass_family import Target
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_checkpoint import Keeper
from toolpath.plan_settings import Leaned, Pattern, PlanSettings
from toolpath.planning.job_plan import Plan, plan_job
from toolpath.stock.stock_map import StockMap
from verify.comparison.program_equivalence import carried
from verify.gcode.dialects import dialect_of
from verify.model import NcProgram, Proof, ProofSetup, ScoredSamples
from verify.prove import prove
from zones.reach.access_view import View

Progress = Callable[[str, float], None]
Planner = Callable[..., Plan]
RAMP_ANGLE = np.radians(3.0)
STOCK_STEP = 0.08  # mm, the planner's stock lattice; wider where that would take more than STOCK_CELLS
STOCK_CELLS = 4e6
ABOVE = 1.0  # mm between the height rapids may go down to and the clearance plane
PREPARED, PROVED = 0.28, 0.96  # shares of the work done
FIRST_SHARE, PLAN_SHARE = 0.9, 0.7  # of what is left to a proof: of a plan and its proof; of these: of the plan


def plan(part_path: Path, setup: Setup, out: Path, progress: Progress, mesh: MeshWish | None = None,
         planner: Planner = plan_job, blank_path: Path | None = None, kept: Kept | None = None) -> dict[str, Any]:
    """Plan and prove a job and write its files into ``out``, from which those of an earlier job are removed.

    mesh : also write the machined part as a mesh, in the frame of the proof (``service.stages.programs.proof_frame``)
    planner : what makes workingsteps of the zones of an access, with the arguments of ``plan_job``
    blank_path : STEP file of the blank where ``stock.kind`` is 'step'; what the setup calls it is not looked at
    kept : what an attempt at this very job kept before and what this one keeps (``service.stages.resume``); nothing in None

    Returns
    -------
    dict
        The report; ``report["state"]`` is 'proved' or 'unproved'. Programs and STEP-NC are written only where it
        is 'proved'.

    Raises
    ------
    CamError
        Wrong input, limits exceeded, or a bug.
    """
    check_plannable(setup)
    out.mkdir(parents=True, exist_ok=True)
    clear_results(out)
    ready = prepare(part_path, setup, progress, blank_path=blank_path)
    inputs = ready.inputs
    cautions = [*limited(inputs), *dry(inputs), *thin_walls(ready)]
    ready = replace(ready, warnings=(*ready.warnings, *sentences(cautions)))
    ready, trimmed, scored = _trimmed_and_scored(part_path, ready)
    checks = scored.checks(ready)
    first, look = ready.views[0], proof_frame(ready)
    dense = look.into(scored.samples, first)
    judged_by = proof_setup(ready, look)
    resumed = Resumed(kept or Kept(), ready, checks, dense)
    told, begun = Learned(), PREPARED
    sides: list[Side] = []
    found: list[int] = []
    blanks: dict[str, StockMap] = {}
    while True:
        # how many there will be is not known: each takes most of what is left
        ended = begun + FIRST_SHARE * (PROVED - begun)
        span = _Span(progress, begun, begun + PLAN_SHARE * (ended - begun), ended)
        for k, view in list(enumerate(ready.views))[len(sides):]:
            sides.append(resumed.side(view, sides, told.along(view.id), partial(
                _side, ready, view, checks, trimmed, sides, span.of(k, len(ready.views)), told, planner, blanks)))
        made = Plan(tuple(t for s in sides for t in s.made.steps), tuple(z for s in sides for z in s.made.zones))
        zone, given_up = scored.without(made, ready.zones)
        written = programs_of(ready, sides, trimmed)
        programs = [p.given() for p in written]
        proof = resumed.proof(programs, zone, partial(
            prove, programs, look.part, inputs.bodies, judged_by, ScoredSamples(dense, zone),
            [z.id for z in ready.zones], span.proving))
        more = learned(told, Attempt(sides, written, ready.zones, scored.zone, zone, look, proof))
        found.append(sum(proof.counts.values()))
        if more is None or not worth_another(found, PLANS):
            break
        # an access is planned from what those before it leave: those up to the first that is told something stay
        sides, told, begun = list(takewhile(partial(_untold, told, more), sides)), more, ended
    stated = in_setup_frame(look, proof)
    late = [*unheld(stated.support), *bent(made.steps), *lives_ended(inputs, made.steps),
            *uncut_centres(inputs, made.steps), *upright(_leaned(inputs.operations.lean), made.zones, made.steps)]
    cautions = [*cautions, *late]
    ready = replace(ready, warnings=(*ready.warnings, *told.notes, *sentences(late)))
    report, rest, stays = reporting.job_report(ready, made, stated, scored.samples, scored.labels, zone,
                                               given_up, cautions)
    if report["state"] == "proved":
        # of every control's program one was simulated, before its figures were known; what is delivered is the same
        final = with_figures(written, report)
        report["proof"]["notes"] += _carried(ready, look, judged_by, written, final)
        written = final
    clean = written if report["state"] == "proved" else []
    with stepnc_under_way(clean, look.part, inputs.bodies, judged_by, out) as stepnc:
        progress("report", PROVED)
        files: Files = {}
        if report["state"] == "proved":
            for p in written:
                files.update({name: ("program", dialect, p.access, text.encode()) for dialect, name, text in p.files()})
        files["zones.json"] = ("zones", "", None, json_bytes(reporting.zones_document(report)))
        page = plan_view(ready, look, scored, zone, rest, stays, proof, programs, judged_by, report)
        if page:
            _preview(ready, page[VIEW_NAME][3], report, out / "preview.png")
            files["preview.png"] = ("preview", "", None, (out / "preview.png").read_bytes())
        _deviation(ready, look, dense, proof, judged_by, report, out / MAP_NAME)
        files[MAP_NAME] = ("deviation", "", None, (out / MAP_NAME).read_bytes())
        if mesh is not None and programs:
            figures, data = machined_part(mesh, programs, look.part, inputs.bodies, judged_by,
                                          lambda f: progress("mesh", PROVED + (1.0 - PROVED) * f))
            report["machined"] = {"file": MESH_NAME, "access": first.id, **figures}
            files[MESH_NAME] = ("machined", "", None, data)
        if report["state"] == "proved":
            files.update(stepnc())
    files.update(sheet_files(ready, written, report, files))
    files.update(page)
    deliver(out, report, files)
    progress("done", 1.0)
    return report


def _trimmed_and_scored(part_path: Path, ready: Prepared) -> tuple[Prepared, Mapping[str, Sequence[Faces]], Score]:
    """The exact faces, which another process reads meanwhile, and the samples of the proof."""
    with ThreadPoolExecutor(1) as pool:
        faces = pool.submit(trimmed_faces, part_path, ready) if ready.inputs.operations.finishing else None
        scored = score(ready)
    try:
        return ready, faces.result() if faces is not None else {}, scored
    except CamError as refusal:  # the part itself is read, and other strategies do without
        warning = f"no passes along the borders of faces: {refusal.message}"
        return replace(ready, warnings=(*ready.warnings, warning)), {}, scored


def _carried(ready: Prepared, look: Look, judged_by: ProofSetup, written: Sequence[Program], final: Sequence[Program]) -> list[str]:
    """Hold the programs as they are delivered, of all controls, against those that are proved; returns notes."""
    return [note for p, f in zip(written, final, strict=True)
            for note in carried(p.given(), [f.given(), *f.twins()], look.part, ready.inputs.bodies, judged_by)]


def _untold(told: Learned, more: Learned, side: Side) -> bool:
    """Whether a proof had nothing to say of an access."""
    return more.along(side.view.id) is told.along(side.view.id)


@dataclass(frozen=True)
class _Span:
    """Progress of one plan and its proof: from where, to where the plan goes, and to where the proof."""

    progress: Progress
    begun: float
    planned: float
    proved: float

    def of(self, k: int, count: int) -> Callable[[float], None]:
        """What one access of several tells its share, 0 to 1, to."""
        width = (self.planned - self.begun) / count
        return lambda share: self.progress("plan", self.begun + width * (k + share))

    def proving(self, share: float) -> None:
        """Report a share, 0 to 1, of the proof."""
        self.progress("prove", self.planned + (self.proved - self.planned) * share)


def _side(ready: Prepared, view: View, checks: list[Target], trimmed: Mapping[str, Sequence[Faces]],
          before: Sequence[Side], tell: Callable[[float], None], told: Learned, planner: Planner,
          blanks: dict[str, StockMap], keeper: Keeper) -> Side:
    """Plan the zones of one access; ``blanks`` keeps what the blank looks like along it for the next plan.

    On a machine with rotary axes, where all accesses are one program, from what the accesses before leave; else from
    the whole blank, for who knows in which order programs are run. Heights are those of the whole blank in any case.
    """
    turned, steps = ready.inputs.turns, sum(len(s.made.steps) for s in before)
    if view.id not in blanks:
        blanks[view.id] = planning_stock(ready, view)
    stock = blanks[view.id].copied()
    found = told.along(view.id)
    settings = replace(plan_settings(ready, view, stock), found=found, planes=band_planes(ready, view, found.unheld))
    if turned:
        lowest = float(ready.blank.corners(view.rotation)[0, 2]) - math.sqrt(3.0) * ready.blank.beyond  # of a box
        stock.left_by([(s.left, s.view.rotation @ view.rotation.T) for s in before if s.left is not None], lowest)
    mine = [k for k, z in enumerate(ready.zones) if z.access == view.id]
    zones = [ready.zones[k] for k in mine]
    made = planner(zones, [checks[k] for k in mine], view.fields, ready.inputs.cut_table, stock, settings,
                   lambda f: tell(0.98 * f), first_step=steps + 1, trimmed=trimmed, keeper=keeper)
    stock.settle(last=True)
    used = worn(t for s in before for t in s.made.steps)
    made = Plan(tuple(with_fresh_cutters(made.steps, ready.inputs.tool_lives, settings.clearance, used)), made.zones)
    if turned:
        made = Plan(tuple(replace(s, access=view.id) for s in made.steps), made.zones)
    return Side(view, made, settings.clearance, stock if turned else None)


def zones_only(part_path: Path, setup: Setup, progress: Progress, blank_path: Path | None = None) -> dict[str, Any]:
    """The dry check: walls, connections, channels, zones with their tools, and what stays out of reach.

    blank_path : as ``plan``

    Raises
    ------
    CamError
        As ``plan``.
    """
    check_plannable(setup)
    ready = prepare(part_path, setup, progress, blank_path=blank_path)
    cautions = [*limited(ready.inputs), *dry(ready.inputs), *thin_walls(ready)]
    ready = replace(ready, warnings=(*ready.warnings, *sentences(cautions)))
    out = reporting.dry_report(ready)
    progress("done", 1.0)
    return out


def verify_program(part_path: Path, setup: Setup, program_text: str, progress: Progress,
                   access: str | None = None, out: Path | None = None, mesh: MeshWish | None = None,
                   spindle_tool: int = 0, blank_path: Path | None = None, dialect: str | None = None,
                   ending: str = "") -> dict[str, Any]:
    """Prove any program, NC code or STEP-NC, against the part: gouges, contacts, rapids and limits, and what it leaves.

    No zone answers for a sample here, so uncut area is a figure (coverage), not a finding. The program is read in the
    frame of one access; where ``access`` is None in that of the first, on a machine with rotary axes in the setup's.
    ``spindle_tool`` is the T number that stands in the spindle, its length offset on, before its first line, 0 for
    none.

    out  : folder for the deviation map, the mesh and the report; none is written where it is None
    mesh : the machined part is wanted too; it is written into ``out``
    blank_path : as ``plan``
    dialect : whose words the program has; None: by its own marks, by ``ending`` of its file name or by the controls of
        the machine (``verify.gcode.dialects.dialect_of``)

    Raises
    ------
    CamError
        As ``plan``; ``ProgramError`` where the program cannot be read, ``SetupError`` (``no_such_access``,
        ``no_such_tool``).
    """
    known = [a.id for a in setup.access]
    if access is not None and access not in known:
        raise SetupError(f"the setup has no access {access}; it has {', '.join(known)}", code="no_such_access",
                         subjects=(access,), remedy="name one of them, or leave it out for the first")
    check_spindle_tool(setup, spindle_tool)
    ready = prepare(part_path, setup, progress, search=False, blank_path=blank_path)
    view = ready.view(access or known[0])
    look = proof_frame(ready) if access is None else Look.of(view)
    dense = look.into(score(ready).samples, ready.views[0])
    spoken = dialect or dialect_of(program_text, ending, setup.machine.dialects)
    given = [NcProgram("program", program_text, dialect=spoken)]
    tools, judged_by = ready.inputs.bodies, proof_setup(ready, look, foreign=True)
    proof = prove(given, look.part, tools, judged_by,
                  ScoredSamples(dense, np.zeros(len(dense), np.int32)), [], lambda f: progress("prove", 0.3 + 0.5 * f),
                  spindle_tool=spindle_tool)
    report = reporting.verification_report(ready, in_setup_frame(look, proof), dense)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        files: Files = {}
        _deviation(ready, look, dense, proof, judged_by, report, out / MAP_NAME)
        files[MAP_NAME] = ("deviation", "", view.id, (out / MAP_NAME).read_bytes())
        if mesh is not None:
            figures, data = machined_part(mesh, given, look.part, tools, judged_by,
                                          lambda f: progress("mesh", 0.8 + 0.2 * f), spindle_tool=spindle_tool)
            report["machined"] = {"file": MESH_NAME, "access": view.id, **figures}
            files[MESH_NAME] = ("machined", "", view.id, data)
        files.update(verification_view(ready, look, dense, proof, given, judged_by, report, spindle_tool))
        deliver(out, report, files)
    progress("done", 1.0)
    return report


def planning_stock(ready: Prepared, view: View) -> StockMap:
    """The stock the planner starts from: the largest the setup allows."""
    lo, hi = ready.blank.corners(view.rotation)
    step = max(min(STOCK_STEP, ready.inputs.engagement_spacing), float(np.sqrt(np.prod(hi[:2] - lo[:2]) / STOCK_CELLS)))
    return ready.blank.planned(view, step)


def plan_settings(ready: Prepared, view: View, stock: StockMap) -> PlanSettings:
    """Tolerances and heights of the plan."""
    inputs = ready.inputs
    q, ops = inputs.quality, inputs.operations
    tops = [stock.highest, float(view.part.bounds[1, 2]) + q.stock_allowance_mm]
    tops.extend(float(f[1, 2]) for f in fixture_boxes(ready, view))
    floor = float(np.ceil(10.0 * (max(tops) + inputs.clearances.rapid + 0.1)) / 10.0)
    chord = q.chordal_tolerance_mm * (1.0 - (ARCS if inputs.machine.arcs else 0.0))
    return PlanSettings(q.scallop_height_mm, chord, q.stock_allowance_mm, ready.lift, floor + ABOVE,
                        floor, float(RAMP_ANGLE), ops.roughing, ops.finishing, ops.cut_direction != "conventional",
                        ops.cut_direction == "either", Pattern(ops.pattern), turning_of(ready, view),
                        rates=inputs.rates, semi_finishing=ops.semi_finishing,
                        leaned=_leaned(ops.lean))


def _leaned(lean: Lean) -> Leaned | None:
    """How noses are asked to lean, in the words of the plan."""
    if not lean.asked:
        return None
    walls = lean.walls_tilt_deg
    return Leaned(math.radians(lean.lead_deg), math.radians(lean.tilt_deg),
                  None if walls is None else math.radians(walls))


def proof_setup(ready: Prepared, view: View | Look, *, foreign: bool = False) -> ProofSetup:
    """The setup in the plain words of the proof, in the frame of a view.

    foreign : of programs that were not planned here: a table nobody told of is not held against them
    """
    inputs = ready.inputs
    c, q, machine = inputs.clearances, inputs.quality, inputs.machine
    # its height is one of the setup frame: a program read in the frame of an oblique access is not held against it
    tabled = (inputs.turns and np.array_equal(view.rotation, np.eye(3))
              and not (foreign and machine.table_z_mm is None))
    cylinder, upwards = ready.blank.proof_cylinder(view.rotation)
    return ProofSetup(
        stock_kind=inputs.stock.kind, margin=inputs.stock.margin_mm, uncertainty=ready.blank.beyond,
        stock_box=ready.blank.proof_box(view.rotation), stock_cylinder=cylinder, stock_axis=upwards,
        stock_mesh=ready.blank.proof_mesh(view.rotation),
        fixtures=fixture_boxes(ready, view), clearance_neck=c.neck,
        clearance_shank=c.shank, clearance_holder=c.holder, clearance_rapid=c.rapid,
        scallop_height=q.scallop_height_mm, gouge_tolerance=q.gouge_tolerance_mm,
        stock_allowance=q.stock_allowance_mm, ramp_angle=float(RAMP_ANGLE),
        rapid_feed=inputs.rates.rapid, acceleration=inputs.rates.acceleration,
        work_offset=access_of(ready, view).work_offset,
        travel=None if machine.travel_mm is None else np.array(machine.travel_mm, dtype=np.float64),
        gauge_length=inputs.gauge_lengths,
        line_spacing=min(ProofSetup.line_spacing, inputs.engagement_spacing),
        dogleg=machine.rapid_motion == "dogleg", max_feed=machine.max_feed_mm_min,
        max_engaged=inputs.max_engaged, max_rpm=inputs.max_rpm,
        table=table_height(inputs, ready.blank) if tabled else None,
        table_known=machine.table_z_mm is not None, free_ratio=FREE_RATIO, walls_in_turn=in_turn(ready),
        kinematics=inputs.kinematics, rotary_limits=inputs.rotary_limits,
        rotary_rate=None if machine.rotary_rate_deg_min is None else float(np.radians(machine.rotary_rate_deg_min)))


def _preview(ready: Prepared, view: bytes | Path, report: dict[str, Any], path: Path) -> None:
    facts = {"state": report["state"], "coverage": f"{100 * report['coverage']:.1f} %",
             "of what is in reach": f"{100 * report['reach_coverage']:.1f} %",
             "machining time": f"{report['machining_time_s'] / 60:.0f} min"}
    data = view if isinstance(view, bytes) else view.read_bytes()
    draw_preview(data, path, ready.inputs.labels.get("order") or "zonemill", facts)


def _deviation(ready: Prepared, view: Look, samples: SurfaceSamples, proof: Proof, judged_by: ProofSetup,
               report: dict[str, Any], path: Path) -> None:
    """Draw the deviation map in the frame of a view; samples and findings of the proof are in that frame."""
    order = ready.inputs.labels.get("order")
    draw_proof(view.part, samples, proof, judged_by, report["state"], report["coverage"] or 0.0, path,
               f"Deviation from the part{f': {order}' if order else ''}")
