"""Walls that earlier tools have brought to size: layers of a later tool need no rim there.

Places are in mm, access frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.passes.contours import dilated
from toolpath.passes.pass_family import FinishTarget
from zones.lattice import Lattice

WALL = 0.3  # part of a unit normal along the access: faces with more are no walls here
BANDS = 4  # of the height that a rim takes to size: samples stand in each of them where the wall is known all over
ROUGH_AROUND = 0.3  # diameters round a place that is not finished, within which no wall counts as finished


@dataclass(frozen=True, eq=False)
class SizedWalls:
    """Places of walls, as tips of a tool that touches them with its side: x, y, and the height of the place.

    sized   : (n, 3) float64, mm, with no more than the scallop left
    rough   : (m, 3) float64, mm, with more
    spacing : mm between neighbours
    reach   : mm round a rough place
    """

    sized: F64
    rough: F64
    spacing: float
    reach: float

    @classmethod
    def of(cls, tool: ToolBody, targets: Sequence[tuple[FinishTarget, NDArray[np.bool_]]]) -> SizedWalls:
        """From the samples of zones, mm.

        targets : FinishTargets, each with an (n,) bool array: whether a sample is finished
        """
        sized, rough, spacing = [np.zeros((0, 3))], [np.zeros((0, 3))], 0.0
        for target, done in targets:
            wall = np.abs(target.normals[:, 2]) < WALL
            level = target.normals[wall, :2]
            beside = target.points[wall].copy()
            beside[:, :2] += tool.radius * level / np.linalg.norm(level, axis=1)[:, None]
            sized.append(beside[done[wall]])
            rough.append(beside[~done[wall]])
            spacing = max(spacing, target.spacing)
        return cls(np.vstack(sized), np.vstack(rough), spacing, ROUGH_AROUND * tool.diameter)

    def along(self, lattice: Lattice, low: float, high: float) -> NDArray[np.bool_]:
        """Where a tool touches walls that are finished all over between two heights, mm, (ny, nx) bool."""
        out = np.ones((lattice.ny, lattice.nx), np.bool_)
        near = (self.spacing + lattice.step) / lattice.step
        for k in range(BANDS):
            a, b = (low + (high - low) * t / BANDS for t in (k, k + 1))
            out &= dilated(lattice.mask(_within(self.sized, a, b)), near)
        around = dilated(lattice.mask(_within(self.rough, low, high)), near + self.reach / lattice.step)
        return out & ~around


def _within(places: F64, low: float, high: float) -> F64:
    """The places (n, 3), mm, between two heights, in plan."""
    return places[(places[:, 2] >= low) & (places[:, 2] <= high), :2]
