"""The machine of a setup: what is built so far is one tool axis, LinuxCNC."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from schemas.base import Number, Triple, Vector, WireModel

BUILT_DIALECTS = ("linuxcnc",)


class Machine(WireModel):
    """A machine tool and the controls a program is wanted for."""

    model_config = {"json_schema_extra": {"examples": [{
        "kind": "3-axis", "dialects": ["linuxcnc"], "max_rpm": 18000, "rapid_mm_min": 10000}]}}

    kind: Annotated[Literal["3-axis", "5-axis"], Field(description="5-axis is not built yet.")] = "3-axis"
    kinematics: Annotated[Literal["table-table-AC", "table-table-BC", "head-table-BC", "head-head-BC",
                                  "head-head-AC"] | None,
                          Field(description="Rotary axes of a 5-axis machine; null on a 3-axis one.")] = None
    tcp: Annotated[bool, Field(description="The control keeps the tool tip in rotary moves; no effect on a 3-axis "
                                           "machine.")] = True
    dialects: Annotated[list[str], Field(min_length=1, max_length=8,
                                         description="Controls to write for; built so far: linuxcnc.")] = ["linuxcnc"]
    travel_mm: Annotated[Triple | None, Field(
        description="What the moves of a program may span in X, Y and Z, mm, on Z with the gauge lengths of its tools "
                    "counted; where on the machine is for the work offset. null: not limited.")] = None
    rotary_deg: Annotated[list[list[Number]] | None, Field(description="Limits of the rotary axes, deg; null on a "
                                                                       "3-axis machine.")] = None
    pivots_mm: Annotated[list[Vector] | None, Field(description="Pivot points of the rotary axes, mm; null on a "
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

    @model_validator(mode="after")
    def _check(self) -> Machine:
        if self.kind == "5-axis":
            raise ValueError("machine.kind '5-axis' is not built yet; use '3-axis'")
        for name in ("kinematics", "rotary_deg", "pivots_mm"):
            if getattr(self, name) is not None:
                raise ValueError(f"machine.{name} belongs to a 5-axis machine, which is not built yet; leave it null")
        if absent := [d for d in self.dialects if d not in BUILT_DIALECTS]:
            raise ValueError(f"dialect {', '.join(map(repr, absent))} is not built yet; "
                             f"use {', '.join(BUILT_DIALECTS)}")
        if len(set(self.dialects)) != len(self.dialects):
            raise ValueError("a dialect stands more than once in machine.dialects")
        if self.travel_mm is not None and min(self.travel_mm) <= 0:
            raise ValueError("machine.travel_mm must be positive in X, Y and Z")
        return self
