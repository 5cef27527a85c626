"""From planned accesses to programs, and the frame these are proved in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from geometry.errors import InternalError, OutputError
from geometry.mesh import F64
from geometry.part import OtherSolid
from geometry.surfaces.nurbs import NurbsSurface
from geometry.tool_body import ToolBody
from output.arc_fitting import fitted
from output.clamping_sequence import MAX_AXIS_DEVIATION, home_of
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_splitting import parts_of
from output.gcode.program_writer import write_program
from output.gcode.proof_header import AWAITED, filled
from output.header_text import decimal
from output.workplan import FIRST_NUMBER, AccessFrame, Ap238, Assembly, Clamping, StockBox, StockCylinder, Workplan
from schemas.setup import Access
from service.delivery.written_program import WrittenProgram
from service.setup_assumptions import setup_assumptions
from service.stages.access_plan import AccessPlan, ProofFrame
from service.stages.blank_model import turned_box
from service.stages.job_part import JobPart
from service.stages.preparation import TABLE_SPARE, Prepared, table_height
from service.stages.trimmed_faces import exact_faces
from service.version import VERSION
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_settings import RotaryAxes
from toolpath.workingsteps import Workingstep
from verify.surface.guard_points import wide_samples
from zones.reach.access_view import View, access_rotation, turned

BOW, SPARE = 1.0 / 800.0, 0.01  # chord error of a swing over the distance from the tip; mm, for rounding
RATE_SPARE = 1.05  # of the time the axes take at their fastest: words are rounded
PARTS, LAST_NUMBER = 100, 7000  # from 8000 on numbers may be locked
DOGLEG_STEP = math.radians(0.5)  # rad, largest turn of an axis in one block where each moves at its own speed
ROUNDS = 4  # of the room for doglegs: each is nearer by the factor of a step
NO_HOLDER = 200.0  # mm of shank above the stickout that are assumed where the setup names no holder


def fixture_boxes(job: JobPart, view: View | ProofFrame) -> tuple[np.ndarray, ...]:
    """Boxes around the fixtures, each (2, 3) float64, mm, in the frame of a view."""
    return tuple(turned_box(box, view.rotation) for box in job.inputs.fixtures)


def other_solids(job: JobPart, view: View | ProofFrame) -> tuple[OtherSolid, ...]:
    """The other solids of the part's file that the setup does not speak of, boxes in the frame of a view."""
    return tuple(replace(o, bounds=turned_box(o.bounds, view.rotation),
                         boxes=np.array([turned_box(b, view.rotation) for b in o.boxes]).reshape(-1, 2, 3))
                 for o in job.inputs.others)


def access_of(job: JobPart, view: View | ProofFrame) -> Access:
    """The access that a view or a frame of a proof belongs to."""
    return next(a for a in job.accesses if a.id == view.id)


def proof_frame(ready: Prepared) -> ProofFrame:
    """The frame programs are proved in: that of the first access, or the setup frame on a machine with rotary axes."""
    first = ProofFrame.of(ready.views[0])
    if not ready.inputs.turns:
        return first
    turn = np.eye(3)
    return first if np.array_equal(first.rotation, turn) else ProofFrame(first.id, turn, ready.part)


def program_frame(job: JobPart, access: str | None) -> ProofFrame:
    """The frame a program of any origin is read in.

    access : id of the access; None: as ``proof_frame``
    """
    named = next((a for a in job.accesses if a.id == access), job.accesses[0])
    rotation = np.eye(3) if access is None and job.inputs.turns else access_rotation(named.direction)
    return ProofFrame(named.id, rotation, turned(job.part, rotation))


def programs_of(ready: Prepared, access_plans: Sequence[AccessPlan],
                trimmed: Mapping[str, Sequence[Faces]] | None = None) -> list[WrittenProgram]:
    """The programs: one for each access that has steps, or one for all accesses on a machine with rotary axes.

    trimmed : exact faces by zone, in the frame of its access; the features of STEP-NC are made of them
    """
    cutting = [s for s in access_plans if s.plan.steps]
    if not cutting:
        return []
    if ready.inputs.turns:
        work = replace(clamped_workplan(ready, cutting), surfaces=_surfaces(ready, cutting, trimmed or {}))
        return _written(ready, ready.views[0].id, work)
    out = []
    for s in cutting:
        view = s.view
        work = replace(workplan(ready, s), surfaces=_surfaces(ready, [s], trimmed or {}))
        turn = None if view.is_first else view.rotation @ view.first.T
        out += _written(ready, view.id, work, "" if view.is_first else f".{view.id}", turn)
    return out


def _written(ready: Prepared, access: str, work: Workplan, end: str = "",
             turn: F64 | None = None) -> list[WrittenProgram]:
    """The program of a plan in every dialect of the machine, or several in order where one would be too large.

    The proof simulates the first dialect that states how far the control may leave the path; its error bound counts it.
    """
    machine = ready.inputs.machine
    switches = Switches(machine.high_speed, machine.haas_tcp, machine.heidenhain_plane, machine.siemens_cycle800)
    if machine.arcs:
        work = fitted(work, ready.inputs.budget.arcs)
    dialects = {d: DIALECTS[d](switches) for d in machine.dialects}
    first = next((d for d, control in dialects.items() if control.bounds_path), machine.dialects[0])
    index = [view.id for view in ready.views].index(access)
    work, out = replace(work, restart=machine.restart_points, number_words=f"access {access} part 999",
                        figures=AWAITED), []
    limit = machine.max_program_kb
    for k, part in enumerate([work] if limit is None else parts_of(work, list(dialects.values()), int(1000 * limit))):
        part = replace(part, number=program_number(index, k), number_words=f"access {access} part {k + 1}")
        texts = {d: write_program(part, control) for d, control in dialects.items()}
        part_end = f"{end}.part{k + 1}" if k else end
        out.append(WrittenProgram(access, part, texts.pop(first), part_end, turn, first, texts))
    return out


def with_figures(written: Sequence[WrittenProgram], report: Mapping[str, Any]) -> list[WrittenProgram]:
    """Proved programs with the figures of their proof in the headers. They are read once more before delivery.

    report : of the job
    """
    figures = figures_of(report)
    out = []
    for p in written:
        texts = {d: filled(text, DIALECTS[d](Switches()), figures) for d, _, text in p.files()}
        out.append(replace(p, work=replace(p.work, figures=figures), text=texts.pop(p.dialect), others=texts))
    return out


def figures_of(report: Mapping[str, Any]) -> tuple[str, ...]:
    """The lines about the proof of the job in the header of a program."""
    scallops = [z["scallop_mm"]["p99"] for z in report["zones"] if z["scallop_mm"]["p99"] is not None]
    scallop = f"scallop p99 at most {decimal(max(scallops))} mm" if scallops else "no scallop to measure"
    rest, time, proof = report["remainder"], report["time"], report["proof"]
    area = decimal(sum(x["area_mm2"] for x in rest), 3)
    return (f"Proof by zonemill {VERSION}, figures of the whole job: no findings",
            "Filled in after it; no other line was changed since",
            f"Coverage {100 * report['coverage']:.2f} %, of what is in reach {100 * report['reach_coverage']:.2f} %",
            f"Gouge at most {decimal(report['gouge_max_mm'])} mm, {scallop}",
            f"Error bound {decimal(proof['error_bound_mm'])} mm, {proof['samples']} samples",
            f"Machining time {report['machining_time_s'] / 60:.1f} min, in cut {time['in_cut_s'] / 60:.1f} min",
            f"Remainder {area} mm2 in {len(rest)} entries of report.json")


def program_number(access: int, part: int) -> int:
    """Number of a program, four digits at most, from 1000 on; ``access`` and ``part`` count from 0.

    >>> program_number(0, 0), program_number(2, 1), program_number(5, 99)
    (1000, 1201, 1599)
    """
    return FIRST_NUMBER + (PARTS * access + part) % LAST_NUMBER


def workplan(ready: Prepared, access_plan: AccessPlan) -> Workplan:
    """The workplan of one access, for the writers."""
    view = access_plan.view
    comments: tuple[str, ...] = ()
    if len(ready.views) > 1:
        d = " ".join(f"{v:.6g}" for v in view.direction)
        comments = (f"access {view.id}, tool axis {d} in the setup frame; stock of the whole blank",)
    return _workplan(ready, access_plan.plan.steps, ProofFrame.of(view), access_plan.clearance, access_of(ready, view),
                     comments)


def clamped_workplan(ready: Prepared, access_plans: Sequence[AccessPlan]) -> Workplan:
    """The workplan of all accesses one after the other, for the writers, on a machine with rotary axes.

    Raises
    ------
    InternalError
        The machine has no rotary axes.
    """
    inputs, first = ready.inputs, ready.views[0]
    frame = ProofFrame(first.id, np.eye(3), ready.part)
    machine = inputs.rotary
    if machine is None:
        raise InternalError("a machine without rotary axes has no clamping")
    spare = ready.blank.beyond
    boxes = [ready.blank.corners(frame.rotation) + [[-spare], [spare]], ready.part.bounds, *fixture_boxes(ready, frame)]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    radius = 0.5 * float(np.linalg.norm(high - low)) + inputs.clearances.rapid
    frames = {s.view.id: AccessFrame(s.view.rotation, s.clearance) for s in access_plans}
    rises = [float(s.view.rotation[2, 2]) for s in access_plans]
    rises += [float((t.axes @ s.view.rotation)[:, 2].min()) for s in access_plans for step in s.plan.steps
              for t in step.trajectories if t.axes is not None]
    leans = float(np.arccos(np.clip(min(rises), -1.0, 1.0)))
    centre = 0.5 * (low + high)
    level = table_height(inputs, ready.blank) + inputs.clearances.rapid
    lift = room_to_turn(centre[2], radius, leans, inputs.bodies, level)
    clamping = Clamping(machine, frames, centre + [0.0, 0.0, lift], radius + lift, inputs.gauge_lengths)
    if inputs.machine.rapid_motion == "dogleg":
        clamping = _wide_of_doglegs(clamping, np.array([low, high]), level, leans, inputs.bodies)
    words = ("fixed tool axes, one after the other, each from what those before leave",)
    steps = tuple(t for s in access_plans for t in s.plan.steps)
    work = _workplan(ready, steps, frame, float(home_of(clamping)[2]), access_of(ready, first), words)
    return replace(work, clamping=clamping)


def _wide_of_doglegs(clamping: Clamping, box: F64, level: float, leans: float, tools: Sequence[ToolBody]) -> Clamping:
    """A ball so much larger that tools clear it and the table where each axis of a turn moves at its own speed.

    box   : (2, 3) float64, mm, setup frame, round part, blank and fixtures
    level : mm, Z that no tool may come down to;  leans : rad, the largest tilt of a tool

    Notes
    -----
    A block turns each axis by w at most. It moves no place of the box by more than w (r1 + r2), nor the linear joints,
    which follow the centre of the ball, by more than w (c1 + c2): r and c are their distances from the axes. The lowest
    place of a tool is no farther from the tilting axis than c1, the radius of the ball, and its length
    (``verify.checks.dogleg_turns``). A lift changes c1 and the radius, so the room is computed until it stays.
    """
    centre, radius, pivots = clamping.centre, clamping.radius, clamping.machine.pivots
    if pivots is None:
        raise InternalError("a plan for doglegs has no pivots")
    tilting, turning = np.array(pivots)

    def distances(low: F64, high: F64) -> float:
        """Of places between two corners, mm: from the tilting axis and from the turning one, together."""
        spin = float(np.hypot(*np.maximum(np.abs(low - turning), np.abs(high - turning))[:2]))
        up = float(np.abs(np.array([low[2], high[2]]) - tilting[2]).max())
        return spin + math.hypot(math.hypot(*(tilting - turning)[:2]) + spin, up)

    long = max(t.stickout + sum(h.length for h in t.holder) + (0.0 if t.holder else NO_HOLDER) + _widest(t)
               for t in tools)
    grown, lift = radius, 0.0
    for _ in range(ROUNDS):
        there = centre + [0.0, 0.0, lift]
        joints = distances(there, there)
        drop, wide = DOGLEG_STEP * (2.0 * joints + grown + long), radius + DOGLEG_STEP * (joints + distances(*box))
        lift = room_to_turn(float(centre[2]), wide, leans, tools, level + drop)
        grown = wide + lift
    return replace(clamping, centre=centre + [0.0, 0.0, lift], radius=grown, step=DOGLEG_STEP)


def _widest(tool: ToolBody) -> float:
    """mm, largest radius of an assembly."""
    holder = (0.5 * max(h.diameter, h.diameter_top) for h in tool.holder)
    return max([tool.widest_radius, 0.5 * tool.shank_diameter, *holder])


def turning_of(ready: Prepared, view: View) -> RotaryAxes | None:
    """TrajectoryKind of the rotary axes in the frame of a view; None on a machine without, or where they only index."""
    inputs, turn = ready.inputs, view.rotation
    machine = inputs.rotary
    if machine is None or not inputs.machine.simultaneous:
        return None
    longest, tolerance = max(inputs.gauge_lengths.values()), inputs.budget.program

    rate, fastest = inputs.machine.rotary_rate_deg_min, inputs.rates.rapid

    def along(tips: F64, axes: F64) -> tuple[F64, F64, F64] | None:
        try:
            way, turns = machine.course(tips @ turn, axes @ turn, tolerance, MAX_AXIS_DEVIATION, longest)
        except OutputError:
            return None
        min_minutes = np.zeros(len(way) - 1)
        if rate is not None:
            min_minutes = np.degrees(np.abs(np.diff(turns, axis=0)).max(axis=1)) / rate
        if machine.pivots is not None:
            for gauge in {*inputs.gauge_lengths.values()}:
                gone = np.abs(np.diff(machine.joints(way, turns, gauge), axis=0)).max(axis=1)
                min_minutes = np.maximum(min_minutes, gone / fastest)
        return way @ turn.T, machine.axes(turns) @ turn.T, RATE_SPARE * min_minutes

    table = table_height(inputs, ready.blank) + inputs.clearances.rapid + TABLE_SPARE
    return RotaryAxes(lambda axes: machine.stands(axes @ turn), along, turn[:, 2], table)


def room_to_turn(height: float, radius: float, leans: float, tools: Sequence[ToolBody], table: float) -> float:
    """How far the ball that tools turn outside of moves up and grows, mm, so that tilted tools clear the table.

    height, radius : mm, of the centre of the ball and its size
    leans : rad, the largest tilt of a tool, well below a half turn (``service.from_wire.check_plannable``)
    table : mm, Z that no tool may come down to

    Notes
    -----
    The grown ball still holds the first one. The tip stands radius cos(tilt) above the centre. A rim of radius r at the
    height h above the tip stands h cos(tilt) - r sin(tilt) above it. While an axis swings, the proof subtracts 1/800 of
    the distance from the tip (``verify.checks.table_clearance``), and so does this function.
    """
    angles = np.linspace(0.0, leans, max(2, int(np.ceil(np.degrees(leans))) + 1))
    up, aside = np.cos(angles), np.sin(angles)
    deepest = np.zeros_like(angles)
    for tool in tools:
        rims = [(0.0, tool.radius), (tool.flute_length, tool.widest_radius), (tool.stickout, 0.5 * tool.shank_diameter)]
        z = tool.stickout
        for part in tool.holder:
            rims += [(z, 0.5 * part.diameter), (z + part.length, 0.5 * part.diameter_top)]
            z += part.length
        if not tool.holder:
            rims.append((z + NO_HOLDER, 0.5 * tool.shank_diameter))
        for h, r in rims:
            np.maximum(deepest, r * aside - h * up + BOW * np.hypot(h, r), out=deepest)
    short = table + deepest + SPARE - height - radius * up
    return float(np.max(np.maximum(short, 0.0) / (1.0 + up)))


def _workplan(ready: Prepared, steps: tuple[Workingstep, ...], frame: ProofFrame, clearance: float, access: Access,
              words: tuple[str, ...]) -> Workplan:
    """The workplan of steps in a frame; clearance : mm, height of the clearance plane."""
    inputs = ready.inputs
    used = {s.tool.id for s in steps}
    if ready.blank.solid is not None:
        words = (*words, f"stock sha256 {ready.blank.solid.sha256}")
    lo, hi = ready.blank.corners(frame.rotation)
    shapes = Ap238(inputs.machine.ap238) is Ap238.CC2
    gauges = inputs.gauge_lengths
    return Workplan(inputs.labels.get("order") or "zonemill job", steps,
                    tuple(t for t in inputs.bodies if t.id in used), clearance, access.work_offset,
                    StockBox(lo, hi), inputs.material_name, ready.part.sha256, inputs.sha256, VERSION,
                    dict(inputs.labels), (*words, *(f"warning: {w}" for w in ready.warnings)),
                    assumed=assumed_words(ready), stock_words=_stock_words(ready), cylinder=_cylinder(ready, frame),
                    stock_mesh=ready.blank.proof_mesh(frame.rotation) if shapes else None,
                    part_mesh=frame.part.mesh if shapes else None, ap238=Ap238(inputs.machine.ap238),
                    coolant=inputs.machine.coolant == "flood",
                    assemblies={b.number: Assembly(gauges[b.number], t.flutes, t.life_min)
                                for t, b in zip(inputs.tools, inputs.bodies, strict=True)})


def assumed_words(ready: Prepared) -> tuple[str, ...]:
    """Header lines on what the proof takes for granted, one for each entry of ``proof.assumed``."""
    return tuple(f"{str(a.what).replace('_', ' ')}: {a.value if isinstance(a.value, str) else decimal(a.value)}. "
                 f"Else {a.effect}. Remedy: {a.remedy}"
                 for a in (*setup_assumptions(ready.inputs), *wide_samples(ready.part.mesh)))


def _stock_words(ready: Prepared) -> str:
    """The kind of the blank for the header; '' where the box in the header is the whole blank."""
    blank = ready.blank
    if blank.bar is not None:
        return f"cylinder of diameter {2.0 * blank.bar.radius:g} mm and height {blank.bar.height:g} mm"
    if blank.solid is not None:
        return "solid of a STEP file"
    return "" if blank.box is not None else f"part grown by {blank.margin:g} mm"


def _cylinder(ready: Prepared, frame: ProofFrame) -> StockCylinder | None:
    """The blank as a cylinder in a frame; None where it is none."""
    bar = ready.blank.bar
    if bar is None:
        return None
    low, high = bar.ends(frame.rotation)
    return StockCylinder(low, (high - low) / bar.height, bar.radius, bar.height)


def _surfaces(ready: Prepared, access_plans: Sequence[AccessPlan],
              trimmed: Mapping[str, Sequence[Faces]]) -> dict[int, NurbsSurface]:
    """Exact faces by number: of one access in its frame, or of all in the setup frame on a machine with rotary axes."""
    out: dict[int, NurbsSurface] = {}
    for access_plan in access_plans:
        turn = np.eye(4)
        if ready.inputs.turns:
            turn[:3, :3] = access_plan.view.rotation.T
        for zone in ready.zones:
            for face in trimmed.get(zone.id, ()) if zone.access == access_plan.view.id else ():
                out.update({one.face: one.surface.moved(turn) for one in exact_faces(face)})
    return out
