"""Settings of a plan: speeds of a tool, tolerances and heights."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from geometry.cutting_mechanics import diameter_in_cut
from geometry.machine_rates import RATES, Rates
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.counterexamples import NONE, Counterexamples
from toolpath.scallop_budget import ScallopBudget
from toolpath.tool_deflection import MIN_FEED, DeflectionEstimate, DeflectionModel
from toolpath.workingsteps import CutDirection


class Pattern(StrEnum):
    """Order of passes over shallow area."""

    AUTO = "auto"
    """Zigzag or spiral, whichever is shorter."""
    ZIGZAG = "zigzag"
    """Straight passes, back and forth."""
    ONE_WAY = "one_way"
    """Straight passes, all in the same direction."""
    SPIRAL = "spiral"
    """Rings from the border inwards, joined turn by turn to a spiral."""


@dataclass(frozen=True)
class CutData:
    """Cutting data of one tool.

    spindle_rpm                   : 1/min
    feed, plunge_feed, link_feed  : mm/min
    step_down                     : mm, the deepest layer
    engaged                       : rad, largest engaged angle of the front of the cutter
    finish                        : the same for finishing; None where it does not differ
    bending                       : DeflectionModel of the tool; None where it is unknown
    bend                          : DeflectionEstimate at this feed; None before it is computed
    """

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
        """The same with the feed reduced to where a cut deflects the tool no more than its limit.

        depth, width : mm, of the cut

        Ways down are no faster than that.
        """
        if self.bending is None:
            return self
        bend = self.bending.under(self.feed, depth, width)
        feed = max(MIN_FEED, bend.share * self.feed)
        down = self.plunge_feed if self.bending.ways_fixed else min(self.plunge_feed, feed)
        return replace(self, feed=feed, plunge_feed=down, bend=bend)

    def bearable(self, depth: float, width: float) -> float:
        """The largest depth of cut, mm, at which the least chip does not bend the tool too far
        (``DeflectionModel.bearable``).

        depth, width : mm, of the deepest cut
        """
        return depth if self.bending is None else self.bending.bearable(self.feed, depth, width)

    def feed_under(self, tool: ToolBody, depth: float, angle: float) -> float:
        """Feed, mm/min, at which a cut of a depth, mm, and an engaged angle, rad, deflects the tool no more than its
        limit.

        In a cut no deeper than a layer it is at least ``feed``, which is for the worst of these. It is at most the feed
        before that was reduced.
        """
        if self.bending is None or self.bend is None or self.bend.share >= 1.0:
            return self.feed
        full = self.feed / self.bend.share
        width = 0.5 * diameter_in_cut(tool, depth) * (1.0 - math.cos(angle))
        least = self.feed if depth <= self.step_down * (1.0 + 1e-9) else MIN_FEED
        return max(least, self.bending.under(full, depth, width).share * full)


@dataclass(frozen=True)
class RotaryAxes:
    """Abilities of the rotary axes, in the access frame.

    stands  : (n,) bool, whether the machine can take tool axes, (n, 3) float64, unit
    along   : the path that the machine follows for tips (n, 3) float64, mm, and axes (n, 3), and the shortest time of
              each block, (m, 3), (m, 3) and (m - 1,) min; None where the rotary axes cannot follow
    up      : (3,) float64, unit, away from the table
    table   : mm along ``up``, below which no part of a tilted tool may come
    """

    stands: Callable[[F64], NDArray[np.bool_]]
    along: Callable[[F64, F64], tuple[F64, F64, F64] | None]
    up: F64
    table: float


@dataclass(frozen=True)
class ToolLean:
    """Requested tilt of a ball or bull nose off the normal of faces, rad.

    lead  : forward along a pass
    tilt  : to one side of it
    walls : to one side on walls; None where walls get no tilt
    """

    lead: float
    tilt: float
    walls: float | None = None


@dataclass(frozen=True, eq=False)
class LeftAlone:
    """Places of faces that are not to be machined, access frame.

    points, normals : (n, 3) float64, mm and unit, out of the material
    spacing         : mm between them
    """

    points: F64
    normals: F64
    spacing: float


@dataclass(frozen=True)
class PlanSettings:
    """Tolerances and heights of a plan; mm and rad.

    lift            : distance along the normal within which a touch counts as reach
    clearance       : height of rapid moves across
    rapid_floor     : lowest height of a rapid
    cut_direction   : CutDirection of passes along walls
    pattern         : of passes over shallow area
    turning         : RotaryAxes; None on a machine without
    leaned          : requested tilt on faces; None where the plan chooses
    left_alone      : LeftAlone, places of faces that the setup does not let machine; None: there are none
    found           : findings of proofs of earlier plans, in the frame of this one
    rates           : speeds and accelerations of the machine, for times
    planes          : heights of contact, descending: all above one is finished before any tool goes below it
                      (``toolpath.planning.depth_bands``)
    semi_finishing  : cuts between the layers too, so that they leave even stock
    underside       : lowest height of the blank: what is cut down to it all round comes loose
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
    left_alone: LeftAlone | None = None
    underside: float = -math.inf

    @property
    def budget(self) -> ScallopBudget:
        """The shares of the scallop and of the chordal tolerance."""
        return ScallopBudget(self.scallop_height, self.chordal_tolerance)
