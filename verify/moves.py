"""Moves: the straight steps of a program as arrays. Every check of the proof takes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import SetupError
from geometry.kernels.cutter_sizes import CutterSizes
from geometry.mesh import F64, I32
from geometry.tool_body import ToolBody
from verify.kernels.tables import MoveArrays
from verify.tool_axes import ToolAxes

Progress = Callable[[float], None]
BOW = 5e-4
FLUTE_ROUNDING = 1e-9  # mm, of the height of a corner: a cone's comes from a tangent


@dataclass(frozen=True, eq=False)
class Moves:
    """Straight moves of the tool tip in the setup frame, in program order.

    start, end : (m, 3) float64, mm
    feed       : (m,) bool, False for a rapid
    tool       : (m,) int32, index, place in the sequence of tools
    axes       : tool axes, None where all are +Z
    stray      : (m,) float64, mm, how far a rapid may leave its straight way (``verify.checks.dogleg_turns``), or None
    """

    start: F64
    end: F64
    feed: NDArray[np.bool_]
    tool: I32
    axes: ToolAxes | None = None
    stray: F64 | None = None

    def __len__(self) -> int:
        return len(self.start)

    @property
    def arrays(self) -> MoveArrays:
        """The moves for kernels, without axes."""
        return MoveArrays(np.ascontiguousarray(self.start), np.ascontiguousarray(self.end), self.feed, self.tool)

    def only(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Moves:
        """The moves where ``chosen`` (m,) bool is true, or those of its rows, (k,) int64, index."""
        axes = None if self.axes is None else self.axes.only(chosen)
        return Moves(self.start[chosen], self.end[chosen], self.feed[chosen], self.tool[chosen], axes,
                     None if self.stray is None else self.stray[chosen])

    def parted(self, count: NDArray[np.int64]) -> tuple[Moves, NDArray[np.int64]]:
        """Each move in even pieces.

        count : (m,) int64, dimensionless, pieces of each move

        Returns the p pieces as moves, and (p,) int64, index, the move of each.
        """
        of = np.repeat(np.arange(len(self)), count)
        pieces = count[of]
        nth = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
        share, way = nth / pieces, (self.end - self.start)[of]
        # the last piece ends where the move does, to the last digit
        ends = np.where((nth + 1 == pieces)[:, None], self.end[of],
                        self.start[of] + ((nth + 1) / pieces)[:, None] * way)
        axes = None if self.axes is None else self.axes.parted(of, share, pieces)
        return Moves(self.start[of] + share[:, None] * way, ends, self.feed[of], self.tool[of], axes,
                     None if self.stray is None else self.stray[of]), of


def cutter_table(tools: Sequence[ToolBody]) -> F64:
    """Sizes of the cutting parts of k tools, as rows of ``geometry.kernels.cutter_sizes.CutterSizes``.

    Returns (k, 9) float64, mm, in the tool frame; column 5, a tangent, is dimensionless.

    Flutes that end at the corner to the rounding of its height reach to it.

    Raises
    ------
    SetupError
        Code flute_too_short: the flutes end inside the corner of the cutting part.
    """
    corner = [2.0 * t.corner_radius if t.end == "bull" else max(t.corner_end[1], t.cone_height) for t in tools]
    for tool, corner_height in zip(tools, corner, strict=True):
        if tool.flute_length < corner_height - FLUTE_ROUNDING:
            raise SetupError(
                f"{tool.id}: the flute length {tool.flute_length} mm ends inside the corner of the cutting part",
                code="flute_too_short", subjects=(tool.id,), measured=tool.flute_length, limit=corner_height,
                remedy="give the flute length measured from the tip")
    return np.array([cutter_sizes(t, max(t.flute_length, high)) for t, high in zip(tools, corner, strict=True)],
                    dtype=np.float64).reshape(-1, 9)


def cutter_sizes(tool: ToolBody, length: float | None = None) -> CutterSizes:
    """Sizes of the cutting part of a tool, mm, in the tool frame.

    length : mm, its height over the tip; None: the flute length
    """
    high, arcs = tool.flute_length if length is None else length, tool.arcs
    if arcs is not None:
        return CutterSizes(tool.radius, tool.radius - arcs.flat, high, arcs.high, arcs.low, 0.0, arcs.out, arcs.up,
                           arcs.bow)
    if tool.taper <= 0.0:
        return CutterSizes(tool.radius, tool.corner_width, high, tool.cone_height)
    wide, low = tool.corner_end
    radius, flat = wide + tool.taper * (high - low), tool.radius - tool.corner_width
    return CutterSizes(radius, radius - flat, high, high, tool.corner_width, tool.taper)
