"""Output of the planner: trajectories of the tool tip and the workingsteps made of them.

Plain values of the tool tip in mm, access frame. Rapids move Z alone, or XY alone at the clearance height. The planner
guarantees that, and nothing downstream reorders them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from geometry.machine_rates import RATES, Rates
from geometry.mesh import F64
from geometry.move_timing import move_seconds
from geometry.tool_body import ToolBody
from toolpath.tool_deflection import DeflectionEstimate


class TrajectoryKind(StrEnum):
    """Purpose of a trajectory; the STEP-NC trajectory types follow from it [ISO14649-10]."""

    RAPID = "rapid"
    APPROACH = "approach"
    CUT = "cut"
    CONNECT = "connect"
    LIFT = "lift"


class CutDirection(StrEnum):
    """On which side of its way a tool has the material, seen from the spindle of a right-hand cutter."""

    CLIMB = "climb"
    """Material on the right."""
    CONVENTIONAL = "conventional"
    """Material on the left."""
    EITHER = "either"
    """Passes may go both ways; the first of them climbs."""

    @property
    def climbs(self) -> bool:
        """Whether the first pass climbs."""
        return self is not CutDirection.CONVENTIONAL

    @property
    def both_ways(self) -> bool:
        """Whether passes may go both ways."""
        return self is CutDirection.EITHER


@dataclass(frozen=True)
class ArcSpan:
    """A stretch of a trajectory on a circle seen along Z; where Z changes, it changes evenly with the angle, a helix.

    first, last : index of the points where it begins and ends
    centre      : mm, X and Y, access frame
    left        : counter-clockwise seen from above, as G3
    """

    first: int
    last: int
    centre: tuple[float, float]
    left: bool


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One polyline of the tool tip.

    motion : TrajectoryKind; RAPID is a G0, everything else a G1 at ``feed``
    points : (n, 3) float64, mm, access frame, n >= 2; the first point equals the last of the trajectory before it
    feed   : mm/min; ignored for a rapid
    axes   : (n, 3) float64, unit, tip to spindle; None: along Z of the frame of the points
    arcs   : stretches that G2 or G3 can follow, in order, separate but for their ends; the points between those of an
             arc lie on it
    loose  : mm that the written way may leave the points by, more than those of a finish: a later pass takes what stays
    """

    motion: TrajectoryKind
    points: F64
    feed: float
    axes: F64 | None = None
    arcs: tuple[ArcSpan, ...] = ()
    loose: float = 0.0

    @property
    def length(self) -> float:
        """Length, mm."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def seconds_of(trajectories: Sequence[Trajectory], rates: Rates) -> float:
    """Time of trajectories in sequence, s; the control stops where rapids and feed moves meet."""
    return float(trajectory_seconds(trajectories, rates).sum())


def trajectory_seconds(trajectories: Sequence[Trajectory], rates: Rates) -> F64:
    """Time of each of k trajectories in sequence, (k,) float64, s; see ``seconds_of``."""
    if not trajectories:
        return np.zeros(0)
    count = [len(t.points) - 1 for t in trajectories]
    rapid = np.repeat([t.motion is TrajectoryKind.RAPID for t in trajectories], count)
    feed = np.where(rapid, rates.rapid, np.repeat([t.feed for t in trajectories], count))
    stop = np.concatenate([[False], rapid[1:] != rapid[:-1]])
    way = np.concatenate([np.diff(t.points, axis=0) for t in trajectories])
    return np.add.reduceat(move_seconds(way, feed, rates, stop), np.cumsum([0, *count[:-1]]))


@dataclass(frozen=True, eq=False)
class Workingstep:
    """One operation with one tool: one zone finished, or the layers above zones taken off.

    id        : 'S07'
    name      : for people and for STEP-NC, for example 'S07 Z3 waterline T1 F12 F13'
    zone      : 'Z3', or None for a step that serves several zones
    faces     : face numbers of the feature
    operation : 'roughing', 'semi_finishing' or 'finishing'
    strategy  : 'depth_layers', 'waterline', 'planar_floor', 'zigzag', 'one_way', 'spiral', 'isoparametric', 'flank',
                'curvature_matched', 'inclined_axis'
    outline   : (k, 2) float64, mm, closed outline (first point repeated) of the machined area in plan
    top, bottom : mm, z of the feature
    access    : id of the access in whose frame all this is; '' where the plan has one frame
    rates     : speeds and accelerations of the machine, for times
    bend      : DeflectionEstimate of its cuts; None where it is unknown
    fresh     : the program requests a fresh cutter before it
    cut_direction : CutDirection of its passes
    """

    id: str
    name: str
    zone: str | None
    faces: tuple[int, ...]
    operation: str
    strategy: str
    tool: ToolBody
    spindle_rpm: float
    feed: float
    side_step: float
    scallop_height: float
    chordal_tolerance: float
    trajectories: tuple[Trajectory, ...]
    outline: F64
    top: float
    bottom: float
    cut_direction: CutDirection = CutDirection.CLIMB
    access: str = ""
    rates: Rates = RATES
    bend: DeflectionEstimate | None = None
    fresh: bool = False

    @property
    def seconds(self) -> float:
        """Time at its feeds and rapids, speeding up and slowing down counted, from standstill to standstill."""
        return seconds_of(self.trajectories, self.rates)
