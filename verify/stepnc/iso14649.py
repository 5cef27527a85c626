"""Reader of STEP-NC as ISO 14649 (MACHINING_SCHEMA, MILLING_SCHEMA): records the tool motion of its main workplan.

Lengths are mm, feeds m/s, spindle speeds 1/s, positive counter-clockwise: the defaults of [ISO14649-10]. Paths are in
the frame of their feature, features in that of the workpiece, and the setup places the workpiece. The reader refuses,
by instance, what could move the tool and is not read: strategies without a path, contact trajectories, splines and
branches.
"""

from __future__ import annotations

import math
import re

import numpy as np

from geometry.errors import ProgramError
from geometry.mesh import F64
from verify.program.program import Remark
from verify.stepnc.attribute_checks import (
    FARTHEST,
    FLAG,
    LOGICAL,
    Checked,
    Many,
    Maybe,
    Named,
    OneOf,
    Real,
    Table,
    Text,
    To,
    Whole,
    attributes,
)
from verify.stepnc.curves import CURVE_TABLE, CURVES, curve_points
from verify.stepnc.cutter_shape import MAX_TAPER, SAME_SHAPE, CutterShape, contradiction, shape_of
from verify.stepnc.part21 import Part21File, Ref, Typed, Value
from verify.stepnc.tool_motion import MAX_DWELL, MAX_FEED, MAX_SPEED, MIN_FEED, CutterRecord, MotionRecorder

SCHEMAS = frozenset({"MACHINING_SCHEMA", "MILLING_SCHEMA", "COMBINED_SCHEMA"})
MM_MIN = 60_000.0  # of one m/s
RPM = 60.0  # of one 1/s
_EXECUTABLES = ("WORKPLAN", "MACHINING_WORKINGSTEP", "RAPID_MOVEMENT", "RETURN_HOME", "DISPLAY_MESSAGE",
                "PROGRAM_STOP", "OPTIONAL_STOP", "SET_MARK")
_CUTTERS = ("BALL_ENDMILL", "BULLNOSE_ENDMILL", "ENDMILL", "TAPERED_ENDMILL")
_AXES = ("THREE_AXES", "THREE_AXES_TILTED_TOOL", "FIVE_AXES_VAR_TILT_YAW")
_TYPES = OneOf(("APPROACH", "LIFT", "CONNECT", "NON_CONTACT", "CONTACT", "TRAJECTORY_PATH"))
_SPEED = Named((("SPEED_NAME", OneOf(("RAPID",))),))
_PATH = {"its_priority": FLAG, "its_type": _TYPES, "its_speed": Maybe(_SPEED),
         "its_technology": Maybe(To(("MILLING_TECHNOLOGY",))),
         "its_machine_functions": Maybe(To(("MILLING_MACHINE_FUNCTIONS",)))}
_FEATURE = {"its_id": Text(), "its_workpiece": To(("WORKPIECE",)),
            "its_operations": Many(To(("FREEFORM_OPERATION",))),
            "feature_placement": Maybe(To(("AXIS2_PLACEMENT_3D",)))}
_STRATEGY = {"pathmode": OneOf(("FORWARD", "ZIGZAG")), "cutmode": OneOf(("CLIMB", "CONVENTIONAL")),
             "its_milling_tolerances": To(("TOLERANCES",)), "stepover": Maybe(Real(0.0))}
_BLADE = {"dimension": To(("MILLING_TOOL_DIMENSION",)), "number_of_teeth": Maybe(Whole()),
          "hand_of_cut": Maybe(OneOf(("LEFT", "RIGHT", "NEUTRAL"))), "coolant_through_tool": Maybe(FLAG),
          "pilot_length": Maybe(Real())}
_NET = {"name": Text(), "u_degree": Whole(), "v_degree": Whole(),
        "control_points_list": Many(Many(To(("CARTESIAN_POINT",)), 2), 2),
        "surface_form": OneOf(("PLANE_SURF", "CYLINDRICAL_SURF", "CONICAL_SURF", "SPHERICAL_SURF", "TOROIDAL_SURF",
                               "SURF_OF_REVOLUTION", "RULED_SURF", "GENERALISED_CONE", "QUADRIC_SURF",
                               "SURF_OF_LINEAR_EXTRUSION", "UNSPECIFIED")),
        "u_closed": LOGICAL, "v_closed": LOGICAL, "self_intersect": LOGICAL}
_KNOTS = {"u_multiplicities": Many(Whole(), 2), "v_multiplicities": Many(Whole(), 2), "u_knots": Many(Real(), 2),
          "v_knots": Many(Real(), 2),
          "knot_spec": OneOf(("UNIFORM_KNOTS", "QUASI_UNIFORM_KNOTS", "PIECEWISE_BEZIER_KNOTS", "UNSPECIFIED"))}

TABLE: Table = {
    "PROJECT": attributes(its_id=Text(), main_workplan=To(("WORKPLAN",)), its_workpieces=Many(To(("WORKPIECE",))),
                          its_owner=Maybe(To()), its_release=Maybe(To()), its_status=Maybe(To())),
    "WORKPLAN": attributes(its_id=Text(), its_elements=Many(To(_EXECUTABLES), 1), its_channel=Maybe(To(("CHANNEL",))),
                           its_setup=Maybe(To(("SETUP",))), its_effect=Maybe(To())),
    "CHANNEL": attributes(its_id=Text()),
    "MACHINING_WORKINGSTEP": attributes(its_id=Text(), its_secplane=To(("PLANE",)), its_feature=To(),
                                        its_operation=To(("FREEFORM_OPERATION",)), its_effect=Maybe(To())),
    "RAPID_MOVEMENT": attributes(its_id=Text(), its_secplane=To(("PLANE",)), its_toolpath=Maybe(To(("TOOLPATH_LIST",))),
                                 its_tool_direction=Maybe(To(_AXES))),
    "RETURN_HOME": attributes(its_id=Text(), its_secplane=To(("PLANE",)), its_toolpath=Maybe(To(("TOOLPATH_LIST",))),
                              its_tool_direction=Maybe(To(_AXES))),
    "DISPLAY_MESSAGE": attributes(its_id=Text(), its_text=Text()),
    "PROGRAM_STOP": attributes(its_id=Text()),
    "OPTIONAL_STOP": attributes(its_id=Text()),
    "SET_MARK": attributes(its_id=Text()),
    "SETUP": attributes(its_id=Text(), its_origin=Maybe(To(("AXIS2_PLACEMENT_3D",))), its_secplane=To(("PLANE",)),
                        its_workpiece_setup=Many(To(("WORKPIECE_SETUP",)))),
    "WORKPIECE_SETUP": attributes(its_workpiece=To(("WORKPIECE",)), its_origin=To(("AXIS2_PLACEMENT_3D",)),
                                  its_offset=Maybe(To()), its_restricted_area=Maybe(To()),
                                  its_instructions=Many(To(("SETUP_INSTRUCTION",)))),
    "SETUP_INSTRUCTION": attributes(description=Maybe(Text()), external_document=Maybe(Text())),
    "WORKPIECE": attributes(its_id=Text(), its_material=Maybe(To(("MATERIAL",))), global_tolerance=Maybe(Real()),
                            its_rawpiece=Maybe(To(("WORKPIECE",))), its_geometry=Maybe(To()),
                            its_bounding_geometry=Maybe(To()), clamping_positions=Many(To(("CARTESIAN_POINT",)))),
    "MATERIAL": attributes(standard_identifier=Text(), material_identifier=Text(), material_property=Many(To())),
    "BLOCK": attributes(name=Text(), position=To(("AXIS2_PLACEMENT_3D",)), x=Real(0.0), y=Real(0.0), z=Real(0.0)),
    "RIGHT_CIRCULAR_CYLINDER": attributes(name=Text(), position=To(("AXIS1_PLACEMENT",)), height=Real(0.0),
                                          radius=Real(0.0)),
    "REGION_PROJECTION": attributes(**_FEATURE, proj_curve=To(), proj_dir=To(("DIRECTION",)),
                                    depth=To(("TOLERANCED_LENGTH_MEASURE",))),
    "REGION_SURFACE_LIST": attributes(**_FEATURE, surface_list=Many(To(), 1)),
    "TOPOLOGICAL_REGION": attributes(**_FEATURE, name=Text(), cfs_faces=Many(To(), 1)),
    "TOOLPATH_FEATURE": attributes(**_FEATURE, depth=To(("PLANE",))),
    "TOLERANCED_LENGTH_MEASURE": attributes(theoretical_size=Real(), implicit_tolerance=To()),
    "PLUS_MINUS_VALUE": attributes(upper_limit=Real(), lower_limit=Real(), significant_digits=Whole()),
    "BEZIER_SURFACE": attributes(**_NET),
    "FREEFORM_OPERATION": attributes(
        its_toolpath=Maybe(To(("TOOLPATH_LIST",))), its_tool_direction=Maybe(To(_AXES)), its_id=Text(),
        retract_plane=Maybe(Real()), start_point=Maybe(To(("CARTESIAN_POINT",))),
        its_tool=To(("MILLING_CUTTING_TOOL",)), its_technology=To(("MILLING_TECHNOLOGY",)),
        its_machine_functions=To(("MILLING_MACHINE_FUNCTIONS",)), overcut_length=Maybe(Real()), approach=Maybe(To()),
        retract=Maybe(To()), its_machining_strategy=Maybe(To())),
    "TOOLPATH_LIST": attributes(its_list=Many(To(("CUTTER_LOCATION_TRAJECTORY", "FEEDSTOP")), 1)),
    "CUTTER_LOCATION_TRAJECTORY": attributes(**_PATH, its_direction=Maybe(FLAG), basiccurve=To(CURVES),
                                             its_toolaxis=Maybe(To(("POLYLINE",))),
                                             surface_normal=Maybe(To(("POLYLINE",)))),
    "FEEDSTOP": attributes(**_PATH, dwell=Real(-1e-9, MAX_DWELL)),
    "MILLING_TECHNOLOGY": attributes(
        feedrate=Maybe(Real(0.0)), feedrate_reference=OneOf(("TCP", "CCP")), cutspeed=Maybe(Real(0.0)),
        spindle=Maybe(Real()), feedrate_per_tooth=Maybe(Real(0.0)), synchronize_spindle_with_feed=FLAG,
        inhibit_feedrate_override=FLAG, inhibit_spindle_override=FLAG, its_adaptive_control=Maybe(To())),
    "MILLING_MACHINE_FUNCTIONS": attributes(
        coolant=FLAG, coolant_pressure=Maybe(Real()), mist=Maybe(FLAG), through_spindle_coolant=FLAG,
        through_pressure=Maybe(Real()), axis_clamping=Many(Text()), chip_removal=FLAG,
        oriented_spindle_stop=Maybe(To(("DIRECTION",))), its_process_model=Maybe(To()), other_functions=Many(To())),
    "MILLING_CUTTING_TOOL": attributes(
        its_id=Text(), its_tool_body=To(_CUTTERS), its_cutting_edge=Many(To(("CUTTING_COMPONENT",)), 1),
        overall_assembly_length=Maybe(Real(0.0, FARTHEST)), direction_for_spindle_orientation=Maybe(To(("DIRECTION",))),
        tool_holder_diameter_for_spindle_orientation=Maybe(Real())),
    **{name: attributes(**_BLADE) for name in _CUTTERS if name != "TAPERED_ENDMILL"},
    "TAPERED_ENDMILL": attributes(**_BLADE, taper_angle=Maybe(Real())),
    "MILLING_TOOL_DIMENSION": attributes(
        diameter=Real(0.0, FARTHEST), tool_tip_half_angle=Maybe(Real()), tool_circumference_angle=Maybe(Real()),
        cutting_edge_length=Maybe(Real(0.0, FARTHEST)), edge_radius=Maybe(Real(-1e-9, FARTHEST)),
        edge_center_vertical=Maybe(Real()), edge_center_horizontal=Maybe(Real())),
    "CUTTING_COMPONENT": attributes(
        tool_offset_length=Real(), its_material=Maybe(To(("MATERIAL",))), technological_data=Maybe(To()),
        expected_tool_life=Maybe(Real(0.0)), its_technology=Maybe(To(("MILLING_TECHNOLOGY",)))),
    "TOLERANCES": attributes(chordal_tolerance=Real(), scallop_height=Real()),
    "UV_STRATEGY": attributes(**_STRATEGY, forward_direction=To(("DIRECTION",)),
                              sideward_direction=To(("DIRECTION",))),
    "PLANE_CL_STRATEGY": attributes(**_STRATEGY, its_plane_normal=To(("DIRECTION",))),
    "PLANE_CC_STRATEGY": attributes(**_STRATEGY, its_plane_normal=To(("DIRECTION",))),
    "LEADING_LINE_STRATEGY": attributes(**_STRATEGY, its_line=To()),
    "THREE_AXES": (),
    "THREE_AXES_TILTED_TOOL": attributes(its_tool_direction=To(("DIRECTION",))),
    "FIVE_AXES_VAR_TILT_YAW": (),
    "PLANE": attributes(name=Text(), position=To(("AXIS2_PLACEMENT_3D",))),
    "AXIS2_PLACEMENT_3D": attributes(name=Text(), location=To(("CARTESIAN_POINT",)), axis=Maybe(To(("DIRECTION",))),
                                     ref_direction=Maybe(To(("DIRECTION",)))),
    "AXIS1_PLACEMENT": attributes(name=Text(), location=To(("CARTESIAN_POINT",)), axis=Maybe(To(("DIRECTION",)))),
    "DIRECTION": attributes(name=Text(), direction_ratios=Many(Real(), 2, 3)),
    "CARTESIAN_POINT": attributes(name=Text(), coordinates=Many(Real(), 3, 3)),
    "POLYLINE": attributes(name=Text(), points=Many(To(("CARTESIAN_POINT",)), 2)),
    "B_SPLINE_SURFACE_WITH_KNOTS": attributes(**_NET, **_KNOTS),
    **CURVE_TABLE,
}
UPRIGHT = 1.0 - 1e-9  # cosine of the tilt of a setup
RECORDS: Table = {
    "B_SPLINE_SURFACE": attributes(**{k: v for k, v in _NET.items() if k != "name"}),
    "B_SPLINE_SURFACE_WITH_KNOTS": attributes(**_KNOTS),
    "RATIONAL_B_SPLINE_SURFACE": attributes(weights_data=Many(Many(Real(0.0), 2), 2)),
    "REPRESENTATION_ITEM": attributes(name=Text()),
}


def read_iso14649(file: Part21File, recorder: MotionRecorder) -> None:
    """Record the tool motion of the main workplan of a file [ISO14649-10; ISO14649-11].

    Raises
    ------
    ProgramError
        An instance, which the subjects name, does not have the required form, or moves the tool in a way that the
        reader does not know.
    """
    Iso14649Reader(file, recorder).run()


class Iso14649Reader:
    """One reading of an ISO 14649 file: placements of workpieces, and the walk through the workplan."""

    def __init__(self, file: Part21File, recorder: MotionRecorder) -> None:
        self.file, self.recorder = file, recorder
        self.data = Checked(file, TABLE, RECORDS)
        self.place = np.eye(4)
        self.origin: tuple[bool, F64] | None = None
        self.elements: list[tuple[int, F64]] = []
        self.seen: set[int] = set()

    def run(self) -> None:
        """Record the motion of the main workplan.

        Raises
        ------
        ProgramError
            The file does not have exactly one project, or an instance is wrong.
        """
        projects = self.data.of("PROJECT")
        if len(projects) != 1:
            raise ProgramError(f"{self.file.name}: one PROJECT expected, not {len(projects)}",
                               subjects=tuple(f"#{n}" for n in projects), measured=len(projects), limit=1,
                               remedy="send one project per file")
        self._flatten(self.data.ref(projects[0], "PROJECT", "main_workplan"), np.eye(4))
        for k, (number, place) in enumerate(self.elements):
            self.place = place
            self._execute(k, number)

    def _standing(self, setup: int) -> F64:
        """(4, 4): transformation from a setup to the first one of the file, whose origin is program zero.

        The part stays where it is clamped, so a setup whose origin is another place of the machine shifts the paths.
        """
        target = self.data.maybe(setup, "SETUP", "its_origin")
        own = target is not None, np.eye(4) if target is None else self.data.placement(target)
        if self.origin is None:
            self.origin = own
        if own[0] != self.origin[0]:
            raise self.file.error(setup, ", its_origin: every setup of a file states its origin, or none does")
        same = np.array_equal(self.origin[1], own[1])
        return np.eye(4) if same else np.asarray(np.linalg.solve(self.origin[1], own[1]))

    def _flatten(self, number: int, place: F64) -> None:
        """List the elements of a workplan and of the workplans in it, with the frame of their workpiece."""
        if number in self.seen:
            raise self.file.error(number, "appears in two places of the workplans, or inside itself")
        self.seen.add(number)
        if self.data.get(number, *_EXECUTABLES)[0] != "WORKPLAN":
            self.elements.append((number, place))
            return
        setup = self.data.maybe(number, "WORKPLAN", "its_setup")
        if setup is not None:
            plane = self.data.ref(setup, "SETUP", "its_secplane")
            standing = self._standing(setup)
            there = standing @ self.data.placement(self.data.ref(plane, "PLANE", "position"))
            place = standing @ self._setup(setup)
            self.recorder.plane("security plane", there[:3, 3], there[:3, 2], self.file.line(setup))
        for element in self.data.refs(number, "WORKPLAN", "its_elements"):
            self._flatten(element, place)

    def _setup(self, number: int) -> F64:
        """(4, 4): transformation from the workpiece to the setup frame."""
        holdings = self.data.refs(number, "SETUP", "its_workpiece_setup")
        if not holdings:
            return np.eye(4)
        if len(holdings) > 1:
            raise self.file.error(number, ", its_workpiece_setup: one workpiece expected")
        if self.data.one(holdings[0], "WORKPIECE_SETUP", "its_offset") is not None:
            raise self.file.error(holdings[0], ", its_offset: an offset is not read, $ expected")
        return self.data.placement(self.data.ref(holdings[0], "WORKPIECE_SETUP", "its_origin"))

    def _execute(self, place: int, number: int) -> None:
        entity, line = self.data.get(number, *_EXECUTABLES)[0], self.file.line(number)
        if entity in ("PROGRAM_STOP", "OPTIONAL_STOP"):
            self.recorder.stop("program stop", line)
        elif entity == "RETURN_HOME":
            self._along(number, entity, line)
            self.recorder.stop("return to home", line)
        elif entity == "RAPID_MOVEMENT":
            self._rapid(place, number, line)
        elif entity == "MACHINING_WORKINGSTEP":
            feature, operation = (self.data.ref(number, entity, a) for a in ("its_feature", "its_operation"))
            self.recorder.plane("security plane", *self._plane(self.data.ref(number, entity, "its_secplane")), line)
            self._operation(operation, self._feature(feature, operation))

    def _rapid(self, place: int, number: int, line: int) -> None:
        """Rapid movement; without a path it takes the next tool over the security plane to the next workingstep."""
        entity = "RAPID_MOVEMENT"
        point, normal = self._plane(self.data.ref(number, entity, "its_secplane"))
        if self._along(number, entity, line):
            return
        self.recorder.over(point, normal, line)
        for later, _ in self.elements[place + 1:]:
            if self.data.get(later, *_EXECUTABLES)[0] == "MACHINING_WORKINGSTEP":
                operation = self.data.ref(later, "MACHINING_WORKINGSTEP", "its_operation")
                self._take(self.data.ref(operation, "FREEFORM_OPERATION", "its_tool"), line)
                return

    def _along(self, number: int, entity: str, line: int) -> bool:
        """The security plane of a rapid movement or a return to home, and its path at rapid; whether it has one."""
        self.recorder.plane("security plane", *self._plane(self.data.ref(number, entity, "its_secplane")), line)
        paths = self.data.maybe(number, entity, "its_toolpath")
        if paths is not None:
            self._paths(paths, np.eye(4), self._direction(number, entity), number, None, rapid=True)
        return paths is not None

    def _take(self, tool: int, line: int) -> None:
        self.recorder.take(self._cutter(tool), line)

    def _feature(self, number: int, operation: int) -> F64:
        """(4, 4): transformation from the feature, which must list the operation on it, to the workpiece."""
        for _, values in self.file.records(number)[:1]:
            listed = values[2] if len(values) > 2 else None
            if not isinstance(listed, list) or Ref(operation) not in listed:
                raise self.file.error(number, f", its_operations: a list with #{operation} expected")
            placement: Value = values[3] if len(values) > 3 else None
            if isinstance(placement, Ref):
                return self.data.placement(int(placement))
            if placement is not None:
                raise self.file.error(number, ", feature_placement: AXIS2_PLACEMENT_3D or $ expected")
        return np.eye(4)

    def _operation(self, number: int, place: F64) -> None:
        entity = "FREEFORM_OPERATION"
        paths = self.data.maybe(number, entity, "its_toolpath")
        if paths is None:
            raise self.file.error(number, ", its_toolpath: TOOLPATH_LIST expected; strategies without one are not read")
        for attribute in ("approach", "retract"):
            if self.data.one(number, entity, attribute) is not None:
                raise self.file.error(number, f", {attribute}: $ expected; the tool path contains it")
        if self.data.maybe(number, entity, "start_point") is not None:
            raise self.file.error(number, ", start_point: $ expected; a control may go there before the tool path")
        self._take(self.data.ref(number, entity, "its_tool"), self.file.line(number))
        technology = self.data.ref(number, entity, "its_technology")
        functions = self.data.ref(number, entity, "its_machine_functions")
        self._check_functions(functions)
        self.recorder.coolant = self.data.one(functions, "MILLING_MACHINE_FUNCTIONS", "coolant") == "T"
        self._paths(paths, place, self._direction(number, entity), number, technology,
                    rapid=False)
        height = self.data.real(number, entity, "retract_plane")
        if height is not None:
            turn = self.place @ place
            self.recorder.retract_to(turn[:3, 3] + height * turn[:3, 2], turn[:3, 2], self.file.line(number))

    def _check_functions(self, number: int) -> None:
        """Refuse functions that hold an axis, stop the spindle or are not known."""
        entity = "MILLING_MACHINE_FUNCTIONS"
        for attribute, what in (("axis_clamping", "clamped axes do not move"), ("other_functions", "it is not read")):
            if self.data.one(number, entity, attribute) != []:
                raise self.file.error(number, f", {attribute}: an empty list expected; {what}")
        if self.data.one(number, entity, "oriented_spindle_stop") is not None:
            raise self.file.error(number, ", oriented_spindle_stop: $ expected; the spindle would stand")

    def _direction(self, number: int, entity: str) -> F64 | None:
        """(3,): the tool axis of paths without axes; None where paths must have axes."""
        target = self.data.maybe(number, entity, "its_tool_direction")
        if target is None:
            return None
        kind = self.data.get(target, *_AXES)[0]
        if kind == "THREE_AXES":
            if self.origin is not None and self.origin[1][2, 2] < UPRIGHT:
                raise self.file.error(number, ", its_tool_direction: THREE_AXES is Z of the machine, and its_origin of "
                                              "the setup is tilted: the tool would lean")
            return np.array([0.0, 0.0, 1.0])
        if kind == "THREE_AXES_TILTED_TOOL":
            return self.data.vector(self.data.ref(target, kind, "its_tool_direction"))
        return None

    def _paths(self, number: int, place: F64, direction: F64 | None, owner: int, technology: int | None, *,
               rapid: bool) -> None:
        """Follow a list of paths; ``direction`` is the tool axis that their owner gives to paths without axes."""
        for path in self.data.refs(number, "TOOLPATH_LIST", "its_list"):
            if self.data.get(path, "CUTTER_LOCATION_TRAJECTORY", "FEEDSTOP")[0] == "FEEDSTOP":
                self.recorder.dwell += self.data.real(path, "FEEDSTOP", "dwell") or 0.0
            else:
                self._trajectory(path, place, direction, owner, technology, rapid)

    def _trajectory(self, number: int, place: F64, direction: F64 | None, owner: int, technology: int | None,
                    rapid: bool) -> None:
        entity = "CUTTER_LOCATION_TRAJECTORY"
        if self.data.one(number, entity, "its_priority") != "T":
            raise self.file.error(number, ", its_priority: .T. expected; a control may leave a path that is only "
                                          "suggested")
        tips, lines = curve_points(self.data, self.data.ref(number, entity, "basiccurve"))
        leaning = self.data.maybe(number, entity, "its_toolaxis")
        if leaning is not None:
            axes, _ = self.data.curve(leaning)
            axes = self.data.unit_axes(number, "its_toolaxis", axes, len(tips))
        elif direction is None:
            raise self.file.error(number, f", its_toolaxis: POLYLINE expected, or THREE_AXES as its_tool_direction of "
                                          f"#{owner}: the tool axis is not given", owner)
        else:
            axes = np.tile(direction, (len(tips), 1))
        if self.data.one(number, entity, "its_direction") == "F":
            tips, axes, lines = tips[::-1], axes[::-1], lines[::-1]
        fast = rapid or isinstance(self.data.one(number, entity, "its_speed"), Typed)
        if (functions := self.data.maybe(number, entity, "its_machine_functions")) is not None:
            self._check_functions(functions)
        own = self.data.maybe(number, entity, "its_technology")
        feed, speed = self._rates(number, own if own is not None else technology, fast)
        turn = self.place @ place
        self.recorder.follow(tips @ turn[:3, :3].T + turn[:3, 3], axes @ turn[:3, :3].T, rapid=fast, feed=feed,
                           speed=speed, lines=lines)

    def _rates(self, path: int, technology: int | None, rapid: bool) -> tuple[float, float]:
        """mm/min and 1/min clockwise."""
        if technology is None:
            if rapid:
                return math.nan, 0.0
            raise self.file.error(path, ", its_technology: MILLING_TECHNOLOGY expected")
        entity = "MILLING_TECHNOLOGY"
        feed, spindle = (self.data.real(technology, entity, a) for a in ("feedrate", "spindle"))
        if feed is None and not rapid:
            raise self.file.error(technology, ", feedrate: a real number, m/s, expected; feeds per tooth are not read")
        if spindle is None:
            raise self.file.error(technology, ", spindle: a real number, 1/s, expected; cutting speeds are not read")
        for own, other in (("feedrate", "feedrate_per_tooth"), ("spindle", "cutspeed")):
            if None not in (self.data.real(technology, entity, own), self.data.real(technology, entity, other)):
                raise self.file.error(technology, f", {other}: $ expected beside {own}; one of both may stand")
        for attribute, right in (("synchronize_spindle_with_feed", "F"), ("its_adaptive_control", None)):
            if self.data.one(technology, entity, attribute) != right:
                raise self.file.error(technology, f", {attribute}: {'$' if right is None else '.F.'} expected; the "
                                                  "feed would be another")
        if not rapid and self.data.one(technology, entity, "feedrate_reference") != "TCP":
            raise self.file.error(technology, ", feedrate_reference: .TCP. expected, the feed of the tip")
        return sane_rates(self.data, technology, math.nan if feed is None else feed * MM_MIN, -RPM * spindle)

    def _cutter(self, number: int) -> CutterRecord:
        name = str(self.data.one(number, "MILLING_CUTTING_TOOL", "its_id"))
        body = self.data.ref(number, "MILLING_CUTTING_TOOL", "its_tool_body")
        kind = self.data.get(body, *_CUTTERS)[0]
        if self.data.one(body, kind, "hand_of_cut") == "LEFT":
            raise self.file.error(body, ", hand_of_cut: .RIGHT. expected; left-hand cutters are not read")
        size = self.data.ref(body, kind, "dimension")
        wide, edge, long = (self.data.real(size, "MILLING_TOOL_DIMENSION", a)
                            for a in ("diameter", "edge_radius", "cutting_edge_length"))
        if wide is None:
            raise self.file.error(size, ", diameter: a real number expected")
        taper = self._taper(body, kind, size)
        for angle in ("tool_tip_half_angle", *(() if taper > 0.0 else ("tool_circumference_angle",))):
            if self.data.one(size, "MILLING_TOOL_DIMENSION", angle) not in (None, 0.0):
                raise self.file.error(size, f", {angle}: $ or 0. expected; only the side of a TAPERED_ENDMILL may lean")
        if taper > 0.0:
            wide = self._tapered_end(number, size, CutterShape(wide, edge or 0.0, self.data.real(
                size, "MILLING_TOOL_DIMENSION", "edge_center_horizontal"), taper))
        corner = 0.5 * wide if kind == "BALL_ENDMILL" else edge or 0.0
        if edge is not None and abs(edge - corner) > 1e-6 or corner > 0.5 * wide + 1e-9:
            raise self.file.error(size, f", edge_radius: {0.5 * wide:g} (half of the diameter) expected, or less on a "
                                        f"bull nose, not {edge}")
        edges = {float(self.data.real(n, "CUTTING_COMPONENT", "tool_offset_length") or 0.0)
                 for n in self.data.refs(number, "MILLING_CUTTING_TOOL", "its_cutting_edge")}
        return CutterRecord(tool_number(name), name, shape_of(wide, corner, taper), wide, corner, long,
                            self.data.real(number, "MILLING_CUTTING_TOOL", "overall_assembly_length"), number,
                            tuple(sorted(edges)), taper, name)

    def _taper(self, body: int, kind: str, size: int) -> float:
        """Angle between the side of a tapered end mill and its axis, deg; 0 of all others."""
        if kind != "TAPERED_ENDMILL":
            return 0.0
        own = self.data.real(body, kind, "taper_angle")
        side = self.data.real(size, "MILLING_TOOL_DIMENSION", "tool_circumference_angle")
        if own is not None and side is not None and abs(own - side) > 1e-6:
            raise self.file.error(body, f", taper_angle: {side:g} expected, the tool_circumference_angle of #{size}, "
                                        f"not {own:g}", size)
        found = own if own is not None else side or 0.0
        return self.data.within(body, "taper_angle, deg", found, 0.0, MAX_TAPER)

    def _tapered_end(self, number: int, size: int, shape: CutterShape) -> float:
        """Diameter of the end of a tapered mill, mm; a side that does not touch the corner is a remark."""
        if shape.difference > SAME_SHAPE:
            self.recorder.remarks.append(Remark(self.file.line(size), contradiction(number, shape)))
        return shape.diameter

    def _plane(self, number: int) -> tuple[F64, F64]:
        """Point and unit normal of a security plane in the setup frame, mm."""
        place = self.place @ self.data.placement(self.data.ref(number, "PLANE", "position"))
        return place[:3, 3], place[:3, 2]


def tool_number(name: str) -> int | None:
    """The T number at the start of a tool id, as in 'T7: ball' or '7'; None where there is none."""
    found = re.match(r"\s*T?([0-9]{1,6})(?![0-9A-Za-z.])", name)
    return int(found.group(1)) if found else None


def sane_rates(data: Checked, technology: int, feed: float, speed: float) -> tuple[float, float]:
    """Feed, mm/min, nan where none is given, and speed, 1/min; ProgramError where no machine has such a value."""
    if not math.isnan(feed):
        data.within(technology, "feedrate in mm/min", feed, MIN_FEED, MAX_FEED)
    return feed, data.within(technology, "spindle in 1/min", speed, -MAX_SPEED, MAX_SPEED)


__all__ = ["SCHEMAS", "read_iso14649", "sane_rates", "tool_number"]
