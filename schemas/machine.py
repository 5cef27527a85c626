"""The machine of a setup: three axes, or five that turn the part or the tool from one tool axis to the next."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from schemas.base import BoundedNumber, Number, Triple, WireModel

DIALECT_ENDINGS = {"linuxcnc": "ngc", "fanuc": "nc", "haas": "nc", "siemens": "mpf", "heidenhain": "h"}
"""Controls for which programs are written and read, with the extensions of their files."""

AngleRange = Annotated[list[BoundedNumber], Field(min_length=2, max_length=2)]
"""Least and greatest angle, deg."""


class Machine(WireModel):
    """A machine tool and the controls that need a program."""

    model_config = {"json_schema_extra": {"examples": [{
        "kind": "3-axis", "dialects": ["linuxcnc"], "max_rpm": 18000, "rapid_mm_min": 10000}]}}

    kind: Annotated[Literal["3-axis", "5-axis"], Field(
        description="3-axis: one program for each access. 5-axis: one program for all tool axes, which are fixed "
                    "during each cut (3+2). With machine.simultaneous they also move during some finishing cuts, such "
                    "as flank milling.")] = "3-axis"
    kinematics: Annotated[Literal["table-table-AC", "table-table-BC", "head-table-BC", "head-head-BC",
                                  "head-head-AC"] | None, Field(
        description="Rotary axes: whether each turns the table or the head, and its letter; the tilting axis comes "
                    "first. Required on a 5-axis machine, null on a 3-axis machine. A table turns the part by Rz(C) "
                    "and then Rx(A) or Ry(B), as LinuxCNC's xyzac-trt does. A head turns the tool by Rx(A) or Ry(B) "
                    "and then Rz(C).")] = None
    iso_axes: Annotated[list[Literal["A", "B", "C"]] | None, Field(
        max_length=2, description="Letters of the table axes that follow ISO 841. At a positive angle of such an axis "
                                  "the tool turns right-handed as seen from the table, so the table itself turns "
                                  "left-handed. Any other table axis turns the table right-handed, as in LinuxCNC. "
                                  "This holds for planned programs, verified programs and rotary_deg. null: not "
                                  "stated. Planned programs then take [], their header says so, and the report lists "
                                  "it under proof.assumed. A program of others that turns a table axis gives the error "
                                  "rotary_sense_open.")] = None
    tcp: Annotated[bool, Field(
        description="true: the control keeps the tool tip during rotary moves. false: programs contain positions of "
                    "the linear joints, and pivots_mm is required. No effect on a 3-axis machine. Verified programs "
                    "ignore it: their own words decide (M428, G43.4, G234, TRAORI or M128).")] = True
    dialects: Annotated[list[str], Field(
        min_length=1, max_length=8,
        description=f"Controls that need a program: {', '.join(DIALECT_ENDINGS)}. Each gets its own program. The first "
                    f"is simulated; the others are read back and compared with it move for move.")] = ["linuxcnc"]
    restart_points: Annotated[bool, Field(
        description="true: the program can be started at every workingstep. Each begins with a label, tool, length, "
                    "zero, speed, coolant and tool centre point control, as after a tool change. A program that runs "
                    "from the top neither calls the tool in the spindle nor stops it: it jumps over these words, which "
                    "on fanuc needs custom macros and on fanuc and haas a program in memory, not in DNC operation. On "
                    "a 5-axis machine the rotary axes return to 0 between workingsteps. false: there are no labels and "
                    "jumps, and only workingsteps after a tool change state these.")] = True
    max_program_kb: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Largest program that the control accepts, in 1000 bytes. A larger program is split, "
                                  "at tool changes where possible, into programs that run in order: "
                                  "program.linuxcnc.ngc, program.part2.linuxcnc.ngc, each with its STEP-NC. null: no "
                                  "limit.")] = None
    coolant: Annotated[Literal["flood", "off"], Field(
        description="flood: programs and STEP-NC turn the coolant on with the spindle (M8). off: they state that the "
                    "coolant is off (M9). The default cutting data assume flood coolant, so give your own cutting data "
                    "for a dry machine.")] = "flood"
    high_speed: Annotated[bool, Field(
        description="true: programs use an option of the control for fast contouring: G05.1 Q1 on fanuc, CYCLE832 on "
                    "siemens.")] = False
    haas_tcp: Annotated[Literal["G234", "G43.4"], Field(
        description="Word that turns on tool centre point control on haas.")] = "G234"
    heidenhain_plane: Annotated[bool, Field(
        description="true: on heidenhain, workingsteps with a fixed tool axis are in a tilted plane (PLANE SPATIAL, "
                    "STAY). false: they are in the setup frame. M128 keeps the tip in both cases.")] = False
    siemens_cycle800: Annotated[str | None, Field(
        max_length=32, pattern=r"^[A-Za-z0-9_]*$",
        description="On siemens: name of the swivel data record, empty if the machine has only one. Workingsteps with "
                    "a fixed tool axis are then in a plane of CYCLE800 (direction 0: no axis moves). null: they are in "
                    "the setup frame. TRAORI keeps the tip in both cases.")] = None
    arcs: Annotated[bool, Field(
        description="true: programs contain arcs and helices in the XY plane, and longer straight moves. They stay "
                    "within half of quality.chordal_tolerance_mm of the planned path; the plan uses the other half. "
                    "Only workingsteps whose tool axis is Z of the program get arcs, and a moving tool axis gets "
                    "neither. false: every move is straight.")] = True
    travel_mm: Annotated[Triple | None, Field(
        description="Travel of the machine in X, Y and Z, mm: the largest extent of the moves of a program. In Z it is "
                    "the extent of the spindle face, so gauge lengths count. The place of the moves within the travel "
                    "is not checked. null: no limit.")] = None
    rotary_deg: Annotated[list[AngleRange] | None, Field(
        min_length=2, max_length=2, description="Smallest and largest angle of each rotary axis, deg, the tilting axis "
                                                "first. null: no limit. Leave it null on a 3-axis machine.")] = None
    table_z_mm: Annotated[BoundedNumber | None, Field(
        description="Height of the table, or of the fixture under the part, mm, in the setup frame with the rotary "
                    "axes at 0. Tools stay clearance_mm.rapid above it; on a 3-axis machine a tool that cuts may come "
                    "down to it. If the spindle nose is wider than the holder, add it as the last segment of "
                    "tools[].holder. null: tilted tools stay above the bottom of the blank.")] = None
    change_position: Annotated[list[BoundedNumber] | None, Field(
        min_length=1, max_length=3,
        description="Place of the spindle face while a tool is changed (M6), mm, in the setup frame with the rotary "
                    "axes at 0: [Z], or [X, Y, Z]. With [Z] alone X and Y stay. The control goes there by itself. "
                    "null: LinuxCNC changes the tool where the spindle stands, so a longer tool then hangs lower. "
                    "Other controls are taken to go above everything.")] = None
    nose_diameter_mm: Annotated[Number | None, Field(
        ge=1, le=1000, description="Diameter of the spindle nose, mm. The nose is then a body 200 mm high that begins "
                                   "gauge_length_mm over the tip of each tool, if a holder or that length is given, "
                                   "and at the program's Z where the spindle is empty. null: nothing is checked "
                                   "above a holder, and the nose of an empty spindle is taken to be 69.832 mm wide "
                                   "(taper 30 of DIN 2079).")] = None
    orientations: Annotated[Literal["find", "given"], Field(
        description="find: a 5-axis machine also uses other tool axes for areas that the accesses of the setup do not "
                    "reach. given: it uses those accesses only. No effect on a 3-axis machine.")] = "find"
    simultaneous: Annotated[bool, Field(
        description="true: the rotary axes may move while the tool cuts. false: they turn between cuts only (3+2). No "
                    "effect on a 3-axis machine or on a verified program.")] = True
    rotary_rate_deg_min: Annotated[Number | None, Field(
        ge=1, le=1e7, description="Highest rotary speed, deg/min. It limits feed moves, and times of rapids are "
                                  "computed with it. null: no limit; rapids are timed with 7200. Leave it null on a "
                                  "3-axis machine.")] = None
    pivots_mm: Annotated[list[Triple] | None, Field(
        min_length=1, max_length=2, description="Pivots of the rotary axes, mm, in the frame of the program with both "
                                                "axes at 0. table-table: a point on the tilting axis and one on the "
                                                "turning axis. head-table: [0, 0, distance from the spindle face up to "
                                                "the swivel] and a point on the turning axis. head-head: only [0, 0, "
                                                "distance]. null: the travel of the linear axes is not checked. A "
                                                "program that turns the axes away from 0 without tool centre point "
                                                "control then gives an error. Leave it null on a 3-axis "
                                                "machine.")] = None
    max_rpm: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Highest spindle speed, 1/min. null: at most 18000 in plans; in verified programs "
                                  "only the limits of the tools apply.")] = None
    max_power_kw: Annotated[Number | None, Field(
        gt=0, le=1e4, description="Power of the spindle, kW. A proof estimates the power of each cut: more is a "
                                  "warning, twice as much a finding. null: more than any spindle has is one.")] = None
    max_feed_mm_min: Annotated[Number | None, Field(
        ge=0.1, le=1e6, description="Highest feed, mm/min. null: at most 5000 in plans, no limit in verified "
                                    "programs.")] = None
    rapid_mm_min: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Rapid rate, mm/min, for machining times; null: 10000.")] = None
    acceleration_mm_s2: Annotated[Number | None, Field(
        ge=1, le=1e7, description="Acceleration, mm/s2, for machining times; null: 4905.")] = None
    jerk_mm_s3: Annotated[Number | None, Field(
        ge=1, le=1e9, description="Jerk, mm/s3, for machining times: how fast the acceleration changes; "
                                  "null: 20000.")] = None
    rapid_motion: Annotated[Literal["linear", "dogleg"] | None, Field(
        description="Path of a rapid in several axes. linear: a straight line. dogleg: each axis moves at its own "
                    "speed, so the path is not straight. The whole box of the move must then stay clear of part, stock "
                    "and fixtures. Plans for five axes then need pivots_mm and a table that tilts. null: dogleg on "
                    "fanuc and haas, linear on other controls and in programs that turn rotary axes, because tool "
                    "centre point control needs it. The report lists the path under proof.assumed where it "
                    "matters.")] = None
    ap238: Annotated[Literal["cc1", "cc2", "integrated_cnc"], Field(
        description="Form of job.stpnc. cc1: conformance class 1 of AP238, tool paths. cc2: class 2, which adds the "
                    "shapes of part and blank, strategies and setup instructions. integrated_cnc: like cc1, with the "
                    "schema name of the first edition, INTEGRATED_CNC_SCHEMA, for readers that know only this "
                    "name.")] = "cc1"

    @model_validator(mode="after")
    def _check(self) -> Machine:
        self._check_rotary()
        if absent := [d for d in self.dialects if d not in DIALECT_ENDINGS]:
            raise ValueError(f"dialect {', '.join(map(repr, absent))} is not built yet; "
                             f"use {', '.join(DIALECT_ENDINGS)}")
        if self.change_position is not None and len(self.change_position) == 2:
            raise ValueError("machine.change_position has 1 number, Z, or 3, X, Y and Z")
        if len(set(self.dialects)) != len(self.dialects):
            raise ValueError("machine.dialects names a dialect more than once")
        if self.travel_mm is not None and min(self.travel_mm) <= 0:
            raise ValueError("machine.travel_mm must be positive in X, Y and Z")
        return self

    def _check_rotary(self) -> None:
        """Fields of rotary axes occur on a 5-axis machine only, and fit its kinematics."""
        if self.kind == "3-axis":
            if self.iso_axes:
                raise ValueError("machine.iso_axes belongs to a 5-axis machine; leave it empty, "
                                 "or set machine.kind '5-axis'")
            for name in ("kinematics", "rotary_deg", "rotary_rate_deg_min", "pivots_mm"):
                if getattr(self, name) is not None:
                    raise ValueError(f"machine.{name} belongs to a 5-axis machine; leave it null, "
                                     "or set machine.kind '5-axis'")
            return
        if self.kinematics is None:
            raise ValueError("machine.kinematics is needed where machine.kind is '5-axis', such as 'table-table-AC'")
        tables = {"table-table": self.kinematics[-2:], "head-table": "C"}.get(self.kinematics[:-3], "")
        if wrong := [letter for letter in self.iso_axes or () if letter not in tables]:
            raise ValueError(f"machine.iso_axes: {', '.join(wrong)} is no axis of a table of {self.kinematics}")
        for letter, limits in zip(self.kinematics[-2:], self.rotary_deg or (), strict=False):
            if limits[0] >= limits[1]:
                raise ValueError(f"machine.rotary_deg of {letter}: {limits[0]:g} is not below {limits[1]:g}")
        if self.pivots_mm is None:
            return
        if len(self.pivots_mm) != (wanted := 1 if self.kinematics.startswith("head-head") else 2):
            raise ValueError(f"machine.pivots_mm has {len(self.pivots_mm)} points, {self.kinematics} takes {wanted}")
        x, y, z = self.pivots_mm[0]
        if self.kinematics.startswith("head") and (x != 0 or y != 0 or z < 0):
            raise ValueError(f"machine.pivots_mm of {self.kinematics} begins with [0, 0, distance from the spindle "
                             "face up to the swivel]")
