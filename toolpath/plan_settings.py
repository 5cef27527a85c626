"""What a plan is asked for: speeds of a tool, tolerances and heights."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.move_timing import RATES, Rates
from geometry.tool_body import ToolBody
from toolpath.counterexamples import NONE, Counterexamples
from toolpath.tool_deflection import MIN_FEED, DeflectionEstimate, DeflectionModel, effective_diameter
from toolpath.workingsteps import CutDirection


class Pattern(StrEnum):
    """How passes over shallow area follow each other."""

    AUTO = "auto"
    """Zigzag or spiral, whichever is less way."""
    ZIGZAG = "zigzag"
    """Straight passes, to and fro."""
    ONE_WAY = "one_way"
    """Straight passes, all walked the same way."""
    SPIRAL = "spiral"
    """Rings from the border inwards, joined turn by turn."""


@dataclass(frozen=True)
class CutData:
    """How fast one tool cuts: 1/min and mm/min; step_down in mm, the deepest layer it takes; engaged in rad, most of
    the front of the cutter that may be in stock; finish: the same in finishing, None where it is no other; bending:
    what it bends by under a cut, None where nobody knows; bend: what that is at this feed, None before it is asked."""

    spindle_rpm: float
    feed: float
    plunge_feed: float
    link_feed: float
    step_down: float
    engaged: float = math.pi
    finish: CutData | None = None
    bending: DeflectionModel | None = None
    bend: DeflectionEstimate | None = None

    def under(self, depth: float, width: float) -> CutData:
        """The same with the feed eased to where a cut of a depth and a width, mm, bends the tool no more than it may.

        Ways down are no faster than that.
        """
        if self.bending is None:
            return self
        bend = self.bending.under(self.feed, depth, width)
        feed = max(MIN_FEED, bend.share * self.feed)
        down = self.plunge_feed if self.bending.ways_fixed else min(self.plunge_feed, feed)
        return replace(self, feed=feed, plunge_feed=down, bend=bend)

    def feed_under(self, tool: ToolBody, depth: float, angle: float) -> float:
        """mm/min at which a cut of a depth, mm, and an engaged angle, rad, bends the tool no more than it may.

        Never less than the feed, which is for the worst, nor more than that was before it was eased.
        """
        if self.bending is None or self.bend is None or self.bend.share >= 1.0:
            return self.feed
        full = self.feed / self.bend.share
        width = 0.5 * effective_diameter(tool.diameter, tool.corner_radius, depth) * (1.0 - math.cos(angle))
        return max(self.feed, self.bending.under(full, depth, width).share * full)


@dataclass(frozen=True)
class RotaryAxes:
    """What rotary axes can do, in the frame of an access.

    stands  : for which tool axes (n, 3), unit, they have a place, (n,) bool
    along   : a path of tips (n, 3), mm, and axes (n, 3), unit, as they follow it, and the least minutes each of its
              blocks takes them, (m, 3), (m, 3) and (m - 1,); None where they do not get along it
    up      : (3,) float64, unit, away from the table
    table   : mm along ``up``, below which nothing of a leaning tool may come
    """

    stands: Callable[[F64], NDArray[np.bool_]]
    along: Callable[[F64, F64], tuple[F64, F64, F64] | None]
    up: F64
    table: float


@dataclass(frozen=True)
class ToolLean:
    """How far a nose is asked to lean off the normal of faces, rad: forwards along a pass, and to one side of it.

    walls : to one side on walls; None where it leans on others alone
    """

    lead: float
    tilt: float
    walls: float | None = None


@dataclass(frozen=True)
class PlanSettings:
    """Tolerances and heights of a plan; mm and rad.

    lift            : distance along the normal within which a touch counts as reach
    clearance       : height of rapid moves across
    rapid_floor     : height down to which a rapid may go
    cut_direction   : CutDirection of passes along walls
    pattern         : of passes over shallow area
    turning         : what the rotary axes can do; None on a machine without
    leaned          : how far noses are asked to lean on faces; None where that is left to the plan
    found           : what a proof found wrong with the plans before, in the frame of this one
    rates           : what the machine does, for times
    planes          : heights of contact, descending, above which all is finished before any tool goes below
                      (``toolpath.planning.depth_bands``)
    semi_finishing  : between the layers too, so that they leave even stock
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
    cut_direction: CutDirection = CutDirection.CLIMB
    pattern: Pattern = Pattern.AUTO
    turning: RotaryAxes | None = None
    found: Counterexamples = NONE
    rates: Rates = RATES
    planes: tuple[float, ...] = ()
    semi_finishing: bool = False
    leaned: ToolLean | None = None
