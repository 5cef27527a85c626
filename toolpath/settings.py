"""What a plan is asked for: speeds of a tool, tolerances and heights."""

from __future__ import annotations

from dataclasses import dataclass

from toolpath.strategies.zigzag import Pattern


@dataclass(frozen=True)
class CutData:
    """How fast one tool cuts: 1/min and mm/min; step_down in mm, the deepest layer it takes."""

    spindle_rpm: float
    feed: float
    plunge_feed: float
    link_feed: float
    step_down: float


@dataclass(frozen=True)
class PlanSettings:
    """Tolerances and heights of a plan; mm and rad.

    lift            : distance along the normal within which a touch counts as reach
    clearance       : height of rapid moves across
    rapid_floor     : height down to which a rapid may go
    either_way      : walls may be cut in both directions; climb : else climb, or conventional when False
    pattern         : of passes over shallow area
    """

    scallop_height: float
    chordal_tolerance: float
    stock_allowance: float
    lift: float
    clearance: float
    rapid_floor: float
    ramp_angle: float
    roughing: bool = True
    finishing: bool = True
    climb: bool = True
    either_way: bool = False
    pattern: Pattern = Pattern.AUTO
