"""The entry to the verifier: it takes programs, part, tools and setup and returns a proof.

Coordinates are in the setup frame, lengths in mm.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.errors import VerificationError
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.part import Part
from geometry.tool_body import ToolBody
from verify.assumptions import in_order
from verify.checks.body_assumptions import body_assumptions
from verify.checks.changed_tools import as_collisions
from verify.checks.empty_spindle import with_nose
from verify.checks.idle_tools import idle_programs, idle_tools
from verify.checks.program_assumptions import program_assumptions, rapids_decided, untold_axes
from verify.checks.program_sequence import (
    FramedProgram,
    Given,
    check_numbers,
    counted,
    moves_of,
    read_all,
    slides_of,
    strays_of,
)
from verify.checks.repeated_passes import repeats
from verify.checks.sideways_cuts import sideways_findings, tapped_out, torn_threads, turned_backwards
from verify.checks.table_clearance import table_findings
from verify.checks.tap_holes import tap_holes
from verify.checks.thread_teeth import drawn_thread_mills, taps_in_holes
from verify.findings import (
    Source,
    contact_findings,
    ordered,
    residual_findings,
)
from verify.kernels.stock import PLUNGE
from verify.material.cutting_loads import cut_sequence, loads
from verify.material.dogleg_rapids import box_findings
from verify.material.drill_loads import drill_loads
from verify.material.engagement import engaged_angles, engagement_findings, engagements, in_parts
from verify.material.fine_plunges import fine_plunges
from verify.material.loose_stock import loose_assumptions
from verify.material.material import contacts, dogleg_limits, unseen, unseen_cores
from verify.material.stock_pass import StockPass
from verify.model import (
    Asked,
    Engagement,
    FaceProof,
    Finding,
    FindingKind,
    Proof,
    ProofSetup,
    ScoredSamples,
    Support,
    WorkDone,
    ZoneProof,
)
from verify.moves import BOW, Moves
from verify.program.arc_chords import CHORD
from verify.program.move_times import minutes_of, spent
from verify.program.program import Program
from verify.progress import Report, StageProgress
from verify.surface.between_samples import settled_samples
from verify.surface.cutter_ends import rapid_presses
from verify.surface.sample_scores import RAY_ERROR, face_proofs, proved_samples, zone_proofs
from verify.surface.surface_cuts import SurfaceCuts, reach_of, surface_cuts
from verify.surface.wall_support import supported
from verify.surface.ways_in import deep_findings, slot_findings
from verify.work.asked_faces import Cutting, Measured
from verify.work.unread_work import unread_work
from verify.work.work_done import with_hidden, work_done

# shares of the work done: read, places between samples settled, residuals, support, contacts known
READ, SETTLED, CUT, HELD, MET = 0.12, 0.15, 0.48, 0.52, 0.97


def prove(programs: Sequence[Given], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
          scored: ScoredSamples, zone_ids: Sequence[str], progress: Report | None = None, *,
          threads: int | None = None, spindle_tool: int = 0, read: Sequence[Program] | None = None,
          asked: Asked | None = None) -> Proof:
    """Prove finished NC programs against the part.

    programs : NcProgram, or (name, text), in the order they run; each starts on the stock the one before leaves
    part     : Part in the setup frame, mm; tools : by T number
    setup    : ProofSetup
    scored   : ScoredSamples; zones may all be 0, then only gouges, contacts and limits are checked
    zone_ids : names of the zones 1, 2, ... of ``scored.zone``
    progress : called with 0..1, never less than before, ten times a second or more often; an exception from it ends
               the proof at once
    threads  : 2 where None, at most the cores; the result has the same bytes for any number
    spindle_tool : T number in the spindle, its length offset on, before the first line of each program; 0 for none
    read     : the same programs, already read by ``verify.program_reading.read_one``; None: they are read here
    asked    : the work that the programs have to do; None: zones answer for their samples, or no work is judged

    Returns
    -------
    Proof

    Raises
    ------
    ProgramError
        A program cannot be read; the subjects name the lines.
    VerificationError
        Two tools share a number, a cutting part is impossible, the counts of samples and zones differ, a fixture is not
        a box, or the budget is not a number.

    Notes
    -----
    A sample is proved where -gouge_tolerance <= residual - stock_allowance <= scallop_height. Residuals are
    exact on the normal of each sample (error_bound), as in [Chappel1983]. Stock beyond the part is checked on vertical
    lines [VanHook1986], or on a grid where tools tilt or programs run with another side up.
    """
    _check(tools, setup, scored, zone_ids)
    threads = threads or min(2, os.cpu_count() or 1)
    stages = StageProgress(progress)
    framed = read_all(programs, part, tools, setup, spindle_tool, stages.span(0.0, READ), read)
    stated = setup.dogleg is not None
    framed, setup = rapids_decided(framed, setup)
    tools = with_nose(tools, framed, setup)
    holes, threads_taken = tap_holes(framed, tools, setup.cutting, setup.tap_holes)
    setup = replace(setup, tap_holes=holes)
    moves, source = moves_of(framed, tools)
    moves = replace(moves, stray=strays_of(framed, tools, setup))
    tree = TriangleTree(part.mesh)
    if asked is not None:
        scored = _settled(scored, part, tools, setup, moves, threads, stages.span(READ, SETTLED))
        scored = with_hidden(scored, asked, Cutting(tree, setup, moves, tools, threads))
    cuts = surface_cuts(part, tools, setup, scored, moves, source, threads,
                        stages.span(READ if asked is None else SETTLED, CUT))
    stages.tell(CUT)
    support, unheld = supported(tree, scored, setup, moves, tools, source, zone_ids, threads,
                                stages.span(CUT, HELD))
    slides = slides_of(framed, tools, setup)
    met = contacts(part.mesh, np.concatenate([cuts.guard, cuts.edge]), moves, tools, setup, slides, threads,
                   stages.span(HELD, MET))
    run = met.run
    used = [tools[k] for k in np.unique(moves.tool[moves.feed])]
    fine = unseen(used, met.spacing, met.upright)
    no_trace = [t for t in fine if t.cone_height <= 0.0]
    skins = setup.plunge_skin * np.array([t.diameter for t in tools])[moves.tool] if len(moves) else np.zeros(0)
    stretches, of = in_parts(moves, tools)
    known = counted(framed, np.unique(source.tool).tolist())
    took = np.concatenate([np.zeros(0), *(minutes_of(p.program, setup) for p in framed)])
    in_cut = cut_sequence(framed, known, run, moves, source, tools, stretches, of, took[known], met.spacing,
                          float(part.mesh.bounds[0, 2]))
    slack = setup.scallop_height + setup.gouge_tolerance + setup.stock_allowance
    backwards = _joined([p.program.reversed_by for p in framed], known)
    tapped = taps_in_holes(moves, tools, tree, slack)
    loaded, cautions = loads(in_cut, tools, setup.cutting, run.cut | tapped.any(axis=1))
    drills = drill_loads(in_cut, tools, setup.cutting, setup, tree, threads)
    angle = engaged_angles(run.engaged, stretches, tools)
    again, springs = repeats(moves, run.cut, source, _finishes(cuts, setup, len(moves)))
    dug = fine_plunges(moves, tools, fine, part.mesh.bounds, setup, threads,
                       unseen_cores(used, setup, met.spacing, met.upright))
    dug = dug[~np.isin(dug[:, 0], run.events[run.events[:, 1] == PLUNGE, 0])]
    pressed = rapid_presses(tree, moves, tools, setup)
    met_by = contact_findings(np.concatenate([run.events, dug, pressed]), moves, source, skins, tools, setup.tap_holes)
    turned, starts = untold_axes(framed, known, run.cut)
    findings = [*as_collisions(met_by, [p.program for p in framed]),
                *cuts.gouges, *cuts.excluded, *loaded, *drills.findings, *turned, *_program_findings(framed),
                *(f for p in framed for f in p.findings(tools)), *_unlisted(run.lost, framed),
                *(f for p in framed for f in table_findings([p.program], tools, p.setup)),
                *idle_programs(source.names, run.cut, moves, source, no_trace, asked),
                *again, *sideways_findings(moves, run.cut, tools, source),
                *torn_threads(moves, run.cut, tapped[:, 0], tools, source),
                *tapped_out(moves, run.cut, tapped[:, 0], tools, source, [p.program.taps for p in framed],
                            backwards),
                *turned_backwards(moves, backwards, tools, source),
                *drawn_thread_mills(moves, run.cut, tools, source, tree, slack, _pitches(setup)),
                *(box_findings(moves, slides, *dogleg_limits(part.mesh, moves, tools, setup), source)
                  if setup.dogleg else ()),
                *engagement_findings(angle, stretches, of, source, setup.max_engaged), *unheld,
                *_residuals(scored, cuts, setup, zone_ids)]
    work: WorkDone | None = None
    if asked is not None:
        cutting = Cutting(tree, setup, moves, tools, threads)
        measured = Measured(scored.samples, cuts.residual, cuts.mover, cuts.reach,
                            error_bound([p.program for p in framed]))
        unread = None if asked.whole is None else unread_work(asked.whole, framed[0], measured, cutting, tools)
        zeros = _joined([p.program.counts_in for p in framed], known)
        work, left = work_done(asked, measured, cutting, run.cut, source, unread)
        findings += [*cuts.allowance, *left,
                     *idle_tools(run.cut, _speeds(framed, known), zeros, source, scored.samples,
                                 slack + asked.facet + measured.error, cutting, no_trace),
                     *deep_findings(scored.samples, cuts.residual, cuts.mover, cutting, source),
                     *slot_findings(scored.samples, cuts.residual, cutting, source)]
    notes = [*cuts.notes, *springs, *(note for p in framed for note in p.notes())]
    tapping = {tools[k].number for k in np.unique(moves.tool[run.cut])}
    taken = [*setup.assumed, *program_assumptions(framed, tools, setup, stated), *cuts.assumed, *drills.assumed,
             *starts, *(a for number, a in threads_taken.items() if number in tapping),
             *loose_assumptions(met.loose, moves, run.cut, source, tools),
             *body_assumptions(framed, part, moves, source, tools, setup, threads)]
    stages.tell(1.0)
    proof = _proof(findings, cuts, run, framed, known, took, moves, source, setup, scored, zone_ids,
                   engagements(angle, stretches, tools), met.spacing, tuple(notes), support)
    proof = replace(proof, cautions=tuple(cautions), assumed=in_order(taken))
    return proof if work is None else replace(proof, work=work)


def _check(tools: Sequence[ToolBody], setup: ProofSetup, scored: ScoredSamples, zone_ids: Sequence[str]) -> None:
    check_numbers(tools)
    for k, box in enumerate(setup.fixtures):
        if not (np.isfinite(box).all() and (np.asarray(box)[0] < np.asarray(box)[1]).all()):
            raise VerificationError(f"fixture {k + 1} is not a box: {np.asarray(box).tolist()}", code="bad_fixture",
                                    subjects=(f"fixture {k + 1}",), measured=np.asarray(box).tolist(),
                                    remedy="give its lower corner first and its upper corner second, in mm")
    budget = [setup.gouge_tolerance, setup.scallop_height, setup.stock_allowance]
    if not np.isfinite(budget).all():
        raise VerificationError("the budget of the proof is not a number", code="bad_budget", measured=budget,
                                remedy="give gouge tolerance, scallop height and stock allowance in mm")
    if len(scored.zone) != len(scored.samples) or scored.zone.max(initial=0) > len(zone_ids):
        raise VerificationError("the counts of samples and zones differ", code="bad_samples",
                                measured=len(scored.zone), limit=len(scored.samples))


def _pitches(setup: ProofSetup) -> dict[int, float]:
    """Pitches that tools state, mm by T number."""
    return {number: said.pitch for number, said in setup.cutting.items() if said.pitch is not None}


def _speeds(read: Sequence[FramedProgram], known: NDArray[np.bool_]) -> F64:
    """(m,) float64, 1/min, of the spindle in each move; inf where nothing states it."""
    speeds = (p.speed if len(p.speed) else np.full(len(p), np.inf) for p in (r.program for r in read))
    return np.concatenate([np.zeros(0), *speeds])[known]


def _joined(of_programs: Sequence[NDArray[np.int64]], known: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(m,) int64, dimensionless, numbers of the moves of all programs, of those that are known."""
    return np.concatenate([np.zeros(0, np.int64), *of_programs])[known]


def _settled(scored: ScoredSamples, part: Part, tools: Sequence[ToolBody], setup: ProofSetup, moves: Moves,
             threads: int, tell: Report) -> ScoredSamples:
    """The samples with close ones in each place that a coarse one does not speak for; no zone answers for them."""
    box = part.mesh.bounds
    samples = settled_samples(scored.samples, box, moves, tools, setup, reach_of(setup), threads, tell)
    return scored if samples is scored.samples else ScoredSamples(samples, np.zeros(len(samples), np.int32))


def _program_findings(read: Sequence[FramedProgram]) -> list[Finding]:
    return [Finding(FindingKind.PROGRAM, p.program.name, r.line, None, None, None, 0.0, 0.0, r.message)
            for p in read for r in p.program.remarks]


def _unlisted(lost: int, read: Sequence[FramedProgram]) -> list[Finding]:
    """The finding that more contacts were found than the tables hold."""
    if not lost:
        return []
    return [Finding(FindingKind.PROGRAM, read[0].program.name, 0, None, None, None, 0.0, 0.0,
                    f"{lost} contacts are not listed, as there are too many: mend those that are listed first", lost)]


def _finishes(cuts: SurfaceCuts, setup: ProofSetup, count: int) -> NDArray[np.bool_]:
    """(count,) bool, moves that leave a sample within the budget."""
    out = np.zeros(count, np.bool_)
    out[cuts.mover[(cuts.mover >= 0) & proved_samples(cuts.residual, setup)]] = True
    return out


def _residuals(scored: ScoredSamples, cuts: SurfaceCuts, setup: ProofSetup, zone_ids: Sequence[str]) -> list[Finding]:
    """Findings of samples outside the budget, and of close points outside it whose sample is within."""
    s, close = scored.samples, cuts.close
    proved = proved_samples(cuts.residual, setup)
    bad = np.flatnonzero((scored.zone > 0) & ~proved)
    within = (scored.zone[close.row] > 0) & proved[close.row]
    near = np.flatnonzero(within & ~proved_samples(cuts.close_residual, setup))
    row, excess = close.row[near], np.concatenate([cuts.residual[bad], cuts.close_residual[near]])
    return residual_findings(np.concatenate([s.points[bad], close.points[near]]),
                             np.concatenate([scored.zone[bad], scored.zone[row]]),
                             np.concatenate([s.face[bad], s.face[row]]), excess - setup.stock_allowance,
                             np.concatenate([s.area[bad], close.area[near]]), zone_ids, setup.scallop_height)


def _proof(findings: list[Finding], cuts: SurfaceCuts, run: StockPass, readings: Sequence[FramedProgram],
           known: NDArray[np.bool_], took: F64, moves: Moves, source: Source, setup: ProofSetup, scored: ScoredSamples,
           zone_ids: Sequence[str], engaged: dict[int, Engagement], spacing: float, notes: tuple[str, ...],
           support: Support) -> Proof:
    read = [r.program for r in readings]
    cut_length = np.linalg.norm(moves.end - moves.start, axis=1)[run.cut]
    minutes = took[known][run.cut]
    used = source.tool[run.cut]
    proved = proved_samples(cuts.residual, setup)
    top, counts = ordered(findings)
    mover = cuts.mover
    has = mover >= 0
    line, program = np.zeros(len(mover), np.int32), np.full(len(mover), -1, np.int32)
    line[has], program[has] = source.line[mover[has]], source.program[mover[has]]
    return Proof(top, counts, cuts.residual, line, program, proved,
                 zone_proofs(scored, cuts.residual, proved, setup, zone_ids),
                 face_proofs(scored.samples, cuts.residual, has, proved, setup), cuts.gouge_max,
                 spent(read, took, known, run.cut), float(cut_length.sum()),
                 {int(t): float(minutes[used == t].sum()) for t in np.unique(used)}, engaged, error_bound(read),
                 cuts.reach, spacing, notes, support)


def error_bound(read: Sequence[Program]) -> float:
    """Largest error of a residual, mm: rays, chords of arcs, blending the programs allow, and turning tools."""
    turning = BOW if any(p.poses is not None for p in read) else 0.0
    return RAY_ERROR + CHORD + max((p.leaves for p in read), default=0.0) + turning


__all__ = ["FaceProof", "Finding", "FindingKind", "Proof", "ProofSetup", "ScoredSamples", "ZoneProof", "prove"]
