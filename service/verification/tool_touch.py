"""What the tools of a program can touch, for the proof of programs that were not planned here.

The proof asks for single samples along the axes that the program cuts with. The answer is the exact approach of
``zones.reach.approach_cones``: the contact of the cutting part, and the whole tool free of part and fixtures. No zone
is built for it. Drills, taps, chamfer and thread mills are asked as ``service.verification.named_touch`` says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from service.stages.job_inputs import JobInputs
from service.stages.preparation import obstacle_mesh
from service.verification.named_touch import AxisLines, NamedTouch
from service.verification.own_ways import MillWays, touched_on_ways
from verify.tool_axes import LEVEL, UPRIGHT
from zones.machinable_area import SEEN
from zones.reach.approach_cones import approach
from zones.reach.index_orientations import AxisCoverage
from zones.remainder.obstructions import SKIN
from zones.remainder.reasons import Reason

MAX_REASONED = 3000  # samples whose reason is looked for one by one; the others share that of the nearest in order
BOOL = NDArray[np.bool_]


class ToolTouch:
    """``verify.model.Touch`` of a part and its fixtures.

    part   : Part in the setup frame
    inputs : JobInputs
    turn   : (3, 3) float64, dimensionless, from the setup frame to that of the proof
    table  : mm, setup frame, height of the machine table, which a tilted tool must avoid; None: no table
    lines  : of drills and taps, frame of the proof, as ``service.verification.named_touch.axis_lines``
    ways   : of mills, frame of the proof, as ``service.verification.own_ways.mill_ways``
    """

    def __init__(self, part: Part, inputs: JobInputs, turn: F64, table: float | None,
                 lines: Mapping[int, AxisLines], ways: Mapping[int, MillWays]) -> None:
        matrix = np.eye(4)
        matrix[:3, :3] = turn
        self.inputs, self.ways = inputs, ways
        self.bare = TriangleTree(part.mesh.transformed(matrix))
        self.clamped = bool(inputs.fixtures) or table is not None
        self.obstacles = TriangleTree(obstacle_mesh(part, inputs, table=table).transformed(matrix)) \
            if self.clamped else self.bare
        self.named = NamedTouch(self.obstacles, inputs.clearances, lines)

    def reaches(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64, lift: float,
                room: float) -> BOOL:
        """Samples that some tool touches along some axis and can finish there.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof
        lift    : mm, distance from the sample along its normal within which a touch counts, over the allowance
        room    : mm, distance that the whole tool keeps from part and fixtures, over allowance and clearances

        Returns (n,) bool.
        """
        quality = self.inputs.quality
        out = np.zeros(len(samples), np.bool_)
        for tool in sorted(tools, key=lambda t: (-t.diameter, t.stickout, t.id)):
            rows = np.flatnonzero(~out)
            if tool.named:
                out[rows] = self.named.reaches(samples.subset(rows), tool, axes, lift,
                                               quality.stock_allowance_mm + room)
                continue
            one = AxisCoverage(self.obstacles, [tool], self.inputs.clearances, quality.scallop_height_mm, lift,
                               quality.stock_allowance_mm + room)
            out[rows] = one.reached(samples.subset(rows), axes).any(axis=1)
        return out

    def edges(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64, lift: float) -> BOOL:
        """Samples that the sharp edge of a flat end touches along some axis: it finishes them in steps alone.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof
        lift    : mm, distance from the sample along its normal within which a touch counts, over the allowance

        Returns (n,) bool.
        """
        out = np.zeros(len(samples), np.bool_)
        for tool in (t for t in tools if t.tip_curvature <= 0.0 and not t.named):
            rows = np.flatnonzero(~out)
            out[rows] = approach(self.obstacles, tool, self.inputs.clearances, samples.points[rows],
                                 samples.normals[rows], axes, lift,
                                 self.inputs.quality.stock_allowance_mm).any(axis=1)
        return out

    def on_ways(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64, lift: float,
                stepped: BOOL) -> BOOL:
        """Samples that a mill touches where its own feed moves take it, as low as part and fixtures let it go.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof
        lift    : mm, distance from the sample within which a touch counts, over the allowance
        stepped : (n,) bool, whether the sharp edge of a flat end counts on a slope, which it finishes in steps alone

        Returns (n,) bool.
        """
        out = np.zeros(len(samples), np.bool_)
        for tool, axis in ((t, a) for t in tools if t.number in self.ways for a in axes):
            may = ~out
            if tool.tip_curvature <= 0.0:
                up = np.abs(samples.normals @ axis)
                may &= stepped | (up <= UPRIGHT) | (up >= LEVEL)
            rows = np.flatnonzero(may)
            out[rows] = touched_on_ways(self.obstacles, samples.points[rows], tool, self.ways[tool.number], axis,
                                        self.inputs.clearances, lift, self.inputs.quality.stock_allowance_mm)
        return out

    def reasons(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64) -> NDArray[np.object_]:
        """Why no tool touches samples: 'undercut', 'fixture', 'holder', 'shank', 'sharp corner' or 'corner'.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof

        Returns (n,) object array of str.
        """
        tools = [t for t in tools if not t.named]
        n = len(samples)
        step = -(-n // MAX_REASONED) if n else 1
        few = samples.subset(np.arange(0, n, step))
        why = np.full(len(few), Reason.CORNER, dtype=object)
        why[~self._seen(few, axes)] = Reason.UNDERCUT
        tries = [(Reason.FIXTURE, tools, self.bare)] if self.clamped else []
        tries += [(Reason.HOLDER, [replace(t, holder=()) for t in tools], self.obstacles),
                  (Reason.SHANK, [_cutter(t) for t in tools], self.obstacles)]
        for word, bodies, tree in tries:
            rows = np.flatnonzero(why == Reason.CORNER)
            why[rows[self._coverage(bodies, tree).reached(few.subset(rows), axes).any(axis=1)]] = word
        for tool in (_cutter(t) for t in tools if t.tip_curvature <= 0.0):
            rows = np.flatnonzero(why == Reason.CORNER)
            near = approach(self.obstacles, tool, self.inputs.clearances, few.points[rows], few.normals[rows], axes,
                            self._lift, self.inputs.quality.stock_allowance_mm)
            why[rows[near.any(axis=1)]] = Reason.SHARP_CORNER
        return np.repeat(why, step)[:n]

    @property
    def _lift(self) -> float:
        """Distance within which a touch counts where a reason is looked for, mm."""
        return 0.5 * self.inputs.quality.scallop_height_mm

    def _coverage(self, tools: Sequence[ToolBody], tree: TriangleTree) -> AxisCoverage:
        quality = self.inputs.quality
        return AxisCoverage(tree, tools, self.inputs.clearances, quality.scallop_height_mm, self._lift,
                            quality.stock_allowance_mm)

    def _seen(self, samples: SurfaceSamples, axes: F64) -> BOOL:
        """(n,) bool: some axis looks at the sample with nothing of the part between."""
        out = np.zeros(len(samples), np.bool_)
        for axis in axes:
            rows = np.flatnonzero(~out & (samples.normals @ axis > SEEN))
            if len(rows):
                start = samples.points[rows] + SKIN * samples.normals[rows]
                out[rows] = first_hits(self.bare, start, axis, 1e-4)[1] < 0
        return out


def _cutter(tool: ToolBody) -> ToolBody:
    """The cutting part alone."""
    return replace(tool, shank_diameter=2.0 * tool.widest_radius, holder=())


__all__ = ["ToolTouch"]
