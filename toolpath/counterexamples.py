"""What a proof found wrong with a plan, as the next plan of the same job takes it into account.

A planner decides by estimates: the stock is known at the nodes of a lattice, a ramp by the slope of its line, a wall by
its profile. Where one is wrong the proof shows the place. Planned again, the tool goes there in thinner skins; where
that does not help, or what was met is not stock under its end, its lines leave the place out, and what they do not
finish counts as left. A sample at which more stayed is aimed lower at, and given up where that is no help either. For a
thin wall that lacked support all tools go down in lower bands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import dense

CARE = 0.5  # of the skin, and of the slope of a ramp, near a place where these were too much
CAREFUL = 1.0  # of the radius round a place, in plan, within which a line is one that goes there
BARRED = 0.3  # of the radius round a place: what of a line is left out
MIN_BARRED = 0.2  # mm
CROWDED = 0.75  # of the radius round a place: what of a line is skimmed first
CLOSER = 0.7  # of its thickness that a wall counts as, each time it was found without support
STRICTER = 0.5  # of what is aimed at, where more stayed than the plan had measured


@dataclass(frozen=True, eq=False)
class Counterexamples:
    """Places of the tip, frame of the plan, by tool id, (n, 3) float64, mm, and samples by zone id.

    dug    : where more than a skin was taken going down
    barred : where the tool must not go
    packed : where too much of the cutter was in stock
    left   : (n,) int64, samples of a zone's checks at which more stayed than allowed
    lost   : (n,) int64, those at which it did so again: given up
    unheld : walls that were finished without support, thinner than they are where that has to be nearer
    """

    dug: Mapping[str, F64] = field(default_factory=dict)
    barred: Mapping[str, F64] = field(default_factory=dict)
    packed: Mapping[str, F64] = field(default_factory=dict)
    left: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    lost: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    unheld: tuple[HighWall, ...] = ()

    def care(self, tool: ToolBody, points: F64) -> float:
        """What share of skin and slope a line through points (n, 3), mm, may have: 1 where nothing was found."""
        if tool.id not in self.dug:
            return 1.0
        way = dense(points, 0.25 * tool.radius) if len(points) > 1 else points
        return CARE if _near(self.dug[tool.id], way, CAREFUL * tool.radius, plan=True).any() else 1.0

    def bars(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """(n,) bool: which of tips (n, 3), mm, are where the tool must not go."""
        return _near(self.barred.get(tool.id), points, max(BARRED * tool.radius, MIN_BARRED))

    def crowds(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """(n,) bool: which of tips (n, 3), mm, are where too much of the tool was in stock."""
        return _near(self.packed.get(tool.id), points, CROWDED * tool.radius)

    def aims(self, zone: str, aim: float, count: int) -> F64:
        """(count,) mm: what is aimed at at the samples of a zone, ``aim`` or, where too much stayed, less.

        At those given up it is less than anything, so they count as left whatever the plan measures there.
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
    """A wall that is to keep its support.

    top, bottom : mm, heights between which it stands, in the frame of the access; thickness : mm
    """

    top: float
    bottom: float
    thickness: float
