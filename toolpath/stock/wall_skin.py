"""Skins that earlier passes left on a wall, compared with neck, shank and holder of a tilted tool.

The lattice of the stock does not show a skin on a wall thinner than a step, since it stands between two nodes. A neck
often follows its flutes closer than that to the wall (0.07 mm is usual for a tool of 1.5 mm). It rubs on the skin where
a pass above was left out or raised. The samples of the zone record such skins: their residual is measured pass by pass,
and where no pass came near, a skin may be as thick as a step.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.kernels.leaning import near
from toolpath.stock.residual_map import ResidualMap
from zones.reach.assembly import Clearances, Disc


class Skins:
    """Skins on the samples of a zone, lowered pass by pass.

    residual : ResidualMap of the zone, which is lowered
    finished : mm; samples with no more left count as the part, whose clearance is checked elsewhere
    thickest : mm, possible skin on a sample that no pass came near: a step of the lattice of the stock
    """

    def __init__(self, residual: ResidualMap, finished: float, thickest: float) -> None:
        self.residual, self.finished, self.thickest = residual, finished, thickest
        self._standing: tuple[F64, F64] | None = None  # places with a skin and its thickness, until the next cut

    def copied(self) -> Skins:
        """A copy with skins of its own."""
        return Skins(self.residual.copied(), self.finished, self.thickest)

    def become(self, other: Skins) -> None:
        """Takes over the skins of a copy."""
        self.residual, self._standing = other.residual, other._standing

    def cut_leaning(self, tips: F64, axes: F64, tool: ToolBody) -> None:
        """Lower the skins by poses, as ``ResidualMap.cut_leaning``.

        tips, axes : (m, 3) float64, access frame, mm and unit
        """
        self.residual.cut_leaning(tips, axes, tool)
        self._standing = None

    def near(self, tips: F64, axes: F64, tool: ToolBody, discs: Sequence[Disc], clear: Clearances) -> NDArray[np.bool_]:
        """Whether neck, shank or holder, with their clearance, may be in a skin at poses, (n,) bool.

        tips, axes : (n, 3) float64, mm and unit, access frame
        discs      : shank and holder with their clearance
        """
        if self._standing is None:
            rows = np.flatnonzero(self.residual.residual > self.finished)
            self._standing = self.residual.points[rows], np.minimum(self.residual.residual[rows], self.thickest)
        out = np.zeros(len(tips), np.bool_)
        near(np.ascontiguousarray(tips), np.ascontiguousarray(axes), *self._standing, behind(tool, discs, clear), out)
        return out


def behind(tool: ToolBody, discs: Sequence[Disc], clear: Clearances) -> F64:
    """Cylinders that follow the flutes, (b, 3) float64, mm, frame of the tool: radius with clearance, lower and upper
    height."""
    rows = [(d.radius, d.height, np.inf) for d in discs]
    if tool.neck_length > tool.flute_length:
        rows.append((0.5 * tool.neck_diameter + tool.neck_clearance(clear.neck), tool.flute_length, tool.neck_length))
    return np.array(rows).reshape(-1, 3)
