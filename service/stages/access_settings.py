"""What planner and proof of an access take from the job: stock, tolerances, heights, limits.

Lengths are mm in the frame of the access, or of the proof.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.sampling import lattice_samples
from schemas.setup import Lean
from service.from_wire import change_in_frame, face_numbers, gauges_given
from service.setup_assumptions import planned_sense, setup_assumptions
from service.stages.access_plan import ProofFrame
from service.stages.job_inputs import RAMP_ANGLE, JobInputs
from service.stages.job_part import JobPart
from service.stages.preparation import Prepared, table_height
from service.stages.programs import access_of, fixture_boxes, other_solids, turning_of
from service.stages.wall_support import FREE_RATIO, in_turn
from toolpath.plan_settings import LeftAlone, Pattern, PlanSettings, ToolLean
from toolpath.scallop_budget import ARC_SHARE
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import CutDirection
from verify.assumptions import Assumed
from verify.checks.program_assumptions import FREE_PATH
from verify.gcode.dialects import CONTROLS, OWN_SPEED_RAPIDS
from verify.model import ProofSetup
from zones.reach.access_view import View
from zones.reach.tip_field import TipField

STOCK_STEP = 0.08  # mm, the planner's stock lattice; wider where that would take more than STOCK_CELLS
STOCK_CELLS = 4e6
ALONE_SPACING, MAX_ALONE = 0.3, 200_000  # mm between places of faces left alone, and how many there are at most
ABOVE = 1.0  # mm between the height rapids may go down to and the clearance plane


def planning_stock(ready: Prepared, view: View) -> StockMap:
    """The stock that the planner of an access starts from: the largest that the setup allows."""
    return ready.blank.planned(view, stock_step(ready.inputs, ready.blank.corners(view.rotation)))


def stock_step(inputs: JobInputs, corners: F64) -> float:
    """Distance between the nodes of the planner's stock, mm.

    corners : (2, 3) float64, mm, of the blank in the frame of the access
    """
    lo, hi = corners
    return max(min(STOCK_STEP, inputs.engagement_spacing), float(np.sqrt(np.prod(hi[:2] - lo[:2]) / STOCK_CELLS)))


@dataclass(frozen=True, eq=False)
class FirstAccess:
    """The stock of the first access, and the tip limits of the tool whose layers come first there.

    view    : View
    stock   : StockMap, as ``planning_stock`` gives it
    field   : TipField of the tool; None where no layers are asked for
    heights : (ny, nx) float64, mm, as ``TipField.cut_height``; None with ``field``
    """

    view: View
    stock: StockMap
    field: TipField | None
    heights: F64 | None

    @classmethod
    def of(cls, ready: Prepared) -> FirstAccess:
        """Computed here; no other thread sees a change of the job."""
        view = ready.views[0]
        stock = planning_stock(ready, view)
        tools = [z.tool.id for z in ready.zones if z.access == view.id] if ready.inputs.operations.roughing else []
        field = view.fields[tools[0]] if tools else None
        return cls(view, stock, field, None if field is None else field.cut_heights())

    def settle(self) -> None:
        """Give the field its heights, once no other thread uses it."""
        if self.field is not None and self.heights is not None:
            self.field.know(self.heights)


def plan_settings(ready: Prepared, view: View, stock: StockMap) -> PlanSettings:
    """Tolerances and heights of a plan, in the frame of the access."""
    inputs = ready.inputs
    q, ops = inputs.quality, inputs.operations
    tops = [stock.highest, float(view.part.bounds[1, 2]) + q.stock_allowance_mm]
    tops.extend(float(f[1, 2]) for f in fixture_boxes(ready, view))
    floor = float(np.ceil(10.0 * (max(tops) + inputs.clearances.rapid + 0.1)) / 10.0)
    chord = q.chordal_tolerance_mm * (1.0 - (ARC_SHARE if inputs.machine.arcs else 0.0))
    ramp = min([RAMP_ANGLE, *inputs.ramp_angles(foreign=False).values()])
    return PlanSettings(q.scallop_height_mm, chord, q.stock_allowance_mm, ready.lift, floor + ABOVE,
                        floor, ramp, ops.roughing, ops.finishing, CutDirection(ops.cut_direction),
                        Pattern(ops.pattern), turning_of(ready, view), rates=inputs.rates,
                        semi_finishing=ops.semi_finishing, leaned=leaned(ops.lean),
                        left_alone=_places_left_alone(ready, view) if ops.roughing else None,
                        underside=float(ready.blank.corners(view.rotation)[0, 2]))


def _places_left_alone(ready: Prepared, view: View) -> LeftAlone | None:
    """Places of the faces that the setup does not let machine, in the frame of the access."""
    mesh = view.part.mesh
    chosen = np.isin(mesh.face_ids, list(left_alone(ready)))
    if not chosen.any():
        return None
    spacing = max(ALONE_SPACING, float(np.sqrt(mesh.areas[chosen].sum() / MAX_ALONE)))
    places = lattice_samples(TriangleMesh(mesh.vertices, mesh.faces[chosen], mesh.face_ids[chosen]), spacing)
    return LeftAlone(places.points, places.normals, spacing)


def leaned(lean: Lean) -> ToolLean | None:
    """Lead and tilt of the setup as the planner takes them, rad; None where it asks for none."""
    if not lean.asked:
        return None
    walls = lean.walls_tilt_deg
    return ToolLean(math.radians(lean.lead_deg), math.radians(lean.tilt_deg),
                  None if walls is None else math.radians(walls))


def proof_setup(job: JobPart, view: View | ProofFrame, *, foreign: bool = False) -> ProofSetup:
    """The conditions of a proof in the frame of a view.

    foreign : the programs were not planned here; then a table of unknown height is no obstacle
    """
    inputs = job.inputs
    c, q, machine = inputs.clearances, inputs.quality, inputs.machine
    # the height of the table is known in the setup frame only, so a proof in an oblique frame leaves the table out
    level = bool(np.array_equal(view.rotation, np.eye(3)))
    tabled = ((inputs.turns or machine.table_z_mm is not None) and level
              and not (foreign and machine.table_z_mm is None))
    cylinder, upwards = job.blank.proof_cylinder(view.rotation)
    return ProofSetup(
        stock_kind=inputs.stock.kind, margin=inputs.stock.margin_mm, uncertainty=job.blank.beyond,
        stock_box=job.blank.proof_box(view.rotation), stock_cylinder=cylinder, stock_axis=upwards,
        stock_mesh=job.blank.proof_mesh(view.rotation),
        fixtures=fixture_boxes(job, view), others=other_solids(job, view), clearance_neck=c.neck,
        clearance_shank=c.shank, clearance_holder=c.holder, clearance_rapid=c.rapid,
        clearance_approach=c.approach,
        scallop_height=q.scallop_height_mm, gouge_tolerance=q.gouge_tolerance_mm,
        stock_allowance=q.stock_allowance_mm, ramp_angle=RAMP_ANGLE, ramp_angles=inputs.ramp_angles(foreign=foreign),
        cores=inputs.cores, tap_holes=inputs.tap_holes, cutting=inputs.cutting,
        rapid_feed=inputs.rates.rapid, acceleration=inputs.rates.acceleration, jerk=inputs.rates.jerk,
        work_offset=access_of(job, view).work_offset,
        travel=None if machine.travel_mm is None else np.array(machine.travel_mm, dtype=np.float64),
        gauge_length=inputs.gauge_lengths,
        gauge_given=gauges_given(inputs.tools),
        line_spacing=min(ProofSetup.line_spacing, inputs.engagement_spacing),
        change_position=change_in_frame(machine.change_position, level=level),
        nose_diameter=machine.nose_diameter_mm, dogleg=_own_speeds(inputs, foreign),
        max_feed=machine.max_feed_mm_min, max_engaged=inputs.max_engaged, max_rpm=inputs.max_rpm,
        table=table_height(inputs, job.blank) if tabled else None,
        table_known=level and machine.table_z_mm is not None, free_ratio=FREE_RATIO,
        walls_in_turn=in_turn(job, foreign=foreign),
        kinematics=inputs.kinematics, rotary_limits=inputs.rotary_limits,
        rotary_rate=None if machine.rotary_rate_deg_min is None else float(np.radians(machine.rotary_rate_deg_min)),
        left_alone=left_alone(job),
        assumed=(*setup_assumptions(inputs), *(() if foreign else (*planned_sense(inputs), *_free_paths(inputs)))))


def _own_speeds(inputs: JobInputs, foreign: bool) -> bool | None:
    """Whether each axis of a rapid moves at its own speed; None: as the dialect of the program has it.

    A plan on three axes is for all its controls, so one of them that moves so decides. On five axes it needs straight
    rapids, and its header says so.
    """
    machine = inputs.machine
    if machine.rapid_motion is not None:
        return machine.rapid_motion == "dogleg"
    own = not foreign and not inputs.turns and not OWN_SPEED_RAPIDS.isdisjoint(machine.dialects)
    return True if own else None


def _free_paths(inputs: JobInputs) -> tuple[Assumed, ...]:
    """What a plan assumes of controls that have no word for the deviation from the path, the first or another."""
    others = [CONTROLS[d] for d in inputs.machine.dialects if d in CONTROLS]
    return () if all(c.bounds_path for c in others) else (FREE_PATH,)


def left_alone(job: JobPart) -> dict[int, str]:
    """Faces that the setup does not let machine, by number, with the words that say so."""
    ops, numbers = job.inputs.operations, {f.number for f in job.part.faces}
    wanted = numbers if ops.faces is None else set(face_numbers(ops.faces))
    unasked = dict.fromkeys(sorted(numbers - wanted), "operations.faces does not name it")
    return unasked | dict.fromkeys(face_numbers(ops.exclude_faces), "operations.exclude_faces names it")


__all__ = ["leaned", "left_alone", "plan_settings", "planning_stock", "proof_setup", "stock_step"]
