"""Findings of a proof that the next plan of the same job avoids.

A planner decides by estimates: it knows the stock at the nodes of a lattice, a ramp by the slope of its line, a wall by
its profile. Where an estimate is wrong the proof reports the place. The next plan reacts in this order.

- A place that was cut too deep: the tool goes there in thinner layers, and past it at the feed of the cut.
- A place where that does not help, or where the tool met something besides stock under its end: lines leave it out.
  The material there counts as left.
- A sample with too much material left: the plan aims lower there, and gives it up where that fails again.
- A thin wall without support: all tools go down in lower bands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import dense

CARE = 0.5  # share of layer depth and ramp slope that is used near a place in ``dug``
CAREFUL = 1.0  # radii: a line this near a place in ``dug``, in plan, goes there
BARRED = 0.3  # radii: a line this near a place in ``barred`` leaves it out
MIN_BARRED = 0.2  # mm
CROWDED = 0.75  # radii: a line this near a place in ``packed`` is skimmed first
CLOSER = 0.7  # factor on the thickness of a wall, each time it was found without support
STRICTER = 0.5  # factor on the aimed residual where more stayed than the plan had measured


@dataclass(frozen=True, eq=False)
class Counterexamples:
    """Findings by tool id and by zone id.

    The first three hold tip places by tool id, (n, 3) float64, mm, in the frame of the plan. ``left`` and ``lost`` hold
    (n,) int64, index into the checks of a zone, by zone id.

    dug    : the descent took more than one layer at once
    barred : the tool must not go there
    packed : too much of the cutter was in stock
    left   : more material stayed than allowed
    lost   : more material stayed a second time; the plan gives these samples up
    unheld : walls that were finished without support, with a smaller thickness where support has to be nearer
    """

    dug: Mapping[str, F64] = field(default_factory=dict)
    barred: Mapping[str, F64] = field(default_factory=dict)
    packed: Mapping[str, F64] = field(default_factory=dict)
    left: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    lost: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    unheld: tuple[HighWall, ...] = ()

    def care(self, tool: ToolBody, points: F64) -> float:
        """Share of layer depth and ramp slope that a line may use; 1 where the proof found nothing near it.

        points : (n, 3) float64, mm, tips in the frame of the plan
        """
        if tool.id not in self.dug:
            return 1.0
        way = dense(points, 0.25 * tool.radius) if len(points) > 1 else points
        return CARE if _near(self.dug[tool.id], way, CAREFUL * tool.radius, plan=True).any() else 1.0

    def bars(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """Whether tips lie where the tool must not go, (n,) bool.

        points : (n, 3) float64, mm, tips in the frame of the plan
        """
        return _near(self.barred.get(tool.id), points, max(BARRED * tool.radius, MIN_BARRED))

    def crowds(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """Whether tips lie where too much of the cutter was in stock, (n,) bool.

        points : (n, 3) float64, mm, tips in the frame of the plan
        """
        return _near(self.packed.get(tool.id), points, CROWDED * tool.radius)

    def aims(self, zone: str, aim: float, count: int) -> F64:
        """Residual that the plan aims at for each sample of a zone: ``aim``, or less where too much stayed.

        zone  : id of the zone
        aim   : mm
        count : number of samples

        Returns (count,) float64, mm; -inf for samples that are given up, so that they always count as left.
        """
        out = np.full(count, aim)
        out[self.left.get(zone, [])] *= STRICTER
        out[self.lost.get(zone, [])] = -np.inf
        return out


NONE = Counterexamples()


def _near(places: F64 | None, points: F64, radius: float, plan: bool = False) -> NDArray[np.bool_]:
    out = np.zeros(len(points), np.bool_)
    for place in () if places is None else places:
        off = points - place
        out |= np.linalg.norm(off[:, :2] if plan else off, axis=1) <= radius
    return out


__all__ = ["NONE", "Counterexamples"]


@dataclass(frozen=True)
class HighWall:
    """A thin wall that needs support while it is finished.

    top, bottom : mm, heights between which it stands, access frame
    thickness   : mm
    """

    top: float
    bottom: float
    thickness: float
