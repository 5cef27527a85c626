"""The machine of a setup: three axes, or five that turn the part or the tool from one tool axis to the next."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from schemas.base import BoundedNumber, Number, Triple, WireModel

DIALECT_ENDINGS = {"linuxcnc": "ngc", "fanuc": "nc", "haas": "nc", "siemens": "mpf", "heidenhain": "h"}
"""Controls programs are written for and read from, and how the names of their files end."""

AngleRange = Annotated[list[BoundedNumber], Field(min_length=2, max_length=2)]
"""Least and greatest angle, deg."""


class Machine(WireModel):
    """A machine tool and the controls a program is wanted for."""

    model_config = {"json_schema_extra": {"examples": [{
        "kind": "3-axis", "dialects": ["linuxcnc"], "max_rpm": 18000, "rapid_mm_min": 10000}]}}

    kind: Annotated[Literal["3-axis", "5-axis"], Field(
        description="A 5-axis machine is planned for with fixed tool axes (3+2), all in one program, and walls may be "
                    "finished by the flank of a tool whose axis moves.")] = "3-axis"
    kinematics: Annotated[Literal["table-table-AC", "table-table-BC", "head-table-BC", "head-head-BC",
                                  "head-head-AC"] | None, Field(
        description="Rotary axes of a 5-axis machine, the tilting one first, by what carries them; needed there, null "
                    "on a 3-axis one. A table turns the part by Rz(C) and then Rx(A) or Ry(B), as LinuxCNC's "
                    "xyzac-trt does; a head turns the tool by Rx(A) or Ry(B) and then Rz(C).")] = None
    iso_axes: Annotated[list[Literal["A", "B", "C"]], Field(
        max_length=2,
        description="Axes of a table whose positive angle turns the tool right-handed as seen from the table (ISO "
                    "841), and so the table the other way; all others turn the table right-handed, as LinuxCNC's do. "
                    "Counts for programs that are planned and that are verified, and for rotary_deg.")] = []
    tcp: Annotated[bool, Field(description="The control keeps the tool tip in rotary moves; false: programs are of "
                                           "the linear joints, and pivots_mm is needed. No effect on a 3-axis machine, "
                                           "nor on a program that is verified: that says so by G43.4 or M428.")] = True
    dialects: Annotated[list[str], Field(
        min_length=1, max_length=8,
        description=f"Controls to write for, {', '.join(DIALECT_ENDINGS)}: one program each, the first of them "
                    "simulated, the others read back and held against it move for move.")] = ["linuxcnc"]
    restart_points: Annotated[bool, Field(
        description="Every step of a program begins behind a label as after a tool change, tool, length, zero, speed, "
                    "coolant and tool centre point control stated again, so that the program can be started there. On "
                    "a 5-axis machine the axes go back to 0 between steps. false: only steps that change the tool "
                    "begin so, and there are no labels.")] = True
    max_program_kb: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Largest program a control takes, 1000 bytes. A larger one is parted, at a change of "
                                  "the tool where it can be, into programs that run one after the other: "
                                  "program.linuxcnc.ngc, program.part2.linuxcnc.ngc, each with its STEP-NC. null: not "
                                  "limited.")] = None
    coolant: Annotated[Literal["flood", "off"], Field(
        description="Whether programs and STEP-NC turn the coolant on with the spindle (M8) or say that it is off "
                    "(M9). Cutting data that the setup does not give are for flood: dry, give your own.")] = "flood"
    high_speed: Annotated[bool, Field(
        description="Say the word for fast contouring where a control has it as an option: G05.1 Q1 on fanuc, CYCLE832 "
                    "on siemens.")] = False
    haas_tcp: Annotated[Literal["G234", "G43.4"], Field(
        description="The word by which a Haas keeps the tool tip.")] = "G234"
    heidenhain_plane: Annotated[bool, Field(
        description="On heidenhain, steps of a fixed tool axis stand in a tilted plane (PLANE SPATIAL, STAY) instead "
                    "of the setup frame; M128 keeps the tip in both.")] = False
    siemens_cycle800: Annotated[str | None, Field(
        max_length=32, pattern=r"^[A-Za-z0-9_]*$",
        description="On siemens, steps of a fixed tool axis stand in a plane of CYCLE800 (direction 0: no axis moves) "
                    "instead of the setup frame; TRAORI keeps the tip in both. The name of the swivel data record, "
                    "empty where the machine has one alone. null: no such planes.")] = None
    arcs: Annotated[bool, Field(
        description="Cuts are written as arcs and helices in the XY plane, and as longer lines, where they stay within "
                    "half of quality.chordal_tolerance_mm of the planned path; the plan is made for the other half. "
                    "Steps that lean stay straight moves.")] = False
    travel_mm: Annotated[Triple | None, Field(
        description="What the moves of a program may span in X, Y and Z, mm, on Z with the gauge lengths of its tools "
                    "counted; where on the machine is for the work offset. null: not limited.")] = None
    rotary_deg: Annotated[list[AngleRange] | None, Field(
        min_length=2, max_length=2, description="Least and greatest angle of the rotary axes, the tilting one first, "
                                                "deg; null: not limited, and on a 3-axis machine.")] = None
    table_z_mm: Annotated[BoundedNumber | None, Field(
        description="Height of the table, or of whatever the part stands on, in the setup frame with the rotary axes "
                    "at 0, mm: no tool comes near it; a spindle nose wider than the holder belongs into "
                    "tools[].holder. null: a tool that leans stays above the bottom of the blank; and on a 3-axis "
                    "machine.")] = None
    orientations: Annotated[Literal["find", "given"], Field(
        description="find: a 5-axis machine turns to further tool axes for what the accesses of the setup leave. "
                    "given: to those accesses alone. No effect on a 3-axis machine.")] = "find"
    simultaneous: Annotated[bool, Field(
        description="The rotary axes move while the tool cuts. false: plans turn them between cuts only (3+2). No "
                    "effect on a 3-axis machine, nor on a program that is verified.")] = True
    rotary_rate_deg_min: Annotated[Number | None, Field(
        ge=1, le=1e7, description="Fastest a rotary axis turns in a feed move, and in rapids for times, deg/min; null: "
                                  "not limited, 7200 in rapids for times; and on a 3-axis machine.")] = None
    pivots_mm: Annotated[list[Triple] | None, Field(
        min_length=1, max_length=2,
        description="Where the rotary axes lie, mm, in the frame of the program while both stand at 0. table-table: a "
                    "point on the tilting and one on the turning axis; head-table: [0, 0, spindle face up to the "
                    "swivel] and a point on the turning axis; head-head: the first alone. null: travel of the linear "
                    "axes is not checked, and programs without tool centre point control are refused off 0; on a "
                    "3-axis machine.")] = None
    max_rpm: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Highest spindle speed, 1/min; null: plans stay at or below 18000, and programs are "
                                  "held to no limit but those of the tools.")] = None
    max_feed_mm_min: Annotated[Number | None, Field(
        ge=0.1, le=1e6, description="Highest feed, mm/min; null: plans stay at or below 5000, and programs are held to "
                                    "no limit.")] = None
    rapid_mm_min: Annotated[Number | None, Field(ge=1, le=1e6, description="Rapid rate for times, mm/min; null: "
                                                                            "10000.")] = None
    acceleration_mm_s2: Annotated[Number | None, Field(ge=1, le=1e7, description="Acceleration, mm/s2, for times; "
                                                                                  "null: 1000.")] = None
    rapid_motion: Annotated[Literal["linear", "dogleg"], Field(
        description="How the control runs a rapid in several axes. linear: straight. dogleg: each axis at its own "
                    "speed, so a rapid that moves more than one axis lower than clearance_mm.rapid over the top of "
                    "part, stock and fixtures is a finding.")] = "linear"
    ap238: Annotated[Literal["cc1", "cc2", "integrated_cnc"], Field(
        description="What job.stpnc is for. cc1: tool paths, conformance class 1. cc2: class 2, with part and blank as "
                    "shapes, strategies and setup instructions too. integrated_cnc: as cc1, under the schema name of "
                    "the first edition, INTEGRATED_CNC_SCHEMA, for readers that know no other.")] = "cc1"

    @model_validator(mode="after")
    def _check(self) -> Machine:
        self._check_rotary()
        if absent := [d for d in self.dialects if d not in DIALECT_ENDINGS]:
            raise ValueError(f"dialect {', '.join(map(repr, absent))} is not built yet; "
                             f"use {', '.join(DIALECT_ENDINGS)}")
        if len(set(self.dialects)) != len(self.dialects):
            raise ValueError("a dialect stands more than once in machine.dialects")
        if self.travel_mm is not None and min(self.travel_mm) <= 0:
            raise ValueError("machine.travel_mm must be positive in X, Y and Z")
        return self

    def _check_rotary(self) -> None:
        """What belongs to rotary axes stands on a 5-axis machine only, and fits them."""
        if self.kind == "3-axis":
            if self.iso_axes:
                raise ValueError("machine.iso_axes belongs to a 5-axis machine; leave it empty, or say kind '5-axis'")
            for name in ("kinematics", "table_z_mm", "rotary_deg", "rotary_rate_deg_min", "pivots_mm"):
                if getattr(self, name) is not None:
                    raise ValueError(f"machine.{name} belongs to a 5-axis machine; leave it null, or say kind '5-axis'")
            return
        if self.kinematics is None:
            raise ValueError("machine.kinematics is needed where machine.kind is '5-axis', such as 'table-table-AC'")
        tables = {"table-table": self.kinematics[-2:], "head-table": "C"}.get(self.kinematics[:-3], "")
        if wrong := [letter for letter in self.iso_axes if letter not in tables]:
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
