"""What earlier passes left on a wall, held against neck, shank and holder of a leaning tool.

The lattice of the stock does not show a skin on a wall that is thinner than a step: it stands between two of its nodes.
A neck that follows its flutes closer than that to the wall (0.07 mm is usual for a tool of 1.5 mm) rubs on it, where a
pass above was left out or raised. Samples of the zone know of such skins: what stands on them was measured pass by
pass, and where no pass came near it may be as thick as a step.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.kernels.skins import near
from toolpath.stock.residual_map import ResidualMap
from zones.reach.assembly import Clearances, Disc


class Skins:
    """What stands on the samples of a zone, lowered pass by pass.

    residual : ResidualMap of the zone; it is taken over and lowered
    finished : mm; samples on which no more is left count as the part, whose clearance is asked elsewhere
    most     : mm, what may stand unseen on a sample no pass came near: a step of the lattice of the stock
    """

    def __init__(self, residual: ResidualMap, finished: float, most: float) -> None:
        self.residual, self.finished, self.most = residual, finished, most
        self._told: tuple[F64, F64] | None = None

    def copied(self) -> Skins:
        """The same, to be lowered on its own."""
        return Skins(self.residual.copied(), self.finished, self.most)

    def become(self, other: Skins) -> None:
        """Take over what stands in a copy."""
        self.residual, self._told = other.residual, other._told

    def cut_leaning(self, tips: F64, axes: F64, tool: ToolBody) -> None:
        """Lower it by poses, as ``ResidualMap.cut_leaning``."""
        self.residual.cut_leaning(tips, axes, tool)
        self._told = None

    def near(self, tips: F64, axes: F64, tool: ToolBody, discs: Sequence[Disc], clear: Clearances) -> NDArray[np.bool_]:
        """(n,) bool: poses at which neck, shank or holder, with their clearance, may be in a skin.

        tips, axes : (n, 3) float64, mm and unit; discs : shank and holder with their clearance
        """
        if self._told is None:
            rows = np.flatnonzero(self.residual.residual > self.finished)
            self._told = self.residual.points[rows], np.minimum(self.residual.residual[rows], self.most)
        out = np.zeros(len(tips), np.bool_)
        near(np.ascontiguousarray(tips), np.ascontiguousarray(axes), *self._told, behind(tool, discs, clear), out)
        return out


def behind(tool: ToolBody, discs: Sequence[Disc], clear: Clearances) -> F64:
    """(b, 3) float64, mm: radius with clearance, and from where to where above the tip, of what follows the flutes."""
    rows = [(d.radius, d.height, np.inf) for d in discs]
    if tool.neck_length > tool.flute_length:
        rows.append((0.5 * tool.neck_diameter + tool.neck_clearance(clear.neck), tool.flute_length, tool.neck_length))
    return np.array(rows).reshape(-1, 3)
